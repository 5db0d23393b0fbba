// People while time moves, where the processor draws: one mesh of few triangles for everybody, moved
// and lit here, drawn at once. At rest they are drawn as elsewhere.

const QUICK = [`#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec3 light;
uniform mat4 projection; uniform float brightness; out vec3 v_light;
void main() { gl_Position = projection * vec4(place, 1.0); v_light = brightness * light; }`, `#version 300 es
precision mediump float;
in vec3 v_light; out vec4 o;
void main() { o = vec4(v_light, 1.0); }`];

const QUICK_EYES = [`#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec3 light; layout(location=2) in vec3 detail; layout(location=3) in uvec4 surface;
uniform mat4 projection; out vec3 v_light; out vec3 v_detail; flat out uvec4 v_surface;
void main() { gl_Position = projection * vec4(place, 1.0); v_light = light; v_detail = detail; v_surface = surface; }`, PERSON[1]];

const LINEAR = Float32Array.from({length: 256}, (_, i) => Math.pow(i / 255, 2.2));
const CODES = Uint8Array.from({length: 2049}, (_, i) => { // light of 0 to 4, as LIGHT's codes()
  const l = i / 512, soft = l < 0.5 ? l : 1 - 0.5 * Math.exp(1 - 2 * l);
  return Math.round(255 * Math.pow(soft, 1 / 2.2));
});

// People who are smaller in the picture than so many pixels are drawn by meshes whose vertices within
// so many metres are one.
const COARSER = [[150, 0.045], [90, 0.07], [50, 0.11], [28, 0.16]];

// A mesh's corners with every triangle's front outward, by the normals of its corners; those from `until` on have two sides.
function outward(index, place, normal, until) {
  const out = index.slice();
  for (let k = 0; k < until; k += 3) {
    const a = 3 * out[k], b = 3 * out[k + 1], c = 3 * out[k + 2], n = [0, 1, 2].map(x => [0, 1, 2].reduce((s, j) => s + normal[4 * out[k + j] + x], 0));
    const ux = place[b] - place[a], uy = place[b + 1] - place[a + 1], uz = place[b + 2] - place[a + 2];
    const vx = place[c] - place[a], vy = place[c + 1] - place[a + 1], vz = place[c + 2] - place[a + 2];
    if ((uy * vz - uz * vy) * n[0] + (uz * vx - ux * vz) * n[1] + (ux * vy - uy * vx) * n[2] < 0) [out[k + 1], out[k + 2]] = [out[k + 2], out[k + 1]];
  }
  return out;
}

// The mesh of somebody far away: vertices that are near each other at rest are one, left and right apart.
// Clothes over skin and their two sides become the same triangle there, and have a front alone.
function coarser({n, bone, weight, rest, normal, colour, index, eyeFrom}, cell) {
  const numbers = new Map(), of = new Int32Array(n), picks = [];
  for (let v = 0; v < n; v++) {
    const key = [0, 1, 2].map(a => Math.floor(rest[3 * v + a] / cell)).join();
    if (!numbers.has(key)) { numbers.set(key, picks.length); picks.push(v); }
    of[v] = numbers.get(key);
  }
  const corners = [], there = new Set();
  for (let k = 0; k < eyeFrom; k += 3) {
    const triangle = [of[index[k]], of[index[k + 1]], of[index[k + 2]]], [a, b, c] = triangle, key = [...triangle].sort((p, q) => p - q).join();
    if (a === b || b === c || a === c || there.has(key)) continue;
    there.add(key);
    corners.push(a, b, c);
  }
  const pick = (from, k) => from.constructor.from(picks.flatMap(v => [...from.subarray(k * v, k * v + k)]));
  const coarse = {n: picks.length, bone: pick(bone, 4), weight: pick(weight, 4), rest: pick(rest, 3), normal: pick(normal, 4), colour: pick(colour, 4),
    morph: new Int16Array(picks.length).fill(-1), deltas: null, openFrom: corners.length, eyeFrom: corners.length};
  return {...coarse, index: outward(Uint16Array.from(corners), coarse.rest, coarse.normal, corners.length)};
}

class QuickPeople {
  constructor(drawing, cast) {
    this.drawing = drawing;
    const gl = drawing.gl, models = this.models = cast.map(k => drawing.lightMesh(k));
    this.from = [0]; // where a person's light is; where their corners are in this picture is `begin`
    for (const m of models) this.from.push(this.from[this.from.length - 1] + m.n);
    const n = this.from[models.length];
    this.begin = new Uint32Array(models.length);
    this.light = new Uint8Array(4 * n);
    this.light32 = new Uint32Array(this.light.buffer);
    this.lit = new Uint8Array(models.length);
    this.next = 0;
    // Of everybody in the picture, one after the other: x, y, z and light; of eyes also what they are painted by.
    this.corners = new Float32Array(4 * n);
    this.corners32 = new Uint32Array(this.corners.buffer);
    this.index = new Uint32Array(models.reduce((s, m) => s + m.index.length, 0));
    this.eyes = new Float32Array(8 * models.reduce((s, m) => s + m.index.length - m.eyeFrom, 0));
    this.eyes32 = new Uint32Array(this.eyes.buffer);
    this.surface32 = models.map(m => new Uint32Array(m.surface.slice().buffer));
    this.skin = this.dynamic([3, gl.FLOAT, false, 16, 0], [4, gl.UNSIGNED_BYTE, true, 16, 12]);
    this.eye = this.dynamic([3, gl.FLOAT, false, 32, 0], [4, gl.UNSIGNED_BYTE, true, 32, 12], [3, gl.FLOAT, false, 32, 16]);
    gl.enableVertexAttribArray(3);
    gl.vertexAttribIPointer(3, 4, gl.UNSIGNED_BYTE, 32, 28);
    gl.bindVertexArray(this.skin.vao);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices = gl.createBuffer());
  }

  dynamic(...pointers) {
    const gl = this.drawing.gl, vao = gl.createVertexArray(), buffer = gl.createBuffer();
    gl.bindVertexArray(vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    pointers.forEach((pointer, k) => { gl.enableVertexAttribArray(k); gl.vertexAttribPointer(k, ...pointer); });
    return {vao, buffer};
  }

  // Where everybody's vertices are; `bones` as in `drawPeople`.
  move(i, m, bones, joints, shapes) {
    const {n, rest, bone, weight, morph, deltas} = m, out = this.corners, base = 12 * joints * i;
    let o = 4 * this.begin[i];
    const s = shapes.subarray(SHAPES * i, SHAPES * (i + 1)), shaped = deltas && s.some(v => Math.abs(v) > 0.003);
    for (let v = 0; v < n; v++, o += 4) {
      let x = rest[3 * v], y = rest[3 * v + 1], z = rest[3 * v + 2];
      if (shaped && morph[v] >= 0) for (let k = 0, d = 3 * SHAPES * morph[v]; k < SHAPES; k++, d += 3) {
        x += s[k] * deltas[d]; y += s[k] * deltas[d + 1]; z += s[k] * deltas[d + 2];
      }
      let px = 0, py = 0, pz = 0;
      for (let k = 4 * v; k < 4 * v + 4; k++) {
        const w = weight[k];
        if (w === 0) break;
        const b = base + bone[k];
        px += w * (bones[b] * x + bones[b + 1] * y + bones[b + 2] * z + bones[b + 3]);
        py += w * (bones[b + 4] * x + bones[b + 5] * y + bones[b + 6] * z + bones[b + 7]);
        pz += w * (bones[b + 8] * x + bones[b + 9] * y + bones[b + 10] * z + bones[b + 11]);
      }
      out[o] = px; out[o + 1] = py; out[o + 2] = pz;
    }
  }

  // Light of a person as they stand; it changes little from picture to picture.
  shine(i, m, bones, joints, room) {
    const {n, normal, bone, colour} = m, lamps = room ? room.lamps.slice(0, 8) : [];
    const sky = lamps.length ? room.sky : [0.8, 0.8, 0.82], ground = lamps.length ? room.ground : [0.5, 0.48, 0.46];
    const base = 12 * joints * i, place = this.corners, out = this.light, begin = this.begin[i];
    for (let v = 0; v < n; v++) {
      const b = base + bone[4 * v], x = normal[4 * v] / 127, y = normal[4 * v + 1] / 127, z = normal[4 * v + 2] / 127;
      const nx = bones[b] * x + bones[b + 1] * y + bones[b + 2] * z, ny = bones[b + 4] * x + bones[b + 5] * y + bones[b + 6] * z;
      const nz = bones[b + 8] * x + bones[b + 9] * y + bones[b + 10] * z, up = 0.5 + 0.5 * ny;
      const o = 4 * (begin + v);
      let r = ground[0] + up * (sky[0] - ground[0]), g = ground[1] + up * (sky[1] - ground[1]), l = ground[2] + up * (sky[2] - ground[2]);
      for (const lamp of lamps) {
        let tx = -lamp.axis[0], ty = -lamp.axis[1], tz = -lamp.axis[2], share = 1;
        if (lamp.kind > 0) {
          tx = lamp.place[0] - place[o]; ty = lamp.place[1] - place[o + 1]; tz = lamp.place[2] - place[o + 2];
          const squared = Math.max(tx * tx + ty * ty + tz * tz, 0.04), by = 1 / Math.sqrt(squared);
          share = 1 / squared; tx *= by; ty *= by; tz *= by;
          if (lamp.kind === 1) {
            const c = lamp.cos, along = -(tx * lamp.axis[0] + ty * lamp.axis[1] + tz * lamp.axis[2]);
            const inside = Math.min(1, Math.max(0, (along - c) / (0.3 * Math.max(1 - c, 1e-6))));
            share *= inside * inside * (3 - 2 * inside);
          }
        }
        share *= Math.max(0, (nx * tx + ny * ty + nz * tz + 0.2) / 1.44);
        r += lamp.colour[0] * share; g += lamp.colour[1] * share; l += lamp.colour[2] * share;
      }
      const c = 4 * v, p = 4 * (this.from[i] + v);
      out[p] = CODES[Math.min(2048, 512 * r * LINEAR[colour[c]]) | 0];
      out[p + 1] = CODES[Math.min(2048, 512 * g * LINEAR[colour[c + 1]]) | 0];
      out[p + 2] = CODES[Math.min(2048, 512 * l * LINEAR[colour[c + 2]]) | 0];
    }
  }

  // Corners of the triangles of somebody that face the eye, from `end` on; returns the end after them.
  facing(i, m, eye, end) {
    const {index, openFrom, eyeFrom} = m, from = this.begin[i], place = this.corners, out = this.index;
    for (let k = 0; k < openFrom; k += 3) {
      const va = from + index[k], vb = from + index[k + 1], vc = from + index[k + 2], a = 4 * va, b = 4 * vb, c = 4 * vc;
      const x = place[a], y = place[a + 1], z = place[a + 2];
      const ux = place[b] - x, uy = place[b + 1] - y, uz = place[b + 2] - z, vx = place[c] - x, vy = place[c + 1] - y, vz = place[c + 2] - z;
      if ((uy * vz - uz * vy) * (eye[0] - x) + (uz * vx - ux * vz) * (eye[1] - y) + (ux * vy - uy * vx) * (eye[2] - z) <= 0) continue;
      out[end++] = va; out[end++] = vb; out[end++] = vc;
    }
    for (let k = openFrom; k < eyeFrom; k++) out[end++] = from + index[k];
    return end;
  }

  // The eyes of somebody, from corner `end` on; returns the end after them.
  look(i, m, end) {
    for (let k = m.eyeFrom; k < m.index.length; k++, end++) {
      const v = m.index[k], from = 4 * (this.begin[i] + v), o = 8 * end;
      for (let a = 0; a < 4; a++) this.eyes32[o + a] = this.corners32[from + a];
      for (let a = 0; a < 3; a++) this.eyes[o + 4 + a] = m.detail[3 * v + a];
      this.eyes32[o + 7] = this.surface32[i][v];
    }
    return end;
  }

  // Those `visible` of a scene's people as they stand, seen in a view of `height` pixels.
  draw(visible, {bones, shapes, place, data: {joints}}, view, height, room, brightness) {
    if (!visible.length) return;
    const d = this.drawing, gl = d.gl, w = view.world;
    this.next = (this.next + 1) % this.models.length;
    let vertices = 0, corners = 0, eyes = 0;
    for (const i of visible) {
      const depth = -(w[2] * place[3 * i] + w[6] * place[3 * i + 1] + w[10] * place[3 * i + 2] + w[14]);
      const fine = this.models[i], px = 1.8 * height / (2 * view.top * Math.max(depth, 0.01));
      const step = COARSER.filter(([most]) => px < most).length, m = step ? fine.coarse[step - 1] : fine;
      this.begin[i] = vertices;
      this.move(i, m, bones, joints, shapes);
      if (this.lit[i] !== 1 + step || i === this.next) { this.shine(i, m, bones, joints, room); this.lit[i] = 1 + step; }
      for (let v = 0, o = 4 * vertices + 3; v < m.n; v++, o += 4) this.corners32[o] = this.light32[this.from[i] + v];
      corners = this.facing(i, m, view.at, corners);
      if (!step) eyes = this.look(i, m, eyes);
      vertices += m.n;
    }
    d.use('quick', view.projection, room, brightness);
    gl.bindVertexArray(this.skin.vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.skin.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.corners, gl.STREAM_DRAW, 0, 4 * vertices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.index, gl.STREAM_DRAW, 0, corners);
    gl.drawElements(gl.TRIANGLES, corners, gl.UNSIGNED_INT, 0);
    if (!eyes) return;
    const at = d.use('eyes', view.projection, room, brightness);
    gl.uniform3fv(at.eye_light, room && room.lamps.length ? [0.86, 0.85, 0.83] : [0.85, 0.85, 0.85]);
    gl.uniform1i(at.look, 2);
    gl.bindVertexArray(this.eye.vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.eye.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.eyes, gl.STREAM_DRAW, 0, 8 * eyes);
    gl.drawArrays(gl.TRIANGLES, 0, eyes);
  }
}

// What the viewer draws besides people: rooms whose light is ready, plain things.

const PIECE = 24; // triangles of a room that are left out together
const SPECK_PX = 1; // what is smaller is left out while time moves

const THING = [`#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec3 normal; layout(location=2) in vec3 colour; layout(location=3) in vec2 uv;
uniform mat4 projection; uniform mat4 model; uniform vec4 paint; uniform float glow; out vec3 v_light; out vec2 v_uv;
${LIGHT}
void main() {
  vec4 world = model * vec4(place, 1.0);
  vec3 n = normalize(mat3(model) * normal);
  gl_Position = projection * world;
  vec3 own = pow(mix(colour, paint.rgb, paint.a), vec3(2.2));
  v_light = codes(own * mix(light_at(world.xyz, n, 0.1), vec3(1.0), glow));
  v_uv = uv;
}`, `#version 300 es
precision highp float;
in vec3 v_light; in vec2 v_uv; uniform sampler2D picture; uniform int look; uniform float brightness; out vec4 o;
void main() {
  vec3 c = v_light;
  if (look > 0) c *= texture(picture, v_uv).rgb;
  o = vec4(c * brightness, 1.0);
}`];

// A room that was drawn before, with how far everything in it is.
const CACHE = [`#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1); }`,
`#version 300 es
precision highp float; precision highp sampler2D;
uniform sampler2D picture; uniform sampler2D depth; out vec4 o;
void main() {
  o = texelFetch(picture, ivec2(gl_FragCoord.xy), 0);
  gl_FragDepth = texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r;
}`];

class Drawing extends Painter {
  constructor(canvas, content, onChange = () => {}) {
    // Where the processor draws, smooth edges would cost it most of its time.
    const slow = isProcessor(rendererName());
    super(canvas, {antialias: !slow, programs: {person: [PERSON, '#define TEXTURED'], quick: [QUICK], eyes: [QUICK_EYES], thing: [THING],
      sheet: [SHEET], around: [SHEET, '#define AROUND'], cache: [CACHE], room: [ROOM], holes: [ROOM, '#define HOLES']}});
    this.slow = slow;
    this.content = content;
    this.pictures = content.header.textures.map(() => this.white);
    this.people = content.header.people.map(() => null);
    this.rooms = content.header.rooms.map(() => null);
    this.solids = {ball: this.solid(slow ? ball(6, 8) : ball(10, 14)), rod: this.solid(rod(slow ? 6 : 12)), box: this.solid(box())};
    this.onChange = onChange;
    this.missing = 0; // pictures of people, things and stimuli that cannot be decoded: white
    this.waiting = new Set(); // for pictures that are being decoded
    this.ready = Promise.all(content.header.textures.map((t, k) => this.load(t, k)));
  }

  // What is drawn changes when a promise is kept.
  wait(promise) {
    const done = promise.finally(() => { this.waiting.delete(done); this.onChange(); });
    this.waiting.add(done);
  }

  async load(texture, k) {
    const gl = this.gl;
    const image = await this.content.picture(texture.file, {premultiplyAlpha: texture.flat ? 'premultiply' : 'none'});
    if (!image) this.missing++;
    else if (texture.flat) this.takeFlat(image, k);
    else this.pictures[k] = this.picture(image, this.slow ? gl.NEAREST_MIPMAP_NEAREST : undefined);
  }

  // The number of a flat picture; in the place of the one that has it.
  takeFlat(image, number = this.pictures.push(this.white) - 1) {
    const gl = this.gl, before = this.pictures[number];
    this.pictures[number] = this.picture(image);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    if (before !== this.white) gl.deleteTexture(before);
    return number;
  }

  padded(ref) { const rows = this.content.plainRows(ref, 1); rows.stride = 4; return rows; }

  modelsOf(k) { return [this.person(k)]; }

  person(k) {
    if (this.people[k]) return this.people[k];
    const gl = this.gl, mesh = this.content.header.people[k], c = this.content;
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    this.buffer(0, c.rows(mesh.place), 3);
    this.buffer(1, this.padded(mesh.normal), 3, {normal: true});
    this.buffer(2, c.rows(mesh.detail), 3);
    this.buffer(3, this.padded(mesh.colour), 3, {normal: true});
    this.buffer(4, c.plainRows(mesh.surface), 4, {whole: true});
    this.buffer(5, c.plainRows(mesh.joints), 4, {whole: true});
    this.buffer(6, c.plainRows(mesh.weights), 4, {normal: true});
    this.buffer(7, c.flat(mesh.morph), 1, {whole: true});
    const index = c.flat(mesh.index), kind = this.indices(index), bytes = index.BYTES_PER_ELEMENT;
    const rows = c.rows(mesh.deltas), n = mesh.deltas.s[0], height = Math.max(1, Math.ceil(n / 64));
    const wide = 64 * SHAPES, texels = new Float32Array(wide * height * 4);
    for (let i = 0; i < n; i++) for (let m = 0; m < SHAPES; m++) for (let x = 0; x < 3; x++)
      texels[4 * ((i >> 6) * wide + (i & 63) * SHAPES + m) + x] = rows[3 * (i * SHAPES + m) + x];
    const deltas = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, deltas);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, wide, height, 0, gl.RGBA, gl.FLOAT, texels);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    // Runs that look alike are drawn at once.
    const runs = [];
    for (const [first, count, picture, twoSided, look] of mesh.runs) {
      const mode = look === 'eye' ? 2 : picture >= 0 ? 1 : 0, before = runs[runs.length - 1];
      if (before && mode === 0 && before.mode === 0 && before.first + before.count === first) before.count += count;
      else runs.push({first, count, picture: () => picture < 0 ? this.white : this.pictures[picture], mode});
    }
    return this.people[k] = {vao, kind, bytes, deltas, runs};
  }

  room(k) {
    if (this.rooms[k]) return this.rooms[k];
    const gl = this.gl, mesh = this.content.header.rooms[k], c = this.content;
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    this.buffer(0, c.rows(mesh.place), 3);
    this.buffer(1, c.rows(mesh.uv), 2);
    this.buffer(2, this.padded(mesh.light), 3, {normal: true});
    const kind = this.indices(c.flat(mesh.index));
    return this.rooms[k] = {vao, kind, runs: mesh.runs};
  }

  // The part of a room that lies in the picture and is no speck in it, as a room of its own: where the
  // processor draws, what lies outside costs it as much as what does not.
  roomInView(k, projection, height) {
    const gl = this.gl, mesh = this.content.header.rooms[k], c = this.content;
    const part = mesh.part ||= this.pieces(mesh);
    const planes = planesOf(projection);
    // Pixels that a metre takes a metre away.
    const scale = 0.5 * height * Math.hypot(projection[1], projection[5], projection[9]), ball = part.balls;
    let key = '';
    for (let i = 0, b = 0; i < part.count; i++, b += 4) {
      const x = ball[b], y = ball[b + 1], z = ball[b + 2], r = ball[b + 3];
      const depth = projection[3] * x + projection[7] * y + projection[11] * z + projection[15];
      part.shown[i] = isInFront(planes, x, y, z, r) && 2 * r * scale > SPECK_PX * (depth - r) ? 1 : 0;
      key += part.shown[i];
    }
    gl.bindVertexArray(part.vao);
    if (key === part.key) return part;
    part.key = key;
    const index = c.flat(mesh.index);
    let end = 0;
    part.runs = mesh.runs.map(([, , picture], run) => {
      const first = end;
      for (let i = part.from[run]; i < part.from[run + 1]; i++) if (part.shown[i]) {
        const piece = index.subarray(part.first[i], part.first[i] + part.length[i]);
        part.index.set(piece, end);
        end += piece.length;
      }
      return [first, end - first, picture];
    });
    gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 0, part.index, 0, end);
    return part;
  }

  // A room's triangles in pieces of a few, each with the ball round it (x, y, z, radius).
  pieces(mesh) {
    const gl = this.gl, c = this.content, place = c.rows(mesh.place), index = c.flat(mesh.index);
    const first = [], length = [], balls = [], from = [0];
    for (const [begin, count] of mesh.runs) {
      for (let i = begin; i < begin + count; i += 3 * PIECE) {
        const n = Math.min(3 * PIECE, begin + count - i), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
        for (let j = i; j < i + n; j++) for (let a = 0; a < 3; a++) {
          const v = place[3 * index[j] + a];
          low[a] = Math.min(low[a], v);
          high[a] = Math.max(high[a], v);
        }
        first.push(i);
        length.push(n);
        balls.push(...low.map((v, a) => (v + high[a]) / 2), Math.hypot(...low.map((v, a) => (high[a] - v) / 2)));
      }
      from.push(first.length);
    }
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    this.buffer(0, place, 3);
    this.buffer(1, c.rows(mesh.uv), 2);
    this.buffer(2, this.padded(mesh.light), 3, {normal: true});
    const copy = new index.constructor(index.length), kind = this.indices(copy);
    return {vao, kind, first, length, from, index: copy, balls: new Float32Array(balls), count: first.length,
      shown: new Uint8Array(first.length), key: '', runs: []};
  }

  solid({place, normal, index}) {
    const gl = this.gl, vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    this.buffer(0, new Float32Array(place), 3);
    this.buffer(1, new Float32Array(normal), 3);
    gl.vertexAttrib3f(2, 1, 1, 1);
    return {vao, kind: this.indices(new Uint16Array(index)), count: index.length};
  }

  thing(mesh) {
    if (mesh.buffers) return mesh.buffers;
    const gl = this.gl, vao = gl.createVertexArray(), c = this.content;
    gl.bindVertexArray(vao);
    this.buffer(0, c.rows(mesh.place), 3);
    this.buffer(1, this.padded(mesh.normal), 3, {normal: true});
    this.buffer(2, this.padded(mesh.colour), 3, {normal: true});
    this.buffer(3, c.rows(mesh.uv), 2);
    const index = c.flat(mesh.index);
    return mesh.buffers = {vao, kind: this.indices(index), count: index.length, picture: mesh.picture};
  }

  // Puts what `draw` draws, kept from its second time on, until `key` or the picture's size is another; tells
  // whether it did. What is not kept is drawn after the people, who hide some of it.
  drawCached(key, width, height, draw) {
    const gl = this.gl, whole = [key, width, height].join();
    if (whole !== this.cacheKey) {
      this.cacheKey = whole;
      return this.isKept = false;
    }
    const target = this.cacheTarget ||= {colour: gl.createTexture(), depth: gl.createTexture(), frame: gl.createFramebuffer(), vao: gl.createVertexArray()};
    if (!this.isKept) {
      this.isKept = true;
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
      for (const [texture, at, form, read, kind] of [[target.colour, gl.COLOR_ATTACHMENT0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE],
        [target.depth, gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT]]) {
        gl.activeTexture(gl.TEXTURE0);
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texImage2D(gl.TEXTURE_2D, 0, form, width, height, 0, read, kind, null);
        for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, at, gl.TEXTURE_2D, texture, 0);
      }
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      draw();
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
    const {p, at} = this.programs.cache;
    gl.useProgram(p);
    gl.bindVertexArray(target.vao);
    [[at.picture, target.colour], [at.depth, target.depth]].forEach(([place, texture], k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(place, k);
    });
    gl.depthFunc(gl.ALWAYS);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.depthFunc(gl.LESS);
    return true;
  }

  // `height` in pixels asks for the part in the picture alone, 0 for all of it.
  drawRoom(k, projection, brightness, height = 0) {
    const gl = this.gl, room = height ? this.roomInView(k, projection, height) : this.room(k);
    gl.bindVertexArray(room.vao);
    gl.activeTexture(gl.TEXTURE0);
    for (const name of ['room', 'holes']) {
      const runs = room.runs.filter(([, , picture]) => (name === 'holes') === (picture >= 0 && this.content.header.textures[picture].holes));
      if (!runs.length) continue;
      const at = this.use(name, projection, null, brightness);
      for (const [first, count, picture] of runs) {
        if (!count) continue;
        gl.bindTexture(gl.TEXTURE_2D, picture < 0 ? this.white : this.pictures[picture]);
        gl.uniform1i(at.look, picture < 0 ? 0 : 1);
        gl.drawElements(gl.TRIANGLES, count, room.kind, 4 * first);
      }
    }
  }

  // A person's mesh of few triangles, for `QuickPeople`.
  lightMesh(k) {
    const person = this.content.header.people[k], mesh = person.light, c = this.content;
    if (person.lightMesh) return person.lightMesh;
    const n = mesh.place.s[0], joints = c.plainRows(mesh.joints), packed = c.plainRows(mesh.weights);
    const bone = new Uint16Array(4 * n), weight = new Float32Array(4 * n);
    for (let v = 0; v < n; v++) { // heaviest first, so that the first 0 ends them
      const order = [0, 1, 2, 3].sort((a, b) => packed[4 * v + b] - packed[4 * v + a]);
      const total = Math.max(1, packed[4 * v] + packed[4 * v + 1] + packed[4 * v + 2] + packed[4 * v + 3]);
      order.forEach((j, k) => { bone[4 * v + k] = 12 * joints[4 * v + j]; weight[4 * v + k] = packed[4 * v + j] / total; });
    }
    const fine = {n, bone, weight, rest: c.rows(mesh.place), detail: c.rows(mesh.detail), normal: this.padded(mesh.normal),
      colour: this.padded(mesh.colour), surface: c.plainRows(mesh.surface), morph: c.flat(mesh.morph), deltas: c.rows(mesh.deltas),
      index: outward(c.flat(mesh.index), c.rows(mesh.place), this.padded(mesh.normal), mesh.openFrom), openFrom: mesh.openFrom, eyeFrom: mesh.eyeFrom};
    fine.coarse = COARSER.map(([, cell]) => coarser(fine, cell));
    return person.lightMesh = fine;
  }

  // Things: {solid or mesh, model, paint [r, g, b] 0 to 1, glow}.
  drawThings(things, projection, room, brightness) {
    if (!things.length) return;
    const gl = this.gl, at = this.use('thing', projection, room, brightness);
    for (const thing of things) {
      const buffers = thing.solid ? this.solids[thing.solid] : this.thing(thing.mesh);
      gl.bindVertexArray(buffers.vao);
      gl.uniformMatrix4fv(at.model, false, thing.model);
      gl.uniform4fv(at.paint, thing.paint ? [...thing.paint, 1] : [0, 0, 0, 0]);
      gl.uniform1f(at.glow, thing.glow || 0);
      const picture = buffers.picture ?? -1;
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, picture < 0 ? this.white : this.pictures[picture]);
      gl.uniform1i(at.look, picture < 0 ? 0 : 1);
      gl.drawElements(gl.TRIANGLES, buffers.count, buffers.kind, 0);
    }
  }

  // Flat pictures {at, turn, size, picture} over what is farther away, the last in front; with `around` {eye, turn} what
  // is seen from the eye through each of a picture all around, behind everything if asked for.
  drawSheets(sheets, projection, around = null) {
    const gl = this.gl, at = this.use(around ? 'around' : 'sheet', projection, null, 1);
    gl.bindVertexArray(this.noArrays ||= gl.createVertexArray());
    gl.activeTexture(gl.TEXTURE0);
    if (around) {
      const [w, ...v] = around.turn, back = [w, ...v.map(x => -x)];
      gl.uniform3fv(at.eye, around.eye);
      gl.uniformMatrix3fv(at.own, false, [[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap(axis => rotate(back, axis)));
    }
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    if (around?.isBehind) gl.disable(gl.DEPTH_TEST);
    for (const sheet of sheets) {
      gl.uniformMatrix4fv(at.model, false, modelMatrix(sheet.at, sheet.turn, [...sheet.size, 1]));
      gl.bindTexture(gl.TEXTURE_2D, this.pictures[sheet.picture]);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }
}

// What a projection shows lies in front of all of these planes (unit normal, distance), farther than it draws or not.
function planesOf(projection) {
  return [[0, 1], [0, -1], [1, 1], [1, -1], [2, 1]].map(([row, sign]) => {
    const plane = [0, 4, 8, 12].map(j => projection[3 + j] + sign * projection[row + j]), length = Math.hypot(plane[0], plane[1], plane[2]);
    return plane.map(v => v / length);
  });
}
const isInFront = (planes, x, y, z, radius) => planes.every(p => p[0] * x + p[1] * y + p[2] * z + p[3] > -radius);

function ball(rings, sides) {
  const place = [], index = [];
  for (let i = 0; i <= rings; i++) for (let j = 0; j <= sides; j++) {
    const a = Math.PI * i / rings, b = 2 * Math.PI * j / sides;
    place.push(Math.sin(a) * Math.cos(b), Math.cos(a), Math.sin(a) * Math.sin(b));
    if (i < rings && j < sides) {
      const k = i * (sides + 1) + j;
      index.push(k, k + 1, k + sides + 1, k + 1, k + sides + 2, k + sides + 1);
    }
  }
  return {place, normal: place, index};
}
function rod(sides) {
  const place = [], normal = [], index = [];
  for (let j = 0; j <= sides; j++) {
    const b = 2 * Math.PI * j / sides, x = Math.cos(b), z = Math.sin(b);
    place.push(x, 0, z, x, 1, z);
    normal.push(x, 0, z, x, 0, z);
    if (j < sides) { const k = 2 * j; index.push(k, k + 1, k + 2, k + 1, k + 3, k + 2); }
  }
  return {place, normal, index};
}
function box() {
  const place = [], normal = [], index = [];
  for (let axis = 0; axis < 3; axis++) for (const sign of [-1, 1]) {
    const n = [0, 0, 0], k = place.length / 3;
    n[axis] = sign;
    for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      const p = [0, 0, 0];
      p[axis] = sign; p[(axis + 1) % 3] = u; p[(axis + 2) % 3] = v;
      place.push(...p.map(x => x / 2));
      normal.push(...n);
    }
    index.push(k, k + 1, k + 2, k, k + 2, k + 3);
  }
  return {place, normal, index};
}

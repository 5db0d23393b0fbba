// Drawing with WebGL 2: rooms whose light is ready, people whose joints move them, plain things.

const PIECE = 24; // triangles of a room that are left out together
const SPECK_PX = 1; // what is smaller is left out while time moves

const LIGHT = `
const int MOST = 8;
uniform int lamps; uniform vec4 lamp_place[MOST]; uniform vec4 lamp_axis[MOST]; uniform vec3 lamp_colour[MOST];
uniform vec3 sky, ground;
vec3 light_at(vec3 place, vec3 n, float wrap) {
  vec3 sum = mix(ground, sky, 0.5 + 0.5 * n.y);
  for (int i = 0; i < MOST; i++) {
    if (i >= lamps) break;
    vec3 to = -lamp_axis[i].xyz; float share = 1.0;
    if (lamp_place[i].w > 0.5) {
      to = lamp_place[i].xyz - place;
      float squared = max(dot(to, to), 0.04);
      share = 1.0 / squared; to *= inversesqrt(squared);
      if (lamp_place[i].w < 1.5) {
        float c = lamp_axis[i].w, inside = clamp((-dot(to, lamp_axis[i].xyz) - c) / (0.3 * max(1.0 - c, 1e-6)), 0.0, 1.0);
        share *= inside * inside * (3.0 - 2.0 * inside);
      }
    }
    sum += lamp_colour[i] * share * max((dot(n, to) + wrap) / ((1.0 + wrap) * (1.0 + wrap)), 0.0);
  }
  return sum;
}
vec3 codes(vec3 light) {
  vec3 soft = mix(light, 1.0 - 0.5 * exp(1.0 - 2.0 * light), step(0.5, light));
  return pow(soft, vec3(1.0 / 2.2));
}`;

const PERSON = [`#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec3 normal; layout(location=2) in vec3 detail;
layout(location=3) in vec3 colour; layout(location=4) in uvec4 surface; layout(location=5) in uvec4 joints;
layout(location=6) in vec4 weights; layout(location=7) in int morph;
uniform mat4 projection; uniform sampler2D bones; uniform sampler2D deltas; uniform int person; uniform int most; uniform float shape[6];
uniform vec3 tint;
out vec3 v_light; out vec3 v_detail; flat out uvec4 v_surface;
${LIGHT}
void main() {
  vec3 at = place;
  if (morph >= 0) for (int k = 0; k < 6; k++) if (shape[k] > 0.003)
    at += shape[k] * texelFetch(deltas, ivec2(k + 6 * (morph % 64), morph / 64), 0).xyz;
  vec4 r0 = vec4(0.0), r1 = vec4(0.0), r2 = vec4(0.0);
  for (int i = 0; i < 4; i++) if (weights[i] > 0.0) {
    int c = 3 * int(joints[i]);
    r0 += weights[i] * texelFetch(bones, ivec2(c, person), 0);
    r1 += weights[i] * texelFetch(bones, ivec2(c + 1, person), 0);
    r2 += weights[i] * texelFetch(bones, ivec2(c + 2, person), 0);
  }
  float total = max(weights.x + weights.y + weights.z + weights.w, 1e-3);
  vec4 h = vec4(at, 1.0);
  vec3 world = vec3(dot(r0, h), dot(r1, h), dot(r2, h)) / total;
  vec3 n = normalize(vec3(dot(r0.xyz, normal), dot(r1.xyz, normal), dot(r2.xyz, normal)));
  gl_Position = projection * vec4(world, 1.0);
  v_light = codes(pow(colour, vec3(2.2)) * light_at(world, n, 0.2)) * tint;
  v_detail = detail; v_surface = surface;
}`, `#version 300 es
precision highp float;
in vec3 v_light; in vec3 v_detail; flat in uvec4 v_surface;
uniform sampler2D picture; uniform int look; uniform float brightness; uniform vec3 eye_light;
out vec4 o;
void main() {
  vec3 c = v_light;
#ifdef TEXTURED
  if (look == 1) { vec4 t = texture(picture, v_detail.xy); if (t.a < 0.45) discard; c *= t.rgb; }
#endif
  if (look == 2) {
    float iris = float(v_surface.y) / 255.0, pupil = float(v_surface.w) / 255.0;
    vec3 at = normalize(v_detail); float r = at.z < 0.0 ? length(at.xy) : 2.0;
    float white = smoothstep(iris - 0.03, iris + 0.03, r);
    float ring = 1.0 - 0.6 * smoothstep(0.8 * iris, iris, r);
    c = mix(v_light * ring, eye_light, white) * smoothstep(pupil - 0.03, pupil + 0.03, r);
  }
  o = vec4(c * brightness, 1.0);
}`];

const ROOM = [`#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec2 uv; layout(location=2) in vec3 light;
uniform mat4 projection; out vec2 v_uv; out vec3 v_light;
void main() { gl_Position = projection * vec4(place, 1.0); v_uv = uv; v_light = light * (255.0 / 127.0); }`,
`#version 300 es
precision highp float;
in vec2 v_uv; in vec3 v_light; uniform sampler2D picture; uniform int look; uniform float brightness; out vec4 o;
void main() {
  vec3 c = v_light;
  if (look > 0) {
    vec4 t = texture(picture, v_uv);
#ifdef HOLES
    if (t.a < 0.45) discard; // which keeps hidden pixels from being left out early
#endif
    c *= t.rgb;
  }
  o = vec4(c * brightness, 1.0);
}`];

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

class Program {
  constructor(gl, [vertex, fragment], defined = '') {
    fragment = fragment.replace('#version 300 es', '#version 300 es\n' + defined);
    this.gl = gl;
    const p = this.p = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(p, shader);
    }
    gl.linkProgram(p);
    if (!gl.getProgramParameter(p, gl.LINK_STATUS))
      throw new Error(gl.getProgramInfoLog(p) + gl.getAttachedShaders(p).map(s => gl.getShaderInfoLog(s)).join());
    this.at = {};
    const n = gl.getProgramParameter(p, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < n; i++) {
      const name = gl.getActiveUniform(p, i).name;
      this.at[name.replace('[0]', '')] = gl.getUniformLocation(p, name);
    }
  }
}

function drawsOnProcessor() {
  const gl = document.createElement('canvas').getContext('webgl2');
  if (!gl) return false;
  const extension = gl.getExtension('WEBGL_debug_renderer_info');
  const name = extension ? gl.getParameter(extension.UNMASKED_RENDERER_WEBGL) : '';
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|basic render/i.test(name);
}

class Drawing {
  constructor(canvas, content) {
    // Where the processor draws, smooth edges would cost it most of its time.
    this.slow = drawsOnProcessor();
    const gl = this.gl = canvas.getContext('webgl2', {antialias: !this.slow, alpha: false, powerPreference: 'high-performance'});
    if (!gl) throw new Error('this browser draws no WebGL 2; open the page in Firefox, Chrome, Edge or Safari of 2022 or newer');
    this.canvas = canvas;
    this.content = content;
    this.programs = {person: new Program(gl, PERSON, '#define TEXTURED'), quick: new Program(gl, QUICK), eyes: new Program(gl, QUICK_EYES), thing: new Program(gl, THING),
      cache: new Program(gl, CACHE), room: new Program(gl, ROOM), holes: new Program(gl, ROOM, '#define HOLES')};
    this.white = this.texture(new Uint8Array([255, 255, 255, 255]), 1, 1);
    this.pictures = content.header.textures.map(() => this.white);
    this.people = content.header.people.map(() => null);
    this.rooms = content.header.rooms.map(() => null);
    this.bones = gl.createTexture();
    this.bonesSize = 0;
    this.solids = {ball: this.solid(this.slow ? ball(6, 8) : ball(10, 14)), rod: this.solid(rod(this.slow ? 6 : 12)), box: this.solid(box())};
    this.ready = Promise.all(content.header.textures.map((t, k) => this.load(t, k)));
    gl.enable(gl.DEPTH_TEST);
  }

  async load(texture, k) {
    const gl = this.gl;
    const image = await createImageBitmap(new Blob([this.content.flat(texture.file)], {type: 'image/webp'}), {premultiplyAlpha: 'none'});
    const t = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, t);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, this.slow ? gl.NEAREST_MIPMAP_NEAREST : gl.LINEAR_MIPMAP_LINEAR);
    this.pictures[k] = t;
  }

  texture(bytes, width, height) {
    const gl = this.gl, t = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, t);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    return t;
  }

  buffer(location, data, k, {whole = false, normal = false} = {}) {
    const gl = this.gl, b = gl.createBuffer();
    const kind = {Float32Array: gl.FLOAT, Uint8Array: gl.UNSIGNED_BYTE, Int8Array: gl.BYTE, Int16Array: gl.SHORT}[data.constructor.name];
    gl.bindBuffer(gl.ARRAY_BUFFER, b);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(location);
    const stride = data.BYTES_PER_ELEMENT * (data.stride || k);
    if (whole) gl.vertexAttribIPointer(location, k, kind, stride, 0);
    else gl.vertexAttribPointer(location, k, kind, normal, stride, 0);
  }

  indices(data) {
    const gl = this.gl;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return data.BYTES_PER_ELEMENT === 2 ? gl.UNSIGNED_SHORT : gl.UNSIGNED_INT;
  }

  padded(ref) { const rows = this.content.plainRows(ref, 1); rows.stride = 4; return rows; }

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
    const texels = new Float32Array(384 * height * 4);
    for (let i = 0; i < n; i++) for (let m = 0; m < 6; m++) for (let x = 0; x < 3; x++)
      texels[4 * ((i >> 6) * 384 + (i & 63) * 6 + m) + x] = rows[i * 18 + m * 3 + x];
    const deltas = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, deltas);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 384, height, 0, gl.RGBA, gl.FLOAT, texels);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    // Runs that look alike are drawn at once.
    const runs = [];
    for (const [first, count, picture, twoSided, look] of mesh.runs) {
      const mode = look === 'eye' ? 2 : picture >= 0 ? 1 : 0, before = runs[runs.length - 1];
      if (before && mode === 0 && before.mode === 0 && before.first + before.count === first) before.count += count;
      else runs.push({first, count, picture, mode});
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
    const planes = [];
    for (const [row, sign] of [[0, 1], [0, -1], [1, 1], [1, -1], [2, 1]]) {
      const plane = [0, 4, 8, 12].map(j => projection[3 + j] + sign * projection[row + j]), length = Math.hypot(plane[0], plane[1], plane[2]);
      planes.push(plane.map(v => v / length));
    }
    // Pixels that a metre takes a metre away.
    const scale = 0.5 * height * Math.hypot(projection[1], projection[5], projection[9]), ball = part.balls;
    let key = '';
    for (let i = 0, b = 0; i < part.count; i++, b += 4) {
      const x = ball[b], y = ball[b + 1], z = ball[b + 2], r = ball[b + 3];
      const depth = projection[3] * x + projection[7] * y + projection[11] * z + projection[15];
      part.shown[i] = planes.every(p => p[0] * x + p[1] * y + p[2] * z + p[3] > -r) && 2 * r * scale > SPECK_PX * (depth - r) ? 1 : 0;
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

  begin(width, height, background, brightness) {
    const gl = this.gl;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(...background.map(v => v / 255 * brightness), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
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

  use(name, projection, room, brightness) {
    const gl = this.gl, {p, at} = this.programs[name];
    gl.useProgram(p);
    gl.uniformMatrix4fv(at.projection, false, projection);
    gl.uniform1f(at.brightness, brightness);
    if (at.picture) gl.uniform1i(at.picture, 0);
    if (!at.lamps) return at;
    const lamps = room ? room.lamps.slice(0, 8) : [];
    gl.uniform1i(at.lamps, lamps.length);
    if (lamps.length) {
      gl.uniform4fv(at.lamp_place, lamps.flatMap(l => [...l.place, l.kind]));
      gl.uniform4fv(at.lamp_axis, lamps.flatMap(l => [...l.axis, l.cos]));
      gl.uniform3fv(at.lamp_colour, lamps.flatMap(l => l.colour));
    }
    gl.uniform3fv(at.sky, room && lamps.length ? room.sky : [0.8, 0.8, 0.82]);
    gl.uniform3fv(at.ground, room && lamps.length ? room.ground : [0.5, 0.48, 0.46]);
    return at;
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

  // `bones` holds 3 rows of 4 numbers for every joint of everyone; `shapes` 6 numbers a person.
  drawPeople(cast, visible, bones, joints, shapes, projection, room, brightness, tints) {
    const gl = this.gl, n = cast.length;
    if (!visible.length) return;
    const at = this.use('person', projection, room, brightness);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.bones);
    if (this.bonesSize !== n * joints) {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 3 * joints, n, 0, gl.RGBA, gl.FLOAT, bones);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      this.bonesSize = n * joints;
    } else gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 3 * joints, n, gl.RGBA, gl.FLOAT, bones);
    gl.uniform1i(at.bones, 1);
    gl.uniform1i(at.deltas, 2);
    const lit = room && room.lamps.length ? [0.86, 0.85, 0.83] : [0.85, 0.85, 0.85];
    gl.uniform3fv(at.eye_light, lit);
    for (const i of visible) {
      const model = this.person(cast[i]);
      gl.bindVertexArray(model.vao);
      gl.activeTexture(gl.TEXTURE2);
      gl.bindTexture(gl.TEXTURE_2D, model.deltas);
      gl.activeTexture(gl.TEXTURE0);
      gl.uniform1i(at.person, i);
      gl.uniform1fv(at.shape, shapes.subarray(6 * i, 6 * i + 6));
      gl.uniform3fv(at.tint, tints && tints[i] ? tints[i] : [1, 1, 1]);
      for (const run of model.runs) {
        gl.uniform1i(at.look, run.mode);
        gl.bindTexture(gl.TEXTURE_2D, run.picture < 0 ? this.white : this.pictures[run.picture]);
        gl.drawElements(gl.TRIANGLES, run.count, model.kind, model.bytes * run.first);
      }
    }
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
}

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

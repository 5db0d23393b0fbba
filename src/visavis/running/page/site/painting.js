// What draws on pages, live figures and sessions seen again, with WebGL 2: light, people whose joints
// move them, buffers and pictures. Bones are three rows of four numbers for every joint.

export const LIGHT = `
const int MOST = 8;
uniform highp int lamps; uniform vec4 lamp_place[MOST]; uniform vec4 lamp_axis[MOST]; uniform vec3 lamp_colour[MOST];
uniform vec3 sky, ground;
float arriving(int i, vec3 place, out vec3 to) { // the share of a lamp's light, and where it is
  to = -lamp_axis[i].xyz;
  if (lamp_place[i].w < 0.5) return 1.0;
  to = lamp_place[i].xyz - place;
  float squared = max(dot(to, to), 0.04), share = 1.0 / squared;
  to *= inversesqrt(squared);
  if (lamp_place[i].w > 1.5) return share;
  float c = lamp_axis[i].w, inside = clamp((-dot(to, lamp_axis[i].xyz) - c) / (0.3 * max(1.0 - c, 1e-6)), 0.0, 1.0);
  return share * inside * inside * (3.0 - 2.0 * inside);
}
vec3 light_at(vec3 place, vec3 n, float wrap) {
  vec3 sum = mix(ground, sky, 0.5 + 0.5 * n.y);
  for (int i = 0; i < MOST; i++) {
    if (i >= lamps) break;
    vec3 to; float share = arriving(i, place, to);
    sum += lamp_colour[i] * share * max((dot(n, to) + wrap) / ((1.0 + wrap) * (1.0 + wrap)), 0.0);
  }
  return sum;
}
vec3 codes(vec3 light) {
  vec3 soft = mix(light, 1.0 - 0.5 * exp(1.0 - 2.0 * light), step(0.5, light));
  return pow(soft, vec3(1.0 / 2.2));
}`;

// With FINE light is computed at every pixel, bright colours keep their hue, and eyes shine.
export const FINE_LIGHT = `
uniform vec3 eye;
vec3 shown(vec3 x) {
  float most = max(x.r, max(x.g, x.b)), mapped = min(most, 0.5) + 0.5 * (1.0 - exp(-max(most - 0.5, 0.0) / 0.5));
  vec3 apart = min(x, 0.5) + 0.5 * (1.0 - exp(-max(x - 0.5, 0.0) / 0.5));
  return pow(mix(apart, x * (mapped / max(most, 1e-4)), 0.7), vec3(1.0 / 2.2));
}
vec3 shine_at(vec3 place, vec3 n) {
  vec3 view = normalize(eye - place), sum = vec3(0.0);
  for (int i = 0; i < MOST; i++) {
    if (i >= lamps) break;
    vec3 to; float share = arriving(i, place, to);
    sum += lamp_colour[i] * share * max(dot(n, to), 0.0) * 5.8 * pow(max(dot(n, normalize(to + view)), 0.0), 250.0);
  }
  return sum;
}`;

export const SHAPES = 7; // of a face

export const PERSON = [`#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec3 normal; layout(location=2) in vec3 detail;
layout(location=3) in vec3 colour; layout(location=4) in uvec4 surface; layout(location=5) in uvec4 joints;
layout(location=6) in vec4 weights; layout(location=7) in int morph;
uniform mat4 projection; uniform sampler2D bones; uniform sampler2D deltas; uniform int person; uniform int most; uniform float shape[${SHAPES}];
uniform vec3 tint;
out vec3 v_light; out vec3 v_detail; flat out uvec4 v_surface;
#ifdef FINE
out vec3 v_place; out vec3 v_normal;
#endif
${LIGHT}
void main() {
  vec3 at = place;
  if (morph >= 0) for (int k = 0; k < ${SHAPES}; k++) if (abs(shape[k]) > 0.003)
    at += shape[k] * texelFetch(deltas, ivec2(k + ${SHAPES} * (morph % 64), morph / 64), 0).xyz;
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
#ifdef FINE
  v_light = pow(colour, vec3(2.2)) * tint; v_place = world; v_normal = n;
#else
  v_light = codes(pow(colour, vec3(2.2)) * light_at(world, n, 0.2)) * tint;
#endif
  v_detail = detail; v_surface = surface;
}`, `#version 300 es
precision highp float;
in vec3 v_light; in vec3 v_detail; flat in uvec4 v_surface;
uniform sampler2D picture; uniform int look; uniform float brightness; uniform vec3 eye_light;
out vec4 o;
#ifdef FINE
in vec3 v_place; in vec3 v_normal;
uniform sampler2D picture2, picture3, picture4, picture5;
${LIGHT}
${FINE_LIGHT}
// A person is one draw: every vertex says which of five pictures is its own, 0 for none.
vec4 picture_at(uint which, vec2 uv) {
  vec2 dx = dFdx(uv), dy = dFdy(uv);
  if (which == 1u) return textureGrad(picture, uv, dx, dy);
  if (which == 2u) return textureGrad(picture2, uv, dx, dy);
  if (which == 3u) return textureGrad(picture3, uv, dx, dy);
  if (which == 4u) return textureGrad(picture4, uv, dx, dy);
  if (which == 5u) return textureGrad(picture5, uv, dx, dy);
  return vec4(1.0);
}
void main() {
  vec4 t = picture_at(v_surface.x, v_detail.xy);
  if (t.a < 0.45) discard;
  vec3 n = normalize(v_normal);
  if (!gl_FrontFacing) n = -n;
  vec3 light = v_light * pow(t.rgb, vec3(2.2)) * light_at(v_place, n, 0.0);
  if (v_surface.y == 1u) light += shine_at(v_place, n);
  o = vec4(shown(light), 1.0);
}
#else
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
}
#endif
`];

// A room whose light was computed before: codes of light at every vertex.
export const ROOM = [`#version 300 es
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

export class Program {
  constructor(gl, shaders, defined = '') {
    const [vertex, fragment] = shaders.map(text => text.replace('#version 300 es', '#version 300 es\n' + defined));
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


/** Return who draws with WebGL 2: the name of a graphics chip, or of a program; null where nobody can. */
export function rendererName() {
  const gl = document.createElement('canvas').getContext('webgl2');
  if (!gl) return null;
  const name = rendererOf(gl);
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return name;
}

export function rendererOf(gl) {
  const extension = gl.getExtension('WEBGL_debug_renderer_info');
  return String(gl.getParameter(extension ? extension.UNMASKED_RENDERER_WEBGL : gl.RENDERER)).slice(0, 200);
}

export const isProcessor = name => /swiftshader|llvmpipe|softpipe|basic render/i.test(name || '');


/** Write the rows that move what was at rest with a joint: its turn q (w, x, y, z), place p and place at rest, each from an index on. */
export function boneRows(q, b, p, o, rest, r, bones, c) {
  const qw = q[b], qx = q[b + 1], qy = q[b + 2], qz = q[b + 3];
  const m0 = 1 - 2 * (qy * qy + qz * qz), m1 = 2 * (qx * qy - qw * qz), m2 = 2 * (qx * qz + qw * qy);
  const m3 = 2 * (qx * qy + qw * qz), m4 = 1 - 2 * (qx * qx + qz * qz), m5 = 2 * (qy * qz - qw * qx);
  const m6 = 2 * (qx * qz - qw * qy), m7 = 2 * (qy * qz + qw * qx), m8 = 1 - 2 * (qx * qx + qy * qy);
  const ox = rest[r], oy = rest[r + 1], oz = rest[r + 2];
  bones[c] = m0; bones[c + 1] = m1; bones[c + 2] = m2; bones[c + 3] = p[o] - (m0 * ox + m1 * oy + m2 * oz);
  bones[c + 4] = m3; bones[c + 5] = m4; bones[c + 6] = m5; bones[c + 7] = p[o + 1] - (m3 * ox + m4 * oy + m5 * oz);
  bones[c + 8] = m6; bones[c + 9] = m7; bones[c + 10] = m8; bones[c + 11] = p[o + 2] - (m6 * ox + m7 * oy + m8 * oz);
}

export class Painter {
  constructor(canvas, {antialias, programs}) {
    const gl = this.gl = canvas.getContext('webgl2', {antialias, alpha: false, powerPreference: 'high-performance'});
    if (!gl) throw new Error('this browser draws no WebGL 2; open the page in Firefox, Chrome, Edge or Safari of 2022 or newer');
    this.canvas = canvas;
    this.programs = Object.fromEntries(Object.entries(programs).map(([name, [shaders, defined]]) => [name, new Program(gl, shaders, defined)]));
    this.white = this.texture(new Uint8Array([255, 255, 255, 255]), 1, 1);
    this.bones = gl.createTexture();
    this.bonesSize = 0;
    gl.enable(gl.DEPTH_TEST);
  }

  // A picture with smaller ones for places far away; `by` is how they are joined.
  picture(image, by = this.gl.LINEAR_MIPMAP_LINEAR) {
    const gl = this.gl, t = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, t);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, by);
    return t;
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

  // `bones` holds 3 rows of 4 numbers for every joint of everyone; `shapes` SHAPES numbers a person.
  drawPeople(cast, visible, bones, joints, shapes, projection, room, brightness, tints, eye) {
    const gl = this.gl, n = cast.length;
    if (!visible.length) return;
    const at = this.use('person', projection, room, brightness);
    if (at.eye) gl.uniform3fv(at.eye, eye);
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
    for (const i of visible) for (const model of this.modelsOf(cast[i])) {
      gl.bindVertexArray(model.vao);
      gl.activeTexture(gl.TEXTURE2);
      gl.bindTexture(gl.TEXTURE_2D, model.deltas);
      gl.activeTexture(gl.TEXTURE0);
      gl.uniform1i(at.person, i);
      gl.uniform1fv(at.shape, shapes.subarray(SHAPES * i, SHAPES * (i + 1)));
      gl.uniform3fv(at.tint, tints && tints[i] ? tints[i] : [1, 1, 1]);
      for (const run of model.runs) {
        gl.uniform1i(at.look, run.mode);
        gl.bindTexture(gl.TEXTURE_2D, run.picture());
        (run.others || []).forEach((texture, k) => {
          gl.activeTexture(gl.TEXTURE3 + k);
          gl.bindTexture(gl.TEXTURE_2D, texture);
          gl.uniform1i(at[`picture${k + 2}`], 3 + k);
        });
        gl.activeTexture(gl.TEXTURE0);
        gl.drawElements(gl.TRIANGLES, run.count, model.kind, model.bytes * run.first);
      }
    }
  }
}

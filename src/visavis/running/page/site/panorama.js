// Panoramas: a picture all around, seen through the browser as through a window, at its true size.
// Arrow keys turn the view, by the rule of `visavis.stimuli.view_turns`.

const STEP_DEG = 30; // how far a press turns the view
const SPEED_DEG_PER_S = 90;
const MAX_PITCH_DEG = 60;
const SLACK = 0.01; // share of a frame by which its light may come before it is due
const MAX_TURNS = 5000;
const ARROWS = { arrowleft: [-1, 0], arrowright: [1, 0], arrowup: [0, 1], arrowdown: [0, -1] };

const rad = (deg) => deg * Math.PI / 180;

// ---- how the view turns ---------------------------------------------------------------------

// The turns of a view in the rhythm of a display: `press` takes a key in the frame of a time, `at`
// says how far it is turned to the right and upwards at a time.
export function viewTurns(frameMs) {
  const turns = []; // [ms, from, to]
  const at = (ms) => {
    let view = [0, 0];
    for (const [since, from, to] of turns) {
      if (ms < since) break;
      const way = [to[0] - from[0], to[1] - from[1]];
      const reach = Math.floor((ms - since) / frameMs + SLACK) * frameMs / 1000 * SPEED_DEG_PER_S;
      const share = Math.min(1, reach / Math.max(Math.hypot(...way), 1e-9));
      view = [from[0] + share * way[0], from[1] + share * way[1]];
    }
    return view;
  };
  const press = (name, ms) => {
    const goal = turns.length ? turns.at(-1)[2] : [0, 0];
    const [right, up] = ARROWS[name];
    const to = [goal[0] + right * STEP_DEG, Math.min(MAX_PITCH_DEG, Math.max(-MAX_PITCH_DEG, goal[1] + up * STEP_DEG))];
    if ((to[0] === goal[0] && to[1] === goal[1]) || turns.length >= MAX_TURNS) return null;
    turns.push([ms, at(ms), to]);
    return turns.at(-1);
  };
  return { at, press };
}

export const turnsView = (name) => name in ARROWS;

// ---- drawing --------------------------------------------------------------------------------

const VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D around;
uniform vec3 window; // half its width and height, and its distance, in pixels
uniform vec2 turn; // to the right, and upwards
out vec4 colour;
const float PI = 3.14159265358979;
void main() {
  vec3 ray = normalize(vec3(gl_FragCoord.xy - window.xy, -window.z));
  float c = cos(turn.y), s = sin(turn.y);
  ray = vec3(ray.x, c * ray.y - s * ray.z, s * ray.y + c * ray.z);
  float right = atan(ray.x, -ray.z) + turn.x;
  vec2 at = vec2(0.5 + right / (2.0 * PI), 0.5 - asin(clamp(ray.y, -1.0, 1.0)) / PI);
  colour = vec4(textureLod(around, at, 0.0).rgb, 1.0);
}`;

let drawing = null; // one for the whole page: browsers give few

function begin() {
  const canvas = document.createElement("canvas");
  canvas.className = "panorama";
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false });
  if (!gl) throw new Error("this browser draws no WebGL 2");
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "its graphics failed");
  gl.useProgram(program);
  const places = Object.fromEntries(["window", "turn"].map((name) => [name, gl.getUniformLocation(program, name)]));
  return { canvas, gl, places, textures: new Map() };
}

// Prepares to draw some panoramas, whose files `decoded` gives as bitmaps no wider than a number of
// pixels; returns the canvas, and what draws one of them turned to the right and upwards.
export async function open(panoramas, size, distancePx, decoded) {
  if (!drawing || drawing.gl.isContextLost()) drawing = begin();
  const { canvas, gl, places, textures } = drawing;
  [canvas.width, canvas.height] = size;
  gl.viewport(0, 0, ...size);
  gl.uniform3f(places.window, size[0] / 2, size[1] / 2, distancePx);
  const names = new Set(panoramas.map((one) => one.picture));
  for (const [name, texture] of textures) if (!names.has(name)) { gl.deleteTexture(texture); textures.delete(name); }
  for (const one of panoramas) {
    if (textures.has(one.picture)) continue;
    const bitmap = await decoded(one, gl.getParameter(gl.MAX_TEXTURE_SIZE));
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE); // across, it goes on around
    bitmap.close();
    textures.set(one.picture, texture);
  }
  const draw = (one, [right, up]) => {
    gl.bindTexture(gl.TEXTURE_2D, textures.get(one.picture));
    gl.uniform2f(places.turn, rad(one.yaw_deg + right), rad(up));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  };
  return { canvas, draw };
}

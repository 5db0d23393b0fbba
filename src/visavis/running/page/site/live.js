// What is drawn live on the page: a figure that walks, answers sliders in the next frame, and can be
// looked at from all round; or the room and the people of a film (drawn_film.js). What it is made of
// is loaded before, checked, and counted: a part that is missing or refused is a failure, never a
// figure without eyes.

import * as blends from "./blend.js";
import * as wire from "./wire.js";
import { readPerson } from "./glb.js";
import { boneRows, isProcessor, LIGHT, FINE_LIGHT, Painter, PERSON, rendererName, rendererOf, ROOM, SHAPES } from "./painting.js";

const TRIES = 4;
const CAMERA_MS = 50; // 20 a second
const SEND_MS = 1000;
const LONGEST_STEP_S = 0.1;
const KEY_TURN = Math.PI / 36;
const TURNS = { ArrowLeft: [-KEY_TURN, 0], ArrowRight: [KEY_TURN, 0], ArrowUp: [0, -KEY_TURN], ArrowDown: [0, KEY_TURN] };
const KEY_CLOSER = 1.08;
const NEAREST_M = 0.6;
const FARTHEST_M = 9;
const HALF_HEIGHT = Math.tan(17 * Math.PI / 180); // of the picture, one metre away
const [NEAR_M, FAR_M] = [0.05, 60];
const [MIN_PITCH, MAX_PITCH] = [-0.02, 1.55];
const SHADE_M = 0.42;
const FLOOR_M = 40;
const MIST_M = [6, 16]; // where the floor's end is lost
const GRID_M = 0.5;
const APART_M = 0.55; // two figures stand so far to both sides
const LANE_M = [0.95, 5];
const PICTURES_A_DRAW = 5;
const files = new Map();

// A level is the floor or a lane below somebody; a shade is the light that a body keeps off it.
const LEVEL = [`#version 300 es
layout(location=0) in vec2 corner;
uniform mat4 projection; uniform vec2 middle, size; uniform float high; uniform vec2 repeat, offset;
out vec3 v_place; out vec2 v_uv; out vec2 v_corner;
void main() {
  v_corner = 2.0 * corner; v_uv = repeat * (corner + 0.5) + offset;
  v_place = vec3(middle.x + size.x * corner.x, high, middle.y + size.y * corner.y);
  gl_Position = projection * vec4(v_place, 1.0);
}`, `#version 300 es
precision highp float;
in vec3 v_place; in vec2 v_uv; in vec2 v_corner;
uniform sampler2D picture; uniform vec3 mist; uniform vec2 mist_m; uniform float shade; out vec4 o;
${LIGHT}
${FINE_LIGHT}
void main() {
  if (shade > 0.0) { o = vec4(0.0, 0.0, 0.0, shade * clamp((1.0 - length(v_corner)) / 0.94, 0.0, 1.0)); return; }
  vec3 lit = shown(pow(texture(picture, v_uv).rgb, vec3(2.2)) * light_at(v_place, vec3(0.0, 1.0, 0.0), 0.0));
  o = vec4(mix(lit, mist, smoothstep(mist_m.x, mist_m.y, distance(eye, v_place))), 1.0);
}`];

// A card hangs anywhere: a board in a headset, a ray, the dot where it ends.
const CARD = [`#version 300 es
layout(location=0) in vec2 corner;
uniform mat4 projection; uniform vec3 middle, across, along;
out vec2 v_uv;
void main() { v_uv = vec2(0.5 + corner.x, 0.5 - corner.y); gl_Position = projection * vec4(middle + across * corner.x + along * corner.y, 1.0); }`, `#version 300 es
precision highp float;
in vec2 v_uv; uniform sampler2D picture; uniform vec3 tint; out vec4 o;
void main() { o = vec4(tint * texture(picture, v_uv).rgb, 1.0); }`];

async function hashOf(buffer) {
  if (!globalThis.crypto?.subtle) return null; // not on a plain address of another machine
  const digest = await crypto.subtle.digest("SHA-256", buffer);
  return [...new Uint8Array(digest)].map((b) => b.toString(16).padStart(2, "0")).join("");
}

const inflate = (content) => new Response(new Blob([content]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();

/** Load a file of a figure whole, check it and inflate it; it stays for all steps to come. */
export async function load(asset, key) {
  if (files.has(asset.name)) return files.get(asset.name);
  let why = "";
  for (let attempt = 1; attempt <= TRIES; attempt += 1) {
    try {
      const response = await wire.asset(asset.name, key);
      if (!response.ok) throw new Error(`the server answered ${response.status}`);
      const content = await response.arrayBuffer();
      if (content.byteLength !== asset.bytes) throw new Error("it came in part");
      const hash = await hashOf(content);
      if (hash !== null && hash !== asset.name) throw new Error("it came damaged");
      const buffer = await inflate(content);
      files.set(asset.name, buffer);
      return buffer;
    } catch (error) {
      why = String(error.message || error);
      await new Promise((resolve) => setTimeout(resolve, 300 * 2 ** (attempt - 1)));
    }
  }
  throw new Error(why);
}

/** What draws a step's figures, its floor and what is below them. */
export class Stage extends Painter {
  constructor(canvas, light) {
    // Where the processor draws, smooth edges would cost it most of its time.
    super(canvas, { antialias: !isProcessor(rendererName()), programs: { person: [PERSON, "#define FINE"], level: [LEVEL], card: [CARD], room: [ROOM] } });
    const { gl } = this;
    this.people = [];
    this.levels = [];
    this.hall = null;
    this.mist = light.background_srgb.map((code) => code / 255);
    this.background = light.background_srgb;
    this.room = { sky: light.sky, ground: light.ground, lamps: light.lamps.map((lamp) => ({
      kind: { sun: 0, spot: 1, point: 2 }[lamp.kind], place: lamp.position_m || [0, 0, 0], axis: lamp.direction || [0, -1, 0],
      cos: Math.cos(lamp.half_angle_deg * Math.PI / 180), colour: lamp.intensity })) };
    this.square = gl.createVertexArray();
    gl.bindVertexArray(this.square);
    this.buffer(0, new Float32Array([-0.5, -0.5, 0.5, -0.5, -0.5, 0.5, 0.5, 0.5]), 2);
    this.finer = gl.getExtension("EXT_texture_filter_anisotropic");
  }

  // A picture that is sharp where it is seen at a slant, and repeats.
  sharp(image) {
    const { gl } = this;
    const texture = this.picture(image);
    if (this.finer) gl.texParameterf(gl.TEXTURE_2D, this.finer.TEXTURE_MAX_ANISOTROPY_EXT, Math.min(8, gl.getParameter(this.finer.MAX_TEXTURE_MAX_ANISOTROPY_EXT)));
    return texture;
  }

  /** Take a person in; return their number. Parts are joined, as many as five pictures allow. */
  add({ rest, parts }) {
    const groups = [];
    for (const part of parts) {
      const last = groups.at(-1);
      const pictures = new Set([...(last?.pictures || []), ...(part.picture ? [part.picture] : [])]);
      if (last && pictures.size <= PICTURES_A_DRAW) { last.parts.push(part); last.pictures = [...pictures]; }
      else groups.push({ parts: [part], pictures: part.picture ? [part.picture] : [] });
    }
    const models = groups.map((group) => this.joined(group));
    this.people.push({ models, rest, isSeen: true });
    return this.people.length - 1;
  }

  joined({ parts, pictures }) {
    const { gl } = this;
    const vertices = parts.reduce((n, part) => n + part.place.length / 3, 0);
    const all = { place: new Float32Array(3 * vertices), normal: new Float32Array(3 * vertices), uv: new Float32Array(2 * vertices),
      colour: new Uint8Array(3 * vertices).fill(255), surface: new Uint8Array(4 * vertices),
      joints: new parts[0].joints.constructor(4 * vertices), weights: new parts[0].weights.constructor(4 * vertices) };
    const index = [];
    let from = 0;
    for (const part of parts) {
      const n = part.place.length / 3;
      for (const name of ["place", "normal"]) all[name].set(part[name], 3 * from);
      for (const name of ["joints", "weights"]) all[name].set(part[name], 4 * from);
      if (part.uv) all.uv.set(part.uv, 2 * from);
      const wide = part.colour ? part.colour.length / n : 0;
      for (let i = 0; i < n; i += 1) {
        if (wide) for (let k = 0; k < 3; k += 1) all.colour[3 * (from + i) + k] = part.colour[wide * i + k];
        all.surface[4 * (from + i)] = part.picture ? 1 + pictures.indexOf(part.picture) : 0;
        all.surface[4 * (from + i) + 1] = part.kind === "eye" ? 1 : 0;
      }
      for (const i of part.index) index.push(from + i);
      from += n;
    }
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    this.buffer(0, all.place, 3);
    this.buffer(1, all.normal, 3);
    this.buffer(2, all.uv, 2);
    this.buffer(3, all.colour, 3, { normal: true });
    this.buffer(4, all.surface, 4, { whole: true });
    this.buffer(5, all.joints, 4, { whole: true });
    this.buffer(6, all.weights, 4);
    const indices = vertices > 0xffff ? Uint32Array.from(index) : Uint16Array.from(index);
    const kind = this.indices(indices);
    const [first = this.white, ...others] = pictures.map((picture) => this.sharp(picture));
    return { vao, kind, bytes: indices.BYTES_PER_ELEMENT, deltas: this.white, runs: [{ first: 0, count: indices.length, picture: () => first, others, mode: 1 }] };
  }

  modelsOf(k) { return this.people[k].models; }

  /** Take in the room that everything stands in: a file's head, arrays and pictures by name. */
  surround({ head, arrays }, pictures) {
    const vao = this.gl.createVertexArray();
    this.gl.bindVertexArray(vao);
    this.buffer(0, arrays.place, 3);
    this.buffer(1, arrays.uv, 2);
    this.buffer(2, Object.assign(arrays.light, { stride: 4 }), 3, { normal: true });
    this.hall = { vao, kind: this.indices(arrays.index), runs: head.runs.map(([first, count, name]) => ({ first, count, picture: name ? this.sharp(pictures[name]) : null })) };
  }

  drawHall(projection) {
    const { gl, hall } = this;
    const at = this.use("room", projection, null, 1);
    gl.bindVertexArray(hall.vao);
    gl.activeTexture(gl.TEXTURE0);
    for (const { first, count, picture } of hall.runs) {
      gl.uniform1i(at.look, picture ? 1 : 0);
      gl.bindTexture(gl.TEXTURE_2D, picture || this.white);
      gl.drawElements(gl.TRIANGLES, count, hall.kind, 4 * first);
    }
  }

  /** Draw everybody as they stand, `bones` of one after the other, as seen by each view; on a headset's `target`, or on the canvas. */
  draw(bones, joints, views, target = null) {
    const { gl, canvas } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target ? target.framebuffer : null);
    this.begin(canvas.width, canvas.height, this.background, 1);
    for (const view of views) {
      if (view.viewport) gl.viewport(...view.viewport);
      this.drawView(bones, joints, view);
      if (target) this.drawCards(target.cards, view.projection);
    }
  }

  drawCards(cards, projection) {
    const { gl } = this;
    const at = this.use("card", projection, null, 1);
    gl.bindVertexArray(this.square);
    gl.activeTexture(gl.TEXTURE0);
    for (const { middle, across, along, picture, colour } of cards) {
      gl.bindTexture(gl.TEXTURE_2D, picture || this.white);
      gl.uniform3fv(at.middle, middle);
      gl.uniform3fv(at.across, across);
      gl.uniform3fv(at.along, along);
      gl.uniform3fv(at.tint, colour || [1, 1, 1]);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
  }

  drawView(bones, joints, { eye, projection }) {
    const { gl } = this;
    if (this.hall) this.drawHall(projection);
    const at = this.use("level", projection, this.room, 1);
    gl.bindVertexArray(this.square);
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform3fv(at.eye, eye);
    gl.uniform3fv(at.mist, this.mist);
    gl.uniform2f(at.mist_m, ...MIST_M);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    for (const level of this.levels) {
      if (!level.isSeen) continue;
      gl.bindTexture(gl.TEXTURE_2D, level.picture || this.white);
      gl.uniform2f(at.middle, ...level.middle);
      gl.uniform2f(at.size, ...level.size);
      gl.uniform1f(at.high, level.high);
      gl.uniform1f(at.shade, level.shade || 0);
      gl.uniform2f(at.repeat, ...level.size.map((side) => side / GRID_M));
      gl.uniform2f(at.offset, 0, level.offset || 0);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    gl.disable(gl.BLEND);
    // No face moves.
    gl.vertexAttribI4i(7, -1, -1, -1, -1);
    const cast = this.people.map((_, k) => k);
    this.drawPeople(cast, cast.filter((k) => this.people[k].isSeen), bones, joints, new Float32Array(SHAPES * cast.length), projection, this.room, 1, null, eye);
  }
}

/** A camera that circles a point, led by a mouse, fingers, a wheel, or arrow keys; `changed` hears of it. */
function circling(canvas, eye, aim, changed) {
  const away = eye.map((at, i) => at - aim[i]);
  const camera = { distance: Math.hypot(...away), yaw: Math.atan2(away[0], away[2]), pitch: 0, isFree: true };
  camera.pitch = Math.asin(away[1] / camera.distance);
  camera.eye = () => [aim[0] + camera.distance * Math.cos(camera.pitch) * Math.sin(camera.yaw), aim[1] + camera.distance * Math.sin(camera.pitch),
    aim[2] + camera.distance * Math.cos(camera.pitch) * Math.cos(camera.yaw)];
  const come = (times) => { camera.distance = Math.min(FARTHEST_M, Math.max(NEAREST_M, camera.distance * times)); changed(); };
  const fingers = new Map();
  const apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
  const down = (e) => { if (camera.isFree) { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, [e.clientX, e.clientY]); } };
  const up = (e) => { fingers.delete(e.pointerId); };
  const turnBy = (yaw, pitch) => {
    camera.yaw -= yaw;
    camera.pitch = Math.min(MAX_PITCH, Math.max(MIN_PITCH, camera.pitch + pitch));
    changed();
  };
  const move = (e) => {
    const before = fingers.get(e.pointerId);
    if (!before) return;
    const spread = fingers.size > 1 ? apart() : 0;
    fingers.set(e.pointerId, [e.clientX, e.clientY]);
    if (fingers.size > 1) { come(spread / Math.max(1, apart())); return; }
    const turn = 2 * Math.PI / canvas.clientHeight;
    turnBy(turn * (e.clientX - before[0]), turn * (e.clientY - before[1]));
  };
  const wheel = (e) => { if (camera.isFree) { e.preventDefault(); come(0.95 ** (-e.deltaY * 0.01)); } };
  const keys = (e) => {
    if (!camera.isFree || e.ctrlKey || e.altKey || e.metaKey) return;
    const turn = TURNS[e.key];
    if (turn) turnBy(...turn);
    else if (e.key === "+") come(1 / KEY_CLOSER);
    else if (e.key === "-") come(KEY_CLOSER);
    else return;
    e.preventDefault();
  };
  const heard = [["keydown", keys], ["pointerdown", down], ["pointerup", up], ["pointercancel", up], ["pointermove", move], ["wheel", wheel]];
  canvas.style.touchAction = "none";
  for (const [kind, hear] of heard) canvas.addEventListener(kind, hear, { passive: false });
  camera.close = () => { for (const [kind, hear] of heard) canvas.removeEventListener(kind, hear); };
  return camera;
}

/** Return what a camera sees: where it is, and the matrix that leads from the world to its picture. */
function viewOf(eye, aim, aspect, top) {
  const unit = (v) => { const n = Math.hypot(...v); return v.map((a) => a / n); };
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const back = unit(eye.map((at, i) => at - aim[i]));
  const right = unit(cross([0, 1, 0], back));
  const up = cross(back, right);
  const along = (axis) => [...axis, -axis.reduce((sum, a, i) => sum + a * eye[i], 0)];
  const [x, y, z] = [along(right).map((a) => a / (top * aspect)), along(up).map((a) => a / top), along(back)];
  const deep = z.map((a, i) => (FAR_M + NEAR_M) / (NEAR_M - FAR_M) * a + (i === 3 ? 2 * FAR_M * NEAR_M / (NEAR_M - FAR_M) : 0));
  return { eye, projection: new Float32Array([0, 1, 2, 3].flatMap((c) => [x[c], y[c], deep[c], -z[c]])) };
}

function gridOf(stage, fill, line) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 256;
  const pen = canvas.getContext("2d");
  pen.fillStyle = fill;
  pen.fillRect(0, 0, 256, 256);
  pen.strokeStyle = line;
  pen.lineWidth = 4;
  pen.strokeRect(0, 0, 256, 256);
  return stage.sharp(canvas);
}

function addLevel(stage, level) {
  stage.levels.push({ isSeen: true, ...level });
  return stage.levels.at(-1);
}

export function addFloor(stage) {
  return addLevel(stage, { picture: gridOf(stage, "#8f8a84", "#7d7872"), middle: [0, 0], size: [FLOOR_M, FLOOR_M], high: 0 });
}

// Two who walk at different speeds each have a lane, which passes below them.
function addLane(stage, x) {
  return addLevel(stage, { picture: gridOf(stage, "#9a958e", "#7d7872"), middle: [x, 0], size: LANE_M, high: 0.002 });
}

const addShade = (stage, x) => addLevel(stage, { middle: [x, 0], size: [2 * SHADE_M, 2 * SHADE_M], high: 0.004, shade: 0.5 });

/** Let a person walk in place at x, above a level that passes below. */
function walkerOf(blend, person, stage, level, x) {
  const pose = blends.newPose(blend);
  const { rest } = person;
  const number = stage.add(person);
  const shade = addShade(stage, x);
  let weights;
  let keyS;
  let stance;
  let phase = 0;
  let wayM = 0;
  return {
    weigh(shares) {
      weights = shares;
      keyS = blends.keyTimes(blend, weights);
      stance = blends.gapsOf(blend, weights);
    },
    hide() { stage.people[number].isSeen = shade.isSeen = false; },
    rounds: 0,
    again() { this.rounds = 0; phase = 0; },
    step(seconds, bones) {
      const cycle = keyS[keyS.length - 1];
      // Who moves a slider in the middle of a walk sees it go on from the same moment of a step.
      const k = Math.min(keyS.length - 2, Math.floor(phase));
      let now = keyS[k] + (phase - k) * (keyS[k + 1] - keyS[k]) + seconds;
      this.rounds += Math.floor(now / cycle);
      now -= Math.floor(now / cycle) * cycle;
      phase = blends.phaseOf(keyS, now);
      blends.poseAt(blend, weights, phase, pose, stance);
      const root = blends.inPlace(blend, weights, keyS, phase, pose.root);
      pose.root = [x + root[0], root[1], root[2]];
      blends.placeAll(blend, pose);
      for (let j = 0; j < blend.joints; j += 1) boneRows(pose.world[j], 0, pose.place[j], 0, rest, 3 * j, bones, 12 * (number * blend.joints + j));
      shade.middle = [x + root[0], root[2]];
      for (let i = 0; i < blend.n; i += 1) wayM += weights[i] * blend.travel_m[3 * i + 2] * seconds / cycle;
      level.offset = (wayM / GRID_M) % 1; // the floor passes below, as on a treadmill
    },
  };
}

/** Return who walks in a step: one figure, and somebody beside it where there is one. */
async function walkersOf(step, stage, key) {
  const blend = blends.readBlend(await load(step.live.blend, key));
  const person = await readPerson(await load(step.live.person, key));
  const floor = addFloor(stage);
  const besideWeights = step.until ? Float64Array.from(step.until.weights) : step.motions?.[1] && Float64Array.from(step.motions[1]);
  const beside = besideWeights && step.live.beside ? await readPerson(await load(step.live.beside, key)) : null;
  const apart = step.motions ? APART_M : -APART_M; // seen from the front: a watched figure is on the left, a moulded one on the right
  const walker = walkerOf(blend, person, stage, beside ? addLane(stage, apart) : floor, beside ? apart : 0);
  const besideWalker = beside && walkerOf(blend, beside, stage, addLane(stage, -apart), -apart);
  if (besideWalker) besideWalker.weigh(besideWeights);
  if (step.is_blind) walker.hide();
  return { walkers: besideWalker ? [walker, besideWalker] : [walker], joints: blend.joints, blend };
}

const joined = (rows) => rows.map((row) => row.map((value) => Math.round(value * 1e4) / 1e4));

/** Return how far a blend is from a target: the mean over joints and aligned moments, in metres. */
export function distanceM(blend, w, targetPlaces, until) {
  const places = placesOf(blend, w, until);
  let sum = 0;
  places.forEach((at, i) => { sum += Math.hypot(at[0] - targetPlaces[i][0], at[1] - targetPlaces[i][1], at[2] - targetPlaces[i][2]); });
  return sum / places.length;
}

/** Return the places of the compared joints at `poses` moments from a cycle's begin, in place. */
export function placesOf(blend, w, until) {
  const keyS = blends.keyTimes(blend, w);
  const gaps = blends.gapsOf(blend, w);
  const pose = blends.newPose(blend);
  const places = [];
  for (let t = 0; t < until.poses; t += 1) {
    const phase = (blend.keys - 1) * t / until.poses;
    blends.poseAt(blend, w, phase, pose, gaps);
    const root = blends.inPlace(blend, w, keyS, phase, pose.root);
    pose.root = root;
    blends.placeAll(blend, pose);
    for (const j of until.joints) places.push([...pose.place[j]]);
  }
  return places;
}

/**
 * Begin to draw a step's figures on a canvas: one that sliders mould, or `step.motions` that are watched.
 *
 * `say(rows)` receives movements about every second; `ended(how)` is called when the step ends by itself,
 * `began(rounds)` when a watched motion begins again. Returned are `move(i, value)`, `report()`, `close()`,
 * `values`, and `seen`, which is resolved by the first picture.
 */
export async function open(step, canvas, key, say, ended, began = () => {}) {
  const stage = new Stage(canvas, step.live.light);
  const { walkers, joints, blend } = step.live.people
    ? await (await import("./drawn_film.js")).actorsOf(step, stage, (asset) => load(asset, key), () => addShade(stage, 0))
    : await walkersOf(step, stage, key);
  const until = step.until && { ...step.until };
  const isWatched = Boolean(step.motions);
  const bones = new Float32Array(12 * joints * stage.people.length);
  const { eye_m: eye, aim_m: aim, is_free: isFree, half_height_01: halfHeight = HALF_HEIGHT } = step.live.camera;
  const camera = circling(canvas, eye, aim, () => noteCamera());
  camera.isFree = isFree;

  const values = step.questions.map((q) => q.start);
  const moves = { sliders: [], camera: [], rounds: [] };
  const gapsMs = [];
  let frames = 0;
  let firstMs = null;
  let sayFirst;
  const seen = new Promise((resolve) => { sayFirst = resolve; });
  let lastMs = null;
  let waiting = [];
  let mostFrames = 0;
  let request = 0;
  let problem = "";
  let isOpen = true;
  let isPaused = false;
  let headset = null;
  let repeats = 0;
  let distance = null;
  const target = until && placesOf(blend, Float64Array.from(until.weights), until);

  const weigh = () => {
    if (!blend) return;
    const weights = isWatched ? Float64Array.from(step.motions[0]) : blends.weightsAt(blend, values);
    walkers[0].weigh(weights);
    if (until) distance = distanceM(blend, weights, target, until);
  };
  weigh();

  const resize = () => {
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const ratio = Math.min(devicePixelRatio, 2);
    if (canvas.width === Math.floor(width * ratio) && canvas.height === Math.floor(height * ratio)) return;
    [canvas.width, canvas.height] = [Math.floor(width * ratio), Math.floor(height * ratio)];
  };

  const roundsOf = () => Math.min(...walkers.map((one) => one.rounds));
  const frame = (nowMs, views, target) => {
    if (lastMs !== null) gapsMs.push(nowMs - lastMs);
    const seconds = lastMs === null ? 0 : Math.min(LONGEST_STEP_S, (nowMs - lastMs) / 1000);
    lastMs = nowMs;
    walkers.forEach((one, i) => {
      const before = one.rounds;
      one.step(isPaused ? 0 : seconds, bones);
      if (isWatched && (blend || i === 0) && one.rounds > before) moves.rounds.push([performance.now(), i]);
    });
    stage.draw(bones, joints, views, target);
    frames += 1;
    canvas.dataset.frames = frames;
    canvas.dataset.draws = stage.people.reduce((n, person) => n + person.models.length, 0); // for each eye
    if (firstMs === null) { firstMs = performance.now(); sayFirst(); }
    for (const since of waiting) mostFrames = Math.max(mostFrames, frames - since);
    waiting = [];
    if (isPaused) return;
    if (isWatched) { began(roundsOf()); return; }
    if (until && !step.is_blind && distance < until.within_m) ended("near");
    else if (performance.now() - firstMs >= step.limit_s * 1000) ended("limit");
  };
  const draw = (nowMs) => {
    if (!isOpen || headset) return;
    request = requestAnimationFrame(draw);
    resize();
    frame(nowMs, [viewOf(camera.eye(), aim, canvas.width / Math.max(1, canvas.height), halfHeight)]);
  };
  const pauseAt = () => { lastMs = null; };
  document.addEventListener("visibilitychange", pauseAt);
  canvas.addEventListener("webglcontextlost", () => {
    if (!isOpen) return;
    problem = "the graphics chip was lost";
    if (headset) headset.lost();
    ended("failed");
  });
  let cameraMs = -Infinity;
  let cameraLater = 0;
  const noteCamera = () => {
    clearTimeout(cameraLater);
    const nowMs = performance.now();
    if (nowMs - cameraMs < CAMERA_MS) { cameraLater = setTimeout(noteCamera, CAMERA_MS); return; }
    cameraMs = nowMs;
    moves.camera.push([nowMs, ...camera.eye()]);
  };
  const tellMoves = () => {
    if (!moves.sliders.length && !moves.camera.length && !moves.rounds.length) return;
    const rows = { sliders: joined(moves.sliders), camera: joined(moves.camera), ...(isWatched ? { rounds: joined(moves.rounds) } : {}) };
    [moves.sliders, moves.camera, moves.rounds] = [[], [], []];
    say(rows);
  };
  const teller = setInterval(tellMoves, SEND_MS);
  moves.camera.push([performance.now(), ...camera.eye()]);
  request = requestAnimationFrame(draw);

  return {
    values,
    seen,
    move(i, value) {
      values[i] = value;
      moves.sliders.push([performance.now(), i, value]);
      weigh();
      waiting.push(frames);
    },
    /** Draw in a headset from now on, and on the page again once it is null. */
    async enter(into) {
      if (headset && headset !== into) headset.detach(stage);
      headset = into;
      lastMs = null;
      if (headset) await headset.attach(stage, (nowMs, views, target) => { if (isOpen) frame(nowMs, views, target); }, eye, aim);
      else { cancelAnimationFrame(request); request = requestAnimationFrame(draw); }
    },
    pause() { isPaused = true; },
    /** Go on, or begin anew: what was seen in part is seen whole. */
    resume(again) {
      isPaused = false;
      lastMs = null;
      if (!again) return;
      repeats += 1;
      for (const one of walkers) one.again();
    },
    report() {
      const sorted = [...gapsMs].sort((a, b) => a - b);
      const period = sorted.length ? sorted[Math.floor(sorted.length / 10)] : 0;
      const dropped = period ? gapsMs.reduce((n, gap) => n + Math.max(0, Math.round(gap / period) - 1), 0) : 0;
      tellMoves();
      return { first_ms: firstMs ?? performance.now(), frames, dropped, slider_frames: mostFrames,
        distance_m: distance, renderer: rendererOf(stage.gl), problem, ...(repeats ? { repeats } : {}), ...(isWatched ? { rounds: roundsOf() } : {}) };
    },
    close() {
      isOpen = false;
      if (headset) headset.detach(stage);
      cancelAnimationFrame(request);
      clearInterval(teller);
      clearTimeout(cameraLater);
      document.removeEventListener("visibilitychange", pauseAt);
      camera.close();
      stage.gl.getExtension("WEBGL_lose_context")?.loseContext(); // browsers keep few contexts; sessions have many steps
    },
  };
}

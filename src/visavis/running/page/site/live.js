// A figure drawn on the page: it walks, answers sliders in the next frame, and can be looked at from
// all round. What it is made of is loaded before, checked, and counted: a part that is missing or
// refused is a failure, never a figure without eyes.

import * as blends from "./blend.js";
import * as wire from "./wire.js";
import * as three from "./three.js";

const TRIES = 4;
const CAMERA_MS = 50; // 20 a second
const SEND_MS = 1000;
const LONGEST_STEP_S = 0.1;
const NEAREST_M = 0.6;
const FARTHEST_M = 9;
const FOV_DEG = 34;
const FLOOR_M = 40;
const MIST_M = [6, 16]; // where the floor's end is lost
const GRID_M = 0.5;
const APART_M = 0.55; // two figures stand so far to both sides
const LANE_M = [0.95, 5];
const files = new Map();

// Colours up to 0.5 stay as they are; brighter ones approach 1, as `shown` in our own shaders has it.
const TONE = `vec3 CustomToneMapping( vec3 color ) {
  vec3 x = max( color, 0.0 );
  float most = max( x.r, max( x.g, x.b ) );
  float mapped = min( most, 0.5 ) + 0.5 * ( 1.0 - exp( - max( most - 0.5, 0.0 ) / 0.5 ) );
  vec3 apart = min( x, 0.5 ) + 0.5 * ( 1.0 - exp( - max( x - 0.5, 0.0 ) / 0.5 ) );
  return mix( apart, x * ( mapped / max( most, 1e-4 ) ), 0.7 );
}`;
three.ShaderChunk.tonemapping_pars_fragment = three.ShaderChunk.tonemapping_pars_fragment.replace(
  "vec3 CustomToneMapping( vec3 color ) { return color; }", TONE);

async function hashOf(buffer) {
  if (!globalThis.crypto?.subtle) return null; // not on a plain address of another machine
  const digest = await crypto.subtle.digest("SHA-256", buffer);
  return [...new Uint8Array(digest)].map((b) => b.toString(16).padStart(2, "0")).join("");
}

/** Load a file of a figure whole and check it; it stays for all steps to come. */
export async function load(asset, key) {
  if (files.has(asset.name)) return files.get(asset.name);
  let why = "";
  for (let attempt = 1; attempt <= TRIES; attempt += 1) {
    try {
      const response = await wire.asset(asset.name, key);
      if (!response.ok) throw new Error(`the server answered ${response.status}`);
      const buffer = await response.arrayBuffer();
      if (buffer.byteLength !== asset.bytes) throw new Error("it came in part");
      const hash = await hashOf(buffer);
      if (hash !== null && hash !== asset.name) throw new Error("it came damaged");
      files.set(asset.name, buffer);
      return buffer;
    } catch (error) {
      why = String(error.message || error);
      await new Promise((resolve) => setTimeout(resolve, 300 * 2 ** (attempt - 1)));
    }
  }
  throw new Error(why);
}

/** Return the graphics renderer's name; null where the page cannot draw with WebGL 2. */
export function rendererName() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return null;
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return name.slice(0, 200);
}

// Surfaces reflect evenly as in our own drawing; only eyes shine.
function drawnAs(material) {
  const look = { name: material.name, map: material.map, side: material.side, vertexColors: material.vertexColors,
    alphaTest: material.alphaTest, normalMap: material.normalMap, fog: false };
  if (material.map) material.map.anisotropy = 8;
  return material.userData.kind === "eye"
    ? new three.MeshPhongMaterial({ ...look, shininess: 250, specular: 0x777777 })
    : new three.MeshLambertMaterial(look);
}

async function readPerson(buffer) {
  const refused = [];
  const manager = new three.LoadingManager();
  manager.onError = (address) => refused.push(address);
  const gltf = await new three.GLTFLoader(manager).parseAsync(buffer, "");
  const { json } = gltf.parser;
  const textures = await Promise.all((json.textures || []).map((_, i) => gltf.parser.getDependency("texture", i)));
  const missing = textures.filter((t) => !t?.image?.width).length + refused.length;
  if (missing) throw new Error(`${missing} pictures of the figure could not be read`);
  gltf.scene.traverse((node) => {
    if (!node.isMesh) return;
    node.frustumCulled = false; // a moving body leaves the bounds it has at rest
    node.material = drawnAs(node.material);
  });
  const joints = await Promise.all(json.skins[0].joints.map((i) => gltf.parser.getDependency("node", i)));
  joints[0].parent.quaternion.identity(); // files face +z; here people face −z, as in Visavis
  return { group: gltf.scene, joints };
}

// Light as our rooms have it: three divides what falls on a surface by π, ours does not.
function addLight(scene, light) {
  const colour = ([r, g, b]) => new three.Color(r, g, b);
  const sky = new three.HemisphereLight(colour(light.sky), colour(light.ground), Math.PI);
  scene.add(sky);
  for (const lamp of light.lamps) {
    let made = new three.PointLight(colour(lamp.intensity), Math.PI, 0, 2);
    if (lamp.kind === "spot") {
      const angle = lamp.half_angle_deg * Math.PI / 180;
      const inner = Math.acos(Math.cos(angle) + 0.3 * (1 - Math.cos(angle)));
      made = new three.SpotLight(colour(lamp.intensity), Math.PI, 0, Math.min(angle, 1.5), 1 - inner / angle, 2);
      made.target.position.set(...lamp.position_m.map((at, i) => at + lamp.direction[i]));
      scene.add(made.target);
    }
    made.position.set(...lamp.position_m);
    scene.add(made);
  }
}

function gridOf(fill, line, ...repeat) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 256;
  const pen = canvas.getContext("2d");
  pen.fillStyle = fill;
  pen.fillRect(0, 0, 256, 256);
  pen.strokeStyle = line;
  pen.lineWidth = 4;
  pen.strokeRect(0, 0, 256, 256);
  const grid = new three.CanvasTexture(canvas);
  grid.colorSpace = three.SRGBColorSpace;
  grid.wrapS = grid.wrapT = three.RepeatWrapping;
  grid.repeat.set(...repeat);
  grid.anisotropy = 8;
  return grid;
}

function addLevel(scene, geometry, grid, x, y) {
  const level = new three.Mesh(geometry, new three.MeshLambertMaterial({ map: grid }));
  level.rotation.x = -Math.PI / 2;
  level.position.set(x, y, 0);
  scene.add(level);
  return level;
}

function addFloor(scene, background) {
  const grid = gridOf("#8f8a84", "#7d7872", FLOOR_M / GRID_M, FLOOR_M / GRID_M);
  addLevel(scene, new three.CircleGeometry(FLOOR_M / 2, 64), grid, 0, 0);
  scene.background = new three.Color().setRGB(...background.map((code) => code / 255), three.SRGBColorSpace);
  scene.fog = new three.Fog(scene.background, ...MIST_M);
  return grid;
}

// Two who walk at different speeds each have a lane, which passes below them.
function addLane(scene, x) {
  // A circle of four corners is a square of side 1, over which a picture has 1/√2 of its width.
  const grid = gridOf("#9a958e", "#7d7872", ...LANE_M.map((side) => Math.SQRT2 * side / GRID_M));
  const lane = addLevel(scene, new three.CircleGeometry(Math.SQRT1_2, 4, Math.PI / 4), grid, x, 0.002);
  lane.scale.set(...LANE_M, 1);
  return grid;
}

/** Let a person of the scene walk in place at x, with a grid that passes below. */
function walkerOf(blend, person, scene, grid, x) {
  const pose = blends.newPose(blend);
  const shade = new three.Mesh(new three.CircleGeometry(0.42, 48), shadeMaterial());
  shade.rotation.x = -Math.PI / 2;
  scene.add(shade);
  scene.add(person.group);
  person.group.position.x = x;
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
    hide() { person.group.visible = shade.visible = false; },
    step(seconds) {
      const cycle = keyS[keyS.length - 1];
      // Who moves a slider in the middle of a walk sees it go on from the same moment of a step.
      const k = Math.min(keyS.length - 2, Math.floor(phase));
      let now = keyS[k] + (phase - k) * (keyS[k + 1] - keyS[k]) + seconds;
      now -= Math.floor(now / cycle) * cycle;
      phase = blends.phaseOf(keyS, now);
      blends.poseAt(blend, weights, phase, pose, stance);
      const root = blends.inPlace(blend, weights, keyS, phase, pose.root);
      pose.turns.forEach(([w, i, j, l], joint) => person.joints[joint].quaternion.set(i, j, l, w));
      person.joints[0].position.set(...root);
      shade.position.set(x + root[0], 0.004, root[2]);
      for (let i = 0; i < blend.n; i += 1) wayM += weights[i] * blend.travel_m[3 * i + 2] * seconds / cycle;
      grid.offset.y = (-wayM / GRID_M) % 1; // the floor passes below, as on a treadmill
    },
  };
}

// The light that a body keeps off the floor about it.
function shadeMaterial() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 128;
  const pen = canvas.getContext("2d");
  const fall = pen.createRadialGradient(64, 64, 4, 64, 64, 64);
  fall.addColorStop(0, "rgba(0,0,0,0.5)");
  fall.addColorStop(1, "rgba(0,0,0,0)");
  pen.fillStyle = fall;
  pen.fillRect(0, 0, 128, 128);
  return new three.MeshBasicMaterial({ map: new three.CanvasTexture(canvas), transparent: true, depthWrite: false });
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
    for (const j of until.joints) places.push(pose.place[j]);
  }
  return places;
}

/**
 * Begin to draw a step's figure on a canvas.
 *
 * `say(kind, rows)` receives movements about every second; `ended(how)` is called when the step ends
 * by itself. Returned are `move(i, value)`, `report()`, `close()` and `values`.
 */
export async function open(step, canvas, key, say, ended) {
  const blend = blends.readBlend(await load(step.live.blend, key));
  const person = await readPerson(await load(step.live.person, key));
  const renderer = new three.WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
  renderer.toneMapping = three.CustomToneMapping;
  const scene = new three.Scene();
  addLight(scene, step.live.light);
  const floor = addFloor(scene, step.live.light.background_srgb);
  const until = step.until && { ...step.until };
  const beside = until && step.live.beside ? await readPerson(await load(step.live.beside, key)) : null;
  const walker = walkerOf(blend, person, scene, beside ? addLane(scene, -APART_M) : floor, beside ? -APART_M : 0);
  const targetWalker = beside && walkerOf(blend, beside, scene, addLane(scene, APART_M), APART_M);
  if (targetWalker) targetWalker.weigh(Float64Array.from(until.weights));
  if (step.is_blind) walker.hide();
  const camera = new three.PerspectiveCamera(FOV_DEG, 1, 0.05, 60);
  camera.position.set(...step.live.camera.eye_m);
  const controls = new three.OrbitControls(camera, canvas);
  controls.target.set(...step.live.camera.aim_m);
  controls.enablePan = false;
  controls.enabled = step.live.camera.is_free;
  [controls.minDistance, controls.maxDistance] = [NEAREST_M, FARTHEST_M];
  controls.maxPolarAngle = Math.PI / 2 + 0.02;
  controls.update();

  const values = step.questions.map((q) => q.start);
  const moves = { sliders: [], camera: [] };
  const gapsMs = [];
  let frames = 0;
  let firstMs = null;
  let lastMs = null;
  let waiting = [];
  let mostFrames = 0;
  let request = 0;
  let problem = "";
  let isOpen = true;
  let distance = null;
  const target = until && placesOf(blend, Float64Array.from(until.weights), until);

  const weigh = () => {
    const weights = blends.weightsAt(blend, values);
    walker.weigh(weights);
    if (until) distance = distanceM(blend, weights, target, until);
  };
  weigh();

  const resize = () => {
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const ratio = Math.min(devicePixelRatio, 2);
    if (canvas.width === Math.floor(width * ratio) && canvas.height === Math.floor(height * ratio)) return;
    renderer.setPixelRatio(ratio);
    renderer.setSize(width, height, false);
    camera.aspect = width / Math.max(1, height);
    camera.updateProjectionMatrix();
  };

  const draw = (nowMs) => {
    if (!isOpen) return;
    request = requestAnimationFrame(draw);
    if (lastMs !== null) gapsMs.push(nowMs - lastMs);
    const seconds = lastMs === null ? 0 : Math.min(LONGEST_STEP_S, (nowMs - lastMs) / 1000);
    lastMs = nowMs;
    resize();
    walker.step(seconds);
    if (targetWalker) targetWalker.step(seconds);
    renderer.render(scene, camera);
    frames += 1;
    canvas.dataset.frames = frames;
    if (firstMs === null) firstMs = performance.now();
    for (const since of waiting) mostFrames = Math.max(mostFrames, frames - since);
    waiting = [];
    if (until && !step.is_blind && distance < until.within_m) ended("near");
    else if (performance.now() - firstMs >= step.limit_s * 1000) ended("limit");
  };
  const pauseAt = () => { lastMs = null; };
  document.addEventListener("visibilitychange", pauseAt);
  canvas.addEventListener("webglcontextlost", () => {
    if (!isOpen) return;
    problem = "the graphics chip was lost"; ended("failed");
  });
  let cameraMs = -Infinity;
  let cameraLater = 0;
  const noteCamera = () => {
    clearTimeout(cameraLater);
    const nowMs = performance.now();
    if (nowMs - cameraMs < CAMERA_MS) { cameraLater = setTimeout(noteCamera, CAMERA_MS); return; }
    cameraMs = nowMs;
    moves.camera.push([nowMs, ...camera.position.toArray()]);
  };
  controls.addEventListener("change", noteCamera);
  const tellMoves = () => {
    if (!moves.sliders.length && !moves.camera.length) return;
    const rows = { sliders: joined(moves.sliders), camera: joined(moves.camera) };
    [moves.sliders, moves.camera] = [[], []];
    say(rows);
  };
  const teller = setInterval(tellMoves, SEND_MS);
  moves.camera.push([performance.now(), ...camera.position.toArray()]);
  request = requestAnimationFrame(draw);

  return {
    values,
    move(i, value) {
      values[i] = value;
      moves.sliders.push([performance.now(), i, value]);
      weigh();
      waiting.push(frames);
    },
    report() {
      const sorted = [...gapsMs].sort((a, b) => a - b);
      const period = sorted.length ? sorted[Math.floor(sorted.length / 10)] : 0;
      const dropped = period ? gapsMs.reduce((n, gap) => n + Math.max(0, Math.round(gap / period) - 1), 0) : 0;
      tellMoves();
      return { first_ms: firstMs ?? performance.now(), frames, dropped, slider_frames: mostFrames,
        distance_m: distance, renderer: rendererOf(renderer), problem };
    },
    close() {
      isOpen = false;
      cancelAnimationFrame(request);
      clearInterval(teller);
      clearTimeout(cameraLater);
      document.removeEventListener("visibilitychange", pauseAt);
      controls.dispose();
      renderer.dispose();
      renderer.forceContextLoss(); // browsers keep few contexts; sessions have many steps
    },
  };
}

function rendererOf(renderer) {
  const gl = renderer.getContext();
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)).slice(0, 200);
}

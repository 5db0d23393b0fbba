// A headset by WebXR: entering, frames in stereo, where head and controllers are, presses by ray on a
// board that shows what the page shows. Figures are drawn by the same code as on the page: a step's
// stage lends its context to the headset. The wire of what is recorded: visavis.running.page.streams.

import { Stage, addFloor } from "./live.js";
import { HEIGHT_M, WIDTH_M, newBoard } from "./headset_board.js";
import { drawIn, eyesOf, openHeadset, rotated, standAt } from "./headset_space.js";
import { newStreams } from "./streams.js";
import { rendererOf } from "./painting.js";

export { whyNot } from "./headset_space.js";

const BOARD = { ahead_m: 1.15, below_m: 0.12, figure_ahead_m: 0.85, figure_below_m: 0.78, tilt: 0.7 };
const RAY_M = 4;
const RAY_WIDE_M = 0.004;
const DOT_M = 0.014;
const HAND_MS = 1000 / 30;
// To be set from real headsets: nobody who wears one holds so still. Two frames around a pause of the page
// may be alike by chance, so it takes some.
const STILL = { s: 2, m: 0.001, rad: 0.1 * Math.PI / 180, frames: 20 };
const MAX_FILLED = 8;
const AXIS_STEP = 0.01;
const LOW_BATTERY_01 = 0.15;
const PULSE = { hover: [0.25, 12], press: [0.6, 25] }; // strength from 0 to 1, milliseconds
const CONTROLS_A_SIDE = ["trigger", "squeeze", "stick_x", "stick_y", "stick", "lower", "upper"];
// Where the standard's gamepad keeps them ("xr-standard"): 0 trigger, 1 squeeze, 3 stick, 4 and 5 buttons.
const BUTTONS = [["squeeze", 1], ["stick", 3], ["lower", 4], ["upper", 5]];
const AXES = [["stick_x", 2], ["stick_y", 3]];
const PLAIN = { background_srgb: [168, 164, 158], sky: [0.8, 0.8, 0.82], ground: [0.5, 0.48, 0.46], lamps: [] };
const NOT_THERE = [NaN, NaN, NaN, NaN, NaN, NaN, NaN, 0];

const numbersOf = ({ position: p, orientation: q }) => [p.x, p.y, p.z, q.w, q.x, q.y, q.z];
const poseRow = (pose) => (pose && numbersOf(pose.transform).every(Number.isFinite) ? [...numbersOf(pose.transform), pose.emulatedPosition ? 0 : 1] : NOT_THERE);
const sideOf = (source) => (source.handedness === "left" ? 0 : 1);

/** Return where a ray meets a board: two numbers from 0 to 1 and how far away; null where it does not. */
export function meet(board, from, way) {
  const { middle, right, up } = board;
  const normal = [right[1] * up[2] - right[2] * up[1], right[2] * up[0] - right[0] * up[2], right[0] * up[1] - right[1] * up[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const slope = dot(way, normal);
  if (slope > -1e-6) return null; // from behind, or along it
  const far = dot(middle.map((m, i) => m - from[i]), normal) / slope;
  if (far < 0) return null;
  const at = from.map((f, i) => f + far * way[i] - middle[i]);
  const [u, v] = [0.5 + dot(at, right) / WIDTH_M, 0.5 - dot(at, up) / HEIGHT_M];
  return u >= 0 && u <= 1 && v >= 0 && v <= 1 ? { at: [u, v], far_m: far } : null;
}

/**
 * Enter a headset; to be called from a press of a button.
 *
 * `page` has `main`, `notice` and `stop` (elements), `say`, `send(kind, event)`, `happened(what)`,
 * `next` (the number of each stream's next row).
 */
export async function enter(step, page) {
  const wantsHands = (step.needs || []).includes("hands");
  let hall = null;
  const contextOf = () => { hall = new Stage(document.createElement("canvas"), PLAIN); return hall.gl; };
  const { session, space } = await openHeadset(contextOf, wantsHands ? ["hand-tracking"] : []);
  addFloor(hall);
  return present(session, space, hall, page);
}

function present(session, space, hall, page) {
  const streams = newStreams((batch) => page.send("stream", { ...batch, rate_hz: session.frameRate ?? null }), page.next);
  const board = newBoard(page.main, page.notice, page.stop, page.say, () => session.end());
  const isSeen = () => session.visibilityState === "visible";
  let stage = null; // a step's stage, its drawing and where one stands in it
  let layer = null;
  let place = null; // of the board, on the floor's axes
  let pictures = new WeakMap();
  let isPlaced = false;
  let lastXr = null;
  let gaps = [];
  let handMs = -Infinity;
  let still = null;
  let isOff = false;
  let isOver = false;
  let frames = 0;
  const axes = new Map();
  const rays = new Map();

  const tell = (what, detail = "") => {
    streams.close();
    page.send("xr", { what, detail: String(detail).slice(0, 200) });
    page.happened(what);
  };
  const base = (painter) => { layer = drawIn(session, painter.gl); };
  const pulse = (source, [strength, ms]) => { source.gamepad?.hapticActuators?.[0]?.pulse?.(strength, ms)?.catch?.(() => {}); };

  // ---- the board and what points at it ----

  function placeBoard({ position: p, orientation: q }) {
    const way = rotated(q, [0, 0, -1]);
    const flat = Math.hypot(way[0], way[2]);
    // A step with a figure has it straight ahead on the floor's axes; else the board is where one looks.
    const [fx, fz] = stage || flat < 0.2 ? [0, -1] : [way[0] / flat, way[2] / flat];
    const [ahead, below] = stage ? [BOARD.figure_ahead_m, BOARD.figure_below_m] : [BOARD.ahead_m, BOARD.below_m];
    const tilt = stage ? BOARD.tilt : 0.1;
    const [c, s] = [Math.cos(tilt), Math.sin(tilt)];
    place = { middle: [p.x + ahead * fx, p.y - below, p.z + ahead * fz], right: [-fz, 0, fx], up: [s * fx, c, s * fz] };
    isPlaced = true;
  }

  const rayOf = (source, frame) => {
    const pose = frame.getPose(source.targetRaySpace, space);
    if (!pose) return null;
    const { position: p, orientation: q } = pose.transform;
    return { pose, from: [p.x, p.y, p.z], way: rotated(q, [0, 0, -1]) };
  };

  const hitOf = (ray) => (ray && place ? meet(place, ray.from, ray.way) : null);

  const control = (source, name, value) => streams.row("responses", performance.now(), [7 * sideOf(source) + CONTROLS_A_SIDE.indexOf(name), value]);

  // A press is timed as it begins: `select` comes when it ends, or not at all.
  session.addEventListener("selectstart", ({ inputSource: source, frame }) => {
    control(source, "trigger", 1);
    if (!isSeen() || isOff) return;
    let ray = rays.get(source)?.ray;
    try { ray = rayOf(source, frame) || ray; } catch { /* a frame that is over: where the ray was last */ }
    const hit = hitOf(ray);
    board.refresh();
    if (hit && board.press(hit.at)) pulse(source, PULSE.press);
  });
  session.addEventListener("selectend", ({ inputSource: source }) => { control(source, "trigger", 0); board.release(); });

  // ---- what happens ----

  session.addEventListener("visibilitychange", () => tell({ visible: "visible", "visible-blurred": "blurred", hidden: "hidden" }[session.visibilityState]));
  space.addEventListener("reset", () => { isPlaced = false; still = null; tell("reset"); });
  session.addEventListener("inputsourceschange", ({ added, removed }) => {
    for (const source of removed) { rays.delete(source); board.release(); }
    const rest = [...session.inputSources];
    if (removed.length && !rest.length) tell("controllers_asleep");
    else if (added.length && rest.length === added.length) tell(added.some((s) => s.hand) ? "hands" : "controllers_awake");
  });
  session.addEventListener("end", () => {
    isOver = true;
    tell("ended");
    hall.gl.getExtension("WEBGL_lose_context")?.loseContext();
  });
  navigator.getBattery?.().then((battery) => battery.addEventListener("levelchange", () => {
    if (!isOver && battery.level <= LOW_BATTERY_01 && !battery.charging) tell("battery_low", battery.level);
  }), () => {});

  // ---- frames ----

  function noteFrame(time, predicted, begunMs, head, hasDrawn) {
    const lastGap = lastXr === null ? null : time - lastXr;
    const known = session.frameRate ? 1000 / session.frameRate : [...gaps].sort((a, b) => a - b)[Math.floor(gaps.length / 10)];
    const skipped = lastGap && known ? Math.max(0, Math.round(lastGap / known) - 1) : 0;
    if (lastGap) gaps = [...gaps.slice(-89), lastGap];
    lastXr = time;
    // A frame that was left out is a row of which nothing is known; a long hole ends the batch. A headset that
    // leaves out every second frame would else send an event a frame.
    if (skipped > MAX_FILLED) for (const name of ["head", "frame_timing"]) streams.skip(name, skipped);
    else for (let i = 0; i < skipped; i += 1) {
      streams.row("head", begunMs, NOT_THERE);
      streams.row("frame_timing", begunMs, [NaN, NaN, NaN, 0, 0], { xr0_ms: time });
    }
    streams.row("head", begunMs, head);
    const { xr0_ms: xr0 } = streams.start("frame_timing", begunMs) || { xr0_ms: time };
    streams.row("frame_timing", begunMs, [time - xr0, predicted - xr0, performance.now() - begunMs, skipped, hasDrawn ? 1 : 0], { xr0_ms: time });
  }

  // A headset that lies on a table goes on telling where it is: but no head holds so still.
  function lookWhetherWorn(row, ms) {
    if (row === NOT_THERE) return;
    const moved = still && (Math.hypot(row[0] - still.row[0], row[1] - still.row[1], row[2] - still.row[2]) > STILL.m
      || 2 * Math.acos(Math.min(1, Math.abs(row[3] * still.row[3] + row[4] * still.row[4] + row[5] * still.row[5] + row[6] * still.row[6]))) > STILL.rad);
    if (!still || moved) {
      still = { row, ms, frames: 0 };
      if (isOff) { isOff = false; tell("on"); }
    } else {
      still.frames += 1;
      if (!isOff && still.frames >= STILL.frames && ms - still.ms > 1000 * STILL.s) { isOff = true; tell("off"); }
    }
  }

  function noteControls(source) {
    const { gamepad } = source;
    if (!gamepad) return;
    const values = [...BUTTONS.map(([name, i]) => [name, gamepad.buttons[i]?.value, 0]), ...AXES.map(([name, i]) => [name, gamepad.axes[i], AXIS_STEP])];
    for (const [name, value, least] of values) {
      const key = `${source.handedness}${name}`;
      if (value === undefined || Math.abs(value - (axes.get(key) || 0)) <= least) continue;
      axes.set(key, value);
      control(source, name, value);
    }
  }

  function noteHands(frame, ms) {
    if (ms - handMs < HAND_MS) return;
    const hands = [...session.inputSources].filter((s) => s.hand);
    if (!hands.length) return;
    handMs = ms;
    const row = [0, 1].flatMap((side) => {
      const source = hands.find((s) => sideOf(s) === side);
      const joints = source ? [...source.hand.values()] : Array(25).fill(null);
      return joints.flatMap((joint) => poseRow(joint && frame.getJointPose(joint, space)));
    });
    streams.row("hands", ms, row);
  }

  function pictureOf(painter) {
    let picture = pictures.get(painter);
    const { gl } = painter;
    const isNew = board.refresh();
    if (!picture) { picture = painter.picture(board.canvas, gl.LINEAR); pictures.set(painter, picture); }
    else if (isNew) { gl.bindTexture(gl.TEXTURE_2D, picture); gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, board.canvas); }
    return picture;
  }

  // What hangs in the world besides figures: the board, rays, and a dot where one meets the board.
  function cardsOf(painter, head, toWorld) {
    const turned = (v) => { const [a, b] = [toWorld(v), toWorld([0, 0, 0])]; return a.map((x, i) => x - b[i]); };
    const card = (middle, across, along, more) => ({ middle: toWorld(middle), across: turned(across), along: turned(along), ...more });
    const cards = [card(place.middle, place.right.map((a) => a * WIDTH_M), place.up.map((a) => a * HEIGHT_M), { picture: pictureOf(painter) })];
    for (const { ray, hit } of rays.values()) {
      const far = hit ? hit.far_m : RAY_M;
      const middle = ray.from.map((f, i) => f + 0.5 * far * ray.way[i]);
      const to = middle.map((m, i) => head[i] - m);
      const side = [ray.way[1] * to[2] - ray.way[2] * to[1], ray.way[2] * to[0] - ray.way[0] * to[2], ray.way[0] * to[1] - ray.way[1] * to[0]];
      const wide = Math.hypot(...side) || 1;
      cards.push(card(middle, side.map((s) => s / wide * RAY_WIDE_M), ray.way.map((w) => w * far), { colour: [0.2, 0.4, 0.62] }));
      if (hit) {
        const end = ray.from.map((f, i) => f + (far - 0.004) * ray.way[i]);
        cards.push(card(end, place.right.map((a) => a * DOT_M), place.up.map((a) => a * DOT_M), { colour: [0.85, 0.35, 0.1] }));
      }
    }
    return cards;
  }

  function onFrame(time, frame) {
    if (isOver) return;
    session.requestAnimationFrame(onFrame);
    const begunMs = performance.now();
    const predicted = frame.predictedDisplayTime ?? NaN;
    const viewer = frame.getViewerPose(space);
    const head = poseRow(viewer);
    lookWhetherWorn(head, begunMs);
    rays.clear();
    for (const source of session.inputSources) {
      const ray = rayOf(source, frame);
      if (source.handedness !== "none") streams.row("pointer", begunMs, [sideOf(source), ...poseRow(ray?.pose)]);
      noteControls(source);
      if (ray) rays.set(source, { ray, hit: hitOf(ray) });
    }
    noteHands(frame, begunMs);
    let pointed = null;
    for (const [source, { hit }] of rays) if (hit) pointed = { source, at: hit.at };
    if (pointed) board.drag(pointed.at);
    if (board.point(pointed?.at) && pointed) pulse(pointed.source, PULSE.hover);
    const isKnown = head !== NOT_THERE && layer;
    if (isKnown) {
      if (!isPlaced) placeBoard(viewer.transform);
      const { painter, draw, stand } = stage || { painter: hall, draw: null, stand: standAt([0, 0, 0], [0, 0, -1]) };
      const { position: p } = viewer.transform;
      const target = { framebuffer: layer.framebuffer, width: layer.framebufferWidth, height: layer.framebufferHeight, cards: cardsOf(painter, [p.x, p.y, p.z], stand.toWorld) };
      const views = eyesOf(viewer, layer, stand);
      if (draw) draw(Number.isFinite(predicted) ? predicted : time, views, target);
      else painter.draw(new Float32Array(0), 0, views, target);
      frames += 1;
    }
    noteFrame(time, predicted, begunMs, head, isKnown);
  }

  base(hall);
  session.requestAnimationFrame(onFrame);
  return {
    board,
    place: () => place,
    frames: () => frames,
    isPresenting: () => !isOver,
    isPaused: () => !isSeen() || isOff,
    facts: () => ({ entered: true, rate_hz: session.frameRate ?? null, space: "local-floor", renderer: rendererOf(hall.gl),
      controllers: [...session.inputSources].map((s) => s.handedness), profiles: [...new Set([...session.inputSources].flatMap((s) => s.profiles.slice(0, 1)))] }),
    /** Draw a step's stage from now on: `draw(ms, views, target)` is called once a frame. */
    async attach(painter, draw, eye, aim) {
      await painter.gl.makeXRCompatible();
      if (isOver) return;
      stage = { painter, draw, stand: standAt(eye, aim) };
      isPlaced = false;
      base(painter);
    },
    detach(painter) {
      if (isOver || stage?.painter !== painter) return;
      stage = null;
      isPlaced = false;
      base(hall);
    },
    lost: () => tell("context_lost"),
    begin() { board.begin(); },
    /** Pass on the samples so far: what comes next is acknowledged only after them. */
    close: () => streams.close(),
    leave: () => session.end(),
  };
}

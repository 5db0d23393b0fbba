// Blends of example motions, by the formulas of visavis.stimuli.motion.synthesis: style_weights,
// example_blend and blend_kernels. Numbers are doubles here, too, and operations come in the same
// order, so that a page and Python agree to far below a thousandth of a degree.

const SQUARINGS = 12;
const STRAIGHT = 0.99999;
const PARALLEL = 1e-6;
const PASSING_M = 0.005;
const X_AXIS = [1, 0, 0];
const DOWN = [0, -1, 0];

// ---- the file -------------------------------------------------------------------------------

const KINDS = { f8: Float64Array, f4: Float32Array, u4: Uint32Array, u1: Uint8Array };

/** Read a file of `page_arrays.packed_arrays`: its head, and its arrays by name. */
export function readArrays(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const padded = (n) => Math.ceil(n / 8) * 8;
  let at = padded(4 + length);
  const arrays = {};
  for (const [name, shape, kind] of head.arrays) {
    arrays[name] = new KINDS[kind](buffer, at, shape.reduce((a, b) => a * b, 1));
    at += padded(arrays[name].byteLength);
  }
  return { head, arrays };
}

/** Read a file of `blend_file.packed_examples`. */
export function readBlend(buffer) {
  const { head, arrays } = readArrays(buffer);
  const blend = { names: head.names, joints: head.joints, frameS: head.frame_s, ...arrays };
  blend.n = head.names.length;
  blend.keys = blend.key_s.length / blend.n;
  blend.sliders = blend.points ? blend.points.length / blend.n : blend.n;
  return blend;
}

// ---- weights --------------------------------------------------------------------------------

function bSpline(x) {
  const r = Math.abs(x);
  return r < 1 ? 2 / 3 - r * r + 0.5 * r ** 3 : (2 - Math.min(r, 2)) ** 3 / 6;
}

/** Return the weights of all examples for slider values: from 0 to 1, with the sum 1. */
export function weightsAt(blend, values) {
  const { n, sliders: d } = blend;
  const w = new Float64Array(n);
  if (!blend.points) w.set(values);
  else {
    const near = new Float64Array(n);
    const distances = new Float64Array(n);
    for (let k = 0; k < n; k += 1) {
      let squares = 0;
      for (let j = 0; j < d; j += 1) squares += (values[j] - blend.points[k * d + j]) ** 2;
      distances[k] = Math.sqrt(squares);
      near[k] = bSpline(distances[k] / blend.reach[k]);
    }
    for (let i = 0; i < n; i += 1) {
      let raw = blend.linear[i];
      for (let j = 0; j < d; j += 1) raw += values[j] * blend.linear[(j + 1) * n + i];
      for (let k = 0; k < n; k += 1) raw += near[k] * blend.radial[k * n + i];
      w[i] = Math.min(1, Math.max(0, raw));
    }
    if (!w.some((share) => share > 0)) w[distances.indexOf(Math.min(...distances))] = 1;
  }
  const total = w.reduce((a, b) => a + b, 0);
  return total > 0 ? w.map((share) => share / total) : w.fill(1 / n);
}

/** Return the times of the blend's key moments. */
export function keyTimes(blend, w) {
  const times = new Float64Array(blend.keys);
  for (let k = 0; k < blend.keys; k += 1) for (let i = 0; i < blend.n; i += 1) times[k] += w[i] * blend.key_s[i * blend.keys + k];
  return times;
}

// ---- vectors and rotations (w, x, y, z) -------------------------------------------------------

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, f) => [a[0] * f, a[1] * f, a[2] * f];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const inverse = (q) => [q[0], -q[1], -q[2], -q[3]];

function unit(a, otherwise) {
  const length = Math.sqrt(dot(a, a));
  return length < 1e-9 ? otherwise : [a[0] / length, a[1] / length, a[2] / length];
}

function times(a, b) {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}

function rotate(q, v) {
  const axis = [q[1], q[2], q[3]];
  const t = scaled(cross(axis, v), 2);
  return plus(plus(v, scaled(t, q[0])), cross(axis, t));
}

function about(axis, angle) {
  const s = Math.sin(0.5 * angle);
  return [Math.cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]];
}

function between(a, b) {
  const w = 1 + dot(a, b);
  if (w < 1e-9) return [0, 1, 0, 0];
  const c = cross(a, b);
  const n = Math.sqrt(w * w + dot(c, c));
  return [w / n, c[0] / n, c[1] / n, c[2] / n];
}

/** Slerp over the shorter arc between two rows of four numbers; writes into `out`. */
function slerp(rows, a, b, h, out) {
  const a0 = rows[a], a1 = rows[a + 1], a2 = rows[a + 2], a3 = rows[a + 3];
  let b0 = rows[b], b1 = rows[b + 1], b2 = rows[b + 2], b3 = rows[b + 3];
  if (a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3 < 0) { b0 = -b0; b1 = -b1; b2 = -b2; b3 = -b3; }
  const s0 = a0 + b0, s1 = a1 + b1, s2 = a2 + b2, s3 = a3 + b3;
  const d0 = a0 - b0, d1 = a1 - b1, d2 = a2 - b2, d3 = a3 - b3;
  const s = Math.sqrt(s0 * s0 + s1 * s1 + s2 * s2 + s3 * s3);
  const d = Math.sqrt(d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3);
  let u = 1 - h, v = h;
  if (d >= 1e-9) {
    const angle = 2 * Math.atan2(d, s);
    const sine = 0.5 * s * d;
    u = Math.sin((1 - h) * angle) / sine;
    v = Math.sin(h * angle) / sine;
  }
  out[0] = u * a0 + v * b0; out[1] = u * a1 + v * b1; out[2] = u * a2 + v * b2; out[3] = u * a3 + v * b3;
}

// Add weight · q qᵀ to a moment: sixteen numbers from `at`.
function addRotation(moments, at, q, weight) {
  for (let a = 0; a < 4; a += 1) {
    const left = weight * q[a];
    for (let b = 0; b < 4; b += 1) moments[at + 4 * a + b] += left * q[b];
  }
}

const moment = new Float64Array(16);
const square = new Float64Array(16);

/** Return the greatest eigenvector of the moment (16 numbers from `at`), on the side of `near`. */
function meanRotation(moments, at, near, nearAt) {
  const m = moment;
  for (let i = 0; i < 16; i += 1) m[i] = moments[at + i];
  for (let round = 0; round < SQUARINGS; round += 1) {
    const trace = m[0] + m[5] + m[10] + m[15];
    const squared = trace * trace;
    for (let i = 0; i < 4; i += 1) {
      const row = 4 * i;
      for (let j = i; j < 4; j += 1) {
        // The moment is symmetric: its columns are its rows.
        const other = 4 * j;
        const total = (m[row] * m[other] + m[row + 1] * m[other + 1] + m[row + 2] * m[other + 2] + m[row + 3] * m[other + 3]) / squared;
        square[row + j] = total;
        square[other + i] = total;
      }
    }
    m.set(square);
  }
  let column = 0;
  for (let i = 1; i < 4; i += 1) if (m[5 * i] > m[5 * column]) column = i;
  const w = m[column], x = m[4 + column], y = m[8 + column], z = m[12 + column];
  let n = Math.sqrt(w * w + x * x + y * y + z * z);
  if (w * near[nearAt] + x * near[nearAt + 1] + y * near[nearAt + 2] + z * near[nearAt + 3] < 0) n = -n;
  return [w / n, x / n, y / n, z / n];
}

// ---- poses ----------------------------------------------------------------------------------

/** Place all joints: `pose.place` and `pose.world` from `pose.root` and `pose.turns`. */
export function placeAll({ parents, joints, offsets_m: offsets }, { root, turns, place, world }) {
  for (let i = 0; i < 3; i += 1) place[0][i] = root[i];
  world[0] = turns[0];
  for (let j = 1; j < joints; j += 1) { // nothing is made anew: a frame places everybody's joints
    const [w, x, y, z] = world[parents[j]];
    const [px, py, pz] = place[parents[j]];
    const [a, b, c] = [offsets[3 * j], offsets[3 * j + 1], offsets[3 * j + 2]];
    const [ta, tb, tc] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
    const [at, all, turn] = [place[j], world[j], turns[j]];
    at[0] = px + (a + w * ta + (y * tc - z * tb));
    at[1] = py + (b + w * tb + (z * ta - x * tc));
    at[2] = pz + (c + w * tc + (x * tb - y * ta));
    const [tw, tx, ty, tz] = turn;
    all[0] = w * tw - x * tx - y * ty - z * tz;
    all[1] = w * tx + x * tw + y * tz - z * ty;
    all[2] = w * ty - x * tz + y * tw + z * tx;
    all[3] = w * tz + x * ty - y * tx + z * tw;
  }
}

const offsetOf = (blend, j) => [blend.offsets_m[3 * j], blend.offsets_m[3 * j + 1], blend.offsets_m[3 * j + 2]];

// From where the heel's goal wants the ankle to where the ball's goal does.
function heelToBall(footTurn, heel, ball, heelGoal, ballGoal) {
  return minus(minus(ballGoal, heelGoal), rotate(footTurn, minus(ball, heel)));
}

// The frames before and after a place in frames, and the share of the way between.
function framesAt(blend, i, k, h) {
  const { keys, key_s: keyS, first } = blend;
  const at = ((1 - h) * keyS[i * keys + k] + h * keyS[i * keys + k + 1]) / blend.frameS;
  const frame = Math.min(first[i + 1] - first[i] - 1, Math.floor(at));
  const here = first[i] + frame;
  return [here, here + 1 < first[i + 1] ? here + 1 : first[i], at - frame];
}

// `heelToBall` of a foot at the phase where it stands flat; it depends on weights alone.
function flatGap(blend, w, side) {
  const phase = blend.flat_phases[side];
  const k = Math.min(blend.keys - 2, Math.floor(phase));
  const sum = new Float64Array(16);
  const goals = [[0, 0, 0], [0, 0, 0]];
  const q = [0, 0, 0, 0];
  let near = [1, 0, 0, 0];
  let most = 0;
  for (let i = 0; i < blend.n; i += 1) {
    if (w[i] <= 0) continue;
    const [here, after, share] = framesAt(blend, i, k, phase - k);
    slerp(blend.foot_turns, 4 * (4 * here + 2 * side), 4 * (4 * after + 2 * side), share, q);
    addRotation(sum, 0, q, w[i]);
    if (w[i] > most) [near, most] = [[...q], w[i]];
    for (let f = 0; f < 2; f += 1) {
      for (let c = 0; c < 3; c += 1) {
        const [a, b] = [here, after].map((row) => blend.foot_m[12 * row + 3 * (2 * side + f) + c]);
        goals[f][c] += w[i] * (after > here ? (1 - share) * a + share * b : a);
      }
    }
  }
  const ball = offsetOf(blend, blend.feet[2 * side + 1]);
  return heelToBall(meanRotation(sum, 0, near, 0), [...blend.heel_m], ball, ...goals);
}

// Bring heel and ball of one foot to their goals: by the knee's bend, then by the whole leg.
function leadLeg(blend, pose, side, goalM, goalTurns, gap) {
  const { parents, feet } = blend;
  const [foot, toes] = [feet[2 * side], feet[2 * side + 1]];
  const shin = parents[foot];
  const thigh = parents[shin];
  const heel = [...blend.heel_m];
  const ball = offsetOf(blend, toes);
  const [heelGoal, ballGoal, footTurn] = [goalM[2 * side], goalM[2 * side + 1], goalTurns[2 * side]];
  const heelUp = heelGoal[1] - (ballGoal[1] - (ball[1] - heel[1]));
  const onBall = Math.min(1, Math.max(0, heelUp / PASSING_M));
  const byHeel = minus(heelGoal, rotate(footTurn, heel));
  const ahead = minus(heelToBall(footTurn, heel, ball, heelGoal, ballGoal), gap);
  const ankle = plus(byHeel, scaled(ahead, onBall));
  const [hipAt, kneeAt, ankleAt] = [pose.place[thigh], pose.place[shin], pose.place[foot]];
  const up = minus(hipAt, kneeAt);
  const down = minus(ankleAt, kneeAt);
  const [l1, l2] = [Math.sqrt(dot(up, up)), Math.sqrt(dot(down, down))];
  const to = minus(ankle, hipAt);
  const reach = Math.min(STRAIGHT * (l1 + l2), Math.max(Math.abs(l1 - l2) / STRAIGHT, Math.sqrt(dot(to, to))));
  let thighTurn = pose.world[thigh];
  const across = scaled(cross(up, down), 1 / (l1 * l2));
  let hinge = unit(across, X_AXIS);
  if (dot(across, across) < PARALLEL * PARALLEL) hinge = rotate(thighTurn, X_AXIS);
  const before = Math.acos(Math.min(1, Math.max(-1, dot(up, down) / (l1 * l2))));
  const after = Math.acos(Math.min(1, Math.max(-1, (l1 * l1 + l2 * l2 - reach * reach) / (2 * l1 * l2))));
  const bend = about(hinge, after - before);
  const bent = minus(plus(kneeAt, rotate(bend, down)), hipAt);
  const swing = between(unit(bent, DOWN), unit(to, DOWN));
  thighTurn = times(swing, thighTurn);
  const shinTurn = times(swing, times(bend, pose.world[shin]));
  pose.turns[thigh] = times(inverse(pose.world[parents[thigh]]), thighTurn);
  pose.turns[shin] = times(inverse(thighTurn), shinTurn);
  pose.turns[foot] = times(inverse(shinTurn), footTurn);
  pose.turns[toes] = times(inverse(footTurn), goalTurns[2 * side + 1]);
}

export function newPose(blend) {
  const rows = (numbers) => Array.from({ length: blend.joints }, () => [...numbers]);
  return { root: [0, 0, 0], turns: rows([1, 0, 0, 0]), place: rows([0, 0, 0]), world: rows([1, 0, 0, 0]) };
}

/** Return what `poseAt` needs of weights; it does not change over time. */
export const gapsOf = (blend, w) => [0, 1].map((side) => flatGap(blend, w, side));

/** Write the blend at a phase from 0 to K into a pose: its root, and turns against the parent. */
export function poseAt(blend, w, phase, pose, gaps = gapsOf(blend, w)) {
  const { n, joints, keys } = blend;
  const all = joints + 4;
  const moments = new Float64Array(16 * all);
  const heaviest = new Float64Array(4 * all);
  const goalM = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]];
  const q = [0, 0, 0, 0];
  pose.root = [0, 0, 0];
  let most = 0;
  const k = Math.min(keys - 2, Math.floor(phase));
  const h = phase - k;
  for (let i = 0; i < n; i += 1) {
    if (w[i] <= 0) continue;
    const [here, after, share] = framesAt(blend, i, k, h);
    for (let c = 0; c < 3; c += 1) {
      const way = after < here ? blend.travel_m[3 * i + c] : 0;
      pose.root[c] += w[i] * ((1 - share) * blend.root_m[3 * here + c] + share * (blend.root_m[3 * after + c] + way));
      for (let f = 0; f < 4; f += 1) {
        goalM[f][c] += w[i] * ((1 - share) * blend.foot_m[12 * here + 3 * f + c] + share * (blend.foot_m[12 * after + 3 * f + c] + way));
      }
    }
    const isHeaviest = w[i] > most;
    most = Math.max(most, w[i]);
    for (let j = 0; j < all; j += 1) {
      if (j < joints) slerp(blend.turns, 4 * (here * joints + j), 4 * (after * joints + j), share, q);
      else slerp(blend.foot_turns, 4 * (4 * here + j - joints), 4 * (4 * after + j - joints), share, q);
      addRotation(moments, 16 * j, q, w[i]);
      if (isHeaviest) for (let a = 0; a < 4; a += 1) heaviest[4 * j + a] = q[a];
    }
  }
  for (let j = 0; j < joints; j += 1) pose.turns[j] = meanRotation(moments, 16 * j, heaviest, 4 * j);
  const goalTurns = [0, 1, 2, 3].map((f) => meanRotation(moments, 16 * (joints + f), heaviest, 4 * (joints + f)));
  placeAll(blend, pose);
  for (const side of [0, 1]) leadLeg(blend, pose, side, goalM, goalTurns, gaps[side]);
  return pose;
}

/** Return the phase at a time of the blend, from 0 to K, and how far it has come in place. */
export function phaseOf(keyS, seconds) {
  const cycle = keyS[keyS.length - 1];
  const own = seconds - Math.floor(seconds / cycle) * cycle;
  let k = 0;
  while (k < keyS.length - 2 && own >= keyS[k + 1]) k += 1;
  return k + (own - keyS[k]) / (keyS[k + 1] - keyS[k]);
}

/** Return where the figure stands at a phase if the way ahead is taken out, evenly over time. */
export function inPlace(blend, w, keyS, phase, root) {
  const k = Math.min(keyS.length - 2, Math.floor(phase));
  const share = (keyS[k] + (phase - k) * (keyS[k + 1] - keyS[k])) / keyS[keyS.length - 1];
  const way = [0, 0, 0];
  for (let i = 0; i < blend.n; i += 1) for (let c = 0; c < 3; c += 1) way[c] += w[i] * blend.travel_m[3 * i + c];
  return minus(root, scaled(way, share));
}

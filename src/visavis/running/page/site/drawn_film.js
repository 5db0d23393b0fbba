// A film that is drawn on the page: its people move in their room as was computed before.

import * as blends from "./blend.js";
import { readPerson } from "./glb.js";
import { boneRows } from "./painting.js";

/** Read how somebody moves (`live_film`): a row for every picture, of the root and the turns of `moving`. */
export function motionOf({ head, arrays }) {
  const { moving, frames, step } = head;
  const { changes, root_m: root, rest } = arrays;
  const wide = 3 + 4 * moving.length;
  const all = wide * frames;
  const rows = new Float32Array(all);
  for (let c = 0; c < wide; c += 1) {
    const first = c < 3 ? root[c] : rest[4 * moving[(c - 3) >> 2] + ((c - 3) & 3)];
    let at = 0;
    let speed = 0;
    for (let k = 0; k < frames; k += 1) {
      const i = frames * c + k;
      const whole = changes[i] + 256 * (changes[all + i] + 256 * (changes[2 * all + i] + 256 * changes[3 * all + i]));
      speed += whole % 2 ? -(whole + 1) / 2 : whole / 2;
      at += speed;
      rows[wide * k + c] = first + step * at;
    }
  }
  return { rows, wide };
}

/** Let a person move as a file of poses says, again and again or `once`; then they stay as they are. */
export function actorOf(file, person, number, shade, once) {
  const { joints, parents, moving, frames, rate_hz: rate } = file.head;
  const { offsets_m: offsets, rest } = file.arrays;
  const { rows, wide } = motionOf(file);
  const body = { joints, parents, offsets_m: offsets };
  const pose = blends.newPose(body);
  for (let j = 0; j < joints; j += 1) for (let i = 0; i < 4; i += 1) pose.turns[j][i] = rest[4 * j + i];
  const lastS = frames / rate;
  let nowS = 0;
  return {
    rounds: 0,
    pose,
    again() { this.rounds = 0; nowS = 0; },
    step(seconds, bones) {
      nowS += seconds;
      const rounds = Math.floor(nowS / lastS);
      if (once) { this.rounds = Math.min(1, rounds); nowS = Math.min(nowS, lastS); } else { this.rounds += rounds; nowS -= rounds * lastS; }
      const k = Math.min(frames - 1, Math.floor(nowS * rate));
      const share = Math.min(1, nowS * rate - k);
      const [here, after] = [wide * k, wide * Math.min(frames - 1, k + 1)];
      for (let i = 0; i < 3; i += 1) pose.root[i] = (1 - share) * rows[here + i] + share * rows[after + i];
      for (let m = 0; m < moving.length; m += 1) {
        const turn = pose.turns[moving[m]];
        for (let i = 0; i < 4; i += 1) turn[i] = (1 - share) * rows[here + 3 + 4 * m + i] + share * rows[after + 3 + 4 * m + i];
        const n = Math.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]);
        for (let i = 0; i < 4; i += 1) turn[i] /= n;
      }
      blends.placeAll(body, pose);
      for (let j = 0; j < joints; j += 1) boneRows(pose.world[j], 0, pose.place[j], 0, person.rest, 3 * j, bones, 12 * (number * joints + j));
      shade.middle = [pose.root[0], pose.root[2]];
    },
  };
}

/**
 * Return who moves in a film that is drawn here, once its room stands on the stage.
 *
 * `load(asset)` returns a file, and `addShade()` the light that a body keeps off the floor.
 */
export async function actorsOf({ live, once }, stage, load, addShade) {
  const room = blends.readArrays(await load(live.room));
  const names = room.head.runs.map(([, , name]) => name).filter(Boolean);
  const images = await Promise.all(names.map((name) => createImageBitmap(new Blob([room.arrays[name]], { type: "image/webp" }),
    { premultiplyAlpha: "none", colorSpaceConversion: "none" })));
  stage.surround(room, Object.fromEntries(names.map((name, i) => [name, images[i]])));
  const actors = [];
  let joints = 0;
  for (const one of live.people) {
    const poses = blends.readArrays(await load(one.poses));
    const person = await readPerson(await load(one.person));
    actors.push(actorOf(poses, person, stage.add(person), addShade(), once));
    joints = poses.head.joints;
  }
  return { walkers: actors, joints };
}

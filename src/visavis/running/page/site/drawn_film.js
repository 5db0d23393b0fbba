// A film that is drawn on the page: its people move in their room as was computed before.

import * as blends from "./blend.js";
import { readPerson } from "./glb.js";
import { boneRows } from "./painting.js";

/** Let a person move as a file of poses says, again and again or `once`; then they stay as they are. */
function actorOf({ head, arrays }, person, stage, shade, once) {
  const { joints, parents, moving, frames, rate_hz: rate } = head;
  const body = { joints, parents, offsets_m: arrays.offsets_m };
  const pose = blends.newPose(body);
  const turnAt = (turns, i) => Array.from(turns.subarray(4 * i, 4 * i + 4));
  for (let j = 0; j < joints; j += 1) pose.turns[j] = turnAt(arrays.rest, j);
  const number = stage.add(person);
  const lastS = frames / rate;
  const between = (values, i, k, n, share) => (1 - share) * values[n * k + i] + share * values[n * Math.min(frames - 1, k + 1) + i];
  let nowS = 0;
  return {
    rounds: 0,
    again() { this.rounds = 0; nowS = 0; },
    step(seconds, bones) {
      nowS += seconds;
      const rounds = Math.floor(nowS / lastS);
      if (once) { this.rounds = Math.min(1, rounds); nowS = Math.min(nowS, lastS); } else { this.rounds += rounds; nowS -= rounds * lastS; }
      const k = Math.min(frames - 1, Math.floor(nowS * rate));
      const share = nowS * rate - k;
      pose.root = [0, 1, 2].map((i) => between(arrays.root_m, i, k, 3, Math.min(1, share)));
      moving.forEach((j, m) => {
        const turn = [0, 1, 2, 3].map((i) => between(arrays.turns, 4 * m + i, k, 4 * moving.length, Math.min(1, share)));
        const n = Math.hypot(...turn);
        pose.turns[j] = turn.map((part) => part / n);
      });
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
    actors.push(actorOf(poses, await readPerson(await load(one.person)), stage, addShade(), once));
    joints = poses.head.joints;
  }
  return { walkers: actors, joints };
}

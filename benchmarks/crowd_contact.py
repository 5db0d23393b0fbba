"""Time the online contact test: six arm capsules against crowds of 100 to 300 people.

    python -m benchmarks.crowd_contact [--frames 20000] [--json]

Every frame poses anew who is touched or may have come near since last posed. The floor is what a
frame costs in which it is known who is touched: the same call, the poses of these people at that
instant, their touches as Python objects, and no test of who is near.
"""

import argparse
import gc
import json
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import StopWatch, cpu_time_s
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.body import ARM_JOINTS, capsule_body
from visavis.stimuli.contact.figures import Figures, crowd_figures
from visavis.stimuli.contact.idle import crowd_poses, people_of, workspace
from visavis.stimuli.contact.touch import (
    MAX_TOUCHES,
    Lasting,
    LastPoses,
    Touch,
    TouchSensor,
    no_poses,
    pose_person,
    touches_of,
)
from visavis.stimuli.scenes.station_crowd import CHARACTERS, Crowd, poisson_disk

LIMIT_MS, LIMIT_P99_MS = 0.02, 0.1
FRAMES = 20_000


def crowd_of(n: int, rng: np.random.Generator) -> Crowd:
    """Return a square of n people at the study's density."""
    side = np.sqrt(n / 1.47)
    position = poisson_disk(side + 0.5, 0.68, rng)[:n] - side / 2
    n = len(position)
    return Crowd(
        1,
        position,
        2 * np.pi * rng.random(n),
        1.6 + 0.3 * rng.random(n),
        (rng.random(n) < 0.5).astype(np.int64),
        rng.integers(0, len(CHARACTERS), n),
        rng.integers(0, 2**31, n),
        np.zeros(n, np.int64),
    )


@dataclass(frozen=True)
class Walk:
    """A walk through a crowd: ends of six arm capsules (6, 3) and whom they touch, frame by frame.

    `how` are the touches of each frame (n, 7), `who` the numbers of the people in them (k,).
    """

    crowd: Crowd
    ends_m: list[tuple[Vector, Vector]]
    radius_m: Vector
    how: list[Vector]
    who: list[npt.NDArray[np.int64]]


def walk_through(n: int, frames: int) -> Walk:
    """Return a walk across a square of n people."""
    rng = np.random.default_rng(n)
    crowd = crowd_of(n, rng)
    arms = capsule_body(1.75, ARM_JOINTS)
    walker = people_of(crowd)[:1].copy()
    sensor = TouchSensor(crowd)
    ends_m, how, who = [], [], []
    for i, x in enumerate(np.linspace(crowd.position_m.min(), crowd.position_m.max(), frames)):
        walker[0, :2] = x, -x
        starts, ends = arms.posed(*(p[0] for p in crowd_poses(walker, 0.01 * x)))
        touches = sensor.touches(starts, ends, arms.radius_m, i / 90)
        ends_m.append((starts, ends))
        how.append(np.array([(*t[:4], *t.point_m) for t in touches]).reshape(-1, 7))
        who.append(np.array(sorted({t.person for t in touches}), np.int64))
    return Walk(crowd, ends_m, arms.radius_m, how, who)


@compiled
def pose_touched(
    part_starts: Vector,
    part_ends: Vector,
    part_radii: Vector,
    t_s: float,
    lasting: Lasting,
    who: npt.NDArray[np.int64],
) -> int:
    """Pose these people, as many arguments as the product's own call has; return how many."""
    people, poses, figures, _ = lasting
    last = LastPoses(*poses)
    room = workspace()
    for i in who:
        starts, ends = last.ends_m[i, 0], last.ends_m[i, 1]
        pose_person(people[i], t_s, Figures(*figures), room, starts, ends)
        last.t_s[i] = t_s
    return len(who)


def pose_known(walk: Walk) -> tuple[float, LastPoses, list[tuple[Touch, ...]]]:
    """Pose and describe all who are touched, frame by frame; return mean CPU ms, what was posed
    last, and the touches.
    """
    people = people_of(walk.crowd)
    last = no_poses(len(people))
    lasting = people, tuple(last), tuple(crowd_figures()), np.empty((MAX_TOUCHES, 7))
    touches: list[tuple[Touch, ...]] = []
    pose_touched(*walk.ends_m[0], walk.radius_m, 0.0, lasting, walk.who[0])
    begin_s = cpu_time_s()
    for i, (starts, ends) in enumerate(walk.ends_m):
        who = walk.who[i]
        pose_touched(starts, ends, walk.radius_m, i / 90, lasting, who)
        touches.append(touches_of(walk.how[i]) if len(who) else ())
    return 1e3 * (cpu_time_s() - begin_s) / len(walk.ends_m), last, touches


def time_frames(n: int, frames: int) -> dict[str, float]:
    """Return mean CPU and p99 wall milliseconds per frame of a walk through n people, the floor
    too.
    """
    walk = walk_through(n, frames)
    sensor = TouchSensor(walk.crowd)
    watch_ms = np.empty(frames)
    touching = 0
    # Modules that other benchmarks have imported are no rubbish to look through in one frame.
    gc.collect()
    gc.freeze()
    begin_s = cpu_time_s()
    for i, (starts, ends) in enumerate(walk.ends_m):
        watch = StopWatch()
        touching += bool(sensor.touches(starts, ends, walk.radius_m, i / 90))
        watch_ms[i] = 1e3 * watch.elapsed_s()
    cpu_ms = 1e3 * (cpu_time_s() - begin_s) / frames
    return {
        "people": len(walk.crowd),
        "cpu_ms": cpu_ms,
        "floor_cpu_ms": pose_known(walk)[0],
        "median_ms": float(np.median(watch_ms)),
        "p99_ms": float(np.percentile(watch_ms, 99)),
        "touching_01": touching / frames,
    }


def main() -> None:
    """Print one row per crowd."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=FRAMES)
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    options = parser.parse_args()
    rows = [time_frames(n, options.frames) for n in (100, 200, 300)]
    if options.json:
        print(json.dumps(rows))
        return
    print(
        f"{'people':>7} {'CPU ms/frame':>13} {'floor':>8} {'median ms':>10} {'p99 ms':>8} "
        f"{'in contact':>11}"
    )
    for row in rows:
        print(
            f"{row['people']:7.0f} {row['cpu_ms']:13.4f} {row['floor_cpu_ms']:8.4f} "
            f"{row['median_ms']:10.4f} "
            f"{row['p99_ms']:8.4f} {row['touching_01']:11.1%}"
        )
    worst = rows[-1]
    print(
        f"limit {LIMIT_MS} ms, p99 {LIMIT_P99_MS} ms: "
        f"{'kept' if worst['cpu_ms'] <= LIMIT_MS and worst['p99_ms'] <= LIMIT_P99_MS else 'MISSED'}"
    )


if __name__ == "__main__":
    main()

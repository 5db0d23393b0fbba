"""Time the online contact test: six arm capsules against crowds of 100 to 300 people.

    python -m benchmarks.crowd_contact [--frames 20000] [--json]

Every frame poses everybody near anew.
"""

import argparse
import json

import numpy as np

from visavis.lab.clock import StopWatch, cpu_time_s
from visavis.stimuli.contact.body import ARM_JOINTS, capsule_body
from visavis.stimuli.contact.idle import crowd_poses, people_of
from visavis.stimuli.contact.touch import TouchSensor
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


def time_frames(n: int, frames: int) -> dict[str, float]:
    """Return mean CPU and p99 wall milliseconds per frame of a walk through n people."""
    rng = np.random.default_rng(n)
    crowd = crowd_of(n, rng)
    arms = capsule_body(1.75, ARM_JOINTS)
    walker = people_of(crowd)[:1].copy()
    sensor = TouchSensor(crowd)
    path = np.linspace(crowd.position_m.min(), crowd.position_m.max(), frames)
    poses = []
    for x in path:
        walker[0, :2] = x, -x
        poses.append(arms.posed(*(p[0] for p in crowd_poses(walker, 0.01 * x))))
    for starts, ends in poses[:200]:
        sensor.touches(starts, ends, arms.radius_m, 0.0)
    watch_ms = np.empty(frames)
    touching = 0
    begun = cpu_time_s()
    for i, (starts, ends) in enumerate(poses):
        watch = StopWatch()
        touching += bool(sensor.touches(starts, ends, arms.radius_m, i / 90))
        watch_ms[i] = 1e3 * watch.elapsed_s()
    cpu_ms = 1e3 * (cpu_time_s() - begun) / frames
    return {
        "people": len(crowd),
        "cpu_ms": cpu_ms,
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
    print(f"{'people':>7} {'CPU ms/frame':>13} {'median ms':>10} {'p99 ms':>8} {'in contact':>11}")
    for row in rows:
        print(
            f"{row['people']:7.0f} {row['cpu_ms']:13.4f} {row['median_ms']:10.4f} "
            f"{row['p99_ms']:8.4f} {row['touching_01']:11.1%}"
        )
    worst = rows[-1]
    print(
        f"limit {LIMIT_MS} ms, p99 {LIMIT_P99_MS} ms: "
        f"{'kept' if worst['cpu_ms'] <= LIMIT_MS and worst['p99_ms'] <= LIMIT_P99_MS else 'MISSED'}"
    )


if __name__ == "__main__":
    main()

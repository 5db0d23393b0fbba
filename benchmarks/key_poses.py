"""How few key poses are enough? Bytes against error, by number of keys and method.

    python -m benchmarks.key_poses [--json]

The four gestures of the study interpolation are reduced to 2 to 16 key poses, found by greedy
error, and given back by every method. Error is the angle of joints (root mean square over all
frames and the joints that move) and the farthest that a wrist is off; bytes are those of the
poses' numbers, in 64 bits.
"""

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from typing import Final, get_args

import numpy as np

from visavis.experiments.interpolation.gestures import GESTURES, source_of
from visavis.experiments.interpolation.study import WRISTS
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip, placed_joints
from visavis.stimuli.motion.interpolation import Method
from visavis.stimuli.motion.rotations import same_hemisphere
from visavis.stimuli.motion.synthesis.key_poses import between_keys, key_frames

COUNTS: Final = (2, 3, 4, 6, 8, 12, 16)
MOVES_DEG: Final = 1.0


@dataclass(frozen=True)
class Row:
    """What one method gives back of one gesture from so many key poses."""

    gesture: str
    method: str
    keys: int
    bytes: int
    share_01: float
    off_deg: float
    wrist_off_cm: float


def row_of(gesture: str, clip: Clip, count: int, method: Method) -> Row:
    """Measure one."""
    motion = between_keys(clip, key_frames(clip, count), method)
    t_s = clip.frame_times_s
    given, meant = motion.at(t_s).orientation_wxyz, clip.orientation_wxyz
    moving = np.rad2deg(_angle_rad(meant, meant[:1])).max(axis=0) > MOVES_DEG
    off_deg = np.rad2deg(_angle_rad(given, meant))[:, moving]
    wrists = [clip.skeleton.index(name) for name in WRISTS]
    places = [placed_joints(m, t_s).position_m[:, wrists] for m in (motion, clip)]
    one_pose = meant[0].nbytes + clip.root_m[0].nbytes
    return Row(
        gesture,
        method,
        count,
        count * one_pose,
        count / len(t_s),
        float(np.sqrt((off_deg**2).mean())),
        float(100 * np.linalg.norm(places[0] - places[1], axis=-1).max()),
    )


def _angle_rad(a: Vector, b: Vector) -> Vector:
    chord = np.linalg.norm(same_hemisphere(a, b) - b, axis=-1)
    return np.asarray(4.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))


def main() -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true")
    as_json = parser.parse_args().json
    rows = [
        row_of(gesture, source_of(gesture), count, method)
        for gesture in GESTURES
        for count in COUNTS
        for method in get_args(Method)
    ]
    if as_json:
        print(json.dumps([asdict(row) for row in rows], indent=2))
        return 0
    print("gesture     method    keys   bytes  of all   off deg  wrist off cm")
    for r in rows:
        print(
            f"{r.gesture:11s} {r.method:9s} {r.keys:4d} {r.bytes:7d} {r.share_01:7.1%}"
            f" {r.off_deg:9.2f} {r.wrist_off_cm:13.2f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Measure posing of a crowd, and retargeting of a BVH file when one is given.

    python -m benchmarks.motion [--bvh FILE --unit-m METRES] [--json]

150 people of 55 joints at their own times in one call, key poses 30° apart. The limits are shares
of the 5 ms that a frame of 150 people may take on the main thread; "ratio" is limit / value. The
peer is scipy's rotation arithmetic on the same load. Errors of retargeting have limits of their
own: 0.01° for limb directions (exact by construction), 0.1 limb lengths for hands and feet.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.table import Row, show
from visavis.lab.clock import cpu_time_s
from visavis.lab.geometry import quat_multiply
from visavis.stimuli.motion.blending import CrossFade, InertialTransition
from visavis.stimuli.motion.bvh import read_bvh
from visavis.stimuli.motion.bvh_clip import CMU_UNIT_M, clip_of_bvh
from visavis.stimuli.motion.clip import KeyPoses
from visavis.stimuli.motion.interpolation import KeyTimes, Slerp, Squad
from visavis.stimuli.motion.retarget import retarget, retargeting_error
from visavis.stimuli.motion.rotations import quat_exp
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward

PEOPLE, KEYS = 150, 8


def cpu_ms(call: Callable[[], object], rounds: int = 60) -> float:
    """Return CPU milliseconds of one call, the least of many."""
    call()
    best = np.inf
    for _ in range(rounds):
        began_s = cpu_time_s()
        call()
        best = min(best, cpu_time_s() - began_s)
    return float(best) * 1e3


def posing(rng: np.random.Generator) -> list[Row]:
    """Time interpolation, forward kinematics and transitions for the crowd."""
    skeleton = canonical_skeleton()
    joints = len(skeleton.names)
    step = rng.normal(size=(KEYS - 1, joints, 3))
    step *= np.radians(30.0) / 2 / np.linalg.norm(step, axis=-1, keepdims=True)
    keys = [quat_exp(rng.normal(size=(joints, 3)))]
    for turn in quat_exp(step):
        keys.append(quat_multiply(keys[-1], turn))
    wxyz = np.stack(keys)
    times = KeyTimes(np.arange(float(KEYS)), period_s=float(KEYS))
    t = rng.uniform(0, KEYS, PEOPLE)
    slerp, squad = Slerp(times, wxyz), Squad(times, wxyz)
    segment, h = times.locate(t)

    def by_scipy() -> object:
        a, b = (
            Rotation.from_quat(wxyz[(segment + k) % KEYS].reshape(-1, 4), scalar_first=True)
            for k in (0, 1)
        )
        part = (a.inv() * b).as_rotvec() * np.repeat(h, joints)[:, None]
        return (a * Rotation.from_rotvec(part)).as_quat(scalar_first=True)

    moving = KeyPoses(skeleton, squad, rng.normal(size=(KEYS, 3)), smooth_root=True)
    frames = moving.at(t)
    fade, inert = (kind(moving, moving, 2.0, 1.0, 0.5) for kind in (CrossFade, InertialTransition))
    during = rng.uniform(2, 3, PEOPLE)
    slerp_ms, squad_ms = cpu_ms(lambda: slerp.at(t)), cpu_ms(lambda: squad.at(t))
    n = PEOPLE * joints / 1e3
    return [
        Row("Slerp", slerp_ms, "ms", 0.5),
        Row("Slerp by scipy (peer)", cpu_ms(by_scipy), "ms"),
        Row("Squad", squad_ms, "ms", 1.0),
        Row(
            "joint placement",
            cpu_ms(lambda: forward(skeleton, frames.root_m, frames.orientation_wxyz)),
            "ms",
            0.5,
        ),
        Row("everybody in a cross-fade", cpu_ms(lambda: fade.at(during)), "ms", 10.0),
        Row("everybody in an inertial transition", cpu_ms(lambda: inert.at(during)), "ms", 10.0),
        Row("time of a million joints by Slerp", slerp_ms / n * 1e3, "ms", 60.0),
        Row("time of a million joints by Squad", squad_ms / n * 1e3, "ms", 120.0),
    ]


def carrying_over(path: Path, unit_m: float) -> list[Row]:
    """Time reading and retargeting of one file and measure the errors."""
    clip = clip_of_bvh(read_bvh(path), unit_m=unit_m)
    result = retarget(clip)
    error = retargeting_error(clip, result)
    seconds = clip.duration_s
    read_ms = cpu_ms(lambda: clip_of_bvh(read_bvh(path), unit_m=unit_m), 3)
    return [
        Row("reading, per second of motion", read_ms / seconds, "ms", 10.0),
        Row(
            "retargeting, per second of motion",
            cpu_ms(lambda: retarget(clip), 3) / seconds,
            "ms",
            10.0,
        ),
        Row("limb directions, worst", float(error.direction_deg.max()), "deg", 0.01),
        Row("hands and feet, median", float(np.median(error.reach_01)), "limb lengths", 0.1),
        Row("hands and feet, worst", float(error.reach_01.max()), "limb lengths", 0.1),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--bvh", type=Path, help="carry this file over and measure the errors")
    parser.add_argument("--unit-m", type=float, default=CMU_UNIT_M, help="metres per unit in it")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    rows = posing(np.random.default_rng(7))
    if options.bvh is not None:
        rows += carrying_over(options.bvh, options.unit_m)
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())

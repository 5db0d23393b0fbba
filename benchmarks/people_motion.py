"""Measure posing of people by procedural motion and gaze, and how well they keep their promises.

    python -m benchmarks.people_motion [--json]

CPU time of the main thread for everybody's whole pose (motion, gaze of eyes, head and trunk, lids)
in one call, the least of many. Limits: 12 people 0.5 ms and 150 people 3 ms, of the 2 ms and 5 ms
a frame may take. "ratio" is limit / value. Slip, gaze and joints are measured on the same crowd.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.motion import cpu_ms
from benchmarks.table import Row, show
from visavis.lab.geometry import Vector, angle_deg, rotate, unit
from visavis.stimuli.gaze.gaze_plan import GazePlan, LookAt
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.joint_limits import beyond_deg
from visavis.stimuli.motion.kinds import (
    Crouch,
    Idle,
    Kind,
    Phone,
    Sit,
    Talk,
    Text,
    Walk,
    WatchBoard,
    Wave,
)
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward

KINDS: tuple[Kind, ...] = (
    Idle(),
    Sit(),
    Phone(),
    Text(),
    WatchBoard(),
    Talk(),
    Wave(),
    Crouch(),
    Walk(),
)
STEP_S = 1 / 240


def crowd(count: int, kinds: Sequence[Kind] = KINDS) -> PeopleMotion:
    """Return people of eleven builds, a metre apart, each at something else."""
    builds = [build_of_skeleton(canonical_skeleton(1.5 + 0.04 * i)) for i in range(11)]
    return PeopleMotion(
        tuple(
            Person(builds[i % 11], kinds[i % len(kinds)], i, (i % 13 - 6.0, 0.0, -(i // 13) - 1.0))
            for i in range(count)
        )
    )


def gazes(count: int) -> GazePlan:
    """Return a plan in which everybody shifts gaze between the observer and a neighbour."""
    looks = {
        i: [
            LookAt(0.0, "observer"),
            LookAt(1.0 + 0.01 * i, "person", ((i + 1) % count,)),
            LookAt(3.0, "observer"),
        ]
        for i in range(count)
    }
    return GazePlan.of(count, looks).watched_from(np.array([0.0, 1.6, 0.0]))


def slips_mm_s(motion: PeopleMotion) -> Vector:
    """Return speeds of the balls of somebody's feet while these are on the floor."""
    own = motion.people[0].build
    toes = [own.skeleton.index(f"{side}_toes") for side in ("left", "right")]
    places = []
    for t in np.arange(2.0, 6.0, STEP_S):
        pose = motion.at(float(t))
        body = forward(own.skeleton, pose.root_m[0], pose.orientation_wxyz[0])
        places.append(body.position_m[toes])
    path = np.array(places)
    down = path[..., 1] < path[..., 1].min() + 5e-4
    speed = np.linalg.norm(np.diff(path[..., [0, 2]], axis=0), axis=-1) / STEP_S * 1e3
    slips: Vector = speed[down[1:] & down[:-1]]
    return slips


def gaze_error_deg(count: int) -> float:
    """Return the largest angle between an eye and the observer, for people in front of them."""
    motion = crowd(count, (Idle(), Sit(), Talk()))
    observer = np.array([0.0, 1.6, -8.0])
    looks = {i: [LookAt(0.0, "observer")] for i in range(count)}
    pose = motion.at(4.0, GazePlan.of(count, looks).watched_from(observer))
    worst = 0.0
    for i, person in enumerate(motion.people):
        skeleton = person.build.skeleton
        body = forward(skeleton, pose.root_m[i], pose.orientation_wxyz[i])
        rows = [skeleton.index("left_eye"), skeleton.index("right_eye")]
        axes = rotate(body.orientation_wxyz[rows], np.tile([0.0, 0.0, -1.0], (2, 1)))
        to = unit(observer - body.position_m[rows])
        ahead = angle_deg(unit(observer - pose.root_m[i]), np.array([0.0, 0.0, -1.0]))
        if ahead < 100.0:
            worst = max(worst, float(angle_deg(axes, to).max()))
    return worst


def rows() -> list[Row]:
    """Measure everything."""
    table = []
    for count, limit_ms in ((12, 0.5), (150, 3.0)):
        motion, plan = crowd(count), gazes(count)
        for name, gaze in (("looking around", None), ("shifting gaze", plan)):
            ms = cpu_ms(lambda m=motion, g=gaze: m.at(3.1, g))  # type: ignore[misc]
            table.append(Row(f"{count} people posed, {name}", ms, "ms", limit_ms))
    for kind in KINDS:
        slip = float(np.percentile(slips_mm_s(crowd(1, (kind,))), 95))
        name = type(kind).__name__
        table.append(Row(f"foot slip, {name}, 95th percentile", slip, "mm/s", 5.0))
    table.append(Row("gaze error, worst eye", gaze_error_deg(60), "deg", 0.1))
    beyond = max(
        float(beyond_deg(crowd(90).at(t).orientation_wxyz).max()) for t in (0.0, 7.0, 31.0)
    )
    table.append(Row("joint beyond its range", beyond, "deg", 0.1))
    return table


def main(argv: Sequence[str]) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(argv)
    return show(rows(), as_json=arguments.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

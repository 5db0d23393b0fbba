"""Measure hybrid motion beside playing every frame of the clips its poses come from.

    python -m benchmarks.hybrid_motion [--json]

Fifteen variants (four clips played, three clips by three increments, the crouch by two) pose 1 to
200 people of 55 joints at their own times, forward kinematics included, as the source's frame-rate
test did within a game engine. "Rate" is poses of the whole crowd per CPU second; its ratio is that
of the clip played (limit 0.9 at 200 people; the source found about 0.5).
"""

import argparse
import json
import sys
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from benchmarks.motion import cpu_ms
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.clip import Clip, KeyPoses, placed_joints, sample_clip
from visavis.stimuli.motion.interpolation import Squad
from visavis.stimuli.motion.kinds import Crouch, Idle, Kind, Run, Walk
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward
from visavis.stimuli.motion.squad_kernels import squad_segments
from visavis.stimuli.motion.synthesis.hybrid import authored_poses, hybrid

PEOPLE = (1, 2, 5, 10, 20, 50, 100, 200)
INCREMENTS = {"walk": (0, 1, 2), "run": (0, 1, 2), "idle": (0, 1, 2), "crouch": (0, 1)}
KINDS: dict[str, Kind] = {
    "walk": Walk(1.3, stride_cv=0.0),
    "run": Run(3.0),
    "idle": Idle(),
    "crouch": Crouch(),
}
ROUNDS = ("walk", "run", "idle")
"""Motions whose poses are joined by Squad."""
FRAMES = {"walk": 30, "run": 30, "idle": 30, "crouch": 58}
"""Frames of a second of a clip, as in the source."""
MIN_RATIO = 0.9
MIN_MQUAT_PER_S = 80.0


@dataclass(frozen=True)
class Row:
    """One variant with one number of people."""

    clip: str
    variant: str
    people: int
    rate_hz: float
    ratio: float
    bytes: int


def source_of(name: str) -> Clip:
    """Return the motion from which frames and poses are taken."""
    person = Person(build_of_skeleton(canonical_skeleton()), KINDS[name], seed=1)
    return bake(person, 6.0, rate_hz=120.0)


def rows_of(name: str) -> list[Row]:
    """Measure all variants of one clip."""
    source = source_of(name)
    n = FRAMES[name]
    played = replace(sample_clip(source, 3.0, 1.0 / n, n), is_loop=True)
    variants = {
        f"hybrid, increment {i}": authored_poses(name, source, 3.0, 3.5, i)
        for i in INCREMENTS[name]
    }
    rng = np.random.default_rng(0)
    found = []
    for people in PEOPLE:
        t_s = rng.uniform(0.0, 1.0, people)
        clip_ms = cpu_ms(partial(placed_joints, played, t_s))
        held = played.orientation_wxyz.nbytes + played.root_m.nbytes
        found.append(Row(name, "every frame", people, 1e3 / clip_ms, 1.0, held))
        for variant, poses in variants.items():
            motion = hybrid(name, poses, 1.0)
            ms = cpu_ms(partial(placed_joints, motion, t_s))
            held = poses.orientation_wxyz.nbytes + poses.root_m.nbytes
            found.append(Row(name, variant, people, 1e3 / ms, clip_ms / ms, held))
    return found


def ratio_of_loops(name: str, people: int) -> float:
    """Return the ratio of the compiled loops alone: Squad and forward kinematics beside a clip."""
    source = source_of(name)
    n = FRAMES[name]
    played = replace(sample_clip(source, 3.0, 1.0 / n, n), is_loop=True)
    motion = hybrid(name, authored_poses(name, source, 3.0, 3.5, 0), 1.0)
    assert isinstance(motion, KeyPoses)
    assert isinstance(motion.turns, Squad)
    turns, t_s = motion.turns, np.random.default_rng(0).uniform(0.0, 1.0, people)
    frames, (segment, share) = motion.at(t_s), turns.times.locate(t_s)
    out = np.empty_like(frames.orientation_wxyz)
    arcs = turns.arcs

    def loops() -> None:
        squad_segments(*arcs, segment, share, out)
        forward(motion.skeleton, frames.root_m, frames.orientation_wxyz)

    return cpu_ms(partial(placed_joints, played, t_s)) / cpu_ms(loops)


def squad_mquat_per_s() -> float:
    """Return how many million turns a second Squad makes on one core, calls included."""
    motion = hybrid("walk", authored_poses("walk", source_of("walk"), 3.0, 3.5, 0), 1.0)
    turns = motion.turns  # type: ignore[union-attr]  # a walk is made of key poses
    assert isinstance(turns, Squad)
    t_s = np.random.default_rng(0).uniform(0.0, 1.0, 2000)
    return float(t_s.size * turns.keys_wxyz.shape[1] / cpu_ms(lambda: turns.at(t_s)) / 1e3)


def main(arguments: list[str]) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(prog="benchmarks.hybrid_motion", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    as_json = parser.parse_args(arguments).json
    rows = [row for name in INCREMENTS for row in rows_of(name)]
    mquat = squad_mquat_per_s()
    if as_json:
        print(json.dumps({"rows": [asdict(r) for r in rows], "squad_mquat_per_s": mquat}, indent=2))
        return 0
    for row in rows:
        print(
            f"{row.clip:7s} {row.variant:20s} {row.people:4d} people {row.rate_hz:9.0f} Hz"
            f"  ratio {row.ratio:.2f}  {row.bytes:6d} bytes"
        )
    worst = min(r.ratio for r in rows if r.people == PEOPLE[-1])
    print(f"least ratio at {PEOPLE[-1]} people {worst:.2f} (limit {MIN_RATIO})")
    print(f"Squad {mquat:.0f} million turns a second (limit {MIN_MQUAT_PER_S:.0f})")
    return 0 if worst >= MIN_RATIO and mquat >= MIN_MQUAT_PER_S else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

"""Hybrid animation from two poses, or the clip it was taken from: which looks better, side by side?

After a thesis of Blekinge Institute of Technology (2017): four motions with two or three authored
poses (increment 0, 1), each beside the clip played frame by frame, on either side.
"""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from experiments.hybrid.clips import CHARACTER, CLIPS, Flaws, motion_of, period_s
from protocol.design import Factor
from stimuli.motion.clip import Motion, placed_joints
from stimuli.motion.kinds import Recorded
from stimuli.motion.synthesis.hybrid import Controls
from stimuli.scenes.gathering import GatheringScene, Standing
from visavis.asking import Answer
from visavis.compare import Compare
from visavis.exclusions import COMPLETENESS_RULES
from visavis.films import Film, Lens, Pair
from visavis.measures import column
from visavis.person import Seen
from visavis.responses import Choice, Response
from visavis.scenes import Scene, Staged, Staging, gathered
from visavis.study import Study
from visavis.trial import Action, TrialScript

CITATION: Final = (
    "Thesis, Blekinge Institute of Technology, Karlskrona (2017): hybrid animation of humanoid "
    "characters from two key poses, compared with key-frame animation."
)
VOTES: Final = ("left_much", "left_some", "equal", "right_some", "right_much")
AWAY_M: Final = 3.2
TURN_DEG: Final = 40.0
"""Figures are seen from the side of their front, so that steps show."""
LENS: Final = Lens(eye_m=(0.0, 1.15, 0.6), aim_m=(0.0, 0.92, -AWAY_M), half_height_01=0.31)
ROUNDS_S: Final = 2.0
"""A film holds as many whole rounds as last so long at least."""

# The simulated rater, not fitted to people: what a centimetre of each fault costs on the scale of
# votes, where 1 parts "slightly" from "significantly".
FEET_BELOW: Final = 0.35
LAME: Final = 0.35
STILL: Final = 2.0
PERSON_SD: Final = 0.3
ERROR_SD: Final = 0.75
EYES_HZ: Final = 60.0
STEPPING_MPS: Final = 0.5
"""How fast a foot passes the other where a step is seen."""
TOES: Final = ("left_toes", "right_toes")

study = Study(
    "hybrid",
    "Hybrid animation beside key-frame animation",
    "Does a motion made of two poses look as good as the clip they were taken from?",
    factors=[
        Factor("clip", CLIPS),
        Factor("increment", (0, 1)),
        Factor("hybrid_side", ("left", "right")),
    ],
    order="random",
    cells=("clip", "increment"),
    parameters={"controls": "neighbours", "limp": 1.0, "excess_hips": 1.0},
    texts="texts",
    folder=Path(__file__).parent,
    on="browser",
    uses=(),
    calibrate=False,
    validate=False,
    questionnaires=("about_voters",),
    exclusions=COMPLETENESS_RULES,
    measures=[
        column(
            "preference", "1",
            "vote for the hybrid: 2 significantly, 1 slightly better, 0 equal, negative for the "
            "clip",
        ),
    ],
    compare=[
        Compare(
            "preference",
            within=("clip", "increment"),
            claim="how hybrid animation compares depends on the motion and the number of poses",
        ),
        Compare(
            "preference", within="hybrid_side", family="side", exploratory=True,
            claim="the side on which the hybrid stands sways votes",
        ),
    ],
    sections=["experiments.hybrid.sections:votes"],
    methods=(
        "Two identical characters moved beside each other, one by a clip played frame by frame at "
        "30 frames a second, one by the hybrid of two (increment 0) or three to four (increment 1) "
        "of its poses; the clip had the faults of the source's own clips. Each pair came with the "
        "hybrid on either side, in random order."
    ),
    references=(CITATION,),
)  # fmt: skip


@study.scene("moving")
def moving(
    staging: Staging,
    *,
    clip: str,
    poses: int,
    controls: str,
    limp: float,
    excess_hips: float,
) -> Staged:
    """Return somebody who moves: by a clip (poses −1), or by its hybrid at an increment."""
    motion = motion_of(
        clip, None if poses < 0 else poses, cast(Controls, controls), Flaws(limp, excess_hips)
    )
    one = Standing(CHARACTER, "person", 0.0, -AWAY_M, 180.0 + TURN_DEG, Recorded(motion), 7)
    return gathered(staging, "moving", (one,), "person", "averted")


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show both beside each other and have one preferred."""
    rounds = max(1, round(ROUNDS_S / period_s(t.clip)))
    seconds = rounds * period_s(t.clip)

    def film(poses: int) -> Film:
        scene = Scene("moving", clip=t.clip, poses=poses, controls=t.controls,
                      limp=float(t.limp), excess_hips=float(t.excess_hips))  # fmt: skip
        return Film(scene, seconds, size_px=(540, 720), lens=LENS)

    made, clip = film(int(t.increment)), film(-1)
    is_left = t.hybrid_side == "left"
    pair = Pair(made, clip) if is_left else Pair(clip, made)
    answers: Any = yield t.watch(pair, Choice("vote", VOTES))
    given: Answer = answers["vote"]
    if given.option is not None:
        for_right = VOTES.index(given.option) - 2
        t.row["preference"] = -for_right if is_left else for_right
    else:
        t.row["preference"] = None


@study.answer
def answer(seen: Seen, response: Response, rng: np.random.Generator) -> str:
    """Vote for the figure with fewer faults; somebody blind to them votes by chance."""
    scene = None if seen.last is None else seen.last.scene
    better = 0.0
    if seen.effect and isinstance(scene, GatheringScene) and len(scene.people) == 2:
        left, right = (
            faults(cast(Any, p.does.motion), round(seen.seconds, 3))
            for p in scene.people
            if isinstance(p.does, Recorded)
        )
        stillness = STILL * np.log10(max(right[2], 1e-6) / max(left[2], 1e-6))
        better = FEET_BELOW * (left[0] - right[0]) + LAME * (left[1] - right[1]) + stillness
    felt = better + PERSON_SD * seen.leaning + ERROR_SD * rng.standard_normal()
    return VOTES[int(np.clip(round(felt), -2, 2)) + 2]


@lru_cache(maxsize=128)
def faults(motion: Motion, seconds: float) -> tuple[float, float, float]:
    """Return how far feet go below the floor, how differently high the hips are carried in steps of
    either foot, and how much the body moves about its mean pose, all in cm.
    """
    t_s = np.arange(0.0, seconds, 1.0 / EYES_HZ)
    placed = placed_joints(motion, t_s).position_m
    skeleton = motion.skeleton
    sole_m = skeleton.rest_m[skeleton.index("left_toes"), 1] - skeleton.rest_m[:, 1].min()
    lowest_m = float(placed[:, [skeleton.index(t) for t in TOES], 1].min())
    hips_m = placed[:, 0, 1]
    apart_m = [placed[:, skeleton.index(f"{side}_foot"), 2] for side in ("left", "right")]
    passing = np.gradient(apart_m[0] - apart_m[1]) * EYES_HZ
    swings = [hips_m[passing > STEPPING_MPS], hips_m[passing < -STEPPING_MPS]]
    lame_m = abs(float(swings[0].mean() - swings[1].mean())) if all(s.size for s in swings) else 0.0
    moved_m = float(np.sqrt(((placed - placed.mean(axis=0)) ** 2).sum(-1).mean()))
    return 100 * max(0.0, float(sole_m) - lowest_m), 100 * lame_m, 100 * moved_m

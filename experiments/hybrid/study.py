"""Hybrid animation from two poses, or the clip it was taken from: which looks better, side by side?

After a thesis of Blekinge Institute of Technology (2017): four motions with two or three authored
poses (increment 0, 1), each beside the clip played frame by frame, on either side.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from visavis.experiments.hybrid.clips import CHARACTER, CLIPS, Flaws, motion_of, period_s
from visavis.experiments.hybrid.facts import FACTS, ORDERS
from visavis.protocol.plan.design import Factor
from visavis.stimuli.motion.clip import Motion, placed_joints
from visavis.stimuli.motion.kinds import Recorded
from visavis.stimuli.motion.synthesis.hybrid import Controls
from visavis.stimuli.scenes.gathering import GatheringScene, Standing
from visavis.study.actions import Action
from visavis.study.asking import Answer
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.films import Film, Lens, Pair
from visavis.study.measures import column
from visavis.study.responses import Choice, Response
from visavis.study.scenes import Scene, StagedScene, Staging, scene_of_people
from visavis.study.source import Source
from visavis.study.study_functions import Seen
from visavis.study.trial import TrialScript

CITATION: Final = (
    "Thesis, Blekinge Institute of Technology, Karlskrona (2017): hybrid animation of humanoid "
    "characters from two key poses, compared with key-frame animation."
)
VOTES: Final = ("left_much", "left_some", "equal", "right_some", "right_much")
MEANINGS: Final = ("hybrid_much", "hybrid_some", "equal", "clip_some", "clip_much")
"""What the votes mean where the hybrid stands left; with sides swapped, the other way round."""
AWAY_M: Final = 3.2
TURN_DEG: Final = 40.0
"""Figures are seen from the side of their front, so that steps show."""
LENS: Final = Lens(eye_m=(0.0, 1.15, 0.6), aim_m=(0.0, 0.92, -AWAY_M), half_height_01=0.31)
ROUNDS_S: Final = 2.0
"""Shortest film; it holds whole rounds only."""

# What the simulated rater sees of a figure, and what it costs on the scale of votes, where 1 parts
# "slightly" from "significantly": fitted so that votes lie as the source describes its bars
# (benchmarks.printed_orders; the source prints no figure).
FEET_BELOW: Final = 0.0446
"""For each centimetre that feet go below the floor."""
LAME: Final = 0.637
"""For each centimetre that one step carries the hips lower than the other."""
UNEVEN: Final = 0.0093
"""For ten times as much change of speed, on average."""
TASTE_SD: Final = 0.651
"""SD of that between people: to some it is jerky, to others lively."""
SLIDING: Final = 1.667
"""For feet that slide ten times as fast where they should stand."""
LIVELY: Final = 1.617
"""Gain for speeds that differ ten times as much."""
HASTE: Final = 6.955
"""For a body that is ten times as fast."""
ERROR_SD: Final = 0.2195
EYES_HZ: Final = 120.0
STILL: Final = 1e-6
"""Smaller values count as zero: somebody who does not move at all."""
STANDING_M: Final = 0.015
"""How far above its lowest point a foot still stands."""
STEPPING_MPS: Final = 0.5
"""How fast a foot passes the other where a step is seen."""
SAME_WITHIN: Final = 0.5
"""Mean votes within half a step of "equal" count as equally good."""
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
    measures=[column("preference", "1", "vote for the hybrid (−2 to 2)")],
    compare=[
        Compare(
            "preference",
            test="tost",
            family="hybrid beside clip",
            options=[("low", -SAME_WITHIN), ("high", SAME_WITHIN)],
            claim="A motion made of poses looks as good as its clip, within half a step of votes",
        ),
        Compare("preference", within=("clip", "increment")),
        Compare(
            "preference",
            within=("clip", "increment"),
            model="clmm",
            family="ordinal",
            exploratory=True,
            options=[("random", "clip")],
        ),
        Compare(
            "preference",
            within=("clip", "increment", "hybrid_side"),
            test="kappa",
            raters="hybrid_side",
            family="retest",
            exploratory=True,
            options=[("scale", "interval")],
            claim="votes for the same pair agree when the sides are swapped",
        ),
        Compare(
            "preference",
            within="hybrid_side",
            family="side",
            exploratory=True,
        ),
    ],
    primary=("preference:preference",),
    sections=["visavis.experiments.hybrid.sections:votes"],
    methods=(
        "Two identical characters moved beside each other, one by a clip played frame by frame at "
        "30 frames a second, one by the hybrid of two (increment 0) or three to four (increment 1) "
        "of its poses; the clip had the faults of the source's own clips. Each pair came with the "
        "hybrid on either side."
    ),
    source=Source(CITATION, 31, where="section 4.1.1", facts=FACTS, orders=ORDERS),
    references=(CITATION,),
)


@study.scene("moving")
def moving(
    staging: Staging,
    *,
    clip: str,
    poses: int,
    controls: str,
    limp: float,
    excess_hips: float,
) -> StagedScene:
    """Return somebody who moves: by a clip (poses −1), or by its hybrid at an increment."""
    motion = motion_of(
        clip, None if poses < 0 else poses, cast(Controls, controls), Flaws(limp, excess_hips)
    )
    one = Standing(CHARACTER, "person", 0.0, -AWAY_M, 180.0 + TURN_DEG, Recorded(motion), 7)
    return scene_of_people(staging, "moving", (one,), "person", "averted")


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show both beside each other and have one preferred."""
    rounds = max(1, round(ROUNDS_S / period_s(t.clip)))
    seconds = rounds * period_s(t.clip)

    def film(poses: int) -> Film:
        scene = Scene(
            "moving",
            clip=t.clip,
            poses=poses,
            controls=t.controls,
            limp=float(t.limp),
            excess_hips=float(t.excess_hips),
        )
        return Film(scene, seconds, size_px=(540, 720), lens=LENS)

    hybrid_film, clip = film(int(t.increment)), film(-1)
    is_left = t.hybrid_side == "left"
    pair = Pair(hybrid_film, clip) if is_left else Pair(clip, hybrid_film)
    votes = Choice("vote", VOTES, means=MEANINGS if is_left else MEANINGS[::-1])
    answers: Any = yield t.watch(pair, votes)
    vote: Answer = answers["vote"]
    if vote.option is not None:
        for_right = VOTES.index(vote.option) - 2
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
            looks_of(cast(Any, p.does.motion), round(seen.seconds, 3))
            for p in scene.people
            if isinstance(p.does, Recorded)
        )
        better = left.cost_to(seen.leaning) - right.cost_to(seen.leaning)
    opinion = better + ERROR_SD * rng.standard_normal()
    return VOTES[int(np.clip(round(opinion), -2, 2)) + 2]


@dataclass(frozen=True)
class Looks:
    """Visible properties of a moving figure: faults, and the course of the body's mean speed.

    Whether stepping feet slide cannot be seen, because figures walk and run in place.
    """

    below_cm: float
    lame_cm: float
    change_per_s: float
    """How much the speed changes in a second, over its mean."""
    sliding_cmps: float
    liveliness: float
    """Standard deviation of the speed over its mean."""
    speed_mps: float

    def cost_to(self, taste: float) -> float:
        """Cost in the eyes of a rater whose taste is so many SDs from the mean; more is worse."""
        return (
            FEET_BELOW * self.below_cm
            + LAME * self.lame_cm
            + (UNEVEN - TASTE_SD * taste) * float(np.log10(self.change_per_s))
            + SLIDING * float(np.log10(1 + self.sliding_cmps))
            - LIVELY * float(np.log10(self.liveliness))
            + HASTE * float(np.log10(self.speed_mps))
        )


@lru_cache(maxsize=128)
def looks_of(motion: Motion, seconds: float) -> Looks:
    """Return what is seen of a motion for so long."""
    t_s = np.arange(0.0, seconds, 1.0 / EYES_HZ)
    joints_m = placed_joints(motion, t_s).position_m
    skeleton = motion.skeleton
    sole_m = skeleton.rest_m[skeleton.index("left_toes"), 1] - skeleton.rest_m[:, 1].min()
    toes = joints_m[:, [skeleton.index(t) for t in TOES]]
    lowest_m = float(toes[..., 1].min())
    hips_m = joints_m[:, 0, 1]
    apart_m = [joints_m[:, skeleton.index(f"{side}_foot"), 2] for side in ("left", "right")]
    passing = np.gradient(apart_m[0] - apart_m[1]) * EYES_HZ
    swings = [hips_m[passing > STEPPING_MPS], hips_m[passing < -STEPPING_MPS]]
    steps = all(s.size for s in swings)
    toe_mps = np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0), axis=-1) * EYES_HZ
    stands = toes[1:, :, 1] < toes[..., 1].min(axis=0) + STANDING_M
    speed_mps = (np.linalg.norm(np.diff(joints_m, axis=0), axis=-1) * EYES_HZ).mean(axis=1)
    mean_mps = max(float(speed_mps.mean()), STILL)
    return Looks(
        below_cm=100 * max(0.0, float(sole_m) - lowest_m),
        lame_cm=100 * abs(float(swings[0].mean() - swings[1].mean())) if steps else 0.0,
        change_per_s=max(float(np.abs(np.diff(speed_mps)).sum() / seconds / mean_mps), STILL),
        sliding_cmps=0.0 if steps else 100 * float(toe_mps[stands].mean()),
        liveliness=max(float(speed_mps.std() / mean_mps), STILL),
        speed_mps=mean_mps,
    )

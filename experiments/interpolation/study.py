"""How natural does a gesture look, interpolated between key poses by three methods?

After Lei et al.: four gestures by three methods, each shown as a film and rated from 1 to 5.
"""

from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from experiments.interpolation import published
from experiments.interpolation.gestures import (
    CHARACTER,
    GESTURES,
    METHODS,
    motion_of,
    seconds_of,
)
from protocol.columns import Column
from protocol.design import Factor
from stimuli.motion.clip import Motion, placed_joints
from stimuli.motion.kinds import Recorded
from stimuli.scenes.gathering import GatheringScene, Standing
from visavis.compare import Compare
from visavis.exclusions import COMPLETENESS_RULES, Exclusion
from visavis.films import Film, Lens
from visavis.person import Seen
from visavis.responses import Rating, Response
from visavis.scenes import Scene, Staged, Staging, gathered
from visavis.study import Source, Study
from visavis.trial import Action, TrialScript

CITATION: Final = (
    "Lei, X., Adamo-Villani, N., Benes, B., Wang, Z., Meyer, Z., Mayer, R., & Lawson, A. "
    "Perceived naturalness of interpolation methods for character upper body animation. Purdue "
    "University and University of California, Santa Barbara."
)
AWAY_M: Final = 2.6
LENS: Final = Lens(eye_m=(0.95, 1.30, 0.0), aim_m=(0.0, 1.16, -AWAY_M), half_height_01=0.30)
"""From the front and a little from the side, from above the head to the knee."""
MAX_SAME: Final = 10
MAX_PATTERN: Final = 3

# The simulated rater: latent = LEVEL - UNEASE × log10(unevenness), fitted to the printed means.
LEVEL: Final = 5.70
UNEASE: Final = 2.38
PERSON_SD: Final = 0.45
ERROR_SD: Final = 1.00
WRISTS: Final = ("right_hand", "left_hand")
EYES_HZ: Final = 120.0
"""How finely a simulated rater sees the movement."""

RULES: Final = (
    Exclusion("max_same_answers", "participant", "same_answers", MAX_SAME - 0.5,
              "{value:.0f} answers the same (limit {limit:.0f})"),
    Exclusion("max_patterned_01", "participant", "patterned_01", 0.95,
              "{value:.0%} of the answers repeat a pattern of at most three (limit {limit:.0%})"),
    *COMPLETENESS_RULES,
)  # fmt: skip

study = Study(
    "interpolation",
    "Naturalness of interpolated gestures",
    "Do gestures look more natural with Squad than with Slerp or LinEuler between key poses?",
    factors=[Factor("gesture", tuple(GESTURES)), Factor("method", METHODS)],
    order="random",
    blocked_by="gesture",
    block_order="williams",
    cells=("method",),
    texts="texts",
    folder=Path(__file__).parent,
    on="browser",
    uses=(),
    calibrate=False,
    validate=False,
    questionnaires=("about_raters",),
    exclusions=RULES,
    columns=[
        Column("same_answers", "1", "how often the person gave the answer they gave most"),
        Column("patterned_01", "1", "share of answers that repeat those two or three before"),
    ],
    compare=[
        Compare(
            "naturalness",
            within="method",
            claim="the method of interpolation changes how natural a gesture looks",
        ),
        Compare(
            "naturalness",
            within=("method", "gesture"),
            model="clmm",
            family="ordinal",
            exploratory=True,
            claim="the same on the scale of ratings, gesture by gesture",
        ),
    ],
    sections=["experiments.interpolation.sections:as_printed"],
    source=Source(
        CITATION,
        97,
        {
            "naturalness": {
                method: (float(mean), None)
                for method, mean in zip(METHODS, published.SUBSETS[1].means, strict=True)
            }
        },
    ),
    methods=(
        "Each gesture was drawn by us and reduced to four key poses, those from which Slerp gives "
        "it back best; the same poses, at their own times, were interpolated by blending Euler "
        "angles (curves continuous over the whole gesture), by Slerp and by Squad. Films of "
        "720 × 720 pixels at 60 pictures a second were shown round after round; ratings counted "
        "after one whole round. Gestures came in an order of a Williams square, methods within a "
        "gesture in random order."
    ),
    references=(CITATION,),
)


@study.scene("gesture")
def gesture(staging: Staging, *, gesture: str, method: Any) -> Staged:
    """Return somebody who makes a gesture, interpolated by a method."""
    does = Recorded(motion_of(gesture, method))
    one = Standing(CHARACTER, "person", 0.0, -AWAY_M, 180.0, does, 7)
    return gathered(staging, "gesture", (one,), "person", "averted")


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show a gesture and have it rated."""
    film = Film(
        Scene("gesture", gesture=t.gesture, method=t.method), seconds_of(t.gesture), lens=LENS
    )
    yield t.watch(film, Rating("naturalness", 1, 5), caption=t.text(f"captions.{t.gesture}"))


@study.answer
def answer(seen: Seen, response: Response, rng: np.random.Generator) -> int:
    """Rate how evenly the hands moved; somebody to whom it makes no difference rates by chance."""
    scene = None if seen.last is None else seen.last.scene
    latent = 3.0
    if (
        seen.effect
        and isinstance(scene, GatheringScene)
        and isinstance(scene.people[0].does, Recorded)
    ):
        motion: Any = scene.people[0].does.motion
        uneven = unevenness_per_s(motion, round(seen.seconds, 3))
        latent = LEVEL - UNEASE * float(np.log10(uneven))
    felt = latent + PERSON_SD * seen.leaning + ERROR_SD * rng.standard_normal()
    return int(np.clip(round(felt), 1, 5))


@lru_cache(maxsize=256)
def unevenness_per_s(motion: Motion, seconds: float) -> float:
    """Return how unevenly the wrists move: root mean square acceleration over that of speed."""
    step_s = 1.0 / EYES_HZ
    t_s = np.arange(0.0, seconds, step_s)
    joints = [motion.skeleton.index(name) for name in WRISTS]
    speed = np.diff(placed_joints(motion, t_s).position_m[:, joints], axis=0) / step_s
    change = np.diff(speed, axis=0) / step_s
    return float(np.sqrt((change**2).sum(-1).mean() / (speed**2).sum(-1).mean()))


@study.facts
def facts(rows: pd.DataFrame) -> pd.DataFrame:
    """Return of each person how alike their answers are, and how much they repeat a pattern."""
    done = rows[(rows["status"] == "complete") & ~rows["is_practice"]]
    found = []
    for participant, own in done.groupby("participant"):
        given = own.sort_values("t_start_ns")["naturalness"].to_numpy(np.float64)
        counts = np.unique(given[np.isfinite(given)], return_counts=True)[1]
        found.append(
            {
                "participant": participant,
                "same_answers": float(counts.max()) if counts.size else np.nan,
                "patterned_01": patterned_01(given),
            }
        )
    return pd.DataFrame(found, columns=["participant", "same_answers", "patterned_01"])


def patterned_01(given: "np.ndarray[Any, np.dtype[np.float64]]") -> float:
    """Return the share of answers that repeat those two or three before, whichever is more.

    Missing for fewer than twice as many answers as the longest pattern.
    """
    if given.size < 2 * MAX_PATTERN:
        return float("nan")
    return max(float(np.mean(given[k:] == given[:-k])) for k in range(2, MAX_PATTERN + 1))


@cache
def stimuli_unevenness() -> dict[tuple[str, str], float]:
    """Return how unevenly the wrists move in every film, by gesture and method."""
    return {
        (name, method): unevenness_per_s(motion_of(name, method), seconds_of(name))
        for name in GESTURES
        for method in METHODS
    }

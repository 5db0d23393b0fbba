"""How natural does a gesture look, interpolated between key poses by three methods?

After Lei et al.: four gestures by three methods, each shown as a film and rated from 1 to 5.
"""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from visavis.experiments.interpolation import published
from visavis.experiments.interpolation.facts import FACTS, ORDERS
from visavis.experiments.interpolation.gestures import (
    CHARACTER,
    GESTURES,
    METHODS,
    motion_of,
    seconds_of,
)
from visavis.protocol.plan.design import Factor
from visavis.stimuli.motion.clip import Motion, placed_joints
from visavis.stimuli.motion.kinds import Recorded
from visavis.stimuli.scenes.gathering import GatheringScene, Standing
from visavis.study.actions import Action
from visavis.study.careless_answers import Careless
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.films import Film, Lens
from visavis.study.responses import Rating, Response
from visavis.study.scenes import Scene, StagedScene, Staging, scene_of_people
from visavis.study.source import Source
from visavis.study.study_functions import Seen
from visavis.study.trial import TrialScript

CITATION: Final = (
    "Lei, X., Adamo-Villani, N., Benes, B., Wang, Z., Meyer, Z., Mayer, R., & Lawson, A. "
    "Perceived naturalness of interpolation methods for character upper body animation. Purdue "
    "University and University of California, Santa Barbara."
)
AWAY_M: Final = 2.6
LENS: Final = Lens(eye_m=(0.95, 1.30, 0.0), aim_m=(0.0, 1.26, -AWAY_M), half_height_01=0.32)
"""From the front and a little from the side, from above the raised hands to the knee."""
MAX_SAME: Final = 10
CLAIM: Final = "Gestures look more natural with Squad than with Slerp or LinEuler"
EXPECTED: Final = "squad > slerp, lineuler"

# The simulated rater sees how unevenly the wrists move, how fast, and how far they rise; fitted to
# the twelve printed means by gesture and method (each within .20).
LEVEL: Final = 7.567
UNEASE: Final = 5.775
SPEED: Final = 1.822
RISE_PER_M: Final = 1.133
EXPERIENCED_01: Final = 0.9
"""Experience above which somebody says that animation is or was their work: a quarter of people, as
in the source."""
SAME_TO_ALL: Final = 3.34
NOVICES_SEE: Final = 0.83
EXPERIENCED_SEE: Final = 1.50
"""How far apart the methods are for each group, around a rating both agree on; as printed."""
PERSON_SD: Final = 0.45
ERROR_SD: Final = 0.95
"""SD of single ratings; with the spread of people it makes the 1.03 that the printed p imply."""
WRISTS: Final = ("right_hand", "left_hand")
EYES_HZ: Final = 120.0
EYES_SD_S: Final = 1 / 60
"""A simulated rater does not see single pictures: what is shorter is blurred (Gaussian)."""

CARELESS: Final = Careless("naturalness", max_same=MAX_SAME - 0.5, max_patterned_01=0.95)
RULES: Final = (*CARELESS.rules, *COMPLETENESS_RULES)

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
    columns=CARELESS.columns,
    compare=[
        Compare(
            "naturalness",
            within="method",
            claim=CLAIM,
            expects=EXPECTED,
        ),
        Compare(
            "naturalness",
            within=("method", "gesture"),
            model="clmm",
            family="ordinal",
            exploratory=True,
            options=[("random", "method")],
            claim="The same on the scale of ratings",
            expects="method: squad > slerp, lineuler",
        ),
        # The source's second, third and fourth hypotheses: tables 4, 5 and 6.
        *(
            Compare(
                "naturalness",
                within="method",
                by=by,
                family="subsets",
                claim=CLAIM,
                expects=EXPECTED,
                published=published.TESTS,
            )
            for by in ("experience", "gesture", "gender_named")
        ),
        Compare(  # table 3: those whom a panel sent
            "naturalness",
            within="method",
            where="recruited_by = 1",
            family="subsets",
            claim=CLAIM,
            expects=EXPECTED,
            published=published.TESTS["panel"],
        ),
    ],
    # The source's first hypothesis; it calls the others secondary (section 3.2).
    primary=("naturalness:method",),
    groups={
        "experience": {
            "novice": "animation_experience < 4",
            "experienced": "animation_experience = 4",
        },
        "gender_named": {"male": "gender = 2", "female": "gender = 1"},
    },
    sections=["visavis.experiments.interpolation.sections:as_printed"],
    source=Source(
        CITATION,
        97,
        {
            "naturalness": {
                method: (float(mean), None)
                for method, mean in zip(METHODS, published.SUBSETS[1].means, strict=True)
            }
        },
        where="table 2",
        facts=FACTS,
        orders=ORDERS,
    ),
    methods=(
        "Each gesture was drawn by us and reduced to four key poses: both ends, then twice the "
        "pose that is farthest from Slerp between those chosen so far. The same poses, at their "
        "own times, were interpolated by blending Euler angles (curves continuous over the whole "
        "gesture), by Slerp and by Squad. Films of 720 × 720 pixels at 60 pictures a second were "
        "shown round after round; ratings counted after one whole round."
    ),
    references=(CITATION,),
)


@study.scene("gesture")
def gesture(staging: Staging, *, gesture: str, method: Any) -> StagedScene:
    """Return somebody who makes a gesture, interpolated by a method."""
    does = Recorded(motion_of(gesture, method))
    one = Standing(CHARACTER, "person", 0.0, -AWAY_M, 180.0, does, 7)
    return scene_of_people(staging, "gesture", (one,), "person", "averted")


study.facts(CARELESS.facts)


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
        sees = EXPERIENCED_SEE if seen.experience_01 > EXPERIENCED_01 else NOVICES_SEE
        latent = SAME_TO_ALL + sees * (naturalness_of(motion, round(seen.seconds, 3)) - SAME_TO_ALL)
    opinion = latent + PERSON_SD * seen.leaning + ERROR_SD * rng.standard_normal()
    return int(np.clip(round(opinion), 1, 5))


@lru_cache(maxsize=256)
def naturalness_of(motion: Motion, seconds: float) -> float:
    """Return what the simulated raters feel on average, from how the wrists move.

    Unevenness is root mean square acceleration over that of velocity, which is speed; rise is how
    far apart in height a wrist is at most.
    """
    t_s = np.arange(0.0, seconds, 1.0 / EYES_HZ)
    joints = [motion.skeleton.index(name) for name in WRISTS]
    place_m = placed_joints(motion, t_s).position_m[:, joints]
    place_m = gaussian_filter1d(place_m, EYES_SD_S * EYES_HZ, axis=0, mode="nearest")
    velocity = np.diff(place_m, axis=0) * EYES_HZ
    change = np.diff(velocity, axis=0) * EYES_HZ
    speed_mps = float(np.sqrt((velocity**2).sum(-1).mean()))
    uneven_per_s = float(np.sqrt((change**2).sum(-1).mean())) / speed_mps
    rise_m = float(np.ptp(place_m[..., 1]))
    return float(
        LEVEL - UNEASE * np.log10(uneven_per_s) + SPEED * np.log10(speed_mps) + RISE_PER_M * rise_m
    )

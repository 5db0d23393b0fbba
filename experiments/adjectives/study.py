"""Walks described by 41 pairs of adjectives: which say something, and which belong together?

After a study of motion interpolation by adjectives: every walk is rated on one list of pairs,
beside a normal walk. Figures are shown as films, from one place; in the source the camera was free.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from visavis.experiments.adjectives.facts import FACTS
from visavis.experiments.adjectives.pairs import PAIRS
from visavis.experiments.adjectives.raters import LOADINGS, PERSON_SD, mean_rating
from visavis.experiments.adjectives.walks import (
    BESIDE,
    RATED,
    REFERENCE,
    impressions_seen,
    round_s,
    walk_name,
    walk_of,
)
from visavis.protocol.plan.design import Factor
from visavis.stimuli.motion.kinds import Recorded
from visavis.stimuli.motion.synthesis.walk_styles import EMOTIONS, SPEEDS
from visavis.stimuli.scenes.gathering import GatheringScene, Standing
from visavis.study.actions import Action
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.films import Film, Lens, Pair
from visavis.study.responses import Rating, Response
from visavis.study.scenes import Scene, StagedScene, Staging, scene_of_people
from visavis.study.source import Source
from visavis.study.study_functions import Seen
from visavis.study.trial import TrialScript

CITATION: Final = (
    "Oshita, M., Honda, A., Katsurada, M., & Aosaki, Y. Motion interpolation using adjectives and "
    "motion features. Kyushu Institute of Technology."
)
LOW, HIGH = -2, 2
AWAY_M: Final = 3.2
TURN_DEG: Final = 40.0
"""Figures are seen from the side of their front, so that steps and posture show."""
LENS: Final = Lens(eye_m=(0.0, 1.2, 0.6), aim_m=(0.0, 0.9, -AWAY_M), half_height_01=0.31)
ROUNDS: Final = 2
"""Cycles in a film, which plays again and again."""
AGREED: Final = ("slow_fast", "drab_clear", "sad_happy", "small_large")
"""A pair of each of the source's clusters, about which raters should agree."""

study = Study(
    "adjectives",
    "Walks described by adjectives",
    "Which adjectives describe how a person walks, and which of them say the same?",
    factors=[Factor("emotion", tuple(EMOTIONS)), Factor("speed", SPEEDS)],
    order="williams",
    cells=("emotion", "speed"),
    texts="texts",
    folder=Path(__file__).parent,
    on="browser",
    uses=(),
    calibrate=False,
    validate=False,
    exclusions=COMPLETENESS_RULES,
    compare=[
        Compare(
            "slow_fast",
            within="speed",
            claim="Fast walks look faster than normal ones, and these than slow ones",
            expects="fast > normal > slow",
        ),
        Compare(
            "sad_happy",
            within="emotion",
            claim="Walks of pleasure look happier than those of depression",
            expects="pleasure > depression",
        ),
        *(
            Compare(
                pair,
                within=("emotion", "speed"),
                test="icc",
                family="agreement",
                exploratory=True,
                options=[("kind", "ICC2k"), ("mu", 0.7)],
                claim=f"The raters' mean of {pair.replace('_', '–')} is reliable (above .70)",
            )
            for pair in AGREED
        ),
    ],
    primary=("slow_fast:speed", "sad_happy:emotion"),
    sections=["visavis.experiments.adjectives.sections:impressions"],
    methods=(
        "Nine emotions of Russell's circle at three speeds were walked by a procedural gait of a "
        "few style parameters. Two films stood side by side, round after round: the walk, by a "
        "man in green, and a normal walk at normal speed, by the same man in red. Below stood 41 "
        "pairs of adjectives with five buttons each (−2 to 2), to be answered in any order; the "
        "order of walks was balanced over participants (Williams). Pairs are kept whose mean "
        "rating of some walk is at least 1 from the middle and whose standard deviation over "
        "raters is at most .85 on average; kept pairs are clustered by Ward's method."
    ),
    source=Source(CITATION, participants=14, where="section 3.3", facts=FACTS),
    references=(CITATION,),
)


@study.scene("walking")
def walking(staging: Staging, *, walk: str, who: str) -> StagedScene:
    """Return somebody who walks on the spot in a style."""
    does = Recorded(walk_of(walk, who))
    one = Standing(who, "person", 0.0, -AWAY_M, 180.0 + TURN_DEG, does, 7)
    return scene_of_people(staging, "walking", (one,), "person", "averted")


def film(walk: str, who: str) -> Film:
    """Return the film of a walk by somebody."""
    scene = Scene("walking", walk=walk, who=who)
    return Film(scene, ROUNDS * round_s(walk), size_px=(540, 720), lens=LENS)


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show a walk beside the normal one, and have it described by all pairs on one list."""
    ratings = tuple(Rating(pair, LOW, HIGH) for pair in PAIRS)
    both = Pair(film(walk_name(t.emotion, t.speed), RATED), film(REFERENCE, BESIDE))
    yield t.watch(both, *ratings, caption=t.text("captions.walk"))


@study.answer
def answer(seen: Seen, response: Response, rng: np.random.Generator) -> int:
    """Rate by four impressions of the walk beside the other; whom it leaves cold, at random."""
    scene = None if seen.last is None else seen.last.scene
    loading = LOADINGS[response.name]
    latent = 0.0
    if seen.effect and isinstance(scene, GatheringScene) and len(scene.people) == 2:
        rated, beside = (
            cast(Any, person.does.motion)
            for person in scene.people
            if isinstance(person.does, Recorded)
        )
        latent = mean_rating(response.name, impressions_seen(rated, beside))
    opinion = latent + PERSON_SD * seen.leaning + loading.sd * rng.standard_normal()
    return int(np.clip(round(opinion), LOW, HIGH))

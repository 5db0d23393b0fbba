"""Walks described by 41 pairs of adjectives: which say something, and which belong together?

After a study of motion interpolation by adjectives: every walk is rated on one list of pairs,
beside a normal walk. Both are live figures, which raters may see from all round.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from visavis.experiments.adjectives.facts import FACTS
from visavis.experiments.adjectives.pairs import PAIRS
from visavis.experiments.adjectives.raters import LOADINGS, PERSON_SD, mean_rating
from visavis.experiments.adjectives.walks import REFERENCE, figures, impressions_seen, walk_name
from visavis.protocol.plan.design import Factor
from visavis.stimuli.motion.synthesis.walk_styles import EMOTIONS, SPEEDS
from visavis.study.actions import Action
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.live import LiveScene
from visavis.study.responses import Rating, Response
from visavis.study.source import Source
from visavis.study.study_functions import Seen
from visavis.study.trial import TrialScript

CITATION: Final = (
    "Oshita, M., Honda, A., Katsurada, M., & Aosaki, Y. Motion interpolation using adjectives and "
    "motion features. Kyushu Institute of Technology."
)
LOW, HIGH = -2, 2
ROUNDS: Final = 2
"""Cycles of the slower walk after which answers count; both go on until the list is left."""
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
        "few style parameters. Two figures, drawn live on the page, walked side by side on the "
        "spot without end: the rated walk, by a man in green, and a normal walk at normal speed, "
        "by the same man in red. Raters turned and zoomed the view at will. Below stood 41 pairs "
        "of adjectives with five buttons each (−2 to 2), to be answered in any order; the "
        "order of walks was balanced over participants (Williams). Pairs are kept whose mean "
        "rating of some walk is at least 1 from the middle and whose standard deviation over "
        "raters is at most .85 on average; kept pairs are clustered by Ward's method."
    ),
    source=Source(CITATION, participants=14, where="section 3.3", facts=FACTS),
    references=(CITATION,),
)


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show a walk beside the normal one, and have it described by all pairs on one list."""
    ratings = tuple(Rating(pair, LOW, HIGH) for pair in PAIRS)
    walk = walk_name(t.emotion, t.speed)
    both = LiveScene(figures(), {walk: 1.0}, beside={REFERENCE: 1.0})
    yield t.watch(both, *ratings, caption=t.text("captions.walk"), min_rounds=ROUNDS)


@study.answer
def answer(seen: Seen, response: Response, rng: np.random.Generator) -> int:
    """Rate by four impressions of the walk beside the other; whom it leaves cold, at random."""
    loading = LOADINGS[response.name]
    latent = 0.0
    if seen.effect and seen.figures is not None:
        latent = mean_rating(response.name, impressions_seen(*seen.figures.motions))
    opinion = latent + PERSON_SD * seen.leaning + loading.sd * rng.standard_normal()
    return int(np.clip(round(opinion), LOW, HIGH))

"""Which of two moving bodies is more natural, side by side? The second study of the source."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from visavis.experiments.gestures import published
from visavis.experiments.gestures.clips import PART_S, PARTS, VERSIONS
from visavis.experiments.gestures.facts import OF_PAIRS, ORDERS_OF_PAIRS, WHERE
from visavis.experiments.gestures.study import CITATION, ONE_LEVEL, film_of, speaking
from visavis.experiments.gestures.viewing import looks_of
from visavis.protocol.plan.design import Factor
from visavis.stimuli.motion.kinds import Recorded
from visavis.stimuli.scenes.gathering import GatheringScene
from visavis.study.actions import Action
from visavis.study.asking import Answer
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.films import Pair
from visavis.study.measures import column
from visavis.study.responses import Choice, Response
from visavis.study.source import Source
from visavis.study.study_functions import Seen
from visavis.study.trial import TrialScript

VOTES: Final = ("left_much", "left_some", "equal", "right_some", "right_much")
MEANINGS: Final = ("corpus_much", "corpus_some", "equal", "holds_some", "holds_much")
"""What the votes mean where the body filled from the corpus stands left."""

TELLING: Final = 1.75
"""How much more of a difference is seen side by side than one after the other."""
TELLING_SD: Final = 1.36
"""People differ in how much it matters to them."""
ERROR_SD: Final = 0.80

study = Study(
    "gesture_pairs",
    "Two moving bodies side by side",
    "Is a body more natural that never stops between gestures, or one that holds?",
    factors=[Factor("part", PARTS), Factor("version", VERSIONS), *ONE_LEVEL],
    order="random",
    cells=("part",),
    texts="texts_pairs",
    folder=Path(__file__).parent,
    on="browser",
    uses=(),
    calibrate=False,
    validate=False,
    screening=("sound",),
    questionnaires=("about_listeners",),
    exclusions=COMPLETENESS_RULES,
    measures=[
        column("vote_for_holds", "1", "vote: −2 for the corpus, +2 for holds"),
    ],
    compare=[
        Compare(
            "vote_for_holds",
            test="t",
            claim="A body filled from a corpus looks more natural than one that holds",
            expects="vote_for_holds < 0",
        ),
        Compare("vote_for_holds", within="part", exploratory=True, family="part"),
    ],
    primary=("vote_for_holds:vote_for_holds",),
    sections=["visavis.experiments.gestures.sections:votes_as_printed"],
    source=Source(CITATION, published.PEOPLE, where=WHERE, facts=OF_PAIRS, orders=ORDERS_OF_PAIRS),
    methods=(
        "The same part of a speech with the same gestures stood on both sides, once with gaps "
        "filled from a corpus and once with interpolation and holds; sides were drawn for every "
        "trial. Both films, with the speech, could be seen again and again."
    ),
    references=(CITATION,),
)
study.scene("speaking")(speaking)


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show both bodies beside each other and have one preferred."""
    is_left = bool(t.rng().random() < 0.5)
    corpus, holds = (
        film_of(body, int(t.part), int(t.version), t.speech, float(t.sound_late_ms), t.speaker)
        for body in ("corpus", "holds")
    )
    pair = Pair(corpus, holds) if is_left else Pair(holds, corpus)
    votes = Choice("vote", VOTES, means=MEANINGS if is_left else MEANINGS[::-1])
    answers: Any = yield t.watch(pair, votes)
    vote: Answer = answers["vote"]
    for_right = None if vote.option is None else VOTES.index(vote.option) - 2
    t.row["vote_for_holds"] = None if for_right is None else for_right if is_left else -for_right


@study.answer
def answer(seen: Seen, response: Response, rng: np.random.Generator) -> str:
    """Vote for the body that looks more natural; somebody blind to bodies votes by chance."""
    scene = None if seen.last is None else seen.last.scene
    for_right = 0.0
    if seen.effect and isinstance(scene, GatheringScene) and len(scene.people) == 2:
        left, right = (
            looks_of(cast(Any, p.does.motion), PART_S)
            for p in scene.people
            if isinstance(p.does, Recorded)
        )
        liking = TELLING + TELLING_SD * seen.leaning
        for_right = liking * (right.naturalness - left.naturalness)
    opinion = for_right + ERROR_SD * rng.standard_normal()
    return VOTES[int(np.clip(round(opinion), -2, 2)) + 2]

"""One of four ratings that changes by chance is not said to change."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from visavis.experiments.crowd.comparisons import (
    COLLISIONS,
    PRIMARY,
    RATINGS,
    SPEED,
    TO_GAP,
    VOLUME,
    comparisons,
)
from visavis.experiments.crowd.conclusions import _direction
from visavis.experiments.crowd.design import BEFORE, CONDITIONS, HAPTIC, HAPTICS_GROUP
from visavis.results.analysis import answer_comparison, with_corrected_p

PEOPLE = 16
SEED = 7
"""Of ratings by chance, one of which has a p between .0125 and .05."""


def test_one_of_four_ratings_just_below_alpha_is_no_change() -> None:
    """Without correction one study of five or six would find something in ratings of chance."""
    measures = {m.column: m for m in RATINGS}
    of_ratings = [
        c for c in comparisons() if c.dv in measures and c.only == {"group": HAPTICS_GROUP}
    ]
    assert {("ratings", "holm", False)} == {
        (c.family, c.correction, c.exploratory) for c in of_ratings
    }
    rng = np.random.default_rng(SEED)
    rows = pd.DataFrame(
        {"participant": f"S{i:02d}", "group": HAPTICS_GROUP, "condition": condition}
        for i in range(PEOPLE)
        for condition in CONDITIONS
    )
    rows = rows.assign(**{name: rng.normal(5, 1, len(rows)) for name in measures})
    findings = with_corrected_p(
        [
            answer_comparison(
                one, rows, measures, {"condition": tuple(CONDITIONS)}, is_simulated=True
            )
            for one in of_ratings
        ]
    )
    terms = [term for finding in findings for term in finding.terms]
    assert len(RATINGS) == len(terms)
    assert [True] == [term.p < term.alpha for term in terms if term.p < 0.1]
    assert not any(term.is_significant for term in terms)


MOVEMENT_SEED = 0
"""Of people who differ in speed between blocks, significantly before correction only."""


def slower_with_haptics(seed: int) -> SimpleNamespace:
    """Return what conclusions read of an analysis, of people whose speed alone changes."""
    measures = {m.column: m for m in PRIMARY}
    rng = np.random.default_rng(seed)
    rows = pd.DataFrame(
        {"participant": f"S{i:02d}", "group": HAPTICS_GROUP, "condition": condition}
        for i in range(PEOPLE)
        for condition in CONDITIONS
    )
    rows = rows.assign(**{name: rng.normal(5, 1, len(rows)) for name in measures})
    rows.loc[rows["condition"] == HAPTIC, SPEED.column] -= 0.8
    found = {
        one.dv: answer_comparison(
            one, rows, measures, {"condition": tuple(CONDITIONS)}, is_simulated=True
        )
        for one in comparisons()
        if one.dv in measures and one.only == {"group": HAPTICS_GROUP} and not one.between
    }
    return SimpleNamespace(finding=found.get)


def test_one_of_four_measures_of_movement_just_below_alpha_answers_no_hypothesis() -> None:
    """The hypotheses about movement are the primary claims, of which chance finds .05 at most."""
    analysis = slower_with_haptics(MOVEMENT_SEED)
    speed = analysis.finding(SPEED.column)
    assert 0.0125 < speed.terms[0].p < 0.05
    assert speed.contrast((BEFORE, HAPTIC)).is_significant
    answers = {
        name: _direction(analysis, name, "?", (BEFORE, HAPTIC), measures)
        for name, measures in (
            ("careful", ((TO_GAP, -1), (SPEED, 1))),
            ("fewer", ((COLLISIONS, 1), (VOLUME, 1))),
        )
    }
    assert {"careful": "not_found", "fewer": "not_found"} == {
        name: answer.status for name, answer in answers.items()
    }
    assert (
        "Over the 4 measures of movement, corrected (holm): p = " in answers["careful"].evidence[1]
    )

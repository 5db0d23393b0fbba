"""One of four ratings that changes by chance is not said to change."""

import numpy as np
import pandas as pd

from visavis.experiments.crowd.comparisons import RATINGS, comparisons
from visavis.experiments.crowd.design import CONDITIONS, HAPTICS_GROUP
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

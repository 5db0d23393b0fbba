"""What docs/statistics.md says that a study can compare is answered by its test."""

import re
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from visavis.results.analysis import answer_comparison
from visavis.study.comparisons import Compare
from visavis.study.measures import Measure

PAGE = Path(__file__).parents[2] / "docs" / "statistics.md"
TABLE = PAGE.read_text(encoding="utf-8").split("## Ratings and choices in a study")[1]
ASKED = re.findall(r"`(Compare\(.+?\))`", TABLE.split("\n## ")[0])
LEVELS = {
    "group": ("old", "young"),
    "method": ("lineuler", "squad"),
    "side": ("left", "right"),
    "clip": tuple(f"c{i}" for i in range(6)),
    "occasion": ("first", "again"),
    "left": ("p", "q", "r"),
    "right": ("p", "q", "r"),
}


def trials() -> pd.DataFrame:
    """Return ratings, votes and choices of 24 people, who differ."""
    rng = np.random.default_rng(8)
    good = rng.normal(0, 0.8, 6)
    pairs = list(permutations(LEVELS["left"], 2))
    rows = []
    for person in range(24):
        own, likes = rng.normal(), dict(zip("pqr", rng.normal((0, 0.5, 1)), strict=True))
        for i, clip in enumerate(LEVELS["clip"]):
            for occasion in LEVELS["occasion"]:
                for method in LEVELS["method"]:
                    left, right = pairs[i]
                    lead = likes[left] - likes[right] + rng.logistic()
                    rating = 3 + own + good[i] + 0.5 * (method == "squad") + rng.normal()
                    rows.append(
                        {
                            "participant": f"P{person:02d}",
                            "group": LEVELS["group"][person % 2],
                            "clip": clip,
                            "occasion": occasion,
                            "method": method,
                            "side": LEVELS["side"][i % 2],
                            "left": left,
                            "right": right,
                            "liking": float(np.clip(np.round(rating), 1, 5)),
                            "vote": 0.0 if abs(lead) < 0.3 else float(np.sign(lead)),
                            "chose_it": float(person % 3 > 0),
                        }
                    )
    return pd.DataFrame(rows)


@pytest.mark.parametrize("text", ASKED)
def test_a_documented_comparison_is_answered(text: str) -> None:
    compare = eval(text, {"Compare": Compare})  # noqa: S307  # our own page
    rows = trials()
    if compare.between:  # the page's example is of one answer per person
        rows = rows.drop_duplicates("participant")
    known = {name: Measure(name, "1", name) for name in ("liking", "vote", "chose_it")}
    found = answer_comparison(compare, rows, known, LEVELS, is_simulated=True)
    assert "" == found.why_not
    assert set(compare.terms) == {term.name for term in found.terms}
    assert all(0 <= term.p <= 1 for term in found.terms)


def test_the_page_names_every_test_of_ratings_and_choices() -> None:
    made = [eval(text, {"Compare": Compare}) for text in ASKED]  # noqa: S307  # our own page
    expected = {"clmm", "bradleyterry", "sign", "binomial", "icc", "krippendorff", "kappa"}
    assert expected | {"tost", "friedman"} == {c.model or c.test for c in made}

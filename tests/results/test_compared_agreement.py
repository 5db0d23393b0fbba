"""A study plans how far its participants agree: intraclass correlation, Krippendorff's α, κ."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.statistics.agreement import cohen_kappa, icc, krippendorff_alpha
from visavis.analysis.statistics_report import Question, answer
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import DesignError
from visavis.results.analysis import answer_comparison
from visavis.results.findings import Finding
from visavis.results.power import KitPower
from visavis.running.quick import quick_study
from visavis.study.comparisons import Compare
from visavis.study.measures import Measure

CLIPS = tuple(f"c{i}" for i in range(7))
ICC2: dict[str, Any] = {"test": "icc", "options": [("kind", "ICC2")], "claim": "they agree"}
STUDY = """from visavis import Compare, Factor, Rating, Scene, Study

CLIPS = tuple("abcdefgh")
study = Study(
    "liked",
    factors=[Factor("clip", CLIPS)],
    calibrate=False,
    validate=False,
    uses=(),
    compare=[
        Compare(
            "liking",
            within="clip",
            test="krippendorff",
            options=[("scale", "ordinal"), ("mu", 0.1)],
            claim="people like the same clips",
        ),
        Compare(
            "liking",
            within="clip",
            test="icc",
            options=[("kind", "ICC2k")],
            claim="the mean of all is worth reporting",
        ),
    ],
)


@study.trial
def trial(t):
    yield t.show(Scene("person"), seconds=0.1 * (1 + CLIPS.index(t.clip)))
    yield t.ask(Rating("liking", 1, 5))


@study.answer
def answer(seen, response, rng):
    good = 7 * seen.seconds if seen.effect else 3
    return int(min(5, max(1, round(good + rng.normal()))))
"""


def ratings(seed: int = 1, people: int = 9) -> pd.DataFrame:
    """Return ratings of seven clips on two occasions by people who agree somewhat."""
    rng = np.random.default_rng(seed)
    good = rng.normal(3, 1, len(CLIPS))
    rows = []
    for p in range(people):
        own = good + rng.normal(0, 0.8, len(CLIPS))
        for occasion in ("first", "again"):
            rated = np.clip(np.round(own + rng.normal(0, 0.5, len(CLIPS))), 1, 5)
            rows += [
                {"participant": f"P{p}", "clip": c, "occasion": occasion, "liking": v}
                for c, v in zip(CLIPS, rated, strict=True)
            ]
    return pd.DataFrame(rows)


def finding_of(of: Compare, rows: pd.DataFrame) -> Finding:
    levels = {"clip": CLIPS, "occasion": ("first", "again")}
    known = {"liking": Measure("liking", "1", "liking")}
    return answer_comparison(of, rows, known, levels, is_simulated=True)


def wide(rows: pd.DataFrame) -> np.ndarray:
    return rows.pivot_table(index="clip", columns="participant", values="liking").to_numpy()


def test_participants_rate_the_levels_of_the_factor() -> None:
    rows = ratings()
    expected = {one.kind: one for one in icc(wide(rows))}["ICC2"]
    finding = finding_of(Compare("liking", within="clip", **ICC2), rows)
    assert expected.value == pytest.approx(finding.terms[0].row["agreement"])
    assert expected.p == pytest.approx(finding.terms[0].p)
    assert ("clip",) == tuple(term.name for term in finding.terms)
    assert () == finding.contrasts


def test_agreement_is_computed_of_things_that_have_words_of_their_own() -> None:
    rows, levels = ratings(), {"clip": CLIPS}
    known = {"liking": Measure("liking", "1", "liking")}
    question = Compare("liking", within="clip", **ICC2)
    words = {clip: f"clip {clip}, long" for clip in CLIPS}
    finding = answer_comparison(question, rows, known, levels, is_simulated=True, level_words=words)
    expected = {one.kind: one for one in icc(wide(rows))}["ICC2"]
    assert expected.value == pytest.approx(finding.terms[0].row["agreement"])


def test_alpha_and_its_bound_decide() -> None:
    rows = ratings()
    options: list[tuple[str, Any]] = [("scale", "interval"), ("mu", 0.2)]
    of = Compare("liking", within="clip", test="krippendorff", options=options, claim="they agree")
    expected = krippendorff_alpha(wide(rows), scale="interval", above=0.2)
    finding = finding_of(of, rows)
    assert expected.p_above == finding.terms[0].p
    assert expected.value == pytest.approx(finding.terms[0].row["agreement"])
    assert "above 0.2" in finding.outcome.sentences[0]


def test_occasions_rate_each_participants_things() -> None:
    rows = ratings()
    of = Compare(
        "liking",
        within=("clip", "occasion"),
        raters="occasion",
        test="kappa",
        options=[("scale", "ordinal")],
        claim="people stay with what they said",
    )
    table = rows.pivot_table(index=["participant", "clip"], columns="occasion", values="liking")
    expected = cohen_kappa(table[["first", "again"]].to_numpy(), scale="ordinal")
    finding = finding_of(of, rows)
    assert 63 == finding.terms[0].row["n"]
    assert any("counts as independent" in note for note in finding.outcome.notes)
    assert expected.value == pytest.approx(finding.terms[0].row["agreement"])
    assert expected.p_above == pytest.approx(finding.terms[0].p)


def test_a_participant_who_left_out_a_rating_is_told_and_leaves_an_icc() -> None:
    rows = ratings()
    short = rows[~((rows["participant"] == "P3") & (rows["clip"] == "c2"))]
    finding = finding_of(Compare("liking", within="clip", **ICC2), short)
    expected = icc(wide(rows[rows["participant"] != "P3"]))
    assert {one.kind: one.value for one in expected}["ICC2"] == pytest.approx(
        finding.terms[0].row["agreement"]
    )
    assert "left out: 1 participants without all ratings" in finding.outcome.notes


def test_the_same_is_asked_of_a_table() -> None:
    rows = ratings()
    means = rows.groupby(["participant", "clip"], as_index=False)["liking"].mean()
    question = Question(
        "icc", dv="liking", within=("participant",), subject="clip", kind="ICC2", mu=0.3
    )
    planned = Compare(
        "liking",
        within="clip",
        test="icc",
        options=[("kind", "ICC2"), ("mu", 0.3)],
        claim="they agree",
    )
    row = answer(means, question).row()
    finding = finding_of(planned, rows).terms[0]
    assert row["agreement"] == pytest.approx(finding.row["agreement"])
    assert row["p_above"] == pytest.approx(finding.p)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"test": "icc", "claim": "c"}, r'name it: options=\[\("kind", "ICC2"\)\]'),
        ({"test": "icc", "claim": "c", "options": [("kind", "ICC4")]}, "ICC1, ICC2"),
        ({**ICC2, "claim": ""}, "needs a claim"),
        ({**ICC2, "between": "group"}, "only= for one group"),
        ({**ICC2, "raters": "occasion"}, "not a factor of within"),
        ({"test": "krippendorff", "claim": "c"}, "needs a scale"),
        ({"test": "kappa", "claim": "c"}, "two raters"),
        ({"test": "kappa", "claim": "c", "options": [("scale", "steps")]}, "needs a scale"),
        ({"test": "friedman", "raters": "clip"}, "only tests of agreement have"),
    ],
)
def test_agreement_says_who_rates_and_by_which_coefficient(
    given: dict[str, Any], words: str
) -> None:
    with pytest.raises(DesignError, match=words):
        Compare("liking", within="clip", **given)


def test_power_simulates_agreement(tmp_path: Path) -> None:
    path = tmp_path / "liked.py"
    path.write_text(STUDY, encoding="utf-8")
    power = KitPower(str(path), tracker_of, quick_study)
    assert 4 == len(power.tests)  # and that a primary claim, and that anything is found
    with_effect, without = (
        power.simulate([8], list(power.tests), effect=effect, seed=3, alpha=0.05)[8]
        for effect in (1.0, 0.0)
    )
    assert {True} == {one.is_significant for one in with_effect.values()}
    assert {False} == {one.is_significant for one in without.values()}

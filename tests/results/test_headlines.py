"""Headlines of a report claim what the corrected tests found, and say where they found nothing."""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis import Compare, Factor, Rating, Study
from visavis.analysis.report import Verdict
from visavis.results.analysis import StudyAnalysis
from visavis.results.opened_study import OpenedStudy
from visavis.results.report.study_report import answers_of
from visavis.study.experiment import StudyExperiment
from visavis.study.pairs import Correlate, Family

Value = Callable[[Mapping[str, Any], np.random.Generator], float]
GAZE = Factor("gaze", ["averted", "directed"])
DISTANCE = Factor("distance", ["near", "far"])
PLACE = Factor("place", ["left", "middle", "right"])
GROUP = Factor("group", ["a", "b"], between=True)
NULL = 20
"""Seed of people in whom no comparison below finds anything."""


def analysed(
    factors: Iterable[Factor],
    compare: Iterable[Compare],
    values: Mapping[str, Value],
    *,
    participants: int = 12,
    families: Iterable[Family] = (),
    scores: Iterable[float] = (),
    seed: int = NULL,
) -> tuple[StudyAnalysis, StudyExperiment]:
    """Return a study of two trials a cell; `values` make the ratings of a trial."""
    study = Study(
        "mood", factors=list(factors), compare=list(compare), families=list(families), repetitions=2
    )

    @study.trial
    def trial(t: Any) -> Any:
        for name in values:
            yield t.ask(Rating(name, 1, 9))

    opened = OpenedStudy(study)
    experiment = opened.experiment({})
    rng = np.random.default_rng(seed)
    rows = [
        {
            "is_simulated": True,
            "participant": f"S{index:02d}",
            "session": 1,
            "trial_id": planned.trial_id,
            "attempt": 1,
            "is_practice": planned.is_practice,
            "status": "complete",
            "reason": None,
            **planned.factors,
            **{name: value(planned.factors, rng) for name, value in values.items()},
        }
        for index in range(participants)
        for planned in experiment.plan(index, seed).trials
    ]
    people = pd.DataFrame({"participant": [f"S{index:02d}" for index in range(participants)]})
    people = people.assign(**({"score": list(scores)} if scores else {}))
    planned_trials = dict.fromkeys(people["participant"], len(rows) // participants)
    return opened.analysis_of_rows(
        experiment, pd.DataFrame(rows), people, planned_counts=planned_trials
    ), experiment


def headlines(found: tuple[StudyAnalysis, StudyExperiment]) -> list[Verdict]:
    """Return what the report says first."""
    return answers_of(*found)


def chance(_: Mapping[str, Any], rng: np.random.Generator) -> float:
    return float(rng.normal(5, 1))


def skewed(_: Mapping[str, Any], rng: np.random.Generator) -> float:
    return float(np.exp(rng.normal(0, 1.5)))


def test_an_effect_on_which_its_own_notes_rest_no_claim_is_inconclusive() -> None:
    """Effects that multiply on a scale of which many give the lowest interact by themselves."""

    def bounded(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
        high = (factors["gaze"] == "directed") * (factors["distance"] == "near")
        return float(np.clip(round(rng.normal(1 + 4 * high, 0.6)), 1, 9))

    compare = Compare(
        "warmth",
        within=["gaze", "distance"],
        claim="Closeness warms a gaze",
        expects="gaze: directed > averted; distance: near > far",
    )
    said = headlines(analysed([GAZE, DISTANCE], [compare], {"warmth": bounded}))

    start = (
        "Inconclusive: closeness warms a gaze (directed minus averted, with near minus with far: "
    )
    claim = next(v for v in said if v.headline.startswith(start))
    assert "undecided" == claim.status
    assert "p < .001" in claim.detail
    assert re.search(r" Note: \d+% of responses stand at a bound", claim.detail)
    assert "do not rest a claim on it" in claim.detail
    assert ["found"] * 2 == [v.status for v in said if v is not claim]


def test_an_effect_lost_by_the_correction_is_no_finding() -> None:
    def lifted(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
        return chance(factors, rng) + 0.7 * float(factors["gaze"] == "directed")

    compare = [
        Compare(n, within="gaze", claim=f"Gaze raises {n}", expects="directed > averted")
        for n in ("a", "b", "c")
    ]
    values = {"a": lifted, "b": chance, "c": chance}
    alone = headlines(analysed([GAZE], compare[:1], values))
    together = headlines(analysed([GAZE], compare, values))

    by_how_much = "(directed minus averted: 0.89, 95% CI [0.15, 1.64])"
    assert [("found", f"Gaze raises a {by_how_much}")] == [(v.status, v.headline) for v in alone]
    lost = f"Not shown: gaze raises a {by_how_much}"
    assert ("not_found", lost) == (together[0].status, together[0].headline)
    assert "Corrected over the family of planned comparisons (holm): p = ." in together[0].detail


@pytest.mark.parametrize("value", [chance, skewed])
@pytest.mark.parametrize(
    ("factors", "effects"),
    [([GAZE], 1), ([PLACE], 1), ([GAZE, PLACE], 3), ([GROUP, GAZE], 3)],
    ids=["two levels", "three levels", "two factors", "groups"],
)
def test_what_is_inconclusive_says_so_with_its_interval(
    factors: list[Factor], effects: int, value: Value
) -> None:
    within = [f.name for f in factors if not f.between]
    between = [f.name for f in factors if f.between]
    compare = Compare("mood", within=within, between=between)
    said = headlines(analysed(factors, [compare], {"mood": value}))

    assert effects == len(said)
    for verdict in said:
        assert verdict.headline.startswith("Inconclusive: mood by ")
        assert "95% CI [" in verdict.detail


def test_what_two_people_cannot_decide_is_not_tested() -> None:
    compare = Compare("mood", within="gaze")
    (said,) = headlines(analysed([GAZE], [compare], {"mood": chance}, participants=2))

    assert ("undecided", "Mood: not tested") == (said.status, said.headline)
    assert "2 participants have mood; tests need 3" in said.detail


def test_correlations_make_a_headline_only_after_holms_correction() -> None:
    names = ("a", "b", "c", "d")
    of = Correlate("shyness", names, "gaze", "score", "shyness", "the score")
    scores = [*map(float, np.random.default_rng(6).permutation(12))]
    told = []
    for known in (scores, []):
        found = analysed([GAZE], [], dict.fromkeys(names, chance), families=[of], scores=known)
        told += [(v.status, v.headline) for v in headlines(found)]
        assert bool(known) == any(
            t.is_significant_alone for t in found[0].correlations_of("shyness")
        )
    assert [
        ("not_found", "Shyness: 0 of 8 tests significant"),
        ("undecided", "Shyness: not tested"),
    ] == told

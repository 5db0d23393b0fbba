"""No sentence of a report says more than its numbers: found by reading reports as a reviewer."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.experiments.test_reversed import table_of
from tests.results.test_headlines import DISTANCE, GAZE, analysed, chance, headlines
from visavis import Compare, Factor
from visavis.analysis.report import Cell, Verdict
from visavis.analysis.statistics.conditions import compare_conditions
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.report.family_report import NEITHER
from visavis.results.report.headlines import lost_by_correction, verdicts_of
from visavis.results.report.study_report import _beside_published, _caveats
from visavis.study.comparisons import published_f
from visavis.study.pairs import Printed
from visavis.study.source import Source


def one_pair_alone() -> pd.DataFrame:
    """Return people of whom two of three levels differ a little and the third varies much."""
    rng = np.random.default_rng(3)
    values = {"a": np.zeros(12), "b": rng.normal(0, 3, 12), "c": 0.25 + rng.normal(0, 0.2, 12)}
    own = rng.normal(0, 1, 12)
    return pd.DataFrame(
        {"participant": f"S{i:02d}", "place": level, "mood": of[i] + own[i]}
        for level, of in values.items()
        for i in range(12)
    )


def test_a_pair_is_not_said_to_differ_where_all_levels_together_do_not() -> None:
    outcome = compare_conditions(
        one_pair_alone(), "mood", subject="participant", within="place", always_posthoc=True
    )
    assert not outcome.significant
    lines = [str(step) for step in outcome.steps if str(step).startswith("Post-hoc")]
    assert not any(line.endswith("→ differ") for line in lines)
    assert any(line.endswith("→ no difference shown, as none is over all levels") for line in lines)


def test_two_results_that_are_not_significant_are_not_called_the_same() -> None:
    printed = Printed(False, text="p = .50")
    analysis, experiment = analysed(
        [GAZE], [Compare("mood", within="gaze", published={"gaze": printed})], {"mood": chance}
    )
    source = Source("Somebody", cells={"mood": {"averted": (5.0, 1.0)}})
    study = analysis.study.with_changes(source=source)
    table = _beside_published(replace(analysis, study=study), experiment.texts)
    assert table is not None
    cells = [row[-1] for row in table.rows]
    assert NEITHER in [cell.text for cell in cells if isinstance(cell, Cell)]
    assert "not significant there nor here, which shows no agreement" in table.note
    assert "Off by: in percent of the published mean." in table.note


def test_an_aligned_rank_test_is_named_in_the_headlines_detail() -> None:
    both = Compare("mood", within=("gaze", "distance"))
    outcome = analysed([GAZE, DISTANCE], [both], {"mood": chance})
    details = [verdict.detail for verdict in headlines(outcome)]
    assert details
    assert all(detail.startswith("Aligned rank transform ANOVA, ") for detail in details)


def test_what_is_significant_before_correction_only_is_said_to_be_so() -> None:
    analysis, experiment = analysed([GAZE], [Compare("mood", within="gaze")], {"mood": chance})
    (finding,) = analysis.findings
    (term,) = finding.terms
    lost = replace(finding, terms=(replace(term, p=0.03, p_corrected=0.06),))
    (verdict,) = verdicts_of(replace(analysis, findings=(lost,)), experiment)
    assert verdict.detail.startswith("Before correction: ")
    assert "(holm): p = .060, not significant." in verdict.detail
    (sentence,) = lost_by_correction(lost)
    assert "gaze: not significant after correction over the family of planned" in sentence
    still = replace(finding, terms=(replace(term, p=0.001, p_corrected=0.002),))
    assert () == lost_by_correction(still)


def test_a_direction_without_words_calls_levels_as_the_differences_do() -> None:
    looks = Factor("gaze", ["averted", "at_you"])
    compare = Compare("mood", within="gaze", expects="at_you > averted")
    (verdict,) = headlines(analysed([looks], [compare], {"mood": chance}))
    assert "mood: at you > averted (at you minus averted: " in verdict.headline


def test_a_printed_p_below_a_bound_is_spaced_like_every_other() -> None:
    printed = published_f(
        "18.92", 2, 30, p="<0.001", eta2p="0.56", is_significant=True, order="a > b"
    )
    assert "F(2, 30) = 18.92, p < .001, η²p = .56" == printed.text


@pytest.mark.parametrize(("name", "is_said"), [("crowd", True), ("interpolation", False)])
def test_a_report_says_where_everybody_had_the_conditions_in_one_order(
    name: str, is_said: bool
) -> None:
    whole = find_study(name).study
    opened = OpenedStudy(whole.with_changes(analysis=replace(whole.analysis, further_of=None)))
    experiment = opened.experiment({})
    trials, people, counts = table_of(opened, experiment, 0.8)
    analysis = opened.analysis_of_rows(experiment, trials, people, planned_counts=counts)
    said = " ".join(_caveats(analysis, experiment, []))
    assert is_said == ("in the same order, so what differs between them may also come" in said)


def test_intervals_of_several_headlines_are_said_not_to_be_widened() -> None:
    outcome = analysed([GAZE], [Compare("mood", within="gaze")], {"mood": chance})
    one = Verdict("found", "more (0.5, 95% CI [0.1, 0.9])", "")
    assert [] == list(_caveats(*outcome, [one]))
    (said,) = _caveats(*outcome, [one, one])
    assert "they are not widened for the number of comparisons" in said


def test_nothing_is_said_of_secondary_findings_where_nothing_was_tested() -> None:
    outcome = analysed([GAZE], [Compare("mood", within="gaze")], {"mood": chance})
    untested = Verdict("undecided", "not tested", "")
    assert [] == list(_caveats(*outcome, [untested, replace(untested, is_secondary=True)]))

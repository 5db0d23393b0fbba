import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tests.experiments.stare.simulated_studies import condition_means, describe
from tests.experiments.stare.synthetic_rows import (
    analysed,
    anxiety_answers,
    study_rows,
    varied_rows,
)
from visavis.experiments.stare import published
from visavis.experiments.stare.comparisons import (
    ALL_MEASURES,
    CONDITION_TESTS,
    DWELL,
    FIRST_TIME,
    FIXATION_COUNT,
    MEASURES,
)
from visavis.experiments.stare.conclusions import conclude
from visavis.experiments.stare.design import CONDITIONS
from visavis.experiments.stare.study import experiment_of
from visavis.lab.errors import DataError
from visavis.results.family_tests import (
    Agreement,
    agreement,
    compare,
    compare_pairs,
    count_agreement,
    find_test,
)
from visavis.results.outputs import statistics_rows

N = 20


@pytest.fixture(scope="module")
def study():
    rows = study_rows(N)
    return analysed(rows, anxiety_answers(N), varied=varied_rows(rows))


def means_of(**columns: list[float]) -> pd.DataFrame:
    """Return condition means with dwell times by condition, one list entry per participant."""
    return pd.DataFrame(
        [
            {"participant": f"S{i}", "condition": condition, DWELL.column: value}
            for condition, values in columns.items()
            for i, value in enumerate(values)
        ]
    )


def in_columns(means: pd.DataFrame) -> pd.DataFrame:
    """Return dwell times with one row per participant and one column per condition."""
    return means.pivot(index="participant", columns="condition", values=DWELL.column)


def dwell(means: pd.DataFrame):
    return compare(in_columns(means), DWELL, ("A", "D"), CONDITION_TESTS, n_tests=30)


def thirty(rows):
    return compare_pairs(CONDITION_TESTS, rows, ALL_MEASURES, experiment_of().levels)


def test_condition_mean_averages_the_trials_of_a_condition(study):
    rows = study.selection.counted
    here = rows[(rows["participant"] == "S01") & (rows["condition"] == "AD")]
    means = study.cell_means().set_index(["participant", "condition"])

    assert here["dwell_ms"].mean() == pytest.approx(means.loc[("S01", "AD"), "dwell_ms"])
    assert means.loc[("S01", "AD"), "n"] == 18


def test_thirty_tests_share_alpha_over_thirty(study):
    assert len(study.pairs_of("conditions")) == 30
    assert {c.threshold for c in study.pairs_of("conditions")} == {0.05 / 30}
    assert {c.threshold for c in study.pairs_of("places")} == {0.05 / 9}
    assert len(study.pairs_of("places")) == 18
    assert {c.threshold for c in study.pairs_of("zones")} == {0.05 / 3}
    assert len(study.pairs_of("zones")) == 15


def test_test_equals_scipy_on_the_participants_means(study):
    wide = study.cell_means().pivot(index="participant", columns="condition", values="dwell_ms")
    expected = stats.ttest_rel(wide["A"], wide["D"])
    outcome = find_test(study.pairs_of("conditions"), DWELL.column, ("A", "D")).outcome

    assert outcome is not None
    assert outcome.is_parametric == (stats.shapiro(wide["A"] - wide["D"]).pvalue > 0.05)
    assert expected.pvalue == pytest.approx(outcome.p)


def test_pairs_with_a_missing_value_are_left_out_and_counted():
    means = means_of(A=[1.0, 2.0, np.nan, 4.0, 5.5], D=[3.0, 3.5, 7.0, 8.0, 9.0])

    test = dwell(means)

    assert (test.n_pairs, test.n_incomplete) == (4, 1)
    assert test.first_mean == pytest.approx((1 + 2 + 4 + 5.5) / 4)
    assert "n = 4 (1 participant without both values)" in test.sentence()


def test_two_participants_are_too_few_and_the_sentence_says_so():
    test = dwell(means_of(A=[1.0, 2.0], D=[3.0, 5.0]))

    assert test.outcome is None
    assert test.is_significant is None
    assert "not tested, 2 participants with both values, 3 needed" in test.sentence()


def test_constant_difference_is_tested_by_ranks():
    test = dwell(means_of(A=[1.0, 2.0, 3.0, 4.0], D=[2.0, 3.0, 4.0, 5.0]))

    assert not test.problem
    assert test.outcome is not None
    assert test.outcome.p == 0.125


def test_condition_nobody_saw_gives_no_test():
    test = dwell(means_of(A=[1.0, 2.0, 3.0, 4.0]))

    assert (test.n_pairs, test.n_incomplete) == (0, 4)
    assert test.outcome is None


def test_direction_is_up_when_the_second_condition_has_more():
    assert dwell(means_of(A=[1.0, 2.0, 3.1], D=[3.0, 4.0, 9.0])).direction == 1
    assert dwell(means_of(A=[3.0, 4.0, 9.0], D=[1.0, 2.0, 3.1])).direction == -1


def test_sentence_names_test_n_statistic_p_effect_interval_and_threshold(study):
    for test in (
        *study.pairs_of("conditions"),
        *study.pairs_of("places"),
        *study.pairs_of("zones"),
    ):
        text = test.sentence()

        assert f"n = {test.n_pairs}" in text
        assert "t test" in text or "Wilcoxon" in text
        assert "t(" in text or "V = " in text
        assert "p = ." in text or "p < .001" in text
        assert "95% CI [" in text
        assert f"over {test.n_tests} tests" in text


def test_descriptives_use_everyone_who_has_a_value():
    means = means_of(A=[1.0, 3.0, np.nan])
    for measure in MEASURES[1:]:
        means[measure.column] = np.nan

    results = {(d.measure, d.condition): d for d in describe(means)}

    assert (results[DWELL, "A"].n, results[DWELL, "A"].mean) == (2, 2.0)
    assert results[DWELL, "A"].sd == pytest.approx(np.sqrt(2))
    assert results[FIXATION_COUNT, "A"].n == 0
    assert np.isnan(results[FIXATION_COUNT, "A"].mean)


@pytest.mark.parametrize(
    ("printed", "ours", "same_direction", "expected"),
    [
        (True, True, True, True),
        (True, True, False, False),
        (True, False, True, False),
        (False, True, True, False),
        (False, False, False, True),
        (True, None, True, None),
    ],
)
def test_verdicts_agree_in_significance_and_direction(printed, ours, same_direction, expected):
    assert Agreement(printed, ours, same_direction).agrees is expected


def test_data_at_the_published_means_agree_with_most_published_verdicts(study):
    assert count_agreement(study.pairs_of("conditions")).published_count == 30
    assert count_agreement(study.pairs_of("conditions")).agree >= 24


def test_reversed_effect_does_not_agree_with_the_published_one():
    rows = study_rows(N)
    rows["condition"] = rows["condition"].map({"A": "D", "D": "A", "AD": "AD", "DA": "DA"})
    means = condition_means(rows)
    test = compare(in_columns(means), DWELL, ("A", "D"), CONDITION_TESTS, n_tests=30)

    assert test.is_significant is True
    assert agreement(test).agrees is False
    assert conclude(thirty(means), ())[0].status == "reversed"


def test_effect_is_found_only_with_both_dwell_time_and_fixation_count():
    rows = study_rows(N)
    both = conclude(thirty(rows), ())
    rows["fixation_count"] = study_rows(N, effect=False, seed=3)["fixation_count"]
    dwell_only = conclude(thirty(rows), ())

    assert both[0].status == "found"
    assert dwell_only[0].status == "partly"


def test_no_effect_is_reported_as_not_significant_with_n():
    rows = study_rows(12, effect=False, seed=5)
    results = analysed(rows, anxiety_answers(12))

    assert results.conclusions[0].headline == (
        "Stare-in-the-crowd effect: not significant with n = 12 (dwell time, directed minus "
        "averted: +166 ms, 95% CI [+19, +313]; fixation count, directed minus averted: −0.25, "
        "95% CI [−0.49, −0.01])"
    )


@pytest.mark.parametrize("participants", [1, 2])
def test_too_few_participants_are_said_not_computed(participants):
    rows = study_rows(participants)
    results = analysed(rows, anxiety_answers(participants))

    assert {c.status for c in results.conclusions} == {"undecided"}
    assert count_agreement(results.pairs_of("conditions")).comparable_count == 0
    assert all("not tested" in c.sentence() for c in results.pairs_of("conditions"))


def test_anxiety_correlation_uses_those_with_a_score(study):
    answers = anxiety_answers(N)
    answers.loc[0:1, "social_anxiety_total"] = np.nan
    results = analysed(study.selection.rows, answers).correlations_of("anxiety")
    with_d = next(c for c in results if c.measure == DWELL and c.level == "D")

    assert {c.n for c in study.correlations_of("anxiety") if c.measure == DWELL} == {N}
    assert with_d.n == N - 2


def test_strong_negative_anxiety_relation_is_found():
    rows = study_rows(N)
    order = {f"S{i + 1:02d}": i for i in range(N)}
    rank = rows["participant"].map(order)
    answers = pd.DataFrame({"participant": list(order), "social_anxiety_total": range(10, 10 + N)})
    rows["dwell_ms"] = 3000.0 - 100 * rank + 0.001 * rows["dwell_ms"]
    results = analysed(rows, answers)

    assert results.conclusions[-1].status == "found"
    assert "3 of 3 conditions" in results.conclusions[-1].answer
    significant = [a for a in results.correlations_of("anxiety") if a.measure == DWELL]
    assert all(a.outcome is not None and a.outcome.r < -0.9 for a in significant)


def test_two_scores_of_one_participant_are_refused():
    answers = pd.DataFrame({"participant": ["S01", "S01"], "social_anxiety_total": [5, 6]})

    with pytest.raises(DataError, match="S01 has two"):
        analysed(study_rows(3), answers)


def test_no_answers_leave_the_rest_of_the_analysis():
    results = analysed(study_rows(4), pd.DataFrame())

    assert results.conclusions[-1].status == "undecided"
    assert all(c.outcome is not None for c in results.pairs_of("conditions") if c.measure == DWELL)


def test_sensitivity_repeats_the_main_analysis_at_its_own_setting(study):
    own = [r for r in study.sensitivity if (r.pad_deg, r.minimum_fixation_ms) == (1.0, 150.0)]

    assert len(study.sensitivity) == 15
    assert own[0].same_verdicts == 30
    main = find_test(study.pairs_of("conditions"), DWELL.column, ("A", "D"))
    assert own[0].first_tests[0].first_mean == pytest.approx(main.first_mean)


def test_sensitivity_leaves_out_excluded_trials():
    rows = study_rows(5)
    varied = varied_rows(rows)
    rows.loc[rows["trial_id"] == "T01", "lost_01"] = 0.9
    varied.loc[varied["trial_id"] == "T01", "dwell_ms"] = 1e9
    results = analysed(rows, anxiety_answers(5), varied=varied)

    assert max(r.first_tests[0].first_mean for r in results.sensitivity) < 1e5


def test_second_view_compares_fixations_of_the_velocity_detector(study):
    assert len(study.pairs_of("second view")) == 5
    assert {c.n_tests for c in study.pairs_of("second view")} == {5}


def test_zone_means_average_the_three_depths(study):
    rows = study.selection.counted
    part = rows[(rows["zone"] == "centre") & (rows["condition"].isin(["A", "D"]))]
    means = part.groupby(["participant", "condition"])[FIRST_TIME.column].mean().unstack()
    test = find_test(study.pairs_of("zones"), FIRST_TIME.column, ("A", "D"), "centre")

    assert test.first_mean == pytest.approx(means.dropna()["A"].mean())


def test_statistics_rows_name_every_family_and_every_sentence(study):
    rows = statistics_rows(study)

    assert len(rows) == 30 + 18 + 15 + 24 + 5 + 30
    assert all(r["sentence"] for r in rows)
    assert {r["family"] for r in rows} == {
        "conditions",
        "places",
        "zones",
        "anxiety",
        "second view",
        "without exclusions",
    }


def test_order_of_rows_does_not_change_the_analysis(study):
    shuffled = study.selection.rows.sample(frac=1, random_state=1).reset_index(drop=True)
    again = analysed(shuffled, anxiety_answers(N))

    for a, b in zip(study.pairs_of("conditions"), again.pairs_of("conditions"), strict=True):
        assert a.outcome is not None
        assert b.outcome is not None
        assert a.outcome.p == pytest.approx(b.outcome.p, rel=1e-9)


def test_published_means_lie_at_zero_deviation():
    means = pd.DataFrame(
        [
            {"participant": who, "condition": c}
            | {m.column: published.MEANS[c][m.column].mean for m in MEASURES}
            for c in CONDITIONS
            for who in ("S1", "S2")
        ]
    )

    assert {d.deviation_01 for d in describe(means)} == {0.0}


def test_conditions_left_out_of_a_study_are_not_tested_and_share_no_alpha():
    rows = study_rows(N)
    rows = rows[rows["condition"].isin(["A", "D"])]
    parameters = {"condition": ["A", "D"], "zone": ["left", "right"]}
    results = analysed(rows, anxiety_answers(N), parameters=parameters)
    tested = [c for c in results.pairs_of("conditions") if c.outcome is not None]

    assert {("A", "D")} == {(c.first, c.second) for c in tested}
    assert {0.05 / 6} == {c.threshold for c in tested}
    assert {0.05 / 2} == {c.threshold for c in results.pairs_of("zones")}
    assert {"A", "D"} == {c.level for c in results.correlations_of("anxiety")}
    untested = find_test(results.pairs_of("conditions"), DWELL.column, ("D", "DA"))
    assert untested.sentence().endswith("not tested, the study was performed without DA.")
    assert results.conclusions[0].status == "found"
    assert results.conclusions[2].answer == "not tested"

"""From rows of trials to statistics, tables and the report, as the waving study declares them."""

import json

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.report import ReportProvenance
from visavis.analysis.statistics.published import check_f
from visavis.experiments.waving.clips import DIRECTIONS, TECHNIQUES
from visavis.experiments.waving.sections import relative_confusion, warping_section
from visavis.experiments.waving.study import study
from visavis.lab.errors import DataError
from visavis.results.opened_study import OpenedStudy
from visavis.results.outputs import statistics_rows, write_study

WAVING = OpenedStudy(study)
EXPERIMENT = WAVING.experiment({})


def rows(participants=6, *, better=0.25, seed=0):
    """Return trials in which warping is answered rightly more often."""
    rng = np.random.default_rng(seed)
    found = []
    for index in range(participants):
        for trial in EXPERIMENT.plan(index, seed).trials:
            f = trial.factors
            right = rng.random() < 0.45 + (better if f["technique"] == "warping" else 0.0)
            others = [f"place_{k}" for k in range(1, 6) if f"place_{k}" != f["target_place"]]
            found.append(
                {
                    "is_simulated": True,
                    "participant": f"S{index:02d}",
                    "session": 1,
                    "trial_id": trial.trial_id,
                    "attempt": 1,
                    "is_practice": trial.is_practice,
                    "status": "complete",
                    "reason": None,
                    **f,
                    "who": f["target_place"] if right else others[int(rng.integers(4))],
                    "is_right": bool(right),
                    "who_by": "ray",
                    "realism": int(rng.integers(3, 9)),
                    "who_ms": float(rng.uniform(900, 2500)),
                }
            )
    return pd.DataFrame(found)


def analysed(table, people=None):
    names = sorted(set(table["participant"]))
    answers = pd.DataFrame({"participant": names}) if people is None else people
    planned = dict.fromkeys(names, 54)
    return WAVING.analysis_of_rows(EXPERIMENT, table, answers, planned_counts=planned)


def verdicts(analysis, dv):
    """Return whether each effect on a measure is significant."""
    finding = next(f for f in analysis.findings if f.compare.dv == dv)
    return {term.name: term.is_significant for term in finding.terms}


@pytest.fixture(scope="module")
def analysis():
    return analysed(rows())


def test_cells_are_means_of_nine_trials_without_training(analysis):
    means = analysis.cell_means()
    assert 6 * 6 == len(means)
    assert (means["n"] == 9).all()
    one = analysis.selection.counted.query("participant == 'S00'")
    chosen = one[(one["technique"] == "warping") & (one["direction"] == "left")]
    cell = means.query("participant == 'S00' and technique == 'warping' and direction == 'left'")
    assert chosen["is_right"].mean() == pytest.approx(cell["is_right"].item())
    assert chosen["who_ms"].median() == pytest.approx(cell["who_ms"].item())


def test_a_planted_advantage_is_found_and_its_sign_kept(analysis):
    assert verdicts(analysis, "is_right")["technique"]
    means = analysis.cell_means().groupby("technique")["is_right"].mean()
    assert means["warping"] > means["orientation"]


def test_no_advantage_is_not_found():
    assert not verdicts(analysed(rows(better=0.0, seed=3)), "is_right")["technique"]


def test_each_effect_stands_beside_what_the_source_prints_of_it(analysis):
    table = pd.DataFrame(statistics_rows(analysis)).set_index(["measure", "term"])
    assert 18.92 == table.loc[("is_right", "direction"), "published_statistic"]
    assert not table.loc[("is_right", "technique:direction"), "published_significant"]
    assert table.loc[("is_right", "technique"), "agrees_with_published"]
    assert table.loc["who_ms", "published"].isna().all()


def test_relative_answers_sum_to_the_trials_of_a_cell(analysis):
    table = relative_confusion(analysis.selection.counted)
    assert len(TECHNIQUES) * len(DIRECTIONS) == len(table)
    assert (table[["left", "self", "right", "farther"]].sum(axis=1) == 6 * 9).all()


def test_a_participant_without_all_cells_is_left_out_and_named():
    table = rows(4)
    gone = (table["participant"] == "S03") & (table["direction"] == "left")
    found = analysed(table[~gone])
    people = found.selection.people
    assert ["S03"] == people.loc[~people["is_analysed"], "participant"].tolist()
    assert 3 == found.n_participants


def test_a_participant_without_a_trial_of_one_clerk_still_counts():
    table = rows(3)
    gone = (table["participant"] == "S01") & (table["trial_id"] == "T07")
    assert 3 == analysed(table[~gone]).n_participants


def test_with_two_participants_nothing_is_tested_and_it_is_said_why():
    accuracy = analysed(rows(2)).findings[0]
    assert accuracy.outcome is None
    assert "2 participants" in accuracy.why_not


def test_unanswered_ratings_are_missing_not_zero():
    table = rows(3)
    table["realism"] = table["realism"].astype(object)
    gone = (table["participant"] == "S00") & (table["direction"] == "self")
    table.loc[gone, "realism"] = None
    means = analysed(table).cell_means()
    missing = means[(means["participant"] == "S00") & (means["direction"] == "self")]
    assert missing["realism"].isna().all()
    assert missing["is_right"].notna().all()


def test_no_answered_trial_is_an_error_that_says_so():
    with pytest.raises(DataError, match="no trial of waving counts"):
        analysed(rows(2).assign(status="interrupted"))


def test_published_eta_of_direction_does_not_follow_from_its_f():
    check = check_f("18.92", 2, 30, p="<0.001", eta="0.356")
    assert not check.verdicts["eta2p"].is_consistent
    accuracy = study.analysis.compare[0]
    (said,) = accuracy.published_of("direction").misfits
    assert "partial η² of .356" in said
    assert "implies .558" in said


def test_the_report_shows_published_values_and_what_is_wrong_with_them(analysis, tmp_path):
    path = write_study(
        analysis, EXPERIMENT, (), ReportProvenance("waving", "1", "virtual time"), tmp_path
    )
    text = path.read_text(encoding="utf-8")
    for expected in (
        "F(1, 15) = 7.09",
        "18.92",
        ".356",
        ".558",
        "SIMULATED",
        "0.67 (0.20)",
        "power is lower",
        "What the source says",
        "Who was waved at",
    ):
        assert expected in text
    assert ">nan" not in text
    for name in ("trials", "participants", "cell_means", "confusion", "statistics", "contrasts"):
        table = pd.read_csv(tmp_path / f"{name}.csv")
        described = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
        assert list(table.columns) == [c for c in described if c in table.columns]
        assert all(described[c]["Description"] for c in table.columns)


def of_warps(met_01):
    trials = rows(3)
    warped = trials["technique"] == "warping"
    return trials.assign(
        coverage_wanted=np.where(warped, 1.25, np.nan),
        coverage_reached=np.where(warped, 1.11, np.nan),
        target_met_01=np.where(warped, met_01, np.nan),
        target_reachable_01=np.where(warped, 0.5, np.nan),
        warp_loop_hz=np.where(warped & (trials["direction"] == "self"), 29.6, np.nan),
        warp_late=np.where(warped & (trials["direction"] == "self"), 1, np.nan),
    )


def test_report_says_what_warping_reached_and_warns_where_it_missed():
    said = str(warping_section(analysed(of_warps(0.05)), EXPERIMENT).section)
    assert "Warping met its target in 5 % of frames" in said
    assert "50 % were within reach" in said
    assert "'All', '81', '+25 %', '+11 %', '50 %', '5 %'" in said
    assert "30 times a second" in said
    assert "27 corrections came too late" in said
    assert "Warping met" not in str(warping_section(analysed(of_warps(0.9)), EXPERIMENT).section)


def test_what_an_older_recording_does_not_tell_of_warping_is_missing():
    older = of_warps(0.05).drop(columns="target_reachable_01")
    said = str(warping_section(analysed(older), EXPERIMENT).section)
    assert "'All', '81', '+25 %', '+11 %', '–', '5 %'" in said


def test_a_recording_that_does_not_tell_what_was_reached_says_so():
    said = str(warping_section(analysed(rows(2)), EXPERIMENT).section)
    assert "does not tell what was reached" in said


def test_a_session_that_broke_off_is_no_whole_person_and_no_verdict_rests_on_it():
    table = rows(7)
    own = table[table["participant"] == "S06"]
    broken = own[~own["is_practice"]].index[25:]
    found = analysed(table.drop(index=broken))
    out = found.selection.people.set_index("participant").loc["S06", "left_out_because"]
    assert "46% of the planned trials finished (limit 75%)" in out
    assert 6 == found.n_participants
    assert (
        found.findings[0].terms
        == analysed(rows(7)[lambda t: t["participant"] != "S06"]).findings[0].terms
    )

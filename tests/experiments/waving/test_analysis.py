"""From rows of trials to statistics, tables and the report."""

import json

import numpy as np
import pandas as pd
import pytest

from analysis.report import ReportProvenance
from experiments.waving.analysis import analyse_rows
from experiments.waving.data_dictionary import TABLES
from experiments.waving.design import DIRECTIONS, TECHNIQUES, WavingParameters, plan_session
from experiments.waving.figures import study_figures
from experiments.waving.measures import cell_means, confusion, eye_heights, relative_confusion
from experiments.waving.methods_text import method_paragraphs
from experiments.waving.published import EFFECTS, check_effect, published_effect
from experiments.waving.report import build_report
from experiments.waving.report_people import people_section
from experiments.waving.study_outputs import write_tables
from lab.errors import DataError


def rows(participants=6, *, better=0.25, seed=0):
    """Return trials in which warping is answered rightly more often."""
    rng = np.random.default_rng(seed)
    found = []
    for index in range(participants):
        for trial in plan_session(index, seed).trials:
            f = trial.factors
            right = rng.random() < 0.45 + (better if f["technique"] == "warping" else 0.0)
            others = [f"place_{k}" for k in range(1, 6) if f"place_{k}" != f["target_place"]]
            found.append(
                {
                    "is_simulated": True,
                    "participant": f"S{index:02d}",
                    "session": 1,
                    "trial_id": trial.trial_id,
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


@pytest.fixture(scope="module")
def analysis():
    return analyse_rows(rows(), is_simulated=True)


def test_cells_are_means_of_nine_trials_without_training(analysis):
    assert 6 * 6 == len(analysis.means)
    assert (analysis.means["n"] == 9).all()
    one = analysis.analysed[analysis.analysed["participant"] == "S00"]
    chosen = one[(one["technique"] == "warping") & (one["direction"] == "left")]
    cell = analysis.means.query(
        "participant == 'S00' and technique == 'warping' and direction == 'left'"
    )
    assert chosen["is_right"].mean() == pytest.approx(cell["accuracy"].item())
    assert chosen["who_ms"].median() == pytest.approx(cell["response_ms"].item())


def test_a_planted_advantage_is_found_and_its_sign_kept(analysis):
    assert analysis.of("accuracy").is_significant("technique")
    means = analysis.by_technique("accuracy")
    assert means["warping"][0] > means["orientation"][0]


def test_no_advantage_is_not_found():
    found = analyse_rows(rows(better=0.0, seed=3), is_simulated=True)
    assert not found.of("accuracy").is_significant("technique")


def test_confusions_count_every_answer_once(analysis):
    assert len(analysis.analysed) == confusion(analysis.analysed).sum()
    both = sum(confusion(analysis.analysed, t) for t in TECHNIQUES)
    assert np.array_equal(both, confusion(analysis.analysed))
    right = int(analysis.analysed["is_right"].sum())
    assert right == np.trace(confusion(analysis.analysed))


def test_relative_answers_sum_to_the_trials_of_a_cell(analysis):
    table = relative_confusion(analysis.analysed)
    assert len(TECHNIQUES) * len(DIRECTIONS) == len(table)
    assert (table[["left", "self", "right", "farther"]].sum(axis=1) == 6 * 9).all()


def test_the_last_attempt_of_a_trial_counts():
    table = rows(3)
    again = table.iloc[[5]].assign(who="place_1", is_right=False)
    found = analyse_rows(pd.concat([table, again]), is_simulated=True)
    assert 3 * 54 == len(found.analysed)


def test_a_participant_without_all_cells_is_left_out_and_named():
    table = rows(4)
    gone = (table["participant"] == "S03") & (table["direction"] == "left")
    found = analyse_rows(table[~gone], is_simulated=True)
    assert ("S03",) == found.left_out
    assert 3 == found.n_participants


def test_with_two_participants_nothing_is_tested_and_it_is_said_why():
    found = analyse_rows(rows(2), is_simulated=True)
    assert found.of("accuracy").anova is None
    assert "2 participants" in found.of("accuracy").why_not


def test_unanswered_ratings_are_missing_not_zero():
    table = rows(3)
    table["realism"] = table["realism"].astype(object)
    gone = (table["participant"] == "S00") & (table["direction"] == "self")
    table.loc[gone, "realism"] = None
    means = cell_means(table[~table["is_practice"]])
    missing = means[(means["participant"] == "S00") & (means["direction"] == "self")]
    assert missing["realism"].isna().all()
    assert missing["accuracy"].notna().all()


def test_simulated_and_real_sessions_are_not_mixed():
    table = rows(3)
    table.loc[table["participant"] == "S01", "is_simulated"] = False
    with pytest.raises(DataError, match="apart"):
        analyse_rows(table, is_simulated=True)


def test_no_answered_trial_is_an_error_that_says_so():
    with pytest.raises(DataError, match="no finished trial"):
        analyse_rows(rows(2).assign(status="interrupted"), is_simulated=True)


def test_published_eta_of_direction_does_not_follow_from_its_f():
    check = check_effect(published_effect("accuracy", "direction"))
    assert not check.verdicts["eta2p"].is_consistent
    assert check.values["eta2p"] == pytest.approx(0.558, abs=5e-4)
    others = [check_effect(e) for e in EFFECTS if e.F and e.term != "direction"]
    assert all(abs(c.values["p"] - float(c.verdicts["p"].printed)) < 0.01 for c in others)


def test_the_report_shows_published_values_and_what_is_wrong_with_them(analysis, tmp_path):
    people = pd.DataFrame({"participant": ["S00"], "age": [25], "strategy": ["the eyes"]})
    path = build_report(
        analysis,
        people,
        ReportProvenance("waving", "1", "virtual time"),
        study_figures(analysis),
        tmp_path / "report.html",
        WavingParameters(),
    )
    text = path.read_text(encoding="utf-8")
    for expected in ("F(1, 15) = 7.09", "18.92", ".356", ".558", "SIMULATED", "0.67 (0.20)"):
        assert expected in text
    assert ">nan" not in text


def test_every_column_of_every_table_is_described(analysis, tmp_path):
    people = pd.DataFrame({"participant": ["S00"], "age": [25]})
    write_tables(analysis, people, tmp_path)
    for name in TABLES:
        table = pd.read_csv(tmp_path / f"{name}.csv")
        described = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
        assert list(described) == list(table.columns)
        assert all(d["Description"] for d in described.values())


def of_height(*heights_m):
    trials = rows(len(heights_m))
    people = sorted(set(trials["participant"]))
    own = trials["participant"].map(dict(zip(people, heights_m, strict=True)))
    return trials.assign(eye_height_m=own, planned_eye_height_m=1.62)


def test_eye_height_more_than_the_tolerance_from_the_planned_one_is_marked():
    table = eye_heights(of_height(1.62, 1.66, 1.68, 1.50, np.nan))
    np.testing.assert_allclose([0.0, 0.04, 0.06, -0.12, np.nan], table["eye_height_off_m"])
    assert [False, False, True, True, False] == list(table["eye_height_is_off"])


def test_recordings_without_eye_heights_mark_nobody():
    assert eye_heights(rows(2)).empty


def test_report_names_whom_the_waves_were_not_warped_for():
    trials = of_height(1.62, 1.70, 1.60)
    said = str(people_section(analyse_rows(trials, is_simulated=True), eye_heights(trials)))
    assert "S01: 1.70 m (+0.08 m)" in said
    assert "S02: " not in said


def test_report_counts_genders_and_missing_answers():
    people = pd.DataFrame({"participant": list("abcd"), "age": [25] * 4, "gender": [1, 2, 2, None]})
    said = str(people_section(analyse_rows(rows(3), is_simulated=True), people))
    assert "Gender: woman 1, man 2, no answer 1." in said


def test_report_says_whose_words_the_source_s_are():
    assert method_paragraphs(WavingParameters())[-1].startswith("What the source says")

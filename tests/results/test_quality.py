import numpy as np
import pytest

from tests.experiments.stare.synthetic_rows import analysed, anxiety_answers, study_rows
from tests.sessions import opened
from visavis.analysis.report import ReportProvenance
from visavis.experiments.stare.scene import distances
from visavis.results.analysis import AnalysisInForce, analyse_rows
from visavis.results.quality import quality_of as quality_of_study
from visavis.results.quality import quality_of_trials, quality_table
from visavis.results.report.reporting_list import FILL_IN, OPEN, WHY_NOT, reporting_table
from visavis.results.report.study_report import exclusion_counts_of
from visavis.results.selection import select
from visavis.study.exclusions import limits_in_force
from visavis.study.measures import Measure


@pytest.fixture(scope="module")
def analysis():
    return analysed(study_rows(3), anxiety_answers(3))


def people(**columns):
    return anxiety_answers(3).assign(**columns)


def quality_of(analysis, answers, **options):
    return quality_of_trials(
        analysis.selection.rows,
        analysis.selection.finished,
        max_trial_lost_01=0.3,
        people=answers,
        **options,
    )


def listed(analysis, quality, setup=None):
    provenance = ReportProvenance("stare", "1", "", setup=setup or {})
    table = reporting_table(exclusion_counts_of(analysis), quality, provenance)
    cells = {str(r[0]): r[1] for r in table.rows}
    return {k: c if isinstance(c, str) else c.text for k, c in cells.items()}, table.note


def test_end_of_session_and_rejected_validations_are_shown(analysis):
    answers = people(
        end_accuracy_deg=[0.8, 3.0, np.nan],
        drift_deg=[0.25, 1.5, np.nan],
        rejected_validations=[0, 2, 0],
    )
    quality = quality_of(analysis, answers, max_error_deg=2.5)
    rows = quality_table(quality).rows
    items, _ = listed(analysis, quality)

    assert rows[1][-3:] == ("3.00", "1.50", "2")
    assert rows[2][-3:] == ("–", "–", "0")
    assert quality.incidents == (
        ("S02", "2 validations rejected", "did not meet the thresholds; calibrated again"),
        ("S02", "large error at the end of the session", "3.00°, limit 2.5°"),
    )
    assert items["Validations rejected"] == "2, of 1 participant"
    assert items["Drift: error at the end minus error before (range)"].startswith("0.88°")


def test_without_those_columns_nothing_is_added(analysis):
    quality = quality_of(analysis, people())

    assert len(quality_table(quality).columns) == 8
    assert "Validations rejected" not in listed(analysis, quality)[0]


def test_vision_is_counted_in_the_words_of_the_questionnaire(analysis):
    quality = quality_of(analysis, people(vision=[1, 2, None]))

    assert quality.facts["vision"] == (
        "1 normal without correction, 1 corrected with contact lenses, 1 without an answer"
    )


def test_vision_nobody_answered_stays_open(analysis):
    quality = quality_of(analysis, people(vision=[None, None, None]))

    assert listed(analysis, quality)[0]["Participants' vision and correction"] == (
        f"{OPEN}{WHY_NOT['vision']}"
    )


def test_items_answered_in_part_are_marked_and_counted(analysis):
    facts = {"display": "Vive Pro, 90 Hz", "viewing": "seated, head free"}
    facts["distances"] = distances()
    items, note = listed(analysis, quality_of(analysis, None, facts=facts))
    display = items["Display: device, resolution, field of view, refresh rate"]
    viewing = items["Viewing conditions: posture, head restraint, distance to the agents"]

    assert display == f"Vive Pro, 90 Hz; resolution and field of view: {FILL_IN}"
    assert viewing == "seated, head free; agents' heads 1.4 to 4.2 m from the eyes (seating plan)"
    assert note == "13 items not recorded, 1 item partly open."


def test_what_the_lab_filled_in_is_whole(analysis):
    setup = {"display": "Vive Pro, 1440 × 1600 per eye, 98°, 90 Hz"}
    items, _ = listed(analysis, quality_of(analysis, None, facts={"display": "Vive Pro"}), setup)

    assert setup["display"] in items.values()


def test_confidence_and_stamps_have_a_row_each(analysis):
    items, _ = listed(analysis, quality_of(analysis, None))

    assert "0.6" in items["Samples counted as lost"]
    assert "0.25" in items["Samples counted as lost"]
    assert "sorted in" in items["Time stamps that repeat or go back"]


def duel_of(rows):
    """Return the analysis of a study that asks for nothing but looks, with its own rules."""
    study = opened("duel").study
    limits = limits_in_force(study.analysis.exclusions, {})
    selection = select(
        rows, study.analysis.exclusions, limits, cells=["gaze"], planned_counts={}, cell_count=2
    )
    measures = [Measure("dwell_ms", "ms", "Dwell time", needs_gaze=True)]
    levels = {"gaze": ("averted", "directed")}
    in_force = AnalysisInForce(levels, measures)
    return analyse_rows(study, selection, anxiety_answers(3), in_force, is_simulated=True)


def duel_rows(**columns):
    rows = study_rows(3).rename(columns={"lost_01": "gaze_lost_01"})
    rows = rows.assign(gaze=rows["condition"].map({"A": "averted"}).fillna("directed"))
    return rows.assign(**columns)


def test_any_study_of_gaze_shows_its_quality_with_its_own_limits():
    rows = duel_rows(gaze_lost_01=0.1)
    rows.loc[rows.index[:5], "gaze_lost_01"] = 0.6
    quality = quality_of_study(duel_of(rows), {"viewing": "seated"})

    assert [5, 0, 0] == quality.participants["trials_out"].tolist()
    assert {"viewing": "seated"} == quality.facts


def test_a_study_without_gaze_shows_none():
    rows = duel_rows(gaze_lost_01=np.nan, calibration_accuracy_deg=np.nan)

    assert quality_of_study(duel_of(rows)) is None

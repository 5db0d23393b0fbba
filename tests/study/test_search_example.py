"""The ready visual search goes from plan to report, and on after a kill."""

import pandas as pd
import pytest

from tests.study.simulated_study import invoked, killed_and_analysed


def drawn_files(folder):
    """Return the files below a folder, by their names from there."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*.svg")}


@pytest.mark.timeout(600)
def test_the_ready_search_goes_from_plan_to_report_and_on_after_a_kill(tmp_path, monkeypatch):
    folder = killed_and_analysed("search", monkeypatch, tmp_path, "--screen", shows="full_1")
    rows = pd.read_csv(folder / "derived" / "trials.csv")
    rows = rows[rows["status"] == "complete"]
    assert {4} == set(rows.groupby(["participant", "clutter"]).size())
    assert rows["fixation_gaze_delay_ms"].dropna().between(0, 200).all()
    assert rows["answer_is_right"].mean() > 0.8
    assert (rows["key_dwell_ms"] > 0).any()
    assert {"cup_entries", "key_to_cup", "cup_pupil_mm", "key_share_01"} <= set(rows)
    findings = pd.read_csv(folder / "derived" / "statistics.csv")
    assert {"key_first_look_ms", "answer_ms"} <= set(findings["measure"])
    invoked("gaze-map", str(folder), "--by", "clutter", "--during", "stimulus", "-o", "map")
    assert "map/gaze_map_by_clutter_full_1.svg" in drawn_files(tmp_path)
    report = next(folder.rglob("report.html")).read_text("utf-8")
    assert "Time to the first look at key" in report

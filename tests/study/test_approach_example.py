"""The ready study of people who walk up goes from plan to report, and on after a kill."""

import pandas as pd
import pytest

from tests.study.simulated_study import killed_and_analysed


@pytest.mark.timeout(600)
def test_the_ready_approach_goes_from_plan_to_report_and_on_after_a_kill(tmp_path, monkeypatch):
    folder = killed_and_analysed("approach", monkeypatch, tmp_path, shows="directed")
    rows = pd.read_csv(folder / "derived" / "trials.csv")
    rows = rows[(rows["status"] == "complete") & ~rows["is_practice"]]
    assert {8} == set(rows.groupby(["participant", "eyes"]).size())
    assert {"trigger"} == set(rows["stop"])
    assert rows["stop_distance_m"].between(0.3, 2.0).all()
    means = rows.groupby("eyes")["stop_distance_m"].mean()
    assert 0.25 == pytest.approx(means["directed"] - means["averted"], abs=0.12)  # as planted
    (finding,) = (
        pd.read_csv(folder / "derived" / "statistics.csv").query("claim == claim").itertuples()
    )
    assert "stop_distance_m" == finding.measure
    assert "directed" in finding.sentence
    report = next(folder.rglob("report.html")).read_text("utf-8")
    assert "Distance to the person at stop" in report

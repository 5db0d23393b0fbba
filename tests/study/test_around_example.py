"""The ready panorama goes from plan to report, and on after a kill: by the head, and by keys."""

import pandas as pd
import pytest

from tests.study.simulated_study import killed_and_analysed


@pytest.mark.timeout(1200)
@pytest.mark.parametrize(
    ("display", "participants"), [((), 6), (("--screen",), 4)], ids=["headset", "screen"]
)
def test_the_ready_panorama_goes_from_plan_to_report_and_on_after_a_kill(
    tmp_path, monkeypatch, display, participants
):
    folder = killed_and_analysed(
        "around", monkeypatch, tmp_path, *display, shows="aside", participants=participants
    )
    rows = pd.read_csv(folder / "derived" / "trials.csv")
    rows = rows[rows["status"] == "complete"]
    assert {2} == set(rows.groupby(["participant", "hangs"]).size())
    assert rows["view_range_deg"].between(10, 360).all()
    dwell_ms = rows[[f"{name}_dwell_ms" for name in ("painting", "window", "door", "shelf")]]
    assert (dwell_ms.sum() > 0).all()
    assert (dwell_ms.sum(axis=1) <= 6_010).all()
    found = rows["painting_first_look_ms"].notna().groupby(rows["hangs"]).sum()
    assert found["aside"] >= found["behind"]
    findings = pd.read_csv(folder / "derived" / "statistics.csv")
    assert {"painting_first_look_ms", "view_range_deg"} <= set(findings["measure"])
    report = next(folder.rglob("report.html")).read_text("utf-8")
    assert "Width of the panorama that was straight ahead" in report

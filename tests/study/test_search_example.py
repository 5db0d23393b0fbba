"""The ready visual search goes from plan to report, and on after a kill."""

from dataclasses import replace

import pandas as pd
import pytest
from typer.testing import CliRunner

import visavis.running.sessions.simulation
from visavis.cli.main import app
from visavis.recording.manifest import read_manifest
from visavis.running.sessions.session_request import simulated_request


def killed_once(study, *words, **keywords):
    """Return a request that ends in the middle of one person's session."""
    request = simulated_request(study, *words, **keywords)

    def on_trial(_, count, __):
        if count == 3:
            raise KeyboardInterrupt

    return replace(request, on_trial=on_trial) if keywords["label"] == "S02C" else request


def invoked(*words):
    """Return what a command prints."""
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == 0, result.output
    return result.output


def drawn_files(folder):
    """Return the files below a folder, by their names from there."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*.svg")}


@pytest.mark.timeout(600)
def test_the_ready_search_goes_from_plan_to_report_and_on_after_a_kill(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    invoked("init", "--screen")
    invoked("examples")
    study = "examples/search.py"
    assert "full_1" in invoked("plan", study)
    words = ["simulate", study, "--participants", "6", "--output", "out", "--processes=1"]
    with monkeypatch.context() as patch:
        patch.setattr(visavis.running.sessions.simulation, "simulated_request", killed_once)
        stopped = CliRunner().invoke(app, words)
    assert stopped.exception is not None
    assert "1 were interrupted; their rest is simulated" in invoked(*words)
    folder = tmp_path / "out" / "simulated" / "search"
    assert 2 == len(read_manifest(folder / "sub-S02C" / "ses-001").parts)
    invoked("analyse", str(folder))
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
    assert "map/gaze_map_by_clutter.svg" in drawn_files(tmp_path)
    report = next(folder.rglob("report.html")).read_text("utf-8")
    assert "Time to the first look at key" in report

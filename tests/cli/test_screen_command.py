"""`visavis run` records a person before a monitor, whose head is tracked by the eye tracker.

What it recorded, an amplifier's LSL stream with it, goes on to check, report and BIDS.
"""

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.cli.screen_command_child import EEG_HZ, MARKS, SWAY_M
from tests.recording.test_export import issues_of
from visavis.cli.app import app
from visavis.recording.reader import Recording

ROOT = Path(__file__).parents[2]
"""A minute: a session in real time, with everything but the person real."""


def operate(terminal, done):
    """Press space at the operator's terminal, and read what it shows, until the session ends."""
    os.set_blocking(terminal, False)
    while not done.wait(0.5):
        os.write(terminal, b" ")
        try:
            while os.read(terminal, 65536):
                pass
        except (BlockingIOError, OSError):
            continue


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """What the command recorded."""
    for program in ("xvfb-run", "xdotool"):
        if shutil.which(program) is None:
            pytest.skip(f"needs a virtual screen and real keys: apt install xvfb {program}")
    pty = pytest.importorskip("pty", reason="a terminal of POSIX")
    folder = tmp_path_factory.mktemp("command")
    ours, theirs = pty.openpty()
    done = threading.Event()
    operator = threading.Thread(target=operate, args=(ours, done))
    operator.start()
    try:
        command = ["xvfb-run", "-a", "-s", "-screen 0 640x360x24", sys.executable]
        ended = subprocess.run(
            [*command, "-m", "tests.cli.screen_command_child", str(folder)],
            stdin=theirs,
            capture_output=True,
            text=True,
            timeout=280,
            cwd=ROOT,
            check=False,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
    finally:
        done.set()
        operator.join()
        os.close(ours)
        os.close(theirs)
    if "OpenGL 3.3" in ended.stderr or "no window" in ended.stderr:
        pytest.skip(ended.stderr.strip().splitlines()[-1])
    assert ended.returncode == 0, ended.stdout[-3000:] + ended.stderr[-3000:]
    (session,) = (folder / "data" / "real" / "pair").glob("sub-*/ses-001")
    return Recording(session)


def test_the_command_records_a_real_session_of_a_screen_a_gazepoint_and_keys(ran):
    assert not ran.is_simulated
    assert ran.status == "complete"
    assert {d["role"]: (d["driver"], d["is_simulated"]) for d in ran.manifest.devices} == {
        "screen": ("screen", False),
        "eye_tracker": ("gazepoint", False),
        "responses": ("keyboard", False),
        "eeg": ("lsl_stream", False),
    }
    assert ran.verify().problems == ()
    trials = ran.trials()
    finished = trials[trials["status"] == "complete"]  # a busy computer may break one off
    assert len(finished) == 2
    assert (finished[["seen_by", "realism_by", "nearer_by"]] == "keys").all().all()


def test_trials_are_marked_in_the_eye_trackers_own_record(ran):
    marks = json.loads((ran.path.parents[4] / MARKS).read_text("utf-8"))
    edges = [mark.split()[:3] for mark in marks if mark.startswith(("trial_start", "trial_end"))]
    trials = ran.trials()[["trial_id", "attempt"]].astype(str).to_numpy().tolist()
    assert [[edge, *trial] for trial in trials for edge in ("trial_start", "trial_end")] == edges


def test_the_head_is_where_the_tracker_finds_the_eyes(ran):
    head = ran.stream_arrays("head")
    at_m = head["position_m"][head["valid"]] - np.array([0.0, 1.2, 0.0])
    assert head["valid"].mean() > 0.9
    spread = at_m.max(axis=0) - at_m.min(axis=0)
    assert (spread > np.array(SWAY_M)).all()  # from one side to beyond the middle
    line = np.array(SWAY_M) / np.linalg.norm(SWAY_M)
    aside = at_m - (at_m @ line)[:, None] * line
    assert np.abs(aside).max() < 1e-4


def test_gaze_meets_the_marks_from_wherever_the_head_is(ran):
    found = ran.events()
    payloads = found.loc[found["name"] == "validation", "payload"]
    errors_deg = [
        row["accuracy_deg"]
        for payload in payloads
        for row in payload["points"]
        if row["eye"] == "combined" and row["accuracy_deg"] is not None
    ]
    assert len(errors_deg) >= 9
    assert np.median(errors_deg) < 0.2


def test_pictures_are_drawn_for_where_the_eyes_are(ran):
    views = ran.stream_arrays("drawn_views")
    assert len(views["t_host_ns"]) > 20
    assert ran.manifest.configuration["screen"]["head"] == "tracked"


def test_what_frames_cost_is_told_by_whatever_drew_them(ran):
    cost, drawn = ran.stream_arrays("drawn_gpu"), ran.stream_arrays("drawn")
    assert len(cost["frame"]) > 0.5 * drawn["drawn"].sum()
    assert set(cost["frame"].tolist()) <= set(drawn["frame"].tolist())
    assert (np.diff(cost["frame"]) > 0).all()
    assert (cost["gpu_ms"] > 0.0).all()


# ---- the amplifier's stream -----------------------------------------------------------------


def said(ran, *arguments, codes=(0,)):
    """What a command says in the lab's folder."""
    with contextlib.chdir(ran.path.parents[4]):
        done = CliRunner().invoke(app, arguments)
    assert done.exit_code in codes, f"{done.output}\n{done.exception!r}"
    return done.stdout


def test_eeg_that_lsls_own_library_sent_is_recorded_with_its_clock(ran):
    eeg, schema = ran.stream_arrays("eeg"), ran.stream_schema("eeg")
    assert [(f.name, f.unit) for f in schema.fields] == [
        (label, "uV") for label in ("fz", "cz", "pz", "oz")
    ]
    assert len(eeg["fz"]) > 10 * EEG_HZ
    steps_ns = np.diff(eeg["t_device_ns"])
    np.testing.assert_allclose(steps_ns, 1e9 / EEG_HZ, rtol=0, atol=2)  # none lost, as stamped
    turns = 2 * np.pi * 10 * (eeg["t_device_ns"] - eeg["t_device_ns"][0]) / 1e9
    wave = np.column_stack((np.sin(turns), np.cos(turns)))
    fit, *_ = np.linalg.lstsq(wave, eeg["fz"].astype(float), rcond=None)
    assert np.hypot(*fit) == pytest.approx(20.0, abs=0.01)
    exchanges = ran.events().loc[lambda e: e["name"] == "clock_exchanges", "payload"]
    assert sum(p["role"] == "eeg" for p in exchanges) > 0


def test_check_and_report_show_it(ran):
    told = said(ran, "check", str(ran.path), codes=(0, 5))  # 5: a busy computer missed frames
    assert re.search(r"eeg +\d+ +\d+ +12[78]\.\d Hz", told)
    said(ran, "analyse", str(ran.path.parents[1]))
    page = (ran.path.parents[1] / "derived" / "report.html").read_text("utf-8")
    assert re.search(rf"eeg of {ran.manifest.participant}", page)


def test_bids_has_it_and_is_valid(ran, tmp_path):
    said(ran, "export", str(ran.path), "--format", "bids", "-o", str(tmp_path), "--keep-label")
    (side,) = tmp_path.rglob("*_recording-eeg_physio.json")
    notes = json.loads(side.read_text("utf-8"))
    assert notes["SamplingFrequency"] == pytest.approx(EEG_HZ, rel=0.01)
    assert notes["fz"]["Units"] == "uV"
    assert [issue for issue in issues_of(tmp_path) if issue.startswith("error")] == []

"""`visavis run` records a person before a monitor, whose head is tracked by the eye tracker."""

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from recording.reader import Recording
from tests.visavis.screen_command_child import SWAY_M

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow
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
            [*command, "-m", "tests.visavis.screen_command_child", str(folder)],
            stdin=theirs, capture_output=True, text=True, timeout=280, cwd=ROOT, check=False,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
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
    }
    assert ran.verify().problems == ()
    trials = ran.trials()
    finished = trials[trials["status"] == "complete"]  # a busy computer may break one off
    assert len(finished) == 2
    assert (finished[["seen_by", "realism_by", "nearer_by"]] == "keys").all().all()


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

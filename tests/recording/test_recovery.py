import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from tests.recording.sessions import (
    new_recorder,
    probe_manifest,
    record_session,
    record_trials,
)
from visavis.lab.clock import SimClock
from visavis.lab.errors import UsageError
from visavis.recording.folder import create_session, open_session
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover


def killed_session(root: Path, mode: str, delay_s: float) -> tuple[Path, int]:
    """Kill a recording process some time after its first trial; return path and acknowledged."""
    child = subprocess.Popen(
        [sys.executable, "-m", "tests.recording.killed_child", str(root), mode],
        stdout=subprocess.PIPE,
    )
    assert child.stdout is not None
    first = child.stdout.readline()
    timer = threading.Timer(delay_s, child.kill)
    timer.start()
    rest = child.stdout.read()
    child.stdout.close()
    timer.join()
    assert child.wait() == -9
    acknowledged = (first + rest).count(b"\n")
    return root / "simulated" / "probe" / "sub-P01" / "ses-001", acknowledged


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is a POSIX signal")
@pytest.mark.parametrize("mode", ["inline", "threaded"])
@pytest.mark.parametrize("delay_ms", [0, 3, 17, 42, 90])
def test_no_acknowledged_trial_is_lost_by_a_kill(tmp_path: Path, mode: str, delay_ms: int) -> None:
    path, acknowledged = killed_session(tmp_path, mode, delay_ms / 1000)
    assert acknowledged > 0
    recording = Recording(path)
    assert "crashed" == recording.status
    trials = recording.trials()["trial_id"].tolist()
    assert list(range(len(trials))) == trials
    assert acknowledged <= len(trials) <= acknowledged + 1
    seq = recording.stream_arrays("probe")["seq"]
    assert np.array_equal(np.arange(len(seq)), seq)
    assert len(seq) >= 60 * len(trials)
    report = recover(path)
    assert report.changed
    assert len(trials) == report.trials
    folder, again = open_session(path)
    folder.close()
    assert not again.changed


def test_recovery_marks_the_part_and_leaves_raw_files(tmp_path: Path) -> None:
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        recorder = new_recorder(folder, clock)
        record_trials(recorder, clock, range(2))
        path = folder.path
    stream = path / "part-01" / "probe.arrows"
    with stream.open("ab") as file:
        file.write(b"\xff\xff\xff\xff torn")
    before = stream.read_bytes()
    report = recover(path)
    assert "are not a whole batch" in report.parts[0].streams[0].problems[0]
    assert 300 == report.parts[0].streams[0].rows
    assert before == stream.read_bytes()
    part = Recording(path).manifest.parts[0]
    assert ("crashed", 300, len(before)) == (
        part.status,
        part.streams[0].rows,
        part.streams[0].bytes,
    )
    assert "without closing" in part.reason
    assert not recover(path).changed
    recorder.close("aborted")


def test_part_whose_folder_was_never_made_is_marked_crashed(tmp_path: Path) -> None:
    with create_session(tmp_path, probe_manifest()) as folder:
        (folder.begin_part(SimClock())).rmdir()
        path = folder.path
    assert "crashed" == recover(path).parts[0].status
    assert 0 == len(Recording(path).trials())
    assert "crashed" == Recording(path).status


def test_complete_session_needs_no_recovery(tmp_path: Path) -> None:
    path = record_session(tmp_path)
    before = (path / "manifest.json").read_bytes()
    assert not recover(path).changed
    assert before == (path / "manifest.json").read_bytes()


def test_session_in_use_is_not_recovered(tmp_path: Path) -> None:
    with (
        create_session(tmp_path, probe_manifest()) as folder,
        pytest.raises(UsageError, match="in use"),
    ):
        recover(folder.path)

"""Calibrating within a session: frames go on while the tracker works out its verdict."""

from pathlib import Path

from tests.faults.sessions import lab, perform


def test_no_frame_is_missed_while_a_calibration_is_worked_out(tmp_path: Path) -> None:
    recording = perform(lab(tmp_path))

    assert "calibration" in set(recording.events()["name"])
    assert 0 == recording.stream_arrays("frames")["dropped"].sum()

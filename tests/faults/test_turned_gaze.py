"""A calibration that turns gaze over stops the session before a trial is lost to it."""

from pathlib import Path

import pytest

from tests.faults.sessions import events, lab, path_of, perform
from visavis.devices.drivers.pupil import codec
from visavis.lab.errors import DeviceError
from visavis.protocol.session.session import MAX_CALIBRATIONS
from visavis.recording.reader import Recording


def test_a_session_whose_gaze_is_turned_over_stops_and_names_the_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = codec.encode_reference

    def y_down(direction_head, device_ns, distance_m):  # type: ignore[no-untyped-def]
        sent = right(direction_head, device_ns, distance_m)
        sent["mm_pos"][1] *= -1
        return sent

    monkeypatch.setattr(codec, "encode_reference", y_down)
    config = lab(tmp_path)

    with pytest.raises(
        DeviceError, match=r"eye_tracker: .*rotated by 18.° about the line of sight"
    ):
        perform(config)

    recording = Recording(path_of(config))
    assert not len(recording.trials())
    assert [e["succeeded"] for e in events(recording, "calibration")] == [True] * MAX_CALIBRATIONS
    assert all("rotated" in e["reason"] for e in events(recording, "validation"))

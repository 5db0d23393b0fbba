"""Sessions before a screen are the same whether frames pass together or one by one."""

from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import pytest

import visavis.devices.pump
from tests.study.simulated_study import invoked, quick_targets
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.recording.reader import Recording
from visavis.running.sessions.study_folder import sessions_of

STUDY = """
from visavis import Factor, Keys, Study, Text

study = Study("shades", factors=[Factor("ink", ["red", "green"])], repetitions=2)


@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.3)
    keys = Keys("r", "g", right=t.ink[0])
    yield t.show(Text("ink", colour=t.ink, height_deg=2), until=keys, limit_s=1.5)
"""


@runtime_checkable
class Nobody(Protocol):
    def a_method_no_device_has(self) -> None: ...


def _session(folder: Path, tracker: str) -> Recording:
    folder.mkdir()
    lab = SCREEN_EXAMPLE.read_text("utf-8").replace("driver: gazepoint", f"driver: {tracker}")
    if tracker != "gazepoint":
        left_out = ("address:", "port:", "camera_up_mm:")
        lab = "\n".join(x for x in lab.splitlines() if not x.strip().startswith(left_out))
    (folder / "lab_config.yaml").write_text(lab, "utf-8")
    (folder / "shades.py").write_text(STUDY, "utf-8")
    words = ["simulate", str(folder / "shades.py"), "--participants=1", "--processes=1"]
    with quick_targets():
        invoked(*words, "--output", str(folder), "--config", str(folder / "lab_config.yaml"))
    (session,) = sessions_of(folder / "simulated" / "shades")
    return Recording(session)


@pytest.mark.slow
@pytest.mark.parametrize("tracker", ["gazepoint", "tobii_lsl", "hid_gaze"])
def test_a_session_before_a_screen_is_the_same_frame_by_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tracker: str
) -> None:
    counts = []
    begin_frame = FrameLoop._begin_frame

    def count_frame(loop: FrameLoop) -> object:
        counts[-1] += 1
        return begin_frame(loop)

    monkeypatch.setattr(FrameLoop, "_begin_frame", count_frame)
    counts.append(0)
    together = _session(tmp_path / "together", tracker)
    monkeypatch.setattr(visavis.devices.pump, "Foreseeing", Nobody)
    monkeypatch.setattr(visavis.devices.pump, "Postponing", Nobody)
    counts.append(0)
    one_by_one = _session(tmp_path / "one_by_one", tracker)

    assert counts[1] == len(one_by_one.stream_arrays("frames")["t_host_ns"])
    assert counts[0] < counts[1] / 2
    assert together.stream_names == one_by_one.stream_names
    for name in together.stream_names:
        one, other = together.stream_arrays(name), one_by_one.stream_arrays(name)
        for column in one:
            is_float = one[column].dtype.kind == "f"
            same = np.array_equal(one[column], other[column], equal_nan=is_float)
            assert same, (name, column)
    assert together.trials().equals(one_by_one.trials())

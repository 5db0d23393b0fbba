"""A session streams to LSL what it records, where the lab's `sync` says so."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.devices.band_makers import simulated_armband
from tests.devices.test_lsl_outlet import FakeLsl
from tests.faults.sessions import lab, request
from visavis.cli.lab_companion import LabCompanion
from visavis.cli.lsl_announcer import AnnouncingRecorder, scope_of
from visavis.devices.drivers.lsl.outlet import LslScope
from visavis.lab.clock import SystemClock
from visavis.lab.config import Sync
from visavis.lab.errors import DeviceNotFound, SessionAborted
from visavis.protocol.session.operator import Command, UnattendedOperator
from visavis.protocol.session.rig import _of_band
from visavis.running.sessions.perform import perform_new

FRAMES = 12


class Stopping(UnattendedOperator):
    """End the session after some frames."""

    def __init__(self) -> None:
        super().__init__()
        self._left = FRAMES

    def poll(self) -> tuple[Command, ...]:
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt
        return tuple(super().poll())


class NamedLsl(FakeLsl):
    """Keep the configuration and the names, types and sources announced."""

    def __init__(self, clock: Any) -> None:
        super().__init__(clock)
        self.announced: list[tuple[Any, ...]] = []

    def StreamInfo(self, name: str, *args: Any) -> Any:  # noqa: N802 - the library's name
        self.announced.append((name, *args))
        return super().StreamInfo(name, *args)


def test_session_streams_gaze_head_and_events(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SystemClock()
    lsl = NamedLsl(clock)
    monkeypatch.setattr("visavis.cli.lab_companion.set_scope", lambda scope: None)
    monkeypatch.setattr("visavis.devices.drivers.lsl.outlet.lsl_library", lambda: lsl)
    config = lab(tmp_path).model_copy(update={"sync": Sync(lsl=True)})
    with pytest.raises(SessionAborted):
        perform_new(replace(request(config, Stopping()), clock=clock, companion=LabCompanion()))
    names = {name for name, *_ in lsl.pushed}
    assert {
        "visavis headset head",
        "visavis headset head_measured",
        "visavis headset frame_timing",
        "visavis eye_tracker gaze",
        "visavis responses responses",
        "visavis events",
    } == {name for name, *_ in lsl.announced}
    assert {"visavis headset head", "visavis eye_tracker gaze", "visavis events"} <= names
    told = [json.loads(row[0])["event"] for name, row, _ in lsl.pushed if name == "visavis events"]
    assert "session_start" in told
    assert not hasattr(lsl, "text")  # the session that LabRecorder looks in stays
    assert all("stare-S01-001" in source for *_, source in lsl.announced)


def test_bands_are_announced_under_their_own_streams(tmp_path: Path) -> None:
    clock = SystemClock()
    band = simulated_armband("armband_left", clock)
    band.open(1.0)
    lsl = NamedLsl(clock)
    with AnnouncingRecorder(tmp_path, clock, is_simulated=True) as recorder:
        for schema in band.describe():
            recorder.declare(_of_band("armband_left", schema))
        recorder.announce(
            {"armband_left": band}, LslScope("s"), source="x", is_simulated=True, lsl=lsl
        )
        recorder.event("note", 0, name="told", text="a")
    band.close()
    assert "visavis armband_left haptics_armband_left" in {name for name, *_ in lsl.announced}
    assert json.loads(lsl.pushed[-1][1][0]) == {"event": "note", "name_": "told", "text": "a"}


def test_streams_are_in_lsls_own_session_unless_the_lab_names_another() -> None:
    assert scope_of(Sync()) == LslScope("")
    given = Sync(lsl=True, session_id="floor-2", this_computer_only=True)
    assert scope_of(given) == LslScope("floor-2", machine_only=True)


def test_missing_library_stops_the_session_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    config = lab(tmp_path).model_copy(update={"sync": Sync(lsl=True)})
    with pytest.raises(DeviceNotFound, match="visavis\\[lsl\\]"):
        perform_new(
            replace(request(config, Stopping()), clock=SystemClock(), companion=LabCompanion())
        )


def test_virtual_time_is_never_streamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    config = lab(tmp_path).model_copy(update={"sync": Sync(lsl=True)})
    with pytest.raises(SessionAborted):
        perform_new(request(config, Stopping()))

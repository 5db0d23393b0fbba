"""However a walk that vibrates is left, no motor runs afterwards: read at the simulated bands."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import devices.sim.armband.simulator
from devices.sim.armband.simulator import ArmbandSimulator
from experiments.crowd.haptics import BAND_ROLES
from lab.errors import SessionAborted
from protocol.operator import Action, Command
from protocol.states import SessionState
from recording.reader import Recording
from tests.experiments.crowd.sessions import request
from tests.faults.sessions import ScriptedOperator
from visavis.sessions.perform import perform_new

HAPTIC_WALK = (SessionState.TRIAL, 3)
IN_THE_MIDST = 700
"""Frames after the walk's begin: contacts come and go by then."""
PATTERN, SILENCE = 1, 2


class Failing(ScriptedOperator):
    """Raise in the midst of the walk that vibrates."""

    error: BaseException = ZeroDivisionError()

    def poll(self) -> Any:
        if self.trail and self.trail[-1] is HAPTIC_WALK[0] and self._frames >= IN_THE_MIDST:
            if self._reached[HAPTIC_WALK[0]] == HAPTIC_WALK[1]:
                raise self.error
        return super().poll()


class Interrupted(Failing):
    error = KeyboardInterrupt()


@pytest.fixture
def bands(monkeypatch: pytest.MonkeyPatch) -> dict[str, ArmbandSimulator]:
    worn: dict[str, ArmbandSimulator] = {}
    made = ArmbandSimulator.__init__

    def make(self: ArmbandSimulator, role: str, *args: Any, **settings: Any) -> None:
        made(self, role, *args, **settings)
        worn[role] = self

    monkeypatch.setattr(devices.sim.armband.simulator.ArmbandSimulator, "__init__", make)
    return worn


def perform(folder: Path, operator: ScriptedOperator, **lab: Any) -> Recording:
    wanted = replace(request(folder, limit_s=12.0, **lab), operator=operator)
    return Recording(perform_new(wanted))


def recorded(folder: Path) -> Recording:
    (path,) = folder.glob("simulated/crowd/sub-*/ses-001")
    return Recording(path)


def assert_ran_and_are_silent(bands: dict[str, ArmbandSimulator]) -> None:
    assert set(BAND_ROLES) == set(bands)
    assert any(any(duties) for band in bands.values() for _, duties in band.duty_log)
    for role, band in bands.items():
        band.advance(band._at_ns + 50_000_000)
        assert not any(band.firmware.duties), role


@pytest.mark.parametrize(
    ("operator", "error"),
    [
        (ScriptedOperator((*HAPTIC_WALK, IN_THE_MIDST, Command(Action.ABORT))), SessionAborted),
        (Failing(), ZeroDivisionError),
        (Interrupted(), SessionAborted),
    ],
    ids=["operator ends it", "a defect", "from the keyboard"],
)
def test_a_session_left_in_the_midst_of_a_vibration_leaves_every_band_silent(
    operator: ScriptedOperator,
    error: type[BaseException],
    tmp_path: Path,
    bands: dict[str, ArmbandSimulator],
) -> None:
    with pytest.raises(error):
        perform(tmp_path, operator)
    assert_ran_and_are_silent(bands)
    assert recorded(tmp_path).status == "aborted"


def test_a_walk_that_is_skipped_leaves_every_band_silent(
    tmp_path: Path, bands: dict[str, ArmbandSimulator]
) -> None:
    skip = Command(Action.SKIP, "dizzy")
    recording = perform(tmp_path, ScriptedOperator((*HAPTIC_WALK, IN_THE_MIDST, skip)))
    row = recording.trials().set_index("trial_id").loc["T02"]
    assert "skipped" == row["status"]
    for role in BAND_ROLES:
        after = _kinds(recording, role, row["t_end_ns"], 2**62)
        assert PATTERN not in after
    assert_ran_and_are_silent(bands)


def test_silence_by_the_operator_lasts_to_the_end_of_the_walk_and_is_flagged(
    tmp_path: Path, bands: dict[str, ArmbandSimulator]
) -> None:
    operator = ScriptedOperator((*HAPTIC_WALK, IN_THE_MIDST, Command(Action.SILENCE)))
    recording = perform(tmp_path, operator)
    row = recording.trials().set_index("trial_id").loc["T02"]
    events = recording.events()
    (pressed,) = events[events["payload"].map(lambda p: p.get("action") == "silence")]["t_ns"]
    assert row["t_start_ns"] < pressed < row["t_end_ns"]
    kinds = np.concatenate([_kinds(recording, r, row["t_start_ns"], pressed) for r in BAND_ROLES])
    assert PATTERN in kinds
    begun = events[(events["name"] == "contact_begin") & (events["t_ns"] > pressed)]
    assert any(p["trial_id"] == "T02" for p in begun["payload"])  # contacts go on
    for role in BAND_ROLES:
        assert PATTERN not in _kinds(recording, role, pressed + 1, 2**62)
    assert "silenced_by_operator" in row["flags"]
    assert any("to the end of T02" in message for message in operator.messages)
    assert_ran_and_are_silent(bands)


def _kinds(recording: Recording, role: str, since_ns: int, until_ns: int) -> Any:
    rows = recording.stream_arrays(f"haptics_{role}")
    asked = rows["t_commanded_ns"]
    return rows["kind"][(asked >= since_ns) & (asked < until_ns)]

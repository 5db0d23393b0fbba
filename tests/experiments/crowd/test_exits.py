"""However a walk that vibrates is left, no motor runs afterwards: read at the simulated bands."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import visavis.devices.sim.armband.simulator
from tests.experiments.crowd.sessions import request
from tests.faults.sessions import ScriptedOperator, events
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.experiments.crowd.haptics import BAND_ROLES
from visavis.lab.errors import SessionAborted
from visavis.protocol.session.operator import Action, Command
from visavis.protocol.session.states import SessionState
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new

HAPTIC_WALK = (SessionState.TRIAL, 3)
IN_THE_MIDST = 700
"""Frames after the walk's begin: contacts come and go by then."""
PATTERN, SILENCE = 1, 2
ARM_M = 1.3
"""No arm reaches whom it touches from farther, sway and all."""


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

    monkeypatch.setattr(visavis.devices.sim.armband.simulator.ArmbandSimulator, "__init__", make)
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
    told = recording.events()
    (pressed,) = told[told["payload"].map(lambda p: p.get("action") == "silence")]["t_ns"]
    assert row["t_start_ns"] < pressed < row["t_end_ns"]
    kinds = np.concatenate([_kinds(recording, r, row["t_start_ns"], pressed) for r in BAND_ROLES])
    assert PATTERN in kinds
    begun = told[(told["name"] == "contact_begin") & (told["t_ns"] > pressed)]
    assert any(p["trial_id"] == "T02" for p in begun["payload"])  # contacts go on
    for role in BAND_ROLES:
        assert PATTERN not in _kinds(recording, role, pressed + 1, 2**62)
    assert "silenced_by_operator" in row["flags"]
    assert any("to the end of T02" in message for message in operator.messages)
    assert_ran_and_are_silent(bands)


def test_the_operator_is_shown_each_contact_while_it_lasts(tmp_path: Path) -> None:
    skips = [(SessionState.TRIAL, n, 1, Command(Action.SKIP, "not needed")) for n in (1, 2, 4)]
    operator = ScriptedOperator(*skips)
    recording = perform(tmp_path, operator)
    begun = [e["trial_id"] for e in events(recording, "contact_begin")]
    walks = {s.trial_id: s for s in operator.seen if s.contacts_begun}
    assert {name: begun.count(name) for name in walks} == {
        name: last.contacts_begun for name, last in walks.items()
    }
    touching = [s for s in operator.seen if s.contacts]
    assert {"T02"} == {s.trial_id for s in touching if any(c.vibrates for c in s.contacts)}
    for status in touching:
        assert status.scene_frame is not None
        assert status.frame is not None
        head_m = status.frame.head.position_m[[0, 2]]
        stand_m = status.scene_frame.scene.stand_m[[c.person for c in status.contacts]]
        assert (np.linalg.norm(stand_m - head_m, axis=1) < ARM_M).all()
    assert not operator.seen[-1].contacts


def _kinds(recording: Recording, role: str, since_ns: int, until_ns: int) -> Any:
    rows = recording.stream_arrays(f"haptics_{role}")
    asked = rows["t_commanded_ns"]
    return rows["kind"][(asked >= since_ns) & (asked < until_ns)]

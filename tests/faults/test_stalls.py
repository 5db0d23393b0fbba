from dataclasses import replace
from pathlib import Path

import pytest

from tests.faults.sessions import ScriptedOperator, events, lab, request, trial_table
from visavis.lab.clock import NS_PER_S, Clock
from visavis.protocol.session.operator import Command
from visavis.protocol.session.operator_desk import StallWatch
from visavis.protocol.session.states import SessionState
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new


class StalledComputer(ScriptedOperator):
    """Let the computer stand still once, in a state reached so often, after some frames."""

    def __init__(self, state: SessionState, times: int, frames: int, stall_s: float) -> None:
        super().__init__()
        self._where = (state, times, frames)
        self._stall_ns = int(stall_s * NS_PER_S)
        self.clock: Clock | None = None

    def poll(self) -> list[Command]:
        state, times, frames = self._where
        here = self.trail and self.trail[-1] is state and self._reached[state] == times
        if here and self._frames == frames and self.clock is not None:
            self.clock.sleep_until_ns(self.clock.now_ns() + self._stall_ns)
        return list(super().poll())


def stalled(data_root: Path, computer: StalledComputer) -> Recording:
    made = request(lab(data_root), computer, trial_s=1.0)
    computer.clock = made.clock
    return Recording(perform_new(replace(made, operator=computer)))


def flags_of(recording: Recording) -> dict[str, str]:
    rows = trial_table(recording)
    return {t: f for t, f in zip(rows["trial_id"], rows["flags"], strict=True) if f}


def test_a_trial_in_which_the_picture_stood_still_is_flagged(tmp_path: Path) -> None:
    recording = stalled(tmp_path, StalledComputer(SessionState.TRIAL, 3, 8, 0.5))

    assert {"complete"} == set(recording.trials()["status"])
    assert {"T02": "picture_stalled"} == flags_of(recording)
    (told,) = events(recording, "picture_stalled")
    assert 500 == pytest.approx(told["stood_ms"], abs=40)


def test_a_picture_that_stood_as_long_as_a_lost_device_interrupts(tmp_path: Path) -> None:
    recording = stalled(tmp_path, StalledComputer(SessionState.TRIAL, 3, 8, 8.0))

    rows = trial_table(recording)
    assert ["interrupted", "complete"] == list(rows.loc["T02", "status"])
    assert "the picture stood still for 8.0 s" == rows.loc[("T02", 1), "reason"]
    assert "" == rows.loc[("T02", 2), "flags"]


@pytest.mark.parametrize("state", [SessionState.INTERTRIAL, SessionState.VALIDATING])
def test_a_pause_of_the_computer_between_trials_flags_none(
    tmp_path: Path, state: SessionState
) -> None:
    recording = stalled(tmp_path, StalledComputer(state, 2, 4, 1.0))

    assert {} == {t: f for t, f in flags_of(recording).items() if "picture" in f}
    assert "complete" == recording.status


def test_what_was_asked_for_is_no_stall() -> None:
    watch = StallWatch()
    assert [0, 0, 300_000_000] == [watch.stood_ns(t) for t in (10**9, 1_010_000_000, 1_310_000_000)]
    watch.allow(2)
    assert [0, 0, 10**9] == [watch.stood_ns(t * 10**9) for t in (3, 5, 6)]

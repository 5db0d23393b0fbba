"""However a session ends, its devices are closed while the stage still holds its graphics."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.faults.sessions import lab, request
from visavis.devices.sim.body.headset import SimulatedHeadset
from visavis.devices.sim.body.responses import SimulatedResponses
from visavis.lab.errors import DeviceError, RecordingError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.protocol.session.operator import Action, Command, UnattendedOperator
from visavis.running.sessions.perform import perform_new
from visavis.stage.contracts import GeometryStage
from visavis.stimuli.scene import SceneFrame


class Ending(UnattendedOperator):
    """Does something at the given frame."""

    def __init__(self, frame: int, end: Callable[[], Sequence[Command]]) -> None:
        self._left, self._end = frame, end

    def poll(self) -> Sequence[Command]:
        """Wait for the moment."""
        self._left -= 1
        return self._end() if self._left == 0 else ()


def throws(problem: BaseException) -> Callable[[], Any]:
    def end() -> Any:
        raise problem

    return end


FRAME = 90
ENDINGS: dict[str, tuple[Callable[[], Any], type[BaseException]]] = {
    "aborted": (lambda: (Command(Action.ABORT),), Exception),
    "ctrl-c": (throws(KeyboardInterrupt()), BaseException),
    "sigterm": (throws(SystemExit(143)), SystemExit),
    "defect": (throws(ZeroDivisionError()), ZeroDivisionError),
    "disk full": (throws(RecordingError("the disk is full")), RecordingError),
}
PLACES = (*ENDINGS, "drawing", "opening", "to the end")


@pytest.mark.parametrize("ending", PLACES)
def test_devices_are_closed_before_the_stage_and_both_once_however_it_ends(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[str] = []
    close = SimulatedHeadset.close

    class Stage(GeometryStage):
        def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
            if ending == "drawing" and frame.index > FRAME:
                raise ZeroDivisionError
            return super().draw(view, frame, head)

        def close(self) -> None:
            closed.append("stage")

    def close_headset(headset: SimulatedHeadset) -> None:
        closed.append("headset")
        close(headset)

    monkeypatch.setattr(SimulatedHeadset, "close", close_headset)
    if ending == "opening":
        monkeypatch.setattr(
            SimulatedResponses, "open", lambda *_: throws(DeviceError("no buttons"))()
        )
    session_request = replace(request(lab(tmp_path), trial_s=0.5), stage_for=Stage)
    if ending in ENDINGS:
        session_request = replace(session_request, operator=Ending(FRAME, ENDINGS[ending][0]))
    if ending == "to the end":
        perform_new(session_request)
    else:
        with pytest.raises(ENDINGS.get(ending, (None, BaseException))[1]):
            perform_new(session_request)
    assert ["headset", "stage"] == closed

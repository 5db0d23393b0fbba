"""Perform a study's first trials and print what code and files were met for the first time in them.

Run in a process of its own: what was compiled, loaded or imported before cannot be told apart.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from numba.core import event

from tests.faults.sessions import TIMING
from tests.running.test_every_study import on_kit, request_for
from visavis.protocol.plan.steps import FrameView
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.states import SessionState
from visavis.running.sessions.perform import get_ready, perform_new

PERFORMED = (SessionState.INTERTRIAL, SessionState.TRIAL)
TRIALS = 12


class Enough(BaseException):
    """So many trials have been performed."""


class FirstMet(event.Listener):
    """Notes what is compiled, opened or imported while frames of trials follow each other."""

    def __init__(self) -> None:
        self.in_trial = False
        self.met: set[str] = set()

    def on_start(self, event: Any) -> None:
        """Hear that a kernel is compiled."""
        if self.in_trial:
            self.met.add(f"compiled {event.data['dispatcher'].py_func.__qualname__}")

    def on_end(self, event: Any) -> None:
        """Hear that it is done."""

    def audit(self, name: str, arguments: tuple[Any, ...]) -> None:
        """Hear what Python does."""
        if self.in_trial and name in ("open", "import"):
            self.met.add(f"{name} {arguments[0]}")


def main(reference: str, root: Path, *, is_ready: bool) -> None:
    """Perform the trials; print the list of what was met in them."""
    first = FirstMet()
    done = 0

    def on_trial(*_: object) -> None:
        nonlocal done
        first.in_trial = False
        done += 1
        if done == TRIALS:
            raise Enough

    study = on_kit(reference)
    request = request_for(study, reference, root, 0)
    request = replace(request, timing=TIMING, on_trial=on_trial, on="lab")
    if is_ready:
        assert get_ready(study, request.experiment, request.config) == ""
    event.register("numba:compile", first)
    sys.addaudithook(first.audit)
    next_frame = FrameLoop.next

    def heard(loop: FrameLoop, *quiet: Any, **also: Any) -> FrameView:
        first.in_trial = loop._states.state in PERFORMED
        return next_frame(loop, *quiet, **also)

    FrameLoop.next = heard  # type: ignore[method-assign]
    try:
        perform_new(request)
    except Enough:
        pass
    assert done > 0
    sys.stdout.write(json.dumps(sorted(first.met)))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), is_ready=sys.argv[3] == "ready")

"""The contract of a simulated participant: a body that sees, and answers when asked."""

from collections.abc import Mapping, Sequence
from typing import Final, Protocol, runtime_checkable

from visavis.devices.contracts import Body
from visavis.stage.contracts import Viewer


class SimulatedParticipant(Body, Viewer, Protocol):
    """Stand where a human would: look at what the stage shows, move, press, answer.

    It never learns the condition, only what a person would learn. All behaviour after `prepare`
    depends on the seed, the stretch and times relative to that moment, not on what came before,
    so a trial that is performed again gives the same data; the exception is a `Learner`.
    """

    def prepare(self, stretch: int, t_ns: int) -> None:
        """Begin a new stretch of behaviour (a trial, a validation) at this session time."""
        ...

    def wear(self, fit: int) -> None:
        """Put the headset on anew; `fit` numbers how it sits (it changes at every break)."""
        ...

    def look_at(self, target_world_m: Sequence[float] | None, t_ns: int) -> None:
        """Follow the instruction to look at a point (calibration, mark); None ends it."""
        ...

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Answer a question; None when this participant would leave it out."""
        ...


STRETCH_AGAIN: Final = 1_000_000
"""Added to the stretch of a trial for every time that its study has it performed again: people
answer anew then."""


@runtime_checkable
class Learner(Protocol):
    """A simulated participant whom earlier trials have changed.

    What it has learned is recorded with every trial, so that a resumed session goes on with it.
    """

    def memory(self) -> Mapping[str, float]:
        """Return what has been learned so far, by name."""
        ...

    def remember(self, memory: Mapping[str, float]) -> None:
        """Take up what was learned before; to be called ahead of `prepare`."""
        ...


@runtime_checkable
class KeyPresser(Protocol):
    """A simulated participant who can answer boards by keys, where nothing points and no gaze is
    calibrated.
    """

    def answer_by_keys(self, controls: Sequence[str]) -> None:
        """Answer boards with these controls of the response device from now on."""
        ...

    def choose(self, choice: int | None, t_ns: int) -> None:
        """Press the key of a board's choice, counted from 0, after some thought; None leaves the
        question out.
        """
        ...

"""Put codes on lines one after another, each for a fixed time and with a rest between them.

Pure: it takes times and returns the steps to write.
"""

from collections import deque
from dataclasses import dataclass

from visavis.lab.clock import NS_PER_MS


@dataclass(frozen=True)
class Pulse:
    """A code that was asked for at a session time; `number` counts from 0."""

    number: int
    code: int
    t_commanded_ns: int


@dataclass(frozen=True)
class Step:
    """The next change of the lines: the beginning of a pulse, or the end of the present one."""

    pulse: Pulse
    begins: bool


class PulseTrain:
    """Codes in a queue: each is on the lines for `width_ms`, then they rest for `settle_ms`."""

    def __init__(self, width_ms: float, settle_ms: float) -> None:
        self._width_ns = round(width_ms * NS_PER_MS)
        self._settle_ns = round(settle_ms * NS_PER_MS)
        self._waiting: deque[Pulse] = deque()
        self._standing: Pulse | None = None
        self._since_ns = -(2**62)
        self._count = 0

    def ask(self, code: int, t_ns: int) -> int:
        """Add a code to the queue; return its number."""
        pulse = Pulse(self._count, code, t_ns)
        self._waiting.append(pulse)
        self._count += 1
        return pulse.number

    def due_ns(self) -> int | None:
        """Return the time of the next change of the lines; None while the queue is empty."""
        if self._standing is not None:
            return self._since_ns + self._width_ns
        return self._since_ns + self._settle_ns if self._waiting else None

    def step(self, t_ns: int) -> Step | None:
        """Return the step that is due, if any; call `note_written` when it was done."""
        due_ns = self.due_ns()
        if due_ns is None or t_ns < due_ns:
            return None
        if self._standing is not None:
            return Step(self._standing, begins=False)
        return Step(self._waiting[0], begins=True)

    def note_written(self, step: Step, t_ns: int) -> None:
        """Note that a step was written at this time."""
        self._since_ns = t_ns
        if step.begins:
            self._standing = self._waiting.popleft()
        else:
            self._standing = None

    def forget(self) -> tuple[Pulse | None, list[Pulse]]:
        """Drop everything; return the pulse on the lines, and those that never began."""
        active_pulse, never = self._standing, list(self._waiting)
        self._waiting.clear()
        self._standing = None
        return active_pulse, never

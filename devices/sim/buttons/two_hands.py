"""The presses of one body for two devices: one control to the first, all others to the second."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

from visavis.devices.contracts import Hand

Press: TypeAlias = tuple[int, str, float]
"""Session time, control, value from 0 to 1."""


@dataclass(eq=False)
class _Source:
    """A body, asked for no time before the last one, and what its devices have yet to take."""

    body: Hand
    control: str
    last_ns: int = -(2**63)
    waiting: tuple[list[Press], list[Press]] = field(default_factory=lambda: ([], []))

    def fetch(self, until_ns: int) -> None:
        """Take what the body presses up to a session time."""
        self.last_ns = max(self.last_ns, until_ns)
        for press in self.body.presses(self.last_ns):
            self.waiting[press[1] != self.control].append(press)


@dataclass(frozen=True)
class _Part:
    """One device's presses."""

    source: _Source
    place: int

    def presses(self, until_ns: int) -> Iterator[Press]:
        """Yield this device's presses up to a session time."""
        self.source.fetch(until_ns)
        waiting = self.source.waiting[self.place]
        while waiting and waiting[0][0] <= until_ns:
            yield waiting.pop(0)


def part_presses(body: Hand, control: str) -> tuple[Hand, Hand]:
    """Return two hands: what presses `control`, and what presses all others."""
    source = _Source(body, control)
    return _Part(source, 0), _Part(source, 1)

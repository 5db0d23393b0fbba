"""Keep a device's time exchanges, and notice when its clock has jumped between two of them."""

from visavis.devices.contracts import ClockPair
from visavis.lab.clock import NS_PER_MS

JUMP_NS = 20 * NS_PER_MS
RECENT = 60
MAX_KEPT = 4096
"""Limit of pairs; half of them stay when it is reached: half an hour at one a second."""


class ExchangeLog:
    """The latest exchanges since open; one straight line fits the `recent` ones."""

    def __init__(self) -> None:
        self.pairs: list[ClockPair] = []
        self._since_jump = 0

    def __len__(self) -> int:
        return len(self.pairs)

    def clear(self) -> None:
        """Forget all exchanges."""
        self.pairs = []
        self._since_jump = 0

    def add(self, pair: ClockPair) -> float | None:
        """Keep an exchange; return the clock's jump in ms, None if there was none."""
        jump_ms = None
        if self.pairs:
            last = self.pairs[-1]
            moved_ns = abs(_offset(pair) - _offset(last))
            # An offset is uncertain by half its round trip, so a slow exchange alone can move it.
            if moved_ns > JUMP_NS + (_round_trip_ns(pair) + _round_trip_ns(last)) // 2:
                jump_ms = moved_ns / NS_PER_MS
                self._since_jump = len(self.pairs)
        self.pairs.append(pair)
        if len(self.pairs) > MAX_KEPT:
            excess = MAX_KEPT // 2
            self.pairs = self.pairs[
                excess:
            ]  # a new list: another thread may be reading the old one
            self._since_jump = max(0, self._since_jump - excess)
        return jump_ms

    @property
    def recent(self) -> list[ClockPair]:
        """The last exchanges, none from before a jump."""
        return self.pairs[max(self._since_jump, len(self.pairs) - RECENT) :]


def _offset(pair: ClockPair) -> int:
    return (pair.host_send_ns + pair.host_receive_ns) // 2 - pair.device_ns


def _round_trip_ns(pair: ClockPair) -> int:
    return pair.host_receive_ns - pair.host_send_ns

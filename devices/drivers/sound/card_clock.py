"""The clock of a sound card, read again and again beside the session's."""

from collections import deque
from typing import Any, Final

from visavis.devices.contracts import ClockPair
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.clock_fit import latest_quick, offset_ns

PAIRS_APART_NS: Final = NS_PER_S // 4
KEPT_PAIRS: Final = 2000
RECENT_PAIRS: Final = 24


class CardClock:
    """Set times of a PortAudio stream's clock on the session's clock."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.pairs: deque[ClockPair] = deque(maxlen=KEPT_PAIRS)

    def read(self, stream: Any) -> None:
        """Read the stream's clock between two readings of the session's, four times a second."""
        before_ns = self._clock.now_ns()
        card_ns = round(stream.time * NS_PER_S)
        if not self.pairs or before_ns - self.pairs[-1].host_receive_ns >= PAIRS_APART_NS:
            self.pairs.append(ClockPair(before_ns, card_ns, self._clock.now_ns()))

    def offset_ns(self) -> int:
        """Return the session's clock minus the card's, of the last seconds."""
        return offset_ns(latest_quick(tuple(self.pairs)[-RECENT_PAIRS:]))

"""Presses of a simulated body, on the wire of any device with buttons.

Not modelled: contact bounce, the delay of the device. Faults: late_start and disconnect (away),
silence (nothing is sent), burst (held back, all arrive when the window ends), garbage (`amount` is
the share of messages replaced by noise, not drawn from anybody's behaviour).
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from visavis.devices.body_contract import foresees_presses
from visavis.devices.byte_links import Chunk
from visavis.devices.contracts import ForeseeableHand, Hand
from visavis.devices.faults import FaultSchedule
from visavis.lab.clock import NEVER_NS, NS_PER_MS, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound

WIRE_NS = NS_PER_MS
AWAY = "the simulated response device is away"
REMEDY = "look at its cable"
GARBAGE_STREAM = 0x6B


class PressingPeer:
    """The other end of a byte link whose buttons a body presses; a subclass defines the bytes.

    `names` maps a study's name of a button to the device's own name.
    """

    def __init__(
        self,
        body: Hand,
        clock: Clock,
        faults: FaultSchedule | None,
        names: Mapping[str, str],
        *,
        seed: int = 0,
    ) -> None:
        self._body = body
        self._hand: ForeseeableHand | None = None
        if isinstance(body, ForeseeableHand) and foresees_presses(type(body)):
            self._hand = body
        self._origin_ns = clock.now_ns()
        self._faults = faults if faults is not None else FaultSchedule()
        self._names = dict(names)
        self._outbox: list[Chunk] = []
        self._noise = np.random.default_rng([seed, GARBAGE_STREAM])

    @abstractmethod
    def message(self, button: str, value_01: float, t_ns: int) -> bytes:
        """Return the device's bytes for a press or release at a session time."""

    def connect(self, t_ns: int) -> None:
        """Take a new connection; earlier presses are lost."""
        if self._is_away(t_ns):
            raise DeviceNotFound(AWAY, remedy=REMEDY)
        for _ in self._body.presses(t_ns):
            pass
        self._outbox.clear()

    def quiet_until_ns(self, now_ns: int) -> int:
        """Return until when nothing is pressed and nothing arrives; `now_ns` where unknown."""
        if self._hand is None or self._faults.faults:
            return now_ns
        press_ns = self._hand.next_press_ns()
        times_ns = [chunk.t_host_ns for chunk in self._outbox]
        return min(times_ns if press_ns is None else [press_ns, *times_ns], default=NEVER_NS)

    def accept(self, data: bytes, t_ns: int) -> None:
        """Take bytes; most devices with buttons listen to nobody."""

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Return the chunks that have arrived at the host by this time."""
        for t_ns, control, value_01 in self._body.presses(until_ns):
            if self._active("silence", t_ns):
                continue
            data = self.message(self._names.get(control, control), value_01, t_ns)
            if not data:
                continue
            garbage = self._faults.active("garbage", t_ns - self._origin_ns)
            if garbage is not None and self._noise.random() < garbage.amount:
                data = self._noise.bytes(len(data))
            arrival_ns = t_ns + WIRE_NS
            burst = self._faults.active("burst", t_ns - self._origin_ns)
            if burst is not None:
                arrival_ns = self._origin_ns + burst.end_ns
            self._outbox.append(Chunk(arrival_ns, data))
        if self._is_away(until_ns):
            self._outbox.clear()
            raise DeviceDisconnected(AWAY, remedy=REMEDY)
        chunks = [chunk for chunk in self._outbox if chunk.t_host_ns <= until_ns]
        self._outbox = [chunk for chunk in self._outbox if chunk.t_host_ns > until_ns]
        return chunks

    def say(self, data: bytes, t_ns: int) -> None:
        """Answer the host."""
        self._outbox.append(Chunk(t_ns + WIRE_NS, data))

    def _active(self, kind: str, t_ns: int) -> bool:
        return self._faults.active(kind, t_ns - self._origin_ns) is not None

    def _is_away(self, t_ns: int) -> bool:
        return self._active("late_start", t_ns) or self._active("disconnect", t_ns)

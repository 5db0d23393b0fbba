"""Listen to the synchronisation board: photodiode, microphone and accelerometer on a serial line.

The board samples by its own clock and answers questions for it; the fit of those exchanges maps
its stamps to the session's clock. A block that is lost is counted, never filled.
"""

from collections.abc import Mapping

import numpy as np

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import ClockPair
from visavis.devices.drivers.armband.codec import FrameReader
from visavis.devices.drivers.armband.ledger import DeviceMicros
from visavis.devices.sync.board_codec import BLOCK, CHANNELS, BoardTime, Samples, decode, encode_ask
from visavis.devices.sync.sensing import Trace
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.clock_fit import fit_clock
from visavis.lab.errors import DeviceTimeout

BAUD = 250_000
ASK_EVERY_NS = 100 * NS_PER_MS
OPENING_S = 3.0
REMEDY = "plug the board in, flash firmware/sync_board, and name its port by --sensor"


class SyncBoard:
    """The board behind a byte link; a `Sensor`."""

    def __init__(self, link: ByteLink, clock: Clock) -> None:
        self._link = link
        self._clock = clock
        self._reader = FrameReader()
        self._micros = DeviceMicros()
        self._asked_ns: dict[int, int] = {}
        self._seq = 0
        self._ask_ns = 0
        self._expected: int | None = None
        self._lost_blocks = 0
        self._blocks: list[tuple[int, int, Samples]] = []
        self.pairs: list[ClockPair] = []

    @property
    def display_name(self) -> str:
        """Name the link."""
        return f"board ({self._link.kind})"

    def open(self) -> None:
        """Connect, and wait until the board has sent its clock and samples."""
        self._link.open(OPENING_S)
        deadline_ns = self._clock.now_ns() + round(OPENING_S * NS_PER_S)
        while not (self.pairs and self._blocks):
            if self._clock.now_ns() >= deadline_ns:
                self._link.close()
                raise DeviceTimeout("the synchronisation board does not answer", remedy=REMEDY)
            self._take(0.02)

    def poll(self) -> None:
        """Take samples and answers; ask for the board's clock ten times a second."""
        self._take(0.0)

    def close(self) -> None:
        """Release the link."""
        self._link.close()

    def loss_count(self) -> int:
        """Return the samples of blocks that never came or came damaged."""
        return self._lost_blocks * BLOCK

    def traces(self) -> Mapping[str, Trace]:
        """Return light, sound and motion in 1/255 of the input's range."""
        fit = fit_clock(self.pairs)
        steps = np.arange(BLOCK, dtype=np.int64)
        device_ns = [at_ns + steps * period_ns for at_ns, period_ns, _ in self._blocks]
        t_ns = fit.to_host_ns(np.concatenate(device_ns))
        levels = np.concatenate([samples.levels for _, _, samples in self._blocks]) / 255.0
        order = np.argsort(t_ns, kind="stable")
        return {name: Trace(t_ns[order], levels[order, i]) for i, name in enumerate(CHANNELS)}

    def _take(self, timeout_s: float) -> None:
        now_ns = self._clock.now_ns()
        if now_ns >= self._ask_ns:
            self._ask_ns = now_ns + ASK_EVERY_NS
            self._seq = (self._seq + 1) % 256
            self._asked_ns[self._seq] = now_ns
            self._link.write(encode_ask(self._seq))
        for chunk in self._link.read(timeout_s):
            for frame in self._reader.feed(chunk.data):
                message = decode(frame)
                if message is None:
                    continue
                at_ns = self._micros.unwrap_ns(message.device_us)
                if isinstance(message, BoardTime):
                    sent_ns = self._asked_ns.pop(message.seq, None)
                    if sent_ns is not None:
                        self.pairs.append(ClockPair(sent_ns, at_ns, chunk.t_host_ns))
                    continue
                if self._expected is not None:
                    self._lost_blocks += (message.seq - self._expected) % 256
                self._expected = (message.seq + 1) % 256
                self._blocks.append((at_ns, message.period_us * 1000, message))

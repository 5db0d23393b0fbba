"""A sound card behind sounddevice's interface: requests and stamps blocks by its own clock.

A simulated person with ears hears what comes out.

`played_blocks` holds the latest output with the card's own times. Not modelled: a card's filters,
the air, and a system that requests blocks late.
"""

from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import HearingBody
from visavis.devices.faults import FaultSchedule
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock

RATE_HZ: Final = 48_000
BLOCK: Final = 480
KEPT_BLOCKS: Final = 6000
SINCE_BOOT_S: Final = 1000.0


class SimulatedPortAudio:
    """The part of sounddevice that `SoundCard` uses. Faults: late_start, disconnect, loss (blocks
    that come too late; the next block reports an underflow).
    """

    class PortAudioError(Exception):
        """What PortAudio raises."""

    def __init__(
        self,
        clock: Clock,
        *,
        faults: FaultSchedule | None = None,
        latency_ms: float = 20.0,
        drift_ppm: float = 0.0,
        body: HearingBody | None = None,
    ) -> None:
        self.clock = clock
        self.faults = faults if faults is not None else FaultSchedule()
        self.latency_s = latency_ms * NS_PER_MS / NS_PER_S
        self.rate = 1.0 + drift_ppm * 1e-6
        self.origin_ns = clock.now_ns()
        self.body = body
        self.played_blocks: deque[tuple[float, npt.NDArray[np.float32]]] = deque(maxlen=KEPT_BLOCKS)

    def device_name(self, device: str | None) -> str:
        """Return the name of the card."""
        return "simulated sound card"

    def is_active(self, kind: str) -> bool:
        """Tell whether a fault is in force now."""
        return self.faults.active(kind, self.clock.now_ns() - self.origin_ns) is not None

    def card_s(self, t_ns: int) -> float:
        """Return what the card's clock shows at a session time."""
        return SINCE_BOOT_S + t_ns * self.rate / NS_PER_S

    def put_out(self, at_s: float, block: npt.NDArray[np.float32]) -> None:
        """Let a block come out at a time of the card's clock."""
        if block.any():
            self.played_blocks.append((at_s, block))
        if self.body is not None:
            t_ns = round((at_s - SINCE_BOOT_S) / self.rate * NS_PER_S)
            self.body.hear(block, RATE_HZ, t_ns)

    def OutputStream(self, **options: Any) -> "SimulatedStream":  # noqa: N802 - sounddevice's name
        """Open the output."""
        if self.is_active("late_start") or self.is_active("disconnect"):
            raise self.PortAudioError("Device unavailable")
        return SimulatedStream(self, options["callback"])


class SimulatedStream:
    """An output stream; its time advances at every access."""

    samplerate = float(RATE_HZ)

    def __init__(self, card: SimulatedPortAudio, callback: Callable[..., None]) -> None:
        self._card = card
        self._callback = callback
        self._runs = self._is_gone = False
        self._block = 0
        self._misses_block = False

    @property
    def latency(self) -> float:
        """Seconds from the request for a block to its output."""
        return self._card.latency_s

    @property
    def active(self) -> bool:
        """Whether the card still requests blocks."""
        self._is_gone = self._is_gone or self._card.is_active("disconnect")
        return self._runs and not self._is_gone

    @property
    def time(self) -> float:
        """The card's clock, in seconds."""
        self._catch_up()
        return self._card.card_s(self._card.clock.now_ns())

    def start(self) -> None:
        """Begin to request blocks."""
        self._runs = True
        self._block = self._blocks_due()

    def stop(self) -> None:
        """Stop requesting blocks."""
        self._runs = False

    def close(self) -> None:
        """Release the output."""
        self._runs = False

    def _blocks_due(self) -> int:
        now_s = self._card.card_s(self._card.clock.now_ns())
        return int(np.floor(now_s * RATE_HZ / BLOCK + 1e-6)) + 1

    def _catch_up(self) -> None:
        while self.active and self._block < self._blocks_due():
            asked_s = self._block * BLOCK / RATE_HZ
            comes_s = asked_s + self._card.latency_s
            times = SimpleNamespace(currentTime=asked_s, outputBufferDacTime=comes_s)
            status = SimpleNamespace(output_underflow=self._misses_block)
            block = np.zeros((BLOCK, 2), np.float32)
            self._callback(block, BLOCK, times, status)
            self._misses_block = self._card.is_active("loss")
            if not self._misses_block:
                self._card.put_out(comes_s, block)
            self._block += 1

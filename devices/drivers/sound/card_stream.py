"""What devices on a stream of the computer's sound card (sounddevice, PortAudio) have in common."""

import contextlib
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

from visavis.devices.contracts import ClockPair, DeviceState, Health, Sink
from visavis.devices.lifecycle import HasLife, Lifecycle
from visavis.devices.meter import StreamMeter
from visavis.devices.spec import AnySpec
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.clock_fit import latest_quick, offset_ns
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound

AGAIN_NS: Final = NS_PER_S
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


class OnCardStream(HasLife):
    """A device on one stream of a sound card, which is opened again after the card was away.

    `load` returns sounddevice or a stand-in; it is called when the device is opened.
    """

    _part: str
    """What the stream belongs to, as an operator calls it."""
    _meter: StreamMeter

    def __init__(
        self,
        role: str,
        load: Callable[[], Any],
        clock: Clock,
        *,
        spec: AnySpec,
        is_simulated: bool,
    ) -> None:
        self._load, self._clock, self._spec = load, clock, spec
        self._library: Any = None
        self._stream: Any = None
        self._life = Lifecycle(role)
        self._card_clock = CardClock(clock)
        self._sink: Sink | None = None
        self._retry_ns = 0
        self.info = replace(
            spec.info(role, None),
            is_simulated=is_simulated,
            transport="memory" if is_simulated else "sound card",
            serial="simulated" if is_simulated else "",
        )

    def open(self, deadline_s: float) -> None:
        """Open the card's stream, which runs until the device is closed."""
        self._life.require("open", DeviceState.CLOSED)
        self._library = self._load()
        self._connect()
        self._life.state = DeviceState.OPEN

    def start(self, sink: Sink) -> None:
        """Begin delivering."""
        self._life.require("start", DeviceState.OPEN)
        if self._stream is None:  # the card was away when the device was stopped
            self._connect()
        self._begin()
        self._sink = sink
        self._life.state = DeviceState.STREAMING

    def close(self) -> None:
        """Release the card; idempotent."""
        self._sink = None
        self._life.state = DeviceState.CLOSED
        self._release()

    def health(self) -> Health:
        """Report what was delivered so far."""
        return self._meter.health(self.state, self._clock.now_ns())

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return readings of the card's clock, each between two of the session's clock."""
        return tuple(self._card_clock.pairs)

    # ---- inside -----------------------------------------------------------------------------

    @abstractmethod
    def _begin(self) -> None:
        """Forget what was delivered."""

    @abstractmethod
    def _new_stream(self) -> Any:
        """Return a stream of the library that does not run yet."""

    def _connect(self) -> None:
        try:
            self._stream = self._new_stream()
            self._card_clock.pairs.clear()
            self._stream.start()
            self._card_clock.read(self._stream)
        except (self._library.PortAudioError, ValueError) as problem:  # ValueError: no such name
            self._release()
            raise DeviceNotFound(
                f"the {self._part} cannot be opened: {problem}",
                role=self.info.role,
                remedy=self._spec.remedy,
            ) from problem

    def _release(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            with contextlib.suppress(self._library.PortAudioError):  # it is gone already
                stream.close()

    def _loss(self, text: str) -> DeviceDisconnected:
        """Let the stream go, and return the error that says so."""
        self._life.state = DeviceState.FAULT
        self._retry_ns = self._clock.now_ns() + AGAIN_NS
        self._release()
        return DeviceDisconnected(text, role=self.info.role, remedy=self._spec.remedy)

    def _reconnect(self) -> None:
        if self._clock.now_ns() < self._retry_ns:
            return
        try:
            self._connect()
        except DeviceError:
            self._retry_ns = self._clock.now_ns() + AGAIN_NS
        else:
            self._life.state = DeviceState.STREAMING

    def _wait(self, timeout_s: float) -> None:
        if timeout_s > 0:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))

"""A voice key on a microphone (sounddevice, PortAudio): pressed when somebody begins to speak.

The card stamps every block with the time, by its own clock, at which the first sample was
converted; that clock is compared with the session's again and again. A press therefore bears the
time of the first sample of the sound, not that of the decision. Where the card gives no stamp, a
block's time is its arrival less the stream's latency, and `check` says so. Sound is never recorded
or handed on: of what is heard only onsets and ends leave this module.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import RESPONSES, DeviceState, Fault, Sink
from visavis.devices.drivers.sound.card_stream import OnCardStream
from visavis.devices.drivers.voice.onset import OnsetDetector, Turn
from visavis.devices.drivers.voice.spec import VOICE, VoiceKeyOptions
from visavis.devices.meter import StreamMeter
from visavis.devices.spec import AnySpec
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected
from visavis.lab.schema import SampleBatch, StreamSchema

STALLED_NS: Final = NS_PER_S
"""A microphone that sends nothing for so long is gone, whatever the system says."""
KEPT_BLOCKS: Final = 2000
BLOCK: Final = 480
"""Samples that come at once: 10 ms at 48 kHz."""


class _Block(NamedTuple):
    """What the card's thread brought: samples (n,), the card's time of the first one, in s."""

    samples: npt.NDArray[np.float32]
    at_s: float


class Row(NamedTuple):
    """A press or release: session time, the device's own, the control, and 1 or 0."""

    t_host_ns: int
    t_device_ns: int
    control: str
    value_01: float


class VoiceKey(OnCardStream):
    """Follow the `ResponseInput` contract over PortAudio's input stream."""

    _part = "microphone"

    def __init__(
        self,
        role: str,
        load: Callable[[], Any],
        clock: Clock,
        *,
        spec: AnySpec,
        options: VoiceKeyOptions,
        is_simulated: bool = False,
    ) -> None:
        super().__init__(role, load, clock, spec=spec, is_simulated=is_simulated)
        self._options = options
        self.controls: tuple[str, ...] = (VOICE,)
        self._detector: OnsetDetector | None = None
        self._blocks: deque[_Block] = deque(maxlen=KEPT_BLOCKS)
        self._has_stamps, self._latency_s = True, 0.0
        self._is_down = False
        self._from_ns = self._last_host_ns = self._last_block_ns = 0
        self._begin()

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the response stream."""
        return (RESPONSES,)

    def start(self, sink: Sink) -> None:
        """Begin delivering; who speaks already is heard when they begin anew."""
        super().start(sink)
        self._card_clock.read(self._stream)
        self._turns()  # only the room's level counts of what was heard so far
        self._from_ns = self._last_host_ns = self._last_block_ns = self._clock.now_ns()

    def poll(self, timeout_s: float) -> int:
        """Judge the blocks that came and deliver onsets and ends; see the contract."""
        self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
        if self._life.state is DeviceState.FAULT:
            self._reconnect()
            row_count = self._deliver(self._final_rows([]))
        else:
            self._card_clock.read(self._stream)
            row_count = self._deliver(self._final_rows(self._rows_of(self._turns())))
            if not self._stream.active:
                raise self._loss("the microphone stopped")
            if self._clock.now_ns() - self._last_block_ns >= STALLED_NS:
                raise self._loss("the microphone sends nothing")
        if not row_count:
            self._wait(timeout_s)
        return row_count

    def check(self) -> tuple[Fault, ...]:
        """Report blocks that were lost, a card without stamps, and a room that is too loud."""
        faults = []
        if self._overflows:
            text = f"{self._overflows} times the microphone lost sound: it was not taken in time"
            faults.append(Fault(self.info.role, "warning", text, "close other programs"))
        if not self._has_stamps:
            text = "the microphone's card does not stamp sound: times are arrival less latency"
            remedy = "choose another card or sound interface of the system for reaction times"
            faults.append(Fault(self.info.role, "warning", text, remedy))
        floor_db = None if self._detector is None else self._detector.floor_db
        if floor_db is not None and floor_db + self._options.threshold_db >= 0:
            text = f"the room is so loud ({floor_db:.0f} dB of full scale) that no voice is heard"
            remedy = "lower the microphone's level in the system, or threshold_db"
            faults.append(Fault(self.info.role, "warning", text, remedy))
        return tuple(faults)

    # ---- inside -----------------------------------------------------------------------------

    def _begin(self) -> None:
        self._meter = StreamMeter(RESPONSES.nominal_rate_hz)
        self._seq = self._overflows = 0
        self._is_down = False

    def _new_stream(self) -> Any:
        stream = self._library.InputStream(
            device=self._options.device or None,
            channels=1,
            dtype="float32",
            blocksize=BLOCK,  # left to itself, PulseAudio may hold sound back for seconds
            latency="low",
            callback=self._take,
        )
        self._blocks.clear()
        self._has_stamps, self._latency_s = True, float(stream.latency)
        self._detector = OnsetDetector(
            stream.samplerate,
            threshold_db=self._options.threshold_db,
            least_ms=self._options.least_ms,
            release_ms=self._options.release_ms,
        )
        return stream

    def _connect(self) -> None:
        super()._connect()
        self._last_block_ns = self._clock.now_ns()

    def _loss(self, text: str) -> DeviceDisconnected:
        self._is_down = False
        return super()._loss(text)

    def _take(self, data: npt.NDArray[np.float32], n: int, times: Any, status: Any) -> None:
        """Take a block; it runs in the card's own thread."""
        at_s = float(times.inputBufferAdcTime)
        if at_s <= 0.0:  # some audio interfaces of operating systems give no stamp
            at_s, self._has_stamps = float(times.currentTime) - self._latency_s, False
        self._overflows += bool(getattr(status, "input_overflow", False))
        self._blocks.append(_Block(data[:, 0].copy(), at_s))

    def _turns(self) -> list[Turn]:
        """Return what the blocks that came say."""
        turns: list[Turn] = []
        while self._blocks and self._detector is not None:
            block = self._blocks.popleft()
            self._last_block_ns = self._clock.now_ns()
            turns += self._detector.feed(block.samples, round(block.at_s * NS_PER_S))
        return turns

    def _rows_of(self, turns: Sequence[Turn]) -> list[Row]:
        """Return the rows that onsets and ends make, in their order."""
        offset_ns = self._card_clock.offset_ns()
        rows: list[Row] = []
        for turn in turns:
            t_host_ns = turn.t_card_ns + offset_ns
            is_earlier = turn.is_down and t_host_ns < self._from_ns
            # The end of what began before the start is none.
            if not is_earlier and turn.is_down != self._is_down:
                self._is_down = turn.is_down
                rows.append(Row(t_host_ns, turn.t_card_ns, VOICE, float(turn.is_down)))
        return rows

    def _final_rows(self, rows: list[Row]) -> list[Row]:
        """Return what may be delivered, given new rows, in the order of session time."""
        return rows

    def _deliver(self, rows: Sequence[Row]) -> int:
        if not rows or self._sink is None:
            return 0
        device_ns = np.array([row.t_device_ns for row in rows], np.int64)
        # A reading of the card's clock may differ from the one before by microseconds.
        host_ns = np.maximum.accumulate(np.array([row.t_host_ns for row in rows], np.int64))
        host_ns = np.maximum(host_ns, self._last_host_ns)
        self._last_host_ns = int(host_ns[-1])
        values = np.zeros(len(rows), RESPONSES.dtype)
        values["control"] = [self.controls.index(row.control) for row in rows]
        values["value_01"] = [row.value_01 for row in rows]
        seq = np.arange(self._seq, self._seq + len(rows), dtype=np.int64)
        self._seq += len(rows)
        self._meter.update(host_ns.tolist(), self._last_host_ns)
        self._sink(SampleBatch(RESPONSES, seq, device_ns, host_ns, values))
        return len(rows)

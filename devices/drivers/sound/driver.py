"""Play sounds through the computer's sound card (sounddevice, PortAudio), and record their times.

The card asks for a block of samples some time before it plays it and states that time by its own
clock, which is compared with the session's clock again and again. So every sound has the time at
which its first sample leaves the card. Devices behind the card (a headset's radio link, a receiver,
an equaliser) add a delay: `visavis sync-test --speaker` measures all of it.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import NO_DEVICE_TIME, DeviceState, Fault
from visavis.devices.drivers.sound.card_stream import OnCardStream
from visavis.devices.drivers.sound.mixing import Mixer, Voice
from visavis.devices.meter import StreamMeter
from visavis.devices.spec import AnySpec
from visavis.devices.streams import SOUND, SOUND_EVENTS
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError
from visavis.lab.geometry import Pose, Vector
from visavis.lab.schema import SampleBatch, empty_values
from visavis.stimuli.sound import Waveform

SOUND_BEGAN, SOUND_ENDED, SOUND_STOPPED, UNDERFLOW = (
    SOUND_EVENTS.index(name) for name in ("began", "ended", "stopped", "underflow")
)
NOBODY: Final = -1
MAX_GAIN_DB: Final = 20.0


class SoundCard(OnCardStream):
    """Follow the `SoundOutput` contract over PortAudio's output stream.

    The card's own thread takes commands with the next block that it asks for.
    """

    _part = "sound output"

    def __init__(
        self,
        role: str,
        load: Callable[[], Any],
        clock: Clock,
        *,
        spec: AnySpec,
        device: str = "",
        volume_01: float = 1.0,
        is_simulated: bool = False,
    ) -> None:
        super().__init__(role, load, clock, spec=spec, is_simulated=is_simulated)
        self._device, self._volume_01 = device or None, volume_01
        self._mixer = Mixer(48_000)
        self._commands: deque[Voice | int] = deque()
        self._card_events: deque[tuple[int, int, float, bool]] = deque()
        """From the card's thread: number, event, the card's own time (s), whether stamped."""
        self._resampled: dict[tuple[str, int], Waveform] = {}
        self._number = self._unheard_count = 0
        self._begin()

    def open(self, deadline_s: float) -> None:
        """Open the card's output; it is silent until something is played."""
        super().open(deadline_s)
        host = getattr(self._library, "device_name", _given_device)(self._device)
        self.info = replace(self.info, model=host or self.info.model)

    def describe(self) -> tuple[Any, ...]:
        """Return the stream of sound events."""
        return (SOUND,)

    def play(
        self,
        sound: Waveform,
        *,
        at_m: Vector | None = None,
        gain_db: float = 0.0,
        loops: bool = False,
    ) -> int:
        """Play a sound from the next block on; see the contract."""
        self._life.require("play", DeviceState.STREAMING, DeviceState.FAULT)
        if not -120.0 <= gain_db <= MAX_GAIN_DB:
            raise DeviceError(
                f"gain_db is {gain_db}",
                role=self.info.role,
                remedy=f"give decibels from -120 to {MAX_GAIN_DB:g}",
            )
        number, self._number = self._number, self._number + 1
        self._commanded_ns[number] = self._clock.now_ns()
        if self._life.state is DeviceState.FAULT:
            self._unheard_count += 1
            return number
        rate_hz = int(self._stream.samplerate)
        key = (sound.sha256, rate_hz)
        if key not in self._resampled:
            self._resampled[key] = sound.at_rate(rate_hz)
        gain = self._volume_01 * 10.0 ** (gain_db / 20.0)
        place = None if at_m is None else np.array(at_m, np.float64)
        self._commands.append(Voice(number, self._resampled[key].samples, gain, place, loops))
        return number

    def prepare(self, sound: Waveform) -> None:
        """Resample a sound to the card's rate in advance, as this takes longer than a frame."""
        if self._stream is not None:
            rate_hz = int(self._stream.samplerate)
            self._resampled.setdefault((sound.sha256, rate_hz), sound.at_rate(rate_hz))

    def hush(self, number: int | None = None) -> None:
        """End one sound, or all, with the next block; never raises."""
        self._commands.append(NOBODY if number is None else number)

    def hear_from(self, head: Pose) -> None:
        """Set the pose of the participant's head, from which sources with a place are heard."""
        self._mixer.head = head

    def poll(self, timeout_s: float) -> int:
        """Read the card's clock and deliver sound events; see the contract."""
        self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
        if self._life.state is DeviceState.FAULT:
            self._reconnect()
        elif not self._stream.active:
            raise self._loss("the sound card stopped")
        else:
            self._card_clock.read(self._stream)
        row_count = self._deliver()
        if not row_count:
            self._wait(timeout_s)
        return row_count

    def stop(self) -> None:
        """Fall silent; the card stays open."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self.hush()
        self._deliver()
        super().stop()

    def check(self) -> tuple[Fault, ...]:
        """Report gaps, sounds that are too loud together, and sounds that were not played."""
        faults = []
        for count, text, remedy in (
            (
                self._underflows,
                "holes in the sound: the card was not given samples in time",
                "close other programs, or raise latency_ms",
            ),
            (
                self._mixer.clipped_blocks,
                "blocks were louder than the card can play, and were cut",
                "lower gain_db of the sounds, or volume_01",
            ),
            (self._unheard_count, "sounds were not heard: the card was away", self._spec.remedy),
        ):
            if count:
                faults.append(Fault(self.info.role, "warning", f"{count} {text}", remedy))
        return tuple(faults)

    # ---- inside -----------------------------------------------------------------------------

    def _begin(self) -> None:
        self._meter = StreamMeter(0.0)
        self._commanded_ns: dict[int, int] = {}
        self._number = self._unheard_count = self._seq = self._underflows = self._retry_ns = 0
        self._commands.clear()
        self._card_events.clear()
        self._mixer.voices = []
        self._mixer.clipped_blocks = 0

    def _new_stream(self) -> Any:
        stream = self._library.OutputStream(
            device=self._device,
            channels=2,
            dtype="float32",
            latency="low",
            callback=self._fill,
        )
        self._mixer.rate_hz = int(stream.samplerate)
        return stream

    def _loss(self, text: str) -> DeviceDisconnected:
        loss = super()._loss(text)
        self._unheard_count += len(self._mixer.voices)
        self._mixer.voices = []
        self._commands.clear()
        return loss

    def _fill(self, out: npt.NDArray[np.float32], n: int, times: Any, status: Any) -> None:
        """Give the card its next block; it runs in the card's own thread."""
        at_s, is_stamped = float(times.outputBufferDacTime), True
        if at_s <= 0.0:  # some audio interfaces of operating systems give no stamp
            at_s, is_stamped = float(times.currentTime) + float(self._stream.latency), False
        while self._commands:
            self._take(self._commands.popleft(), at_s, is_stamped)
        if getattr(status, "output_underflow", False):
            self._card_events.append((NOBODY, UNDERFLOW, at_s, is_stamped))
        out[:], over = self._mixer.block(n)
        for voice, sample in over:
            kind = SOUND_STOPPED if voice.ends else SOUND_ENDED
            end_s = at_s + sample / self._mixer.rate_hz
            self._card_events.append((voice.number, kind, end_s, is_stamped))

    def _take(self, command: Voice | int, at_s: float, is_stamped: bool) -> None:
        if isinstance(command, Voice):
            self._mixer.voices.append(command)
            self._card_events.append((command.number, SOUND_BEGAN, at_s, is_stamped))
            return
        for voice in self._mixer.voices:
            voice.ends = voice.ends or command in (NOBODY, voice.number)

    def _deliver(self) -> int:
        rows = [self._card_events.popleft() for _ in range(len(self._card_events))]
        if not rows or self._sink is None:
            return 0
        offset_ns = self._card_clock.offset_ns()
        values = empty_values(SOUND, len(rows))
        card_ns = np.array([round(at_s * NS_PER_S) for _, _, at_s, _ in rows], np.int64)
        values["sound"] = [number for number, _, _, _ in rows]
        values["event"] = [kind for _, kind, _, _ in rows]
        values["t_commanded_ns"] = [self._commanded_ns.get(row[0], NO_DEVICE_TIME) for row in rows]
        values["t_sounding_ns"] = card_ns + offset_ns
        values["stamped"] = [is_stamped for _, _, _, is_stamped in rows]
        self._underflows += int((values["event"] == UNDERFLOW).sum())
        now_ns = self._clock.now_ns()
        numbers = np.arange(self._seq, self._seq + len(rows), dtype=np.int64)
        self._seq += len(rows)
        self._meter.update(card_ns.tolist(), now_ns)
        host = np.full(len(rows), now_ns, np.int64)
        self._sink(SampleBatch(SOUND, numbers, card_ns, host, values))
        return len(rows)


def _given_device(device: str | None) -> str:
    return device or ""

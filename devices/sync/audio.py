"""Click through the sound card, and listen through it (sounddevice, PortAudio).

A sensor at an audio input - a photodiode, a piezo disc, a microphone - is sampled by the card; the
card's own stamp of every block is set on the session's clock by the block that waited least.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.devices.sync.sensing import Trace
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.clock_fit import fit_one_way
from visavis.lab.errors import DeviceError, DeviceNotFound

CLICK_MS = 4.0
PITCH_HZ = 1000.0
INSTALL = "pip install 'visavis[sound]'; on Linux also: apt-get install libportaudio2"


def sound_library() -> Any:
    """Return sounddevice; raises DeviceNotFound with the line that installs it."""
    try:
        import sounddevice
    except (ImportError, OSError) as missing:  # OSError: the module without PortAudio
        raise DeviceNotFound(f"no sound: {missing}", remedy=INSTALL) from missing
    return sounddevice


class SoundCardSpeaker:
    """Clicks through an output that is kept open, so that a click starts with the next block."""

    def __init__(self, library: Any, device: str | None = None) -> None:
        try:
            self._stream = library.OutputStream(
                device=device, channels=1, dtype="float32", latency="low", callback=self._fill
            )
        except (library.PortAudioError, ValueError) as problem:  # ValueError: no such name
            raise DeviceError(
                f"the sound output cannot be opened: {problem}",
                remedy="name one of `python -m sounddevice` by --speaker",
            ) from problem
        n = round(self._stream.samplerate * CLICK_MS / 1000)
        t_s = np.arange(n) / self._stream.samplerate
        self._click = (0.8 * np.cos(2 * np.pi * PITCH_HZ * t_s)).astype(np.float32)
        self._at = n
        self._stream.start()

    def click(self) -> None:
        """Let the next block begin with a click."""
        self._at = 0

    def close(self) -> None:
        """Release the output."""
        self._stream.close()

    def _fill(self, out: npt.NDArray[np.float32], n: int, times: Any, status: Any) -> None:
        part = self._click[self._at : self._at + n]
        out[: part.size, 0], out[part.size :] = part, 0.0
        self._at += part.size


class SoundCardSensor:
    """Channels of an audio input by number: "input_1", "input_2"; a `Sensor`."""

    def __init__(self, library: Any, clock: Clock, device: str | None = None) -> None:
        self._library = library
        self._clock = clock
        self._device = device
        self._stream: Any = None
        self._blocks: list[npt.NDArray[np.float32]] = []
        self._ends: list[tuple[int, int]] = []
        """(samples so far, session time at which their last one was converted)."""
        self._n = self._overflows = 0

    @property
    def display_name(self) -> str:
        """Name the input."""
        return f"audio input ({self._device or 'default'})"

    def open(self) -> None:
        """Begin to listen."""
        try:
            self._stream = self._library.InputStream(
                device=self._device, dtype="float32", latency="low", callback=self._take
            )
        except (self._library.PortAudioError, ValueError) as problem:  # ValueError: no such name
            raise DeviceError(
                f"the audio input cannot be opened: {problem}",
                remedy="name one of `python -m sounddevice` by --sensor audio:NAME",
            ) from problem
        self._stream.start()

    def poll(self) -> None:
        """Do nothing: the library calls when a block has come."""

    def close(self) -> None:
        """Release the input."""
        if self._stream is not None:
            self._stream.close()

    def loss_count(self) -> int:
        """Return how often blocks were lost."""
        return self._overflows

    def traces(self) -> Mapping[str, Trace]:
        """Return every channel over the session's time; raises DeviceError below two blocks."""
        if len(self._ends) < 2:
            raise DeviceError("the audio input delivered nothing", remedy="choose another input")
        period_ns = NS_PER_S / self._stream.samplerate
        sample_counts, ends_ns = np.array(self._ends, np.int64).T
        card_ns = np.rint(sample_counts * period_ns).astype(np.int64)
        levels = np.concatenate(self._blocks).astype(np.float64)
        samples_ns = np.rint(np.arange(1, len(levels) + 1) * period_ns).astype(np.int64)
        t_ns = fit_one_way(card_ns, ends_ns).to_host_ns(samples_ns)
        return {f"input_{i + 1}": Trace(t_ns, levels[:, i]) for i in range(levels.shape[1])}

    def _take(self, data: npt.NDArray[np.float32], n: int, times: Any, status: Any) -> None:
        waited_s = times.currentTime - times.inputBufferAdcTime - n / self._stream.samplerate
        self._n += n
        self._ends.append((self._n, self._clock.now_ns() - round(waited_s * NS_PER_S)))
        self._blocks.append(data.copy())
        self._overflows += bool(status)

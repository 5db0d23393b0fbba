"""Sounds for participants, as samples read from WAV, FLAC and OGG files."""

import hashlib
import math
import warnings
from dataclasses import dataclass, field
from functools import cached_property
from math import gcd
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DataError

MAX_S: Final = 1800.0
MIN_RATE_HZ, MAX_RATE_HZ = 4000, 192_000
MAX_FILE_BYTES: Final = 1 << 30
PACKED_BEGINNINGS: Final = (b"fLaC", b"OggS", b"\x1aE\xdf\xa3")
"""The first bytes of files that PyAV reads: FLAC, OGG, and films as WebM and Matroska."""
FILM: Final = b"ftyp"
"""What films as MP4 begin with after four bytes; PyAV reads them."""
CUT_S: Final = 0.1
SILENCE_DB: Final = -200.0


@dataclass(frozen=True, eq=False)
class Waveform:
    """A recording: `samples` (n, c) float32 of one channel or two (left, right), full scale 1."""

    name: str
    samples: npt.NDArray[np.float32] = field(repr=False)
    rate_hz: int

    @property
    def duration_s(self) -> float:
        """How long it lasts when it is played once."""
        return len(self.samples) / self.rate_hz

    @cached_property
    def level_db(self) -> float:
        """Its root mean square in decibels relative to that of the loudest sine; of two channels
        the louder.
        """
        return _decibels(float(np.sqrt(2 * (self.samples.astype(np.float64) ** 2).mean(0).max())))

    @cached_property
    def peak_db(self) -> float:
        """Its largest sample in decibels relative to full scale."""
        return _decibels(float(np.abs(self.samples).max()))

    @cached_property
    def pitch_hz(self) -> float:
        """The frequency of its strongest partial."""
        windowed = self.samples.mean(axis=1) * np.hanning(len(self.samples))
        count = max(len(windowed), self.rate_hz)
        return float(np.abs(np.fft.rfft(windowed, count)).argmax() * self.rate_hz / count)

    @cached_property
    def sha256(self) -> str:
        """Hash of rate and samples, independent of the file's name."""
        head = f"{self.rate_hz} {self.samples.shape}".encode()
        return hashlib.sha256(head + self.samples.tobytes()).hexdigest()

    def at_both_ears(self, gain_db: float) -> npt.NDArray[np.float32]:
        """Return what reaches the left and the right ear (n, 2) where it has no place."""
        loud = self.samples * np.float32(10 ** (gain_db / 20))
        return np.repeat(loud, 2, axis=1) if loud.shape[1] == 1 else loud

    def at_rate(self, rate_hz: int) -> "Waveform":
        """Return it resampled to a sound card's rate."""
        if rate_hz == self.rate_hz:
            return self
        from scipy.signal import resample_poly  # it takes half a second

        divisor = gcd(rate_hz, self.rate_hz)
        samples = resample_poly(self.samples, rate_hz // divisor, self.rate_hz // divisor, axis=0)
        return Waveform(self.name, samples.astype(np.float32), rate_hz)


def read_sound(path: Path) -> Waveform:
    """Read a WAV file of 8 to 32 bits or floats, or a FLAC or OGG file, with one channel or two.

    Raises:
        DataError: there is no such file, it is none of these or cut short, or nothing in it can be
            played.
    """
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise DataError(f"{path}: larger than {MAX_FILE_BYTES >> 20} MiB; cut the recording")
        with path.open("rb") as file:
            head = file.read(8)
    except OSError as problem:
        raise DataError(f"{path}: cannot be read ({problem.strerror or problem})") from problem
    is_packed = head[:4] in PACKED_BEGINNINGS or head[4:] == FILM
    samples, rate_hz = (_read_packed if is_packed else _read_wav)(path)
    if not 1 <= samples.shape[1] <= 2:
        raise DataError(f"{path}: {samples.shape[1]} channels; a sound has one or two")
    if not MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ:
        raise DataError(f"{path}: {rate_hz} samples a second; {MIN_RATE_HZ} to {MAX_RATE_HZ}")
    if not len(samples) or len(samples) > MAX_S * rate_hz:
        raise DataError(f"{path}: {len(samples) / rate_hz:g} s; more than none, up to {MAX_S:g} s")
    if not np.isfinite(samples).all():
        raise DataError(f"{path}: holds values that are not numbers; save it again")
    return Waveform(path.stem, samples, rate_hz)


def _read_wav(path: Path) -> tuple[npt.NDArray[np.float32], int]:
    """Return samples (n, c) of a WAV file and their rate."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks of other programs
            warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
            rate_hz, raw = wavfile.read(path)
    except wavfile.WavFileWarning as problem:
        raise DataError(f"{path}: cut short; copy or save it again") from problem
    except OSError as problem:
        raise DataError(f"{path}: cannot be read ({problem.strerror or problem})") from problem
    except (ValueError, EOFError, IndexError, KeyError, TypeError, MemoryError) as problem:
        raise DataError(
            f"{path}: no WAV file that could be read ({problem}); save it as WAV, 16 bits"
        ) from problem
    except Exception as problem:  # scipy passes on errors of struct and numpy
        raise DataError(f"{path}: a damaged WAV file ({problem}); save it again") from problem
    return _as_float(raw if raw.ndim > 1 else raw[:, None]), int(rate_hz)


def _read_packed(path: Path) -> tuple[npt.NDArray[np.float32], int]:
    """Return samples (n, c) of a FLAC or OGG file and their rate."""
    try:
        import av  # of the extra "browser"
    except ImportError as problem:
        raise DataError(
            f"{path}: FLAC and OGG need PyAV, which is not installed; run: pip install "
            "'visavis[browser]', or save the sound as WAV"
        ) from problem
    try:
        with av.open(str(path)) as file:
            if not file.streams.audio:
                raise DataError(f"{path}: there is no sound in it")
            stream = file.streams.audio[0]
            rate_hz, ticks = int(stream.rate or 0), stream.duration
            lasts_s = None if ticks is None else float(ticks * (stream.time_base or 0))
            to_float = av.AudioResampler(format="flt")
            parts: list[npt.NDArray[Any]] = [
                part.to_ndarray().reshape(-1, part.layout.nb_channels)
                for frame in file.decode(stream)
                for part in to_float.resample(frame)
            ]
            if parts and file.streams.video:
                parts = [_beside_pictures(file, stream, parts)]
    except (av.error.FFmpegError, ValueError) as problem:
        why = getattr(problem, "strerror", None) or problem
        raise DataError(f"{path}: a damaged sound ({why}); save it again") from problem
    samples = np.concatenate(parts or [np.zeros((0, 1))]).astype(np.float32)
    if lasts_s is not None and rate_hz and len(samples) / rate_hz < lasts_s - CUT_S:
        raise DataError(
            f"{path}: cut short, {len(samples) / rate_hz:.2f} s of {lasts_s:.2f} s; copy or save "
            "it again"
        )
    return samples, rate_hz


def _beside_pictures(file: Any, stream: Any, parts: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Return a film's sound from its first picture on, with silence where it begins later."""
    samples, video = np.concatenate(parts), file.streams.video[0]
    starts = [float((s.start_time or 0) * s.time_base) for s in (stream, video)]
    late = round((starts[0] - starts[1]) * stream.rate)
    if late <= 0:
        return samples[-late:]
    return np.concatenate([np.zeros((late, samples.shape[1]), samples.dtype), samples])


def part_of(sound: Waveform, from_s: float, seconds: float) -> Waveform:
    """Return so many seconds of a recording; silence before it begins and where it is over.

    Raises:
        DataError: nothing of it is heard.
    """
    if not -seconds < from_s < sound.duration_s:
        raise DataError(
            f"{sound.name} lasts {sound.duration_s:.2f} s; nothing of it is left at {from_s:g} s"
        )
    first, count = round(from_s * sound.rate_hz), round(seconds * sound.rate_hz)
    samples = np.zeros((count, sound.samples.shape[1]), np.float32)
    own = sound.samples[max(first, 0) : max(first + count, 0)]
    samples[max(-first, 0) :][: len(own)] = own
    return Waveform(f"{sound.name} from {from_s:g} s", samples, sound.rate_hz)


def _as_float(raw: npt.NDArray[np.generic]) -> npt.NDArray[np.float32]:
    """Return samples of any kind of WAV file on the scale from −1 to 1."""
    if raw.dtype.kind == "u":  # 8 bits stand about 128
        return ((raw.astype(np.float64) - 128) / 128).astype(np.float32)
    if raw.dtype.kind == "i":  # 24 bits come in the upper bytes of 32
        return (raw.astype(np.float64) / 2.0 ** (8 * raw.dtype.itemsize - 1)).astype(np.float32)
    return raw.astype(np.float32)


def _decibels(share: float) -> float:
    return 20 * math.log10(share) if share > 10 ** (SILENCE_DB / 20) else SILENCE_DB

"""Recordings of digits for the sound check: a lab's own, or those of Visavis."""

import io
import wave
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final

from visavis.lab.errors import DesignError

OURS: Final = Path(__file__).parent / "digits"
FOLDER: Final = "digits"
"""Folder of a lab's own digits, beside its study: digits/LANGUAGE/0.wav to 9.wav."""
HOW_MANY: Final = 3
PAUSE_S: Final = 0.35
MAX_BYTES: Final = 40_000
"""The largest file of one digit: a page waits for three."""


@lru_cache(maxsize=16)
def spoken_digits(language: str, folder: Path | None) -> tuple[bytes, ...]:
    """Return the files of the ten digits in a language, those beside a study first.

    Raises:
        DesignError: there are none in this language, or one cannot be spoken with the others.
    """
    own = None if folder is None else folder / FOLDER / language
    where = own if own is not None and own.is_dir() else OURS / language
    if not where.is_dir():
        raise DesignError(
            f"the sound check has no digits in {language!r}: put 0.wav to 9.wav into "
            f"{FOLDER}/{language} beside the study"
        )
    files, formats = [], set()
    for digit in range(10):
        path = where / f"{digit}.wav"
        try:
            content = path.read_bytes()
            with wave.open(io.BytesIO(content)) as read:
                formats.add((read.getnchannels(), read.getsampwidth(), read.getframerate()))
        except (OSError, EOFError, wave.Error) as error:
            raise DesignError(f"{path}: no digit can be spoken from it ({error})") from error
        if len(content) > MAX_BYTES:
            raise DesignError(f"{path}: {len(content)} bytes; a digit takes at most {MAX_BYTES}")
        files.append(content)
    if len(formats) > 1:
        raise DesignError(f"{where}: the digits differ in channels, bits or rate")
    return tuple(files)


def say_digits(digits: Sequence[int], files: Sequence[bytes]) -> bytes:
    """Return a WAV file in which digits are said one after another."""
    buffer, pieces = io.BytesIO(), []
    for digit in digits:
        with wave.open(io.BytesIO(files[digit])) as read:
            wave_format = read.getparams()
            zero = b"\x80" if wave_format.sampwidth == 1 else bytes(wave_format.sampwidth)
            pieces += [
                read.readframes(wave_format.nframes),
                zero * wave_format.nchannels * round(PAUSE_S * wave_format.framerate),
            ]
    with wave.open(buffer, "wb") as wav:
        wav.setparams(wave_format)
        wav.writeframes(b"".join(pieces))
    return buffer.getvalue()


def hear_digits(sound: bytes, files: Sequence[bytes]) -> str:
    """Return the digits in a sound, found by comparison with the files; "" if there are none."""
    with wave.open(io.BytesIO(sound)) as read:
        left = read.readframes(read.getnframes())
    samples_by_digit = {}
    for digit, content in enumerate(files):
        with wave.open(io.BytesIO(content)) as read:
            samples_by_digit[digit] = read.readframes(read.getnframes())
    places = []
    for digit, samples in samples_by_digit.items():
        at = left.find(samples)
        while at >= 0:
            places.append((at, digit))
            at = left.find(samples, at + len(samples))
    return "".join(str(digit) for _, digit in sorted(places))

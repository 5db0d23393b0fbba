"""Speech that a speaker is heard with: a recording, when its words are said, and its phones.

A recording `speech.wav` has its times beside it in `speech.words.csv`, one row a word or phone with
the columns kind (word, phone), text, start_s and end_s. Words tie strokes to speech, phones move
the lips; a recording without either is still heard, and its loudness moves the jaw.
"""

import csv
import io
import wave
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from visavis.lab.errors import DataError
from visavis.lab.foreign_text import require_csv
from visavis.lab.plain_files import read_plain
from visavis.stimuli.sound import Waveform, read_sound

COLUMNS: Final = ("kind", "text", "start_s", "end_s")
KINDS: Final = ("word", "phone")


@dataclass(frozen=True)
class Utterance:
    """A word, or a phone in IPA, from `start_s` to `end_s` of a recording."""

    text: str
    start_s: float
    end_s: float


@dataclass(frozen=True, eq=False)
class Speech:
    """A recording with its words and phones in the order of time; either may be missing."""

    sound: Waveform
    words: tuple[Utterance, ...] = ()
    phones: tuple[Utterance, ...] = ()

    def word(self, text: str) -> Utterance:
        """Return a word; "Caesar#2" is the second of this name. Case and punctuation do not count.

        Raises:
            DataError: it is not said, or not so often.
        """
        name, _, number = text.partition("#")
        if not self.words:
            raise DataError(
                f"the words of {self.sound.name} have no times; list them in "
                f"{self.sound.name}.words.csv beside it"
            )
        if number and (not number.isdigit() or int(number) < 1):
            raise DataError(f"the word {text!r} has no number after #; write Caesar#2")
        same = [word for word in self.words if _plain(word.text) == _plain(name)]
        if len(same) < int(number or 1):
            said = f"{len(same)} times" if same else "never"
            raise DataError(f"{self.sound.name} says {name!r} {said}, not as asked for ({text})")
        return same[int(number or 1) - 1]


def _plain(text: str) -> str:
    return "".join(letter for letter in text.casefold() if letter.isalnum())


def words_path(path: Path) -> Path:
    """Return the file with the times of a recording."""
    return path.with_name(f"{path.stem}.words.csv")


def read_speech(path: Path) -> Speech:
    """Read a recording (WAV) and, where they stand beside it, the times of its words and phones.

    Raises:
        DataError: the recording cannot be played, or a row of its times is wrong (with its line).
    """
    sound = read_sound(path)
    times = words_path(path)
    if not times.exists():
        return Speech(sound)
    try:
        text = read_plain(times).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{times} cannot be read ({error}); save it as UTF-8 text") from error
    require_csv(times, text)
    reader = csv.DictReader(io.StringIO(text))
    if missing := [name for name in COLUMNS if name not in (reader.fieldnames or ())]:
        raise DataError(f"{times}: the columns {', '.join(missing)} are missing")
    of: dict[str, list[Utterance]] = {kind: [] for kind in KINDS}
    for row in reader:
        at = f"{times}, line {reader.line_num}"
        if row["kind"] not in KINDS:
            raise DataError(f"{at}: kind is {row['kind']!r}; give word or phone")
        try:
            start_s, end_s = float(row["start_s"]), float(row["end_s"])
        except (TypeError, ValueError):
            start_s = end_s = np.nan
        before = of[row["kind"]]
        if not 0 <= start_s <= end_s <= sound.duration_s + 0.05:
            raise DataError(
                f"{at}: from {row['start_s']} to {row['end_s']} s is no time within the recording "
                f"({sound.duration_s:.2f} s)"
            )
        if before and start_s < before[-1].start_s:
            raise DataError(f"{at}: begins before the {row['kind']} above")
        before.append(Utterance(row["text"], start_s, end_s))
    return Speech(sound, tuple(of["word"]), tuple(of["phone"]))


def write_speech(path: Path, speech: Speech) -> None:
    """Write a recording as WAV (16 bits) and its times beside it."""
    sound = speech.sound
    codes = np.round(np.clip(sound.samples, -1, 1) * 32767).astype("<i2")
    with wave.open(str(path), "wb") as file:
        file.setparams((codes.shape[1], 2, sound.rate_hz, len(codes), "NONE", ""))
        file.writeframes(codes.tobytes())
    rows = [("word", u) for u in speech.words] + [("phone", u) for u in speech.phones]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for kind, u in sorted(rows, key=lambda row: (row[1].start_s, row[0] == "phone")):
        writer.writerow((kind, u.text, f"{u.start_s:.3f}", f"{u.end_s:.3f}"))
    words_path(path).write_text(text.getvalue(), encoding="utf-8")


@lru_cache(maxsize=8)
def _read_once(path: Path, changed_ns: int) -> Speech:
    return read_speech(path)


def speech_of(path: Path) -> Speech:
    """Return the speech of a file, read once for as long as the file stays as it is.

    Raises:
        DataError: as `read_speech`.
    """
    try:
        changed_ns = path.stat().st_mtime_ns
    except OSError as problem:
        raise DataError(f"{path}: cannot be read ({problem.strerror or problem})") from problem
    return _read_once(path, changed_ns)

"""Speech from text, by the synthesiser espeak-ng, if it is installed.

espeak-ng speaks some hundred languages without a network, is in Debian and Homebrew, has an
installer for Windows, and tells when each word and phone begins; voices that sound more like people
(Piper's, say) tell neither and come with licences of their own. It is under the GPL, is not passed
on with Visavis, and runs in a process of its own. What it speaks belongs to whoever wrote the text.

A text has a clause a line. `2.6: lend me your ears` begins at 2.6 s, `22.8 noble: The noble Brutus`
so that "noble" does; a line without a time follows the one before after a pause.
"""

import base64
import ctypes.util
import json
import re
import subprocess  # Python itself, with a file of ours
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.lab.errors import DataError
from visavis.lab.plain_files import read_plain
from visavis.stimuli.motion.speaking.speech import Speech, Utterance
from visavis.stimuli.sound import Waveform

PROGRAM: Final = Path(__file__).with_name("espeak_library.py")
NAMES: Final = ("espeak-ng", "libespeak-ng.so.1", "libespeak-ng.1.dylib", "libespeak-ng")
WINDOWS: Final = Path(r"C:\Program Files\eSpeak NG\libespeak-ng.dll")
PAUSE_S: Final = 0.3
TAIL_S: Final = 0.2
LIMIT_S: Final = 60.0
PEAK_01: Final = 0.7
LINE: Final = re.compile(
    r"\s*(?:(?P<at>\d+(?:\.\d+)?)(?:\s+(?P<word>[^\s:]+))?\s*:\s+)?(?P<text>.*\w.*)"
)
RATES_WPM: Final = (80, 450)


@dataclass(frozen=True)
class SynthesisVoice:
    """A voice of espeak-ng by name or language, its words a minute, and its pitch (0 to 99)."""

    name: str = "en-gb"
    rate_wpm: int = 150
    pitch: int = 40

    def __post_init__(self) -> None:
        if not RATES_WPM[0] <= self.rate_wpm <= RATES_WPM[1] or not 0 <= self.pitch <= 99:
            raise DataError(
                f"a voice of {self.rate_wpm} words a minute and pitch {self.pitch}; give "
                f"{RATES_WPM[0]} to {RATES_WPM[1]}, and 0 to 99"
            )


@dataclass(frozen=True)
class Clause:
    """A line: `at_s` is when it begins, or its `word` does; None follows the one before."""

    text: str
    at_s: float | None = None
    word: str = ""


def read_text(path: Path) -> tuple[Clause, ...]:
    """Read a text with a clause a line; lines that begin with # are notes.

    Raises:
        DataError: the file cannot be read, or nothing in it can be said.
    """
    try:
        text = read_plain(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path} cannot be read ({error}); save it as UTF-8 text") from error
    clauses = []
    for line in text.splitlines():
        match = LINE.fullmatch(line)
        if match is None or line.lstrip().startswith("#"):
            continue
        at = match["at"]
        clauses.append(
            Clause(match["text"].strip(), None if at is None else float(at), match["word"] or "")
        )
    if not clauses:
        raise DataError(f"{path} has no words; write a clause a line")
    return tuple(clauses)


def library_path() -> str:
    """Return the library of espeak-ng on this computer.

    Raises:
        DataError: there is none.
    """
    for name in NAMES:
        if name.startswith("lib"):
            try:
                ctypes.CDLL(name)
            except OSError:
                continue
            return name
        if path := ctypes.util.find_library(name):
            return path
    if WINDOWS.exists():
        return str(WINDOWS)
    raise DataError(
        "speech needs the program espeak-ng, which is not installed; install it (apt install "
        "espeak-ng, brew install espeak-ng, or its installer for Windows), or give a recording"
    )


def synthesised(
    name: str, clauses: Sequence[Clause], voice: SynthesisVoice, seconds: float | None = None
) -> Speech:
    """Return a text as speech with the times of words and phones, `seconds` long.

    Raises:
        DataError: espeak-ng is missing or refuses, a clause would begin before the one above it
            ends, or the text takes longer than `seconds`.
    """
    library = library_path()
    pieces: list[tuple[float, np.ndarray[Any, Any]]] = []
    words: list[Utterance] = []
    phones: list[Utterance] = []
    rate_hz, end_s = 0, 0.0
    for clause in clauses:
        order = {"library": library, "voice": voice.name, "text": clause.text}
        reply = _speak({**order, "rate_wpm": voice.rate_wpm, "pitch": voice.pitch})
        rate_hz = int(reply["rate_hz"])
        samples = np.frombuffer(base64.b64decode(reply["samples"]), "<i2") / 32768
        own_phones = _phones(reply["phones"], len(samples) / rate_hz)
        own_words = _words(reply["words"], own_phones, clause.text)
        start_s = _begin(clause, own_words, end_s)
        if start_s < end_s - 1e-9:
            raise DataError(
                f"{clause.text!r} would begin at {start_s:.2f} s, before the clause above ends "
                f"({end_s:.2f} s); begin it later, or speak faster"
            )
        pieces.append((start_s, samples))
        words += [Utterance(w.text, w.start_s + start_s, w.end_s + start_s) for w in own_words]
        phones += [Utterance(p.text, p.start_s + start_s, p.end_s + start_s) for p in own_phones]
        end_s = start_s + (own_phones[-1].end_s if own_phones else len(samples) / rate_hz)
    whole_s = end_s + TAIL_S if seconds is None else seconds
    if end_s > whole_s + 1e-9:
        raise DataError(f"the text takes {end_s:.2f} s and not {whole_s:g} s; speak faster")
    mix = np.zeros(round(whole_s * rate_hz))
    for start_s, samples in pieces:
        first = round(start_s * rate_hz)
        own = samples[: max(0, len(mix) - first)]
        mix[first : first + len(own)] += own
    mix *= PEAK_01 / max(1e-6, float(np.abs(mix).max()))
    return Speech(
        Waveform(name, mix[:, None].astype(np.float32), rate_hz), tuple(words), tuple(phones)
    )


def _begin(clause: Clause, words: Sequence[Utterance], end_s: float) -> float:
    """Return when a clause begins, in seconds of the whole."""
    if clause.at_s is None:
        return end_s + (PAUSE_S if end_s else 0.0)
    if not clause.word:
        return clause.at_s
    at = Speech(Waveform(clause.text, np.zeros((1, 1), np.float32), 8000), tuple(words))
    return max(0.0, clause.at_s - at.word(clause.word).start_s)


def _speak(order: dict[str, Any]) -> dict[str, Any]:
    try:
        run = subprocess.run(  # noqa: S603  (Python itself, and a file of ours)
            [sys.executable, "-I", str(PROGRAM)],
            input=json.dumps(order).encode(),
            capture_output=True,
            timeout=LIMIT_S,
            check=True,
        )
        reply: dict[str, Any] = json.loads(run.stdout)
    except (subprocess.SubprocessError, ValueError) as problem:
        raise DataError(f"espeak-ng did not speak {order['text']!r}: {problem}") from problem
    if "problem" in reply:
        raise DataError(f"{reply['problem']}; espeak-ng --voices lists them")
    return reply


def _phones(events: Sequence[tuple[str, float]], seconds: float) -> list[Utterance]:
    """Return phones with their ends; pauses are left out."""
    starts = [at for _, at in events] + [seconds]
    return [
        Utterance(name, at, end)
        for (name, at), end in zip(events, starts[1:], strict=True)
        if name and end > at
    ]


def _words(
    events: Sequence[tuple[int, int, float]], phones: Sequence[Utterance], text: str
) -> list[Utterance]:
    """Return words from their first phone to their last."""
    words = []
    for k, (at, length, start_s) in enumerate(events):
        until_s = events[k + 1][2] if k + 1 < len(events) else np.inf
        own = [p for p in phones if start_s - 1e-6 <= p.start_s < until_s - 1e-6]
        if own:
            words.append(Utterance(text[at - 1 : at - 1 + length], own[0].start_s, own[-1].end_s))
    return words

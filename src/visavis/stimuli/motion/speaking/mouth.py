"""How a speaker's mouth moves with the sound: by phones where their times are known, else by
loudness.

The faces here open the jaw and widen the lips; they cannot round them.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.speaking.speech import Speech, Utterance
from visavis.stimuli.sound import Waveform

RATE_HZ: Final = 100
MOST: Final = 0.55
"""The jaw opens so far at most."""
JAW_01: Final = {
    "aɑæɐʌɶ": 0.55,
    "ɛeɔoəɜɒøœɘɵɚɞ": 0.38,
    "iɪuʊyʏɨʉɯ": 0.18,
    "pbm": 0.0,
    "fvɱ": 0.04,
    "kgŋxɣhɦʁ": 0.20,
}
"""How far the jaw is open in a phone that begins with one of these letters of IPA (our choice)."""
OTHER_01: Final = 0.12
SPREAD_01: Final = {"iɪjeɛ": 0.22, "szʃʒtdn": 0.10}
"""How far lips are widened."""
CLOSED: Final = frozenset("pbm")
SILENCE: Final = frozenset("_: ")
MARKS: Final = "ˈˌ'ː"
PAUSE_S: Final = 0.06
LOUD_WINDOW_S: Final = 0.06


@dataclass(frozen=True, eq=False)
class Mouth:
    """How far the jaw is open and the lips are wide, 0 to 1, `RATE_HZ` times a second."""

    jaw_01: Vector
    spread_01: Vector

    def at(self, t_s: float) -> tuple[float, float]:
        """Return jaw and lips at a time; the mouth is shut before and after."""
        at = t_s * RATE_HZ
        grid = np.arange(len(self.jaw_01))
        jaw, spread = (
            float(np.interp(at, grid, column, 0.0, 0.0)) for column in (self.jaw_01, self.spread_01)
        )
        return jaw, spread


def mouth_of(speech: Speech) -> Mouth:
    """Return how the mouth moves with speech."""
    if speech.phones:
        return _of_phones(speech.phones, speech.sound.duration_s)
    return _of_loudness(speech.sound)


def _shape(phone: Utterance) -> tuple[float, float]:
    """Return jaw and lips of a phone."""
    letters = phone.text.strip(MARKS)
    if not letters or letters[0] in SILENCE:
        return 0.0, 0.0
    first = letters[0]
    jaw = next((value for of, value in JAW_01.items() if first in of), OTHER_01)
    spread = next((value for of, value in SPREAD_01.items() if first in of), 0.0)
    return jaw, spread


def _of_phones(phones: tuple[Utterance, ...], seconds: float) -> Mouth:
    """Go from the middle of each phone to that of the next; lips stay shut through closures."""
    times, shapes = [0.0], [(0.0, 0.0)]
    last_s = 0.0
    for phone in phones:
        if phone.start_s - last_s > PAUSE_S:
            times += [last_s + PAUSE_S / 2, max(phone.start_s - PAUSE_S / 2, times[-1])]
            shapes += [(0.0, 0.0), (0.0, 0.0)]
        last_s = phone.end_s
        shape, long_s = _shape(phone), phone.end_s - phone.start_s
        is_shut = phone.text.strip(MARKS)[:1] in CLOSED or shape == (0.0, 0.0)
        # A pause, and a p, b or m, is shut for its whole length, any other phone at its middle.
        inside = min(PAUSE_S, long_s / 3) if is_shut else long_s / 2
        ends = (
            (phone.start_s + inside, phone.end_s - inside) if is_shut else (phone.start_s + inside,)
        )
        for at in ends:
            times.append(max(at, times[-1]))
            shapes.append(shape)
    times.append(max(seconds, times[-1]))
    shapes.append((0.0, 0.0))
    grid = np.arange(int(np.ceil(seconds * RATE_HZ)) + 1) / RATE_HZ
    jaw, spread = (np.interp(grid, times, [shape[k] for shape in shapes]) for k in (0, 1))
    return Mouth(jaw, spread)


def _of_loudness(sound: Waveform) -> Mouth:
    count = int(np.ceil(sound.duration_s * RATE_HZ)) + 1
    power = np.concatenate([[0.0], np.cumsum((sound.samples.astype(np.float64) ** 2).mean(axis=1))])
    middle = np.arange(count) / RATE_HZ
    first, last = (
        np.clip(
            np.round((middle + side * LOUD_WINDOW_S / 2) * sound.rate_hz), 0, len(power) - 1
        ).astype(np.int64)
        for side in (-1, 1)
    )
    loud = np.sqrt((power[last] - power[first]) / np.maximum(1, last - first))
    top = float(np.quantile(loud[loud > 1e-4], 0.95)) if (loud > 1e-4).any() else 1.0
    return Mouth(MOST * np.sqrt(np.clip(loud / top, 0.0, 1.0)), np.zeros(count))

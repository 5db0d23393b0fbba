"""The clips of both studies: one speech in three parts, with three bodies, in four versions.

A lab that has its own speaker changes `SCRIPT`, `SPEAKERS` and `CHARACTER` here
(docs/gestures.md).
"""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Final

from visavis.lab.errors import DataError
from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.motion.clip import Clip, cut
from visavis.stimuli.motion.speaking.body_plan import Fill
from visavis.stimuli.motion.speaking.gesture_script import GestureScript, read_script
from visavis.stimuli.motion.speaking.mouth import Mouth, mouth_of
from visavis.stimuli.motion.speaking.performance import perform
from visavis.stimuli.motion.speaking.speaker import Speaker
from visavis.stimuli.motion.speaking.speech import speech_of
from visavis.stimuli.motion.speaking.synthetic_speaker import synthetic_speaker

SCRIPT: Final = Path(__file__).with_name("speech.yaml")
CHARACTER: Final = "male_02"
RATE_HZ: Final = 30.0
PARTS: Final = (1, 2, 3)
VERSIONS: Final = (1, 2, 3, 4)
"""Seeds of the postures; without a body all are the same film, shown four times."""
FILLS: Final[dict[str, Fill]] = {"still": "none", "corpus": "F", "holds": "I"}
"""Bodies: none (N of the source), gaps filled from the corpus (F), by interpolation (I)."""
PART_S: Final = 11.0


@cache
def speech() -> GestureScript:
    """Return the gestures of the whole speech."""
    return read_script(SCRIPT)


def speech_file() -> Path:
    """Return the recording that the script names.

    Raises:
        DataError: it names none.
    """
    recording = speech().speech
    if recording is None:
        raise DataError(f"{SCRIPT}: names no recording; give speech: FILE.wav")
    return recording


@cache
def mouth() -> Mouth:
    """Return how the lips move through the whole speech."""
    return mouth_of(speech_of(speech_file()))


@cache
def synthetic() -> Speaker:
    """Return a synthetic speaker, which stands in for one that a lab records."""
    return synthetic_speaker()[0]


SPEAKERS: Final[dict[str, Callable[[], Speaker]]] = {"synthetic": synthetic}
"""Whose bodies move; the studies show all of them."""


@cache
def whole(body: str, version: int, speaker: str = "synthetic") -> Clip:
    """Return the whole speech with a body."""
    build = build_of(default_casting(CHARACTER))
    own = SPEAKERS[speaker]()
    return perform(speech(), own, build, fill=FILLS[body], seed=version, rate_hz=RATE_HZ)


@cache
def clip_of(body: str, part: int, version: int, speaker: str = "synthetic") -> Clip:
    """Return a part of the speech; without a body every version is the first."""
    version = VERSIONS[0] if body == "still" else version
    frames = round(PART_S * RATE_HZ)
    return cut(whole(body, version, speaker), (part - 1) * frames, part * frames)


def heard_from_s(part: int, speech: str, late_ms: float) -> float:
    """Return the second of the speech with which a part's film begins: that of its gestures
    (`own`), or of the next part (`other`); the sound comes `late_ms` later than the body moves.
    """
    other = part % len(PARTS) + 1
    return PART_S * ((other if speech == "other" else part) - 1) - late_ms / 1000


@cache
def mouth_from(from_s: float) -> Callable[[float], tuple[float, float]]:
    """Return how the lips move with the speech from then on, whatever the body does."""
    return partial(_mouth_at, from_s)


def _mouth_at(from_s: float, t_s: float) -> tuple[float, float]:
    return mouth().at(t_s + from_s) if 0.0 <= t_s <= PART_S else (0.0, 0.0)

"""The clips of both studies: one speech in three parts, with three bodies, in four versions."""

from functools import cache
from pathlib import Path
from typing import Final

from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.motion.clip import Clip, cut
from visavis.stimuli.motion.speaking.body_plan import Fill
from visavis.stimuli.motion.speaking.gesture_script import GestureScript, read_script
from visavis.stimuli.motion.speaking.performance import perform
from visavis.stimuli.motion.speaking.synthetic_speaker import synthetic_speaker

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
    return read_script(Path(__file__).with_name("speech.yaml"))


@cache
def whole(body: str, version: int) -> Clip:
    """Return the whole speech with a body."""
    # The synthetic speaker stands in for one that a lab records.
    speaker, _ = synthetic_speaker()
    build = build_of(default_casting(CHARACTER))
    return perform(speech(), speaker, build, fill=FILLS[body], seed=version, rate_hz=RATE_HZ)


@cache
def clip_of(body: str, part: int, version: int) -> Clip:
    """Return a part of the speech; without a body every version is the first."""
    version = VERSIONS[0] if body == "still" else version
    frames = round(PART_S * RATE_HZ)
    return cut(whole(body, version), (part - 1) * frames, part * frames)

"""Motions as options name them: files, and the motions that Visavis computes."""

from pathlib import Path
from typing import Final

from visavis.lab.errors import UsageError
from visavis.stimuli.characters.character import Character
from visavis.stimuli.motion.baking import KINDS_BY_NAME, bake
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.motion_file import MOTION_SUFFIXES, read_motion
from visavis.stimuli.motion.people import Person

_SEED: Final = 5
MAX_SECONDS: Final = 600.0


def motion_on_character(name: str, who: Character, seconds: float, unit_m: float) -> Clip:
    """Return a motion on a character: a BVH file or clip, or `seconds` of one by its name.

    Raises:
        UsageError: the name is neither, or there is no such length.
        MotionError: the file cannot be read.
    """
    path = Path(name)
    if name in KINDS_BY_NAME:
        if not 0 < seconds <= MAX_SECONDS:
            raise UsageError(f"--seconds {seconds:g}; give more than 0, at most {MAX_SECONDS:g}")
        return bake(Person(build_of_character(who), KINDS_BY_NAME[name], seed=_SEED), seconds)
    if path.suffix.lower() in MOTION_SUFFIXES:
        return read_motion(path, who.skeleton, unit_m=unit_m)
    raise UsageError(
        f"{name!r} is neither a BVH file, a clip, nor a motion; motions are "
        f"{', '.join(KINDS_BY_NAME)}"
    )

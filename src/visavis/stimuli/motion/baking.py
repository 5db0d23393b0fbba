"""Turn procedural motion of one person into a clip."""

from typing import Final

import numpy as np

from visavis.stimuli.gaze.turning import Gaze
from visavis.stimuli.motion import kinds
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.people import PeopleMotion, Person

KINDS_BY_NAME: Final[dict[str, kinds.Kind]] = {
    "stand": kinds.Idle(),
    "sit": kinds.Sit(),
    "wave": kinds.Wave(hand="right"),
    "wave_both": kinds.Wave(hand="both"),
    "phone": kinds.Phone(),
    "text": kinds.Text(hand="right"),
    "board": kinds.WatchBoard(),
    "talk": kinds.Talk(),
    "crouch": kinds.Crouch(),
    "walk": kinds.Walk(),
    "run": kinds.Run(),
}
"""Procedural motions by the name a command line takes."""


def bake(
    person: Person,
    duration_s: float,
    *,
    rate_hz: float = 30.0,
    start_s: float = 0.0,
    gaze: Gaze | None = None,
) -> Clip:
    """Return what a person does for a while as a clip, a frame every 1 / `rate_hz` seconds.

    Raises:
        MotionError: the duration holds no frame.
    """
    n = round(duration_s * rate_hz) + 1
    if n < 2:
        raise MotionError(f"{duration_s} s at {rate_hz} Hz hold no motion; ask for more")
    motion = PeopleMotion((person,))
    poses = [motion.at(start_s + k / rate_hz, gaze) for k in range(n)]
    return Clip(
        person.build.skeleton,
        1.0 / rate_hz,
        np.array([p.root_m[0] for p in poses]),
        np.array([p.orientation_wxyz[0] for p in poses]),
    )

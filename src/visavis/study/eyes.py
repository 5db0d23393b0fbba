"""What a scene may ask of the eyes of the person who counts."""

from typing import Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.scene import Agent

EYES: Final = ("directed", "averted")
NO_GAZE: Final = "none"
"""What `eyes` says of somebody played by a figure without gaze."""
AVERTED_DEG: Final = 25.0


def check_eyes(scene: str, agent: Agent, eyes: str) -> None:
    """Raise `DesignError` if an agent's eyes cannot do what a scene asks, or are not asked."""
    if agent.has_gaze and eyes == NO_GAZE:
        raise DesignError(
            f'scene {scene}: eyes is "none", but {agent.character} has gaze; write '
            f"{' or '.join(EYES)}"
        )
    if not agent.has_gaze and eyes != NO_GAZE:
        raise DesignError(
            f"scene {scene}: {agent.character} was imported without gaze, so its eyes cannot be "
            f'{eyes}; write eyes="none", or let somebody whose eyes turn play this part'
        )


def past_m(eye_m: Vector, facing: Vector) -> Vector:
    """Return a point beside the participant, `AVERTED_DEG` outwards from where a head faces."""
    outside = 1.0 if eye_m[0] >= 0 else -1.0
    angle = np.radians(outside * AVERTED_DEG)
    c, s = np.cos(angle), np.sin(angle)
    x, z = facing[0] * c + facing[2] * s, -facing[0] * s + facing[2] * c
    point_m: Vector = eye_m + 3.0 * np.array([x, facing[1] - 0.08, z])
    return point_m

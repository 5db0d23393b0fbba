"""How high the cushion is on which a body sits."""

from typing import Final

import numpy as np

from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.skinning import skin_vertices
from visavis.stimuli.motion.skeleton import Placement

SAT_ON: Final = tuple(PART_INDEX[name] for name in ("torso", "left_thigh", "right_thigh"))
BELOW_HIPS_M: Final = 0.20
"""How far from the hips it reaches."""
SINK_M: Final = 0.02
"""How deep somebody sinks into a cushion."""


def cushion_top_m(character: Character, body: Placement) -> float | None:
    """Return the height in world of the cushion that a placed body sinks into; None of a figure
    without flesh there.
    """
    mesh = character.levels[0]
    rows = np.unique(mesh.triangles[np.isin(mesh.triangle_part, SAT_ON)])
    points = skin_vertices(mesh, character.skeleton, body)[rows]
    hips = [character.skeleton.index(f"{side}_upper_leg") for side in ("left", "right")]
    apart_m = points - body.position_m[hips].mean(axis=0)
    below = points[np.hypot(apart_m[:, 0], apart_m[:, 2]) < BELOW_HIPS_M, 1]
    return float(below.min()) + SINK_M if len(below) else None

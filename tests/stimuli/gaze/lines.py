"""Where drawn eyes look: the lines of gaze of a picture's people."""

import numpy as np

from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture


def lines_of_gaze(picture: Picture) -> tuple[Vector, Vector]:
    """Return centres (n, 2, 3) of everybody's eyes and unit lines of gaze (n, 2, 3) from there, in
    world, left eye first. With the picture of a recorded moment this is the truth of that moment.
    """
    n, people = len(picture.cast), picture.people
    centres, lines = np.empty((n, 2, 3)), np.empty((n, 2, 3))
    ahead = np.tile([0.0, 0.0, -1.0], (2, 1))
    for i, character in enumerate(picture.cast):
        body = forward(character.skeleton, people.root_m[i], people.orientation_wxyz[i])
        eyes = [character.skeleton.index(f"{side}_eye") for side in ("left", "right")]
        centres[i] = body.position_m[eyes]
        lines[i] = rotate(body.orientation_wxyz[eyes], ahead)
    return centres, lines

"""Where a thing is that somebody holds, such as the phone of `Phone` and `Text`."""

from typing import Literal

import numpy as np

from visavis.lab.geometry import Pose, rotate
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.build import Build
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import PosedPeople

FROM_PALM_M = 0.024
"""How far the middle of a held phone lies from the axis of the hand."""


def held_in_hand(build: Build, people: PosedPeople, i: int, hand: Literal["left", "right"]) -> Pose:
    """Return the pose in world of a thing lying in the palm of person `i`.

    Its own axes: −x along the fingers of a left hand, +x of a right one; −y away from the palm.
    """
    skeleton = build.skeleton
    body = forward(skeleton, people.root_m[i], people.orientation_wxyz[i])
    row = skeleton.index(f"{hand}_hand")
    along = -1.0 if hand == "left" else 1.0
    in_palm = np.array([along * 1.05 * float(build.lengths_m[p.B_HAND]), -FROM_PALM_M, 0.0])
    turn = body.orientation_wxyz[row]
    return Pose(body.position_m[row] + rotate(turn, in_palm), turn)

"""How near arms come to the own body, by the capsules that collisions are found with."""

import numpy as np

from visavis.lab.body_joints import BODY_JOINTS
from visavis.stimuli.contact.body import capsule_body
from visavis.stimuli.contact.touch import segment_distance
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.skeleton import forward

LOWER_ARM = ("lower_arm", "hand")
BODY = ("hips", "spine", "upper_chest", "neck", "head", "left_upper_leg", "right_upper_leg")


def clearance_m(clip: Clip, stature_m: float, every: int = 1) -> tuple[float, str, float]:
    """Return the least distance between lower arms and body, or between both arms, with whose it is
    and when in seconds; negative inside.
    """
    body = capsule_body(stature_m)
    frames = np.arange(0, len(clip.root_m), every)
    placed = forward(clip.skeleton, clip.root_m[frames], clip.orientation_wxyz[frames])
    rows = [clip.skeleton.index(name) for name in BODY_JOINTS]
    starts, ends = body.posed(placed.position_m[:, rows], placed.orientation_wxyz[:, rows])
    pairs = [(f"{s}_{a}", b) for s in ("left", "right") for a in LOWER_ARM for b in BODY]
    pairs += [(f"left_{a}", f"right_{b}") for a in LOWER_ARM for b in LOWER_ARM]
    point = np.empty(3)
    least = (np.inf, "", 0.0)
    for one, other in pairs:
        a, b = body.joint.index(one), body.joint.index(other)
        touch_m = body.radius_m[a] + body.radius_m[b]
        for f, frame in enumerate(frames):
            square = segment_distance(starts[f, a], ends[f, a], starts[f, b], ends[f, b], point)
            gap_m = float(np.sqrt(square) - touch_m)
            if gap_m < least[0]:
                least = (gap_m, f"{one} {other}", float(frame * clip.frame_s))
    return least

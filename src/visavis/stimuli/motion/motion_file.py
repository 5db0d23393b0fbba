"""Read a motion file of either kind for a character: BVH is retargeted, our own clips are worn."""

from pathlib import Path

from visavis.stimuli.motion.bvh import read_bvh
from visavis.stimuli.motion.bvh_clip import clip_of_bvh
from visavis.stimuli.motion.clip import Clip, standing_on_floor, worn_by
from visavis.stimuli.motion.clip_file import read_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.retarget import retarget
from visavis.stimuli.motion.skeleton import Skeleton

MOTION_SUFFIXES = (".bvh", ".npz")


def read_motion(path: Path, skeleton: Skeleton, *, unit_m: float = 0.01) -> Clip:
    """Return the motion of a file on a character's skeleton, its floor at y = 0.

    `unit_m` is the unit of a BVH file in metres; such files do not say.

    Raises:
        MotionError: the file is missing, broken, or of neither kind.
    """
    if path.suffix.lower() == ".bvh":
        return standing_on_floor(retarget(clip_of_bvh(read_bvh(path), unit_m=unit_m), skeleton))
    if path.suffix.lower() == ".npz":
        return worn_by(read_clip(path), skeleton)
    raise MotionError(f"{path} is neither a BVH file nor a clip (.bvh, .npz)")

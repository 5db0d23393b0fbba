"""Read a motion file of either kind for a character: BVH is retargeted, our own clips are worn."""

from collections.abc import Callable, Mapping
from pathlib import Path

from visavis.stimuli.motion.bvh import read_bvh
from visavis.stimuli.motion.bvh_clip import clip_of_bvh
from visavis.stimuli.motion.clip import Clip, standing_on_floor, worn_by
from visavis.stimuli.motion.clip_file import read_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.joint_names import match_joints
from visavis.stimuli.motion.oddities import oddities_of
from visavis.stimuli.motion.retarget import retarget
from visavis.stimuli.motion.skeleton import Skeleton

MOTION_SUFFIXES = (".bvh", ".npz")


def read_motion(
    path: Path,
    skeleton: Skeleton,
    *,
    unit_m: float = 0.01,
    joint_names: Mapping[str, str] | None = None,
    tell: Callable[[str], None] | None = None,
) -> Clip:
    """Return the motion of a file on a character's skeleton, its floor at y = 0.

    `unit_m` is the unit of a BVH file in metres; such files do not say. `joint_names` gives the
    file's names for some of our joints, where they are of no known convention. `tell` takes what
    is odd about the motion: mirrored axes, frames of zeros, speeds beyond a person's.

    Raises:
        MotionError: the file is missing, broken, of neither kind, or its joints are not known.
    """
    if path.suffix.lower() == ".bvh":
        bvh = read_bvh(path)
        source = clip_of_bvh(bvh, unit_m=unit_m)
        names = match_joints(source.skeleton, joint_names)
        motion = retarget(source, skeleton, joint_map=names)
        if tell is not None:
            for text in oddities_of(bvh, source, names, motion):
                tell(f"{path}: {text}")
        return standing_on_floor(motion)
    if path.suffix.lower() == ".npz":
        return worn_by(read_clip(path), skeleton)
    raise MotionError(f"{path} is neither a BVH file nor a clip (.bvh, .npz)")

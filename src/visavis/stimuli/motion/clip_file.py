"""Clips in our own format: one .npz file with skeleton, times and turns, nothing lost."""

from pathlib import Path
from typing import Final

import numpy as np

from visavis.lab.plain_files import read_arrays
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton

FORMAT: Final = "visavis-clip-1"


def write_clip(path: Path, clip: Clip) -> None:
    """Write a clip; refuses to replace a file.

    Raises:
        MotionError: there is a file of that name already.
    """
    if path.exists():
        raise MotionError(f"{path} exists; choose another name or move it away")
    with path.open("xb") as file:
        np.savez_compressed(
            file,
            format=np.array(FORMAT),
            names=np.array(clip.skeleton.names),
            parents=clip.skeleton.parents,
            offsets_m=clip.skeleton.offsets_m,
            tips_m=clip.skeleton.tips_m,
            frame_s=np.array(clip.frame_s),
            root_m=clip.root_m,
            orientation_wxyz=clip.orientation_wxyz,
            looped=np.array(clip.is_loop),
            travel_m=np.array(clip.travel_m),
        )


def read_clip(path: Path) -> Clip:
    """Read a clip written by `write_clip`.

    Raises:
        MotionError: the file is missing, broken, or of another format.
    """
    try:
        file = read_arrays(path)
        if str(file["format"]) != FORMAT:
            raise MotionError(f"{path} is of format {file['format']}; this reads {FORMAT}")
        skeleton = Skeleton(
            tuple(str(n) for n in file["names"]),
            file["parents"],
            file["offsets_m"],
            file["tips_m"],
        )
        x, y, z = file["travel_m"].tolist()
        return Clip(
            skeleton,
            float(file["frame_s"]),
            file["root_m"],
            file["orientation_wxyz"],
            bool(file["looped"]),
            (x, y, z),
        )
    except (OSError, KeyError, TypeError, ValueError) as problem:
        raise MotionError(
            f"{path} cannot be read as a clip ({problem}); give a file that `visavis warp` or "
            "write_clip wrote, or a BVH file"
        ) from problem

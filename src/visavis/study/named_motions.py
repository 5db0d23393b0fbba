"""What a person of a scene does, by name: a motion with its settings, or a clip's path."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import DesignError
from visavis.lab.yaml_lines import did_you_mean
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.motion.kinds import (
    Crouch,
    Idle,
    Kind,
    Phone,
    Recorded,
    Sit,
    Talk,
    Text,
    Walk,
    WatchBoard,
    Wave,
)
from visavis.stimuli.motion.motion_file import MOTION_SUFFIXES, read_motion
from visavis.study.arguments import argument_names

MOTIONS: Final[Mapping[str, type[Kind]]] = {
    "idle": Idle,
    "wave": Wave,
    "talk": Talk,
    "phone": Phone,
    "text": Text,
    "crouch": Crouch,
    "walk": Walk,
    "sit": Sit,
    "watch": WatchBoard,
}
"""Motions of a person by name; any other text is the path of a clip (.npz or .bvh)."""


def motion_options(name: str) -> tuple[str, ...]:
    """Return the settings of a motion, or of a clip's, by name."""
    kind = MOTIONS.get(name)
    return argument_names(read_motion)[2:] if kind is None else argument_names(kind)


def motion_of(name: str, options: Mapping[str, Any], folder: Path, character: str) -> Kind:
    """Return a motion with its settings; a clip's file lies in the folder.

    Raises:
        DesignError: there is no such motion, or it takes no such setting.
        MotionError: the clip cannot be read, or a setting is out of range.
    """
    if name in MOTIONS:
        try:
            return MOTIONS[name](**options)
        except TypeError as error:
            raise DesignError(f"motion {name}: {error}") from error
    path = folder / name
    if path.suffix.lower() not in MOTION_SUFFIXES:
        raise DesignError(
            f"there is no motion {name!r}{did_you_mean(name, MOTIONS)}; the path of a clip "
            "(.npz, .bvh) will do, too"
        )
    return Recorded(read_motion(path, default_casting(character).skeleton, **options))

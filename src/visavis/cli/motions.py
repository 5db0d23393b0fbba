"""Motions as options name them: files, and the motions that Visavis computes."""

from pathlib import Path
from typing import Annotated, Final, TypeAlias

import typer

from visavis.cli.app import errors, verbatim
from visavis.lab.errors import UsageError
from visavis.lab.yaml_lines import ProblemsError, read_document
from visavis.stimuli.characters.character import Character
from visavis.stimuli.motion.baking import KINDS_BY_NAME, bake
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.motion_file import MOTION_SUFFIXES, read_motion
from visavis.stimuli.motion.people import Person

JointMapOption: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--joint-map", help="YAML file of joints of ours and the file's bones, where names differ."
    ),
]
_SEED: Final = 5
MAX_SECONDS: Final = 600.0


def motion_on_character(
    name: str, who: Character, seconds: float, unit_m: float, joint_map: Path | None = None
) -> Clip:
    """Return a motion on a character: a BVH file or clip, or `seconds` of one by its name.

    `joint_map` names bones of a BVH file, see `read_joint_map`; what is odd about it is printed.

    Raises:
        UsageError: the name is neither, or there is no such length.
        MotionError: the file cannot be read.
    """
    path = Path(name)
    if name in KINDS_BY_NAME:
        if not 0 < seconds <= MAX_SECONDS:
            raise UsageError(f"--seconds {seconds:g}; give more than 0, at most {MAX_SECONDS:g}")
        return bake(Person(build_of_character(who), KINDS_BY_NAME[name], seed=_SEED), seconds)
    if path.suffix.lower() in MOTION_SUFFIXES:
        names = None if joint_map is None else read_joint_map(joint_map)
        return read_motion(path, who.skeleton, unit_m=unit_m, joint_names=names, tell=_tell)
    raise UsageError(
        f"{name!r} is neither a BVH file, a clip, nor a motion; motions are "
        f"{', '.join(KINDS_BY_NAME)}"
    )


def _tell(text: str) -> None:
    errors.print(f"[yellow]{verbatim(text)}[/]", soft_wrap=True)


def read_joint_map(path: Path) -> dict[str, str]:
    """Read which bone of a file of a character or motion stands for which of our joints.

    Raises:
        UsageError: the file is not a list of names.
        ProblemsError: a joint is given twice.
    """
    document = read_document(path)
    data = document.data
    if document.problems:
        raise ProblemsError(path, list(document.problems))
    if not isinstance(data, dict) or not all(isinstance(v, str) for v in data.values()):
        raise UsageError(f"{path}: write one line a joint, such as `left_upper_arm: Bone_014`")
    return {str(ours): theirs for ours, theirs in data.items()}

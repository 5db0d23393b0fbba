"""Which character plays which part."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Final

from visavis.lab.errors import DesignError
from visavis.stimuli.characters.cast import cast_names, load_cast, load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.outfits import in_other_clothes
from visavis.stimuli.characters.storage import FIGURE_FILES, read_character
from visavis.stimuli.motion.build import Build, build_of_character

Casting = Callable[[str], Character]
"""Finds the character for the name a study uses ("female_03")."""


@dataclass(frozen=True)
class Member:
    """Somebody of a lab's own cast; `sha256` (hex) of the imported file, empty for people who
    come with Visavis.
    """

    name: str
    sha256: str


@dataclass(eq=False)
class _InForce:
    """The cast of this process; an empty one stands for the people who come with Visavis."""

    members: tuple[Member, ...] = ()
    library: Path | None = None
    is_used: bool = field(default=False)


_in_force: Final = _InForce()


def members_of(entries: Sequence[str], folder: Path, library: Path) -> tuple[Member, ...]:
    """Return the members of a cast as named in a configuration: people who come with Visavis,
    people imported into `library`, or folders (from `folder`) of figures that were.

    Raises:
        DesignError: somebody is not there, is named twice, or has not been imported.
    """
    names: list[str] = []
    for entry in entries:
        there = (folder / Path(entry).expanduser()).resolve()
        if entry in cast_names() or not there.is_dir():
            names.append(entry)
            continue
        figures = sorted(
            path.stem for path in there.iterdir() if path.suffix.lower() in FIGURE_FILES
        )
        if not figures:
            raise DesignError(
                f"cast: {there} holds no .glb, .vrm or .fbx file; give the folder that holds them"
            )
        names += figures
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DesignError(f"cast: {', '.join(twice)} named twice; name everybody once")
    missing = [n for n in names if n not in cast_names() and not _file(library, n).exists()]
    if missing:
        raise DesignError(
            f"cast: nobody called {', '.join(missing)} has been imported into {library}; run "
            "`visavis character import` with their files, or name a folder of figures or some of "
            f"who is there: {', '.join([*_library_names(library), *cast_names()])}"
        )
    return tuple(
        Member(name, "" if name in cast_names() else _sha256(_file(library, name)))
        for name in names
    )


def use_cast(members: Sequence[Member], library: Path) -> None:
    """Set the people who play the numbered parts, in this order; none for the default cast.

    Raises:
        DesignError: others have been cast in this process already, whose measures are kept.
    """
    names = tuple(members)
    if names == _in_force.members:
        if not _in_force.is_used:
            _in_force.library = library
        return
    if _in_force.is_used:
        raise DesignError(
            "sessions with different casts cannot be shown or measured by one command; take those "
            "of each cast apart, where the lab_config.yaml in force names that cast or none"
        )
    _in_force.members, _in_force.library = names, library


@cache
def default_casting(part: str) -> Character:
    """Return the character of a part: a name of the cast, or the n-th woman or man of the active
    cast.

    Where a lab has a cast of its own, its n-th woman plays the n-th of those who come along, unless
    that one is in the cast herself. Figures without gaze play under their names alone.

    Numbers beyond the cast start again in other clothes: "male_07" is the first man so dressed.

    Raises:
        DesignError: the part is neither, or the cast has nobody to play it.
    """
    _in_force.is_used = True
    if part in cast_names():
        if not _in_force.members or part in {m.name for m in _in_force.members}:
            return load_character(part)
        part = _number_name(part)
    gender, _, number = part.partition("_")
    if gender not in ("female", "male") or not number.isdigit() or int(number) < 1:
        for member in _in_force.members:
            if member.name == part:
                return _person(member)
        raise DesignError(
            f"nobody plays {part!r}; use a name of the cast ({', '.join(_names())}) or female_01, "
            "male_01 and so on; people you imported are of it once `cast` in lab_config.yaml names "
            "them"
        )
    candidates = numbered_people(gender)
    if not candidates:
        error = f"the cast in lab_config.yaml has no {gender} person to play {part}; add one"
        if bystanders := ", ".join(c.name for c in _people() if not c.has_gaze):
            error += f" with gaze: without it ({bystanders}) figures play where a scene names them"
        raise DesignError(error)
    outfit, who = divmod(int(number) - 1, len(candidates))
    return in_other_clothes(candidates[who], outfit)


def numbered_people(gender: str) -> tuple[Character, ...]:
    """Return the women or men ("female", "male") of the active cast who play numbered parts."""
    return tuple(c for c in _people() if c.gender == gender and c.has_gaze)


def _number_name(name: str) -> str:
    """Return the number of a person who comes with Visavis: "anna" is "female_01"."""
    gender = load_character(name).gender
    same_gender = [c.name for c in load_cast() if c.gender == gender]
    return f"{gender}_{same_gender.index(name) + 1:02d}"


def _names() -> tuple[str, ...]:
    return tuple(dict.fromkeys((*(m.name for m in _in_force.members), *cast_names())))


def _people() -> tuple[Character, ...]:
    if not _in_force.members:
        return load_cast()
    return tuple(_person(member) for member in _in_force.members)


@cache
def _person(member: Member) -> Character:
    if not member.sha256:
        return load_character(member.name)
    library = _in_force.library
    assert library is not None  # noqa: S101 - use_cast gives both
    path = _file(library, member.name)
    if not path.exists():
        raise DesignError(
            f"{path} is not there, but this cast has {member.name} in it; import the figure again"
        )
    if _sha256(path) != member.sha256:
        raise DesignError(
            f"{path} is not the {member.name} that was recorded (SHA-256 {member.sha256[:12]}…); "
            "put the file of that day back"
        )
    return read_character(path)


def _library_names(library: Path) -> list[str]:
    return sorted(path.stem for path in library.glob("*.npz"))


def _file(library: Path, name: str) -> Path:
    return library / f"{name}.npz"


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def build_of(character: Character) -> Build:
    """Return a character's build, measured once."""
    return build_of_character(character)

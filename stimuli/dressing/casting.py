"""Which character plays which part."""

from collections.abc import Callable
from functools import cache

from lab.errors import DesignError
from stimuli.characters.cast import cast_names, load_cast, load_character
from stimuli.characters.character import Character
from stimuli.characters.outfits import in_other_clothes
from stimuli.motion.build import Build, build_of_character

Casting = Callable[[str], Character]
"""Finds the character for the name a study uses ("female_03")."""


@cache
def default_casting(part: str) -> Character:
    """Return who plays a part: a name of the cast, or the n-th woman or man of it.

    Numbers beyond the cast start again in other clothes: "male_07" is the first man so dressed.

    Raises:
        DesignError: the part is neither.
    """
    if part in cast_names():
        return load_character(part)
    gender, _, number = part.partition("_")
    if gender not in ("female", "male") or not number.isdigit() or int(number) < 1:
        raise DesignError(
            f"nobody plays {part!r}; use a name of the cast ({', '.join(cast_names())}) or "
            "female_01, male_01 and so on"
        )
    candidates = [c for c in load_cast() if c.gender == gender]
    outfit, who = divmod(int(number) - 1, len(candidates))
    return in_other_clothes(candidates[who], outfit)


@cache
def build_of(character: Character) -> Build:
    """Return a character's build, measured once."""
    return build_of_character(character)

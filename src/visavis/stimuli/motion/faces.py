"""Expressions of faces: which shapes go how far, from when on and until when."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.lab.kinds import of_kinds
from visavis.lab.yaml_lines import did_you_mean
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rhythm_kernels import ease

EXPRESSIONS: Final[Mapping[str, Mapping[str, float]]] = {
    "neutral": {},
    "smile": {"smile": 1.0},
    "frown": {"smile": -0.6},
    "open_mouth": {"jaw_open": 0.4},
}
"""How far shapes of a face (`MORPHS`) go; a frown draws the corners of the mouth down."""
FULL_EXPRESSIONS: Final[Mapping[str, Mapping[str, float]]] = {"frown": {"frown": 1.0}}
"""What goes instead in figures that have shapes of their own for an expression."""
SHAPES_OF_FILES: Final = {
    "smile": "mouthSmileLeft and mouthSmileRight",
    "jaw_open": "jawOpen",
}
"""What shapes that faces need are called in files, for messages."""
CHANGE_S: Final = 0.5
"""How long a face takes to change."""


@dataclass(frozen=True)
@of_kinds()
class Face:
    """An expression, or several joined by "+" that are made at once, how much, and when.

    One from 0 s on is there at the onset; a later one comes within `CHANGE_S`, and goes within as
    long from `until_s` on. It `is_full` on a figure that has shapes of its own for it (`face_of`).

    Raises:
        MotionError: there is no such expression, or a number is out of range.
    """

    expression: str = "neutral"
    strength_01: float = 1.0
    from_s: float = 0.0
    until_s: float = np.inf
    is_full: bool = False

    def __post_init__(self) -> None:
        for name in self.parts:
            if name not in EXPRESSIONS:
                raise MotionError(f"no face {name!r}{did_you_mean(name, EXPRESSIONS)}")
        if not (0.0 <= self.strength_01 <= 1.0 and 0.0 <= self.from_s < np.inf):
            raise MotionError(
                f"face {self.expression} with strength {self.strength_01:g} from {self.from_s:g} s "
                "on; give 0 to 1, and a time from the onset"
            )
        if not self.until_s > self.from_s:
            raise MotionError(
                f"face {self.expression} from {self.from_s:g} until {self.until_s:g} s; give a "
                "later end"
            )

    @property
    def parts(self) -> tuple[str, ...]:
        """The expressions that are made at once."""
        return tuple(name.strip() for name in self.expression.split("+"))

    def weights(self, t_s: float) -> Vector:
        """Return how far each shape of `MORPHS` goes at a time after the onset."""
        share = 1.0 if self.from_s == 0.0 else ease((t_s - self.from_s) / CHANGE_S)
        share *= 1.0 - ease((t_s - self.until_s) / CHANGE_S)
        weights = np.zeros(len(MORPHS))
        expressions = {**EXPRESSIONS, **FULL_EXPRESSIONS} if self.is_full else EXPRESSIONS
        for name in self.parts:
            for shape, weight in expressions[name].items():
                weights[MORPHS.index(shape)] += share * self.strength_01 * weight
        return np.clip(weights, -1.0, 1.0)


def face_of(character: Character, face: Face) -> Face:
    """Return a face as a character makes it: by shapes of its own for it, where it has them."""
    shapes = {shape for name in face.parts for shape in FULL_EXPRESSIONS.get(name, ())}
    has_shapes = bool(shapes) and shapes <= character.levels[0].morphs.keys()
    return replace(face, is_full=True) if has_shapes else face


def shape_lacking(character: Character, expression: str) -> str | None:
    """Return what the shape is called in files that a character would need for an expression; None
    if there is nothing that it lacks.
    """
    face, shapes = face_of(character, Face(expression)), character.levels[0].morphs
    own = FULL_EXPRESSIONS if face.is_full else {}
    needs = [shape for name in face.parts if name not in own for shape in EXPRESSIONS[name]]
    return next((SHAPES_OF_FILES[shape] for shape in needs if shape not in shapes), None)


NEUTRAL: Final = Face()

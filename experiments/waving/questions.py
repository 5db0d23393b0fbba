"""The two questions after every trial, as boards that stand before the participant."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from lab.geometry import Pose
from stimuli.picture import Panel
from stimuli.scenes.office import CUSTOMERS

WHO_TEXT: Final = "According to you, to whom was the wave directed?"
REALISM_TEXT: Final = "How realistic was this interaction? 1 is low, 9 is high."
BOARD_SIZE_M: Final = (1.5, 0.5)
BOARD_AT_M: Final = (0.0, 1.12, -1.7)
UPRIGHT: Final = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Question:
    """A board and what each of its choices means."""

    question_id: str
    panel: Panel
    meanings: tuple[str, ...]


def _board(text: str, choices: tuple[str, ...]) -> Panel:
    return Panel(text, choices, Pose(np.array(BOARD_AT_M), np.array(UPRIGHT)), BOARD_SIZE_M)


def who_question(participant_place: str) -> Question:
    """Return the question for the addressee: five places from left to right, one's own marked."""
    names = tuple(c.name for c in CUSTOMERS)
    own = names.index(participant_place)
    labels = []
    for i in range(len(names)):
        steps = abs(i - own)
        side = "left" if i < own else "right"
        labels.append("me" if steps == 0 else side if steps == 1 else f"{side} {steps}")
    return Question("who", _board(WHO_TEXT, tuple(labels)), names)


def realism_question() -> Question:
    """Return the question for realism, 1 to 9."""
    numbers = tuple(str(n) for n in range(1, 10))
    return Question("realism", _board(REALISM_TEXT, numbers), numbers)

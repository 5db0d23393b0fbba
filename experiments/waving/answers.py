"""What a simulated participant of the waving study answers to the questionnaires."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from experiments.waving.judgement import Person

EYES_ONLY: Final = "I looked at the eyes."
STRATEGIES: Final = (
    "Mostly the eyes, and how the body was turned when they were hard to see.",
    "Eyes first, then the direction of the head and of the hand.",
    "Where the body and the raised hand pointed, and the eyes if they were close enough.",
)
EYES_ONLY_01: Final = 0.25
"""Share of the source's participants who named the eyes alone; all named them."""
COMMENTS: Final = (
    "Some of them were hard to see behind the others.",
    "It felt natural to be waved at.",
    "On the right I could hardly tell.",
)


def answer_question(
    person: Person, question_id: str, options: Sequence[str], rng: np.random.Generator
) -> str | None:
    """Return an answer in the words of the options, or free text; None leaves it out."""
    if question_id == "age":
        return str(person.age)
    if question_id == "gender":
        return person.gender if person.gender in options else None
    if question_id == "strategy":
        if rng.random() < EYES_ONLY_01:
            return EYES_ONLY
        return STRATEGIES[int(rng.integers(len(STRATEGIES)))]
    if question_id == "comment":
        return None if rng.random() < 0.5 else COMMENTS[int(rng.integers(len(COMMENTS)))]
    return options[int(rng.integers(len(options)))] if options else None

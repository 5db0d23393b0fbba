"""How a simulated participant answers; nothing in it depends on vibration.

Presence and embodiment are drawn round the person's own level, with a spread per answer, so
that the published means come out without any effect of the block (Berton et al. 2020 found
none).
"""

from collections.abc import Sequence

import numpy as np

from visavis.experiments.crowd.participant.traits import Person
from visavis.people.person import plain_answer

_SUBSCALES = ("agency", "change", "ownership")
_NOISE = 0.6


def answer_question(
    person: Person, question_id: str, options: Sequence[str], rng: np.random.Generator
) -> str | None:
    """Return an answer in the words of the options, or a number; None to leave it out."""
    if question_id.startswith("presence"):
        return _rating(person.presence, options, rng)
    for subscale, level in zip(_SUBSCALES, person.embodiment, strict=True):
        if question_id.startswith(subscale):
            return _rating(float(level), options, rng)
    return plain_answer(person.age, person.sex, question_id, options, rng)


def _rating(level: float, options: Sequence[str], rng: np.random.Generator) -> str:
    category = round(level + _NOISE * rng.standard_normal())
    return options[min(max(category, 1), len(options)) - 1]

"""Answers of a simulated participant: questionnaire items, age, a comment."""

from collections.abc import Sequence

import numpy as np

from visavis.people.observer.temperament import Population, Temperament

LSAS_ITEMS = 48
ITEM_LOADING = 0.62
"""C: correlation of an item's latent value with the trait; gives a total with alpha near .95."""
ITEM_SD = 0.95
"""C: spread of an item's latent value on the 0-3 scale, before rounding."""
COMMENTS_CALM = (
    "I liked looking at the people, some of them seemed to look back.",
    "The ones in front felt real. I mostly looked around.",
    "After a while I waited to see who would look at me.",
)
COMMENTS_TENSE = (
    "It was uncomfortable when one of them kept staring, I looked away.",
    "I did not like being watched and tried to look at the room instead.",
    "Some of them felt a little creepy.",
)


def _rate_item(who: Temperament, population: Population, rng: np.random.Generator, top: int) -> int:
    """Answer an item on a scale 0..top so that totals follow the trait."""
    middle = population.anxiety.lsas_mean / LSAS_ITEMS
    slope = population.anxiety.lsas_sd / LSAS_ITEMS
    noise = ITEM_SD * np.sqrt(1 - ITEM_LOADING**2) * rng.standard_normal()
    latent = middle + slope * who.anxiety + noise
    return int(np.clip(round(latent * top / 3), 0, top))


def _closest(options: Sequence[str], *words: str) -> str | None:
    """Return the first option that is or begins with one of the words."""
    for word in words:
        for option in options:
            if option.strip().lower().startswith(word):
                return option
    return None


def answer_question(
    who: Temperament,
    population: Population,
    question_id: str,
    prompt: str,
    options: Sequence[str],
    rng: np.random.Generator,
) -> str | None:
    """Answer one question; None leaves it out.

    Understands by words in the identifier and the prompt: age, gender or sex, experience with
    virtual reality or games, comments. Every other question with ordered options is answered as
    an item of the anxiety scale; free text it does not understand is left out.
    """
    question_text = f"{question_id} {prompt}".lower()
    words = set(question_text.replace("_", " ").replace(".", " ").replace("?", " ").split())
    if not options:
        if words & {"age", "old", "years"}:
            return str(who.age_years)
        if words & {"comment", "comments", "remark", "remarks", "notice", "noticed", "anything"}:
            pool = COMMENTS_TENSE if who.anxiety > 0.4 else COMMENTS_CALM
            return None if rng.random() < 0.4 else pool[int(rng.integers(len(pool)))]
        if words & {"gender", "sex"}:
            return "female" if who.is_female else "male"
        return None
    if words & {"gender", "sex"}:
        first = ("female", "woman", "f") if who.is_female else ("male", "man", "m", "homme")
        return _closest(options, *first) or options[0]
    if words & {"experience", "vr", "game", "games", "headset"} and len(options) >= 2:
        level = who.games_experience if words & {"game", "games"} else who.vr_experience
        return options[round((level - 1) / 4 * (len(options) - 1))]
    if words & {"handedness", "handed", "hand", "dominant"}:
        return _closest(options, "right" if rng.random() < 0.9 else "left") or options[0]
    if words & {"vision", "glasses", "lenses", "sight"}:
        return _closest(options, "normal", "none", "no") or options[0]
    if (yes_no := _closest(options, "yes")) is not None and len(options) == 2:
        return yes_no
    return options[_rate_item(who, population, rng, len(options) - 1)]

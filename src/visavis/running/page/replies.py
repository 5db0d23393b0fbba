"""Checks of what a page replies to a step, before any of it is accepted."""

import re
from collections.abc import Mapping
from typing import Any, Final

from visavis.running.page.flat import check_distance, check_shown
from visavis.running.page.steps import (
    BY_LIMIT,
    MOULDER,
    PRELOAD,
    WAYS,
    PageError,
    PageStep,
    count,
    mapping,
    number,
    read_drawn,
    read_film,
)
from visavis.running.page.streams import MAX_RATE_HZ

NUMBER: Final = re.compile(r"-?[0-9]{1,12}([.,][0-9]{1,12})?")
TYPED_DIGITS: Final = re.compile(r"[0-9]{1,8}")
MAX_TEXT: Final = 10_000
"""Longest answer in words, in characters."""
MAX_NAMES: Final = 8
MAX_NAME: Final = 200
MIN_PX_PER_MM: Final = 0.5
MAX_PX_PER_MM: Final = 40.0


def check_reply(step: PageStep, content: Mapping[str, Any]) -> None:
    """Refuse a reply that does not answer a step, before any of it is accepted.

    Raises:
        PageError: saying what is wrong.
    """
    if "is_full" in content:
        raise PageError("whether there is a place is not for a page to say")
    if content.get("stop") is not None:
        if content["stop"] not in ("keep", "delete"):
            raise PageError(f"stop is {str(content['stop'])[:40]!r}; it is keep or delete")
        return
    number(content.get("hidden_ms", 0), "hidden_ms")
    count(content.get("sound_breaks", 0), "sound_breaks")
    if step.kind == "consent" and not isinstance(content.get("agreed"), bool):
        raise PageError("consent was neither given nor declined")
    if step.kind == "card":
        _check_size(content.get("px_per_mm", ""))
        if content.get("distance_mm") is not None:
            check_distance(content["distance_mm"])
    if step.kind == "sound":
        count(content.get("played"), "played")
        digits = content.get("heard", "")
        if digits is not None and not (isinstance(digits, str) and TYPED_DIGITS.fullmatch(digits)):
            raise PageError(f"heard are digits, not {str(digits)[:40]!r}")
    if step.kind == PRELOAD:
        mapping(content.get("films", {}), "films")
        mapping(content.get("pictures", {}), "pictures")
    if step.kind == "enter":
        _check_entering(step, content)
    if step.kind == "show":
        number(content.get("shown_ms"), "shown_ms")
        check_shown(step, content)
    if step.kind not in ("watch", "mould", "questions"):
        return
    if step.kind == "mould":
        number(content.get("shown_ms"), "shown_ms")
        if content.get("failed") is not None:
            mapping(content["failed"], "what failed")
            return
        read_drawn(content)
    if step.kind == "watch":
        number(content.get("shown_ms"), "shown_ms")
        if content.get("failed") is not None:
            mapping(content["failed"], "what failed")
            return
        if step.content.get("live"):
            read_drawn(content)
        if step.content["films"]:
            number(content.get("off_ms"), "off_ms")
            number(content.get("apart_ms") or 0, "apart_ms")
            film_replies = mapping(content.get("films"), "films")
            for film in step.content["films"]:
                read_film(film_replies.get(film["place"]))
    answers = mapping(content.get("answers"), "answers")
    for question in step.content["questions"]:
        _check_answer(question, answers.get(question["name"]), is_timed=step.kind != "questions")


def _check_entering(step: PageStep, content: Mapping[str, Any]) -> None:
    """Refuse what no page says of a headset that was entered, or why it was not."""
    if not isinstance(content.get("entered"), bool):
        raise PageError("a headset was neither entered nor not")
    texts = {name: content.get(name, "") for name in ("why", "space", "renderer")}
    for name in ("controllers", "profiles"):
        several = content.get(name, [])
        if not isinstance(several, list) or len(several) > MAX_NAMES:
            raise PageError(f"{name} are at most {MAX_NAMES} names")
        texts |= {f"{name} {i}": text for i, text in enumerate(several)}
    for name, text in texts.items():
        if not isinstance(text, str) or len(text) > MAX_NAME:
            raise PageError(f"{name} is a text of at most {MAX_NAME} characters")
    rate_hz = content.get("rate_hz")
    if rate_hz is not None and not 0 < number(rate_hz, "rate_hz") <= MAX_RATE_HZ:
        raise PageError(f"{rate_hz} Hz is no headset's rate")
    if step.content["xr"] == "required" and not content["entered"]:
        raise PageError("this study needs a headset; who enters none may stop")


def _check_size(px_per_mm: Any) -> None:
    """Refuse an impossible size of the screen; None means that the participant has no card."""
    if (
        px_per_mm is not None
        and not MIN_PX_PER_MM <= number(px_per_mm, "px_per_mm") <= MAX_PX_PER_MM
    ):
        raise PageError(f"px_per_mm is {px_per_mm}")


def _check_answer(question: Mapping[str, Any], content: Any, *, is_timed: bool) -> None:
    name, option = question["name"], content
    if is_timed:
        answer = mapping(content, f"the answer to {name}")
        number(answer.get("at_ms"), "at_ms")
        if answer.get("by") not in (*WAYS, BY_LIMIT):
            raise PageError(f"{name}: answered by {str(answer.get('by'))[:40]!r}")
        if answer.get("released_ms") is not None:
            if not question.get("is_held") or answer["by"] != "keys":
                raise PageError(f"{name}: nobody asked when a key was released")
            if number(answer["released_ms"], "released_ms") < answer["at_ms"]:
                raise PageError(f"{name}: its key was released before it was pressed")
        option = answer.get("option")
    if option is None:
        return
    if not isinstance(option, str) or len(option) > MAX_TEXT:
        raise PageError(f"{name}: an answer is a text of at most {MAX_TEXT} characters")
    options = [o["value"] for o in question.get("options") or ()]
    if options and option not in options:
        raise PageError(f"{name}: {option[:40]!r} is none of its options")
    if question["kind"] == MOULDER or (question["kind"] in ("number", "slider") and not is_timed):
        _check_number(question, option)


def _check_number(question: Mapping[str, Any], text: str) -> None:
    if not NUMBER.fullmatch(text):
        raise PageError(f"{question['name']}: {text[:40]!r} is not a number")
    value = float(text.replace(",", "."))
    low, high = question.get("low"), question.get("high")
    if (low is not None and value < low) or (high is not None and value > high):
        raise PageError(f"{question['name']}: {text[:40]} is out of bounds")

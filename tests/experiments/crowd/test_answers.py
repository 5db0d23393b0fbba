"""Answers are what the questionnaires call them, in whatever language they were asked."""

from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from experiments.crowd.intake import answers_of
from protocol.questionnaires import load_questionnaire, read_answer


def recording(answers: dict[tuple[str, str], str | None]) -> Any:
    """Return what `answers_of` reads of a recording: answers by questionnaire and question."""
    payloads = [{"questionnaire": q, "question": n, "answer": a} for (q, n), a in answers.items()]
    block = {"index": 1, "name": "Block eins", "trials": [{"factors": {"condition": "Haptic"}}]}
    events = pd.DataFrame({"name": "answer", "payload": payloads})
    manifest = SimpleNamespace(participant="S01", plan={"blocks": [block]})
    return SimpleNamespace(events=lambda: events, manifest=manifest)


@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_a_choice_read_in_another_language_is_the_same_answer(language: str) -> None:
    asked = load_questionnaire("demographics", language=language)
    own = load_questionnaire("demographics")
    gender, known = (next(q for q in of.questions() if q.question_id == "gender")
                     for of in (asked, own))  # fmt: skip
    said = gender.options[1]
    # as a session records it: the value, where the words were not the questionnaire's own
    kept = said if language == "en" else str(read_answer(gender, said))
    person, _ = answers_of(recording({("demographics", "gender"): kept}))
    assert known.options[1] == person["gender"]


def test_answers_after_a_block_are_told_by_its_condition_whatever_it_is_called() -> None:
    items = [q.question_id for q in load_questionnaire("presence").questions()]
    given: dict[tuple[str, str], str | None] = {("presence@1", item): "5" for item in items}
    given["presence@1", items[0]] = None
    _, (row,) = answers_of(recording(given))
    assert ("Haptic", None) == (row["condition"], row[items[0]])
    everything = dict.fromkeys(given, "5")
    _, (row,) = answers_of(recording(everything))
    assert 5.0 == row["presence"]

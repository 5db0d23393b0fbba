"""Answers are what the questionnaires call them, in whatever language they were asked."""

from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from visavis.experiments.crowd.measuring import sex_of
from visavis.protocol.plan.questionnaires import load_questionnaire, read_answer
from visavis.results.intake import blocks_of


def recording(answers: dict[tuple[str, str], str | None]) -> Any:
    """Return a recording of answers by questionnaire and question, and of nothing else."""
    payloads = [{"questionnaire": q, "question": n, "answer": a} for (q, n), a in answers.items()]
    block = {"index": 1, "name": "Block eins", "trials": [{"factors": {"condition": "Haptic"}}]}
    events = pd.DataFrame({"name": "answer", "payload": payloads})
    manifest = SimpleNamespace(participant="S01", plan={"blocks": [block]})
    return SimpleNamespace(events=lambda: events, manifest=manifest)


@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_what_somebody_is_is_the_same_answer_in_every_language(language: str) -> None:
    asked = load_questionnaire("demographics", language=language)
    own = load_questionnaire("demographics")
    gender, known = (
        next(q for q in of.questions() if q.question_id == "gender") for of in (asked, own)
    )
    said = gender.options[1]
    # as a session records it: the value, where the words were not the questionnaire's own
    kept = said if language == "en" else str(read_answer(gender, said))
    assert known.options[1] == sex_of(recording({("demographics", "gender"): kept}))


def test_somebody_who_did_not_say_what_they_are_has_no_sex() -> None:
    assert sex_of(recording({("demographics", "age"): "30"})) is None


def test_answers_after_a_block_are_told_by_its_condition_whatever_it_is_called() -> None:
    asked = [load_questionnaire("presence")]
    items = [q.question_id for q in asked[0].questions()]
    given: dict[tuple[str, str], str | None] = {("presence@1", item): "5" for item in items}
    given["presence@1", items[0]] = None
    (row,) = blocks_of(recording(given), asked, "condition").to_dict("records")
    assert ("Haptic", None) == (row["condition"], row[items[0]])
    everything = dict.fromkeys(given, "5")
    (row,) = blocks_of(recording(everything), asked, "condition").to_dict("records")
    assert 5.0 == row["presence"]


def test_a_block_after_which_nothing_was_answered_has_no_row() -> None:
    assert blocks_of(recording({}), [load_questionnaire("presence")], "condition").empty

"""What participants read and answer is in their language; what analysis reads is not."""

from pathlib import Path

import pytest

from tests.faults.sessions import CONFIG, events
from tests.sessions import perform
from visavis.cli.studies import check_wording
from visavis.lab.config import LabConfig, load_config
from visavis.lab.errors import ConfigError
from visavis.protocol.plan.questionnaires import (
    SCALES_DIR,
    available,
    load_questionnaire,
    read_answers,
)
from visavis.results.intake import person_of
from visavis.study.texts import WORDS_DIR, languages_in, read_texts

LANGUAGES = ("de", "fr")
TRANSLATED = ("demographics", "free_comment")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", TRANSLATED)
def test_shipped_translation_words_every_question_and_option(name: str, language: str) -> None:
    own, other = load_questionnaire(name), load_questionnaire(name, language=language)
    assert language == other.language
    assert [q.question_id for q in own.questions()] == [q.question_id for q in other.questions()]
    for asked, translated in zip(own.questions(), other.questions(), strict=True):
        assert asked.prompt != translated.prompt
        assert not set(asked.options) & set(translated.options)


def test_questionnaire_without_a_translation_says_that_it_is_in_english() -> None:
    assert "en" == load_questionnaire("social_anxiety", language="de").language


def test_translations_are_no_questionnaires_of_their_own() -> None:
    assert not [name for name in available() if "." in name]
    assert 4 == len(list(SCALES_DIR.glob("*.*.yaml")))


@pytest.mark.parametrize("language", languages_in(WORDS_DIR))
def test_leaving_out_has_a_word_in_every_language(language: str) -> None:
    assert read_texts((), language).get("no_answer")


def test_answers_given_in_german_are_read_as_those_given_in_english(tmp_path: Path) -> None:
    def asked_in(language: str) -> tuple[dict[str, object], list[dict[str, object]]]:
        recording = perform("asking", tmp_path / language, language=language)
        person = person_of(recording, [load_questionnaire("demographics")])
        return person, events(recording, "answer")

    english, said = asked_in("en")
    german, gesagt = asked_in("de")
    assert english == german
    assert {"de"} == {payload["language"] for payload in gesagt}
    assert not [payload for payload in said if "language" in payload]
    assert {"Frau", "Mann", "anders"} & {payload["said"] for payload in gesagt}


def lab_with(tmp_path: Path, wording: str) -> LabConfig:
    path = tmp_path / "lab_config.yaml"
    path.write_text(f"{CONFIG.read_text('utf-8')}\nwording:\n  {wording}\n", encoding="utf-8")
    return load_config(path)


def test_wording_of_a_questionnaire_that_there_is_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no questionnaire 'demografics'; did you mean 'demogr"):
        check_wording(lab_with(tmp_path, "demografics: d.yaml"))


@pytest.mark.parametrize("known", ["demographics", "strategy"])
def test_wording_of_what_visavis_or_a_study_asks_is_taken(tmp_path: Path, known: str) -> None:
    check_wording(lab_with(tmp_path, f"{known}: d.yaml"))


def test_wording_of_what_a_study_of_the_lab_asks_is_taken(tmp_path: Path) -> None:
    (tmp_path / "mood.py").write_text(
        "from visavis import Factor, Scene, Study\n"
        'study = Study("mood", factors=[Factor("eyes", ["averted"])], questionnaires=["feeling"])\n'
        "@study.trial\ndef trial(t):\n    yield t.show(Scene('two_people'), 1)\n",
        encoding="utf-8",
    )
    (tmp_path / "feeling.yaml").write_text(
        "name: feeling\ntitle: Now\nversion: 1\nlicence: ours\nscales: {words: {kind: text}}\n"
        "items: [{id: now, scales: [words], text: 'How are you?'}]\n",
        encoding="utf-8",
    )
    lab = lab_with(tmp_path, "feeling: f.yaml\nstudies:\n  mood: mood.py")
    check_wording(lab)
    assert {"now": None} == read_answers(load_questionnaire(tmp_path / "feeling.yaml"), {})

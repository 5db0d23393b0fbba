"""What `check_study` finds wrong with a study, and that it finds nothing where nothing is."""

from pathlib import Path
from typing import Any

import pytest

from tests.sessions import STUDIES
from visavis.lab.errors import DesignError
from visavis.people.person import StudyPerson
from visavis.results.opened_study import OpenedStudy
from visavis.testing import check_study

HEAD = """from visavis import Choice, Compare, Factor, Rating, Scene, Study
study = Study("own", factors=[Factor("eyes", ["averted", "directed"])], texts="texts")
"""
TRIAL = """@study.trial
def trial(t):
    yield t.show(Scene("two_people", eyes=t.eyes), seconds=1)
    yield t.ask(Rating("realism", 1, 7))
"""
TEXTS = "instruction: '{trials} scenes follow.'\n"


def written(folder: Path, trial: str = TRIAL, **texts: str) -> Path:
    (folder / "texts").mkdir()
    for language, text in (texts or {"en": TEXTS}).items():
        (folder / "texts" / f"{language}.yaml").write_text(text, encoding="utf-8")
    path = folder / "own.py"
    path.write_text(HEAD + trial, encoding="utf-8")
    return path


def said(path: Path) -> str:
    with pytest.raises(DesignError) as error:
        check_study(path)
    return str(error.value)


def test_nothing_is_wrong_with_the_duel() -> None:
    check_study(STUDIES / "duel.py", {"repetitions": 1})


def test_number_in_a_text_is_told_with_file_and_name(tmp_path: Path) -> None:
    path = written(tmp_path, en="instruction: 8 scenes follow.\n")
    assert "en.yaml, instruction: it names a number itself" in said(path)


def test_text_that_one_language_lacks_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, en=TEXTS, de="practice: Zuerst üben Sie.\n")
    told = said(path)
    assert "de.yaml has no instruction" in told
    assert "en.yaml has no practice" in told


def test_placeholders_that_differ_between_languages_are_told(tmp_path: Path) -> None:
    path = written(tmp_path, en=TEXTS, de="instruction: Es folgen Szenen.\n")
    assert "instruction: placeholders differ (de: none; en: trials)" in said(path)


def test_person_who_is_told_the_condition_is_found_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def knowing(
        self: OpenedStudy, index: int, seed: int, *, effect: bool, experiment: Any = None
    ) -> StudyPerson:
        first = experiment.plan(index, seed).trials[0].factors["eyes"]
        answer = 7 if first in ("averted", "directed") else 1
        return StudyPerson(
            index, seed, effect, responses=experiment.words, answer_of=lambda *_: answer
        )

    monkeypatch.setattr(OpenedStudy, "participant", knowing)
    assert "'realism' changes when the levels are renamed" in said(written(tmp_path))


def test_column_that_nothing_describes_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, TRIAL + "    t.row['mood'] = 'calm'\n")
    assert "column 'mood' of the trials is not described" in said(path)

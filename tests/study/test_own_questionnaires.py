"""Questionnaires of a study's own: the page's form works, and mistakes are told beforehand."""

import re
from pathlib import Path

import pytest

from visavis.lab.errors import DesignError
from visavis.protocol.plan.questionnaires import load_questionnaire
from visavis.results.opened_study import find_study

PAGE = Path(__file__).parents[2] / "docs" / "questionnaires.md"
STUDY = """
from visavis import Compare, Factor, Rating, Study
study = Study("own", "S", factors=[Factor("a", ["x", "y"])], calibrate=False,
    questionnaires=["calm"], compare=[Compare("r", within="a")])

@study.trial
def trial(t):
    yield t.ask(Rating("r", 1, 5))
"""
WORDING = "questionnaire: calm\nlanguage: fr\nitems: {calm: …}\n"


def page_form():
    (form,) = re.findall(r"^```yaml\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    return form


def opened(folder, form):
    (folder / "own.py").write_text(STUDY, "utf-8")
    (folder / "calm.yaml").write_text(form, "utf-8")
    return find_study(str(folder / "own.py"))


def test_the_form_on_the_page_is_a_questionnaire(tmp_path):
    opened(tmp_path, page_form()).experiment_to_run({})
    questions = load_questionnaire(tmp_path / "calm.yaml").questions()
    assert [q.question_id for q in questions] == ["calm", "tense", "felt_min", "remark"]


@pytest.mark.parametrize(
    ("form", "says"),
    [
        (WORDING, r"calm\.yaml is in the form of a wording .*wording: in lab_config\.yaml"),
        ("name: calm\ntitel: x\n", r"calm\.yaml"),
    ],
)
def test_a_questionnaire_with_a_mistake_is_told_before_anything_is_recorded(tmp_path, form, says):
    with pytest.raises(DesignError, match=says):
        opened(tmp_path, form).experiment_to_run({})

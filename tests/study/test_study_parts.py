"""A study is made of parts small enough to be taken in; keywords of a study file reach each."""

import inspect
from dataclasses import fields

import pytest

from visavis import Factor, Study
from visavis.study.declaration import PART_OF, PARTS
from visavis.study.parts import SETTABLE, StudyDesign

MAX_FIELDS = 20
FACTORS = [Factor("eyes", ["averted", "directed"])]


@pytest.mark.parametrize("kind", [Study, *PARTS.values()])
def test_no_part_has_more_fields_than_can_be_taken_in(kind: type) -> None:
    assert len(fields(kind)) <= MAX_FIELDS


@pytest.mark.parametrize("kind", [Study, *PARTS.values()])
def test_every_field_is_explained_below_it(kind: type) -> None:
    lines = inspect.getsource(kind).splitlines()
    for name in (f.name for f in fields(kind)):
        at = next(i for i, line in enumerate(lines) if line.startswith(f"    {name}: "))
        assert lines[at + 1].strip().startswith('"""'), name


def test_no_two_parts_have_a_field_of_one_name() -> None:
    assert sum(len(fields(kind)) for kind in PARTS.values()) == len(PART_OF)


def test_a_keyword_of_a_study_is_read_from_its_part() -> None:
    study = Study("mood", factors=FACTORS, repetitions=3, needs=["eye_tracker"], answer_by="ray")
    assert (3, ["eye_tracker"], "ray") == (
        study.design.repetitions,
        study.devices.needs,
        study.asks.answer_by,
    )


def test_a_part_may_be_given_whole() -> None:
    whole = Study("mood", design=StudyDesign(factors=FACTORS, repetitions=3))
    assert whole == Study("mood", factors=FACTORS, repetitions=3)


def test_a_changed_study_keeps_the_rest() -> None:
    study = Study("mood", "Mood", factors=FACTORS, repetitions=3, version="2")
    assert study == study.with_changes(repetitions=4).with_changes(repetitions=3)


def test_what_every_study_has_comes_in_the_order_of_settable() -> None:
    assert list(SETTABLE) == list(Study("mood", factors=FACTORS).usual_parameters)


def test_reading_a_field_past_its_part_says_where_it_stands() -> None:
    study = Study("mood", factors=FACTORS)
    field = "repetitions"
    with pytest.raises(AttributeError, match=rf"in a part: \.design\.{field}"):
        getattr(study, field)

"""What people are told before they enter a headset."""

import pytest

from benchmarks.headset_page import draws_of, page_bytes
from visavis.running.page.headset_information import SECTION, headset_information
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.gltf.exporting import glb_of_character
from visavis.study.texts import read_texts


@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_people_are_told_of_comfort_stopping_seizures_floor_age_and_movement(language: str) -> None:
    texts = read_texts((), language)
    assert list(texts.below(SECTION)) == [
        "comfort",
        "stop",
        "seizures",
        "floor",
        "age",
        "movement",
        "room",
        "breaks",
        "discomfort",
    ]
    information = headset_information(texts)
    assert all(len(line) > 40 for line in information.lines)


def test_another_text_is_another_version() -> None:
    versions = {headset_information(read_texts((), name)).version for name in ("en", "de", "fr")}
    assert len(versions) == 3


def test_a_page_in_a_headset_is_small_and_a_person_few_draws() -> None:
    assert page_bytes() <= 250_000
    assert draws_of(glb_of_character(load_character("anna"))) <= 4

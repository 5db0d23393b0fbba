"""Shoes of the cast: closed all round, and none seen through the trousers above them."""

import pytest

from character_making.feet_seen import MAX_SEEN_M2, POSES, worst_mm2
from visavis.stimuli.characters.cast import cast_names, load_character


@pytest.mark.parametrize("name", cast_names())
def test_no_slit_in_a_shoe_and_no_shoe_through_trousers(name: str) -> None:
    person = load_character(name)
    for level in range(len(person.levels)):
        for pose in POSES:
            slit, speck = worst_mm2(person, level, pose)
            assert slit * 1e-6 < MAX_SEEN_M2[level]
            assert speck * 1e-6 < MAX_SEEN_M2[level]

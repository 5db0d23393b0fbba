"""What is odd about a figure is told; of people who are as they should be, nothing is."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.checking import findings
from visavis.stimuli.characters.closing import collision_mesh


@pytest.mark.parametrize("name", cast_names())
def test_nothing_is_odd_about_the_people_who_come_along(name: str) -> None:
    assert () == findings(load_character(name))


def _with_morphs(person: Character, *left_out: str) -> Character:
    full, *others = person.levels
    kept = {name: morph for name, morph in full.morphs.items() if name not in left_out}
    return replace(person, levels=(replace(full, morphs=kept), *others))


def _halfway(person: Character) -> Character:
    full, *others = person.levels
    blink = full.morphs["left_blink"]
    half = {**full.morphs, "left_blink": replace(blink, delta_m=blink.delta_m * np.float32(0.2))}
    return replace(person, levels=(replace(full, morphs=half), *others))


def _handless(person: Character) -> Character:
    full, *others = person.levels
    parts = full.triangle_part.copy()
    parts[parts == PART_INDEX["left_hand"]] = PART_INDEX["left_forearm"]
    return replace(person, levels=(replace(full, triangle_part=parts), *others))


def _lopsided(person: Character) -> Character:
    offsets = person.skeleton.offsets_m.copy()
    offsets[person.skeleton.index("left_hand")] *= 0.7
    return replace(person, skeleton=replace(person.skeleton, offsets_m=offsets))


def _torn(person: Character) -> Character:
    closed = collision_mesh(person)
    return replace(person, closed=replace(closed, triangles=closed.triangles[:-1]))


def _swollen(person: Character) -> Character:
    closed = collision_mesh(person)
    return replace(person, closed=replace(closed, vertices_m=closed.vertices_m * np.float32(2)))


def _goggling(person: Character) -> Character:
    return replace(person, eyeball=replace(person.eyeball, radius_m=0.03))


def _dumb(person: Character) -> Character:
    return _with_morphs(person, "jaw_open")


def _squinting(person: Character) -> Character:
    offsets = person.skeleton.offsets_m.copy()
    offsets[person.skeleton.index("left_eye"), 0] -= 0.03
    return replace(person, skeleton=replace(person.skeleton, offsets_m=offsets))


@pytest.mark.parametrize(
    ("told", "odd"),
    [
        ("its left lids do not close", lambda p: _with_morphs(p, "left_blink")),
        ("its left lids do not close", _halfway),
        ("lids do not follow its eyes", lambda p: _with_morphs(p, "lids_up", "lids_down")),
        ("cannot make the faces smile, frown", lambda p: _with_morphs(p, "smile")),
        ("cannot make the faces open_mouth: give the file jawOpen", _dumb),
        ("is 170.00 m tall", lambda p: replace(p, stature_m=170.0)),
        ("eyeballs have a radius of 30 mm", _goggling),
        ("it has no left hand", _handless),
        ("surface for collisions is not closed", _torn),
        ("litres; people's hold", _swollen),
        ("mm apart", _squinting),
        ("is the joint map right?", _lopsided),
    ],
)
def test_what_is_odd_is_told(told: str, odd: Callable[[Character], Character]) -> None:
    (found,) = [text for text in findings(odd(load_character("anna"))) if told in text]
    assert 1 == len(found.splitlines())

"""A person whose feet show through shoes or trousers is made again."""

from dataclasses import replace

import pytest

from character_making.feet_seen import feet_hold
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import Character


def without(person: Character, material: str, low_m: float, high_m: float) -> Character:
    """Return a person with a hole in a material, between two heights above the ankle."""
    mesh = person.levels[1]
    ankle_m = person.skeleton.rest_m[person.skeleton.index("left_foot")][1]
    above_m = mesh.vertices_m[mesh.triangles].mean(axis=1)[:, 1] - ankle_m
    worn = mesh.triangle_material == [m.name for m in person.materials].index(material)
    kept = ~(worn & (above_m > low_m) & (above_m < high_m))
    holed = replace(
        mesh,
        triangles=mesh.triangles[kept],
        triangle_part=mesh.triangle_part[kept],
        triangle_material=mesh.triangle_material[kept],
    )
    return replace(person, levels=(person.levels[0], holed, person.levels[2]))


@pytest.mark.parametrize(
    ("material", "low_m", "high_m"), [("shoe", -0.1, -0.03), ("bottom", 0.0, 0.1)]
)
def test_whoever_is_made_is_made_again_with_a_hole_in_a_shoe_or_in_trousers_above_it(
    material: str, low_m: float, high_m: float
) -> None:
    person = load_character("gabriel")

    assert feet_hold(person, 1)
    assert not feet_hold(without(person, material, low_m, high_m), 1)

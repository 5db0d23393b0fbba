"""Hems of the cast when legs move: thighs stay below tops, shoes below trousers."""

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial import cKDTree

from character_making.recipes import CAST as RECIPES
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.cast import load_cast, load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.skinning import skin_of
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.kinds import Sit, Walk
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward

CAST = load_cast()
STRIDE_S = np.arange(2.0, 3.1, 0.15)
COVERED_M = 0.02
MAX_THROUGH_01, MAX_SHOWN_01 = 0.03, 0.05
"""Shares of what a garment covers that may come through it in motion, and be out at rest."""


def vertices_of(character: Character, material: str) -> np.ndarray:
    mesh = character.levels[0]
    number = [m.name for m in character.materials].index(material)
    return np.unique(mesh.triangles[mesh.triangle_material == number])


def is_out(
    points_m: Vector, around_m: Vector, normals: Vector, out_m: float
) -> npt.NDArray[np.bool_]:
    """Tell which points (v,) lie farther outside of a surface's vertices than `out_m`."""
    _, nearest = cKDTree(around_m).query(points_m, 4)
    offset = points_m[:, None] - around_m[nearest]
    out: npt.NDArray[np.bool_] = (offset * normals[nearest]).sum(axis=-1).min(axis=1) > out_m
    return out


def through_01(
    character: Character,
    kind: Walk | Sit,
    times_s: Vector,
    inner: np.ndarray,
    outer: np.ndarray,
    out_m: float,
) -> float:
    """Return the largest share of the inner vertices that come out of the outer ones."""
    mesh = character.levels[0]
    shown = is_out(mesh.vertices_m[inner], mesh.vertices_m[outer], mesh.normals[outer], 0.0)
    inner = inner[~shown]
    assert len(inner) > 20
    motion = PeopleMotion((Person(build_of_character(character), kind, 3),))
    shares = []
    for t in times_s:
        people = motion.at(float(t))
        placed = forward(character.skeleton, people.root_m[0], people.orientation_wxyz[0])
        skin = skin_of(character, placed)
        out = is_out(skin.vertices_m[inner], skin.vertices_m[outer], skin.normals[outer], out_m)
        shares.append(float(out.mean()))
    return max(shares)


@pytest.mark.parametrize("character", CAST, ids=[c.name for c in CAST])
def test_thighs_of_walkers_and_sitters_do_not_come_through_their_tops(character: Character) -> None:
    """A thigh came through every shirt at each stride: hems did not go with it."""
    rest_m = character.levels[0].vertices_m
    top, trousers = vertices_of(character, "top"), vertices_of(character, "bottom")
    top = top[rest_m[top, 1] < 0.1]
    front = rest_m[trousers, 2] < -0.04
    covered = trousers[front & (rest_m[trousers, 1] > rest_m[top, 1].min() + COVERED_M)]
    assert MAX_THROUGH_01 > through_01(character, Walk(), STRIDE_S, covered, top, 0.008)
    assert MAX_THROUGH_01 > through_01(character, Sit(), np.array([1.0]), covered, top, 0.008)


@pytest.mark.parametrize("name", [recipe.name for recipe in RECIPES if recipe.shoes != "loafer"])
def test_shoes_of_walkers_stay_below_their_trousers(name: str) -> None:
    """Gabriel's boots came through the hems of his trousers, other people's shoes too."""
    character = load_character(name)
    mesh = character.levels[0]
    rest_m = mesh.vertices_m
    ankle_m = character.skeleton.rest_m[character.skeleton.index("left_foot")][1]
    trousers, shoes = vertices_of(character, "bottom"), vertices_of(character, "shoe")
    trousers = trousers[rest_m[trousers, 1] < ankle_m + 0.15]
    shoes = shoes[rest_m[shoes, 1] < ankle_m + 0.15]
    near = cKDTree(rest_m[trousers][:, [0, 2]]).query_ball_point(rest_m[shoes][:, [0, 2]], 0.03)
    hem_m = np.array([rest_m[trousers[n], 1].min() if n else np.inf for n in near])
    covered = shoes[rest_m[shoes, 1] > hem_m + 0.012]
    assert len(covered) > 20
    shown_01 = is_out(rest_m[covered], rest_m[trousers], mesh.normals[trousers], 0.0).mean()
    assert MAX_SHOWN_01 > shown_01
    assert MAX_THROUGH_01 > through_01(character, Walk(), STRIDE_S, covered, trousers, 0.001)

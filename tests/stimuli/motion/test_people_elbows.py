"""Elbows of sitters: neither in the own trunk nor over the edge of the seat."""

import numpy as np
import numpy.typing as npt
import pytest

from tests.stimuli.valid_avatars import avatar_files, needs_avatars
from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.skinning import skin_vertices
from visavis.stimuli.motion.build import MAX_ELBOW_BESIDE_M, build_of_character
from visavis.stimuli.motion.kinds import Sit
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward

CAST = load_cast()
SEEDS = (0, 1, 2)


def _reach_m(triangles: Vector, origin: Vector, way: Vector) -> npt.NDArray[np.float64]:
    """Return how far triangles (m, 3, 3) reach along rays (k, 3); −∞ where none is met."""
    one, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(way[:, None], other)
    size = (across * one).sum(axis=-1)
    share = np.divide(1.0, size, out=np.zeros_like(size), where=np.abs(size) > 1e-12)
    from_corner = origin[:, None] - triangles[:, 0]
    u = share * (from_corner * across).sum(axis=-1)
    beyond = np.cross(from_corner, one)
    v = share * (beyond * way[:, None]).sum(axis=-1)
    t = share * (beyond * other).sum(axis=-1)
    is_met = (share != 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
    reach: npt.NDArray[np.float64] = np.where(is_met, t, -np.inf).max(axis=1)
    return reach


def _arms(person: Character, seed: int) -> list[tuple[float, float]]:
    """Return of both arms how far the lower half of the upper arm is from the trunk, outwards from
    its middle, and the elbow from the middle of the chest.
    """
    skeleton, mesh = person.skeleton, person.levels[1]
    sit = Sit(0.45, "thighs", lively=0.25)
    pose = PeopleMotion((Person(build_of_character(person), sit, seed),)).at(3.0)
    body = forward(skeleton, pose.root_m[0], pose.orientation_wxyz[0])
    chest = skeleton.index("upper_chest")

    def in_chest(points: Vector) -> Vector:
        turn = np.broadcast_to(quat_conjugate(body.orientation_wxyz[chest]), (len(points), 4))
        placed: Vector = rotate(turn, points - body.position_m[chest])
        return placed

    joints = in_chest(body.position_m)
    skin = in_chest(skin_vertices(mesh, skeleton, body).astype(np.float64))
    trunk = skin[mesh.triangles[mesh.triangle_part == PART_INDEX["torso"]]]
    arms = []
    for side in ("left", "right"):
        shoulder, elbow = (joints[skeleton.index(f"{side}_{j}_arm")] for j in ("upper", "lower"))
        rows = np.unique(
            mesh.triangles[mesh.triangle_part == PART_INDEX[f"{side}_upper_arm"]].ravel()
        )
        bone = elbow - shoulder
        share = (skin[rows] - shoulder) @ bone / (bone @ bone)
        points = skin[rows[share > 0.5]]
        middle = points * np.array([0.0, 1.0, 0.0])
        middle[:, 2] = 0.5 * joints[skeleton.index("hips"), 2]
        off_m = np.linalg.norm(points - middle, axis=1)
        reach_m = _reach_m(trunk, middle, (points - middle) / off_m[:, None])
        arms.append((float((off_m - reach_m).min()), float(abs(elbow[0]))))
    return arms


def _in_the_trunk(person: Character) -> list[tuple[float, float]]:
    """Return of every arm that is less than 5 mm clear of the trunk and could be wider what
    `_arms` does.
    """
    arms = [arm for seed in SEEDS for arm in _arms(person, seed)]
    return [(gap, x) for gap, x in arms if gap < 0.005 and x < MAX_ELBOW_BESIDE_M - 0.005]


@pytest.mark.parametrize("person", CAST, ids=[c.name for c in CAST])
def test_arms_of_sitters_are_clear_of_their_trunk_or_at_the_edge_of_the_seat(
    person: Character,
) -> None:
    assert [] == _in_the_trunk(person)


@needs_avatars
def test_arms_of_imported_sitters_are_clear_of_their_trunk_or_at_the_edge_of_the_seat() -> None:
    people = [import_gltf(file) for file in avatar_files()]

    assert {} == {p.name: wrong for p in people if (wrong := _in_the_trunk(p))}


@pytest.mark.parametrize("person", CAST, ids=[c.name for c in CAST])
def test_elbows_of_sitters_stay_within_a_centimetre_of_the_seat(person: Character) -> None:
    for seed in SEEDS:
        assert 0.235 > max(x for _, x in _arms(person, seed))  # seats are 0.45 m wide, arms 9 cm

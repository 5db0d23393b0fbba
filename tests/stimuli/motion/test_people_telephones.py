"""Telephones at ears: where ears are, along the cheek, in a hand whose elbow hangs."""

from pathlib import Path

import numpy as np
import pytest

from lab.geometry import Vector, quat_conjugate, rotate, unit
from stimuli.characters.body_parts import PART_INDEX
from stimuli.characters.cast import load_cast
from stimuli.characters.character import Character
from stimuli.characters.gltf import import_gltf
from stimuli.characters.skinning import skin_vertices
from stimuli.dressing.telephone import holding_telephone
from stimuli.motion.build import build_of_character
from stimuli.motion.kinds import Phone
from stimuli.motion.people import PeopleMotion, Person
from stimuli.motion.skeleton import Placement, forward
from stimuli.motion.telephoning import head_skin_m, mouth_corner_m, tragus_m
from tests.stimuli.glb_figure import write_glb
from tests.stimuli.valid_avatars import avatar_files, needs_avatars

CAST = load_cast()
HALF_M = (0.0725, 0.0355, 0.0045)


def _phoning(person: Character) -> Placement:
    pose = PeopleMotion((Person(build_of_character(person), Phone(hand="left"), 3),)).at(1.0)
    return forward(person.skeleton, pose.root_m[0], pose.orientation_wxyz[0])


def _case_m(person: Character, body: Placement) -> Vector:
    """Return the corners of the telephone (k, 3) in the head's axes."""
    mesh = holding_telephone(person, "left").levels[0]
    held = np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX["held_object"]])
    hand, head = person.skeleton.index("left_hand"), person.skeleton.index("head")
    at = mesh.vertices_m[held] - person.skeleton.rest_m[hand]
    world = body.position_m[hand] + rotate(body.orientation_wxyz[hand], at)
    return rotate(quat_conjugate(body.orientation_wxyz[head]), world - body.position_m[head])


def _axes(case: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the middle, the way from the mouth's end to the ear's, and out of the face."""
    axes = np.linalg.svd(case - case.mean(axis=0))[2]
    return case.mean(axis=0), axes[0] * np.sign(axes[0][2]), axes[2] * np.sign(axes[2][0])


def _wrong(person: Character) -> list[str]:
    """Return what is wrong with how somebody telephones."""
    body = _phoning(person)
    case = _case_m(person, body)
    middle, to_ear, inward = _axes(case)
    skin, _ = head_skin_m(person)
    rest, index = person.skeleton.rest_m, person.skeleton.index
    eye = rest[index("left_eye")] - rest[index("head")]
    ear, mouth = tragus_m(skin, eye), mouth_corner_m(skin, eye, person.stature_m)
    assert ear is not None
    earpiece = middle + 0.060 * to_ear + HALF_M[2] * inward
    wrong = []
    if np.linalg.norm(earpiece - ear) > 0.030:
        wrong.append(f"earpiece {np.linalg.norm(earpiece - ear):.3f} m from the ear")
    off_deg = float(np.degrees(np.arccos(unit(ear - mouth) @ to_ear)))
    if off_deg > 20.5:
        wrong.append(f"points {off_deg:.0f} degrees past the mouth")
    if -case[:, 0].max() < -eye[0]:
        wrong.append("before the eye")
    # How far skin goes into the box, and how far beyond its face it stands.
    axes = np.stack([to_ear, np.cross(inward, to_ear), inward])
    inside = np.min(np.array(HALF_M) - np.abs((skin - middle) @ axes.T), axis=1)
    if inside.max() > 0.003:
        wrong.append(f"{inside.max():.3f} m inside the head")
    elbow = body.position_m[index("left_lower_arm")] - body.position_m[index("left_upper_arm")]
    if unit(elbow)[1] > -0.1 or -unit(elbow)[0] > 0.3:
        wrong.append(f"elbow {np.round(unit(elbow), 2)}")
    return wrong


@pytest.mark.parametrize("person", CAST, ids=[c.name for c in CAST])
def test_a_telephone_lies_at_ear_and_cheek_and_the_elbow_hangs(person: Character) -> None:
    assert [] == _wrong(person)


@needs_avatars
def test_a_telephone_lies_at_the_ear_of_imported_people() -> None:
    people = [import_gltf(file) for file in avatar_files()[:2]]

    assert {} == {p.name: wrong for p in people if (wrong := _wrong(p))}


@pytest.mark.parametrize("person", CAST, ids=[c.name for c in CAST])
def test_fingers_lie_at_the_back_of_a_telephone_not_through_it(person: Character) -> None:
    body = _phoning(person)
    case = _case_m(person, body)
    middle, to_ear, inward = _axes(case)
    mesh, index = person.levels[0], person.skeleton.index
    rows = np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX["left_hand"]])
    fingers = [index(f"left_{f}_{j}") for f in ("index", "middle", "ring") for j in ("middle",)]
    heaviest = np.take_along_axis(mesh.joints, mesh.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    rows = rows[np.isin(heaviest[rows], fingers)]
    world = skin_vertices(mesh, person.skeleton, body)[rows]
    head = index("head")
    at = rotate(quat_conjugate(body.orientation_wxyz[head]), world - body.position_m[head])
    axes = np.stack([to_ear, np.cross(inward, to_ear), inward])
    within = np.array(HALF_M) - np.abs((at - middle) @ axes.T)

    assert 0.0042 > np.min(within, axis=1).max()  # no finger has come through to the other side


def test_of_a_figure_without_ears_the_telephone_is_beside_the_head(tmp_path: Path) -> None:
    write_glb(tmp_path / "box_F.glb")
    person = import_gltf(tmp_path / "box_F.glb")
    case = _case_m(person, _phoning(person))

    assert case[:, 0].mean() < -0.05
    assert np.isfinite(case).all()

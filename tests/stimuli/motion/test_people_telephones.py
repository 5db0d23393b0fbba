"""Telephones at ears: where ears are, along the cheek, in a hand whose elbow hangs."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from tests.stimuli.glb_figure import write_glb
from tests.stimuli.valid_avatars import avatar_files, needs_avatars
from visavis.lab.geometry import Vector, quat_conjugate, rotate, unit
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.checking import findings
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.skinning import skin_vertices
from visavis.stimuli.dressing.telephone import holding_telephone
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.joint_limits import beyond_deg
from visavis.stimuli.motion.kinds import Phone
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import Placement, forward
from visavis.stimuli.motion.telephoning import head_skin_m, mouth_corner_m, tragus_m

CAST = load_cast()
Side = Literal["left", "right"]
DIGITS = ("thumb", "index", "middle", "ring", "little")
HALF_M = (0.0725, 0.0355, 0.0045)


def _phoning(person: Character, side: Side = "left") -> Placement:
    pose = PeopleMotion((Person(build_of_character(person), Phone(hand=side), 3),)).at(1.0)
    return forward(person.skeleton, pose.root_m[0], pose.orientation_wxyz[0])


def _of_head(person: Character, body: Placement, world: Vector) -> Vector:
    """Return points (k, 3) in the head's axes."""
    head = person.skeleton.index("head")
    return rotate(quat_conjugate(body.orientation_wxyz[head]), world - body.position_m[head])


def _case_m(person: Character, body: Placement, side: Side = "left") -> Vector:
    """Return the corners of the telephone (k, 3) in the head's axes."""
    mesh = holding_telephone(person, side).levels[0]
    held = np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX["held_object"]])
    hand = person.skeleton.index(f"{side}_hand")
    at = mesh.vertices_m[held] - person.skeleton.rest_m[hand]
    world = body.position_m[hand] + rotate(body.orientation_wxyz[hand], at)
    return _of_head(person, body, world)


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

    assert {} == {c.name: wrong for c in people if (wrong := _wrong(c))}


def _hand(person: Character, side: Side) -> tuple[Vector, Vector, list[str]]:
    """Return the skin (k, 3) of a hand that holds a telephone, at vertices and in the middle of
    triangles: in the head's axes, the ear at −x; along the telephone's length, across it towards
    the nose and out of its face; and the joint that moves each point most.
    """
    body = _phoning(person, side)
    mirror = np.array([1.0 if side == "left" else -1.0, 1.0, 1.0])
    middle, to_ear, inward = _axes(mirror * _case_m(person, body, side))
    mesh = person.levels[0]
    own = mesh.triangles[mesh.triangle_part == PART_INDEX[f"{side}_hand"]]
    rows = np.unique(own)
    world = skin_vertices(mesh, person.skeleton, body)
    skin = mirror * _of_head(person, body, np.concatenate([world[rows], world[own].mean(axis=1)]))
    heaviest = np.take_along_axis(mesh.joints, mesh.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    axes = np.stack([to_ear, np.cross(to_ear, inward), inward])
    moved_by = [person.skeleton.names[k] for k in heaviest[np.concatenate([rows, own[:, 0]])]]
    return skin, (skin - middle) @ axes.T, moved_by


def _gaps_m(along: Vector) -> Vector:
    """Return how far points along a telephone's axes are outside it; below 0 inside."""
    over = np.abs(along) - np.array(HALF_M)
    gaps: Vector = np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0)
    return gaps


def _not_held(person: Character, side: Side) -> list[str]:
    """Return what is wrong with how a hand holds the telephone at the ear."""
    at_head, along, moved_by = _hand(person, side)
    gaps, wrong = _gaps_m(along), []
    if gaps.min() < -0.002:
        wrong.append(f"{moved_by[gaps.argmin()]} is {-gaps.min():.4f} m inside the telephone")
    for digit in DIGITS:
        ends = [f"{side}_{digit}_{phalanx}" for phalanx in ("middle", "distal")]
        off_m = gaps[np.isin(moved_by, ends)].min()
        if off_m > 0.006:
            wrong.append(f"{digit} is {off_m:.4f} m off")
        tip = along[np.isin(moved_by, ends[1:])].mean(axis=0)
        at_edge = -tip[1] > HALF_M[1] - 0.008 if digit == "thumb" else tip[1] > HALF_M[1]
        if digit != "index" and not at_edge:
            wrong.append(f"{digit} ends {np.abs(tip[1]):.4f} m from the middle, not at an edge")
    skin, _ = head_skin_m(person)
    for point, joint in zip(at_head, moved_by, strict=True):
        beside = skin[np.hypot(*(skin - point)[:, 1:].T) < 0.005]
        deep_m = float((-beside[:, 0]).max(initial=-1.0) + point[0])
        if deep_m > 0.003:
            wrong.append(f"{joint} is {deep_m:.4f} m inside the head")
    return wrong


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("person", CAST, ids=[c.name for c in CAST])
def test_a_hand_closes_round_the_telephone_it_holds_and_not_through_it(
    person: Character, side: Side
) -> None:
    assert [] == _not_held(person, side)


@needs_avatars
@pytest.mark.parametrize("side", ["left", "right"])
def test_hands_of_imported_people_close_round_a_telephone(side: Side) -> None:
    people = [import_gltf(file) for file in avatar_files()[2:4]]

    assert {} == {c.name: wrong for c in people if (wrong := _not_held(c, side))}


def test_index_fingers_lie_along_a_telephone_and_the_others_bend_round_it() -> None:
    curls = np.array([_grip(person)[:4] for person in CAST])

    assert (curls[:, 0] < curls[:, 1:].min(axis=1)).all()
    assert 0.25 < curls[:, 1:].min()


def test_joints_stay_within_their_ranges_about_a_telephone() -> None:
    for side in ("left", "right"):
        people = tuple(Person(build_of_character(c), Phone(hand=side), 3) for c in CAST[::3])
        pose = PeopleMotion(people).at(1.0)
        fingers = [
            k
            for k, name in enumerate(CAST[0].skeleton.names)
            if "_hand" not in name and name.endswith(("_proximal", "_middle", "_distal"))
        ]

        assert 0.0 == beyond_deg(pose.orientation_wxyz)[:, fingers].max()


def _grip(person: Character) -> Vector:
    return build_of_character(person).telephoning_m[p.B_GRIP : p.B_GRIP + p.GRIP_SIZE]


def test_a_hand_without_bones_in_its_fingers_is_left_as_it_is(tmp_path: Path) -> None:
    write_glb(tmp_path / "box_F.glb")
    person = import_gltf(tmp_path / "box_F.glb")

    assert [0.0] * p.GRIP_SIZE == _grip(person).tolist()
    assert any("fingers have no bones" in text for text in findings(person))


def test_of_a_figure_without_ears_the_telephone_is_beside_the_head(tmp_path: Path) -> None:
    write_glb(tmp_path / "box_F.glb")
    person = import_gltf(tmp_path / "box_F.glb")
    case = _case_m(person, _phoning(person))

    assert case[:, 0].mean() < -0.05
    assert np.isfinite(case).all()

"""What people of the crowd do is drawn and touched alike, and looks like people."""

import numpy as np
import pytest

from lab.geometry import Vector, rotate
from stimuli.characters.body_parts import PART_INDEX
from stimuli.characters.character import Character
from stimuli.contact.body import BODY_JOINTS
from stimuli.contact.idle import crowd_poses, people_of
from stimuli.dressing.station import station_picture
from stimuli.motion.skeleton import forward
from stimuli.picture import Picture
from stimuli.scenes.station_crowd import PHONING, CrowdFrame, CrowdScene, station_crowd

FEET = [BODY_JOINTS.index(f"{s}_{part}") for s in ("left", "right") for part in ("foot", "toes")]


def _picture(configuration: int, t_ns: int) -> Picture:
    scene = CrowdScene("station", (), crowd=station_crowd(configuration))
    return station_picture(
        CrowdFrame(scene, 0, np.zeros((0, 3)), np.zeros(0), crowd_t_ns=t_ns, track=None)
    )


def test_what_touches_is_what_is_drawn():
    picture = _picture(3, 5_000_000_000)
    touched, _ = crowd_poses(people_of(station_crowd(3)), 5.0)

    for i, person in enumerate(picture.cast):
        body = forward(
            person.skeleton, picture.people.root_m[i], picture.people.orientation_wxyz[i]
        )
        rows = [person.skeleton.index(name) for name in BODY_JOINTS]
        assert touched[i] == pytest.approx(body.position_m[rows], abs=1e-9)


def test_feet_of_the_crowd_do_not_slide():
    people, step_s = people_of(station_crowd(3)), 0.1
    feet = np.array([crowd_poses(people, float(t))[0][:, FEET] for t in np.arange(0, 20, step_s)])
    speed_mm_s = 1e3 * np.linalg.norm(np.diff(feet, axis=0), axis=-1) / step_s

    assert 5.0 > np.percentile(speed_mm_s, 95)


def _ear_m(person: Character, side: str) -> Vector:
    """Return where an ear stands out most, at rest, from the head's joint."""
    mesh, skeleton = person.levels[0], person.skeleton
    skin = [i for i, m in enumerate(person.materials) if m.kind == "skin"]
    own = np.isin(mesh.triangle_material, skin) & np.isin(
        mesh.triangle_part, [PART_INDEX["face"], PART_INDEX["scalp"]]
    )
    points = mesh.vertices_m[np.unique(mesh.triangles[own])].astype(np.float64)
    eye = skeleton.rest_m[skeleton.index("left_eye")]
    points = points[np.abs(points[:, 1] - eye[1] + 0.02) < 0.035]
    outward = points[:, 0] * (-1 if side == "left" else 1)
    ear: Vector = points[outward > np.quantile(outward, 0.985)].mean(axis=0)
    return ear - skeleton.rest_m[skeleton.index("head")]


def test_telephones_are_at_the_ear():
    picture = _picture(2, 5_000_000_000)
    crowd = station_crowd(2)
    away = []
    for i in np.flatnonzero(crowd.behaviour == PHONING).tolist():
        person = picture.cast[i]
        body = forward(
            person.skeleton, picture.people.root_m[i], picture.people.orientation_wxyz[i]
        )
        mesh = person.levels[2]
        held = np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX["held_object"]])
        hand = int(mesh.joints[held[0], 0])
        side = "left" if person.skeleton.names[hand].startswith("left") else "right"
        rest = mesh.vertices_m[held] - person.skeleton.rest_m[hand]
        case = body.position_m[hand] + rotate(body.orientation_wxyz[hand], rest)
        head = person.skeleton.index("head")
        ear = body.position_m[head] + rotate(body.orientation_wxyz[head], _ear_m(person, side))
        # The nearest point of the case, as mixtures of its corners.
        nearest = min(
            np.linalg.norm(ear - (a + (b - a) * s)) for s in (0.0, 0.25, 0.5, 0.75, 1.0)
            for a in case[::3] for b in case[::3]
        )  # fmt: skip
        away.append(nearest)

    assert 0.05 > max(away)
    assert 0.03 > np.median(away)

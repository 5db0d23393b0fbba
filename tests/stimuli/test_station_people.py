"""People of the scenes: drawn as they touch, none like a neighbour, telephones at ears."""

from collections.abc import Iterator
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.outfits import in_other_clothes
from visavis.stimuli.characters.skinning import skin_vertices
from visavis.stimuli.contact.idle import crowd_poses, people_of
from visavis.stimuli.dressing.audience import audience_picture
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.office import agents_of, office_picture
from visavis.stimuli.dressing.station import station_picture
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes import station_crowd as station_crowd_module
from visavis.stimuli.scenes.audience import audience_scene
from visavis.stimuli.scenes.office import OfficeScene
from visavis.stimuli.scenes.station_crowd import PHONING, CrowdFrame, CrowdScene, station_crowd

FEET = [BODY_JOINTS.index(f"{s}_{part}") for s in ("left", "right") for part in ("foot", "toes")]


def _picture(configuration: int, t_ns: int) -> Picture:
    scene = CrowdScene("station", (), crowd=station_crowd(configuration))
    return station_picture(
        CrowdFrame(scene, 0, np.zeros((0, 3)), np.zeros(0), crowd_t_ns=t_ns, track=None)
    )


def test_what_touches_is_what_is_drawn() -> None:
    picture = _picture(3, 5_000_000_000)
    touched, _ = crowd_poses(people_of(station_crowd(3)), 5.0)

    for i, person in enumerate(picture.cast):
        body = forward(
            person.skeleton, picture.people.root_m[i], picture.people.orientation_wxyz[i]
        )
        rows = [person.skeleton.index(name) for name in BODY_JOINTS]
        assert touched[i] == pytest.approx(body.position_m[rows], abs=1e-9)


def test_feet_of_the_crowd_do_not_slide() -> None:
    people, step_s = people_of(station_crowd(3)), 0.1
    feet = np.array([crowd_poses(people, float(t))[0][:, FEET] for t in np.arange(0, 20, step_s)])
    speed_mm_s = 1e3 * np.linalg.norm(np.diff(feet, axis=0), axis=-1) / step_s

    assert 5.0 > np.percentile(speed_mm_s, 95)


@cache
@pytest.mark.parametrize("configuration", [0, 3])
def test_nobody_in_the_crowd_jerks(configuration: int) -> None:
    """A joint that leaves its own path for one picture and is back in the next is a jerk.

    Arms that swing bend their path by up to .9 mm within a picture; twitches of people who looked
    at somebody straight ahead of them were 8 and 10 mm.
    """
    people = people_of(station_crowd(configuration))
    joints_m = np.array([crowd_poses(people, float(t))[0] for t in np.arange(5.0, 10.0, 1 / 90)])
    steps = np.diff(joints_m, axis=0)
    before = np.linalg.norm(steps[1:-1] - steps[:-2], axis=-1)
    after = np.linalg.norm(steps[1:-1] - steps[2:], axis=-1)

    assert 1.2 > 1e3 * float(np.minimum(before, after).max())


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
    head: Vector = skeleton.rest_m[skeleton.index("head")]
    return ear - head


def test_telephones_are_at_the_ear() -> None:
    picture = _picture(2, 5_000_000_000)
    crowd = station_crowd(2)
    away, rises_deg = [], []
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
            np.linalg.norm(ear - (a + (b - a) * s))
            for s in (0.0, 0.25, 0.5, 0.75, 1.0)
            for a in case[::3]
            for b in case[::3]
        )
        away.append(nearest)
        axes = np.linalg.svd(case - case.mean(axis=0))[2]
        from_mouth = rotate(quat_conjugate(body.orientation_wxyz[head]), axes[0])
        from_mouth *= np.sign(from_mouth[2])  # a head's z points backwards
        rises_deg.append(float(np.degrees(np.arcsin(from_mouth[1]))))

    assert 0.05 > max(away)
    assert 0.03 > np.median(away)
    # They lay nearly level, one end below the ear, not along the cheek towards the mouth.
    assert 20.0 < min(rises_deg)
    assert 30.0 < np.median(rises_deg) < 50.0


@pytest.mark.parametrize("configuration", range(9))
def test_nobody_within_three_metres_looks_alike(configuration: int) -> None:
    crowd = station_crowd(configuration)
    away = np.linalg.norm(crowd.position_m[:, None] - crowd.position_m, axis=2)
    near = np.triu(away < 3.0, k=1)
    alike = (crowd.character[:, None] == crowd.character) & (crowd.outfit[:, None] == crowd.outfit)

    assert not (near & alike).any()
    # Nor do two of the same face stand side by side in different clothes.
    same_face = crowd.character[:, None] == crowd.character
    assert 1.8 <= away[np.triu(same_face, k=1)].min()
    assert 24 <= len(set(zip(crowd.character.tolist(), crowd.outfit.tolist(), strict=True)))


@pytest.fixture
def eleven_bodies(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Five men play the six, as in a lab's cast of eleven: the sixth is the first, dressed anew."""
    again = in_other_clothes(default_casting("male_01"), 1)

    def casting(part: str) -> Character:
        return again if part == "male_06" else default_casting(part)

    monkeypatch.setattr(station_crowd_module, "default_casting", casting)
    station_crowd.cache_clear()
    yield
    station_crowd.cache_clear()


@pytest.mark.usefixtures("eleven_bodies")
@pytest.mark.parametrize("configuration", range(9))
def test_two_of_one_body_stand_as_far_apart_as_eleven_bodies_allow(configuration: int) -> None:
    crowd = station_crowd(configuration)
    away = np.linalg.norm(crowd.position_m[:, None] - crowd.position_m, axis=2)
    body = np.where(crowd.character == 11, 6, crowd.character)
    pairs = np.triu(body[:, None] == body, k=1)

    assert 2.3 <= away[pairs].min()
    assert 11 == len(np.unique(body))
    # The look of the sixth man is that of the first in his second outfit.
    look = 100 * body + crowd.outfit + (crowd.character == 11)
    assert 3.0 < away[np.triu(look[:, None] == look, k=1)].min()


def test_other_clothes_are_of_other_colours_on_the_same_body() -> None:
    person = load_character("anna")
    dressed = [in_other_clothes(person, outfit) for outfit in range(4)]

    assert dressed[0] is person
    assert 4 == len({d.name for d in dressed})
    top = next(i for i, m in enumerate(person.materials) if m.name == "top")
    mesh = person.levels[0]
    used = np.unique(mesh.triangles[mesh.triangle_material == top])
    worn = [d.levels[0].colour_srgb[used].mean(axis=0) for d in dressed]
    for i in range(4):
        assert dressed[i].closed is person.closed
        for j in range(i):
            assert 30 < np.linalg.norm(worn[i] - worn[j])


def test_six_men_of_the_crowd_are_six() -> None:
    men = {default_casting(f"male_{number:02d}").name for number in range(1, 7)}

    assert 6 == len(men)
    assert "gabriel_2" == default_casting("male_07").name


def test_the_speaker_does_not_sit_in_his_own_audience() -> None:
    names = [f"{g}_{i:02d}" for g, n in (("female", 6), ("male", 5)) for i in range(1, n + 1)]
    frame = SceneFrame(audience_scene(names), 0, np.tile([0.0, 0, 1], (11, 1)), np.ones(11))
    cast = audience_picture(frame).cast

    assert cast[-1].name not in [person.name for person in cast[:-1]]


def test_who_telephones_or_types_in_the_office_holds_a_telephone() -> None:
    scene = OfficeScene("office", agents_of("place_3", None, 0, 0.0))
    n = len(scene.agents)
    cast = office_picture(SceneFrame(scene, 0, np.tile([0.0, 0, 1], (n, 1)), np.ones(n))).cast
    holding = {
        agent.place
        for agent, person in zip(scene.agents, cast, strict=True)
        if (person.levels[0].triangle_part == PART_INDEX["held_object"]).any()
    }

    assert {"bystander_middle", "bystander_right"} == holding


NEIGHBOURS = (
    ("left_close", "centre_close", "right_close"),
    ("left_middle", "centre_middle", "right_middle"),
    ("left_far", "centre_far", "right_far"),
)


@pytest.mark.parametrize(
    ("left", "centre", "right"),
    [("male_05", "male_03", "female_06"), ("male_01", "male_05", "male_03")],
)
def test_arms_of_neighbours_in_the_audience_are_five_centimetres_apart(
    left: str, centre: str, right: str
) -> None:
    names = [f"{g}_{i:02d}" for g, n in (("female", 6), ("male", 5)) for i in range(1, n + 1)]
    first = [left, centre, right]
    others = [name for name in names if name not in first]
    seated = [first[i // 3] if i in (0, 3, 6) else others.pop() for i in range(11)]
    scene = audience_scene(seated)
    n = len(scene.agents)
    picture = audience_picture(SceneFrame(scene, 0, np.tile([0.0, 0, 1], (n, 1)), np.ones(n)))
    arms = {}
    for i, agent in enumerate(scene.agents):
        person = picture.cast[i]
        mesh = person.levels[1]
        of_arms = [
            PART_INDEX[f"{side}_{part}"]
            for side in ("left", "right")
            for part in ("upper_arm", "forearm", "hand")
        ]
        body = forward(
            person.skeleton, picture.people.root_m[i], picture.people.orientation_wxyz[i]
        )
        rows = np.unique(mesh.triangles[np.isin(mesh.triangle_part, of_arms)])
        arms[agent.place] = cKDTree(skin_vertices(mesh, person.skeleton, body)[rows])
    for row in NEIGHBOURS:
        for one, other in pairwise(row):
            assert 0.05 <= np.min(arms[one].query(arms[other].data)[0]), (one, other)

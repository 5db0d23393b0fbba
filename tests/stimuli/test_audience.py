"""The audience stands as the study describes it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from visavis.lab.errors import DesignError
from visavis.lab.geometry import angle_deg, unit, yaw_pitch_deg_of
from visavis.stimuli.characters.body_parts import PARTS
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.sizing import scale_to_stature
from visavis.stimuli.characters.skinning import skin_vertices
from visavis.stimuli.dressing.audience import audience_picture
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.joint_limits import beyond_deg
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.rooms.audience_room import STEP_HEIGHTS_M, room_before_m
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import (
    ACTIVE_PLACES,
    AUDIENCE_TURN_DEG,
    MARK_M,
    PARTICIPANT_EYE_M,
    PARTICIPANT_TURN_DEG,
    PLACES,
    SPEAKER_EYE_M,
    audience_scene,
    black_scene,
    depth_of,
    training_scene,
    zone_of,
)
from visavis.stimuli.visibility import SceneGeometry

CHARACTERS = tuple(f"c{i:02d}" for i in range(11))
SCENE = audience_scene(CHARACTERS)
HEADS = np.array([a.head_centre_m for a in SCENE.agents])
SEEN = unit(HEADS - PARTICIPANT_EYE_M)
DISTANCE_M = np.linalg.norm(HEADS - PARTICIPANT_EYE_M, axis=1)
RADIUS_DEG = np.degrees(np.arcsin([a.head_radius_m for a in SCENE.agents] / DISTANCE_M))


def test_nine_active_places_are_three_zones_by_three_depths() -> None:
    expected = {(z, d) for z in ("left", "centre", "right") for d in ("close", "middle", "far")}

    assert expected == {(zone_of(p), depth_of(p)) for p in ACTIVE_PLACES}
    assert len(ACTIVE_PLACES) == 9
    assert len(PLACES) == 11
    assert PLACES == tuple(a.place for a in SCENE.agents)


def test_zones_and_depths_follow_what_is_seen() -> None:
    yaw_deg, _ = yaw_pitch_deg_of(SEEN[:9])
    by_zone = {
        z: [y for p, y in zip(PLACES, yaw_deg, strict=False) if zone_of(p) == z]
        for z in ("left", "centre", "right")
    }
    by_depth = {
        d: [m for p, m in zip(ACTIVE_PLACES, DISTANCE_M, strict=False) if depth_of(p) == d]
        for d in ("close", "middle", "far")
    }

    assert min(by_zone["left"]) > max(by_zone["centre"])
    assert min(by_zone["centre"]) > max(by_zone["right"])
    assert max(by_depth["close"]) < min(by_depth["middle"])
    assert max(by_depth["middle"]) < min(by_depth["far"])


def test_nearest_head_is_at_least_a_metre_away() -> None:
    assert 1.0 <= DISTANCE_M.min() < 1.5


def test_every_head_lies_within_the_hundred_degrees_of_the_headset() -> None:
    yaw_deg, pitch_deg = yaw_pitch_deg_of(SEEN)

    assert 50 >= np.max(np.abs(yaw_deg) + RADIUS_DEG)
    assert 50 >= np.max(np.abs(pitch_deg) + RADIUS_DEG)


def test_heads_as_seen_stay_so_far_apart_that_one_degree_of_padding_is_never_cut() -> None:
    gap_deg = angle_deg(SEEN[:, None], SEEN[None]) - RADIUS_DEG[:, None] - RADIUS_DEG[None]
    np.fill_diagonal(gap_deg, np.inf)

    assert 2.0 < gap_deg.min()


def test_heads_do_not_stand_in_each_other() -> None:
    apart_m = np.linalg.norm(HEADS[:, None] - HEADS[None], axis=-1)
    np.fill_diagonal(apart_m, np.inf)

    assert 0.5 < apart_m.min()


def test_no_part_of_any_head_is_hidden_also_when_the_participant_leans() -> None:
    geometry = SceneGeometry.from_scene(SCENE)
    rng = np.random.default_rng(1)
    for lean_m in ([0, 0, 0], [0.08, 0, 0], [-0.08, 0, 0], [0, 0.05, 0], [0, -0.05, 0]):
        origin_m = PARTICIPANT_EYE_M + np.array(lean_m)
        for index, head_m in enumerate(HEADS):
            offset = unit(rng.normal(size=(200, 3))) * 0.12 * 0.95
            direction = unit(head_m + offset - origin_m)
            origins = np.repeat(origin_m[None], 200, axis=0)

            hit = geometry.observe(origins, direction, np.ones(200, np.bool_))[3]

            assert {index} == set(hit.tolist()), (SCENE.agents[index].place, lean_m)


def test_stage_front_hides_the_lower_bodies() -> None:
    geometry = SceneGeometry.from_scene(SCENE)
    front = geometry.capsules[11:17]  # three beams, each in two halves
    only_front = SceneGeometry(np.array([[*HEADS[3], 0.12]]), front, True)
    # A head-sized ball at seat height behind the front cannot be hit.
    lowered = HEADS[3] - np.array([0.0, 0.62, 0.0])
    seat = SceneGeometry(np.array([[*lowered, 0.05]]), front, True)
    direction = unit(lowered - PARTICIPANT_EYE_M)[None]
    valid = np.ones(1, np.bool_)

    assert -1 == seat.observe(PARTICIPANT_EYE_M[None], direction, valid)[3][0]
    assert 0 == only_front.observe(PARTICIPANT_EYE_M[None], SEEN[3:4], valid)[3][0]


@pytest.mark.parametrize("target_m", [PARTICIPANT_EYE_M, SPEAKER_EYE_M], ids=["user", "speaker"])
def test_eyes_reach_participant_and_speaker_within_thirty_degrees(target_m: np.ndarray) -> None:
    turn_deg = [angle_deg(unit(target_m - a.eye_centre_m), a.facing) for a in SCENE.agents]

    assert 30.0 >= max(turn_deg)


def test_eyes_turn_aside_as_far_in_every_place_and_no_farther_than_heads_let_them() -> None:
    """People who look at one point for long leave some 20° to their eyes, whatever their seat:
    half of the 44° that Stahl (1999) found eyes to keep within beside a free head. Where one seat
    asks for more than another, how white an averted eye looks depends on the place.
    """
    speaker, participant = (
        unit(np.array([target_m - a.eye_centre_m for a in SCENE.agents]))
        for target_m in (SPEAKER_EYE_M, PARTICIPANT_EYE_M)
    )
    facing = np.array([a.facing for a in SCENE.agents])
    yaw_deg = yaw_pitch_deg_of(facing)[0] - yaw_pitch_deg_of(speaker)[0]
    turn_deg = np.concatenate([angle_deg(speaker, facing), angle_deg(participant, facing)])

    np.testing.assert_allclose(20.0, (yaw_deg + 180.0) % 360.0 - 180.0, atol=1.5)
    assert 24.0 > turn_deg.max()


def test_looking_at_the_speaker_is_told_from_looking_at_the_participant() -> None:
    """A gaze cone of about five degrees still feels direct; averted eyes stay well outside."""
    apart_deg = [
        angle_deg(unit(PARTICIPANT_EYE_M - a.eye_centre_m), unit(SPEAKER_EYE_M - a.eye_centre_m))
        for a in SCENE.agents
    ]

    assert 10.0 < min(apart_deg)


def test_audience_is_turned_ten_degrees_in_the_room_on_average() -> None:
    yaw_deg, _ = yaw_pitch_deg_of(np.array([-a.facing for a in SCENE.agents]))

    assert pytest.approx(AUDIENCE_TURN_DEG) == PARTICIPANT_TURN_DEG - yaw_deg.mean()


def test_speaker_stands_behind_the_participant_on_the_left() -> None:
    assert SPEAKER_EYE_M[0] < PARTICIPANT_EYE_M[0]
    assert SPEAKER_EYE_M[2] > PARTICIPANT_EYE_M[2] + 1.0


def test_mark_stands_at_top_centre_clear_of_every_head() -> None:
    direction = unit(MARK_M - PARTICIPANT_EYE_M)
    yaw_deg, pitch_deg = yaw_pitch_deg_of(direction)

    assert pytest.approx(0.0) == yaw_deg
    assert 15 < pitch_deg < 25
    assert 5.0 < np.min(angle_deg(SEEN, direction) - RADIUS_DEG)


def test_scene_is_the_same_object_for_the_same_characters() -> None:
    assert audience_scene(list(CHARACTERS)) is SCENE
    assert audience_scene(CHARACTERS[::-1]) is not SCENE


def test_shuffled_characters_change_who_sits_there_and_nothing_else() -> None:
    other = audience_scene(CHARACTERS[::-1])

    assert CHARACTERS[::-1] == tuple(a.character for a in other.agents)
    for a, b in zip(SCENE.agents, other.agents, strict=True):
        assert (a.place, a.agent_id) == (b.place, b.agent_id)
        np.testing.assert_array_equal(a.head_centre_m, b.head_centre_m)


def test_black_scene_shows_the_mark_alone() -> None:
    black = black_scene(CHARACTERS)
    geometry = SceneGeometry.from_scene(black)
    angle, _, _, hit = geometry.observe(PARTICIPANT_EYE_M[None], SEEN[:1], np.ones(1, np.bool_))

    assert black.brightness_01 == 0
    assert black.mark_m is not None
    assert -1 == hit[0]
    assert angle[0, 0] < 1e-6
    assert training_scene(CHARACTERS).mark_m is None


@pytest.mark.parametrize("characters", [CHARACTERS[:8], (*CHARACTERS[:10], "c00")])
def test_missing_or_doubled_character_is_refused(characters: tuple[str, ...]) -> None:
    with pytest.raises(DesignError, match="11 different characters"):
        audience_scene(characters)


def test_unknown_place_names_the_known_ones() -> None:
    with pytest.raises(DesignError, match="left_close"):
        zone_of("balcony")


def test_who_cannot_sit_under_the_eyes_of_the_audience_is_named() -> None:
    giant = replace(scale_to_stature(load_character("anna"), 2.4), name="giant_F")
    scene = audience_scene(CHARACTERS)
    facing = np.array([a.facing for a in scene.agents])
    frame = SceneFrame(scene, 0, facing, np.ones(len(scene.agents)))
    with pytest.raises(MotionError, match=r"giant_F cannot sit at .* would need a seat"):
        audience_picture(frame, casting=lambda part: giant)


def test_a_tall_man_sits_on_a_low_chair_at_every_place_of_the_audience() -> None:
    # As far from seat to eyes as the tallest man of VALID, .90 m.
    tall = scale_to_stature(load_character("ike"), 2.02)
    scene = audience_scene(CHARACTERS)
    facing = np.array([a.facing for a in scene.agents])
    frame = SceneFrame(scene, 0, facing, np.ones(len(scene.agents)))
    speaker = load_character("gabriel")
    posed = audience_picture(frame, casting=lambda c: tall if c in CHARACTERS else speaker).people
    assert beyond_deg(posed.orientation_wxyz).max() < 1.0


ARM = ("hand", "forearm")


@dataclass(frozen=True)
class Seated:
    """Somebody of the audience: vertices (n, 3), which of them are of feet and of hands, and their
    chair: the middle of its seat's top and the ways aside and ahead.
    """

    place: str
    points_m: np.ndarray
    feet: np.ndarray
    hands: np.ndarray
    seat_m: np.ndarray
    aside: np.ndarray
    ahead: np.ndarray

    def from_seat(self, points_m: np.ndarray) -> np.ndarray:
        """Return points (n, 3) as aside, above the seat, and before its middle."""
        from_m = points_m - self.seat_m
        return np.stack([from_m @ self.aside, from_m[:, 1], from_m @ self.ahead], axis=1)


@pytest.fixture(scope="module", params=[0, 4])
def seated(request: pytest.FixtureRequest) -> list[Seated]:
    names = [f"{g}_{i:02d}" for g, n in (("female", 6), ("male", 5)) for i in range(1, n + 1)]
    scene = audience_scene(np.random.default_rng(request.param).permutation(names).tolist())
    frame = SceneFrame(scene, 0, np.tile([0.0, 0.0, 1.0], (11, 1)), np.ones(11))
    picture = audience_picture(frame)
    found = []
    for i, agent in enumerate(scene.agents):
        person, people = picture.cast[i], picture.people
        mesh, body = (
            person.levels[0],
            forward(person.skeleton, people.root_m[i], people.orientation_wxyz[i]),
        )
        of_feet = np.isin(mesh.triangle_part, [PARTS.index(f"{s}_foot") for s in ("left", "right")])
        feet = np.unique(mesh.triangles[of_feet])
        of_hands = [PARTS.index(f"{s}_{part}") for s in ("left", "right") for part in ARM]
        hands = np.zeros(len(mesh.vertices_m), bool)
        hands[mesh.triangles[np.isin(mesh.triangle_part, of_hands)]] = True
        chair = next(p for p in picture.room.props if p.name == f"chair_{agent.place}_frame")
        seat = chair.blocks[0]
        ahead = agent.facing
        middle = np.array(seat.at_m) + [0.0, seat.high_m, 0.0] + 0.02 * ahead
        aside = np.array([ahead[2], 0.0, -ahead[0]])
        points = skin_vertices(mesh, person.skeleton, body)
        found.append(Seated(agent.place, points, feet, hands, middle, aside, ahead))
    return found


def test_everybody_sits_back_in_their_chair(seated: list[Seated]) -> None:
    """They were perched 12 to 23 cm before its back."""
    back_m = -0.225
    gap_m = {}
    for one in seated:
        aside, above, before = one.from_seat(one.points_m).T
        by_back = (np.abs(aside) < 0.215) & (above > 0.16) & (above < 0.50)
        gap_m[one.place] = float(before[by_back].min() - back_m)
    assert {} == {place: gap for place, gap in gap_m.items() if not -0.03 < gap < 0.07}


def test_everybody_sinks_two_centimetres_into_their_cushion(seated: list[Seated]) -> None:
    """They sat up to 2 cm above it, imported people up to 3 cm."""
    deepest_m = {}
    for one in seated:
        aside, above, before = one.from_seat(one.points_m[~one.hands]).T
        on_seat = (np.abs(aside) < 0.18) & (before > -0.20) & (before < 0.12) & (above > -0.10)
        deepest_m[one.place] = float(above[on_seat].min())

    assert {} == {place: m for place, m in deepest_m.items() if not -0.03 < m < -0.01}


def test_feet_of_the_audience_are_on_their_own_step(seated: list[Seated]) -> None:
    """Toes of most hung over its edge, by up to 35 cm."""
    over_m = {}
    for one in seated:
        lowest_m = one.points_m[:, 1].min()
        step_m = min(STEP_HEIGHTS_M, key=lambda height: abs(height - lowest_m))
        room_m = min(room_before_m(point, step_m) for point in one.points_m[one.feet])
        over_m[one.place] = -room_m
    assert {} == {place: over for place, over in over_m.items() if over > 0.03}


def test_no_shoe_is_in_the_seat_of_somebody_else(seated: list[Seated]) -> None:
    """In every audience some were, by up to 20 cm."""
    deepest_m = {}
    for one in seated:
        for other in seated:
            aside, above, before = one.from_seat(other.points_m[other.feet]).T
            within = (np.abs(aside) < 0.225) & (above < 0.0) & (above > -0.05) & (before < 0.2)
            deep_m = np.max(before[within] + 0.24, initial=0.0)
            if other is not one and deep_m > 0.02:
                deepest_m[other.place, one.place] = float(deep_m)
    assert {} == deepest_m

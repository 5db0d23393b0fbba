"""Films in a ring of corridors: cuts keep the rules, the camera keeps clear, rates agree."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stimuli.camera.outlined import outlined_room
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.choosing import Clearance, is_free, place_on, points_of_interest
from visavis.stimuli.camera.director import (
    NO_CUTS,
    NO_PLACE,
    STYLES,
    Cut,
    Director,
    FilmedPlace,
    Moment,
    Style,
    prepare,
)
from visavis.stimuli.camera.obstacles import NOBODY, sees
from visavis.stimuli.camera.shots import LogNormalLengths, ShotSize, view_angle_deg

RING = [[0, 0], [16, 0], [16, 12], [0, 12]]
BLOCK = [[4, 4], [12, 4], [12, 8], [4, 8]]
SPEED_MPS = 1.3
CORNERS = np.array([[2.0, 2.0], [14.0, 2.0], [14.0, 10.0], [2.0, 10.0], [2.0, 2.0]])
FULL_CUTS = Style(ShotSize.FULL, lengths=LogNormalLengths(2.0, 0.3))


def above(place_m: Vector, by_m: float) -> Vector:
    return place_m + np.array([0.0, by_m, 0.0])


@pytest.fixture(scope="module")
def place() -> FilmedPlace:
    return prepare(outlined_room("ring", RING, [BLOCK], 3.0), seed=1)


def walking(t_ns: int) -> Moment:
    """Walk round the block while somebody else comes the other way."""
    passed = np.concatenate([[0], np.linalg.norm(np.diff(CORNERS, axis=0), axis=1).cumsum()])
    x, z, ox, oz = (
        np.interp(way % passed[-1], passed, CORNERS[:, k])
        for way in (SPEED_MPS * t_ns / NS_PER_S, passed[-1] - 1.1 * t_ns / NS_PER_S)
        for k in (0, 1)
    )
    other = np.array([[ox + 0.5, 0.2, oz, ox + 0.5, 1.5, oz, 0.22]])
    return Moment(np.array([x, 0.0, z]), 1.75, other)


def filmed(place: FilmedPlace, style: Style, rate_hz: int, seconds: int, seed: int = 3):
    director = Director(place, style, walking, seed=seed)
    times = [k * NS_PER_S // rate_hz for k in range(seconds * rate_hz)]
    return director, times, [director.view_at(t) for t in times]


def test_films_of_30_60_and_90_pictures_a_second_show_the_same(place: FilmedPlace) -> None:
    at_30, at_60, at_90 = (filmed(place, FULL_CUTS, hz, 8)[2] for hz in (30, 60, 90))

    for k, view in enumerate(at_30):
        for other in (at_60[2 * k], at_90[3 * k]):
            np.testing.assert_allclose(view.position_m, other.position_m, atol=1e-6)
            np.testing.assert_allclose(view.looks_at_m, other.looks_at_m, atol=1e-6)


def test_camera_keeps_clear_of_walls_and_below_its_speed(place: FilmedPlace) -> None:
    for style in STYLES.values():
        director, times, views = filmed(place, style, 30, 12)
        cuts = {c.t_ns for c in director.cuts}
        for t, a, b in zip(times[1:], views, views[1:], strict=False):
            assert not place.obstacles.is_near(b.position_m, style.clear_m - 1e-9)
            if t not in cuts:
                assert place.obstacles.sees(a.position_m, b.position_m)
                step_m = np.linalg.norm(b.position_m - a.position_m)
                assert step_m <= style.drive.max_speed_mps / 30 + 1e-6


def alternatives(place: FilmedPlace, style: Style, cut: Cut) -> int:
    """Count the places a cut could have gone to that see the head and turn the view enough."""
    graph, moment = place.graph, walking(cut.t_ns)
    edge, share = np.empty(3 * len(graph.edges), np.int64), np.empty(3 * len(graph.edges))
    n = points_of_interest(cut.subject_m, 3.0, 100.0, graph.network, -1, edge, share)
    clearance = Clearance(place.obstacles.arrays, moment.people, 0.1, 0.15)
    head = above(moment.subject_m, 0.93 * moment.height_m)
    places = [place_on(graph.nodes_m, graph.edges, edge[i], share[i]) for i in range(n)]
    return sum(
        view_angle_deg(cut.subject_m, cut.from_m, p) >= style.min_angle_deg
        and is_free(p, clearance)
        and place.obstacles.sees(p, head, moment.people)
        for p in places
    )


def test_cuts_turn_the_view_by_30_degrees_wherever_that_is_possible(place: FilmedPlace) -> None:
    director, _, _ = filmed(place, FULL_CUTS, 30, 40)
    later = director.cuts[1:]

    assert len(later) >= 8
    for cut in later:
        assert cut.angle_deg >= 30.0 or not alternatives(place, FULL_CUTS, cut)


def test_no_shot_is_shorter_than_the_shortest(place: FilmedPlace) -> None:
    style = replace(FULL_CUTS, min_shot_s=1.5, lengths=LogNormalLengths(0.1, 0.0))
    director, _, _ = filmed(place, style, 30, 15)

    assert len(director.cuts) > 3
    assert min(np.diff([c.t_ns for c in director.cuts])) >= 1.5 * NS_PER_S


def test_style_without_cuts_has_one_shot_and_a_static_camera_stands(place: FilmedPlace) -> None:
    one, _, _ = filmed(place, STYLES["medium-no-cuts"], 30, 10)
    static, times, views = filmed(place, STYLES["extreme-long-static"], 30, 10)
    cuts = {c.t_ns for c in static.cuts}

    assert ["start"] == [c.reason for c in one.cuts]
    for t, a, b in zip(times[1:], views, views[1:], strict=False):
        assert t in cuts or (a.position_m == b.position_m).all()


def test_subject_is_seen_and_a_person_who_hides_it_causes_a_cut(place: FilmedPlace) -> None:
    subject = np.array([8.0, 0.0, 2.0])
    quiet = Director(place, FULL_CUTS, lambda _: Moment(subject, 1.75), seed=1)
    camera = quiet.view_at(0).position_m
    head = above(subject, 0.93 * 1.75)
    between = 0.5 * (camera + head)
    stands = np.array([[*above(between, -0.3), *above(between, 0.3), 0.25]])

    def hidden_from_two_seconds(t_ns: int) -> Moment:
        return Moment(subject, 1.75, stands if t_ns >= 2 * NS_PER_S else NOBODY)

    style = replace(FULL_CUTS, moves=False, lengths=LogNormalLengths(60.0, 0.0))
    director = Director(place, style, hidden_from_two_seconds, seed=1)
    director.view_at(4 * NS_PER_S)

    assert ["start", "hidden"] == [c.reason for c in director.cuts]
    assert 2.2 <= director.cuts[1].t_ns / NS_PER_S <= 2.3
    assert director.sees_subject


def test_a_hidden_subject_breaks_the_shortest_shot(place: FilmedPlace) -> None:
    subject = np.array([8.0, 0.0, 2.0])
    style = replace(FULL_CUTS, moves=False, min_shot_s=5.0, lengths=LogNormalLengths(60.0, 0.0))
    quiet = Director(place, style, lambda _: Moment(subject, 1.75), seed=1)
    between = 0.5 * (quiet.view_at(0).position_m + above(subject, 0.93 * 1.75))
    stands = np.array([[*above(between, -0.3), *above(between, 0.3), 0.25]])

    def hidden_from_the_second_tenth(t_ns: int) -> Moment:
        return Moment(subject, 1.75, stands if t_ns >= NS_PER_S // 10 else NOBODY)

    director = Director(place, style, hidden_from_the_second_tenth, seed=1)
    director.view_at(2 * NS_PER_S)
    assert ["start", "hidden"] == [c.reason for c in director.cuts]
    assert 0.3 <= director.cuts[1].t_ns / NS_PER_S <= 0.4
    assert [] == director.hidden


def test_no_cut_goes_to_a_place_from_which_the_subject_will_be_hidden_within_a_second(
    place: FilmedPlace,
) -> None:
    style = replace(FULL_CUTS, moves=False, lengths=LogNormalLengths(2.0, 0.0))
    velocity = np.array([SPEED_MPS, 0.0, 0.0])

    def second_cut(people: Vector) -> tuple[Cut, Vector]:
        """Return the cut after the first shot, and where the head is then."""

        def walks_by(t_ns: int) -> Moment:
            return Moment(np.array([4.0, 0.0, 2.0]) + velocity * t_ns / NS_PER_S, 1.75, people)

        director = Director(place, style, walks_by, seed=1)
        director.view_at(3 * NS_PER_S)
        cut = director.cuts[1]
        return cut, above(walks_by(cut.t_ns).subject_m, 0.93 * 1.75)

    usual, head = second_cut(NOBODY)
    near_the_later_head = 0.1 * usual.to_m + 0.9 * (head + velocity)
    stands = np.array([[*above(near_the_later_head, -0.1), *near_the_later_head, 0.15]])
    chosen, _ = second_cut(stands)
    assert usual.t_ns == chosen.t_ns
    surfaces = place.obstacles.arrays
    assert sees(usual.to_m, head, stands, *surfaces)
    assert not sees(usual.to_m, head + velocity, stands, *surfaces)
    assert sees(chosen.to_m, head + velocity, stands, *surfaces)


def test_a_subject_who_stays_hidden_is_in_the_log_with_the_reason(place: FilmedPlace) -> None:
    subject = np.array([8.0, 0.0, 2.0])
    turns = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    posts = [subject + np.array([np.cos(a), 0.0, np.sin(a)]) for a in turns]
    around = [[*post, *above(post, 4.0), 0.6] for post in posts]

    def walled_in(t_ns: int) -> Moment:
        is_hidden = NS_PER_S <= t_ns < 2 * NS_PER_S
        return Moment(subject, 1.75, np.array(around) if is_hidden else NOBODY)

    for style, why in ((FULL_CUTS, NO_PLACE), (replace(FULL_CUTS, cuts=False), NO_CUTS)):
        director = Director(place, replace(style, moves=False), walled_in, seed=1)
        director.view_at(3 * NS_PER_S)
        (hidden,) = director.hidden
        assert hidden.why == why
        assert 0.8 <= hidden.seconds <= 1.1
        assert 0.9 <= hidden.t_ns / NS_PER_S <= 1.1


def test_same_seed_gives_the_same_film_and_another_seed_other_lengths(place: FilmedPlace) -> None:
    cuts = [[c.t_ns for c in filmed(place, FULL_CUTS, 30, 20, seed)[0].cuts] for seed in (3, 3, 4)]
    assert cuts[0] == cuts[1]
    assert cuts[0] != cuts[2]


def test_camera_is_not_asked_backwards(place: FilmedPlace) -> None:
    director = Director(place, FULL_CUTS, walking)
    director.view_at(NS_PER_S)
    with pytest.raises(DesignError, match="go forward"):
        director.view_at(0)

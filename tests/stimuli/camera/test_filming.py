"""Cameras that films of studies are compared by: one that follows, several that take turns."""

from collections.abc import Callable

import numpy as np
import pytest

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.director import Moment
from visavis.stimuli.camera.filming import FilmingCamera, Follower, TakingTurns
from visavis.stimuli.camera.obstacles import Obstacles

AHEAD = np.array([0.0, 0.0, -1.0])


def wall(z: float) -> Obstacles:
    """Return a wall 6 m wide and 3 m high at a z, and nothing else."""
    a, b, c, d = ([-3.0, 0.0, z], [3.0, 0.0, z], [3.0, 3.0, z], [-3.0, 3.0, z])
    return Obstacles.of_triangles(np.array([[a, b, c], [a, c, d]]))


def walking(t_ns: int) -> Moment:
    """Return somebody who walks ahead at 1.2 m/s."""
    return Moment(np.array([0.0, 0.0, 2.0 - 1.2 * t_ns / NS_PER_S]), 1.75)


def follower(obstacles: Obstacles) -> Follower:
    return Follower(obstacles, walking, lambda _: AHEAD)


def turns(obstacles: Obstacles, moment: Callable[[int], Moment] = walking) -> TakingTurns:
    return TakingTurns(obstacles, ((-2.0, 2.5, 4.0), (2.0, 2.5, -6.0)), moment, min_shot_s=1.0)


@pytest.mark.parametrize("make", [follower, turns])
def test_films_of_30_60_and_90_pictures_a_second_show_the_same(
    make: Callable[[Obstacles], FilmingCamera],
) -> None:
    films = []
    for factor in (1, 2, 3):
        camera, rate = make(wall(20.0)), 30 * factor
        views = [camera.view_at(k * NS_PER_S // rate) for k in range(4 * rate)]
        films.append([np.r_[v.position_m, v.looks_at_m] for v in views[::factor]])
    assert np.allclose(films[0], films[1], atol=1e-6)
    assert np.allclose(films[0], films[2], atol=1e-6)


def test_a_camera_behind_somebody_stays_before_the_wall_behind_them() -> None:
    obstacles = wall(3.2)  # 1.2 m behind where they start; 2.6 m is what the camera would like
    camera = follower(obstacles)
    places = [camera.view_at(k * NS_PER_S // 30).position_m for k in range(90)]
    assert max(p[2] for p in places) <= 3.05
    head = walking(89 * NS_PER_S // 30).subject_m
    assert np.linalg.norm((places[-1] - head)[[0, 2]]) > 2.0
    assert camera.cut_ns == ()


def test_it_comes_round_smoothly_when_they_turn() -> None:
    def front(t_ns: int) -> Vector:
        return AHEAD if t_ns < NS_PER_S else np.array([1.0, 0.0, 0.0])

    still = Moment(np.zeros(3), 1.75)
    camera = Follower(wall(20.0), lambda _: still, front)
    places = np.array([camera.view_at(k * NS_PER_S // 30).position_m for k in range(120)])
    assert places[0] @ AHEAD < -2.0
    assert places[-1][0] < -2.0
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 0.2


def test_another_camera_takes_over_where_somebody_is_hidden_and_never_too_soon() -> None:
    def moment(t_ns: int) -> Moment:
        stands = Moment(np.zeros(3), 1.75)
        between = np.array([[-0.5, 0.3, 1.0, -0.5, 2.4, 1.0, 0.6]])  # before the first camera
        return stands if t_ns < NS_PER_S // 2 else Moment(stands.subject_m, 1.75, between)

    camera = turns(wall(20.0), moment)
    views = [camera.view_at(k * NS_PER_S // 30) for k in range(60)]
    (cut_ns,) = camera.cut_ns
    assert NS_PER_S <= cut_ns < 1.1 * NS_PER_S
    assert (-2.0, 2.0) == (views[0].position_m[0], views[-1].position_m[0])


def test_without_a_place_nothing_can_be_filmed() -> None:
    with pytest.raises(DesignError, match="no camera was placed"):
        TakingTurns(wall(20.0), (), walking)

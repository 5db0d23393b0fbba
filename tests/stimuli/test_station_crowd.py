import numpy as np
import pytest

from visavis.lab.errors import DesignError
from visavis.stimuli.scenes.station_crowd import (
    BOARD_M,
    CONFIGURATIONS,
    PHONING,
    READ_WITHIN_M,
    SIDE_M,
    SPACING_M,
    START_M,
    WAITING,
    body_radius_m,
    can_read,
    density_per_m2,
    in_room,
    max_people,
    poisson_disk,
    station_crowd,
)

ALL = range(1, CONFIGURATIONS + 1)


@pytest.mark.parametrize("configuration", ALL)
def test_every_configuration_has_the_published_density(configuration):
    assert density_per_m2(station_crowd(configuration)) == pytest.approx(1.47, abs=0.06)


@pytest.mark.parametrize("density", [0.3, 0.8, 1.0, 2.0, 2.5])
def test_a_crowd_can_be_thinner_or_denser(density):
    for configuration in (0, 1, 8):
        crowd = station_crowd(configuration, density)
        assert density_per_m2(crowd) == pytest.approx(density, rel=0.06 / 1.47)
        assert len(crowd) <= max_people(density)
        apart = np.linalg.norm(crowd.position_m[:, None] - crowd.position_m, axis=2)
        assert crowd.spacing_m <= apart[apart > 0].min()


@pytest.mark.parametrize("density", [0.29, 2.51, float("nan")])
def test_a_crowd_nobody_can_stand_in_or_meet_is_refused(density):
    with pytest.raises(DesignError, match=r"0\.3 to 2\.5"):
        station_crowd(1, density)


def gaps_m(crowd):
    """Return what is free between neighbours (k,): their distance less both bodies along it."""
    a, b = crowd.neighbours.T
    between = crowd.position_m[b] - crowd.position_m[a]
    distance = np.linalg.norm(between, axis=1)
    direction = between / distance[:, None]
    free = distance - body_radius_m(crowd, a, direction) - body_radius_m(crowd, b, direction)
    return free


@pytest.mark.parametrize("configuration", ALL)
def test_neighbours_leave_six_tenths_of_a_metre_on_average(configuration):
    gaps = gaps_m(station_crowd(configuration))
    assert gaps.mean() == pytest.approx(0.60, abs=0.04)
    assert gaps.min() > 0.15


@pytest.mark.parametrize("configuration", ALL)
def test_nobody_stands_closer_than_the_spacing_or_outside_the_square(configuration):
    at = station_crowd(configuration).position_m
    apart = np.linalg.norm(at[:, None] - at, axis=2)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() >= SPACING_M
    assert np.abs(at).max() <= SIDE_M / 2


def test_configurations_differ_and_repeat():
    first = station_crowd(1).position_m
    station_crowd.cache_clear()
    np.testing.assert_array_equal(first, station_crowd(1).position_m)
    assert not np.array_equal(first[:50], station_crowd(2).position_m[:50])


def test_who_waits_faces_the_board_and_who_telephones_faces_anywhere():
    angles = {WAITING: [], PHONING: []}
    for configuration in ALL:
        crowd = station_crowd(configuration)
        facing = np.stack([-np.sin(crowd.yaw_rad), -np.cos(crowd.yaw_rad)], axis=1)
        to_board = np.array([BOARD_M[0], BOARD_M[2]]) - crowd.position_m
        to_board /= np.linalg.norm(to_board, axis=1, keepdims=True)
        angle = np.degrees(np.arccos(np.clip((facing * to_board).sum(axis=1), -1, 1)))
        for behaviour, found in angles.items():
            found += angle[crowd.behaviour == behaviour].tolist()
    assert np.percentile(angles[WAITING], 95) < 35
    assert np.mean(angles[PHONING]) == pytest.approx(90, abs=10)


def test_board_is_readable_only_within_two_metres():
    x, z = BOARD_M[0], BOARD_M[2]
    assert can_read(x - READ_WITHIN_M + 0.01, z)
    assert not can_read(x - READ_WITHIN_M - 0.01, z)
    assert not can_read(*START_M)


def test_start_mark_lies_in_the_room_and_outside_the_crowd():
    assert in_room(np.array(START_M))
    assert max(abs(START_M[0]), abs(START_M[1])) > SIDE_M / 2
    assert not in_room(np.array([5.1, 0.0]))


def test_unknown_configuration_is_refused_with_those_there_are():
    with pytest.raises(DesignError, match="1 to 8"):
        station_crowd(9)


def test_poisson_disk_is_full():
    points = poisson_disk(6.0, 0.7, np.random.default_rng(3))
    corners = np.stack(np.meshgrid(*[np.linspace(0, 6, 61)] * 2), axis=-1).reshape(-1, 2)
    nearest = np.linalg.norm(corners[:, None] - points, axis=2).min(axis=1)
    # a hole of more than two spacings could still hold a point
    assert nearest.max() < 2 * 0.7

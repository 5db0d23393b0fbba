"""Collisions over time: runs, minimum duration, lost steps."""

import numpy as np
import pytest

from visavis.analysis.collisions import (
    MalformedSeries,
    box,
    common_volume,
    find_collisions,
    nearest_part,
    speed_at,
)

STEP_NS = 10_000_000


def found(*volumes: float, **options: object):
    t_ns = np.arange(len(volumes), dtype=np.int64) * STEP_NS
    return find_collisions(t_ns, np.array(volumes)[:, None], "volume", **options)


def test_run_lasts_from_its_first_to_its_last_step() -> None:
    (one,) = found(0, 2e-6, 5e-6, 3e-6, 0)
    assert (STEP_NS, 3 * STEP_NS, 3, 2 * STEP_NS) == (
        one.start_ns,
        one.end_ns,
        one.n_steps,
        one.peak_ns,
    )
    assert one.max_volume_m3 == 5e-6
    assert one.duration_s == pytest.approx(0.02)
    assert one.counted
    assert not one.cut
    assert one.rule == "volume"


def test_two_steps_last_exactly_the_minimum_and_do_not_count() -> None:
    assert [False] == [c.counted for c in found(0, 2e-6, 2e-6, 0)]
    assert [True] == [c.counted for c in found(0, 2e-6, 2e-6, 2e-6, 0)]


def test_threshold_itself_is_no_contact() -> None:
    assert found(0, 1e-6, 0) == ()


def test_lost_step_ends_a_run_and_marks_both_sides() -> None:
    first, second = found(0, 2e-6, 2e-6, np.nan, 2e-6, 0)
    assert (first.n_steps, second.n_steps) == (2, 1)
    assert first.cut
    assert second.cut


def test_contact_at_the_ends_is_cut() -> None:
    first, second = found(2e-6, 0, 2e-6)
    assert first.cut
    assert second.cut


def test_characters_are_kept_apart() -> None:
    t_ns = np.arange(4, dtype=np.int64) * STEP_NS
    volumes = np.array([[0, 0], [2e-6, 2e-6], [2e-6, 0], [0, 3e-6]])
    got = find_collisions(t_ns, volumes, "centres")
    assert [(0, 2), (1, 1), (1, 1)] == [(c.character, c.n_steps) for c in got]


@pytest.mark.parametrize(
    ("t_ns", "volumes"),
    [([0, 10], [[0.0]]), ([0, 0], [[0.0], [0.0]]), ([0, 1], [[0.0], [-1.0]])],
)
def test_series_that_do_not_fit_are_refused(t_ns: list[int], volumes: list[list[float]]) -> None:
    with pytest.raises(MalformedSeries):
        find_collisions(np.array(t_ns), np.array(volumes), "volume")


def test_speed_is_that_of_the_step_around_the_time() -> None:
    t_ns = np.array([0, 10, 30]) * 1_000_000
    position = np.array([[0.0, 0.0], [0.01, 0.0], [0.01, 0.04]])
    assert 1.0 == pytest.approx(speed_at(t_ns, position, 5_000_000))
    assert 2.0 == pytest.approx(speed_at(t_ns, position, 30_000_000))
    assert np.isnan(speed_at(t_ns, position, 31_000_000))
    assert np.isnan(speed_at(t_ns, position, -1))


def test_nearest_part_is_by_surface_not_by_axis() -> None:
    starts = np.array([[0.0, 0, 0], [0.0, 1, 0]])
    ends = np.array([[1.0, 0, 0], [1.0, 1, 0]])
    part, gap = nearest_part(np.array([0.5, 0.45, 0.0]), starts, ends, np.array([0.1, 0.4]))
    assert part == 1
    assert gap == pytest.approx(0.15)


def test_one_cube_in_common_is_contact_and_an_empty_one_is_not() -> None:
    body = box([0.005, 0.005, 0.005], [0.004] * 3)
    one = common_volume(body, body, "published").volume_m3
    assert 1e-6 == pytest.approx(one)
    t_ns = np.arange(4, dtype=np.int64) * 10_000_000
    runs = find_collisions(t_ns, np.array([[0.0], [one], [one], [0.0]]), "published")
    assert [(10_000_000, 20_000_000)] == [(c.start_ns, c.end_ns) for c in runs]

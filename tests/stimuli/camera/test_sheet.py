"""The objective sheet of a film says of hand-made camera ways what can be counted by hand."""

import numpy as np
import pytest

from visavis.lab.geometry import Pose, Vector
from visavis.stimuli.camera.obstacles import NOBODY
from visavis.stimuli.camera.sheet import FilmLog
from visavis.stimuli.camera.shots import ShotSize
from visavis.stimuli.picture import Camera
from visavis.stimuli.rooms.plain import plain_room

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
HEAD = np.array([0.0, 1.6, 0.0])
STEP_NS = 40_000_000


def filmed(places: list[list[float]], heads: Vector | None = None, **options: object) -> FilmLog:
    """Note one picture a place."""
    log = FilmLog(ShotSize.FULL)
    room, people = plain_room(), options.get("people", NOBODY)
    for k, place in enumerate(places):
        camera = Camera(Pose(np.array(place), LEVEL), -0.5, 0.5, -0.3, 0.3)
        log.add(k * STEP_NS, camera, HEAD if heads is None else heads[k], room, people)  # type: ignore[arg-type]
    return log


def test_shots_are_counted_by_jumps_and_timed() -> None:
    sheet = filmed([[0, 1.6, 2.0]] * 50 + [[2.0, 1.6, 0.0]] * 25).sheet()
    assert (2, 75, 0) == (sheet.shots, sheet.pictures, sheet.cuts_below_30_deg)
    assert pytest.approx((3.0, 1.5)) == (sheet.seconds, sheet.mean_shot_s)


def test_a_cut_that_turns_the_view_by_less_than_30_degrees_breaks_the_rule() -> None:
    sheet = filmed([[0, 1.6, 1.0]] * 10 + [[0.05, 1.6, 2.3]] * 10).sheet()
    assert 1 == sheet.cuts_below_30_deg


def test_a_cut_to_the_other_side_of_where_somebody_walks_crosses_the_line() -> None:
    walk = np.array([[0.05 * k - 0.5, 1.6, 0.0] for k in range(20)])
    across = [[0.0, 1.6, 2.0]] * 10 + [[0.0, 1.6, -2.0]] * 10
    along = [[0.0, 1.6, 2.0]] * 10 + [[1.9, 1.6, 0.6]] * 10
    assert [1, 0] == [filmed(way, walk).sheet().lines_crossed for way in (across, along)]
    assert 0 == filmed(across).sheet().lines_crossed


def test_jerk_is_the_third_derivative_within_shots() -> None:
    t_s = np.arange(60) * STEP_NS / 1e9
    smooth = [[float(0.1 * t**3), 1.6, 1.0] for t in t_s]
    assert pytest.approx(0.6, rel=1e-6) == filmed(smooth).sheet().jerk_mps3
    assert (
        pytest.approx(0.0, abs=1e-9)
        == filmed([[0, 1.6, 2]] * 9 + [[2, 1.6, 0]] * 9).sheet().jerk_mps3
    )


def test_a_camera_in_a_wall_or_in_somebody_collides() -> None:
    somebody = np.array([[1.0, 0.3, 0.0, 1.0, 1.6, 0.0, 0.22]])
    wall = [[3.19, 1.6, 0.0]] * 3
    assert 3 == filmed([*wall, [0, 1.6, 2.0]]).sheet().collisions
    assert 2 == filmed([[1.1, 1.2, 0.0]] * 2 + [[0, 1.6, 2.0]], people=somebody).sheet().collisions


def test_time_until_somebody_is_seen_again_and_size_in_the_picture() -> None:
    log = filmed([[0, 0.96, 2.0]] * 30)
    log.visibility += [(k * 250_000_000, k not in (2, 3, 7)) for k in range(10)]
    sheet = log.sheet()
    assert pytest.approx((0.7, 0.375, 0.5)) == (sheet.seen_01, sheet.lost_s, sheet.longest_lost_s)
    share = 1.6 / (2 * 2.0 * 0.3)
    assert pytest.approx(share / 0.8) == sheet.size_off_by

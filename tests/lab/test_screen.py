"""A screen shows what lies behind it, from wherever the eyes are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.geometry import Pose
from visavis.lab.screen import FlatScreen
from visavis.stage.geometry.projection import projection, view
from visavis.stimuli.picture import Camera

SCREEN = FlatScreen(0.5, 0.3, 1000, 600, 0.6)
HERE = np.zeros(3)


def clip_of(screen, eye_m, point_m):
    """The corner-to-corner place (−1 to 1) at which the renderer's own matrices put a point."""
    seen = screen.view_from(np.array(eye_m))
    bounds = (seen.tangent_left, seen.tangent_right, seen.tangent_bottom, seen.tangent_top)
    pose = Pose(np.array(eye_m, float), np.array(seen.orientation_wxyz))
    at = projection(Camera(pose, *bounds)) @ view(pose) @ np.array([*point_m, 1.0])
    return at[:2] / at[3]


def test_a_centred_eye_sees_as_wide_as_the_screen_is():
    seen = SCREEN.view_from(HERE)
    assert (seen.tangent_left, seen.tangent_right) == pytest.approx((-0.25 / 0.6, 0.25 / 0.6))
    assert (seen.tangent_bottom, seen.tangent_top) == pytest.approx((-0.15 / 0.6, 0.15 / 0.6))


@pytest.mark.parametrize("eye_m", [(0, 0, 0), (0.1, 0, 0), (-0.2, 0.15, 0.3), (0.4, -0.3, -0.3)])
def test_corners_of_the_screen_are_corners_of_the_picture_from_every_place(eye_m):
    left, right, bottom, top = SCREEN.edges_m()
    assert clip_of(SCREEN, eye_m, (left, top, -0.6)) == pytest.approx((-1, 1))
    assert clip_of(SCREEN, eye_m, (right, bottom, -0.6)) == pytest.approx((1, -1))


def test_a_thing_behind_the_screen_moves_with_the_eyes():
    """Twice as far as the screen: the line from the eye crosses the screen half-way."""
    assert clip_of(SCREEN, (0, 0, 0), (0.1, 0.0, -1.2)) == pytest.approx((0.05 / 0.25, 0))
    assert clip_of(SCREEN, (0.1, 0, 0), (0.1, 0.0, -1.2)) == pytest.approx((0.1 / 0.25, 0))
    assert clip_of(SCREEN, (-0.1, 0, 0), (0.1, 0.0, -1.2)) == pytest.approx((0.0, 0))


def test_a_screen_beside_the_eyes_is_seen_aslant():
    aside = FlatScreen(0.5, 0.3, 1000, 600, 0.6, 0.25, -0.15)
    seen = aside.view_from(HERE)
    assert (seen.tangent_left, seen.tangent_top) == pytest.approx((0.0, 0.0))
    assert aside.meets_m(HERE[None], np.array([[0.0, 0.0, -1.0]])) == pytest.approx(
        np.array([[0.0, 0.0, -0.6]])
    )


places = st.tuples(*[st.floats(-0.2, 0.2)] * 3).map(np.array)
shares = st.tuples(st.floats(-0.99, 0.99), st.floats(-0.99, 0.99))


@given(eye_m=places, drawn_m=places, share=shares, depth=st.floats(0.2, 20))
def test_who_looks_at_a_pixel_looks_at_what_was_drawn_there(eye_m, drawn_m, share, depth):
    """Drawn for one place and looked at from another: the ray leads to the thing drawn."""
    point = np.array([share[0] * 0.25, share[1] * 0.15, -0.6])
    thing = drawn_m + (point - drawn_m) * (1 + depth)
    gaze = (point - eye_m) / np.linalg.norm(point - eye_m)
    seen = SCREEN.seen_through(drawn_m, eye_m[None], gaze[None])[0]
    expected = (thing - drawn_m) / np.linalg.norm(thing - drawn_m)
    assert seen == pytest.approx(expected, abs=1e-9)


def test_pixels_count_from_the_top_left():
    points = np.array([[-0.25, 0.15, -0.6], [0.0, 0.0, -0.6], [0.25, -0.15, -0.6]])
    assert SCREEN.pixels_of(points) == pytest.approx(np.array([[0, 0], [500, 300], [1000, 600]]))


def test_gaze_away_from_the_screen_meets_nothing():
    away = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [np.nan, 0.0, -1.0]])
    met = SCREEN.meets_m(np.zeros((3, 3)), away)
    assert np.isnan(met).all()
    assert not SCREEN.is_on(met).any()
    beside = SCREEN.meets_m(np.zeros((1, 3)), np.array([[0.6, 0.0, -0.8]]))
    assert beside == pytest.approx(np.array([[0.45, 0.0, -0.6]]))
    assert not SCREEN.is_on(beside)[0]

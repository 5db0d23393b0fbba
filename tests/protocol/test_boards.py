"""Boards pointed at: what points, where along, and which choice it meets."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.geometry import Pose, rotate, turn_towards, unit
from visavis.protocol.plan.steps import BodyView, FrameView
from visavis.protocol.session.boards import choice_under, newer_ray
from visavis.stimuli.panels import choice_centre_m
from visavis.stimuli.picture import Panel

AHEAD = np.array([0.0, 0.0, -1.0])
AT = Pose(np.array([0.0, 1.12, -1.7]), np.array([1.0, 0.0, 0.0, 0.0]))
BOARDS = tuple(Panel("?", tuple(map(str, range(n))), AT, (1.5, 0.5)) for n in (5, 9))


def ray(origin, target):
    way = unit(np.asarray(target, float) - origin)
    return Pose(np.asarray(origin, float), turn_towards(way))


@pytest.mark.parametrize("board", BOARDS)
def test_a_ray_to_the_middle_of_a_choice_chooses_it(board):
    for i in range(len(board.choices)):
        assert i == choice_under(ray((0.2, 1.1, -0.3), choice_centre_m(board, i)), board)


def test_a_ray_away_from_the_board_chooses_nothing():
    board = BOARDS[0]
    assert choice_under(ray((0.0, 1.6, 0.0), (0.0, 1.6, 5.0)), board) is None
    assert choice_under(ray((0.0, 1.6, 0.0), (4.0, 1.6, -1.7)), board) is None
    assert choice_under(ray((0.0, 1.1, -3.0), choice_centre_m(board, 2)), board) is None
    assert choice_under(None, board) is None


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5))
def test_the_turn_towards_a_direction_leads_there(yaw, pitch):
    way = np.array([np.cos(pitch) * np.sin(yaw), np.sin(pitch), np.cos(pitch) * np.cos(yaw)])
    assert way == pytest.approx(rotate(turn_towards(way), AHEAD), abs=1e-7)


def view_of(body=None, head_valid=True):
    head = Pose(np.array([0.0, 1.6, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    return FrameView(0, 0, head, head_valid, None, (), body)


def hand(valid):
    return BodyView(
        ("hips", "right_hand"),
        np.array([0]),
        np.array([[[0.0, 1.0, 0.0], [0.3, 1.1, -0.3]]]),
        np.tile([1.0, 0.0, 0.0, 0.0], (1, 2, 1)),
        np.array([[True, valid]]),
    )


def test_a_tracked_hand_points_along_its_fingers():
    found = newer_ray(None, view_of(hand(valid=True)))
    assert found.is_hand
    assert [1.0, 0.0, 0.0] == pytest.approx(rotate(found.pose.orientation_wxyz, AHEAD), abs=1e-12)


def test_a_head_points_where_no_hand_was_ever_tracked():
    assert not newer_ray(None, view_of()).is_hand
    assert not newer_ray(None, view_of(hand(valid=False))).is_hand


def test_a_hand_that_is_lost_for_a_moment_keeps_pointing():
    before = newer_ray(None, view_of(hand(valid=True)))
    assert newer_ray(before, view_of()) is before
    assert newer_ray(before, view_of(hand(valid=False))) is before


def test_nothing_points_when_nothing_is_tracked():
    assert newer_ray(None, view_of(head_valid=False)) is None

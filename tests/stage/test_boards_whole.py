"""Every board is whole and legible: on screens of three sizes, and in a headset."""

import numpy as np
import pytest

from visavis.lab.geometry import Pose, quat_conjugate, rotate
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.protocol.plan.questionnaires import available, load_questionnaire
from visavis.protocol.plan.session_plan import Trial
from visavis.results.opened_study import find_study
from visavis.stage import panel_image
from visavis.stimuli.panels import (
    DISTANCE_M,
    IN_HEADSET,
    MIN_X_HEIGHT_DEG,
    X_HEIGHT_EM,
    Surface,
    board_before,
    choice_boxes_01,
    choice_centre_m,
    choice_met,
)
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.responses import Choice, Rating
from visavis.study.trial import TrialScript

HEAD = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
KEYS = tuple("0123456789")


def screen(width_m, height_m, distance_m, right_m=0.0, up_m=0.0):
    flat = FlatScreen(width_m, height_m, 1920, 1080, distance_m, right_m, up_m)
    return Surface(PlacedScreen(flat, HEAD), KEYS)


SHIPPED, SMALL, WALL = (
    screen(0.531, 0.299, 0.65),
    screen(0.345, 0.194, 0.6, 0.02, -0.05),
    screen(4.0, 2.25, 3.0),
)
SURFACES = {"shipped": SHIPPED, "small": SMALL, "wall": WALL, "headset": IN_HEADSET}
LONG = ("not at all like my own body", "somewhat", "neither", "quite", "wholly and always")


def questions():
    """Yield text, choices and ends of every kind of question of every study and questionnaire."""
    yield "How close?", tuple(map(str, range(1, 10))), ("far away", "as close as can be")
    yield "Which?", (*LONG, "hardly ever", "now and then", "very often", "no answer"), ("", "")
    for name in available():
        for asked in load_questionnaire(name).questions():
            if 0 < len(asked.options) < 9:
                yield asked.prompt, (*asked.options, "no answer"), ("", "")


def boards(surface):
    for text, choices, ends in questions():
        hint = "Key in the corner, or arrows and enter"
        yield board_before(
            HEAD, surface, text, choices, ends=ends, hint=hint * bool(surface.screen)
        )


def distance_m(surface):
    return DISTANCE_M if surface.screen is None else surface.screen.flat.distance_m


@pytest.mark.parametrize("name", SURFACES)
def test_every_line_of_a_board_fits_its_place_in_letters_that_can_be_read(name, monkeypatch):
    surface, drawn = SURFACES[name], []
    largest = panel_image._largest

    def note(draw, text, box, largest_px):
        size = largest(draw, text, box, largest_px)
        wrapped = panel_image._wrap(draw, text, box[2] - box[0], size)
        drawn.append((text, size, panel_image._fits(draw, wrapped, box, size)))
        return size

    monkeypatch.setattr(panel_image, "_largest", note)
    for board in boards(surface):
        drawn.clear()
        panel_image.panel_image(board)
        deg_per_px = np.degrees(board.size_m[0] / panel_image.WIDTH_PX / distance_m(surface))
        assert {board.text, *board.choices} <= {text for text, _, _ in drawn}
        assert [text for text, _, fits in drawn if not fits] == []
        small = [t for t, px, _ in drawn if px * X_HEIGHT_EM * deg_per_px < MIN_X_HEIGHT_DEG]
        assert small == []


@pytest.mark.parametrize("name", ["shipped", "small", "wall"])
def test_a_board_lies_within_the_screen_it_is_read_on(name):
    surface = SURFACES[name]
    flat, place = surface.screen.flat, surface.screen.place
    left, right, bottom, top = flat.edges_m()
    for board in boards(surface):
        own = rotate(
            quat_conjugate(place.orientation_wxyz), board.pose.position_m - place.position_m
        )
        half_w, half_h = board.size_m[0] / 2, board.size_m[1] / 2
        assert left < own[0] - half_w
        assert own[0] + half_w < right
        assert bottom < own[1] - half_h
        assert own[1] + half_h < top
        assert own[2] == pytest.approx(-flat.distance_m)


def test_choices_in_rows_lie_apart_within_the_board_and_are_met():
    for surface in SURFACES.values():
        for board in boards(surface):
            boxes = choice_boxes_01(board)
            assert (boxes > 0).all()
            assert (boxes < 1).all()
            for i in range(len(boxes)):
                to = choice_centre_m(board, i) - HEAD.position_m
                assert choice_met(board, HEAD.position_m, to) == i


def test_a_board_on_a_screen_shows_the_keys_that_answer_it():
    board = board_before(HEAD, SHIPPED, "How?", ("a", "b", "c"), hint="keys")
    assert (board.keys, board.hint) == (("1", "2", "3"), "keys")
    assert board_before(HEAD, IN_HEADSET, "How?", ("a", "b", "c")).keys == ()


def test_few_short_choices_stay_in_one_row_where_they_always_stood():
    board = board_before(HEAD, IN_HEADSET, "How?", tuple(map(str, range(1, 10))))
    assert (board.rows, board.size_m) == (1, (1.8, 0.9))


@pytest.mark.parametrize("name", SHIPPED_STUDIES)
def test_questions_of_shipped_studies_stay_in_one_row_in_a_headset(name):
    experiment = find_study(name).experiment({})
    script = TrialScript(Trial("T1", 1, 0, False, {}, 0), experiment.settings)
    for response in experiment.responses.values():
        if isinstance(response, Rating | Choice):
            assert script.board_of(response, HEAD, IN_HEADSET).rows == 1

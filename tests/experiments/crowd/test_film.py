"""The film of a walk: its length, what is lit, what is said when the body was lost."""

import numpy as np
import pytest

from experiments.crowd.film import Span, film_walk, frames
from experiments.crowd.film_drawing import LIT, TOUCHED, FilmPainter
from lab.errors import UsageError
from stage.errors import StageError
from tests.experiments.crowd.synthetic_body import carried, nowhere_near

SPANS = [Span("armband_left_forearm", 0.5, 1.5, True), Span("armband_right_forearm", 2, 3, False)]


def painted(walk, step, spans=SPANS):
    painter = FilmPainter(
        (640, 360),
        walk,
        [(s.role, s.begin_s, s.end_s, s.vibrated) for s in spans],
        title="walk",
        is_simulated=True,
    )
    (frame,) = frames(walk, np.array([step]), spans)
    return frame, painter.paint(frame)


def has(picture, colour):
    return bool((picture.reshape(-1, 3) == np.array(colour)).all(axis=1).any())


def test_a_film_has_a_frame_for_every_tick_of_the_walk():
    steps = carried(4.0).steps_at(25)
    assert 101 == len(steps)
    assert (np.diff(steps) == 4).all()
    assert 26 == len(carried(4.0).steps_at(25, 1.0))


def test_contacts_light_the_part_and_the_person():
    walk = carried(4.0)
    lit = [f for f in frames(walk, np.arange(0, 401, 10), SPANS) if f.parts]
    assert lit
    assert all(f.touched for f in lit)
    _, picture = painted(walk, lit[0].step, [])
    assert has(picture, LIT)
    assert has(picture, TOUCHED)


def test_nothing_is_lit_where_nobody_stands():
    place = nowhere_near()
    frame, picture = painted(carried(1.0, begin=place, end=place), 50, [])
    assert not frame.parts
    assert not has(picture[:200, 330:], LIT)


def test_bands_vibrate_within_their_pulses_and_only_there():
    walk = carried(4.0)
    of = {t: next(iter(frames(walk, np.array([round(100 * t)]), SPANS))) for t in (0.2, 1.0, 2.5)}
    assert [set(), {"armband_left_forearm"}, set()] == [set(f.vibrating) for f in of.values()]


def test_a_lost_body_is_said_to_be_lost():
    walk = carried(1.0)
    walk.position_m[50] = np.nan
    frame, picture = painted(walk, 50)
    assert not frame.is_tracked
    assert not frame.parts
    assert picture.shape == (360, 640, 3)


def test_a_film_is_written_whole_and_never_replaces_one(tmp_path):
    video = tmp_path / "walk.avi"
    n = film_walk(
        carried(1.0), SPANS, video, title="walk", is_simulated=True, size_px=(320, 240), rate_hz=5
    )
    assert 6 == n
    assert b"AVI " == video.read_bytes()[8:12]
    with pytest.raises(StageError, match="exists already"):
        film_walk(carried(1.0), SPANS, video, title="walk", is_simulated=True)


def test_impossible_sizes_and_rates_are_refused(tmp_path):
    with pytest.raises(UsageError, match="cannot be drawn"):
        film_walk(carried(1.0), [], tmp_path / "a.avi", title="", is_simulated=True, rate_hz=0)

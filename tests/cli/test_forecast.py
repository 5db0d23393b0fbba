"""A film says how long it takes while it can still be stopped without loss."""

import pytest

from visavis.cli.notifier import MEASURED_PICTURES, Forecast, Pace, time_left


@pytest.mark.parametrize(
    ("picture_s", "expected"),
    [(1.2, "500 pictures, about 10 min more"), (0.1, "500 pictures, about 49 s more"), (0.01, "")],
)
def test_a_slow_film_says_once_how_long_it_takes(picture_s: float, expected: str) -> None:
    passed_s = 30.0  # the first picture loads everything, and does not count
    forecast = Forecast(lambda: passed_s)
    said = []
    for done in range(1, 501):
        said.append(forecast.line_after(done, 500))
        passed_s += picture_s
    assert 1 >= sum(map(bool, said))
    assert expected in said[MEASURED_PICTURES]
    assert bool(expected) == bool(said[MEASURED_PICTURES])


def test_work_without_a_terminal_says_how_long_it_takes_from_its_first_piece_on() -> None:
    passed_s = 0.0
    pace = Pace("simulating", lambda: passed_s)
    lines = []
    for count in range(1, 41):
        passed_s += 6.0
        lines.append(pace.line_after(count, 40))
    assert "simulating: 1 of 40 done, about 4 min more" == lines[0]
    assert "simulating: 20 of 40 done, about 2 min more" == lines[19]
    assert 10 == sum(map(bool, lines))  # each tenth but the last, which ends soon
    assert "" == lines[-1]


def test_nothing_that_ends_soon_is_forecast() -> None:
    pace = Pace("simulating", lambda: 1.0)
    assert [""] * 10 == [pace.line_after(count, 10) for count in range(1, 11)]


def test_the_time_left_rests_on_the_mean_pace_and_nothing_is_known_before_the_first_piece() -> None:
    assert ("", "about 80 s", "about 2 min", "") == (
        time_left(20.0, 0, 10),
        time_left(20.0, 2, 10),
        time_left(20.0, 1, 8),
        time_left(20.0, 10, 10),
    )

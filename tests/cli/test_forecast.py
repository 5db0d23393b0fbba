"""A film says how long it takes while it can still be stopped without loss."""

import pytest

from visavis.cli.notifier import MEASURED_PICTURES, Forecast


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

"""What differs between simulated people, and what they share."""

import numpy as np
import pytest

from visavis.people.observer.temperament import (
    DEFAULT_POPULATION,
    Temperament,
    draw_temperament,
)

OF_EACH_PERSON = {
    "head_visit_s", "other_visit_s", "hold_s", "startle_s", "return_gain", "recheck_gain",
    "head_gain", "fixation_s", "onset_latency_s", "saccade_s_per_rad", "drift_rad", "head_rate",
    "blink_interval_s", "pupil_dark_mm", "pupil_bright_mm", "sway_m", "ipd_m",
}  # fmt: skip
"""Constants that are drawn for everybody; others are the population's."""


def test_people_differ_in_what_is_drawn_and_in_nothing_else() -> None:
    drawn = [
        draw_temperament(DEFAULT_POPULATION, np.random.default_rng(seed)).constants
        for seed in range(8)
    ]
    rows = np.concatenate(drawn)
    names = rows.dtype.names or ()
    assert OF_EACH_PERSON == {name for name in names if len(np.unique(rows[name])) > 1}


def test_every_constant_but_the_seat_has_a_value() -> None:
    row = draw_temperament(DEFAULT_POPULATION, np.random.default_rng(1)).constants[0]
    zero = {name for name in row.dtype.names or () if row[name] == 0}
    assert {"seat_x", "seat_y", "seat_z"} == zero


@pytest.mark.parametrize(
    ("expected", "constant"),
    [
        (0.10, "other_visit_s"),
        (0.08, "fixation_s"),
        (0.12, "onset_latency_s"),
        (0.06, "saccade_s_per_rad"),
        (0.20, "drift_rad"),
        (0.10, "head_rate"),
        (0.30, "sway_m"),
    ],
)
def test_people_differ_by_shares_of_a_constant(
    expected: float, constant: str, crowd: list[Temperament]
) -> None:
    shares = np.log([float(person.constants[constant][0]) for person in crowd])
    assert pytest.approx(expected, rel=0.05) == shares.std()


@pytest.fixture(scope="module")
def crowd() -> list[Temperament]:
    rng = np.random.default_rng(5)
    return [draw_temperament(DEFAULT_POPULATION, rng) for _ in range(3000)]

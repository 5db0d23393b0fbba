import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.analysis.report.notation import (
    decimal,
    fraction,
    mean_sd,
    milliseconds,
    percentage,
    probability,
    threshold,
)


@pytest.mark.parametrize(
    ("p", "expected"),
    [
        (0.0000001, "< .001"),
        (0.00099, "< .001"),
        (0.001, ".001"),
        (0.0234, ".023"),
        (0.5, ".500"),
        (1.0, "> .999"),
        (None, "–"),
        (math.nan, "–"),
    ],
)
def test_probability_has_three_digits_and_no_leading_zero(p, expected):
    assert expected == probability(p)


@given(st.floats(0, 1))
def test_probability_never_prints_certainty(p):
    assert probability(p) not in (".000", "1.000", "0.000")


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.05 / 30, ".00167"), (0.05, ".05"), (0.05 / 9, ".00556"), (0.05 / 3, ".0167")],
)
def test_threshold_has_three_significant_digits(value, expected):
    assert expected == threshold(value)


def test_times_print_in_whole_milliseconds():
    assert milliseconds(1569.7) == "1570"


def test_negative_number_has_a_true_minus_and_zero_has_none():
    assert decimal(-6.754) == "\u22126.75"
    assert decimal(-0.001) == "0.00"


def test_fraction_drops_the_leading_zero_only():
    assert [fraction(v) for v in (0.61, -0.42, 1.0, 10.25)] == [".61", "\u2212.42", "1.00", "10.25"]


def test_mean_without_spread_prints_alone():
    assert mean_sd(504.2, 175.4, 0) == "504 (175)"
    assert mean_sd(504.2, math.nan, 0) == "504"
    assert mean_sd(math.nan, math.nan, 0) == "–"


def test_missing_share_prints_as_a_dash():
    assert percentage(math.nan) == "–"
    assert percentage(0.034) == "3.4 %"

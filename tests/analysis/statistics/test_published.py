"""Rules of the checker: what fits, what is cut off, what cannot be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special, stats

from visavis.analysis.statistics import published
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.printed import judge, read_printed


@pytest.mark.parametrize(
    ("text", "value", "half_unit"),
    [
        ("2.50", 2.5, 0.005),
        ("13.0", 13.0, 0.05),
        (13, 13.0, 0.5),
        (".017", 0.017, 0.0005),
        ("−6.75", -6.75, 0.005),
        ("approximately 98%", 0.98, 0.005),
        ("3.76e-09", 3.76e-9, 0.005e-9),
    ],
)
def test_printed_numbers_carry_their_rounding(
    text: str | int, value: float, half_unit: float
) -> None:
    figure = read_printed(text)
    assert (value, half_unit) == pytest.approx((figure.value, figure.half_unit))


@settings(max_examples=60, deadline=None)
@given(st.floats(0.05, 40.0), st.integers(1, 6), st.integers(5, 80))
def test_correctly_rounded_results_are_never_flagged(F: float, df1: int, df2: int) -> None:
    p = stats.f.sf(F, df1, df2)
    eta = F * df1 / (F * df1 + df2)
    check = published.check_f(f"{F:.2f}", df1, df2, p=f"{p:.3f}", eta=f"{eta:.2f}")
    assert check.is_consistent, check


def test_cut_off_p_is_flagged_as_cut_off() -> None:
    verdict = published.check_f("7.09", 1, 15, p=".017").verdicts["p"]
    assert not verdict.is_consistent
    assert "cut off" in verdict.remark


def test_wrong_eta_is_flagged_as_not_following() -> None:
    check = published.check_f("18.92", 2, 30, p="<.001", eta="0.356")
    assert check.verdicts["p"].is_consistent
    assert not check.verdicts["eta2p"].is_consistent
    assert "does not follow" in check.sentence()


def test_bound_that_does_not_hold_is_flagged() -> None:
    assert not judge("<.001", 0.004).is_consistent
    assert judge("< .05", 0.004).is_consistent


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 500), st.data())
def test_means_of_integers_are_possible(n: int, data: st.DataObject) -> None:
    total = data.draw(st.integers(n, 5 * n))
    assert published.check_integer_mean(f"{total / n:.4f}", n).is_consistent


def test_mean_between_two_possible_ones_is_impossible() -> None:
    assert not published.check_integer_mean("2.25", 3).is_consistent
    assert not published.check_integer_mean(3.2989, 97, decimals=4).is_consistent


def test_tukey_verdicts_follow_from_means_and_p() -> None:
    verdicts = {("c", "a"): True, ("c", "b"): True, ("b", "a"): False}
    check = published.check_oneway_from_means(
        "3.76e-09", ["2.5464", "2.5567", "3.3814"], 97, names=("a", "b", "c"), significant=verdicts
    )
    assert check.is_consistent
    wrong = published.check_oneway_from_means(
        "3.76e-09", ["2.5464", "2.5567", "3.3814"], 97, names="abc", significant={("b", "a"): True}
    )
    assert not wrong.is_consistent


@pytest.mark.parametrize("p", [1e-200, 1e-40, 1e-10, 0.001, 0.5, 0.99, 0.9999])
@pytest.mark.parametrize("df2", [10, 30, 3000])
def test_f_of_a_p_equals_the_closed_form_of_two_numerator_df(p: float, df2: int) -> None:
    expected = df2 / 2 * np.expm1(-2 / df2 * np.log(p))
    assert expected == pytest.approx(published._f_of_p(p, 2, df2), rel=1e-9)


def test_an_f_beyond_all_numbers_is_refused() -> None:
    with pytest.raises(StatisticsError, match="beyond all numbers"):
        published._f_of_p(1e-200, 1, 1)


def test_rounding_of_fractional_df_is_allowed_for() -> None:
    """F 3.50 with true df 1.5649 and 34.249 has p .0516; from 1.56 and 34.2 it is .0517."""
    p = float(special.fdtrc(1.5649, 34.249, 3.5))
    check = published.check_f("3.500000", "1.56", "34.2", p=f"{p:.6f}")
    assert check.is_consistent
    far = published.check_f("3.500000", "1.56", "34.2", p=f"{p + 0.001:.6f}")
    assert not far.is_consistent
    whole = published.check_f("3.500000", 2, 30, p=f"{special.fdtrc(2.004, 30, 3.5):.6f}")
    assert not whole.is_consistent


def test_rounding_of_welchs_df_is_allowed_for() -> None:
    p = 2 * float(special.stdtr(5.3746, -2.5))
    assert published.check_t("2.500000", "5.37", p=f"{p:.5f}").is_consistent
    assert not published.check_t("2.500000", "5.37", p=f"{p + 0.001:.5f}").is_consistent


def test_degrees_of_freedom_may_be_text() -> None:
    assert published.check_f("18.92", "2", "30", p="<.001").is_consistent
    with pytest.raises(StatisticsError, match="degrees of freedom are positive"):
        published.check_f("18.92", "0", "30")

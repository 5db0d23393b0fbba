"""Rules of the simple tests: hand-worked values, limits, invariances."""

import itertools
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.multitest import multipletests

from tests.reference.stats_papers import signed_rank_p_from_t
from visavis.analysis.statistics import (
    adjust_p,
    independent_t,
    one_sample_t,
    paired_t,
    partial_eta_squared,
    pearson,
    shapiro_wilk,
    skewness,
    spearman,
    stars,
    wilcoxon_signed_rank,
)
from visavis.analysis.statistics.effects import eta_interval, noncentral_t_bounds

WHOLE = st.lists(st.integers(-4, 4), min_size=4, max_size=9).filter(any)


def test_paired_t_of_hand_worked_differences() -> None:
    # differences 1, 2, 3: mean 2, SD 1, t = 2 √3
    result = paired_t([2.0, 4.0, 6.0], [1.0, 2.0, 3.0])
    assert (2.0, 1.0, 2) == (result.estimate, result.sd, result.df)
    assert 2 * np.sqrt(3) == pytest.approx(result.t)
    assert 2.0 == pytest.approx(result.effect.value)
    assert 12 / 14 == pytest.approx(result.eta.value)


@pytest.mark.usefixtures("normal_tails")
def test_interval_of_dz_has_t_at_its_noncentral_tails() -> None:
    result = paired_t([2.0, 4.0, 6.5, 3.0, 5.0], [1.0, 2.0, 3.0, 3.5, 4.0])
    assert result.effect.interval is not None
    for bound, tail in ((result.effect.interval.low, 0.975), (result.effect.interval.high, 0.025)):
        assert tail == pytest.approx(stats.nct.cdf(result.t, 4, bound * np.sqrt(5)), abs=1e-8)


def test_interval_of_partial_eta_has_f_at_its_noncentral_tails() -> None:
    interval = partial_eta_squared(7.09, 2, 30, level=0.9).interval
    assert interval is not None
    for bound, tail in ((interval.low, 0.95), (interval.high, 0.05)):
        noncentrality = bound * 33 / (1 - bound)
        assert tail == pytest.approx(stats.ncf.cdf(7.09, 2, 30, noncentrality), abs=1e-8)


def test_interval_of_partial_eta_starts_at_zero_for_a_small_f() -> None:
    interval = partial_eta_squared(0.1, 1, 15).interval
    assert interval is not None
    assert 0.0 == interval.low
    assert interval.high > 0.0065


@settings(deadline=None)
@given(WHOLE)
def test_exact_signed_rank_counts_every_sign_pattern(differences: list[int]) -> None:
    result = wilcoxon_signed_rank(np.array(differences, dtype=float), method="exact")
    nonzero = np.array([d for d in differences if d])
    ranks = stats.rankdata(np.abs(nonzero))
    sums = np.array(
        [
            sum(r for r, s in zip(ranks, signs, strict=True) if s)
            for signs in itertools.product((0, 1), repeat=len(ranks))
        ]
    )
    centre = ranks.sum() / 2
    observed = ranks[nonzero > 0].sum()
    expected = np.mean(np.abs(sums - centre) >= abs(observed - centre) - 1e-9)
    assert expected == pytest.approx(result.p)
    assert observed == result.V


@settings(deadline=None)
@given(WHOLE)
def test_signed_rank_mirrors_when_the_samples_are_exchanged(differences: list[int]) -> None:
    x, y = np.array(differences, dtype=float), np.zeros(len(differences))
    one, other = wilcoxon_signed_rank(x, y), wilcoxon_signed_rank(y, x)
    assert one.p == pytest.approx(other.p)
    assert one.effect.value == pytest.approx(-other.effect.value)
    assert one.T == other.T


def test_float_noise_does_not_break_ties_of_differences() -> None:
    x, y = [0.3, 0.2, 0.9, 1.4], [0.1, 0.0, 0.5, 0.3]  # 0.2, 0.2, 0.4, 1.1
    assert wilcoxon_signed_rank(x, y).has_ties


def test_pratt_ranks_zeros_before_dropping_them() -> None:
    # |d| = 0, 1, 2, 3: ranks 1..4; V of the positives 2 + 4 = 6, without the zero 1 + 3 = 4
    d = np.array([0.0, 1.0, -2.0, 3.0])
    assert 6.0 == wilcoxon_signed_rank(d, zeros="pratt").V
    assert 4.0 == wilcoxon_signed_rank(d, zeros="wilcoxon").V


def test_signed_rank_p_of_a_printed_sum_needs_no_data() -> None:
    assert signed_rank_p_from_t(33, 13) == pytest.approx(0.38235208985751545)


def test_complete_dominance_has_an_interval_below_one() -> None:
    effect = wilcoxon_signed_rank(np.arange(1.0, 9.0)).effect
    assert 1.0 == effect.value
    assert effect.interval is not None
    assert effect.interval.low < 0.95
    assert 1.0 == effect.interval.high


@cache
def correlations_of_all_orders() -> np.ndarray:
    x = np.arange(6.0)
    return np.array([np.corrcoef(x, p)[0, 1] for p in itertools.permutations(range(6))])


@settings(deadline=None)
@given(st.permutations(range(6)))
def test_exact_spearman_counts_every_order(order: list[int]) -> None:
    x = np.arange(6.0)
    y = np.array(order, dtype=float)
    every = correlations_of_all_orders()
    expected = np.mean(np.abs(every) >= abs(stats.spearmanr(x, y).statistic) - 1e-9)
    assert expected == pytest.approx(spearman(x, y).p)


def test_perfect_correlation_is_one_with_p_zero() -> None:
    result = pearson([1.0, 2.0, 3.0, 4.0], [2.0, 4.0, 6.0, 8.0])
    assert (1.0, 0.0) == (result.r, result.p)


def test_welch_leaves_student_when_variances_differ() -> None:
    x, y = [1.0, 2.0, 3.0, 4.0], [10.0, 30.0, 20.0]
    assert stats.ttest_ind(x, y, equal_var=False).pvalue == pytest.approx(
        independent_t(x, y, equal_variances=False).p
    )
    assert stats.ttest_ind(x, y).pvalue == pytest.approx(independent_t(x, y).p)


def test_one_sample_t_measures_from_mu() -> None:
    assert 0.0 == pytest.approx(one_sample_t([4.0, 5.0, 6.0], mu=5).t)


def test_shapiro_of_three_equally_spaced_values_is_one() -> None:
    assert 1.0 == pytest.approx(shapiro_wilk([1.0, 2.0, 3.0]).W)


def test_skewness_of_a_mirrored_sample_turns_its_sign() -> None:
    x = np.array([1.0, 2.0, 9.0, 3.0])
    assert skewness(x) == pytest.approx(-skewness(-x))
    assert stats.skew(x, bias=False) == pytest.approx(skewness(x))


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("none", [0.01, 0.04, 0.03]),
        ("bonferroni", [0.03, 0.12, 0.09]),
        ("holm", [0.03, 0.06, 0.06]),
        ("bh", [0.03, 0.04, 0.04]),
    ],
)
def test_adjusted_p_worked_by_hand(method: str, expected: list[float]) -> None:
    assert expected == pytest.approx(adjust_p([0.01, 0.04, 0.03], method))


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_lies_between_raw_and_bonferroni(p: list[float]) -> None:
    raw, holm, bonferroni = (adjust_p(p, m) for m in ("none", "holm", "bonferroni"))
    assert (raw <= holm + 1e-15).all()
    assert (holm <= bonferroni + 1e-15).all()


@pytest.mark.parametrize(
    ("p", "expected"), [(0.00158, "*"), (0.00031, "**"), (3e-5, "***"), (0.05, "")]
)
def test_stars_follow_the_bonferroni_ladder(p: float, expected: str) -> None:
    assert expected == stars(p, n_tests=30)


def test_results_print_as_apa_sentences() -> None:
    result = paired_t([2.0, 4.0, 6.0, 4.0], [1.0, 2.0, 3.0, 5.0], names=("A", "D"))
    assert str(result).startswith("t(3) = 1.46, p = .239, dz = 0.73, 95% CI [")
    assert "paired t" == result.row()["test"]
    assert 4 == result.row()["n"]


@pytest.mark.parametrize("t", [0.0, 1e-6, 0.3, 40.0, 999.0, 1001.0, 1e6, 1e12])
@pytest.mark.parametrize("df", [2, 30, 3000])
def test_intervals_exist_for_any_statistic(t: float, df: int) -> None:
    low, high = noncentral_t_bounds(t, df)
    assert low < t + 1e-9
    assert t <= high + 1e-9
    interval = eta_interval(t * t, 3, df)
    assert 0 <= interval.low <= interval.high <= 1


def test_intervals_of_huge_statistics_continue_the_exact_ones() -> None:
    below, above = (np.array(noncentral_t_bounds(t, 30)) / t for t in (999.9, 1000.1))
    assert below == pytest.approx(above, rel=1e-4)
    exact, approximate = (eta_interval(F, 1, 5) for F in (0.999e6, 1.001e6))
    assert exact.low == pytest.approx(approximate.low, rel=1e-5)


@pytest.mark.parametrize(
    ("ours", "theirs"), [("holm", "holm"), ("bonferroni", "bonferroni"), ("bh", "fdr_bh")]
)
def test_adjustment_equals_that_of_statsmodels(ours: str, theirs: str) -> None:
    """Ours stays: statsmodels takes two seconds to import, and knows no family larger than p."""
    rng = np.random.default_rng(6)
    several = rng.random(1), rng.random(7) ** 3, np.round(rng.random(12), 1), np.array([0.0, 1.0])
    for p in several:
        expected = multipletests(p, method=theirs)[1]
        assert expected.tolist() == pytest.approx(adjust_p(p, ours).tolist(), abs=1e-15)

"""Intervals hold the truth as often as they say, or there is none.

`python -m benchmarks.interval_coverage` measures every interval that a report can print.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from benchmarks.interval_coverage import PROMISE, PROMISES, held
from visavis.analysis import statistics
from visavis.analysis.statistics.agreement import icc, single_without_each
from visavis.analysis.statistics.effects import eta_interval, noncentral_t_bounds

BY_NAME = {promise.name: promise for promise in PROMISES}
STUDIES = 250
CHANCE = 2 * np.sqrt(PROMISE * (1 - PROMISE) / STUDIES)


@pytest.mark.parametrize("kind", ["normal", "skewed", "ratings"])
@pytest.mark.parametrize("name", ["paired: r_rb", "groups: r_rb"])
def test_a_rank_biserial_interval_holds_the_truth_of_large_effects(name: str, kind: str) -> None:
    """On Fisher's z, by the error without an effect, it did so in .52 to .80."""
    for n in (8, 16):
        for effect in (1.0, 2.0):
            share, result = held(BY_NAME[name], kind, effect, n, STUDIES)
            assert (STUDIES, True) == (result, share > PROMISE - CHANCE), (n, effect, share)


@pytest.mark.parametrize("kind", ["normal", "skewed"])
@pytest.mark.parametrize("name", ["4 conditions: W", "3 groups: ε²"])
def test_a_share_of_rank_variance_holds_the_truth_of_large_effects(name: str, kind: str) -> None:
    """By the noncentral F of normal ranks it did so in .78 to .9."""
    share, _ = held(BY_NAME[name], kind, 2.0, 8, STUDIES)
    assert share > PROMISE - CHANCE


@pytest.mark.parametrize(
    ("name", "kind", "effect"),
    [
        ("paired: dz", "skewed", 2.0),
        ("paired: η²p", "skewed", 2.0),
        ("groups: d", "skewed", 2.0),
        ("groups: d", "ratings", 2.0),
        ("3 groups: η²", "skewed", 2.0),
        ("one group: d", "skewed", -2.0),
        ("one group: mean", "skewed", 0.0),
        ("ICC2, 4 raters", "skewed", 0.5),
        ("Cronbach's α, 4 items", "skewed", 0.5),
    ],
)
def test_what_is_divided_by_an_sd_holds_the_truth_of_skewed_values(
    name: str, kind: str, effect: float
) -> None:
    """Noncentral t and F did so in .74 to .87, as few people hide the tails of their measure."""
    for n in (8, 40):
        share, _ = held(replace(BY_NAME[name], truth_n=20_000), kind, effect, n, STUDIES)
        assert share > PROMISE - CHANCE, (n, share)


def test_normal_values_pay_little_for_tails_that_they_do_not_have() -> None:
    rng = np.random.default_rng(8)
    for n, most in ((8, 1.25), (40, 1.12)):
        x = stats.norm.ppf((np.arange(n) + 0.5) / n)
        y = x + rng.permutation(x) - 0.7
        result = statistics.paired_t(x, y).effect.interval
        t = statistics.paired_t(x, y)
        low, high = noncentral_t_bounds(t.t, n - 1)
        assert result is not None
        assert 1 < (result.high - result.low) / ((high - low) / np.sqrt(n)) < most


def test_a_widened_interval_keeps_zero_out_where_the_test_does() -> None:
    """No effect has no SD to divide by: p below .05 and an interval around 0 contradict."""
    x = np.array([0.1, 0.2, 0.1, 0.9, 0.3, 0.2, 5.0, 1.2, 0.2, 0.4]) + 0.35
    for sign in (1, -1):
        result = statistics.one_sample_t(sign * x)
        assert result.p < 0.05
        assert result.effect.interval is not None
        assert sign * result.effect.interval.low * result.effect.interval.high >= 0


def test_a_skewed_mean_has_its_longer_side_where_the_tail_is() -> None:
    x = np.array([0.1, 0.2, 0.1, 0.9, 0.3, 0.2, 5.0, 1.2, 0.2, 0.4])
    right, left = (statistics.one_sample_t(sign * x) for sign in (1, -1))
    plain = statistics.one_sample_t(x, for_skew=False).interval
    assert plain.low == pytest.approx(right.interval.low)
    assert right.interval.high > plain.high + 0.2
    assert -right.interval.high == pytest.approx(left.interval.low)


def test_correlations_of_raters_without_each_thing_are_those_of_the_rest() -> None:
    rng = np.random.default_rng(1)
    table = rng.normal(size=(9, 4)) + rng.normal(size=(9, 1)) + np.arange(4)
    without = single_without_each(table)
    for i in range(len(table)):
        rest = {one.kind: one.value for one in icc(np.delete(table, i, axis=0))}
        for kind, even in without.items():
            assert np.log((1 + 3 * rest[kind]) / (1 - rest[kind])) == pytest.approx(even[i])


@pytest.mark.parametrize("name", ["pearson", "spearman"])
def test_a_correlations_interval_holds_the_truth_of_skewed_pairs(name: str) -> None:
    share, _ = held(BY_NAME[name], "skewed", 0.5, 40, STUDIES)
    assert share > PROMISE - CHANCE


def test_one_direction_throughout_leaves_room_below() -> None:
    """It was "−1.00, 95 % CI [−1.00, −0.98]" of 16 people."""
    down = statistics.wilcoxon_signed_rank(-np.arange(1.0, 17.0)).effect
    assert -1 == down.value
    assert down.interval is not None
    assert -1 == down.interval.low
    assert -0.9 < down.interval.high < -0.3


def test_a_rank_biserial_interval_turns_round_with_its_conditions() -> None:
    rng = np.random.default_rng(4)
    x, y = np.round(rng.normal(0.4, 1, 18), 1), np.round(rng.normal(0, 1, 18), 1)
    for test in (statistics.wilcoxon_signed_rank, statistics.mann_whitney):
        there, back = test(x, y).effect.interval, test(y, x).effect.interval
        assert there is not None
        assert back is not None
        assert (there.low, there.high) == pytest.approx((-back.high, -back.low), abs=1e-9)


def test_ranks_that_all_agree_have_no_interval() -> None:
    s, c = np.repeat(np.arange(5), 3), np.tile(np.arange(3), 5)
    friedman_result = statistics.friedman(
        {"s": s, "c": c, "y": c + 1.0}, "y", subject="s", within="c"
    )
    assert (1.0, None) == (friedman_result.effect.value, friedman_result.effect.interval)


def test_two_groups_of_two_values_have_the_interval_of_shares_that_differ() -> None:
    x, y = np.repeat([1.0, 0.0], [9, 3]), np.repeat([1.0, 0.0], [3, 9])
    effect = statistics.mann_whitney(x, y).effect
    assert 0.5 == pytest.approx(effect.value)
    assert effect.interval is not None
    assert effect.interval.low < 0.15
    assert 0.75 < effect.interval.high < 0.9


def test_noncentralities_are_those_of_effectsize() -> None:
    """R: `F_to_eta2(F, df1, df2, ci = .95, alternative = "two.sided")` maps λ by λ / (λ + df2)."""
    for (F, df1, df2), (low, high) in {
        (8.0, 2, 20): (0.090992117406, 0.6566626838),
        (3.5, 3, 45): (0.001522131261, 0.3620266409),
        (0.7, 1, 14): (0.0, 0.3594910044),
    }.items():
        interval = eta_interval(F, df1, df2, cases=df2)
        assert (low, high) == pytest.approx((interval.low, interval.high), abs=2e-6)


@pytest.mark.parametrize("name", ["4 conditions: η²p", "3 groups: η²", "paired: η²p"])
def test_a_share_of_variance_is_that_of_the_population(name: str) -> None:
    """The bounds are mapped by the rows behind the error, not by its df."""
    share, _ = held(BY_NAME[name], "normal", 1.0, 8, STUDIES)
    assert share > PROMISE - CHANCE

"""Intervals hold the truth as often as they say, or there is none.

`python -m benchmarks.interval_coverage` measures every interval that a report can print.
"""

import numpy as np
import pytest

from benchmarks.interval_coverage import PROMISE, PROMISES, held
from visavis.analysis import statistics
from visavis.analysis.statistics.effects import eta_interval

BY_NAME = {promise.name: promise for promise in PROMISES}
STUDIES = 250
CHANCE = 2 * np.sqrt(PROMISE * (1 - PROMISE) / STUDIES)


@pytest.mark.parametrize("kind", ["normal", "skewed", "ratings"])
@pytest.mark.parametrize("name", ["paired: r_rb", "groups: r_rb"])
def test_a_rank_biserial_interval_holds_the_truth_of_large_effects(name: str, kind: str) -> None:
    """On Fisher's z, by the error without an effect, it did so in .52 to .80."""
    for n in (8, 16):
        for effect in (1.0, 2.0):
            share, made = held(BY_NAME[name], kind, effect, n, STUDIES)
            assert (STUDIES, True) == (made, share > PROMISE - CHANCE), (n, effect, share)


@pytest.mark.parametrize("kind", ["normal", "skewed"])
@pytest.mark.parametrize("name", ["4 conditions: W", "3 groups: ε²"])
def test_a_share_of_rank_variance_holds_the_truth_of_large_effects(name: str, kind: str) -> None:
    """By the noncentral F of normal ranks it did so in .78 to .9."""
    share, _ = held(BY_NAME[name], kind, 2.0, 8, STUDIES)
    assert share > PROMISE - CHANCE


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
    found = statistics.friedman({"s": s, "c": c, "y": c + 1.0}, "y", subject="s", within="c")
    assert (1.0, None) == (found.effect.value, found.effect.interval)


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

"""Rules of equivalence, power, reliability, clusters and the estimation plot."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.collections import FillBetweenPolyCollection, PathCollection
from scipy import stats

from visavis.analysis import statistics
from visavis.analysis.statistics.errors import MissingValue, StatisticsError, UnequalLength


def test_equivalence_holds_exactly_when_the_interval_lies_inside_the_bounds() -> None:
    x = np.array([0.1, -0.2, 0.3, 0.0, -0.1, 0.2, -0.3, 0.1])
    inner = statistics.tost_one_sample(x, low=-1.0, high=1.0).interval
    for margin, expected in ((1e-6, True), (-1e-6, False)):
        result = statistics.tost_one_sample(x, low=-1.0, high=inner.high + margin)
        assert expected is result.is_equivalent
    assert 0.9 == pytest.approx(inner.level)


def test_equivalence_p_is_the_larger_one_sided_p() -> None:
    x, y = np.array([5.0, 6.0, 7.0, 8.0, 9.5]), np.array([5.2, 5.9, 7.3, 7.8, 9.4])
    result = statistics.tost_paired(x, y, low=-0.5, high=0.4)
    low = stats.ttest_1samp(x - y, -0.5, alternative="greater").pvalue
    high = stats.ttest_1samp(x - y, 0.4, alternative="less").pvalue
    assert (low, high, max(low, high)) == pytest.approx((result.p_low, result.p_high, result.p))


def test_equivalence_bounds_in_sd_scale_with_the_data() -> None:
    x, y = np.array([5.0, 6.0, 7.0, 8.0, 9.5]), np.array([5.2, 5.9, 7.3, 7.8, 9.4])
    small = statistics.tost_paired(x, y, low=-0.5, high=0.5, unit="sd")
    large = statistics.tost_paired(100 * x, 100 * y, low=-0.5, high=0.5, unit="sd")
    assert small.p == pytest.approx(large.p)
    assert 100 * small.low == pytest.approx(large.low)


def test_equivalence_of_groups_equals_welch_one_sided() -> None:
    x, y = [5.0, 6.0, 7.0, 8.0], [5.2, 5.9, 7.3, 7.8, 9.4]
    result = statistics.tost_independent(x, y, low=-3.0, high=3.0)
    high = stats.ttest_ind(np.array(x) - 3.0, y, equal_var=False, alternative="less").pvalue
    assert high == pytest.approx(result.p_high)


def test_crossed_equivalence_bounds_are_refused() -> None:
    with pytest.raises(StatisticsError, match="must lie below"):
        statistics.tost_one_sample([1.0, 2.0, 4.0], low=1.0, high=-1.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 6), st.floats(0.1, 0.8), st.floats(0.5, 0.95))
def test_sample_size_and_sensitivity_invert_power(k: int, f: float, power: float) -> None:
    n = statistics.oneway_sample_size(k=k, f=f, power=power).n_per_group
    assert power == pytest.approx(statistics.oneway_power(k=k, n_per_group=n, f=f).power)
    assert f == pytest.approx(
        statistics.oneway_sensitivity(k=k, n_per_group=n, power=power).f, rel=1e-6
    )


def test_power_without_effect_is_alpha() -> None:
    assert 0.05 == pytest.approx(statistics.oneway_power(k=3, n_per_group=10, f=0.0).power)


@pytest.mark.parametrize("hits", [0, 3, 20])
def test_proportion_intervals_equal_scipy(hits: int) -> None:
    test = stats.binomtest(hits, 20)
    for ours, theirs in (("wilson", "wilson"), ("clopper-pearson", "exact")):
        expected = test.proportion_ci(method=theirs)
        got = statistics.proportion_interval(hits, 20, method=ours)
        assert (expected.low, expected.high) == pytest.approx((got.low, got.high), abs=1e-9)


def test_smallest_adequate_n_is_not_decided_by_one_lucky_point() -> None:
    hits = {8: (30, 100), 12: (82, 100), 16: (75, 100), 20: (85, 100), 24: (93, 100)}
    curve = statistics.power_curve(hits)
    assert 20 == curve.smallest
    assert [8, 12, 16, 20, 24] == [p.n for p in curve.points]
    assert 24 == statistics.power_curve(hits, rule="lower bound").smallest
    assert statistics.power_curve({8: (30, 100)}).smallest is None
    assert "no n up to 8" in str(statistics.power_curve({8: (30, 100)}))


def test_alpha_of_identical_items_is_one_and_reversing_restores_it() -> None:
    a = np.array([1.0, 2.0, 3.0, 5.0, 4.0])
    same = statistics.cronbach_alpha({"q1": a, "q2": a}, ["q1", "q2"])
    turned = statistics.cronbach_alpha({"q1": a, "q2": 6 - a}, ["q1", "q2"], reverse=["q2"])
    assert 1.0 == pytest.approx(same.alpha)
    assert 1.0 == pytest.approx(turned.alpha)
    assert turned.unreversed != pytest.approx(1.0)


@pytest.mark.usefixtures("normal_tails")
def test_interval_of_alpha_is_felds_f_interval() -> None:
    rng = np.random.default_rng(2)
    common = rng.normal(size=30)
    items = {f"q{i}": common + rng.normal(size=30) for i in range(4)}
    result = statistics.cronbach_alpha(items, list(items))
    quantile = stats.f.ppf(0.975, 29, 87)
    assert 1 - (1 - result.alpha) * quantile == pytest.approx(result.interval.low)
    assert result.interval.low < result.alpha < result.interval.high


def test_ward_merges_by_the_smallest_increase_in_sum_of_squares() -> None:
    points = [[12.0], [0.0], [1.0], [10.0]]
    tree = statistics.ward(points, 2)
    assert [0.5, 2.0, 110.25] == pytest.approx(tree.increases.tolist())  # 1/2, 4/2, 2·2/4 · 10.5²
    assert [1, 2, 2, 1] == tree.labels.tolist()
    assert [[11.0], [0.5]] == tree.means.tolist()
    assert [1] == statistics.ward([[3.0]], 1).labels.tolist()


def test_scales_are_kept_when_raters_agree_on_a_motion() -> None:
    ratings = np.zeros((4, 3, 2))
    ratings[:, 0, 0] = 2.0  # all agree: kept
    ratings[:, 1, :] = 0.5  # nobody is moved: dropped
    ratings[:, 2, 0] = [-2.0, 2.0, 2.0, 2.0]  # a mean of 1, but no agreement
    chosen = statistics.select_scales(ratings, largest_spread=0.5)
    assert [0] == chosen.indices.tolist()
    assert [1.0, 0.5] == chosen.profiles[0].tolist()
    with pytest.raises(MissingValue, match="rater 1"):
        statistics.select_scales(np.full((2, 2, 2), np.nan))


def test_estimation_plot_shows_every_participant_and_each_interval() -> None:
    rng = np.random.default_rng(4)
    base = rng.normal(size=12)
    conditions = {"A": base, "B": base + 1, "C": base + rng.normal(size=12)}
    conditions["B"] = conditions["B"] + rng.normal(size=12) / 5
    figure = statistics.estimation_plot(conditions, dv="dwell (ms)", watermark="SIMULATED")
    upper, lower = figure.axes
    dots = [c for c in upper.collections if isinstance(c, PathCollection)]
    points = np.concatenate([c.get_offsets()[:, 1].data for c in dots])
    assert np.isin(np.concatenate(list(conditions.values())), points).all()
    clouds = [c for c in upper.collections if isinstance(c, FillBetweenPolyCollection)]
    assert 3 == len(clouds)
    lines = [line for line in upper.lines if len(line.get_xdata()) == 3]
    assert 12 == len(lines)
    test = statistics.paired_t(conditions["B"], base)
    drawn = [tuple(line.get_ydata()) for line in lower.lines if len(line.get_ydata()) == 2]
    assert any(
        (test.interval.low, test.interval.high) == pytest.approx(tuple(map(float, y)))
        for y in drawn
    )
    assert "SIMULATED" in [t.get_text() for t in figure.texts]


def test_estimation_plot_of_unequal_pairs_is_refused() -> None:
    with pytest.raises(UnequalLength):
        statistics.estimation_plot({"A": [1.0, 2.0, 3.0], "B": [1.0, 2.0, 3.0, 4.0]})

"""Censored times: estimates equal those of R's survival, and what cannot be estimated is refused.

Expected values were printed by R 4.3 with survival 3.5-3 for the same 195 rows:

    survfit(Surv(time, came) ~ group, d)
    survdiff(Surv(time, came) ~ group + strata(stratum), d)
    coxph(Surv(time, came) ~ group + strata(stratum) + cluster(cluster), d, ties = "breslow")
"""

from typing import Any

import numpy as np
import pytest

from visavis.analysis.statistics.errors import ConstantResponse, StatisticsError
from visavis.analysis.statistics.survival import (
    SurvivalTimes,
    cox,
    kaplan_meier,
    log_rank,
    survival_times,
)


def rows() -> list[tuple[Any, ...]]:
    """Return times of 13 people at 5 targets by 3 means, many of them cut off at 300 s."""
    rng = np.random.default_rng(4)
    made = []
    for person in range(13):
        pace = np.exp(0.4 * rng.standard_normal())
        for target in range(5):
            for group, scale in (("a", 60), ("b", 90), ("w", 600)):
                time = pace * scale * rng.exponential()
                at_once = group != "w" and rng.random() < 0.25
                time = 0.0 if at_once else round(time, 1)
                made.append((min(time, 300.0), time < 300, group, f"t{target}", f"p{person}"))
    return made


def data() -> SurvivalTimes:
    return survival_times(*zip(*rows(), strict=True))


def test_median_times_are_those_of_r() -> None:
    assert kaplan_meier(data(), "a").median == 34.6
    assert kaplan_meier(data(), "b").median == 35.6
    rarely = kaplan_meier(data(), "w")
    assert np.isnan(rarely.median)
    assert (rarely.n, rarely.events) == (65, 19)
    assert rarely.share[-1] == pytest.approx(46 / 65)


def test_log_rank_within_strata_is_that_of_r() -> None:
    test = log_rank(data())
    assert round(test.chi2, 1) == 111.3
    assert test.df == 2
    assert 0 < test.p < 1e-20


def test_hazard_ratios_and_their_clustered_errors_are_those_of_r() -> None:
    a, b = cox(data(), "w")
    assert [r.group for r in (a, b)] == ["a", "b"]
    assert a.ratio == pytest.approx(12.18895001, rel=1e-7)
    assert (a.low, a.high) == pytest.approx((7.82202301, 18.9938718), rel=1e-7)
    assert a.z == pytest.approx(11.04846, abs=1e-5)
    assert b.ratio == pytest.approx(8.303411154, rel=1e-7)
    assert (b.low, b.high) == pytest.approx((5.19727452, 13.2659217), rel=1e-7)


def test_what_cannot_be_estimated_is_refused() -> None:
    times, came, group, stratum, cluster = map(list, zip(*rows(), strict=True))
    never = [c and g != "w" for c, g in zip(came, group, strict=True)]
    with pytest.raises(ConstantResponse, match="never came in w"):
        cox(survival_times(times, never, group, stratum, cluster), "a")
    nobody = survival_times(times, [False] * 195, group, stratum, cluster)
    assert kaplan_meier(nobody, "a").events == 0
    with pytest.raises(ConstantResponse, match="no times to compare"):
        log_rank(nobody)
    with pytest.raises(StatisticsError, match="no group 'c'"):
        cox(data(), "c")
    with pytest.raises(StatisticsError, match="negative"):
        survival_times([-1.0, *times[1:]], came, group, stratum, cluster)
    with pytest.raises(StatisticsError, match="one group"):
        survival_times(times, came, ["a"] * 195, stratum, cluster)
    with pytest.raises(StatisticsError, match="equally many"):
        survival_times(times, came[1:], group, stratum, cluster)

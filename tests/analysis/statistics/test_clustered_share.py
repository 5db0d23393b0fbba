"""Shares of answers of which people gave several each."""

import numpy as np
import pytest

from visavis.analysis.statistics.binomial import binomial_test, clustered_share
from visavis.analysis.statistics.errors import TooFewSubjects


def test_answers_that_people_only_repeat_are_worth_no_more_than_one_each() -> None:
    once = clustered_share([1, 1, 1, 0, 0, 1, 0, 1], [1] * 8)
    repeated = clustered_share([10, 10, 10, 0, 0, 10, 0, 10], [10] * 8)
    assert 0.625 == once[0] == repeated[0]
    assert once[1].low < 0.3
    # effective numbers 7 · (t(79)/t(7))² and 7: a person's ten answers widen, never narrow
    assert repeated[1].low < once[1].low < once[1].high < repeated[1].high


def test_people_who_all_answer_alike_bound_a_share_as_so_many_answers_would() -> None:
    share, interval = clustered_share([0] * 12, [4] * 12)
    assert 0.0 == share == interval.low
    exact = binomial_test(0, 12).effect.interval
    assert exact is not None
    assert exact.high == pytest.approx(interval.high)


def test_answers_no_more_alike_within_people_than_between_count_fully() -> None:
    rng = np.random.default_rng(1)
    hits = rng.binomial(20, 0.3, 200)
    share, interval = clustered_share(hits, [20] * 200)
    exact = binomial_test(int(hits.sum()), 4000).effect.interval
    assert exact is not None
    assert hits.sum() / 4000 == share
    assert interval.low == pytest.approx(exact.low, abs=0.003)
    assert interval.high == pytest.approx(exact.high, abs=0.003)


def test_one_person_tells_nothing_of_others_and_nobody_nothing_at_all() -> None:
    share, interval = clustered_share([3], [4])
    assert (0.75, 0.0, 1.0) == (share, interval.low, interval.high)
    with pytest.raises(TooFewSubjects):
        clustered_share([0], [0])

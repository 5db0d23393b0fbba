"""The printed numbers, checked against each other as far as they allow."""

from collections import Counter

import numpy as np
import pytest
from scipy import stats

from visavis.experiments.stare.design import CONDITIONS
from visavis.experiments.stare.published import (
    COMPARISONS,
    CORRELATIONS,
    INCONSISTENCIES,
    MEANS,
    PARTICIPANTS,
    POSITION_TESTS,
    POSITION_THRESHOLDS,
    TESTS,
    THRESHOLDS,
    ZONE_TESTS,
    ZONE_THRESHOLDS,
)
from visavis.stimuli.scenes.audience import ACTIVE_PLACES
from visavis.study.look_measures import DWELL_MS, MAIN_MEASURES
from visavis.study.pairs import Printed

DF = PARTICIPANTS - 1
T_TESTS = {key: row for key, row in TESTS.items() if row.statistic is not None}


def test_thirty_tests_of_five_comparisons_on_six_measures() -> None:
    expected = {(a, b, m) for a, b in COMPARISONS for m in MAIN_MEASURES}

    assert expected == set(TESTS)
    assert 30 == len(TESTS)
    assert {False: 25, True: 5} == Counter(t.is_wilcoxon for t in TESTS.values())
    assert set(CONDITIONS) == set(MEANS)


@pytest.mark.parametrize("row", T_TESTS.values(), ids=map(" ".join, T_TESTS))
def test_effect_size_follows_from_t(row: Printed) -> None:
    assert row.statistic is not None
    t = abs(row.statistic)
    low, high = ((t + d) ** 2 / ((t + d) ** 2 + DF) for d in (-0.005, 0.005))

    assert row.eta_p2 is not None
    assert low - 0.0051 <= row.eta_p2 <= high + 0.0051


def p_range(t: float) -> tuple[float, float]:
    low, high = (2 * stats.t.sf(abs(t) + d, DF) for d in (0.005, -0.005))
    return float(low), float(high)


def test_only_the_listed_p_values_do_not_follow_from_their_t() -> None:
    wrong = []
    for (_, _, measure), row in T_TESTS.items():
        assert row.statistic is not None
        assert row.p is not None
        low, high = p_range(row.statistic)
        fits = low < row.p if row.p_is_bound else low - 5e-6 <= row.p <= high + 5e-6
        if not fits:
            wrong.append((row.where, measure))

    assert [
        ("table A.3", "first_fixation_time_ms"),
        ("table A.1", "second_fixation_time_ms"),
    ] == wrong
    for table, _ in wrong:
        assert any(i.where.startswith(table) for i in INCONSISTENCIES)


def test_difference_of_the_means_has_the_sign_of_t() -> None:
    for (first, second, measure), row in T_TESTS.items():
        assert row.statistic is not None
        difference = MEANS[first][measure].mean - MEANS[second][measure].mean

        if abs(row.statistic) > 0.5:
            assert (difference > 0) == (row.statistic > 0), (row.where, measure)
            assert row.direction == -np.sign(row.statistic), (row.where, measure)


@pytest.mark.parametrize("row", TESTS.values(), ids=map(" ".join, TESTS))
def test_stars_follow_from_p_and_the_levels_over_thirty(row: Printed) -> None:
    assert row.p is not None
    assert row.stars == sum(row.p < level / 30 for level in (0.05, 0.01, 0.001))
    assert row.is_significant == (row.p < THRESHOLDS[0])


def test_stars_of_places_and_zones_follow_from_their_thresholds() -> None:
    for by_measure in POSITION_TESTS.values():
        for value in by_measure.values():
            assert value.stars == sum((value.p or 0.0) < level for level in POSITION_THRESHOLDS)
    for by_comparison in ZONE_TESTS.values():
        for value in by_comparison.values():
            assert value.stars == sum((value.p or 0.0) < level for level in ZONE_THRESHOLDS)


def test_seven_of_nine_places_show_the_effect_in_dwell_time() -> None:
    assert set(ACTIVE_PLACES) == set(POSITION_TESTS)
    assert 7 == sum(by[DWELL_MS].stars > 0 for by in POSITION_TESTS.values())


def test_zone_table_repeats_the_main_tables_over_all_places() -> None:
    for (first, second), value in ZONE_TESTS["all"].items():
        main = TESTS[first, second, "first_fixation_time_ms"]

        assert pytest.approx(main.p, abs=5.1e-5) == value.p


def test_rank_correlations_follow_from_thirty_participants() -> None:
    for c in CORRELATIONS.values():
        assert c.p is not None
        assert c.r is not None
        low, high = (
            2 * stats.t.sf(abs(r) * ((PARTICIPANTS - 2) / (1 - r * r)) ** 0.5, PARTICIPANTS - 2)
            for r in (c.r - 0.005, c.r + 0.005)
        )

        assert low - 5e-4 <= c.p <= high + 5e-4

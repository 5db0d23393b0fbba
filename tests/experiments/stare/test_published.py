"""The printed numbers, checked against each other as far as they allow."""

from collections import Counter

import pytest
from scipy import stats

from experiments.stare.design import CONDITIONS
from experiments.stare.published import (
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
    PairedTest,
    published_test,
)
from stimuli.scenes.audience import ACTIVE_PLACES
from visavis.looks import DWELL_MS, MAIN_MEASURES

DF = PARTICIPANTS - 1
T_TESTS = [t for t in TESTS if t.t is not None]


def test_thirty_tests_of_five_comparisons_on_six_measures() -> None:
    expected = {(a, b, m) for a, b in COMPARISONS for m in MAIN_MEASURES}

    assert expected == {(t.first, t.second, t.measure) for t in TESTS}
    assert 30 == len(TESTS)
    assert {"paired_t": 25, "wilcoxon": 5} == Counter(t.test for t in TESTS)
    assert set(CONDITIONS) == set(MEANS)


@pytest.mark.parametrize("row", T_TESTS, ids=lambda r: f"{r.table} {r.measure}")
def test_effect_size_follows_from_t(row: PairedTest) -> None:
    assert row.t is not None
    low, high = ((abs(row.t) + d) ** 2 / ((abs(row.t) + d) ** 2 + DF) for d in (-0.005, 0.005))

    assert row.eta_p2 is not None
    assert low - 0.0051 <= row.eta_p2 <= high + 0.0051


def p_range(t: float) -> tuple[float, float]:
    low, high = (2 * stats.t.sf(abs(t) + d, DF) for d in (0.005, -0.005))
    return float(low), float(high)


def test_only_the_listed_p_values_do_not_follow_from_their_t() -> None:
    wrong = []
    for row in T_TESTS:
        assert row.t is not None
        low, high = p_range(row.t)
        fits = low < row.p if row.p_is_bound else low - 5e-6 <= row.p <= high + 5e-6
        if not fits:
            wrong.append((row.table, row.measure))

    assert [
        ("table A.3", "first_fixation_time_ms"),
        ("table A.1", "second_fixation_time_ms"),
    ] == wrong
    for table, _ in wrong:
        assert any(i.where.startswith(table) for i in INCONSISTENCIES)


def test_difference_of_the_means_has_the_sign_of_t() -> None:
    for row in T_TESTS:
        assert row.t is not None
        difference = MEANS[row.first][row.measure].mean - MEANS[row.second][row.measure].mean

        if abs(row.t) > 0.5:
            assert (difference > 0) == (row.t > 0), (row.table, row.measure)


@pytest.mark.parametrize("row", TESTS, ids=lambda r: f"{r.table} {r.measure}")
def test_stars_follow_from_p_and_the_levels_over_thirty(row: PairedTest) -> None:
    assert row.stars == sum(row.p < level / 30 for level in (0.05, 0.01, 0.001))
    assert row.is_significant == (row.p < THRESHOLDS[0])


def test_stars_of_places_and_zones_follow_from_their_thresholds() -> None:
    for by_measure in POSITION_TESTS.values():
        for value in by_measure.values():
            assert value.stars == sum(value.p < level for level in POSITION_THRESHOLDS)
    for by_comparison in ZONE_TESTS.values():
        for value in by_comparison.values():
            assert value.stars == sum(value.p < level for level in ZONE_THRESHOLDS)


def test_seven_of_nine_places_show_the_effect_in_dwell_time() -> None:
    assert set(ACTIVE_PLACES) == set(POSITION_TESTS)
    assert 7 == sum(by[DWELL_MS].stars > 0 for by in POSITION_TESTS.values())


def test_zone_table_repeats_the_main_tables_over_all_places() -> None:
    for (first, second), value in ZONE_TESTS["all"].items():
        main = published_test(first, second, "first_fixation_time_ms")

        assert pytest.approx(main.p, abs=5.1e-5) == value.p


def test_rank_correlations_follow_from_thirty_participants() -> None:
    for c in CORRELATIONS:
        low, high = (
            2 * stats.t.sf(abs(r) * ((PARTICIPANTS - 2) / (1 - r * r)) ** 0.5, PARTICIPANTS - 2)
            for r in (c.r_s - 0.005, c.r_s + 0.005)
        )

        assert low - 5e-4 <= c.p <= high + 5e-4


def test_a_test_that_is_not_printed_is_refused() -> None:
    with pytest.raises(KeyError, match="AD and DA"):
        published_test("AD", "DA", DWELL_MS)

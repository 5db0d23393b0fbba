import pytest
from scipy.stats import binomtest

from benchmarks.stare_null import false_positives, wilson
from tests.experiments.stare.simulated_studies import simulate_studies


@pytest.mark.parametrize(("hits", "n"), [(0, 200), (10, 200), (200, 200), (3, 7)])
def test_monte_carlo_interval_is_wilsons(hits: int, n: int) -> None:
    expected = binomtest(hits, n).proportion_ci(method="wilson")

    assert wilson(hits, n) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_false_positives_are_counted_per_test_and_for_the_family() -> None:
    outcomes = list(simulate_studies(range(1, 3), participants=4, effect=False, processes=1))
    rows = {r["name"]: r for r in false_positives(outcomes)}
    ps = [[c.outcome.p for c in o.comparisons if c.outcome is not None] for o in outcomes]
    pooled = rows["all 30 tests at 0.05"]
    assert pooled["of"] == sum(len(p) for p in ps)
    assert pooled["rejected"] == sum(x < 0.05 for p in ps for x in p)
    family = rows["any of 30 at 0.05/30 (family)"]
    assert family["of"] == 2
    assert family["rejected"] == sum(min(p) < 0.05 / 30 for p in ps)

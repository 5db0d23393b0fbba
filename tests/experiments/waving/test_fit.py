"""The fit of the simulated judge looks at the same judge."""

import inspect
from dataclasses import replace
from itertools import islice

import numpy as np
import pandas as pd
import pytest

from benchmarks.waving_fit import (
    CHECK_SEED,
    FIT_SEED,
    FREE,
    FRESH_SEED,
    ORDERS,
    PRINTED,
    PRINTED_DZ,
    TARGETS,
    Expected,
    Target,
    Waves,
    art_p,
    evolved,
    expected,
    fitted,
    point_of,
    population_of,
    shares_of_orders,
    source_lines,
    understood,
    varied,
    waves_of,
)
from tests.experiments.waving.test_participant_spread import SEEN
from visavis.analysis.statistics import art_anova
from visavis.experiments.waving.clips import DIRECTIONS, TECHNIQUES
from visavis.experiments.waving.judgement import (
    DEFAULT_POPULATION,
    Person,
    Population,
    judge,
    lapse_share,
    noise_deg,
    worth_of,
)
from visavis.experiments.waving.perception import Evidence
from visavis.lab.errors import UsageError
from visavis.results.printed_orders import order_holds

BEARING = np.array([-24.0, -12.5, 0.0, 12.5, 24.0])
POPULATION = replace(DEFAULT_POPULATION, lapse_01=0.1)


def waves(n=3000, person=(0.5, 0.3, 0.0), seed=4):
    """Return two waves, one in plain sight, one mostly hidden, each seen once by many alike."""
    rng = np.random.default_rng(seed)
    many = np.array(DEFAULT_POPULATION.pixels)
    return Waves(
        pixels=np.stack([many, 0.3 * many]),
        pointing_deg=np.array([[-12.0, -14.0, -10.0, -12.0], [13.0, 5.0, 8.0, 20.0]]),
        bearing_deg=np.stack([BEARING, BEARING]),
        reach_01=np.array([[0.9, 1.0, 0.95, 0.9, 0.9], [1.0, 1.0, 0.9, 0.97, 1.0]]),
        own=np.array([2, 2]),
        target=np.array([1, 3]),
        cell=np.array([0, 1]),
        people=np.tile(person, (n, 1)),
        readings=rng.standard_normal((n, 2, 4)),
        attention=rng.random((n, 2)),
        guesses=rng.integers(5, size=(n, 2)),
    )


@pytest.mark.parametrize("k", [0, 1])
def test_shares_of_right_answers_are_those_of_the_judge(k):
    w = waves()
    blur, lapse = np.exp(POPULATION.acuity_sd * 0.5), lapse_share(POPULATION, 0.3)
    person = Person(blur, POPULATION.self_bias, lapse, 6.0, 1.0, 25, "man")
    evidence = Evidence(
        w.pixels[k], w.pixels[k], w.pointing_deg[k], w.bearing_deg[k], w.reach_01[k]
    )
    rng = np.random.default_rng(1)
    told = [judge(evidence, 2, person, POPULATION, rng).place for _ in range(3000)]
    share = np.mean(np.array(told) == w.target[k])
    assert share == pytest.approx(understood(w, POPULATION)[:, k].mean(), abs=0.04)


def test_the_search_tests_its_studies_as_the_report_does():
    rng = np.random.default_rng(3)
    shares = rng.binomial(9, 0.3 + 0.4 * rng.random((4, 16, 2, 3))) / 9
    _, person, technique, direction = np.indices(shares.shape)
    for k, y in enumerate(shares):
        tidy = {"s": person[k].ravel(), "A": technique[k].ravel(), "B": direction[k].ravel()}
        made = art_anova(
            tidy | {"y": y.ravel()}, "y", subject="s", within=("A", "B"), correction="none"
        )
        ps = [made.effect(name).p for name in ("A", "B", "A:B")]
        assert ps == pytest.approx(art_p(shares)[:, k].tolist(), rel=1e-9)


def test_a_point_of_the_search_is_its_population_again():
    again = population_of(point_of(DEFAULT_POPULATION))
    for name, value in vars(DEFAULT_POPULATION).items():
        assert value == pytest.approx(getattr(again, name))


def test_a_variant_differs_in_one_number():
    assert replace(DEFAULT_POPULATION, reach_power=0.0) == varied("reach_power=0")
    assert varied(f"acuity_sd={DEFAULT_POPULATION.acuity_sd}") == DEFAULT_POPULATION


@pytest.mark.parametrize("text", ["reach_power", "reach_power=much", "blur_deg=1", "reach=0"])
def test_a_variant_of_no_known_number_is_refused(text):
    with pytest.raises(UsageError, match="number"):
        varied(text)


def test_a_technique_that_does_harm_is_no_fit():
    power = (PRINTED.power(16, 0.05), 1.0, 0.05)
    better = Expected(
        accuracy=np.array([[0.7, 0.6, 0.5], [0.77, 0.67, 0.57]]),
        sd_people=np.array([0.25, 0.2]),
        sd_cells=np.array([0.25, 0.2]),
        power=power,
        gain_dz=PRINTED_DZ,
        gain_skew=0.0,
        reversed_01=0.25,
        orders=dict.fromkeys(ORDERS, 0.95),
    )
    worse = replace(better, accuracy=better.accuracy[::-1], gain_dz=-PRINTED_DZ, reversed_01=0.75)
    assert not better.misses.any()
    missed = {t.name for t, miss in zip(TARGETS, worse.misses, strict=True) if miss > 1}
    assert {
        "accuracy orientation",
        "accuracy warping",
        "difference of techniques, mean over SD",
        "people with whom it is reversed",
    } == missed


@pytest.mark.parametrize(
    ("value", "miss"),
    [(0.5, 0.0), (0.45, 0.0), (0.425, 0.5), (0.4, 1.0), (0.6, 1.0), (0.65, 2.0)],
)
def test_a_value_misses_its_target_by_one_where_it_is_on_a_limit(value, miss):
    assert miss == pytest.approx(Target("", 0.4, 0.6, 0.05).miss(value))


def test_places_are_weighed_as_the_judge_weighs_them():
    w = waves(n=200, person=(0.5, -9.0, 0.0))  # who attends to all
    q = POPULATION
    noise = noise_deg(w.pixels[None], np.exp(q.acuity_sd * 0.5), q)
    read = w.pointing_deg + noise * w.readings
    worth = worth_of(read, noise, w.bearing_deg[None], w.reach_01[None], q)
    worth[..., 2] += q.self_bias
    attended = replace(q, lapse_01=1e-12)
    assert (worth.argmax(axis=-1) == w.target).tolist() == understood(w, attended).tolist()


def test_evolution_comes_to_the_lowest_point_of_a_narrow_valley():
    lowest, widths = np.array([0.3, -0.2, 0.5, 0.0]), np.array([1.0, 0.1, 1.0, 0.3])

    def loss(x):
        return float((((x - lowest) / widths) ** 2).sum())

    middles = evolved(loss, np.zeros(4), np.random.default_rng(2))
    assert lowest == pytest.approx(
        next(m for m in islice(middles, 150) if loss(m) < 1e-4), abs=0.02
    )


def test_constants_far_from_those_that_hold_are_fitted_anew():
    away = 0.3 * np.random.default_rng(1).standard_normal(len(FREE))
    start = point_of(DEFAULT_POPULATION) + away
    assert max(expected(waves_of(SEEN, studies=100), population_of(start)).misses) > 1
    found, holds = fitted(SEEN, start, minutes=10.0)
    assert holds
    tested = expected(waves_of(SEEN, studies=200, seed=CHECK_SEED), population_of(found))
    assert max(tested.misses) <= 1


def test_constants_are_printed_as_the_judge_has_them():
    lines = source_lines(DEFAULT_POPULATION)
    own = inspect.getsource(Population).splitlines()
    assert len(lines) == len([line for line in lines if line in own])
    assert {name.partition(".")[0] for name in FREE} == {
        line.split(":")[0].strip() for line in lines
    }


def test_the_printed_f_of_technique_implies_the_difference_that_is_wanted():
    assert 0.666 == pytest.approx(PRINTED_DZ, abs=0.001)
    assert 0.70 == pytest.approx(PRINTED.power(16, 0.05), abs=0.01)


def test_fits_and_checks_share_no_seed_with_the_evaluation():
    assert min(FIT_SEED, FRESH_SEED, CHECK_SEED) > 10_000


def test_shares_of_orders_are_those_of_the_mechanism_that_reports_use():
    rng = np.random.default_rng(8)
    shares = rng.integers(0, 10, size=(40, 4, 2, 3)) / 9
    rows = [
        pd.DataFrame(
            [
                {"participant": p, "technique": t, "direction": d, "is_right": study[p, i, j]}
                for p in range(4)
                for i, t in enumerate(TECHNIQUES)
                for j, d in enumerate(DIRECTIONS)
            ]
        )
        for study in shares
    ]
    holds = {name: [order_holds(order, r) for r in rows] for name, order in ORDERS.items()}
    wanted = {name: np.mean(each) for name, each in holds.items()}
    assert wanted == pytest.approx(shares_of_orders(shares), abs=0.03)  # ties of rounded sums

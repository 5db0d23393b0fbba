"""The fit of the simulated judge looks at the same judge."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.waving_fit import (
    CHECK_SEED,
    FIT_SEED,
    Expected,
    Waves,
    expected,
    loss_terms,
    point_of,
    population_of,
    right_shares,
    varied,
)
from experiments.waving.judgement import DEFAULT_POPULATION, Person, judge, lapse_share
from experiments.waving.perception import Evidence
from lab.errors import UsageError

BEARING = np.array([-24.0, -12.5, 0.0, 12.5, 24.0])
POPULATION = replace(DEFAULT_POPULATION, lapse_01=0.1)


def waves(readings=3000, people=((0.5, 0.3),), seed=4):
    """Return two waves: one in plain sight, one mostly hidden."""
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
        people=np.array(people),
        readings=rng.standard_normal((len(people), 2, readings, 4)),
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
    assert share == pytest.approx(right_shares(w, POPULATION)[0, k], abs=0.04)


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


def test_a_technique_that_does_harm_has_no_power_that_counts():
    power = (0.99, 1.0, 0.05)
    better = Expected(np.array([[0.6, 0.6, 0.5], [0.7, 0.7, 0.6]]), np.ones(2), np.ones(2), power)
    worse = replace(better, accuracy=better.accuracy[::-1])
    still = np.zeros(15)
    assert 0.0 == loss_terms(better, still, still)["power of technique"]
    assert loss_terms(worse, still, still)["power of technique"] > 100


def test_more_people_have_more_power():
    rng = np.random.default_rng(2)
    w = waves(readings=20, people=rng.standard_normal((30, 2)))
    six = replace(
        w,
        **{name: np.repeat(getattr(w, name), 3, axis=0)
           for name in ("pixels", "pointing_deg", "bearing_deg", "reach_01", "own", "target")},
        cell=np.arange(6),
        readings=np.repeat(w.readings, 3, axis=1),
    )  # fmt: skip
    few, many = (expected(six, POPULATION, people).power[0] for people in (8, 32))
    assert 0.05 < few < many <= 1.0


def test_fits_and_checks_share_no_seed_with_the_evaluation():
    assert min(FIT_SEED, CHECK_SEED) > 10_000

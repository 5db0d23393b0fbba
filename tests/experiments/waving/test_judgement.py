"""How a simulated participant judges: from what is seen, and from nothing else."""

from dataclasses import fields, replace

import numpy as np
import pytest

from visavis.experiments.waving.judgement import DEFAULT_POPULATION, Person, draw_person, judge
from visavis.experiments.waving.perception import Evidence

BEARING = np.array([-24.0, -12.5, 0.0, 12.5, 24.0])
PERSON = Person(1.0, 0.0, 0.0, 6.0, 1.0, 25, "man")
# Rules of the model hold whatever people are fitted to.
CALM = replace(
    DEFAULT_POPULATION,
    blur_deg=(2.82, 0.466, 36.8, 1.28),
    looseness_deg=(0.68, 7.4, 11.7, 9.29),
    sharpness=0.922,
    reach_power=89.9,
    least_reach_01=0.393,
)
MANY = np.array(DEFAULT_POPULATION.pixels)


def evidence(towards=1, pixels=MANY, reach=(1.0,) * 5):
    return Evidence(pixels, MANY, np.full(4, BEARING[towards]), BEARING, np.array(reach))


def answers(seen, own=2, person=PERSON, n=400, effect=True):
    rng = np.random.default_rng(1)
    return np.array([judge(seen, own, person, CALM, rng, effect=effect).place for _ in range(n)])


def test_evidence_holds_pixels_and_directions_but_no_condition():
    assert {"pixels", "free", "pointing_deg", "bearing_deg", "reach_01"} == {
        f.name for f in fields(Evidence)
    }


@pytest.mark.parametrize("towards", range(5))
def test_a_wave_in_plain_sight_is_mostly_understood(towards):
    assert (answers(evidence(towards, 40 * MANY)) == towards).mean() > 0.8


def test_more_pixels_are_read_better():
    shares = [(answers(evidence(1, k * MANY)) == 1).mean() for k in (0.1, 1.0, 10.0)]
    assert sorted(shares) == shares
    assert shares[2] > shares[0] + 0.1


def test_who_sees_nothing_answers_by_leaning_and_line_of_sight():
    blind = np.zeros(4)
    assert (answers(evidence(0, blind, (0.05, 0.05, 0.05, 0.05, 1.0))) == 4).mean() > 0.6
    biased = replace(PERSON, self_bias=3.0)
    assert (answers(evidence(0, blind), own=3, person=biased) == 3).mean() > 0.6


def test_customers_who_cannot_see_the_wave_are_answered_less():
    open_line = (answers(evidence(3)) == 3).mean()
    hidden = (answers(evidence(3, reach=(1, 1, 1, 0.1, 1))) == 3).mean()
    assert hidden < open_line


def test_mirrored_evidence_gives_mirrored_probabilities():
    seen = evidence(1, reach=(0.4, 0.9, 1.0, 0.8, 0.2))
    mirrored = Evidence(MANY, MANY, -seen.pointing_deg, BEARING, seen.reach_01[::-1])
    loose = replace(CALM, blur_deg=(1e-9,) * 4)
    still = np.random.default_rng

    class Zero:
        def __init__(self):
            self._rng = still(0)

        def standard_normal(self, n=None):
            return 0.0 if n is None else np.zeros(n)

        def random(self):
            return 1.0

    one = judge(seen, 2, PERSON, loose, Zero()).probability
    other = judge(mirrored, 2, PERSON, loose, Zero()).probability
    assert one == pytest.approx(other[::-1], abs=1e-12)


def test_without_effect_the_wave_changes_no_answer():
    one = answers(evidence(0, 40 * MANY), effect=False)
    assert np.array_equal(one, answers(evidence(4, 40 * MANY), effect=False))


def test_realism_stays_on_the_scale_and_follows_sight():
    rng = np.random.default_rng(2)
    hidden = replace(evidence(), pixels=0.1 * MANY)
    seen = [judge(evidence(), 2, PERSON, CALM, rng).realism for _ in range(300)]
    behind = [judge(hidden, 2, PERSON, CALM, rng).realism for _ in range(300)]
    assert set(seen) | set(behind) <= set(range(1, 10))
    assert np.mean(behind) < np.mean(seen)


def test_the_same_seed_makes_the_same_person():
    one, other = (draw_person(DEFAULT_POPULATION, np.random.default_rng(5)) for _ in range(2))
    assert one == other


def test_who_never_attends_answers_any_place():
    absent = replace(PERSON, lapse_01=1.0)
    counts = np.bincount(answers(evidence(1, 40 * MANY), person=absent, n=1000), minlength=5)
    assert (np.abs(counts / 1000 - 0.2) < 0.06).all()


def test_shares_not_attended_to_lie_around_the_usual_one():
    population = replace(DEFAULT_POPULATION, lapse_01=0.1, lapse_sd=1.0)
    rng = np.random.default_rng(3)
    shares = [draw_person(population, rng).lapse_01 for _ in range(400)]
    assert 0.1 == pytest.approx(np.median(shares), abs=0.02)
    assert 0 < min(shares) < max(shares) < 1

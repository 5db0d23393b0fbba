"""People differ in what warping does to them as the printed statistics imply, to both sides.

`seen_waves.npz` is what a customer can see of the 54 waves: rendering them takes minutes where no
plan is kept. `python -m benchmarks.waving_fit --starts 0 --check 0 --seen FILE` makes it.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy import special

from benchmarks.waving_fit import (
    CHECK_SEED,
    PRINTED,
    PRINTED_DZ,
    Expected,
    expected,
    waves_of,
)
from benchmarks.waving_participants import MEAN_LIMIT, SD_LIMIT, SHARE_LIMITS
from experiments.waving.clips import TECHNIQUES
from experiments.waving.judgement import DEFAULT_POPULATION
from experiments.waving.quick_study import STIMULI, evidence_for
from experiments.waving.study import MEAN_ACCURACY

SEEN = dict(np.load(Path(__file__).with_name("seen_waves.npz")))


@pytest.fixture(scope="module")
def found() -> Expected:
    return expected(waves_of(SEEN, studies=200, seed=CHECK_SEED), DEFAULT_POPULATION)


@pytest.mark.parametrize("k", [0, 13])
def test_the_waves_in_the_file_are_those_of_the_study(k: int) -> None:
    assert TECHNIQUES[0] == STIMULI[k][0]  # without a plan, so quick to render
    fresh = evidence_for(STIMULI[k])
    for name, values in SEEN.items():
        assert np.asarray(getattr(fresh, name)) == pytest.approx(values[k], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("k", [0, 1])
def test_accuracies_and_their_spread_between_people_are_the_printed_ones(
    found: Expected, k: int
) -> None:
    mean, sd = MEAN_ACCURACY[TECHNIQUES[k]]
    assert mean == pytest.approx(found.accuracy[k].mean(), abs=MEAN_LIMIT / 2)
    assert sd == pytest.approx(found.sd_people[k], abs=SD_LIMIT)


def test_differences_between_techniques_have_the_printed_size_and_both_signs(
    found: Expected,
) -> None:
    implied = special.ndtr(-PRINTED_DZ)
    assert 0.25 == pytest.approx(implied, abs=0.01)
    assert implied == pytest.approx(found.reversed_01, abs=0.06)
    assert PRINTED_DZ == pytest.approx(found.gain_dz, abs=0.1)
    assert abs(found.gain_skew) < 0.5


def test_power_of_technique_is_the_closed_form_one_and_the_interaction_is_rare(
    found: Expected,
) -> None:
    technique, direction, interaction = found.power
    assert PRINTED.power(16, 0.05) == pytest.approx(technique, abs=0.08)
    assert direction > SHARE_LIMITS["is_right", "direction"][1]
    assert interaction <= SHARE_LIMITS["is_right", "technique:direction"][1] + 0.05

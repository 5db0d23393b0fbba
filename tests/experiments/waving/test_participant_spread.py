"""People differ in what warping does to them as the printed statistics imply, to both sides.

`seen_waves.npz` is what a customer can see of the 54 waves: rendering them takes minutes where no
plan is kept. `python -m benchmarks.waving_fit --keep FILE` makes it and fits people to it.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy import special

from benchmarks.waving_fit import (
    CHECK_SEED,
    CHECK_STUDIES,
    PRINTED_DZ,
    TARGETS,
    Expected,
    Target,
    expected,
    waves_of,
)
from visavis.experiments.waving.clips import TECHNIQUES
from visavis.experiments.waving.judgement import DEFAULT_POPULATION
from visavis.experiments.waving.quick_study import STIMULI, evidence_for

SEEN = dict(np.load(Path(__file__).with_name("seen_waves.npz")))


@pytest.fixture(scope="module")
def found() -> Expected:
    return expected(waves_of(SEEN, CHECK_STUDIES, seed=CHECK_SEED), DEFAULT_POPULATION)


@pytest.mark.parametrize("k", [0, 13])
def test_the_waves_in_the_file_are_those_of_the_study(k: int) -> None:
    assert TECHNIQUES[0] == STIMULI[k][0]  # without a plan, so quick to render
    fresh = evidence_for(STIMULI[k])
    for name, values in SEEN.items():
        assert np.asarray(getattr(fresh, name)) == pytest.approx(values[k], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("target", TARGETS, ids=[t.name for t in TARGETS])
def test_people_are_as_right_and_as_different_as_printed(found: Expected, target: Target) -> None:
    assert target.least <= found.values[target.name] <= target.most


def test_the_printed_f_implies_one_person_in_four_with_whom_warping_does_harm() -> None:
    assert 0.25 == pytest.approx(special.ndtr(-PRINTED_DZ), abs=0.01)

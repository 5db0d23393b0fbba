"""Rules of the decision path: which test runs, what it is compared with, what is shown."""

import numpy as np
import pytest

from visavis.analysis.statistics import compare_paired, correct_family
from visavis.analysis.statistics.signed_rank import SignedRank
from visavis.analysis.statistics.t_tests import TTest

NORMAL = np.array([-1.2, -0.7, -0.3, 0.0, 0.2, 0.6, 0.9, 1.4]) + 1.0
SKEWED = np.array([0.01, 0.02, 0.02, 0.03, 0.05, 0.06, 0.4, 30.0])
NOTHING = np.zeros(8)


def test_normal_differences_lead_to_the_paired_t_test() -> None:
    assert isinstance(compare_paired(NORMAL, NOTHING).test, TTest)


def test_skewed_differences_lead_to_the_signed_rank_test() -> None:
    assert isinstance(compare_paired(SKEWED, NOTHING).test, SignedRank)


def test_normality_threshold_decides_the_branch() -> None:
    p = compare_paired(NORMAL, NOTHING).normality.p
    assert not compare_paired(NORMAL, NOTHING, normality_alpha=min(0.999, p + 1e-3)).is_parametric


def test_bonferroni_threshold_is_alpha_over_the_family() -> None:
    one = compare_paired(NORMAL, NOTHING)
    of_thirty = compare_paired(NORMAL, NOTHING, n_tests=30)
    assert 0.05 == one.threshold
    assert one.significant
    assert 0.05 / 30 == of_thirty.threshold
    assert not of_thirty.significant
    assert 30 * one.p == pytest.approx(of_thirty.p_adjusted)


def test_every_branch_shows_its_numbers() -> None:
    result = compare_paired(NORMAL, NOTHING, names=("A", "D"), n_tests=5)
    assert 3 == len(result.steps)
    check, run, verdict = (str(step) for step in result.steps)
    assert "A − D" in check
    assert f"W = {result.normality.W:.3f}" in check
    assert "t(7) = " in run
    assert "threshold .01" in verdict
    assert "Bonferroni, 5 tests" == result.provenance.correction
    assert "paired t" == result.row()["test"]


def test_family_corrected_by_holm_spares_the_smallest_p() -> None:
    family = [compare_paired(NORMAL * s, NOTHING + c) for s, c in ((1, 0), (1, 0.6), (1, 0.9))]
    holm = correct_family(family, "holm")
    assert 3 * holm[0].p == pytest.approx(holm[0].p_adjusted)
    assert [c.p for c in family] == [c.p for c in holm]
    assert holm[2].p_adjusted == pytest.approx(max(holm[2].p, holm[1].p_adjusted))
    assert correct_family([], "holm") == ()

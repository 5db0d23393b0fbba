"""People of the crowd differ, and change between blocks, as much as the printed tests imply."""

import numpy as np
import pytest

from benchmarks.crowd_participants import PUBLISHED, quick_study
from visavis.experiments.crowd.design import CONDITIONS
from visavis.experiments.crowd.published import PARTICIPANTS, TESTS

SEED = 2026
"""One on which nothing was fitted."""
PEOPLE = 14
FITTED = ("collisions", "shoulders_to_gap_deg", "speed_m_s")
"""Volumes are not: those of people whose arms meet bodies end at what an arm holds."""


@pytest.fixture(scope="module")
def walks():
    return quick_study(PEOPLE, SEED).trials


def changed(cells):
    """Return the SD of what neither a person nor a block explains; cells (people, blocks)."""
    left = cells - cells.mean(axis=1, keepdims=True) - cells.mean(axis=0) + cells.mean()
    return float(np.sqrt((left**2).sum() / ((len(cells) - 1) * (cells.shape[1] - 1))))


def implied(measure):
    """Return that SD as the printed F and means imply it."""
    means, _ = PUBLISHED[measure]
    return float(np.sqrt(PARTICIPANTS * np.var(means, ddof=1) / TESTS[measure].statistic))


# Slow: whole blocks, since people's form wanders over as many walks as a block has.
@pytest.mark.parametrize("measure", FITTED)
def test_people_change_from_block_to_block_as_the_printed_f_implies(walks, measure):
    cells = walks.groupby(["participant", "condition"])[measure].mean().unstack()
    # 26 degrees of freedom: the standard error of such an SD is 14 %.
    assert implied(measure) == pytest.approx(changed(cells[list(CONDITIONS)].to_numpy()), rel=0.4)


@pytest.mark.parametrize("measure", FITTED)
def test_people_differ_from_each_other_as_printed(walks, measure):
    cells = walks.groupby(["participant", "condition"])[measure].mean().unstack()
    _, printed = PUBLISHED[measure]
    # 13 degrees of freedom: 20 %; over blocks together.
    assert np.mean(printed) == pytest.approx(np.mean(cells.std(ddof=1)), rel=0.4)


def test_some_people_go_against_the_others(walks):
    cells = walks.groupby(["participant", "condition"])["collisions"].mean().unstack()
    before, haptic = (cells[c] for c in CONDITIONS[:2])
    assert 0 < (haptic > before).mean() < 0.5

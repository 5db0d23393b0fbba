"""A map of reach: blends stay among what examples span, and the examples themselves are reached."""

import numpy as np

from visavis.stimuli.motion.synthesis.reach import Reach, reach_of
from visavis.stimuli.motion.synthesis.walk_features import GROUPS, feature_table
from visavis.stimuli.motion.synthesis.walk_styles import walk_set


def test_cells_are_those_in_which_a_point_lies_whatever_the_other_parameters() -> None:
    points = np.array([[0.05, 0.95, 0.1], [0.55, 0.05, 0.9], [1.0, 1.0, 0.5], [1.2, 0.5, 0.5]])
    reach = Reach(("a", "b", "c"), points)
    cells = reach.cells(0, 1, count=2)
    assert cells.tolist() == [[False, True], [True, True]]
    assert reach.planes[0, 1] == 3 / 100


def test_examples_are_reached_and_corners_far_from_all_are_not() -> None:
    walks = walk_set("set_a")
    reach = reach_of(walks, tuple(GROUPS), 90, np.random.default_rng(2))
    primary = feature_table(walks).primary
    assert np.abs(reach.points[: len(walks)] - primary).max() < 1e-6
    for i, j in reach.planes:
        cells = reach.cells(i, j)
        for point in primary[:, [i, j]]:
            x, y = np.minimum((point * 10).astype(int), 9)
            assert cells[y, x]
    # More blends can only reach more.
    fewer = reach_of(walks, tuple(GROUPS), 9, np.random.default_rng(2))
    assert all(reach.planes[p] >= fewer.planes[p] for p in reach.planes)

"""The body of a simulated person who sits or stands before a display and points."""

import numpy as np
import pytest

from visavis.body import segments_of


def test_the_feet_of_a_simulated_person_stand_on_the_floor():
    names = ("hips", "left_toes", "right_toes", "head")
    nowhere = np.zeros((1, 3))
    hips, left, right, head = segments_of(names, nowhere, nowhere, nowhere - [0, 0, 1])[0][0]

    assert (0, 0) == pytest.approx((left[1], right[1]), abs=0.05)
    assert 0.85 < hips[1] < 1.05
    assert 1.4 < head[1] < 1.7

import numpy as np
import pytest

from tests.analysis.gaze.streams import TRIAL_NS, TRIAL_ROWS, stamps
from visavis.analysis.gaze.aoi import aoi_by_pad
from visavis.analysis.gaze.sensitivity import sensitivity_of_trial


def test_each_pad_and_minimum_has_its_row():
    angle = np.full((TRIAL_ROWS, 1), 20.0)
    angle[100:130] = 2.5  # 250 ms within the head
    angle[300:322] = 3.8  # 183 ms within 1 degree of the rim
    angle[500:515] = 4.7  # 125 ms within 2 degrees
    hit = np.where(angle[:, 0] < 3, 0, -1).astype(np.int16)
    radius, limit = np.full(angle.shape, 3.0), np.full(angle.shape, 9.0)
    areas = aoi_by_pad(angle, radius, limit, hit)
    rows = list(sensitivity_of_trial(stamps(TRIAL_ROWS), areas, 0, 0, TRIAL_NS))
    expected = {
        (0.0, 100.0): 1, (0.0, 150.0): 1, (0.0, 200.0): 1,
        (0.5, 100.0): 1, (0.5, 150.0): 1, (0.5, 200.0): 1,
        (1.0, 100.0): 2, (1.0, 150.0): 2, (1.0, 200.0): 1,
        (1.5, 100.0): 2, (1.5, 150.0): 2, (1.5, 200.0): 1,
        (2.0, 100.0): 3, (2.0, 150.0): 2, (2.0, 200.0): 1,
    }  # fmt: skip
    assert expected == {(r.pad_deg, r.minimum_fixation_ms): r.measures.fixation_count for r in rows}
    assert pytest.approx(67 * 1000 / 120, abs=1e-3) == rows[-1].measures.dwell_ms

"""The floor of contact poses those who are touched, no more and no less."""

import numpy as np

from benchmarks.crowd_contact import pose_known, walk_through
from visavis.stimuli.contact.touch import TouchSensor


def test_the_floor_poses_and_describes_exactly_who_is_touched():
    walk = walk_through(100, 300)
    sensor = TouchSensor(walk.crowd)
    expected = [sensor.touches(*ends, walk.radius_m, i / 90) for i, ends in enumerate(walk.ends_m)]
    _, last, touches = pose_known(walk)
    assert expected == touches
    touched = {touch.person for frame in expected for touch in frame}
    assert touched
    assert touched == set(np.flatnonzero(np.isfinite(last.t_s)).tolist())

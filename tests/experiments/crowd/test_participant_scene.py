"""A simulated participant walks through the crowd that is shown, not through the one before."""

import numpy as np

from visavis.analysis.gait import clearance_m
from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.lab.body_joints import BODY_JOINTS
from visavis.stimuli.scenes.station_crowd import (
    EMPTY_STATION,
    CrowdFrame,
    CrowdScene,
    station_crowd,
)

NO_GAZE = np.empty((0, 3))
STEP_NS = 100_000_000


def shown(scene, t_ns):
    return CrowdFrame(scene, t_ns, NO_GAZE, NO_GAZE[:, 0])


def test_a_crowd_left_on_the_display_is_not_walked_through():
    participant = CrowdParticipant(0, 1, effect=True)
    before, after = (CrowdScene(f"station_{c}", agents=(), crowd=station_crowd(c)) for c in (1, 2))
    participant.prepare(1, 0)
    participant.see(shown(before, 0), 0)
    participant.prepare(2, STEP_NS)
    participant.see(shown(before, STEP_NS), STEP_NS)
    for step in range(2, 20):
        participant.see(shown(EMPTY_STATION, step * STEP_NS), step * STEP_NS)
        participant.head(step * STEP_NS)
    t_ns = np.arange(20, 160, dtype=np.int64) * STEP_NS
    participant.see(shown(after, int(t_ns[0])), int(t_ns[0]))
    position, _ = participant.segments(BODY_JOINTS, t_ns)
    clear = [
        float(clearance_m(position[:, 0, [0, 2]], station_crowd(c).position_m).min())
        for c in (1, 2)
    ]
    assert clear[1] > 0.15 > clear[0]

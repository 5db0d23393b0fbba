"""When people look at people while they walk through a crowd."""

import numpy as np

from visavis.analysis.gaze.targets import GazeTargets
from visavis.experiments.crowd.looks import shares_on_people
from visavis.stimuli.scenes.station_crowd import station_crowd

MS = 1_000_000
CHEST_M, EYE_M = 1.2, 1.6


def test_looks_end_on_the_people_who_stand_there_and_on_nobody_above_them() -> None:
    """From a metre away at somebody's chest for a step, then over all heads, then lost."""
    crowd = station_crowd(1)
    x, z = crowd.position_m[0]
    eye = np.array([x + 0.4, EYE_M, z + 0.4])
    at_chest = np.array([x, CHEST_M, z]) - eye
    n = 75
    direction = np.repeat([at_chest, [0.1, 1.0, 0.0], [np.nan] * 3], 25, axis=0)
    valid = np.arange(n) < 50
    none = np.full((n, 1), 90.0)
    samples = GazeTargets(
        np.arange(n) * 10 * MS + 500 * MS,
        valid,
        direction,
        none,
        none,
        none,
        np.full(n, -1),
        origin_world_m=np.tile(eye, (n, 1)),
    )
    steps = list(shares_on_people(samples, crowd, (500 * MS, 1250 * MS)))
    assert [1.0, 0.0, None] == [step["on_agent_01"] for step in steps]
    assert [125.0, 375.0, 625.0] == [step["t_ms"] for step in steps]

"""A made-up walk: a standing body carried along a straight line through a crowd."""

from typing import Any

import numpy as np

from visavis.experiments.crowd.walks import Walk
from visavis.stimuli.contact.idle import crowd_poses, people_of
from visavis.stimuli.scenes.station_crowd import START_M, Crowd, station_crowd

STATURE_M = 1.75


def carried(
    seconds: float = 4.0,
    *,
    begin: tuple[float, float] = (-2.5, 2.6),
    end: tuple[float, float] = (-0.5, 0.6),
    step_s: float = 0.01,
    crowd: Crowd | None = None,
    **row: Any,
) -> Walk:
    """Return a walk from one place to another (x, z) in a straight line."""
    people = station_crowd(1) if crowd is None else crowd
    someone = people_of(station_crowd(1))[:1].copy()
    someone[0, :2], someone[0, 4] = 0.0, 0.0
    position, turn = crowd_poses(someone, 0.0)
    n = round(seconds / step_s) + 1
    share = np.linspace(0, 1, n)[:, None]
    place = np.array(begin) + share * (np.array(end) - np.array(begin))
    at = np.repeat(position, n, axis=0)
    at[:, :, [0, 2]] += place[:, None]
    t_ns = np.arange(n, dtype=np.int64) * round(step_s * 1e9)
    return Walk(
        "T01",
        {
            "trial_id": "T01",
            "participant": "S01",
            "condition": "Haptic",
            "configuration": people.configuration,
            "t_start_ns": 0,
            "t_end_ns": int(t_ns[-1]) + 1,
            "came_back": True,
            "is_simulated": True,
            **row,
        },
        people,
        t_ns,
        at,
        np.repeat(turn, n, axis=0),
        STATURE_M,
    )


def nowhere_near() -> tuple[float, float]:
    """Return a place (x, z) where nobody stands."""
    return START_M[0] - 0.4, START_M[1] + 0.4

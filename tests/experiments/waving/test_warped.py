"""What is told of a warped wave holds for what an observer sees, not for the raster's edges."""

from dataclasses import replace

import numpy as np
import pytest

from visavis.experiments.waving.clips import (
    DEFAULT_MAKING,
    WARPING,
    Making,
    reached_in,
    situation_of,
    study_wave,
)
from visavis.stimuli.dressing.office_view import eye_at, view_of
from visavis.stimuli.motion.warping.control import see

CLERK, PLACE = "clerk_left", "place_3"
ALLOWED = 0.1 * DEFAULT_MAKING.increment
"""How far from its target a feature may be, as a share of the original one."""


def test_features_are_told_to_a_quarter_of_what_may_be_left():
    """By a view four times as fine; at half as many pixels the hand's error is twice as large."""
    waving = study_wave(CLERK, PLACE, WARPING, replace(DEFAULT_MAKING, increment=0.0)).waving
    finer = view_of(CLERK, eye_at(PLACE), PLACE, 2048)
    off = []
    for t_s in np.linspace(waving.start_s, waving.end_s, 20):
        told = situation_of(waving, PLACE, eye_at(PLACE), float(t_s), DEFAULT_MAKING.increment)
        still = np.zeros((1, len(told.units)))
        off.append(see(told, still)[0] / see(replace(told, view=finer), still)[0] - 1)
    assert np.std(off, axis=0) == pytest.approx(0.0, abs=0.25 * ALLOWED)


def test_a_plan_holds_between_its_keys_as_on_them():
    making = Making(before_s=0.3, wave_s=0.6)
    wave = study_wave(CLERK, PLACE, WARPING, making)
    track = wave.waving.warp
    assert track is not None
    assert wave.plan_result is not None
    on_keys = reached_in(
        (CLERK, PLACE, making),
        track.key_s,
        track.omega_rad,
        np.tile(eye_at(PLACE), (len(track.key_s), 1)),
    )
    assert wave.plan_result.met_01 >= 0.8 * wave.plan_result.reachable_01
    assert wave.plan_result.met_01 >= on_keys.met_01 - 0.1

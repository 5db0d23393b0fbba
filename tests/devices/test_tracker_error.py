"""The simulated tracker errs as published trackers do, and repeats by seed."""

import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pytest

from visavis.devices import sim
from visavis.devices.sim.gaze.source import GazePeer
from visavis.devices.sim.gaze.tracker_error import (
    StretchNoise,
    TrackerErrorModel,
    draw_systematic,
    measured_directions,
)
from visavis.devices.sim.gaze.trackers import SPREAD_OF_NOISE, TRACKERS, sizes_of_error
from visavis.lab.geometry import angle_deg, direction_from_yaw_pitch_deg, unit

MODEL = TrackerErrorModel()
GRID_DEG = np.array([-15.0, -7.5, 0.0, 7.5, 15.0])


def mean_error_deg(seed, model=MODEL, **fits):
    error = draw_systematic(model, seed, **fits)
    yaw, pitch = np.meshgrid(GRID_DEG, GRID_DEG)
    truth = direction_from_yaw_pitch_deg(yaw.ravel(), pitch.ravel())
    out = np.empty((truth.shape[0], 2, 3))
    silent = np.zeros((truth.shape[0], 11))
    measured_directions(truth, truth, silent, error.offset_rad, error.gain, out)
    return angle_deg(unit(out.mean(axis=1)), truth).mean()


def test_calibrated_accuracy_is_near_the_published_mean():
    errors = [mean_error_deg(seed, fit=0, calibrated_fit=0) for seed in range(300)]

    assert 0.75 < np.mean(errors) < 1.1


def test_uncalibrated_and_slipped_headsets_are_worse():
    def mean(**fits):
        return np.mean([mean_error_deg(seed, **fits) for seed in range(100)])

    calibrated = mean(fit=1, calibrated_fit=1)
    assert mean(fit=1, calibrated_fit=0) > 1.5 * calibrated
    assert mean(fit=1, calibrated_fit=None) > 3 * calibrated


def test_precision_is_near_the_published_figures():
    noise = StretchNoise(MODEL, 1, 1, 120.0).take(20_000)
    ahead = np.tile([0.0, 0.0, -1.0], (20_000, 1))
    out = np.empty((20_000, 2, 3))
    measured_directions(ahead, ahead, noise, np.zeros((2, 2)), np.zeros((2, 2)), out)
    seen = unit(out.mean(axis=1))

    rms_deg = np.sqrt(np.mean(angle_deg(seen[1:], seen[:-1]) ** 2))
    sd_deg = np.degrees(np.hypot(seen[:, 0].std(), seen[:, 1].std()))
    assert rms_deg == pytest.approx(0.11, abs=0.01)
    assert sd_deg == pytest.approx(0.18, abs=0.02)


def test_noise_does_not_depend_on_how_it_is_taken():
    whole = StretchNoise(MODEL, 1, 5, 120.0).take(2000)
    parts = StretchNoise(MODEL, 1, 5, 120.0)

    taken = np.concatenate([parts.take(n) for n in (1, 2, 509, 1, 700, 787)])

    np.testing.assert_array_equal(whole, taken)


def test_missing_direction_stays_missing():
    nothing = np.full((1, 3), np.nan)
    out = np.empty((1, 2, 3))

    measured_directions(
        nothing, nothing, np.zeros((1, 11)), np.zeros((2, 2)), np.zeros((2, 2)), out
    )

    assert np.isnan(out).all()


def step_deg(model, seed):
    """Return the RMS angle between successive samples of two eyes that rest ahead."""
    ahead = np.tile([0.0, 0.0, -1.0], (400, 1))
    out = np.empty((400, 2, 3))
    noise = StretchNoise(model, seed, 0, 200.0).take(400)
    measured_directions(ahead, ahead, noise, np.zeros((2, 2)), np.zeros((2, 2)), out)
    seen = unit(out.mean(axis=1))
    return np.sqrt(np.mean(angle_deg(seen[1:], seen[:-1]) ** 2))


@pytest.mark.parametrize("driver", sorted(TRACKERS))
def test_a_simulated_tracker_measures_as_its_makers_and_others_say(driver):
    """Every simulated tracker had one error, the same noise for everybody."""
    figures, sizes = TRACKERS[driver], sizes_of_error(driver)
    model = TrackerErrorModel(**sizes)
    assert figures.sources
    if figures.accuracy_deg is not None:
        off = [mean_error_deg(seed, model, fit=0, calibrated_fit=0) for seed in range(400)]
        assert figures.accuracy_deg == pytest.approx(np.mean(off), rel=0.1)
    steps = [step_deg(model, seed) for seed in range(300)]
    if figures.rms_deg is not None:
        assert figures.rms_deg == pytest.approx(np.median(steps), rel=0.1)
    if figures.delay_ms is not None:
        assert figures.delay_ms == model.latency_ms
    assert SPREAD_OF_NOISE == pytest.approx(np.std(np.log(steps)), rel=0.15)


def test_trackers_of_the_table_are_simulated_and_stand_in_the_docs():
    names = [m.name for m in pkgutil.iter_modules(sim.__path__) if not m.ispkg]
    peers = {
        of.driver
        for name in names
        for of in vars(importlib.import_module(f"{sim.__name__}.{name}")).values()
        if isinstance(of, type) and issubclass(of, GazePeer) and of.driver
    }
    assert set(TRACKERS) == peers
    page = (Path(__file__).parents[2] / "docs" / "eye-trackers.md").read_text(encoding="utf-8")
    for driver, figures in TRACKERS.items():
        cells = [figures.accuracy_deg, figures.rms_deg, figures.delay_ms]
        told = " | ".join("–" if cell is None else f"{cell:g}" for cell in cells)
        assert f"| `{driver}` | {figures.name} | {told} | {figures.sources} |" in page

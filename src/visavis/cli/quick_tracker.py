"""The tracker error of the simulated Pupil Core, without its wire: for power and benchmarks."""

import numpy as np
import numpy.typing as npt

from visavis.devices.sim.gaze.tracker_error import (
    N_SLOW,
    N_WHITE,
    StretchNoise,
    TrackerErrorModel,
    draw_systematic,
    measured_directions,
)
from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Vector, unit
from visavis.running.sessions.session_request import device_seed

RATE_HZ = 120.0
TRIAL_SAMPLES = 2304
"""Samples drawn at once: a trial of 16 s and the dark before it."""
OPENNESS_SEEN_01 = (0.6 / 0.99 + 0.1) / 1.2
"""Lids at which the simulator's confidence reaches the driver's threshold of 0.6."""


class QuickTracker:
    """Draw the same errors as the simulated device, from the same seeds."""

    def __init__(self, seed: int, model: TrackerErrorModel | None = None) -> None:
        self._seed = seed
        self._model = TrackerErrorModel() if model is None else model
        self._noise = np.empty((0, 0))
        self._stretch = -1
        self._fit = -1
        self._systematic = draw_systematic(self._model, seed, fit=-1, calibrated_fit=-1)

    @property
    def delay_ns(self) -> int:
        """Mean time from a sample to its arrival."""
        return round(self._model.latency_ms * NS_PER_MS)

    def measure(
        self, eyes: npt.NDArray[np.void], *, first_sample: int, stretch: int, fit: int
    ) -> tuple[Vector, npt.NDArray[np.bool_]]:
        """Return combined directions in the head frame (n, 3) and validity (n,)."""
        n = eyes.shape[0]
        if fit != self._fit:
            self._fit = fit
            self._systematic = draw_systematic(self._model, self._seed, fit=fit, calibrated_fit=fit)
        if stretch != self._stretch or self._noise.shape[0] < first_sample + n:
            self._stretch = stretch
            noise = StretchNoise(self._model, self._seed, stretch, RATE_HZ)
            # Every row belongs to its sample, so drawing twice as many later repeats the first.
            self._noise = noise.take(max(2 * (first_sample + n), TRIAL_SAMPLES))
        out = np.empty((n, 2, 3))
        measured_directions(
            eyes["left_direction_head"],
            eyes["right_direction_head"],
            self._noise[first_sample:, : N_WHITE + N_SLOW],
            self._systematic.offset_rad,
            self._systematic.gain,
            out,
        )
        return unit(out.sum(axis=1)), eyes["openness_01"] >= OPENNESS_SEEN_01


def tracker_of(seed: int, index: int) -> QuickTracker:
    """Return the tracker a whole session of this participant would get."""
    return QuickTracker(device_seed(seed, index))

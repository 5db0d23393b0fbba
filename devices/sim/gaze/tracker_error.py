"""Errors of a simulated eye tracker: systematic per fit, noise per stretch of behaviour.

Figures follow published head-mounted trackers: mean error 1.08° and median 0.84° over 18
people (Schuetz & Fiehler 2022, J. Eye Mov. Res., Vive Pro Eye), where the samples' SD had a
median of 0.20° and RMS of successive angles 0.08°, said there to be biased low by repeats.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled

Floats = npt.NDArray[np.float64]

BLOCK_SAMPLES = 512
N_WHITE = 4
N_SLOW = 2
N_UNIFORM = 5

_ERROR_STREAM = 0x5E
_NOISE_STREAM = 0x4E
_PERSON_STREAM = 0x5B
_SEED_RANGE = 2**64


@dataclass(frozen=True)
class TrackerErrorModel:
    """Sizes of the error, degrees unless named otherwise; all standard deviations per axis.

    `offset_deg` is shared by both eyes, `eye_offset_deg` is each eye's own; `gain_sd_01` makes
    the error grow with eccentricity. White noise is per eye and sample, slow noise is shared
    and first-order with time constant `slow_time_constant_s`; `noise_spread` is the SD of the
    logarithm by which people differ in both.
    """

    offset_deg: float = 0.58
    eye_offset_deg: float = 0.45
    gain_sd_01: float = 0.03
    uncalibrated_factor: float = 5.0
    slipped_factor: float = 2.0
    white_deg: float = 0.07
    slow_deg: float = 0.12
    slow_time_constant_s: float = 0.25
    latency_ms: float = 12.0
    latency_jitter_ms: float = 0.8
    noise_spread: float = 0.0


@dataclass(frozen=True)
class SystematicError:
    """Yaw and pitch, left and right eye: offsets in radians (2, 2) and gains (2, 2)."""

    offset_rad: Floats
    gain: Floats


def draw_systematic(
    model: TrackerErrorModel, seed: int, *, fit: int, calibrated_fit: int | None
) -> SystematicError:
    """Draw the error of a headset in this `fit`, calibrated at `calibrated_fit` or never.

    The same arguments always give the same error.
    """
    calibration = -1 if calibrated_fit is None else calibrated_fit
    rng = np.random.default_rng(
        [seed, _ERROR_STREAM, fit % _SEED_RANGE, (calibration + 1) % _SEED_RANGE]
    )
    factor = 1.0
    if calibrated_fit is None:
        factor = model.uncalibrated_factor
    elif calibrated_fit != fit:
        factor = model.slipped_factor
    shared_deg = rng.normal(0.0, model.offset_deg, 2)
    own = rng.normal(0.0, model.eye_offset_deg, (2, 2))
    gain = rng.normal(0.0, model.gain_sd_01, (2, 2))
    return SystematicError(np.radians(factor * (shared_deg + own)), factor * gain)


def noise_of_person(model: TrackerErrorModel, seed: int) -> float:
    """Return by how much the noise of the person whose session has this seed is the usual one."""
    if model.noise_spread == 0:
        return 1.0
    rng = np.random.default_rng([seed, _PERSON_STREAM])
    return float(np.exp(model.noise_spread * rng.standard_normal()))


class StretchNoise:
    """Noise of one stretch: row i always belongs to the stretch's i-th sample.

    Columns: white yaw and pitch of the left and the right eye, slow yaw and pitch (radians),
    then `N_UNIFORM` uniform numbers for latency and faults.
    """

    def __init__(self, model: TrackerErrorModel, seed: int, stretch: int, rate_hz: float) -> None:
        self._rng = np.random.default_rng([seed, _NOISE_STREAM, stretch % _SEED_RANGE])
        person = noise_of_person(model, seed)
        self._white_rad = np.radians(model.white_deg) * person
        self._slow_rad = np.radians(model.slow_deg) * person
        self._keep = float(np.exp(-1.0 / (rate_hz * model.slow_time_constant_s)))
        self._state = self._rng.standard_normal(N_SLOW) * self._keep
        self._rows = np.empty((0, N_WHITE + N_SLOW + N_UNIFORM))
        self._next = 0

    def take(self, n: int) -> Floats:
        """Return the next n rows, shape (n, N_WHITE + N_SLOW + N_UNIFORM)."""
        end = self._next + n
        if end > self._rows.shape[0]:
            parts = [self._rows[self._next :]]
            have = parts[0].shape[0]
            while have < n:
                parts.append(self._block())
                have += BLOCK_SAMPLES
            self._rows = np.concatenate(parts)
            self._next, end = 0, n
        rows = self._rows[self._next : end]
        self._next = end
        return rows

    def following(self, n: int) -> Floats:
        """Return what `take` will return."""
        rows = self.take(n)
        self._next -= n
        return rows

    def _block(self) -> Floats:
        rng = self._rng
        block = np.empty((BLOCK_SAMPLES, N_WHITE + N_SLOW + N_UNIFORM))
        block[:, :N_WHITE] = rng.standard_normal((BLOCK_SAMPLES, N_WHITE)) * self._white_rad
        drive = rng.standard_normal((BLOCK_SAMPLES, N_SLOW)) * np.sqrt(1 - self._keep**2)
        slow = block[:, N_WHITE : N_WHITE + N_SLOW]
        _first_order(drive, self._keep, self._state, slow)
        slow *= self._slow_rad
        block[:, N_WHITE + N_SLOW :] = rng.random((BLOCK_SAMPLES, N_UNIFORM))
        return block


@compiled
def _first_order(drive: Floats, keep: float, state: Floats, out: Floats) -> None:
    """Filter columns: out[i] = drive[i] + state, state = keep * out[i]."""
    for i in range(drive.shape[0]):
        for k in range(drive.shape[1]):
            out[i, k] = drive[i, k] + state[k]
            state[k] = keep * out[i, k]


@compiled
def measured_directions(
    left: Floats, right: Floats, noise: Floats, offset_rad: Floats, gain: Floats, out: Floats
) -> None:
    """Write the directions that the tracker reports for true ones (n, 3) in the head frame.

    `out` (n, 2, 3) gets unit vectors, left eye first. Non-finite directions stay so.
    """
    for i in range(left.shape[0]):
        for eye in range(2):
            if eye == 0:
                x, y, z = left[i, 0], left[i, 1], left[i, 2]
            else:
                x, y, z = right[i, 0], right[i, 1], right[i, 2]
            yaw = np.arctan2(-x, -z)
            pitch = np.arctan2(y, np.hypot(x, z))
            yaw_error = offset_rad[eye, 0] + gain[eye, 0] * yaw + noise[i, 2 * eye] + noise[i, 4]
            pitch_error = (
                offset_rad[eye, 1] + gain[eye, 1] * pitch + noise[i, 2 * eye + 1] + noise[i, 5]
            )
            yaw += yaw_error / max(np.cos(pitch), 0.2)
            pitch += pitch_error
            out[i, eye, 0] = -np.sin(yaw) * np.cos(pitch)
            out[i, eye, 1] = np.sin(pitch)
            out[i, eye, 2] = -np.cos(yaw) * np.cos(pitch)

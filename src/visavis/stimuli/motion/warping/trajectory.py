"""Offsets over a whole clip: as near to the wanted features as a smooth movement can be.

Poses solved one by one differ in what the target leaves free, and filtering them over time loses
the target. Here all keys are solved together, Gauss-Newton step by step: features against their
goals (the same Jacobians and caps as one pose), the second derivative of the offsets over time,
and a weak pull back to the original motion.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.warping.control import (
    ControlSettings,
    Outcome,
    Situation,
    cap_length,
    is_within,
    linearise,
    scale_of,
    see,
)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Offsets (k, w) at the keys, features (k, f) seen there, and what the solution cost."""

    omega_rad: Vector
    features: Vector
    cost: float


def correct_offsets(
    situations: Sequence[Situation],
    outcomes: Sequence[Outcome],
    omega_rad: Vector,
    step_s: float,
    settings: ControlSettings,
    *,
    is_loop: bool = False,
    pool: ThreadPoolExecutor | None = None,
    progress: Callable[[], None] | None = None,
) -> Trajectory:
    """Correct smooth offsets (k, w) until the features come to their goals, and stay smooth.

    The goal of a pose that could not reach its target alone is the best it reached. Returns the
    cheapest of all trajectories met.
    """
    bend = _bending(len(omega_rad), step_s, settings.smooth_s, is_loop=is_loop)
    goals = np.array([o.goal if o.is_reached else o.final for o in outcomes])
    scales = np.array([scale_of(s, o.original) for s, o in zip(situations, outcomes, strict=True)])
    limit = np.radians([u.range_deg for u in situations[0].units])
    omega, most = omega_rad, -1
    best: Trajectory | None = None
    for n in range(settings.passes + 1):
        last = n == settings.passes
        looks = [
            (see(s, w[None])[0], np.zeros((len(s.targets), len(w))))
            if last
            else linearise(s, w, settings, pool)
            for s, w in zip(situations, omega, strict=True)
        ]
        features, jacobians = np.array([a for a, _ in looks]), np.array([b for _, b in looks])
        left = scales * (goals - features)
        cost = float((left**2).sum() + settings.smoothness**2 * ((bend @ omega) ** 2).sum())
        n_reached = sum(
            is_within(g, o.original, s, situation)
            for g, o, s, situation in zip(goals, outcomes, features, situations, strict=True)
        )
        if best is None or (n_reached, -cost) > (most, -best.cost):
            best, most = Trajectory(omega, features, cost), n_reached
        if progress is not None:
            progress()
        if last or (n_reached == len(situations) and n > 1):
            return best
        changes = np.array([cap_length(e, settings.error_cap) for e in left])
        change = _solve(scales[..., None] * jacobians, changes, omega, bend, settings)
        cap = np.radians(settings.step_cap_deg)
        omega = np.clip(omega + np.clip(change, -cap, cap), -limit, limit)
    raise AssertionError


def _bending(n: int, step_s: float, time_s: float, *, is_loop: bool) -> sparse.csr_array:
    """Return the matrix (rows, n) that turns n keys into τ² times their second derivative."""
    rows = np.arange(n if is_loop else max(n - 2, 0))
    at = [(rows + k) % n for k in range(3)]
    share = (time_s / step_s) ** 2 * np.repeat([1.0, -2.0, 1.0], len(rows))
    entries = (np.tile(rows, 3), np.concatenate(at))
    return sparse.csr_array(sparse.coo_array((share, entries), shape=(len(rows), n)))


def _solve(
    jacobians: Vector,
    changes: Vector,
    omega: Vector,
    bend: sparse.csr_array,
    settings: ControlSettings,
) -> Vector:
    """Return the change (k, w) that minimises errors, bending and distance from the original."""
    from scipy.sparse.linalg import splu  # imported here, because serving a study does not need it

    keys, _, units = jacobians.shape
    stiff = settings.smoothness**2 * (bend.T @ bend)
    hold = settings.rest_pull * settings.damping**2
    blocks = sparse.block_diag([j.T @ j for j in jacobians])
    system = (
        blocks
        + sparse.kron(stiff, sparse.eye_array(units))
        + (settings.damping**2 + hold) * sparse.eye_array(keys * units)
    )
    pull = np.einsum("kfw,kf->kw", jacobians, changes) - stiff @ omega - hold * omega
    solution: Vector = splu(sparse.csc_array(system)).solve(pull.ravel()).reshape(keys, units)
    return solution


def interpolate_offsets(
    key_s: Vector, omega_rad: Vector, times_s: Vector, *, is_loop: bool = False
) -> Vector:
    """Return offsets (n, w) at times from those at keys (k, w), with a continuous acceleration.

    A loop has its first key again after the last.
    """
    from scipy.interpolate import CubicSpline  # late, as above

    if len(key_s) == 1:
        return np.repeat(omega_rad, len(times_s), axis=0)
    if is_loop:
        omega_rad = np.concatenate([omega_rad, omega_rad[:1]])
        key_s = np.append(key_s, 2 * key_s[-1] - key_s[-2])
        return np.asarray(CubicSpline(key_s, omega_rad, bc_type="periodic")(times_s))
    return np.asarray(CubicSpline(key_s, omega_rad, bc_type="natural")(times_s))

"""The control loop: how much to turn each unit so that what is perceived comes to the target.

After Chaumette & Hutchinson 2006 (visual servoing): central differences over the units, an error
capped in length, damped least squares, a cap per unit. Features are steered in shares of their
value in the original motion, so that a small face counts as much as a wide gesture. Defaults are
measured ones: smaller probes than 4° drown in the pixel noise of 128 × 128.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.motion.warping.features import (
    FeatureTarget,
    fine_values_of,
    grain_of,
    pixel_of,
    values_of,
)
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.motion.warping.perceived import SeenBody, perceived_parts
from visavis.stimuli.motion.warping.raster_kernels import Bytes
from visavis.stimuli.motion.warping.units import WarpingUnit, turned_by

MIN_PX: Final = 24
SEARCHED_DAMPING: Final = (0.0625, 0.25, 1.0, 4.0)
"""Factors of the damping that a searched step tries."""
SEARCHED_ERROR: Final = (0.0625, 0.125, 0.25, 0.5, 1.0)
"""Factors of the error cap that a searched step tries."""
_FAR: Final = 1e6


@dataclass(frozen=True)
class ControlSettings:
    """Parameters of the loop.

    `probe_deg` is the step of the differences, `damping` the λ of least squares, `error_cap` the
    most a step asks of the features together, as a share of their original values,
    `step_cap_deg` the most a unit turns in a step.
    `rest_pull` is the share of what the target leaves free that a step takes back. `most_steps` a
    pose, `rate_hz` how often the loop runs, `threads` share the renders without changing them.

    `search` renders twenty steps, of `SEARCHED_DAMPING` times the damping and `SEARCHED_ERROR`
    times the error cap, and takes the best; `wide_probe_deg` adds as many by the differences over
    a second, wider probe (0 for none), which feels what small ones do not: a hand wholly hidden.

    Over time: `smooth_s` is the time constant τ of the filter; a whole clip is then corrected in
    at most `passes` rounds, weighing τ² times the second derivative of the offsets by `smoothness`
    against errors as shares (see `trajectory`).
    """

    probe_deg: float = 4.0
    damping: float = 0.2
    error_cap: float = 0.2
    step_cap_deg: float = 5.0
    most_steps: int = 8
    smooth_s: float = 0.25
    passes: int = 6
    smoothness: float = 0.01
    rest_pull: float = 0.05
    rate_hz: float = 15.0
    threads: int = 1
    search: bool = False
    wide_probe_deg: float = 0.0

    def __post_init__(self) -> None:
        positive = (
            self.probe_deg,
            self.damping,
            self.error_cap,
            self.step_cap_deg,
            self.most_steps,
            self.smooth_s,
            self.passes,
            self.smoothness,
            self.rest_pull,
            self.rate_hz,
            self.threads,
        )
        if not all(np.isfinite(v) and v > 0 for v in positive):
            raise MotionError(f"every parameter of the control loop is above 0; got {self}")
        if not (np.isfinite(self.wide_probe_deg) and self.wide_probe_deg >= 0):
            raise MotionError(f"wide_probe_deg is an angle, or 0 for none; got {self}")
        if self.wide_probe_deg and not self.search:
            raise MotionError("a wide probe serves a searched step only; set search as well")


@dataclass(frozen=True, eq=False)
class Situation:
    """The inputs of the loop for one pose: body, view, targets and warping units.

    `root_m` (3,), `local_wxyz` (55, 4). `earlier_root_m`, `earlier_wxyz` are the same a frame
    earlier, for features of movement; both are warped alike.
    """

    body: SeenBody
    view: Outlook
    targets: tuple[FeatureTarget, ...]
    units: tuple[WarpingUnit, ...]
    root_m: Vector
    local_wxyz: Vector
    earlier_root_m: Vector | None = None
    earlier_wxyz: Vector | None = None


@dataclass(frozen=True, eq=False)
class ControlStep:
    """One step: offsets (w,) before and after, features (f,) seen before it, and the change asked
    for as shares (f,) of the original features.
    """

    omega_rad: Vector
    next_rad: Vector
    features: Vector
    change: Vector


@dataclass(frozen=True, eq=False)
class Outcome:
    """Offsets (w,) for a pose, and features (f,): `original`, `goal` and `final`."""

    omega_rad: Vector
    original: Vector
    goal: Vector
    final: Vector
    steps: int
    is_reached: bool


def warped_turns(
    skeleton: Skeleton, units: tuple[WarpingUnit, ...], local_wxyz: Vector, omega_rad: Vector
) -> Vector:
    """Return turns (n, 55, 4) of a pose for offsets (n, w), held within joint limits."""
    return turned_by(skeleton, units, local_wxyz, omega_rad, is_limited=True)


def see(
    situation: Situation,
    omega_rad: Vector,
    pool: ThreadPoolExecutor | None = None,
    threads: int = 1,
) -> Vector:
    """Return the features (n, f) of the pose warped by offsets (n, w)."""
    return values_of(situation.targets, *_ids(situation, omega_rad, pool, threads))


def _ids(
    situation: Situation, omega_rad: Vector, pool: ThreadPoolExecutor | None, threads: int
) -> tuple[Bytes, Bytes | None]:
    """Return what is perceived of the pose under offsets (n, w), and of that a frame earlier."""

    def ids(root_m: Vector, local_wxyz: Vector) -> Bytes:
        skeleton = situation.body.skeleton
        turns = warped_turns(skeleton, situation.units, local_wxyz, omega_rad)
        roots = np.broadcast_to(root_m, (len(turns), 3))
        return perceived_parts(
            situation.body, situation.view, roots, turns, pool=pool, threads=threads
        )

    before = None
    if situation.earlier_root_m is not None and situation.earlier_wxyz is not None:
        before = ids(situation.earlier_root_m, situation.earlier_wxyz)
    return ids(situation.root_m, situation.local_wxyz), before


def cap_length(error: Vector, cap: float) -> Vector:
    """Shorten a vector to at most `cap`."""
    length = float(np.linalg.norm(error))
    return error if length <= cap else error * (cap / length)


def damped_solution(jacobian: Vector, change: Vector, damping: float) -> Vector:
    """Return Jᵀ (J Jᵀ + λ² I)⁻¹ Δs for a Jacobian (f, w)."""
    square = jacobian @ jacobian.T + damping**2 * np.eye(len(change))
    solution: Vector = jacobian.T @ np.linalg.solve(square, change)
    return solution


def linearise(
    situation: Situation,
    omega_rad: Vector,
    settings: ControlSettings,
    pool: ThreadPoolExecutor | None = None,
) -> tuple[Vector, Vector]:
    """Return features (f,) at offsets (w,) and their derivatives (f, w) per radian.

    2 w + 1 renders: central differences over the units.
    """
    still = np.zeros((1, len(situation.units)))
    probes = np.concatenate([still, probes_of(situation, settings.probe_deg)]) + omega_rad
    ids, before = _ids(situation, probes, pool, settings.threads)
    features = values_of(situation.targets, ids[:1], None if before is None else before[:1])[0]
    fine = fine_values_of(situation.targets, ids[1:], None if before is None else before[1:])
    return features, _slopes(fine, settings.probe_deg)


def _wide_slopes(
    situation: Situation,
    omega_rad: Vector,
    settings: ControlSettings,
    pool: ThreadPoolExecutor | None,
) -> Vector:
    """Return derivatives (f, w) per radian over the wide probe: 2 w renders."""
    probes = probes_of(situation, settings.wide_probe_deg) + omega_rad
    features = fine_values_of(situation.targets, *_ids(situation, probes, pool, settings.threads))
    return _slopes(features, settings.wide_probe_deg)


def probes_of(situation: Situation, probe_deg: float) -> Vector:
    """Return offsets (2 w, w): one unit after the other turned forth, then back."""
    forth = np.radians(probe_deg) * np.eye(len(situation.units))
    return np.concatenate([forth, -forth])


def _slopes(features: Vector, probe_deg: float) -> Vector:
    """Return central differences (f, w) per radian of features (2 w, f) seen at the probes."""
    n = len(features) // 2
    slopes: Vector = ((features[:n] - features[n:]) / (2 * np.radians(probe_deg))).T
    return slopes


def control_step(
    situation: Situation,
    omega_rad: Vector,
    goal: Vector,
    scale: Vector,
    settings: ControlSettings,
    pool: ThreadPoolExecutor | None = None,
    *,
    tolerance: Vector | None = None,
) -> ControlStep:
    """Take one step from offsets (w,) towards wanted features (f,): 2 w + 1 renders.

    `scale` (f,) turns features into what the loop steers, see `scale_of`. A searched step makes
    20 renders more, twice as many and 2 w with a wide probe; it prefers what is within `tolerance`
    (f,) where that is given.
    """
    features, jacobian = linearise(situation, omega_rad, settings, pool)
    error = scale * (goal - features)
    capped_error = cap_length(error, settings.error_cap)
    reach = np.radians([unit.range_deg for unit in situation.units])

    def ahead(shares: Vector, step: Vector, damping: float) -> Vector:
        cap = np.radians(settings.step_cap_deg)
        free = omega_rad - damped_solution(shares, shares @ omega_rad, damping)
        change = damped_solution(shares, step, damping) - settings.rest_pull * free
        turn = np.clip(change, -cap, cap)
        next_rad: Vector = np.clip(omega_rad + turn, -reach, reach)
        return next_rad

    if not settings.search:
        shares = scale[:, None] * jacobian
        return ControlStep(
            omega_rad, ahead(shares, capped_error, settings.damping), features, capped_error
        )
    jacobians = [jacobian]
    if settings.wide_probe_deg:
        jacobians.append(_wide_slopes(situation, omega_rad, settings, pool))
    asks = [cap_length(error, settings.error_cap * share) for share in SEARCHED_ERROR]
    choices = [(j, d, a) for j in jacobians for d in SEARCHED_DAMPING for a in asks]
    candidates = np.array(
        [ahead(scale[:, None] * j, a, settings.damping * damping) for j, damping, a in choices]
    )
    left = goal - see(situation, candidates, pool, settings.threads)
    length = np.linalg.norm(scale * left, axis=1)
    if tolerance is not None:
        length = np.where((np.abs(left) <= tolerance).all(axis=1), length, length + _FAR)
    best = int(np.argmin(length))
    return ControlStep(omega_rad, candidates[best], features, choices[best][2])


def wanted_features(targets: tuple[FeatureTarget, ...], original: Vector) -> Vector:
    """Return the features (f,) to come to, from those of the original motion."""
    return np.clip(original * (1.0 + np.array([t.change for t in targets])), 0.0, 1.0)


def scale_of(situation: Situation, original: Vector) -> Vector:
    """Return factors (f,) that make features shares of their original value, times weights.

    A feature of fewer than `MIN_PX` pixels is a share of so many.
    """
    pixel = np.array([pixel_of(t, situation.view.size_px) for t in situation.targets])
    weight = np.sqrt([t.weight for t in situation.targets])
    factors: Vector = weight / np.maximum(original, MIN_PX * pixel)
    return factors


def is_close(
    targets: tuple[FeatureTarget, ...], view: Outlook, goal: Vector, features: Vector
) -> bool:
    """Return whether every feature is within a pixel of its goal."""
    pixel = np.array([pixel_of(t, view.size_px) for t in targets])
    return bool((np.abs(goal - features) < pixel).all())


def steer(
    situation: Situation,
    settings: ControlSettings,
    *,
    start_rad: Vector | None = None,
    pool: ThreadPoolExecutor | None = None,
) -> Outcome:
    """Run the loop on one pose and return the best offsets met.

    A body of which nothing is perceived is left as it is: there is nothing to steer by.
    """
    zero = np.zeros(len(situation.units))
    original = see(situation, zero[None])[0]
    goal = wanted_features(situation.targets, original)
    if is_close(situation.targets, situation.view, goal, original):
        return Outcome(zero, original, goal, original, 0, True)
    scale = scale_of(situation, original)
    tolerance = tolerance_of(situation, original, goal) if settings.search else None
    omega = zero if start_rad is None else start_rad
    best, best_seen, least = zero, original, _length(scale * (goal - original), False)
    n_steps = 0
    while True:
        # The last look only judges where the last step has led.
        if n_steps == settings.most_steps:
            features, ahead = see(situation, omega[None])[0], omega
        else:
            step = control_step(situation, omega, goal, scale, settings, pool, tolerance=tolerance)
            features, ahead, n_steps = step.features, step.next_rad, n_steps + 1
        left = goal - features
        within = tolerance is not None and bool((np.abs(left) <= tolerance).all())
        error = _length(scale * left, within)
        if error < least:
            best, best_seen, least = omega, features, error
        close = is_close(situation.targets, situation.view, goal, features)
        if close or np.array_equal(ahead, omega):
            break
        omega = ahead
    return Outcome(
        best, original, goal, best_seen, n_steps, is_within(goal, original, best_seen, situation)
    )


def _length(error: Vector, within: bool) -> float:
    """Return how long an error is; one within tolerance counts as shorter than any that is not."""
    return float(np.linalg.norm(error)) - (_FAR if within else 0.0)


def tolerance_of(
    situation: Situation, original: Vector, goal: Vector, share: float = 0.1
) -> Vector:
    """Return the tolerated error (f,): a share of the wanted change, or the buffer's resolution."""
    size = situation.view.size_px
    grain = np.array(
        [grain_of(t, float(w), size) for t, w in zip(situation.targets, goal, strict=True)]
    )
    least: Vector = np.maximum(share * np.abs(goal - original), grain)
    return least


def is_within(
    goal: Vector, original: Vector, features: Vector, situation: Situation, share: float = 0.1
) -> bool:
    """Return whether the error is at most a tenth of the wanted change or one buffer step."""
    tolerance = tolerance_of(situation, original, goal, share)
    return bool((np.abs(goal - features) <= tolerance).all())

"""Warp a whole clip for an observer, and measure the result's features."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.warping.control import (
    ControlSettings,
    Outcome,
    Situation,
    is_within,
    steer,
    wanted_features,
    warped_turns,
)
from visavis.stimuli.motion.warping.features import FeatureTarget, values_of
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.motion.warping.perceived import (
    SeenBody,
    perceived_parts,
    refuse_observer_inside,
)
from visavis.stimuli.motion.warping.trajectory import correct_offsets, interpolate_offsets
from visavis.stimuli.motion.warping.units import WarpingUnit

View = Outlook | Callable[[float], Outlook]
"""A still view, or the view at a time of the clip in seconds (a moving observer or occluder)."""


@dataclass(frozen=True, eq=False)
class WarpedClip:
    """A warped clip with the results of the control loop.

    At the k times `key_s` the loop ran: offsets `omega_rad` (k, w) of the result, `pose_reached`
    (k,) whether the units alone could come to the target, `steps` (k,). At the n frames `frame_s`
    of the result: features `original`, `goal` and `final` (n, f), `is_reached` (n,) within a
    tenth of the wanted change or of what the buffer can tell (`grain_of`).
    """

    clip: Clip
    targets: tuple[FeatureTarget, ...]
    units: tuple[WarpingUnit, ...]
    settings: ControlSettings
    key_s: Vector
    omega_rad: Vector
    pose_reached: npt.NDArray[np.bool_]
    steps: npt.NDArray[np.int64]
    frame_s: Vector
    original: Vector
    goal: Vector
    final: Vector
    is_reached: npt.NDArray[np.bool_]

    @property
    def summary(self) -> str:
        """One line: how much of the change was reached, and whether more was impossible."""
        share = float(self.is_reached.mean())
        parts = ", ".join(
            f"{t.kind} of {'+'.join(t.parts)} {a:.4f} → {r:.4f} (wanted {w:.4f})"
            for t, a, w, r in zip(
                self.targets,
                self.original.mean(axis=0),
                self.goal.mean(axis=0),
                self.final.mean(axis=0),
                strict=True,
            )
        )
        verdict = f"target reached in {share:.0%} of the frames"
        if share < 1:
            verdict += "; elsewhere this is the best these units allow"
            verdict += f" (pose by pose {self.pose_reached.mean():.0%}) in a smooth movement"
        return f"{parts}; {verdict}"


def warp_clip(
    clip: Clip,
    body: SeenBody,
    view: View,
    targets: tuple[FeatureTarget, ...],
    units: tuple[WarpingUnit, ...],
    settings: ControlSettings | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> WarpedClip:
    """Warp a clip so that an observer perceives the wanted features.

    The loop runs `rate_hz` times a second of motion, each time from the offsets found before; a
    filter of `smooth_s` joins them, and all keys are corrected together until they come to the
    target again. Where the target cannot be reached, the nearest result counts.

    Raises:
        MotionError: clip and body have different joints, or the observer is inside the body.
    """
    control = settings or ControlSettings()
    if clip.skeleton.names != body.skeleton.names:
        raise MotionError("clip and body have different joints; retarget the clip first")
    if not targets or not units:
        raise MotionError("a warp needs at least one feature and one warping unit")
    key_s = _key_times(clip, control.rate_hz)
    n, steps = len(key_s), len(key_s) + control.passes + 1
    poses = clip.at(key_s)
    outcomes: list[Outcome] = []
    start = np.zeros(len(units))

    def report(n_done: int) -> None:
        if progress is not None:
            progress(n_done, steps)

    with ThreadPoolExecutor(control.threads) as pool:
        # Each key pose alone, from the offsets of the one before: neighbours need little change.
        situations = _situations(clip, body, view, targets, units, key_s)
        for k, situation in enumerate(situations):
            refuse_observer_inside(
                body,
                situation.view.camera.pose.position_m,
                poses.root_m[k],
                poses.orientation_wxyz[k],
            )
            outcomes.append(steer(situation, control, start_rad=start, pool=pool))
            start = outcomes[-1].omega_rad
            report(k + 1)
        # Smoothing moves the features off their goals, so that all keys are corrected together.
        offsets_rad = np.array([o.omega_rad for o in outcomes])
        omega = smooth_offsets(offsets_rad, key_s, control.smooth_s, is_loop=clip.is_loop)
        if omega.any():
            gap_s = float(key_s[1] - key_s[0]) if n > 1 else 1.0
            omega = correct_offsets(
                situations, outcomes, omega, gap_s, control, is_loop=clip.is_loop, pool=pool
            ).omega_rad
    report(steps)
    at_frames = interpolate_offsets(key_s, omega, clip.frame_times_s, is_loop=clip.is_loop)
    reach = np.radians([unit.range_deg for unit in units])
    warped_clip = _apply(clip, body, units, np.clip(at_frames, -reach, reach))
    # The report measures the result itself, not what the loop expected.
    original, final = _seen_in(clip, warped_clip, body, view, targets)
    goal = np.array([wanted_features(targets, row) for row in original])
    still = _situations(clip, body, view, targets, units, clip.frame_times_s[:1])[0]
    return WarpedClip(
        clip=warped_clip,
        targets=targets,
        units=units,
        settings=control,
        key_s=key_s,
        omega_rad=omega,
        pose_reached=np.array([o.is_reached for o in outcomes], dtype=np.bool_),
        steps=np.array([o.steps for o in outcomes]),
        frame_s=clip.frame_times_s,
        original=original,
        goal=goal,
        final=final,
        is_reached=np.array(
            [is_within(w, o, r, still) for w, o, r in zip(goal, original, final, strict=True)],
            dtype=np.bool_,
        ),
    )


def _key_times(clip: Clip, rate_hz: float) -> Vector:
    """Return when the loop runs: on both ends of an open clip, evenly round a loop."""
    if len(clip.root_m) == 1:
        return np.zeros(1)
    n = max(3, round(clip.duration_s * rate_hz) + (not clip.is_loop))
    return np.linspace(0.0, clip.duration_s, n, endpoint=not clip.is_loop)


def _seen_in(
    clip: Clip, warped_clip: Clip, body: SeenBody, view: View, targets: tuple[FeatureTarget, ...]
) -> tuple[Vector, Vector]:
    """Return the features (n, f) of every frame of a clip, before and after."""
    moving = any(t.kind == "motion_coverage" for t in targets)
    values = np.zeros((2, len(clip.root_m), len(targets)))
    before = None
    for k, t in enumerate(clip.frame_times_s):
        turns = np.stack([clip.orientation_wxyz[k], warped_clip.orientation_wxyz[k]])
        roots = np.stack([clip.root_m[k], warped_clip.root_m[k]])
        ids = perceived_parts(body, view(float(t)) if callable(view) else view, roots, turns)
        values[:, k] = values_of(targets, ids, ids if before is None else before)
        before = ids if moving else None
    return values[0], values[1]


def _situations(
    clip: Clip,
    body: SeenBody,
    view: View,
    targets: tuple[FeatureTarget, ...],
    units: tuple[WarpingUnit, ...],
    key_s: Vector,
) -> list[Situation]:
    poses, earlier = clip.at(key_s), clip.at(key_s - clip.frame_s)
    moving = any(t.kind == "motion_coverage" for t in targets)
    return [
        Situation(
            body,
            view(float(t)) if callable(view) else view,
            targets,
            units,
            poses.root_m[k],
            poses.orientation_wxyz[k],
            earlier.root_m[k] if moving else None,
            earlier.orientation_wxyz[k] if moving else None,
        )
        for k, t in enumerate(key_s)
    ]


def smooth_offsets(omega: Vector, key_s: Vector, time_s: float, *, is_loop: bool = False) -> Vector:
    """Filter offsets (k, w) over time by a critically damped second-order filter, both ways.

    Running it forth and back keeps the offsets in step with the motion; offsets of 0 stay 0.
    """
    if len(omega) < 2:
        return omega
    step = float(key_s[1] - key_s[0])
    tiles = 3 if is_loop else 1
    series = np.concatenate([omega] * tiles)
    for _ in range(2):
        series = _critically_damped(series, step, time_s / 2)[::-1]
    n = len(omega)
    return series[n : 2 * n] if is_loop else series


def _critically_damped(series: Vector, step_s: float, time_s: float) -> Vector:
    """Follow a series from its first value, at rest there."""
    out, x, v = np.empty_like(series), series[0].copy(), np.zeros_like(series[0])
    out[0] = x
    for k in range(1, len(series)):
        x, v = follow(x, v, series[k], step_s, time_s)
        out[k] = x
    return out


def follow(
    value: Vector, speed: Vector, target: Vector, step_s: float, time_s: float
) -> tuple[Vector, Vector]:
    """Return value and speed a moment later by x'' = (target − x) / τ² − 2 x' / τ.

    Exact for a held target, whatever the step.
    """
    decay = float(np.exp(-step_s / time_s))
    gap = value - target
    slope = speed + gap / time_s
    return target + (gap + slope * step_s) * decay, (speed - slope * step_s / time_s) * decay


def _apply(clip: Clip, body: SeenBody, units: tuple[WarpingUnit, ...], omega: Vector) -> Clip:
    """Return the clip with offsets (n, w) on its frames; offsets of 0 change no bit."""
    if not omega.any():
        return clip
    turns = np.empty_like(clip.orientation_wxyz)
    for i, row in enumerate(omega):
        turns[i] = warped_turns(body.skeleton, units, clip.orientation_wxyz[i], row)
    return replace(clip, orientation_wxyz=turns)

"""Warp a whole clip for an observer, and what became of its features."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lab.geometry import Vector
from stimuli.motion.clip import Clip
from stimuli.motion.errors import MotionError
from stimuli.motion.warping.control import (
    ControlSettings,
    Outcome,
    Situation,
    is_within,
    see,
    steer,
    warped_turns,
)
from stimuli.motion.warping.features import FeatureTarget
from stimuli.motion.warping.outlook import Outlook
from stimuli.motion.warping.perceived import SeenBody, perceived, refuse_observer_inside
from stimuli.motion.warping.units import WarpingUnit

View = Outlook | Callable[[float], Outlook]
"""A still view, or the view at a time of the clip in seconds (a moving observer or occluder)."""


@dataclass(frozen=True, eq=False)
class WarpedClip:
    """A warped clip and how it came about.

    At the k times `key_s` the loop ran: offsets `omega_rad` (k, w) before the filter over time,
    features `original`, `wanted` and `reached` (k, f) after it, `is_reached` (k,), `steps` (k,).
    """

    clip: Clip
    targets: tuple[FeatureTarget, ...]
    units: tuple[WarpingUnit, ...]
    settings: ControlSettings
    key_s: Vector
    omega_rad: Vector
    original: Vector
    wanted: Vector
    reached: Vector
    is_reached: npt.NDArray[np.bool_]
    steps: npt.NDArray[np.int64]

    @property
    def summary(self) -> str:
        """One line for whoever asked: how much was reached, and whether more was impossible."""
        share = float(self.is_reached.mean())
        parts = ", ".join(
            f"{t.kind} of {'+'.join(t.parts)} {a:.4f} → {r:.4f} (wanted {w:.4f})"
            for t, a, w, r in zip(
                self.targets,
                self.original.mean(axis=0),
                self.wanted.mean(axis=0),
                self.reached.mean(axis=0),
                strict=True,
            )
        )
        verdict = f"target reached at {share:.0%} of the key times"
        if share < 1:
            verdict += "; elsewhere this is the best these units allow"
        return f"{parts}; {verdict}"


def warp_clip(
    clip: Clip, body: SeenBody, view: View, targets: tuple[FeatureTarget, ...],
    units: tuple[WarpingUnit, ...], settings: ControlSettings | None = None,
    *, progress: Callable[[int, int], None] | None = None,
) -> WarpedClip:  # fmt: skip
    """Warp a clip so that an observer perceives the wanted features.

    The loop runs `rate_hz` times a second of motion, each time from the offsets found before;
    a filter of `smooth_s` joins them, which rests at both ends only when the clip does not loop.

    Raises:
        MotionError: clip and body have different joints, or the observer is inside the body.
    """
    chosen = settings or ControlSettings()
    if clip.skeleton.names != body.skeleton.names:
        raise MotionError("clip and body have different joints; retarget the clip first")
    if not targets or not units:
        raise MotionError("a warp needs at least one feature and one warping unit")
    n = max(2, round(clip.duration_s * chosen.rate_hz) + 1) if len(clip.root_m) > 1 else 1
    key_s = np.linspace(0.0, clip.duration_s, n)
    poses = clip.at(key_s)
    outcomes: list[Outcome] = []
    start = np.zeros(len(units))
    with ThreadPoolExecutor(chosen.threads) as pool:
        situations = _situations(clip, body, view, targets, units, key_s)
        for k, situation in enumerate(situations):
            refuse_observer_inside(
                body, situation.view.camera.pose.position_m, poses.root_m[k],
                poses.orientation_wxyz[k],
            )  # fmt: skip
            outcomes.append(steer(situation, chosen, start_rad=start, pool=pool))
            start = outcomes[-1].omega_rad
            if progress is not None:
                progress(k + 1, n)
    omega = np.array([o.omega_rad for o in outcomes])
    smooth = smoothed(omega, key_s, chosen.smooth_s, looped=clip.looped)
    warped = _apply(clip, body, units, key_s, smooth)
    reached = np.array(
        [see(s, w[None])[0] for s, w in zip(situations, smooth, strict=True)]
    ).reshape(n, len(targets))
    wanted = np.array([o.wanted for o in outcomes])
    original = np.array([o.original for o in outcomes])
    is_reached = [
        is_within(w, o, r, situation)
        for w, o, r, situation in zip(wanted, original, reached, situations, strict=True)
    ]
    return WarpedClip(
        clip=warped,
        targets=targets,
        units=units,
        settings=chosen,
        key_s=key_s,
        omega_rad=omega,
        original=original,
        wanted=wanted,
        reached=reached,
        is_reached=np.array(is_reached, dtype=np.bool_),
        steps=np.array([o.steps for o in outcomes]),
    )


def _situations(
    clip: Clip, body: SeenBody, view: View, targets: tuple[FeatureTarget, ...],
    units: tuple[WarpingUnit, ...], key_s: Vector,
) -> list[Situation]:  # fmt: skip
    poses = clip.at(key_s)
    moving = any(t.kind == "motion_coverage" for t in targets)
    found: list[Situation] = []
    before = None
    for k, t in enumerate(key_s):
        now = view(float(t)) if callable(view) else view
        root, turns = poses.root_m[k], poses.orientation_wxyz[k]
        found.append(Situation(body, now, targets, units, root, turns, before))
        if moving:
            before = perceived(body, now, root[None], turns[None])[0]
    return found


def smoothed(omega: Vector, key_s: Vector, time_s: float, *, looped: bool = False) -> Vector:
    """Filter offsets (k, w) over time by a critically damped second-order filter, both ways.

    Running it forth and back keeps the offsets in step with the motion; offsets of 0 stay 0.
    """
    if len(omega) < 2:
        return omega
    step = float(key_s[1] - key_s[0])
    tiles = 3 if looped else 1
    series = np.concatenate([omega] * tiles)
    for _ in range(2):
        series = _critically_damped(series, step, time_s / 2)[::-1]
    n = len(omega)
    return series[n : 2 * n] if looped else series


def _critically_damped(series: Vector, step_s: float, time_s: float) -> Vector:
    """Follow a series by x'' = (target − x) / τ² − 2 x' / τ, exact for a held target."""
    out, x, v = np.empty_like(series), series[0].copy(), np.zeros_like(series[0])
    decay = np.exp(-step_s / time_s)
    out[0] = x
    for k in range(1, len(series)):
        gap = x - series[k]
        slope = v + gap / time_s
        x = series[k] + (gap + slope * step_s) * decay
        v = (v - slope * step_s / time_s) * decay
        out[k] = x
    return out


def _apply(
    clip: Clip, body: SeenBody, units: tuple[WarpingUnit, ...], key_s: Vector, omega: Vector
) -> Clip:
    """Return the clip with offsets (k, w) at `key_s`, joined by straight lines, on its frames."""
    if not omega.any():
        return clip
    times = clip.frame_times_s
    at_frames = np.stack([np.interp(times, key_s, omega[:, w]) for w in range(omega.shape[1])], 1)
    turns = np.empty_like(clip.orientation_wxyz)
    for i, row in enumerate(at_frames):
        turns[i] = warped_turns(body.skeleton, units, clip.orientation_wxyz[i], row)
    return replace(clip, orientation_wxyz=turns)

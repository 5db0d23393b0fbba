"""Draw an imported recording: gaze and fixations, speed, pupils, what was lost."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from visavis.analysis.gaze.event_kernels import speeds_deg_s
from visavis.analysis.gaze.events import Fixations
from visavis.analysis.gaze.stamps import Times, typical_step_ns
from visavis.lab.geometry import Vector, yaw_pitch_deg_of

_AZIMUTH, _ELEVATION, _LEFT, _RIGHT = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
_HOLE_STEPS = 3


def draw_import(
    path: Path,
    *,
    title: str,
    t_ns: Times,
    direction: Vector,
    frame: str,
    fixations: Fixations,
    detector: str,
    usable: Mapping[str, npt.NDArray[np.bool_]],
    pupil_mm: Mapping[str, npt.NDArray[np.float64]],
    lost_01: float,
    rate_hz: float,
) -> None:
    """Write a PNG with five panels over time; gaps in lines are lost gaze."""
    t_s = (t_ns - t_ns[0]) / 1e9
    figure = Figure(figsize=(11, 8.5), layout="constrained")
    axes: list[Axes] = list(
        figure.subplots(5, 1, sharex=True, height_ratios=(1.7, 1.4, 1.4, 1.2, 0.8)).flat
    )
    share = float(fixations.duration_ns.sum()) / max(1, int(t_ns[-1] - t_ns[0]))
    figure.suptitle(
        f"{title}: {len(t_ns)} samples, {rate_hz:.1f} Hz, {lost_01:.1%} lost, "
        f"{len(fixations)} fixations in {frame} ({detector}), {share:.0%} of the time"
    )
    yaw, pitch = yaw_pitch_deg_of(direction)
    for axis, angle, colour, label in (
        (axes[0], _without_seam_jumps(-yaw), _AZIMUTH, "azimuth"),
        (axes[1], pitch, _ELEVATION, "elevation"),
    ):
        _shade(axis, fixations, t_ns)
        axis.plot(t_s, angle, lw=0.9, color=colour)
        axis.set_ylabel(f"{label} in {frame} (°)")
    axes[0].set_title("right and up are positive; grey: fixation", loc="left", fontsize=9)
    _speed_panel(axes[2], t_s, t_ns, direction)
    colours = {"left": _LEFT, "right": _RIGHT, "combined": "black"}
    for name, pupil in pupil_mm.items():
        if np.isfinite(pupil).any():
            axes[3].plot(t_s, pupil, lw=0.8, color=colours[name], label=name)
    axes[3].set_ylabel("pupil (mm)")
    if axes[3].lines:
        axes[3].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    else:
        axes[3].text(0.5, 0.5, "no pupil data", ha="center", transform=axes[3].transAxes)
    for k, (name, is_usable) in enumerate(usable.items()):
        axes[4].fill_between(
            t_s, k + 0.1, k + 0.9, where=~is_usable, step="post", color=colours[name], lw=0
        )
    axes[4].set_yticks(np.arange(len(usable)) + 0.5, [f"{name} lost" for name in usable])
    axes[4].set_ylim(0, len(usable))
    axes[4].set_xlabel("time (s)")
    axes[4].set_xlim(0, max(float(t_s[-1]), 1e-3))
    figure.savefig(path, dpi=110)


def _shade(axis: Axes, fixations: Fixations, t_ns: Times) -> None:
    for onset, duration in zip(fixations.onset_ns, fixations.duration_ns, strict=True):
        start = (onset - t_ns[0]) / 1e9
        axis.axvspan(start, start + duration / 1e9, color="0.88", lw=0)


def _without_seam_jumps(angle_deg: Vector) -> Vector:
    """Remove jumps of 360° across the seam, passing over NaN; for drawing only."""
    out = angle_deg.copy()
    is_finite = np.isfinite(out)
    if is_finite.any():
        out[is_finite] = np.unwrap(out[is_finite], period=360.0)
        out -= 360.0 * np.round(np.median(out[is_finite]) / 360.0)
    return out


def _speed_panel(axis: Axes, t_s: Vector, t_ns: Times, direction: Vector) -> None:
    is_finite = np.isfinite(direction[:, 0])
    step_ns = typical_step_ns(t_ns)
    breaks = np.concatenate([[False], np.diff(t_ns) > _HOLE_STEPS * step_ns]) | ~is_finite
    stretch = np.where(is_finite, np.cumsum(breaks), -1)
    speed = np.empty(len(t_ns))
    speeds_deg_s(t_ns, np.ascontiguousarray(direction), stretch, 1, speed)
    axis.semilogy(t_s, np.maximum(speed, 0.1), lw=0.6, color="0.3")
    for limit in (30, 100):
        axis.axhline(limit, color="red", lw=0.7, ls="--" if limit == 30 else ":")
    axis.set_ylabel("gaze speed (°/s)\nlines: 30, 100")
    axis.set_ylim(0.5, 2000)

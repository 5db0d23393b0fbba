"""Estimate how many degrees the picture of HMR's uncalibrated eye cameras spans, and describe the
saccades by which `auto` parts fixations that the labels hold together.

    python -m benchmarks.gaze_detectors.hmr_scale FOLDER

A saccade lasts `MS_A_DEGREE` longer for each degree (Carpenter, 1988, Movements of the Eyes), so
the labelled saccades' durations over their amplitudes in widths of the picture tell the degrees of
a width. FOLDER holds the set as `benchmarks.gaze_detectors.sets` reads it.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.gaze_detectors.agreement import runs_of
from benchmarks.gaze_detectors.sets import HMR_DEG, HMR_RATE_HZ, SETS, Recording
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.lab.geometry import angle_deg

MS_A_DEGREE = 2.2
AMPLITUDES = ((0.02, 0.4), (0.03, 0.25), (0.02, 0.2), (0.05, 0.4))
"""Ranges of amplitudes in widths of the picture: smaller ones are noise, larger ones few."""
MAX_SACCADE_MS = 200.0


def saccades_of(recordings: Sequence[Recording]) -> Iterator[tuple[float, float]]:
    """Yield the amplitude in widths of the picture and the duration in ms of each saccade that is
    labelled, without losses.
    """
    for recording in recordings:
        (labelling,) = recording.by.values()
        for first, end in runs_of(labelling.movement == Movement.SACCADE):
            lasts_ms = (end - first) * 1000.0 / HMR_RATE_HZ
            rays = recording.direction[first - 1 : end + 1] if first else np.empty((0, 3))
            if (
                len(rays) == end - first + 2
                and np.isfinite(rays).all()
                and lasts_ms <= MAX_SACCADE_MS
            ):
                yield float(angle_deg(rays[0], rays[-1])) / HMR_DEG, lasts_ms


def degrees_of_width(
    saccades: Sequence[tuple[float, float]], amplitudes: tuple[float, float]
) -> float:
    """Return the degrees of a width, from saccades with amplitudes within these."""
    widths, lasts_ms = np.array(saccades).T
    is_within = (widths > amplitudes[0]) & (widths < amplitudes[1])
    slope = np.polyfit(widths[is_within], lasts_ms[is_within], 1)[0]
    return float(slope) / MS_A_DEGREE


def within_labels(recordings: Sequence[Recording]) -> Iterator[tuple[float, float]]:
    """Yield the amplitude in degrees and the peak speed in °/s of each saccade that `auto` finds
    within one labelled fixation, with fixations on both sides.
    """
    for recording in recordings:
        (labelling,) = recording.by.values()
        movements = detect_movements(recording.t_ns, recording.direction)
        is_saccade = movements.kind == Movement.SACCADE
        for first, end in labelling.fixations:
            is_within = is_saccade & (movements.first_row > first) & (movements.last_row < end - 1)
            yield from zip(
                movements.amplitude_deg[is_within].tolist(),
                movements.peak_deg_s[is_within].tolist(),
                strict=True,
            )


def main(arguments: Sequence[str]) -> int:
    """Print the estimate for each range of amplitudes; return 1 without the set."""
    recordings = list(SETS["hmr"](Path(arguments[0]))) if arguments else []
    if not recordings:
        print("give the folder of the set: data_hmr")
        return 1
    saccades = list(saccades_of(recordings))
    for amplitudes in AMPLITUDES:
        estimate = degrees_of_width(saccades, amplitudes)
        low, high = amplitudes
        print(f"saccades of {low:g} to {high:g} widths: {estimate:.0f}° (taken: {HMR_DEG:g}°)")
    amplitudes_deg, peaks_deg_s = np.array(list(within_labels(recordings))).T
    print(
        f"within one labelled fixation auto finds {len(peaks_deg_s)} saccades, half of them of "
        f"{np.nanmedian(amplitudes_deg):.1f}° and {np.nanmedian(peaks_deg_s):.0f}°/s or more"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Measure the speed of the gaze rules on generated trials, against the limits.

    python -m benchmarks.gaze_speed [--json]

A trial is 16 s at 120 Hz with 11 heads, a study 2160 trials. "Ratio" is limit / value for
times and value / limit for rates: 1 or more is within the limit.
"""

import argparse
import sys
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.table import Row, show
from visavis.analysis.gaze.aoi import aoi_of_samples
from visavis.analysis.gaze.events import detect_idt, detect_ivt
from visavis.analysis.gaze.looks import measure_trial
from visavis.lab.clock import cpu_time_s
from visavis.lab.geometry import direction_from_yaw_pitch_deg

ROWS, HEADS, TRIAL_NS = 1920, 11, 16_000_000_000
STUDY_TRIALS = 2160
IVT_SAMPLES = 4_000_000


def gaze_of(seconds: float, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Return directions that rest 0.1-0.6 s on places up to 20° away, with 0.1° jitter."""
    n = int(seconds * rate_hz)
    yaw, pitch = np.empty(n), np.empty(n)
    row, at = 0, np.zeros(2)
    while row < n:
        rest = int(rng.uniform(0.1, 0.6) * rate_hz)
        to = rng.uniform(-20, 20, 2)
        flight = max(1, int(0.04 * rate_hz))
        path = np.concatenate([np.tile(at, (rest, 1)), np.linspace(at, to, flight)])[: n - row]
        yaw[row : row + len(path)], pitch[row : row + len(path)] = path.T
        row, at = row + len(path), to
    jitter = rng.normal(0, 0.1, (2, n))
    return direction_from_yaw_pitch_deg(yaw + jitter[0], pitch + jitter[1])


def cpu_us(call: Callable[[], object], times: int) -> float:
    """Return CPU microseconds per call, the least of five rounds."""
    call()
    rounds = []
    for _ in range(5):
        began_s = cpu_time_s()
        for _ in range(times):
            call()
        rounds.append((cpu_time_s() - began_s) / times)
    return min(rounds) * 1e6


def measure() -> list[Row]:
    """Return every figure."""
    rng = np.random.default_rng(7)
    t_ns = np.rint(np.arange(ROWS) * 1e9 / 120).astype(np.int64)
    gaze = gaze_of(16, 120, rng)
    heads = direction_from_yaw_pitch_deg(rng.uniform(-20, 20, HEADS), rng.uniform(-10, 10, HEADS))
    angle = np.degrees(np.arccos(np.clip(gaze @ heads.T, -1, 1))).astype(np.float32)
    radius = np.full(angle.shape, 2.5, np.float32)
    limit = np.full(angle.shape, 0.7, np.float32)
    hit = np.where(angle.min(1) <= 2.5, angle.argmin(1), -1).astype(np.int16)
    target = int(hit.max())

    def trial() -> object:
        aoi = aoi_of_samples(angle, radius, limit, hit)
        return measure_trial(t_ns, aoi, target, 0, TRIAL_NS, switch_ns=TRIAL_NS // 2)

    def frame() -> object:
        return aoi_of_samples(angle[:2], radius[:2], limit[:2], hit[:2])

    long_t = np.rint(np.arange(IVT_SAMPLES) * 1e9 / 120).astype(np.int64)
    long_gaze = np.tile(gaze, (IVT_SAMPLES // ROWS + 1, 1))[:IVT_SAMPLES]
    trial_us = cpu_us(trial, 200)
    study_s = trial_us * STUDY_TRIALS / 1e6
    rows = [
        Row("area of interest and looks, trial with a switch", trial_us, "us", 1000),
        Row("area of interest online, 2 samples", cpu_us(frame, 5000), "us", 20),
        Row(f"looks of {STUDY_TRIALS} trials", study_s, "CPU s", 2.16),
    ]
    at_once: tuple[tuple[str, Callable[[], object]], ...] = (
        ("I-VT, 4 M samples at once", lambda: detect_ivt(long_t, long_gaze)),
        ("I-DT, 4 M samples at once", lambda: detect_idt(long_t, long_gaze)),
    )
    for name, call in at_once:
        rate = IVT_SAMPLES / cpu_us(call, 1) * 1e6
        rows.append(Row(name, rate, "samples/CPU s", 1e6, at_least=True))
    ivt_us = cpu_us(lambda: detect_ivt(t_ns, gaze), 200)
    return [*rows, Row("I-VT, one trial", ivt_us, "us", 1920)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    as_json = parser.parse_args(arguments).json
    return show(measure(), as_json=as_json)


if __name__ == "__main__":
    sys.exit(main())

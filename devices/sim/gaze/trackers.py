"""How well known eye trackers measure, as their makers and others say it: for simulated ones.

Accuracy is the mean angle between gaze and target, precision the RMS of angles between successive
samples (RMS-S2S) of both eyes' average; delay is that until a sample can be had. Where a tracker is
not listed, or a figure of it not known, `TrackerErrorModel` keeps its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Final

from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel

USUAL_ACCURACY_DEG: Final = 0.86
"""Mean error of both eyes' average by the usual model, over 15° to all sides."""
SPREAD_OF_NOISE: Final = 0.35
"""SD of the logarithm of people's noise, an assumption: it differs twofold between two of them."""


@dataclass(frozen=True)
class TrackerFigures:
    """What is known of a tracker; None: not known. `sources` says where each figure comes from."""

    name: str
    sources: str
    accuracy_deg: float | None = None
    rms_deg: float | None = None
    delay_ms: float | None = None


TRACKERS: Final[Mapping[str, TrackerFigures]] = {
    "eyelink": TrackerFigures(
        "EyeLink 1000 Plus",
        "maker: 0.25 to 0.5° typical; below 0.01° RMS and below 1.8 ms at 1000 Hz",
        0.375,
        0.01,
        1.8,
    ),
    "gazepoint": TrackerFigures("Gazepoint GP3", "maker: 0.5 to 1°", accuracy_deg=0.75),
    "neon": TrackerFigures("Pupil Labs Neon", "maker: 1.8° without a correction of offsets", 1.8),
    "varjo": TrackerFigures("Varjo (VR-1 to XR-4)", "maker: 1°, 0.2°; 20 to 30 ms", 1.0, 0.2, 25.0),
    "fove": TrackerFigures(
        "FOVE 0", "maker: below 1°; delay 15 ms (Stein et al. 2021)", 1.0, None, 15.0
    ),
    "sranipal": TrackerFigures(
        "HTC Vive Pro Eye",
        "1.08° and 0.08° (Schuetz & Fiehler 2022, precision said to be flattered by repeats); "
        "delay 52 ms (Stein et al. 2021)",
        1.08,
        0.08,
        52.0,
    ),
}
"""By driver."""


def sizes_of_error(driver: str) -> dict[str, float]:
    """Return the fields of a `TrackerErrorModel` that the figures of a driver's tracker set.

    The shares of an error that both eyes have, that each has alone and that grows with
    eccentricity stay those of the usual model, and so do those of fast and slow noise. People
    differ in noise by `SPREAD_OF_NOISE`; a tracker that is not listed has the usual error.
    """
    figures = TRACKERS.get(driver)
    if figures is None:
        return {}
    usual = TrackerErrorModel
    sizes = {"noise_spread": SPREAD_OF_NOISE}
    if figures.accuracy_deg is not None:
        for name in ("offset_deg", "eye_offset_deg", "gain_sd_01"):
            sizes[name] = getattr(usual, name) * figures.accuracy_deg / USUAL_ACCURACY_DEG
    if figures.rms_deg is not None:
        # Successive averages of both eyes differ by white noise in two axes; slow noise hardly.
        for name in ("white_deg", "slow_deg"):
            sizes[name] = getattr(usual, name) * figures.rms_deg / (sqrt(2) * usual.white_deg)
    if figures.delay_ms is not None:
        sizes["latency_ms"] = figures.delay_ms
        sizes["latency_jitter_ms"] = min(usual.latency_jitter_ms, figures.delay_ms / 3)
    return sizes

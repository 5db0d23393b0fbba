"""How old the head of a picture is at its light, and whether the runtime kept the display's pace.

A pose bears the time that it describes. What the runtime's own stamps say of it, together with the
delay of light that a photodiode measured, bounds its age: it is youngest where the runtime foresaw
the head for the light that it promised, and oldest where it handed out a head as it then was.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_MS
from visavis.lab.schema import SampleBatch

HALVED_RUN = 9
"""Frames in a row that must last twice as long as the display's: fewer are dropped frames."""
HALVED_LOW, HALVED_HIGH = 1.7, 2.3
REPROJECTED_FOR = 0b11
"""Flags of OpenVR that say that a frame was reprojected, because of processor or card; its other
flags only say that it could be."""
MAY_PASS_01 = 0.02
"""The share of frames up to which a pace is called kept."""

Int = npt.NDArray[np.int64]


@dataclass(frozen=True)
class PoseAge:
    """The age of a picture's head at its light, in ms; NaN where nothing is known.

    `at_least_ms` takes the runtime at its word that the pose is foreseen, `at_most_ms` takes it as
    the head was when it was handed out; each is the median over frames. `look_ahead_ms` is from
    handing out to the promised light, `picture_delay_ms` from there to the light that a photodiode
    saw (NaN: not measured, and not in the ages).
    """

    frames: int
    at_least_ms: float
    at_most_ms: float
    look_ahead_ms: float
    picture_delay_ms: float


def pose_age(
    described_ns: Int, handed_ns: Int, light_ns: Int, picture_delay_ms: float = float("nan")
) -> PoseAge:
    """Return the age of poses by what they describe, when they came, and their promised light."""
    nan = float("nan")
    if not light_ns.size:
        return PoseAge(0, nan, nan, nan, picture_delay_ms)
    late_ms = 0.0 if np.isnan(picture_delay_ms) else picture_delay_ms
    foreseen_ms = (light_ns - described_ns) / NS_PER_MS
    ahead_ms = (light_ns - handed_ns) / NS_PER_MS
    oldest_ms = np.maximum(foreseen_ms, ahead_ms)
    return PoseAge(
        frames=int(light_ns.size),
        at_least_ms=float(np.median(foreseen_ms)) + late_ms,
        at_most_ms=float(np.median(oldest_ms)) + late_ms,
        look_ahead_ms=float(np.median(ahead_ms)),
        picture_delay_ms=picture_delay_ms,
    )


@dataclass(frozen=True)
class RuntimePace:
    """Whether a runtime showed every frame once: shares of frames, and who says so.

    `halved_01` is the share of frames that lasted twice as long as the display's, many in a row;
    `reprojected_01` that of frames which the runtime says it showed again, turned (NaN where it
    says nothing of it).
    """

    frames: int
    halved_01: float
    reprojected_01: float

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is wrong with the pace, in words; empty where it was kept."""
        wrong = []
        if self.halved_01 > MAY_PASS_01:
            wrong.append(
                f"the runtime halved its rate in {self.halved_01:.0%} of frames: a mark's light "
                "is up to a frame later than promised, and delays measured at another rate do not "
                "hold"
            )
        if self.reprojected_01 > MAY_PASS_01:
            wrong.append(
                f"the runtime showed {self.reprojected_01:.0%} of frames again, turned for the "
                "head: their light is that of an earlier mark"
            )
        return tuple(wrong)


def runtime_pace(
    frame_ns: Int, nominal_ns: int, account: Mapping[str, Any] | None = None
) -> RuntimePace:
    """Return the pace of frames that began at these times, with the runtime's account of them.

    `account` holds the columns of `FRAME_TIMING`.
    """
    nan = float("nan")
    lasted = np.diff(frame_ns) / max(1, nominal_ns)
    is_double = (lasted > HALVED_LOW) & (lasted < HALVED_HIGH)
    halved = 0
    for run in np.split(is_double, np.flatnonzero(np.diff(is_double)) + 1):
        if run.size >= HALVED_RUN and run[0]:
            halved += run.size
    reprojected_01 = nan
    if account is not None and account["timing_known"].any():
        again = (account["reprojection_flags"] & REPROJECTED_FOR).astype(bool)
        again |= account["presents"] > 1
        reprojected_01 = float(again[account["timing_known"]].mean())
    return RuntimePace(
        frames=int(frame_ns.size),
        halved_01=halved / lasted.size if lasted.size else 0.0,
        reprojected_01=reprojected_01,
    )


def account_of(batches: Sequence[SampleBatch]) -> Mapping[str, Any] | None:
    """Return the columns of the runtime's account of frames; None where there is none."""
    rows = [batch.values for batch in batches if batch.schema.name == "frame_timing"]
    if not rows:
        return None
    table = np.concatenate(rows)
    return {name: table[name] for name in table.dtype.names or ()}


def heads_of(batches: Sequence[SampleBatch]) -> tuple[Int, Int]:
    """Return what the head's poses describe, and when they were handed out (ns), in order."""
    heads = [batch for batch in batches if batch.schema.name == "head"]
    if not heads:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    return (
        np.concatenate([batch.t_device_ns for batch in heads]),
        np.concatenate([batch.t_host_ns for batch in heads]),
    )

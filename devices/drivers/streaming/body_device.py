"""The common part of body trackers on a message wire: segments, order of samples, places.

A driver adds a codec: how to connect, how to read a message, how to keep the stream alive. Samples
that arrive after a later one are dropped and counted; a hole in `seq` is a lost sample.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import Fault, body_schema
from visavis.devices.drivers.streaming.stream_device import StreamDevice
from visavis.devices.plausible import are_places
from visavis.devices.segment_watch import SegmentWatch
from visavis.devices.spec import AnySpec
from visavis.devices.transports import MessageTransport
from visavis.lab.clock import Clock
from visavis.lab.config import is_own_role
from visavis.lab.geometry import (
    Vector,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    quat_multiply,
    rotate,
)

Severity = Literal["warning", "blocking"]
Flags = npt.NDArray[np.bool_]

RESTART_AFTER_S = 10.0
"""A counter that steps by more than this time means that the stream was restarted."""


@dataclass(frozen=True, eq=False)
class BodySample:
    """One sample: positions (n, 3), orientations (n, 4) (w, x, y, z), flags (n,), all in world.

    Rows that are not valid are NaN. `counter` is the device's own; None where it has none.
    """

    counter: int | None
    t_device_ns: int
    position_m: Vector
    orientation_wxyz: Vector
    valid: Flags


UPRIGHT = {"+Z": (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0), "+Y": (1.0, 0.0, 0.0, 0.0)}
"""How a tracker's world is turned to y up, by its upward axis."""


def upright(up: str, yaw_deg: float) -> Vector:
    """Return the rotation (w, x, y, z) from a tracker's world to ours, turned about y at last."""
    return quat_multiply(quat_from_yaw_pitch_deg(yaw_deg), np.array(UPRIGHT[up]))


def turn_world(world: Vector, position_m: Vector, orientation_wxyz: Vector, valid: Flags) -> None:
    """Turn valid rows from a tracker's world to ours, in place; bodies' own axes turn with it."""
    turns = quat_multiply(world, orientation_wxyz[valid])
    orientation_wxyz[valid] = quat_multiply(turns, quat_conjugate(world))
    with np.errstate(invalid="ignore", over="ignore"):  # infinite places are refused later
        position_m[valid] = rotate(world, position_m[valid])


class BodyDevice(StreamDevice[BodySample]):
    """Follow the `BodyTracker` contract over a message transport.

    A segment with an impossible place (infinite, or beyond a kilometre) is not valid. The stream of
    a tracker under a role of the lab's own bears the role's name: a suit and props are told apart.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        spec: AnySpec,
        *,
        segments: Sequence[str],
        rate_hz: float,
        lost_after_s: float = 2.0,
    ) -> None:
        self.segments = tuple(segments)
        stream = role if is_own_role(role) else "body"
        schema = body_schema(self.segments, rate_hz, stream)
        super().__init__(role, transport, clock, spec, schema, lost_after_s=lost_after_s)

    def check(self) -> tuple[Fault, ...]:
        """Return the faults of stream, clock and segments since start."""
        role = self.info.role
        faults = list(self._notes.values())
        jumps_ms = self._one_way.jumps_ms
        for count, text, remedy in (
            (self._malformed, "messages could not be read", "keep the .wire log and report it"),
            (
                self._lost_count,
                "samples were lost on the way",
                "use a cable; check network and load",
            ),
            (self._late, "samples came late or twice and were left out", "check the network"),
            (
                self._refused_count,
                "positions that can be none were refused",
                "calibrate the tracker",
            ),
            (self._restarts, "times the stream began anew", "stop other recordings of this body"),
            (len(jumps_ms), "jumps of the tracker's clock", "let nobody set its clock"),
        ):
            if count:
                faults.append(Fault(role, "warning", f"{count} {text}", remedy))
        if self._is_tracked is not None and not self._is_tracked.all():
            lost_segments = [
                s for s, is_seen in zip(self.segments, self._is_tracked, strict=True) if not is_seen
            ]
            text = f"not tracked now: {', '.join(lost_segments)}"
            remedy = "check markers, sensors and line of sight"
            severity: Severity = (
                "blocking" if len(lost_segments) == len(self.segments) else "warning"
            )
            faults.append(Fault(role, severity, text, remedy))
        frozen = self._watch.fault(role)
        if frozen is not None:
            faults.append(frozen)
        return tuple(faults)

    # ---- inside -----------------------------------------------------------------------------

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._far = round(RESTART_AFTER_S * self._schema.nominal_rate_hz)
        self._lost_count = self._late = self._restarts = self._refused_count = 0
        self._seq = -1
        self._counter: int | None = None
        self._is_tracked: Flags | None = None
        self._watch = SegmentWatch(self.segments)
        self._looked_ns: int | None = None

    def _values(self, samples: Sequence[BodySample]) -> npt.NDArray[np.void]:
        values = np.empty(len(samples), self._schema.dtype)
        for i, raw_sample in enumerate(samples):
            sample, row = self._with_places(raw_sample), values[i]
            row["position_m"] = sample.position_m
            row["orientation_wxyz"] = sample.orientation_wxyz
            row["valid"] = sample.valid
            since_ns = 0 if self._looked_ns is None else sample.t_device_ns - self._looked_ns
            self._watch.look(sample.position_m, sample.orientation_wxyz, max(since_ns, 0))
            self._looked_ns = sample.t_device_ns
        self._is_tracked = values["valid"][-1].copy()
        return values

    def _with_places(self, sample: BodySample) -> BodySample:
        """Return the sample without segments in impossible places."""
        position_m, turn = sample.position_m, sample.orientation_wxyz
        bad = sample.valid & ~(are_places(position_m) & np.isfinite(turn).all(axis=-1))
        if not bad.any():
            return sample
        self._refused_count += int((bad & ~np.isnan(position_m).any(axis=-1)).sum())
        return replace(
            sample,
            position_m=np.where(bad[:, None], np.nan, position_m),
            orientation_wxyz=np.where(bad[:, None], np.nan, turn),
            valid=sample.valid & ~bad,
        )

    def _number(self, sample: BodySample) -> int | None:
        """Return the sample's `seq`; None when a later one was delivered already."""
        counter, before = sample.counter, self._counter
        if counter is None:
            self._seq += 1
            return self._seq
        step = 1
        if before is not None:
            ahead = counter - before
            if -self._far < ahead <= 0:
                self._late += 1
                return None
            if 0 < ahead <= self._far:
                step = ahead
                self._lost_count += ahead - 1
            else:
                self._restarts += 1
        self._counter = counter
        self._seq += step
        return self._seq

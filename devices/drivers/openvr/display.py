"""What an OpenVR runtime says of display and frames, and whether base stations stay in place."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np
import numpy.typing as npt

from devices.contracts import FRAME_TIMING
from devices.drivers.openvr import codec
from lab.clock import NS_PER_S
from lab.errors import ProtocolViolation
from lab.frame import EyeView, FrameInfo

MOVED_BASE_STATION_M = 0.005

Array = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class DisplayFacts:
    """The display and its views, left first; `midpoint_m` (3,) is between the eyes."""

    rate_hz: float
    render_size_px: tuple[int, int]
    photons_ns: int
    midpoint_m: Array
    views: tuple[EyeView, EyeView]


def read_display(
    display: bytes, eyes: tuple[bytes, bytes], *, role: str, remedy: str
) -> DisplayFacts:
    """Read the runtime's account of display and eyes; raises ProtocolViolation."""
    try:
        rate_hz, photons_s, width, height = msgpack.unpackb(display)
        told = [msgpack.unpackb(eye) for eye in eyes]
    except (ValueError, TypeError) as cause:
        raise ProtocolViolation(
            "the runtime's account of the display cannot be read", role=role, remedy=remedy
        ) from cause
    if not 1 <= rate_hz <= 1000:
        raise ProtocolViolation(
            f"the runtime says the display runs at {rate_hz} Hz", role=role, remedy=remedy
        )
    placed = [codec.decode_matrix(matrix) for _, matrix in told]
    if placed[0] is None or placed[1] is None:
        raise ProtocolViolation("the runtime gives no places of the eyes", role=role, remedy=remedy)
    midpoint_m = (np.array(placed[0][0]) + np.array(placed[1][0])) / 2
    left, right = (
        _view(tangents, np.array(place[0]) - midpoint_m, place[1])
        for (tangents, _), place in zip(told, (placed[0], placed[1]), strict=True)
    )
    size_px = (int(width), int(height))
    photons_ns = round(photons_s * NS_PER_S)
    return DisplayFacts(float(rate_hz), size_px, photons_ns, midpoint_m, (left, right))


def timing_row(frame: FrameInfo, pose_seq: int, submitted_ns: int, timing_raw: bytes) -> bytes:
    """Return what became of a frame as a row of `FRAME_TIMING`."""
    timing = codec.decode_frame_timing(timing_raw)
    values = np.zeros(1, FRAME_TIMING.dtype)
    row = values[0]
    row["frame"] = frame.index
    row["pose_seq"] = pose_seq
    row["predicted_display_ns"] = frame.predicted_display_ns
    row["t_submitted_ns"] = submitted_ns
    row["skipped"] = frame.dropped
    row["render_gpu_ms"] = math.nan
    if timing is not None:
        row["timing_known"] = True
        row["presents"] = timing.presents
        row["mispresented"] = timing.mispresented
        row["runtime_dropped"] = timing.dropped
        row["reprojection_flags"] = timing.reprojection_flags
        row["render_gpu_ms"] = timing.render_gpu_ms
    return values.tobytes()


@dataclass
class BaseStations:
    """Where base stations stood first, and how far each has moved since; `slots` names them."""

    slots: Mapping[int, str] = field(default_factory=dict)
    moved_m: dict[str, float] = field(default_factory=dict)
    _places: dict[str, Array] = field(default_factory=dict)

    def look(self, poses: Array) -> None:
        """Compare the poses of a frame with the first ones."""
        for slot, serial in self.slots.items():
            pose = codec.decode_pose(poses[slot]) if slot < len(poses) else None
            if pose is None:
                continue
            place = np.array(pose[0])
            moved_m = float(np.linalg.norm(place - self._places.setdefault(serial, place)))
            if moved_m > MOVED_BASE_STATION_M:
                self.moved_m[serial] = max(moved_m, self.moved_m.get(serial, 0.0))


def _view(
    raw: Sequence[float], offset_m: Array, turn: tuple[float, float, float, float]
) -> EyeView:
    """Return the view of getProjectionRaw's left, right, top, bottom.

    In the projection the runtime makes of them its "top" bounds the view below; openvr.h names
    them for an axis that points down.
    """
    left, right, top, bottom = raw
    x, y, z = (float(v) for v in offset_m)
    return EyeView((x, y, z), turn, left, right, min(top, bottom), max(top, bottom))

"""Display and frame timing of an OpenVR runtime, and movements of its base stations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np
import numpy.typing as npt

from visavis.devices.drivers.openvr import codec
from visavis.devices.drivers.streaming.message_device import legible
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import ProtocolViolation
from visavis.lab.frame import EyeView

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
    """Read the runtime's description of display and eyes; raises ProtocolViolation."""
    with legible("the runtime's account of the display", remedy):
        rate_hz, photons_s, width, height = (float(n) for n in msgpack.unpackb(display))
        eye_rows = [msgpack.unpackb(eye) for eye in eyes]
        size_px = (int(width), int(height))
        photons_ns = round(photons_s * NS_PER_S)
        eye_poses = [codec.decode_matrix([float(n) for n in eye[1]]) for eye in eye_rows]
        tangents = [[float(n) for n in eye[0]] for eye in eye_rows]
        # Older captures have no hidden areas, because these were not asked for.
        hidden_corners = [
            [(float(u), float(v)) for u, v in (eye[2] if eye[2:] else [])] for eye in eye_rows
        ]
    if eye_poses[0] is None or eye_poses[1] is None:
        raise ProtocolViolation("the runtime gives no places of the eyes", role=role, remedy=remedy)
    if not all(len(both) % 3 == 0 and np.isfinite(both).all() for both in hidden_corners):
        raise ProtocolViolation(
            "the runtime's account of what the lenses hide is not of triangles",
            role=role,
            remedy=remedy,
        )
    midpoint_m = (np.array(eye_poses[0][0]) + np.array(eye_poses[1][0])) / 2
    left, right = (
        _view(four, np.array(place[0]) - midpoint_m, place[1], corners)
        for four, place, corners in zip(
            tangents, (eye_poses[0], eye_poses[1]), hidden_corners, strict=True
        )
    )
    return DisplayFacts(float(rate_hz), size_px, photons_ns, midpoint_m, (left, right))


def add_timing(row: np.void, timing_raw: bytes) -> None:
    """Write the compositor's report on a frame, if it gave one, into its `FRAME_TIMING` row."""
    timing = codec.decode_frame_timing(timing_raw)
    if timing is not None:
        row["timing_known"] = True
        row["presents"] = timing.presents
        row["mispresented"] = timing.mispresented_count
        row["runtime_dropped"] = timing.dropped_count
        row["reprojection_flags"] = timing.reprojection_flags
        row["render_gpu_ms"] = timing.render_gpu_ms


@dataclass
class BaseStations:
    """First places of base stations, and how far each has moved since; `slots` names them."""

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
    raw: Sequence[float],
    offset_m: Array,
    turn: tuple[float, float, float, float],
    hidden_01: Sequence[tuple[float, float]],
) -> EyeView:
    """Return a view from getProjectionRaw's tangents and getHiddenAreaMesh's corners.

    The tangents are left, right, top, bottom, but the runtime's "top" bounds the view below,
    because openvr.h names them for an axis that points down. Corners are shares of the view's
    width and height, from its left and from below. openvr.h does not say so; Unreal Engine draws
    them this way, the mesh of an Index has its nose there, and OpenComposite and xrizer, which
    replace SteamVR for games, count them so.
    """
    left, right, below, above = (*raw[:2], min(raw[2:]), max(raw[2:]))
    x, y, z = (float(v) for v in offset_m)
    hidden_area = tuple(
        (left + u * (right - left), below + v * (above - below)) for u, v in hidden_01
    )
    return EyeView((x, y, z), turn, left, right, below, above, hidden=hidden_area)

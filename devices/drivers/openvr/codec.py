"""Read the structures an OpenVR runtime fills in; pure, from raw bytes.

Source: openvr.h of ValveSoftware/openvr (BSD-3). Matrices are 3x4, row major, device to world:
metres, right-handed, y up, −z forward, as ours. A pose counts only when its flag is set, its
result is 200 (running) and every number is finite.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

MAX_DEVICES = 64
POSE_DTYPE = np.dtype(
    [
        ("matrix", "<f4", (3, 4)),
        ("velocity_m_s", "<f4", (3,)),
        ("turning_rad_s", "<f4", (3,)),
        ("result", "<i4"),
        ("is_valid", "?"),
        ("is_connected", "?"),
        ("padding", "V2"),
    ]
)
"""`TrackedDevicePose_t`, 80 bytes."""

MAX_AGE_S = 60.0
"""An event with a greater age counts as new."""
RUNNING_OK = 200
HMD, CONTROLLER, TRACKER, BASE_STATION = 1, 2, 3, 4
LEFT_HAND, RIGHT_HAND = 1, 2

EVENTS: Mapping[int, str] = {
    100: "activated",
    101: "deactivated",
    103: "worn",
    104: "taken_off",
    105: "eyes_moved",
    106: "standby",
    107: "awake",
    108: "role_changed",
    200: "press",
    201: "release",
    700: "quit",
    704: "quit",
}
"""`EVREventType` values that a driver acts on."""

BUTTONS: Mapping[int, str] = {
    0: "system",
    1: "menu",
    2: "grip",
    7: "a",
    32: "trackpad",
    33: "trigger",
    31: "worn",
}
"""`EVRButtonId` -> the names controls are configured with."""

VSYNC = struct.Struct("<?fQ")
"""Known, seconds since the last vertical sync, count of vertical syncs."""

_TIMING = struct.Struct("<6I d 16f")
"""The start of `Compositor_FrameTiming`, up to its pose."""

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]


@dataclass(frozen=True)
class VrEvent:
    """One event: `kind` from `EVENTS`, how old it was, and the button if it is about one."""

    kind: str
    slot: int
    age_s: float
    button: str | None


@dataclass(frozen=True)
class FrameTiming:
    """The compositor's report on one of its frames."""

    frame: int
    presents: int
    mispresented_count: int
    dropped_count: int
    reprojection_flags: int
    render_gpu_ms: float


def decode_pose(pose: npt.NDArray[np.void]) -> tuple[Triple, Quadruple] | None:
    """Return position and orientation (w, x, y, z) of one pose; None when it is not valid."""
    if not pose["is_valid"] or not pose["is_connected"] or pose["result"] != RUNNING_OK:
        return None
    return decode_matrix(pose["matrix"].ravel().tolist())


def decode_matrix(m: Sequence[float]) -> tuple[Triple, Quadruple] | None:
    """Return position and orientation of a 3x4 matrix (12 numbers); None if it is no pose."""
    r00, r01, r02, x, r10, r11, r12, y, r20, r21, r22, z = m
    if not math.isfinite(sum(m)):
        return None
    trace = r00 + r11 + r22
    if trace > 0:
        s = 2 * math.sqrt(1 + trace)
        q = (s / 4, (r21 - r12) / s, (r02 - r20) / s, (r10 - r01) / s)
    elif r00 >= r11 and r00 >= r22:
        s = 2 * math.sqrt(max(1e-12, 1 + r00 - r11 - r22))
        q = ((r21 - r12) / s, s / 4, (r01 + r10) / s, (r02 + r20) / s)
    elif r11 >= r22:
        s = 2 * math.sqrt(max(1e-12, 1 + r11 - r00 - r22))
        q = ((r02 - r20) / s, (r01 + r10) / s, s / 4, (r12 + r21) / s)
    else:
        s = 2 * math.sqrt(max(1e-12, 1 + r22 - r00 - r11))
        q = ((r10 - r01) / s, (r02 + r20) / s, (r12 + r21) / s, s / 4)
    w, i, j, k = q
    length = math.sqrt(w * w + i * i + j * j + k * k)
    if not 0.5 < length < 2.0:
        return None
    return (x, y, z), (w / length, i / length, j / length, k / length)


def decode_poses(raw: bytes) -> npt.NDArray[np.void]:
    """Return the 64 slots; a shorter answer holds only its first whole slots."""
    whole = len(raw) - len(raw) % POSE_DTYPE.itemsize
    poses: npt.NDArray[np.void] = np.frombuffer(raw[:whole], POSE_DTYPE)
    return poses


def decode_event(raw: bytes) -> VrEvent | None:
    """Return an event of `VREvent_t`; None when it is cut, or of a kind that is not used."""
    if len(raw) < 12:
        return None
    kind_number, slot, age_s = struct.unpack_from("<IIf", raw)
    kind = EVENTS.get(kind_number)
    if kind is None:
        return None
    button = None
    if kind in ("press", "release"):
        if len(raw) < 20:
            return None
        # VREvent_t is 4-byte packed on Linux, aligned to 8 elsewhere; the library says which.
        at = 12 if len(raw) % 8 == 4 else 16
        button = BUTTONS.get(struct.unpack_from("<I", raw, at)[0])
        if button is None:
            return None
    return VrEvent(kind, slot, age_s if abs(age_s) < MAX_AGE_S else 0.0, button)


def decode_frame_timing(raw: bytes) -> FrameTiming | None:
    """Return the compositor's report on a frame; None when it gave none."""
    if len(raw) < _TIMING.size:
        return None
    numbers = _TIMING.unpack_from(raw)
    return FrameTiming(
        frame=numbers[1],
        presents=numbers[2],
        mispresented_count=numbers[3],
        dropped_count=numbers[4],
        reprojection_flags=numbers[5],
        render_gpu_ms=numbers[9],
    )

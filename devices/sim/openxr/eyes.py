"""Each eye of a simulated OpenXR runtime, through HTC's or Meta's extension.

HTC's answers are written byte by byte, by the places that its plugin's structures give them, not by
the driver's structures. Not modelled: smoothing, eyes that cannot be told apart.
"""

# ruff: noqa: N802 - the functions bear the names of OpenXR

import ctypes
import struct
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from visavis.devices.contracts import Body
from visavis.devices.drivers.openxr.eyes import FB, HTC

SUCCESS, RUNTIME_FAILURE, VALIDATION_FAILURE = 0, -2, -1
EYE_X_M = 0.0315
OPEN_01 = 0.5
FB_CONFIDENCE_01 = 0.875
SUPPORTS_HTC = 1000326005
NUMBERS = {"create": 1000326001, "gaze": (1000326002, 1000326003),
           "pupil": (1000326006, 1000326007), "geometric": (1000326009, 1000326010)}  # fmt: skip
HEAD = struct.Struct("<i4xQ")
"""Type and next of every structure."""
AFTER_HEAD = HEAD.size
_POINTER = ctypes.c_void_p
_THREE = ctypes.CFUNCTYPE(ctypes.c_int32, _POINTER, _POINTER, _POINTER)
_ONE = ctypes.CFUNCTYPE(ctypes.c_int32, _POINTER)
Pose = tuple[list[float], list[float]]


class SimulatedEyes:
    """The functions of a runtime for each eye; none until `tell_by` says whose."""

    prototypes: ClassVar = {
        "xrCreateEyeTrackerHTC": _THREE,
        "xrGetEyeGazeDataHTC": _THREE,
        "xrGetEyePupilDataHTC": _THREE,
        "xrGetEyeGeometricDataHTC": _THREE,
        "xrDestroyEyeTrackerHTC": _ONE,
    }
    """Prototypes of functions that pyopenxr does not know."""

    def __init__(
        self,
        body: Body,
        sampled_ns: Callable[[int], int],
        is_lost: Callable[[], bool],
        epoch_ns: int,
    ) -> None:
        self.tell_by("none")
        self.supported = True
        self.refusals = 0
        self._body = body
        self._sampled_ns = sampled_ns
        self._is_lost = is_lost
        self._epoch_ns = epoch_ns
        self._now_ns = 0
        self._allocate: Callable[[Any], int] = lambda target: 0

    def allocate_with(self, allocate: Callable[[Any], int]) -> None:
        """Take the function that gives handles."""
        self._allocate = allocate

    def tell_by(self, per_eye: str) -> None:
        """Offer the extension of htc, meta or none from the next instance on."""
        self.extension = {"none": "", "htc": HTC, "meta": FB}[per_eye]

    # ---- HTC --------------------------------------------------------------------------------

    def answer_properties(self, address: int) -> None:
        """Write into HTC's structure of the system's properties."""
        ctypes.c_uint32.from_address(address + AFTER_HEAD).value = int(
            self.supported and self.extension == HTC
        )

    def _xr_CreateEyeTrackerHTC(self, session: int, info: int, tracker: int) -> int:
        if self._type(info) != NUMBERS["create"]:
            return VALIDATION_FAILURE
        self._allocate(ctypes.c_void_p(tracker))
        return SUCCESS

    def _xr_DestroyEyeTrackerHTC(self, tracker: int) -> int:
        return SUCCESS

    def _xr_GetEyeGazeDataHTC(self, tracker: int, info: int, data: int) -> int:
        if self.refusals:
            self.refusals -= 1
            return RUNTIME_FAILURE
        if (self._type(info), self._type(data)) != NUMBERS["gaze"]:
            return VALIDATION_FAILURE
        time_ns = ctypes.c_int64.from_address(info + AFTER_HEAD + 8).value
        self._now_ns = time_ns - self._epoch_ns
        payload = b"".join(
            struct.pack("<I7f", pose is not None, *_turn_and_place(pose)) for pose in self._poses()
        )
        self._write(data, payload)
        return SUCCESS

    def _xr_GetEyePupilDataHTC(self, tracker: int, info: int, data: int) -> int:
        if (self._type(info), self._type(data)) != NUMBERS["pupil"]:
            return VALIDATION_FAILURE
        is_seen, eyes = self._sample_eyes()
        self._write(data, 2 * struct.pack("<IIfff", is_seen, is_seen, eyes["pupil_mm"], 0.5, 0.5))
        return SUCCESS

    def _xr_GetEyeGeometricDataHTC(self, tracker: int, info: int, data: int) -> int:
        if (self._type(info), self._type(data)) != NUMBERS["geometric"]:
            return VALIDATION_FAILURE
        _, eyes = self._sample_eyes()
        is_known = not self._is_lost()
        self._write(data, 2 * struct.pack("<Ifff", is_known, eyes["openness_01"], 0.0, 0.0))
        return SUCCESS

    # ---- Meta -------------------------------------------------------------------------------

    def _xr_CreateEyeTrackerFB(self, session: Any, info: Any, tracker: Any) -> int:
        self._allocate(tracker)
        return SUCCESS

    def _xr_DestroyEyeTrackerFB(self, tracker: Any) -> int:
        return SUCCESS

    def _xr_GetEyeGazesFB(self, tracker: Any, info: Any, gazes: Any) -> int:
        at = info.contents.time
        self._now_ns = int(getattr(at, "value", at)) - self._epoch_ns
        eye_gazes = gazes.contents
        for eye, pose in enumerate(self._poses()):
            eye_gaze = eye_gazes.gaze[eye]
            eye_gaze.is_valid = int(pose is not None)
            eye_gaze.gaze_confidence = 0.0 if pose is None else FB_CONFIDENCE_01
            x, y, z, w, *place = _turn_and_place(pose)
            turn = eye_gaze.gaze_pose.orientation
            turn.x, turn.y, turn.z, turn.w = x, y, z, w
            at_m = eye_gaze.gaze_pose.position
            at_m.x, at_m.y, at_m.z = place
        eye_gazes.time = self._epoch_ns + self._sampled_ns(self._now_ns)
        return SUCCESS

    # ---- inside -----------------------------------------------------------------------------

    def _type(self, address: int) -> int:
        return int(ctypes.c_int32.from_address(address).value)

    def _write(self, address: int, content: bytes) -> None:
        stamp = struct.pack("<q", self._epoch_ns + self._sampled_ns(self._now_ns))
        ctypes.memmove(address + AFTER_HEAD, stamp + content, len(stamp) + len(content))

    def _sample_eyes(self) -> tuple[bool, Any]:
        sampled_ns = max(0, self._sampled_ns(self._now_ns))
        eyes = self._body.eyes(np.array((sampled_ns,), np.int64))[0]
        return not self._is_lost() and bool(eyes["openness_01"] >= OPEN_01), eyes

    def _poses(self) -> tuple[Pose | None, Pose | None]:
        is_seen, eyes = self._sample_eyes()
        if not is_seen:
            return None, None
        left, right = (
            ([side * EYE_X_M, 0.0, 0.0], turned_to(eyes[f"{name}_direction_head"]))
            for name, side in (("left", -1), ("right", 1))
        )
        return left, right


def turned_to(ray: Any) -> list[float]:
    """Return the shortest turn (w, x, y, z) from −z to a unit ray."""
    x, y, z = ray
    turn = np.array([1.0 - z, y, -x, 0.0])  # w = 1 + cos, axis = (−z) × ray
    turn_wxyz: list[float] = (turn / np.linalg.norm(turn)).tolist()
    return turn_wxyz


def _turn_and_place(pose: Pose | None) -> tuple[float, ...]:
    place, (w, x, y, z) = pose if pose is not None else ([0.0] * 3, [0.0] * 4)
    return (x, y, z, w, *place)

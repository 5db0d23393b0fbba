"""Hands with fingers of a simulated OpenXR runtime, by XR_EXT_hand_tracking.

A flat hand that moves as one piece, on the body's hands. Like runtimes it leaves the memory of a
hand that is not followed as it was but for its flags, and refuses what the specification calls an
error. Not modelled: fingers that bend, hands made up from controllers, radii by person.
"""

# ruff: noqa: N802 - the functions bear the names of OpenXR

import ctypes
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from visavis.devices.sim.openxr.hands import SimulatedHands
from visavis.lab.geometry import quat_from_yaw_pitch_deg, quat_multiply, rotate

SUCCESS, VALIDATION_FAILURE, HANDLE_INVALID, TIME_INVALID = 0, -1, -12, -30
FUNCTION_UNSUPPORTED, FEATURE_UNSUPPORTED = -7, -8
EXTENSION = "XR_EXT_hand_tracking"
JOINT_COUNT = 26
LOCATION = struct.Struct("<Q8f")
"""Flags, quaternion (x, y, z, w), position, radius: XrHandJointLocationEXT."""
ALL_VALID_AND_TRACKED = 0b1111
FINGERS_M = (
    (-0.022, (0.02, -0.04, -0.08, -0.10, -0.12)),
    (0.0, (0.02, -0.045, -0.09, -0.115, -0.135)),
    (0.018, (0.02, -0.04, -0.08, -0.105, -0.125)),
    (0.036, (0.02, -0.03, -0.06, -0.08, -0.10)),
)
"""Index to little finger of a right hand: how far right of the palm's middle, and its joints' z."""
THUMB_M = ((-0.025, 0.03), (-0.04, 0.0), (-0.05, -0.03), (-0.055, -0.05))
"""The right thumb's joints: x and z."""


def offsets_m(hand: int) -> list[tuple[float, float, float]]:
    """Return where a hand's joints lie in its palm's axes: x right, y off its back, −z ahead."""
    sign = -1 if hand == 0 else 1
    joints = [(0.0, 0.0), (0.0, 0.07), *THUMB_M]
    joints += [(x, z) for x, places in FINGERS_M for z in places]
    return [(sign * x, 0.0, z) for x, z in joints]


class SimulatedJoints:
    """The functions of a runtime that concern hand joints; hands `off` are not followed."""

    def __init__(self, hands: SimulatedHands, is_lost: Callable[[], bool], epoch_ns: int) -> None:
        self.is_supported = True
        self.is_enabled = False
        """Whether the instance was made with the extension."""
        self._hands = hands
        self._is_lost = is_lost
        self._epoch_ns = epoch_ns
        self._hand_of: dict[int, int] = {}
        self._new_handle: Callable[[Any], int] = lambda _: 0

    def allocate_with(self, new_handle: Callable[[Any], int]) -> None:
        """Take handles from the runtime."""
        self._new_handle = new_handle

    def _xr_CreateHandTrackerEXT(self, session: Any, info: Any, tracker: Any) -> int:
        if not self.is_enabled:
            return FUNCTION_UNSUPPORTED
        if not self.is_supported:
            return FEATURE_UNSUPPORTED
        hand = int(getattr(info.contents.hand, "value", info.contents.hand))
        if hand not in (1, 2):
            return VALIDATION_FAILURE
        self._hand_of[self._new_handle(tracker)] = hand - 1
        return SUCCESS

    def _xr_DestroyHandTrackerEXT(self, tracker: Any) -> int:
        return SUCCESS

    def _xr_LocateHandJointsEXT(self, tracker: Any, info: Any, located: Any) -> int:
        hand = self._hand_of.get(int(ctypes.cast(tracker, ctypes.c_void_p).value or 0))
        if hand is None:
            return HANDLE_INVALID
        at = info.contents.time
        at_ns = int(getattr(at, "value", at))
        if at_ns <= 0:
            return TIME_INVALID
        answer = located.contents
        if answer.joint_count != JOINT_COUNT or not answer._joint_locations:  # noqa: SLF001 - the package's field
            return VALIDATION_FAILURE
        pose = None if self._is_lost() else self._hands.pose(hand, max(0, at_ns - self._epoch_ns))
        address = ctypes.cast(answer._joint_locations, ctypes.c_void_p).value or 0  # noqa: SLF001 - as above
        answer.is_active = pose is not None
        if pose is None:
            for joint in range(JOINT_COUNT):
                ctypes.memset(address + joint * LOCATION.size, 0, 8)
            return SUCCESS
        place, turn = np.array(pose[0]), np.array(pose[1])
        turn = quat_multiply(turn, quat_from_yaw_pitch_deg(90.0 if hand == 0 else -90.0))
        w, x, y, z = turn
        data = b"".join(
            LOCATION.pack(
                ALL_VALID_AND_TRACKED, x, y, z, w, *(place + rotate(turn, np.array(offset))), 0.008
            )
            for offset in offsets_m(hand)
        )
        ctypes.memmove(address, data, len(data))
        return SUCCESS

"""Ask an OpenXR runtime for the joints of both hands: XR_EXT_hand_tracking.

pyopenxr has its types; its own function for locating passes no memory for the joints.
"""

import ctypes
from typing import Any

import numpy as np

from visavis.devices.drivers.openxr.eyes import system_properties
from visavis.devices.drivers.openxr.packing import INSTANT

HAND_TRACKING = "XR_EXT_hand_tracking"
SIDES = ("left", "right")
JOINTS = (
    "palm",
    "wrist",
    *(f"thumb_{part}" for part in ("metacarpal", "proximal", "distal", "tip")),
    *(
        f"{finger}_{part}"
        for finger in ("index", "middle", "ring", "little")
        for part in ("metacarpal", "proximal", "intermediate", "distal", "tip")
    ),
)
"""The joints of a hand in the extension's order."""
JOINT = np.dtype(
    [("flags", "<u8"), ("turn_xyzw", "<f4", (4,)), ("place_m", "<f4", (3,)), ("radius_m", "<f4")]
)
"""XrHandJointLocationEXT, as the runtime fills it in and as it goes over the wire."""
ANSWER_BYTES = INSTANT.size + JOINT.itemsize * len(SIDES) * len(JOINTS)
"""An answer: host ns and XrTime of one instant, then the joints of the left and the right hand."""


def supports_hands(xr: Any, instance: Any, system: Any) -> bool:
    """Tell whether the headset of a system tracks hands."""
    properties = xr.SystemHandTrackingPropertiesEXT()
    system_properties(xr, instance, system, properties)
    return bool(properties.supports_hand_tracking)


class HandJoints:
    """The trackers of both hands in a running session."""

    def __init__(self, xr: Any, instance: Any, session: Any) -> None:
        self._xr = xr
        address = xr.get_instance_proc_addr(instance, "xrLocateHandJointsEXT")
        self._locate = ctypes.cast(address, xr.PFN_xrLocateHandJointsEXT)
        self._trackers = [
            xr.create_hand_tracker_ext(session, xr.HandTrackerCreateInfoEXT(hand=hand))
            for hand in (xr.HandEXT.LEFT, xr.HandEXT.RIGHT)
        ]

    def read(self, space: Any, host_ns: int, now: int) -> bytes:
        """Return the joints at an instant, relative to a space, for the wire.

        The joints of a hand that the runtime does not follow have no flags.

        Raises:
            XrException: the runtime refused.
        """
        xr = self._xr
        rows = np.zeros((len(SIDES), len(JOINTS)), JOINT)
        for hand, tracker in zip(rows, self._trackers, strict=True):
            locations = xr.HandJointLocationsEXT()
            locations.joint_count = len(JOINTS)
            pointer = ctypes.POINTER(xr.HandJointLocationEXT)
            locations._joint_locations = ctypes.cast(hand.ctypes.data, pointer)  # noqa: SLF001 - the package's field
            info = xr.HandJointsLocateInfoEXT(base_space=space, time=now)
            result = self._locate(tracker, ctypes.byref(info), ctypes.byref(locations))
            problem = xr.check_result(xr.Result(result))
            if problem.is_exception():
                raise problem
            if not locations.is_active:
                hand["flags"] = 0
        return INSTANT.pack(host_ns, now) + rows.tobytes()

"""Events and buttons of a simulated OpenVR runtime."""

import struct

BUTTON_NUMBERS = {
    "system": 0,
    "menu": 1,
    "grip": 2,
    "a": 7,
    "worn": 31,
    "trackpad": 32,
    "trigger": 33,
}
EVENT_NUMBERS = {
    "activated": 100,
    "deactivated": 101,
    "standby": 106,
    "awake": 107,
    "press": 200,
    "release": 201,
    "quit": 700,
}
RIGHT_CONTROLLER_SLOT = 2


def packed_event(size: int, kind: str, slot: int, age_s: float, button: str) -> bytes:
    """Return an event as the runtime's own structure of `size` bytes holds it."""
    raw = bytearray(size)
    struct.pack_into("<IIf", raw, 0, EVENT_NUMBERS[kind], slot, age_s)
    if button:
        at = 12 if size % 8 == 4 else 16
        struct.pack_into("<I", raw, at, BUTTON_NUMBERS[button])
    return bytes(raw)


def button_of(control: str) -> tuple[int, str]:
    """Return slot and button of a body's control: "trigger", "left_grip"."""
    side, _, button = control.rpartition("_")
    slot = RIGHT_CONTROLLER_SLOT - 1 if side == "left" else RIGHT_CONTROLLER_SLOT
    return slot, button

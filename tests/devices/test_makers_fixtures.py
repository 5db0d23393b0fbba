"""Per driver: the test that pins the maker's own bytes, numbers or replies, and where they stand.

A maker's document, header, client or recording is meant, never our simulator. Drivers of protocols
without a maker (our own band, a laboratory's own firmware) are listed with the reason. The fixtures
of two standards, which several makers share, stand here.
"""

import csv
import re
from pathlib import Path

import pytest

from visavis.devices.drivers.buttons.hid_reports import ReportReader, layout_of
from visavis.devices.drivers.openvr import codec as openvr_codec
from visavis.devices.registry import built_in, driver_wiring

FOLDER = Path(__file__).parent

with (FOLDER / "makers_fixtures.csv").open(encoding="utf-8", newline="") as table:
    FIXTURES = {row["driver"]: row for row in csv.DictReader(table)}
WITHOUT_A_MAKER = {
    "ascii_armband": "a laboratory's own firmware",
    "ble_armband": "our own protocol, pinned in test_armband_codec",
    "byte_buttons": "boxes of many makers send one character a press",
    "hid_armband": "a laboratory's own firmware",
    "keyboard": "key numbers are GLFW's, met as the genuine library",
    "serial_armband": "our own protocol, pinned in test_armband_codec",
    "serial_triggers": "boxes of many makers take one byte",
    "sound_card": "PortAudio, met as the genuine library",
    "spp_armband": "our own protocol, pinned in test_armband_codec",
    "usb_armband": "a laboratory's own firmware",
    "voice_and_keyboard": "PortAudio and GLFW, met as the genuine libraries",
    "voice_key": "PortAudio, met as the genuine library",
}


def test_every_driver_has_its_makers_bytes_or_no_maker():
    real = {name for name in built_in() if driver_wiring(name).real is not None}
    assert real == {*FIXTURES, *WITHOUT_A_MAKER}
    assert not {*FIXTURES} & {*WITHOUT_A_MAKER}


@pytest.mark.parametrize("driver", sorted(FIXTURES))
def test_the_test_that_pins_them_is_there(driver):
    row = FIXTURES[driver]
    text = (FOLDER / f"test_{row['file']}.py").read_text("utf-8")
    assert re.search(rf"^def {row['test']}\(", text, re.M)
    assert row["source"]


# ---- Valve: the package made from openvr.h -------------------------------------------------


def test_structures_and_numbers_are_those_of_valves_package():
    openvr = pytest.importorskip("openvr", reason="openvr is not installed: pip install openvr")
    import ctypes

    pose = openvr.TrackedDevicePose_t
    ours = {name: offset for name, (_, offset, *_) in openvr_codec.POSE_DTYPE.fields.items()}
    assert ctypes.sizeof(pose) == openvr_codec.POSE_DTYPE.itemsize
    assert (ours["matrix"], ours["velocity_m_s"], ours["turning_rad_s"], ours["result"]) == (
        pose.mDeviceToAbsoluteTracking.offset,
        pose.vVelocity.offset,
        pose.vAngularVelocity.offset,
        pose.eTrackingResult.offset,
    )
    assert (ours["is_valid"], ours["is_connected"]) == (
        pose.bPoseIsValid.offset,
        pose.bDeviceIsConnected.offset,
    )
    timing = openvr.Compositor_FrameTiming
    assert openvr_codec._TIMING.size == timing.m_HmdPose.offset
    assert (timing.m_nNumFramePresents.offset, timing.m_nReprojectionFlags.offset) == (8, 20)
    events = {
        "TrackedDeviceActivated": "activated",
        "TrackedDeviceDeactivated": "deactivated",
        "TrackedDeviceUserInteractionStarted": "worn",
        "TrackedDeviceUserInteractionEnded": "taken_off",
        "IpdChanged": "eyes_moved",
        "EnterStandbyMode": "standby",
        "LeaveStandbyMode": "awake",
        "TrackedDeviceRoleChanged": "role_changed",
        "ButtonPress": "press",
        "ButtonUnpress": "release",
        "Quit": "quit",
        "RestartRequested": "quit",
    }
    theirs = {getattr(openvr, f"VREvent_{name}", None): kind for name, kind in events.items()}
    missing = {number for number in openvr_codec.EVENTS if number not in theirs}
    assert missing <= {704}, "704 is DriverRequestedQuit"
    assert all(theirs[n] == openvr_codec.EVENTS[n] for n in openvr_codec.EVENTS if n in theirs)
    assert openvr.TrackingResult_Running_OK == openvr_codec.RUNNING_OK
    assert openvr.k_unMaxTrackedDeviceCount == openvr_codec.MAX_DEVICES


# ---- USB-IF: the example of a joystick -----------------------------------------------------

JOYSTICK = bytes.fromhex(
    "0501 1500 0904 a101 8501 0502 09bb 1581 257f 7508 9501 8102 0501 0901 a100 0930 0931 9502"
    "8102 c0 0939 1500 2503 3500 460e01 661400 7504 9501 8102 4500 660000 0509 1901 2904 2501"
    "9504 7501 3500 8102 c0"
)
"""The joystick with which "Device Class Definition for Physical Interface Devices" 1.0 begins its
example (that of HID 1.11, appendix D, with a report's number): throttle, x, y, a hat of four
sides, four buttons."""


def test_joystick_of_the_usb_forums_own_example():
    layout = layout_of(JOYSTICK)
    assert layout.is_numbered
    assert layout.buttons() == (
        "x-",
        "x+",
        "y-",
        "y+",
        "up",
        "right",
        "down",
        "left",
        "button_1",
        "button_2",
        "button_3",
        "button_4",
    )
    reader = ReportReader(layout)
    pressed = reader.feed(bytes((1, 0, 127, 0x81, 0x21)))  # hat 1: a quarter turn; second button
    down = {press.button: press.value_01 for press in pressed if press.value_01 > 0}
    assert down == {"x+": 1.0, "y-": 1.0, "right": 1.0, "button_2": 1.0}

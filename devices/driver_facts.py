"""What each driver is for, what it speaks over, and which libraries and ports it needs.

Plain facts for `visavis doctor` and `visavis devices`; nothing here imports a driver.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Kind = Literal["eye tracker", "headset", "responses", "body tracker", "armband", "other"]


@dataclass(frozen=True)
class Library:
    """A library by its import name, its name in package lists, and the line that installs it."""

    module: str
    distribution: str
    install: str


@dataclass(frozen=True)
class DriverFacts:
    """`tcp` says that `address` and `port` of the options are dialled; `udp_in` lists what the
    firewall must let in; `runtime` is a program or vendor library beside ours.
    """

    kind: Kind
    wire: str
    library: Library | None = None
    tcp: bool = False
    udp_in: tuple[str, ...] = ()
    runtime: Literal["", "openvr", "openxr", "fove"] = ""


SERIAL = Library("serial", "pyserial", "pip install 'visavis[serial]'")
BLE = Library("bleak", "bleak", "pip install 'visavis[ble]'")
HID = Library("hid", "hidapi", "pip install 'visavis[usb]'")
USB = Library("usb", "pyusb", "pip install 'visavis[usb]'")
LSL = Library("pylsl", "pylsl", "pip install 'visavis[lsl]'")
OPENVR = Library("openvr", "openvr", "pip install 'visavis[openvr]'")
OPENXR = Library("xr", "pyopenxr", "pip install 'visavis[openxr]'")
NEON = Library("pupil_labs.realtime_api", "pupil-labs-realtime-api", "pip install 'visavis[neon]'")
PYLINK = Library("pylink", "sr-research-pylink", "pip install 'visavis[eyelink]'")
WEBSOCKETS = Library("websockets", "websockets", "pip install 'visavis[bhaptics]'")
ZMQ = Library("zmq", "pyzmq", "pip install pyzmq")

_LSL_IN = ("UDP 16571-16604", "TCP 16572-16604")

FACTS: Mapping[str, DriverFacts] = {
    "eyelink": DriverFacts("eye tracker", "vendor library", PYLINK),
    "fove": DriverFacts("eye tracker", "vendor library", runtime="fove"),
    "gazepoint": DriverFacts("eye tracker", "TCP", tcp=True),
    "hid_gaze": DriverFacts("eye tracker", "USB HID", HID),
    "lsl_gaze": DriverFacts("eye tracker", "LSL", LSL, udp_in=_LSL_IN),
    "tobii_lsl": DriverFacts("eye tracker", "LSL", LSL, udp_in=_LSL_IN),
    "neon": DriverFacts("eye tracker", "HTTP, RTSP", NEON, tcp=True, udp_in=("UDP 49152-65535",)),
    "pupil_core": DriverFacts("eye tracker", "ZeroMQ", ZMQ, tcp=True),
    "openxr_gaze": DriverFacts("eye tracker", "OpenXR", OPENXR, runtime="openxr"),
    "openxr_headset": DriverFacts("headset", "OpenXR", OPENXR, runtime="openxr"),
    "openvr_headset": DriverFacts("headset", "OpenVR", OPENVR, runtime="openvr"),
    "openvr_controllers": DriverFacts("responses", "OpenVR", OPENVR, runtime="openvr"),
    "openxr_controllers": DriverFacts("responses", "OpenXR", OPENXR, runtime="openxr"),
    "openvr_trackers": DriverFacts("body tracker", "OpenVR", OPENVR, runtime="openvr"),
    "xsens": DriverFacts("body tracker", "UDP", udp_in=("UDP {port}",)),
    "natnet": DriverFacts("body tracker", "UDP", udp_in=("UDP {data_port}",)),
    "lsl_body": DriverFacts("body tracker", "LSL", LSL, udp_in=_LSL_IN),
    "serial_armband": DriverFacts("armband", "serial port", SERIAL),
    "spp_armband": DriverFacts("armband", "Bluetooth serial", SERIAL),
    "ble_armband": DriverFacts("armband", "Bluetooth LE", BLE),
    "neosensory_buzz": DriverFacts("armband", "Bluetooth LE", BLE),
    "vhp_slim": DriverFacts("armband", "Bluetooth LE", BLE),
    "vhp_sleeve": DriverFacts("armband", "serial port", SERIAL),
    "ascii_armband": DriverFacts("armband", "serial port", SERIAL),
    "bhaptics": DriverFacts("armband", "WebSocket", WEBSOCKETS, tcp=True),
    "hid_armband": DriverFacts("armband", "USB HID", HID),
    "usb_armband": DriverFacts("armband", "USB", USB),
    "simulated_armband": DriverFacts("armband", "none"),
    "simulated_body": DriverFacts("body tracker", "none"),
    "simulated_headset": DriverFacts("headset", "none"),
    "simulated_responses": DriverFacts("responses", "none"),
}
"""Facts by driver name."""

UNKNOWN = DriverFacts("other", "see its package")
"""What is known of a driver that another package brings."""


def facts_of(driver: str) -> DriverFacts:
    """Return what is known of a driver."""
    return FACTS.get(driver, UNKNOWN)

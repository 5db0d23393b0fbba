"""The libraries that drivers of Visavis need, by the line that installs each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Library:
    """A library by its import name, its name in package lists, and the line that installs it."""

    module: str
    distribution: str
    install: str


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
SOUNDDEVICE = Library("sounddevice", "sounddevice", "pip install 'visavis[sound]'")
ZMQ = Library("zmq", "pyzmq", "pip install pyzmq")

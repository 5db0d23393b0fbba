"""The libraries that drivers of Visavis need, by the line that installs each."""

import importlib
from dataclasses import dataclass
from typing import Any

from visavis.lab.errors import DeviceNotFound


@dataclass(frozen=True)
class Library:
    """A library by its import name, its name in package lists, and the line that installs it."""

    module: str
    distribution: str
    install: str

    def imported(self, *submodules: str) -> Any:
        """Return the library, imported with these of its modules; raises DeviceNotFound."""
        try:
            for name in submodules:
                importlib.import_module(f"{self.module}.{name}")
            return importlib.import_module(self.module)
        except ImportError as cause:
            raise DeviceNotFound(
                f"the library {self.distribution} is not installed", remedy=f"run: {self.install}"
            ) from cause


SERIAL = Library("serial", "pyserial", "pip install 'visavis[serial]'")
BLE = Library("bleak", "bleak", "pip install 'visavis[ble]'")
HID = Library("hid", "hidapi", "pip install 'visavis[usb]'")
USB = Library("usb", "pyusb", "pip install 'visavis[usb]'")
LSL = Library("pylsl", "pylsl", "pip install 'visavis[lsl]'")
OPENVR = Library("openvr", "openvr", "pip install 'visavis[openvr]'")
OPENXR = Library("xr", "pyopenxr", "pip install 'visavis[openxr]'")
NEON = Library("pupil_labs.realtime_api", "pupil-labs-realtime-api", "pip install 'visavis[neon]'")
PYLINK = Library("pylink", "sr-research-pylink", "pip install 'visavis[eyelink]'")
TITTA = Library("TittaPy_v2", "TittaPy", "pip install 'visavis[tobii]'")
WEBSOCKETS = Library("websockets", "websockets", "pip install 'visavis[bhaptics]'")
BHAPTICS_SDK = Library("bhaptics_python", "bhaptics-python", "pip install 'visavis[bhaptics-sdk]'")
SOUNDDEVICE = Library("sounddevice", "sounddevice", "pip install 'visavis[sound]'")
ZMQ = Library("zmq", "pyzmq", "pip install pyzmq")

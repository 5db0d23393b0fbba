"""Carry reports to a USB band: HID through hidapi, vendor-class endpoints through pyusb.

One `write` is one report; one chunk is one input report. Bands are found by vendor, product and
serial number.
"""

import contextlib
import threading
from collections.abc import Sequence
from typing import Any

from visavis.devices.byte_links import Chunk
from visavis.devices.libraries import HID, USB
from visavis.devices.one_of_a_kind import the_only, the_only_hid
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

REMEDY = "plug it in, then look at `visavis devices list`"
LINUX_REMEDY = f"{REMEDY}; on Linux a udev rule must let you use it (visavis devices rules)"
WRITE_TIMEOUT_MS = 200
MAX_INPUT_BYTES = 64
MAX_AT_ONCE = 64


class HidLink:
    """A `ByteLink` of reports over hidapi; `library` takes the place of its module in tests."""

    def __init__(
        self,
        clock: Clock,
        *,
        vid: int,
        pid: int,
        serial_number: str = "",
        library: Any = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._clock = clock
        self._criteria = (vid, pid, serial_number)
        self._library = library
        self._device: Any = None
        self._writing = threading.RLock()

    @property
    def kind(self) -> str:
        """Name vendor and product."""
        return f"hid {self._criteria[0]:04x}:{self._criteria[1]:04x}"

    def open(self, deadline_s: float) -> None:
        """Open the only band that fits."""
        self.close()
        library = self._library if self._library is not None else _hidapi()
        vid, pid, serial_number = self._criteria
        entries = [
            entry
            for entry in library.enumerate(vid, pid)
            if not serial_number or entry.get("serial_number") == serial_number
        ]
        if not entries:
            raise DeviceNotFound(f"no HID {vid:04x}:{pid:04x} {serial_number}", remedy=REMEDY)
        entry = the_only_hid(entries, "HID bands")
        device = library.device()
        try:
            device.open_path(entry["path"])
        except OSError as cause:
            text = f"cannot open HID {vid:04x}:{pid:04x}: {cause}"
            raise DeviceNotFound(text, remedy=LINUX_REMEDY) from cause
        device.set_nonblocking(0)
        self._device = device

    def write(self, data: bytes) -> int:
        """Hand over one report with its number first; see `ByteLink`."""
        device = self._device
        if device is None:
            raise DeviceDisconnected("the HID is closed", remedy=REMEDY)
        try:
            with self._writing:
                byte_count = device.write(data)
        except (OSError, ValueError) as cause:
            raise DeviceDisconnected(f"{self.kind} is gone: {cause}", remedy=REMEDY) from cause
        if byte_count < 0:
            raise DeviceDisconnected(f"{self.kind} takes no report", remedy=REMEDY)
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return the input reports that came; see `ByteLink`."""
        device = self._device
        if device is None:
            raise DeviceDisconnected("the HID is closed", remedy=REMEDY)
        chunks: list[Chunk] = []
        wait_ms = round(timeout_s * 1000)
        try:
            # timeout 0 blocks in some versions of hidapi, so 1 ms is the least
            while len(chunks) < MAX_AT_ONCE:
                report = device.read(MAX_INPUT_BYTES, max(1, wait_ms))
                if not report:
                    break
                chunks.append(Chunk(self._clock.now_ns(), bytes(report)))
                wait_ms = 1
        except (OSError, ValueError) as cause:
            raise DeviceDisconnected(f"{self.kind} is gone: {cause}", remedy=REMEDY) from cause
        return chunks

    def close(self) -> None:
        """Close the band; idempotent."""
        device, self._device = self._device, None
        if device is not None:
            with contextlib.suppress(OSError, ValueError):
                device.close()


class UsbLink:
    """A `ByteLink` over two endpoints of a vendor-class interface, through pyusb.

    The first interface with an endpoint out is used, and its endpoint in when it has one.
    `backend` takes the place of libusb in tests.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        vid: int,
        pid: int,
        serial_number: str = "",
        backend: Any = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._clock = clock
        self._criteria = (vid, pid, serial_number)
        self._backend = backend
        self._device: Any = None
        self._out: Any = None
        self._in: Any = None
        self._usb: Any = None
        self._writing = threading.RLock()

    @property
    def kind(self) -> str:
        """Name vendor and product."""
        return f"usb {self._criteria[0]:04x}:{self._criteria[1]:04x}"

    def open(self, deadline_s: float) -> None:
        """Find the band, take its configuration and endpoints."""
        self.close()
        usb = self._usb = USB.imported("core", "util")
        vid, pid, serial_number = self._criteria
        try:
            candidates = usb.core.find(
                find_all=True,
                idVendor=vid,
                idProduct=pid,
                backend=self._backend if self._backend is not None else _libusb(),
            )
            devices = [
                device
                for device in candidates
                if not serial_number or device.serial_number == serial_number
            ]
        except usb.core.NoBackendError as cause:
            raise DeviceNotFound(
                "libusb is not there", remedy="run: pip install libusb-package"
            ) from cause
        except (usb.core.USBError, ValueError) as cause:  # the serial number cannot be read
            text = f"cannot use USB device {vid:04x}:{pid:04x}: {cause}"
            raise DeviceNotFound(text, remedy=LINUX_REMEDY) from cause
        if not devices:
            raise DeviceNotFound(
                f"no USB device {vid:04x}:{pid:04x} {serial_number}", remedy=REMEDY
            )
        device = the_only(
            devices,
            lambda found: f"{self.kind} on bus {found.bus} address {found.address}",
            "USB devices",
            "give serial_number in lab_config.yaml, or unplug one",
        )
        try:
            device.set_configuration()
            configuration = device.get_active_configuration()
            ends = [end for interface in configuration for end in interface]
        except usb.core.USBError as cause:
            text = f"cannot use USB device {vid:04x}:{pid:04x}: {cause}"
            raise DeviceNotFound(text, remedy=LINUX_REMEDY) from cause
        inward = usb.util.ENDPOINT_IN
        out = [e for e in ends if usb.util.endpoint_direction(e.bEndpointAddress) != inward]
        back = [e for e in ends if usb.util.endpoint_direction(e.bEndpointAddress) == inward]
        if not out:
            raise DeviceNotFound(f"{self.kind} has no endpoint out", remedy="check vid and pid")
        self._device, self._out, self._in = device, out[0], back[0] if back else None

    def write(self, data: bytes) -> int:
        """Hand over one report; see `ByteLink`."""
        out = self._out
        if out is None:
            raise DeviceDisconnected("the USB device is closed", remedy=REMEDY)
        try:
            with self._writing:
                out.write(data, WRITE_TIMEOUT_MS)
        except self._usb.core.USBTimeoutError as cause:
            raise DeviceTimeout(f"{self.kind} takes nothing", remedy=REMEDY) from cause
        except self._usb.core.USBError as cause:
            raise DeviceDisconnected(f"{self.kind} is gone: {cause}", remedy=REMEDY) from cause
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return what came; see `ByteLink`. Without an endpoint in, only wait."""
        if self._out is None:
            raise DeviceDisconnected("the USB device is closed", remedy=REMEDY)
        if self._in is None:
            if timeout_s > 0:
                self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))
            return ()
        wait_ms = max(1, round(timeout_s * NS_PER_S) // NS_PER_MS)
        chunks: list[Chunk] = []
        try:
            while len(chunks) < MAX_AT_ONCE:
                data = self._in.read(self._in.wMaxPacketSize, wait_ms)
                chunks.append(Chunk(self._clock.now_ns(), bytes(data)))
                wait_ms = 1
        except self._usb.core.USBTimeoutError:
            return chunks
        except self._usb.core.USBError as cause:
            raise DeviceDisconnected(f"{self.kind} is gone: {cause}", remedy=REMEDY) from cause
        return chunks

    def close(self) -> None:
        """Give the band back; idempotent."""
        device, self._device = self._device, None
        self._out = self._in = None
        if device is not None:
            with contextlib.suppress(self._usb.core.USBError):
                self._usb.util.dispose_resources(device)


def _hidapi() -> Any:
    hid = HID.imported()
    if not hasattr(hid, "device"):
        raise DeviceNotFound(
            "the installed library `hid` is not hidapi",
            remedy="run: pip uninstall hid, then pip install --force-reinstall hidapi",
        )
    return hid


def _libusb() -> Any:
    """Return libusb as pip brings it; None lets pyusb look for the system's."""
    try:
        import libusb_package
    except ImportError:
        return None
    return libusb_package.get_libusb1_backend()

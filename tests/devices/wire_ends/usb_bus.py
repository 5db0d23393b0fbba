"""A USB bus with one report band: a libusb for the real pyusb, and hidapi's calls.

The backend follows pyusb's `usb.backend.IBackend` (one configuration, one vendor-class interface,
interrupt endpoints 0x01 and 0x81); the HID side follows cython-hidapi's `enumerate` and `device`.
Not modelled: descriptors of reports, transfers in pieces, stalls, other devices, kernel drivers.
"""

import array
from types import SimpleNamespace
from typing import Any

from visavis.devices.sim.bands.plain import ReportBandSimulator
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.errors import DeviceError

PACKET_BYTES = 64
NO_ACCESS, NO_DEVICE, TIMED_OUT = 13, 19, 110
LOOK_NS = NS_PER_MS


class FakeUsbBus:
    """One vendor-class band; `is_plugged`, `is_allowed`, `takes` (bytes out) may be changed."""

    def __init__(
        self,
        peer: ReportBandSimulator,
        clock: Clock,
        *,
        vid: int,
        pid: int,
        serial_number: str = "",
    ) -> None:
        self.peer, self.clock = peer, clock
        self.vid, self.pid, self.serial_number = vid, pid, serial_number
        self.is_plugged = self.is_allowed = self.takes = True

    def backend(self) -> Any:
        """Return what `usb.core.find(backend=...)` takes."""
        import usb.backend
        import usb.core

        bus = self
        gone = usb.core.USBError("No such device", errno=NO_DEVICE)
        forbidden = usb.core.USBError("Access denied (insufficient permissions)", errno=NO_ACCESS)
        late = usb.core.USBTimeoutError("Operation timed out", errno=TIMED_OUT)

        class Backend(usb.backend.IBackend):  # type: ignore[misc]  # pyusb has no types
            """Answer for one device."""

            def enumerate_devices(self) -> Any:
                """Return the device when it is plugged in."""
                return iter([1] if bus.is_plugged else [])

            def get_parent(self, dev: Any) -> None:
                """Return no hub."""

            def get_device_descriptor(self, dev: Any) -> Any:
                """Describe the device."""
                return SimpleNamespace(
                    bLength=18, bDescriptorType=1, bcdUSB=0x200, bDeviceClass=0xFF,
                    bDeviceSubClass=0, bDeviceProtocol=0, bMaxPacketSize0=64, idVendor=bus.vid,
                    idProduct=bus.pid, bcdDevice=0x100, iManufacturer=0, iProduct=0,
                    iSerialNumber=3, bNumConfigurations=1, address=1, bus=1, port_number=1,
                    port_numbers=(1,), speed=2,
                )  # fmt: skip

            def get_configuration_descriptor(self, dev: Any, config: int) -> Any:
                """Describe the one configuration."""
                if config:
                    raise IndexError
                return SimpleNamespace(
                    bLength=9, bDescriptorType=2, wTotalLength=32, bNumInterfaces=1,
                    bConfigurationValue=1, iConfiguration=0, bmAttributes=0x80, bMaxPower=50,
                    extra_descriptors=[],
                )  # fmt: skip

            def get_interface_descriptor(self, dev: Any, intf: int, alt: int, config: int) -> Any:
                """Describe the one interface."""
                if intf or alt or config:
                    raise IndexError
                return SimpleNamespace(
                    bLength=9, bDescriptorType=4, bInterfaceNumber=0, bAlternateSetting=0,
                    bNumEndpoints=2, bInterfaceClass=0xFF, bInterfaceSubClass=0,
                    bInterfaceProtocol=0, iInterface=0, extra_descriptors=[],
                )  # fmt: skip

            def get_endpoint_descriptor(
                self, dev: Any, ep: int, intf: int, alt: int, config: int
            ) -> Any:
                """Describe the endpoints, in first so that order must not matter."""
                return SimpleNamespace(
                    bLength=7, bDescriptorType=5, bEndpointAddress=(0x81, 0x01)[ep],
                    bmAttributes=3, wMaxPacketSize=PACKET_BYTES, bInterval=1, bRefresh=0,
                    bSynchAddress=0, extra_descriptors=[],
                )  # fmt: skip

            def open_device(self, dev: Any) -> object:
                """Return a handle."""
                if not bus.is_plugged:
                    raise gone
                if not bus.is_allowed:
                    raise forbidden
                bus.peer.connect(bus.clock.now_ns())
                return object()

            def close_device(self, handle: Any) -> None:
                """Take the handle back."""

            def set_configuration(self, handle: Any, value: int) -> None:
                """Take the one there is."""

            def get_configuration(self, handle: Any) -> int:
                """Return the one there is."""
                return 1

            def claim_interface(self, handle: Any, intf: int) -> None:
                """Allow it."""

            def release_interface(self, handle: Any, intf: int) -> None:
                """Allow it."""

            def ctrl_transfer(
                self,
                handle: Any,
                kind: int,
                request: int,
                value: int,
                index: int,
                data: Any,
                t: int,
            ) -> int:
                """Give the strings: languages, then the serial number."""
                text = b"\x09\x04"
                if value & 0xFF:
                    text = bus.serial_number.encode("utf-16-le")
                answer = bytes((len(text) + 2, 3)) + text
                data[: len(answer)] = array.array("B", answer)
                return len(answer)

            def intr_write(self, handle: Any, ep: int, intf: int, data: Any, timeout: int) -> int:
                """Hand one packet to the band."""
                if not bus.is_plugged:
                    raise gone
                if not bus.takes:
                    raise late
                bus.peer.accept(bytes(data), bus.clock.now_ns())
                return len(data)

            def intr_read(self, handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
                """Take one packet from the band, or time out."""
                if not bus.is_plugged:
                    raise gone
                chunk = _wait(bus.peer, bus.clock, timeout)
                if chunk is None:
                    raise late
                buff[: len(chunk)] = array.array("B", chunk)
                return len(chunk)

        return Backend()


class FakeHidapi:
    """One HID band behind hidapi's module functions; `is_plugged`, `is_allowed` may be changed."""

    def __init__(
        self,
        peer: ReportBandSimulator,
        clock: Clock,
        *,
        vid: int,
        pid: int,
        serial_number: str = "",
    ) -> None:
        self.peer, self.clock = peer, clock
        self._ids = (vid, pid)
        self._serial_number = serial_number
        self.is_plugged = self.is_allowed = True

    def enumerate(self, vid: int, pid: int) -> list[dict[str, Any]]:
        """List the band when it fits."""
        if not self.is_plugged or (vid, pid) != self._ids:
            return []
        return [{"path": b"/dev/hidraw9", "serial_number": self._serial_number}]

    def device(self) -> "FakeHidDevice":
        """Return an object that can be opened."""
        return FakeHidDevice(self)


class FakeHidDevice:
    """What `hid.device()` returns."""

    def __init__(self, bus: FakeHidapi) -> None:
        self._bus = bus

    def open_path(self, path: bytes) -> None:
        """Open it."""
        if not self._bus.is_allowed:
            raise OSError("open failed")
        self._bus.peer.connect(self._bus.clock.now_ns())

    def set_nonblocking(self, flag: int) -> None:
        """Do nothing."""

    def write(self, data: bytes) -> int:
        """Hand one report to the band; -1 when it is gone."""
        if not self._bus.is_plugged:
            return -1
        self._bus.peer.accept(bytes(data), self._bus.clock.now_ns())
        return len(data)

    def read(self, most: int, timeout_ms: int = 0) -> list[int]:
        """Return one report, or nothing in time."""
        if not self._bus.is_plugged:
            raise OSError("read error")
        return list(_wait(self._bus.peer, self._bus.clock, timeout_ms) or b"")

    def close(self) -> None:
        """Do nothing."""


def _wait(peer: ReportBandSimulator, clock: Clock, timeout_ms: int) -> bytes | None:
    """Return the band's next report, waiting for it on the clock."""
    deadline_ns = clock.now_ns() + timeout_ms * NS_PER_MS
    while True:
        try:
            chunk = peer.next_report(clock.now_ns())
        except DeviceError:
            return None
        now_ns = clock.now_ns()
        if chunk is not None or now_ns >= deadline_ns:
            return chunk
        clock.sleep_until_ns(min(now_ns + LOOK_NS, deadline_ns))

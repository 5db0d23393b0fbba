"""Gamepads and USB button boxes that are HIDs, with the buttons that they describe.

A HID has no clock of its own. The computer asks it every 1 to 8 ms, which is the resolution of a
press. Boxes that type like a keyboard belong to `keyboard`.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from visavis.devices.byte_links import ByteLink, Chunk
from visavis.devices.drivers.buttons.device import ButtonDevice, Press
from visavis.devices.drivers.buttons.hid_reports import (
    DESKTOP_PAGE,
    Layout,
    ReportReader,
    layout_of,
)
from visavis.devices.drivers.buttons.spec import HID_BUTTONS
from visavis.devices.drivers.hid_gaze.reports import hid_library
from visavis.devices.one_of_a_kind import the_only_hid
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout, ProtocolViolation

DESCRIBE = b"descriptor"
DESCRIPTOR, REPORT = b"D", b"R"
JOYSTICK, GAMEPAD = 0x04, 0x05
MAX_REPORTS = 64
MAX_REPORT_BYTES = 256


class HidButtonLink:
    """A HID's reports as chunks that begin with "R"; its descriptor, asked for, begins with "D".

    Without `vid` and `pid` the only gamepad or joystick is taken. `library` replaces hidapi in
    tests.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        vid: int | None = None,
        pid: int | None = None,
        serial_number: str = "",
        library: Any = None,
    ) -> None:
        self.is_simulated = False
        self._clock = clock
        self._criteria = (vid, pid, serial_number)
        self._library = library
        self._device: Any = None
        self._answers: deque[Chunk] = deque()
        self._usb_id = ""

    @property
    def kind(self) -> str:
        """Name vendor and product."""
        return f"hid {self._usb_id}".strip()

    def open(self, deadline_s: float) -> None:
        """Find and open the device."""
        self.close()
        library = self._library if self._library is not None else hid_library()
        rows = [row for row in library.enumerate() if self._fits(row)]
        if not rows:
            raise DeviceNotFound("no such gamepad or button box", remedy=HID_BUTTONS.remedy)
        row = the_only_hid(rows, "gamepads or button boxes")
        device = library.device()
        try:
            device.open_path(row["path"])
        except OSError as cause:
            raise DeviceNotFound(
                f"{row.get('product_string')} cannot be opened ({cause})",
                remedy="on Linux: visavis devices rules says who may use it",
            ) from cause
        self._device = device
        self._usb_id = f"{row['vendor_id']:04x}:{row['product_id']:04x}"

    def write(self, data: bytes) -> int:
        """Ask for the descriptor."""
        if self._device is None:
            raise DeviceDisconnected("the device is closed", remedy=HID_BUTTONS.remedy)
        now_ns = self._clock.now_ns()
        if data == DESCRIBE:
            try:
                descriptor = bytes(self._device.get_report_descriptor())
            except (OSError, ValueError) as cause:
                raise self._disconnection(cause) from cause
            self._answers.append(Chunk(now_ns, DESCRIPTOR + descriptor))
        return now_ns

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return the reports that came; see `ByteLink`."""
        if self._device is None:
            raise DeviceDisconnected("the device is closed", remedy=HID_BUTTONS.remedy)
        chunks = list(self._answers)
        self._answers.clear()
        wait_ms = 1 if chunks else max(1, round(timeout_s * 1000))
        try:
            while len(chunks) < MAX_REPORTS:
                report = self._device.read(MAX_REPORT_BYTES, wait_ms)
                if not report:
                    break
                chunks.append(Chunk(self._clock.now_ns(), REPORT + bytes(report)))
                wait_ms = 1
        except (OSError, ValueError) as cause:
            if not chunks:  # earlier reports count; the next call raises
                raise self._disconnection(cause) from cause
        return chunks

    def close(self) -> None:
        """Close the device; idempotent."""
        device, self._device = self._device, None
        self._answers.clear()
        if device is not None:
            device.close()

    def _fits(self, row: Mapping[str, Any]) -> bool:
        vid, pid, serial_number = self._criteria
        if vid is None and pid is None and not serial_number:
            usages = (JOYSTICK, GAMEPAD)
            return row.get("usage_page") == DESKTOP_PAGE and row.get("usage") in usages
        return (
            (vid is None or row.get("vendor_id") == vid)
            and (pid is None or row.get("product_id") == pid)
            and (not serial_number or row.get("serial_number") == serial_number)
        )

    def _disconnection(self, cause: Exception) -> DeviceDisconnected:
        return DeviceDisconnected(f"{self.kind} is gone: {cause}", remedy=HID_BUTTONS.remedy)


class HidButtons(ButtonDevice):
    """Follow the `ResponseInput` contract over a HID; its buttons are known once it is open."""

    def __init__(self, role: str, link: ByteLink, clock: Clock, *, keys: Mapping[str, str]) -> None:
        self._reader = ReportReader(Layout((), is_numbered=False))
        super().__init__(role, link, clock, HID_BUTTONS, buttons=tuple(keys), keys=keys)

    @property
    def unreadable_count(self) -> int:
        """How many reports were too short."""
        return self._reader.unreadable_count

    def _fresh(self) -> None:
        """Keep the buttons that are held down: every report carries the whole state."""

    def _read(self, data: bytes) -> Iterable[Press]:
        return self._reader.feed(data[1:]) if data[:1] == REPORT else ()

    def _greet(self, deadline_ns: int) -> None:
        """Read which buttons there are."""
        self._link.write(DESCRIBE)
        while (now_ns := self._clock.now_ns()) < deadline_ns:
            for chunk in self._link.read((deadline_ns - now_ns) / NS_PER_S):
                if chunk.data[:1] == DESCRIPTOR:
                    self._take(layout_of(chunk.data[1:]))
                    return
        raise DeviceTimeout(
            "it does not describe its buttons", role=self._role, remedy=self._spec.remedy
        )

    def _take(self, layout: Layout) -> None:
        if not layout.controls:
            raise ProtocolViolation(
                "it has no buttons that could be read",
                role=self._role,
                remedy="if it types like a keyboard, use driver: keyboard",
            )
        self._reader = ReportReader(layout)
        self._name(layout.buttons())

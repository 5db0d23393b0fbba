"""Carry reports of a HID eye tracker by hidapi: exactly one report per read."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from visavis.devices.drivers.hid_gaze.codec import EYE_TRACKER, INPUT, USAGE_PAGE, walk_descriptor
from visavis.devices.libraries import HID
from visavis.devices.one_of_a_kind import the_only_hid
from visavis.devices.transports import Exchange, Frames, Message, NoTopics
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound, ProtocolViolation

MAX_REPORTS = 1000


def hid_library() -> Any:
    """Return hidapi's module: its hidraw flavour on Linux, the only one elsewhere."""
    name = "hidraw" if sys.platform.startswith("linux") else "hid"
    library = replace(HID, module=name).imported()
    if not hasattr(library, "device"):
        raise DeviceNotFound(
            f"the module {name!r} belongs to another package than hidapi",
            remedy="run: pip uninstall hid, then pip install --force-reinstall hidapi",
        )
    return library


def list_trackers(library: Any) -> list[Mapping[str, Any]]:
    """Return every connected eye tracker as hidapi describes it."""
    return [
        row
        for row in library.enumerate()
        if row.get("usage_page") == USAGE_PAGE and row.get("usage") == EYE_TRACKER
    ]


class HidReports(NoTopics):
    """Offer one eye tracker's reports; an empty serial takes the only one there is.

    Requests: (descriptor,), (identity,), (feature:NN,). `library` replaces hidapi in tests.
    """

    def __init__(
        self, serial: str, clock: Clock, *, library: Any = None, is_simulated: bool = False
    ) -> None:
        self.is_simulated = is_simulated
        self._serial = serial
        self._clock = clock
        self._injected_library = library
        self._device: Any = None
        self._row: Mapping[str, Any] = {}
        self._size = 64

    @property
    def kind(self) -> str:
        """Name the device by vendor, product and serial."""
        row = self._row
        if not row:
            return "hid"
        return f"hid {row['vendor_id']:04x}:{row['product_id']:04x} {row.get('serial_number', '')}"

    def open(self, deadline_s: float) -> None:
        """Find and open the tracker, and learn the size of its report."""
        self.close()
        library = self._injected_library if self._injected_library is not None else hid_library()
        rows = list_trackers(library)
        matches = [r for r in rows if not self._serial or r.get("serial_number") == self._serial]
        if not matches:
            serials = ", ".join(str(row.get("serial_number")) for row in rows) or "none"
            raise DeviceNotFound(f"no HID eye tracker {self._serial!r} (found: {serials})".strip())
        self._row = the_only_hid(matches, "HID eye trackers")
        device = library.device()
        try:
            device.open_path(self._row["path"])
        except OSError as cause:
            raise DeviceNotFound(
                f"the eye tracker {self.kind} cannot be opened ({cause})",
                remedy="close other programs that use it; on Linux: visavis devices rules",
            ) from cause
        self._device = device
        reports = walk_descriptor(self._descriptor())
        sizes = [layout.size for (kind, _), layout in reports.items() if kind == INPUT]
        if not sizes:
            self.close()
            raise ProtocolViolation("the device describes no input report of an eye tracker")
        self._size = max(sizes)

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Read the descriptor, the identity, or a feature report."""
        sent_ns = self._clock.now_ns()
        kind = frames[0]
        if kind == b"descriptor":
            answer = self._descriptor()
        elif kind == b"identity":
            names = (self._row.get("product_string"), self._row.get("serial_number"))
            answer = "\n".join(str(name or "") for name in names).encode()
        else:
            answer = self._feature(int(kind.removeprefix(b"feature:"), 16))
        return Exchange((kind, answer), sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Write a feature report: (set, report)."""
        if self._device is None:
            return
        try:
            self._device.send_feature_report(frames[1])
        except (OSError, ValueError) as cause:
            raise self._lose(cause) from cause

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the waiting reports; raises DeviceDisconnected once the tracker is unplugged."""
        if self._device is None:
            raise DeviceDisconnected("the eye tracker is not open")
        messages: list[Message] = []
        wait_ms = max(1, round(timeout_s * 1e3)) if timeout_s > 0 else 0
        try:
            while len(messages) < MAX_REPORTS:
                if wait_ms:
                    report = self._device.read(self._size, wait_ms)
                else:
                    self._device.set_nonblocking(1)
                    report = self._device.read(self._size)
                if not report:
                    break
                messages.append(Message(self._clock.now_ns(), (bytes(report),)))
                wait_ms = 0
        except (OSError, ValueError) as cause:
            if not messages:
                raise self._lose(cause) from cause
        finally:
            if self._device is not None:
                self._device.set_nonblocking(0)
        return messages

    def send(self, port: int, frames: Frames) -> None:
        """Write, as `post` does."""
        self.post(frames)

    def close(self) -> None:
        """Close the device; idempotent."""
        if self._device is not None:
            self._device.close()
            self._device = None

    def _descriptor(self) -> bytes:
        try:
            return bytes(self._device.get_report_descriptor())
        except (OSError, ValueError) as cause:
            raise self._lose(cause) from cause

    def _feature(self, number: int) -> bytes:
        try:
            return bytes(self._device.get_feature_report(number, 256))
        except (OSError, ValueError):
            return b""  # optional: the driver uses its options instead

    def _lose(self, cause: Exception) -> DeviceError:
        self.close()
        return DeviceDisconnected(f"the eye tracker is gone ({cause})")

"""hidapi's module with one simulated eye tracker plugged in."""

from collections.abc import Mapping
from typing import Any

from visavis.devices.sim.hid_gaze import PRODUCT_ID, SERIAL, VENDOR_ID, HidGazeSimulator
from visavis.lab.clock import Clock


class FakeHidapi:
    """Stand in for hidapi's module with one simulated tracker plugged in."""

    def __init__(self, simulator: HidGazeSimulator, clock: Clock) -> None:
        self.simulator = simulator
        self.clock = clock

    def enumerate(self) -> list[Mapping[str, Any]]:
        """List a keyboard, and the tracker while it is there."""
        tracker = {
            "path": b"/dev/hidraw-sim",
            "vendor_id": VENDOR_ID,
            "product_id": PRODUCT_ID,
            "usage_page": 0x12,
            "usage": 0x01,
            "serial_number": SERIAL,
            "product_string": "Simulated eye tracker",
        }
        is_gone = self.simulator.source.is_away(self.clock.now_ns())
        return [
            {"usage_page": 1, "usage": 6, "path": b"/dev/keyboard"},
            *([] if is_gone else [tracker]),
        ]

    def device(self) -> "FakeHidDevice":
        """Return a closed device."""
        return FakeHidDevice(self)


class FakeHidDevice:
    """Offer the methods of hidapi's device that the transport uses; reads never merge reports."""

    def __init__(self, library: FakeHidapi) -> None:
        self._library = library
        self._waiting: list[bytes] = []

    def open_path(self, path: bytes) -> None:
        """Open; OSError when it is gone."""
        self._check()
        self._library.simulator.outgoing(self._library.clock.now_ns())

    def close(self) -> None:
        """Close."""

    def set_nonblocking(self, on: int) -> None:
        """Accept: a virtual clock never waits here."""

    def get_report_descriptor(self) -> list[int]:
        """Return the descriptor."""
        self._check()
        return list(self._library.simulator.descriptor)

    def get_feature_report(self, number: int, size: int) -> list[int]:
        """Return a feature report."""
        self._check()
        return list(self._library.simulator.feature(number)[:size])

    def send_feature_report(self, report: bytes) -> int:
        """Take a feature report."""
        self._library.simulator.answer((b"set", bytes(report)), self._library.clock.now_ns())
        return len(report)

    def read(self, size: int, timeout_ms: int = 0) -> list[int]:
        """Return the next report, cut to `size`; [] when none comes in time."""
        self._check()
        clock, simulator = self._library.clock, self._library.simulator
        until_ns = clock.now_ns() + timeout_ms * 1_000_000
        while True:
            now_ns = clock.now_ns()
            simulator.advance(now_ns)
            self._waiting += [message.frames[0] for message in simulator.outgoing(now_ns)]
            if self._waiting:
                return list(self._waiting.pop(0)[:size])
            if now_ns >= until_ns:
                return []
            clock.sleep_until_ns(min(until_ns, now_ns + 1_000_000))

    def _check(self) -> None:
        if self._library.simulator.source.is_away(self._library.clock.now_ns()):
            raise OSError("read error")

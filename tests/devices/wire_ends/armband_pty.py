"""Host the simulated armband's firmware on a pseudo-terminal of this computer, in a thread."""

import os
import select
import sys
import threading

from visavis.devices.sim.armband.firmware import ArmbandFirmware
from visavis.lab.clock import Clock
from visavis.lab.closing import Closing
from visavis.lab.errors import DeviceNotFound

LOOP_S = 0.001


def open_terminal(*, blocking: bool = True) -> tuple[int, int, str]:
    """Open a raw pseudo-terminal; return its two ends and the name that others open.

    Raises DeviceNotFound on Windows, which has none.
    """
    if sys.platform == "win32":
        raise DeviceNotFound(
            "Windows has no pseudo-terminals, on which this simulator stands",
            remedy="rehearse on the virtual clock (visavis simulate), or on Linux or macOS",
        )
    else:  # mypy takes what follows a raise for dead on Windows
        import tty

        own, other = os.openpty()
        tty.setraw(other)
        os.set_blocking(own, blocking)
        return own, other, os.ttyname(other)


class PtyArmband(Closing):
    """Serve an armband until closed; a context manager. `port` is what pyserial opens."""

    def __init__(self, clock: Clock, firmware: ArmbandFirmware | None = None) -> None:
        self.firmware = firmware if firmware is not None else ArmbandFirmware()
        self._clock = clock
        self._origin_ns = clock.now_ns()
        self._own, self._other, self.port = open_terminal()
        self._stopping = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._serve, name="pty-armband", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop and release the terminal; re-raises what stopped the thread."""
        self._stopping.set()
        self._thread.join()
        for descriptor in (self._own, self._other):
            if descriptor >= 0:
                os.close(descriptor)
        self._own = self._other = -1
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _serve(self) -> None:
        try:
            while not self._stopping.is_set():
                said = b""
                ready, _, _ = select.select([self._own], [], [], LOOP_S)
                if ready:
                    said = self.firmware.feed(os.read(self._own, 4096), self._now_us())
                said += self.firmware.step(self._now_us())
                if said:
                    os.write(self._own, said)
        except Exception as failure:  # a thread top: close() hands it on
            self._failure = failure

    def _now_us(self) -> int:
        return (self._clock.now_ns() - self._origin_ns) // 1000

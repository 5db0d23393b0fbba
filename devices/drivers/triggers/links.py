"""Wires of triggers other than serial ports: a parallel port, an LSL outlet of markers.

Each is a `ByteLink` on which a byte sets the lines until the next one.
"""

import contextlib
import ctypes
import os
import struct
import sys
from collections.abc import Sequence
from typing import Any

from visavis.devices.byte_links import Chunk
from visavis.devices.drivers.lsl.outlet import lsl_library
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound

PARALLEL_REMEDY = (
    "Linux: load ppdev, unload lp (sudo modprobe ppdev; sudo rmmod lp) and join the group lp; "
    "Windows: install inpoutx64 and give the port's address from the device manager"
)


class _Lines:
    """The common part of links that only write: reading waits and returns nothing."""

    is_simulated = False

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Wait, and return nothing: the lines do not answer."""
        if timeout_s > 0:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(timeout_s * NS_PER_S))
        return ()


def _io(number: int, size: int = 0, *, writes: bool = False) -> int:
    """Return a request of Linux's ppdev, as <linux/ioctl.h> builds it (most processors)."""
    return int(writes) << 30 | size << 16 | ord("p") << 8 | number


PPCLAIM, PPRELEASE, PPEXCL = _io(0x8B), _io(0x8C), _io(0x8F)
PPDATADIR, PPWDATA = _io(0x90, 4, writes=True), _io(0x86, 1, writes=True)


class ParallelLink(_Lines):
    """The eight data lines D0-D7 (pins 2-9) of a parallel port.

    `port` is a device of Linux's ppdev ("/dev/parport0"), or on Windows the port's address
    ("0x378"), to which the library inpoutx64 writes. `library` replaces it in tests.
    """

    def __init__(self, clock: Clock, port: str, library: Any = None) -> None:
        super().__init__(clock)
        self._port = port
        self._library = library
        self._handle: int | None = None

    @property
    def kind(self) -> str:
        """Name the port."""
        return f"parallel {self._port}"

    @property
    def _is_address(self) -> bool:
        return self._port.lower().startswith("0x")

    def open(self, deadline_s: float) -> None:
        """Claim the port."""
        self.close()
        if self._is_address:
            self._library = self._library if self._library is not None else _inpout()
            self._handle = int(self._port, 16)
            return
        self._handle = _claim(self._port)

    def write(self, data: bytes) -> int:
        """Put every byte on the lines, one after another."""
        if self._handle is None:
            raise DeviceDisconnected("the port is closed", remedy=PARALLEL_REMEDY)
        for byte in data:
            self._put(self._handle, byte)
        return self._clock.now_ns()

    def close(self) -> None:
        """Release the port; idempotent."""
        handle, self._handle = self._handle, None
        if handle is not None and not self._is_address:
            _release(handle)

    def _put(self, handle: int, byte: int) -> None:
        if self._is_address:
            self._library.Out32(handle, byte)
            return
        try:
            _ask(handle, PPWDATA, struct.pack("B", byte))
        except OSError as cause:
            text = f"{self._port} is gone: {cause.strerror or cause}"
            raise DeviceDisconnected(text, remedy=PARALLEL_REMEDY) from cause


def _claim(port: str) -> int:
    handle = -1
    try:
        handle = os.open(port, os.O_RDWR)
        _ask(handle, PPEXCL)
        _ask(handle, PPCLAIM)
        _ask(handle, PPDATADIR, struct.pack("i", 0))
    except OSError as cause:
        if handle >= 0:
            os.close(handle)
        text = f"cannot use {port}: {cause.strerror or cause}"
        raise DeviceNotFound(text, remedy=PARALLEL_REMEDY) from cause
    return handle


def _release(handle: int) -> None:
    with contextlib.suppress(OSError):  # it is gone, and closing releases it too
        _ask(handle, PPRELEASE)
    os.close(handle)


def _ask(handle: int, request: int, data: bytes = b"") -> None:
    if sys.platform == "win32":
        raise OSError("on Windows, give the port's address, such as 0x378")
    else:
        import fcntl

        fcntl.ioctl(handle, request, data or 0)


def _inpout() -> Any:
    try:
        return ctypes.CDLL("inpoutx64.dll")
    except OSError as cause:
        raise DeviceNotFound(
            f"the library inpoutx64.dll cannot be loaded: {cause}", remedy=PARALLEL_REMEDY
        ) from cause


class MarkerLink(_Lines):
    """An LSL outlet of type Markers: each code but 0 is a sample, stamped when it is pushed."""

    kind = "lsl markers"

    def __init__(self, clock: Clock, name: str, source_id: str, library: Any = None) -> None:
        super().__init__(clock)
        self._stream_names = (name, source_id)
        self._lsl = library
        self._outlet: Any = None

    def open(self, deadline_s: float) -> None:
        """Announce the stream."""
        if self._lsl is None:
            self._lsl = lsl_library()
        name, source_id = self._stream_names
        info = self._lsl.StreamInfo(name, "Markers", 1, 0.0, self._lsl.cf_int32, source_id)
        self._outlet = self._lsl.StreamOutlet(info)

    def write(self, data: bytes) -> int:
        """Push every code but 0, which ends a pulse on lines and means nothing here."""
        if self._outlet is None:
            raise DeviceDisconnected("the outlet is closed", remedy="open it")
        for code in data:
            if code:
                self._outlet.push_sample([code])
        return self._clock.now_ns()

    def close(self) -> None:
        """Withdraw the stream; idempotent."""
        self._outlet = None

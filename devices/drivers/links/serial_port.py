"""Reach a device over a serial port: a cable, a paired Bluetooth port, a pty or `socket://`.

Ports are found by what is plugged in (vendor, product, serial number), never by a fixed number.

What the line DTR means depends on the board. On one with a converter (FTDI, CH340, CP210x, the
second processor of an Arduino Uno) a rising DTR resets it; on one whose own processor speaks USB
(Leonardo, Micro, Pico, Teensy) DTR says that somebody listens, and most send nothing without it.
"""

import contextlib
import os
import select
import sys
import threading
from collections.abc import Callable, Sequence
from errno import EACCES
from typing import Any

from visavis.devices.byte_links import ByteLink, Chunk
from visavis.devices.libraries import SERIAL
from visavis.devices.wiring import Site
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

BAUD = 38_400
WRITE_TIMEOUT_S = 0.2
MAX_BYTES = 4096
FTDI, CP210X, CH340, PROLIFIC = 0x0403, 0x10C4, 0x1A86, 0x067B
CONVERTERS = frozenset({FTDI, CP210X, CH340, PROLIFIC})
ESP_BOARDS = frozenset({CP210X, CH340})
"""Converters of boards with an ESP32, which is kept in reset while RTS is up and DTR is not."""
ARDUINO = frozenset({0x2341, 0x2A03})
ARDUINO_CONVERTERS = frozenset({0x0001, 0x0010, 0x003B, 0x003F, 0x0042, 0x0043, 0x0044, 0x0243})
"""Arduino's products whose USB is a second processor: Uno, Mega 2560, Mega ADK, the adapter."""

ACCESS_REMEDY = "you may not use this port: visavis devices rules says how to change that"


class SerialLink:
    """A `ByteLink` over pyserial, which opens the port and waits where it takes no bytes.

    What passes at once is read and written by system calls alone, except on Windows and URLs.

    `port` is a device name ("COM4", "/dev/ttyUSB0", a pty) or a URL pyserial knows
    ("socket://host:port"); instead, `vid`, `pid` and `serial_number` find it. `dtr` is "on",
    "off" or "auto": on for a board that speaks USB itself, else off, so that opening resets none.
    `device` is what remedies call it.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        port: str = "",
        vid: int | None = None,
        pid: int | None = None,
        serial_number: str = "",
        baud: int = BAUD,
        dtr: str = "auto",
        device: str = "device",
        is_simulated: bool = False,
    ) -> None:
        if not port and vid is None and not serial_number:
            raise DeviceNotFound(
                "no serial port is named",
                remedy="give port, or vid and pid, or serial_number in lab_config.yaml",
            )
        self.is_simulated = is_simulated
        self._clock = clock
        self._port = port
        self._criteria = (vid, pid, serial_number)
        self._baud = baud
        self._dtr = dtr
        self._remedy = (
            f"plug the {device} in or switch it on; `visavis doctor` lists what is plugged in"
        )
        self._opened_as = port
        self._serial: Any = None
        self._fd: int | None = None
        self._library: Any = None
        self._writing = threading.RLock()

    @property
    def kind(self) -> str:
        """Name the port and its speed."""
        return f"serial {self._opened_as or 'port not found yet'} {self._baud}"

    def open(self, deadline_s: float) -> None:
        """Find and open the port."""
        self.close()
        self._library = serial = SERIAL.imported()
        name = self._opened_as = self._port or find_port(*self._criteria, self._remedy)
        try:
            port = serial.serial_for_url(
                name,
                baudrate=self._baud,
                timeout=0,
                write_timeout=WRITE_TIMEOUT_S,
                do_not_open=True,
            )
            if "://" not in name:
                port.exclusive = True
                self._set_lines(port, name)
            port.open()
        except (serial.SerialException, OSError, ValueError) as cause:
            errno = cause.errno if isinstance(cause, OSError) else None
            why = os.strerror(errno) if errno else str(cause)
            remedy = ACCESS_REMEDY if errno == EACCES else self._remedy
            raise DeviceNotFound(f"cannot open {name}: {why}", remedy=remedy) from cause
        has_fd = sys.platform != "win32" and "://" not in name
        self._serial, self._fd = port, port.fileno() if has_fd else None

    def _set_lines(self, port: Any, name: str) -> None:
        """Set the lines that hold from the moment the port opens."""
        vid, pid = _identity_of(name)
        port.dtr = needs_dtr(vid, pid) if self._dtr == "auto" else self._dtr == "on"
        if vid in ESP_BOARDS:
            port.rts = port.dtr

    def write(self, data: bytes) -> int:
        """Hand over the bytes; see `ByteLink`."""
        port = self._serial
        if port is None:
            raise DeviceDisconnected("the port is closed", remedy=self._remedy)
        try:
            with self._writing:
                fd = self._fd
                rest = data if fd is None else data[_write_at_once(fd, data) :]
                if rest:
                    port.write(rest)
        except self._library.SerialTimeoutException as cause:
            raise DeviceTimeout(
                f"{self._opened_as} takes no bytes", remedy="switch the band off and on"
            ) from cause
        except (self._library.SerialException, OSError, TypeError) as cause:
            raise DeviceDisconnected(
                f"{self._opened_as} is gone: {cause}", remedy=self._remedy
            ) from cause
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return what came; see `ByteLink`."""
        port, fd = self._serial, self._fd
        if port is None:
            raise DeviceDisconnected("the port is closed", remedy=self._remedy)
        try:
            if fd is not None:
                data = self._read_at_once(fd, timeout_s)
            else:
                if port.timeout != timeout_s:
                    port.timeout = timeout_s
                data = port.read(1)
        except (self._library.SerialException, OSError, TypeError, ValueError) as cause:
            raise DeviceDisconnected(
                f"{self._opened_as} is gone: {cause}", remedy=self._remedy
            ) from cause
        if not data:
            return ()
        stamp_ns = self._clock.now_ns()
        if fd is None:
            with contextlib.suppress(self._library.SerialException, OSError, TypeError):
                # earlier bytes count; the next call raises at the end of the link
                if waiting := port.in_waiting:
                    data += port.read(min(waiting, MAX_BYTES))
        return (Chunk(stamp_ns, data),)

    def close(self) -> None:
        """Close the port; idempotent."""
        port, self._serial, self._fd = self._serial, None, None
        if port is not None:
            # The library leaves the socket of a URL open when the other end was reset.
            url_socket = getattr(port, "_socket", None)
            with contextlib.suppress(OSError, self._library.SerialException):
                port.close()
            if url_socket is not None:
                url_socket.close()

    def _read_at_once(self, fd: int, timeout_s: float) -> bytes:
        """Return what has come, after a wait for the first byte; OSError at the port's end."""
        if not select.select((fd,), (), (), max(0.0, timeout_s))[0]:
            return b""
        if self._fd != fd:  # a closed descriptor may be that of another file by now
            raise OSError("the port was closed")
        try:
            data = os.read(fd, MAX_BYTES)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("ready to be read, but nothing is there")
        return data


def _write_at_once(fd: int, data: bytes) -> int:
    """Return how many bytes a port takes without waiting."""
    try:
        return os.write(fd, data)
    except BlockingIOError:
        return 0


def serial_port(baud: int | None = None) -> Callable[[Site[Any]], ByteLink]:
    """Return a `real`: the port named by a device's options, at their `baud` or at this one."""

    def real(site: Site[Any]) -> ByteLink:
        options = site.options
        return SerialLink(
            site.clock,
            port=options.port,
            vid=options.vid,
            pid=options.pid,
            serial_number=options.serial_number,
            baud=options.baud if baud is None else baud,
            dtr=options.dtr,
            device=site.spec.product.model,
        )

    return real


def needs_dtr(vid: int | None, pid: int | None) -> bool:
    """Tell whether a port's other end is a processor of its own, which waits for DTR to send."""
    if vid is None or vid in CONVERTERS:
        return False
    return not (vid in ARDUINO and pid in ARDUINO_CONVERTERS)


def _identity_of(name: str) -> tuple[int | None, int | None]:
    """Return vendor and product of the USB device that a port belongs to, if it is one's."""
    from serial.tools import list_ports

    # /dev/serial/by-id and rules of a lab's own are links to the port
    names = {name, os.path.realpath(name)}
    port = next((port for port in list_ports.comports() if port.device in names), None)
    return (None, None) if port is None else (port.vid, port.pid)


def find_port(
    vid: int | None,
    pid: int | None,
    serial_number: str,
    remedy: str = "`visavis doctor` lists what is plugged in",
) -> str:
    """Return the name of the one port that fits; raises DeviceNotFound, which lists the ports."""
    SERIAL.imported()
    from serial.tools import list_ports

    ports = list(list_ports.comports())
    fitting = [
        port.device
        for port in ports
        if (vid is None or port.vid == vid)
        and (pid is None or port.pid == pid)
        and (not serial_number or port.serial_number == serial_number)
    ]
    if len(fitting) == 1:
        return str(fitting[0])
    port_list = ", ".join(
        f"{port.device} (vid {_hex(port.vid)}, pid {_hex(port.pid)}, serial {port.serial_number})"
        for port in ports
        if port.vid is not None
    )
    ports_without_usb = [port.device for port in ports if port.vid is None]
    if ports_without_usb:
        others = f"without a USB identity, to be given as port: {', '.join(ports_without_usb)}"
        port_list = f"{port_list}; {others}" if port_list else others
    criteria = f"vid {_hex(vid)}, pid {_hex(pid)}, serial {serial_number or 'any'}"
    if fitting:
        raise DeviceNotFound(
            f"{len(fitting)} serial ports fit {criteria}: {', '.join(fitting)}",
            remedy="give serial_number in lab_config.yaml",
        )
    raise DeviceNotFound(
        f"no serial port fits {criteria}; plugged in: {port_list or 'none'}", remedy=remedy
    )


def _hex(number: int | None) -> str:
    return "any" if number is None else f"{number:04x}"

"""Reach a band over Bluetooth classic's serial port profile without a serial port in between.

A paired band usually shows up as a serial port (COM4, /dev/rfcomm0): then use that. Where the
system lets Python open RFCOMM sockets (Linux with BlueZ, Windows), `RfcommLink` needs none.
"""

import contextlib
import select
import socket
import threading
from collections.abc import Callable, Sequence

from visavis.devices.byte_links import Chunk
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

MAX_BYTES = 4096
WRITE_TIMEOUT_S = 0.5
REMEDY = "switch it on, pair it, and check its address"

Connect = Callable[[str, int, float], socket.socket]


class RfcommLink:
    """A `ByteLink` over an RFCOMM socket; `connect` takes its place in tests."""

    def __init__(
        self,
        clock: Clock,
        *,
        address: str,
        channel: int = 1,
        connect: Connect | None = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._clock = clock
        self._address = address
        self._channel = channel
        self._connect = connect if connect is not None else connect_rfcomm
        self._socket: socket.socket | None = None
        self._writing = threading.RLock()

    @property
    def kind(self) -> str:
        """Name address and channel."""
        return f"rfcomm {self._address} channel {self._channel}"

    def open(self, deadline_s: float) -> None:
        """Connect."""
        self.close()
        try:
            connection = self._connect(self._address, self._channel, deadline_s)
        except TimeoutError as cause:
            raise DeviceTimeout(f"{self.kind} does not answer", remedy=REMEDY) from cause
        except OSError as cause:
            raise DeviceNotFound(f"cannot reach {self.kind}: {cause}", remedy=REMEDY) from cause
        connection.settimeout(WRITE_TIMEOUT_S)
        self._socket = connection

    def write(self, data: bytes) -> int:
        """Hand over the bytes; see `ByteLink`."""
        connection = self._socket
        if connection is None:
            raise DeviceDisconnected(f"{self.kind} is closed", remedy=REMEDY)
        try:
            with self._writing:
                connection.sendall(data)
        except TimeoutError as cause:
            raise DeviceTimeout(f"{self.kind} takes no bytes", remedy=REMEDY) from cause
        except OSError as cause:
            raise DeviceDisconnected(f"{self.kind} is gone: {cause}", remedy=REMEDY) from cause
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return what came; see `ByteLink`."""
        connection = self._socket
        if connection is None:
            raise DeviceDisconnected(f"{self.kind} is closed", remedy=REMEDY)
        try:
            ready, _, _ = select.select([connection], [], [], max(0.0, timeout_s))
            if not ready:
                return ()
            data = connection.recv(MAX_BYTES)
        except (OSError, ValueError) as cause:
            raise DeviceDisconnected(f"{self.kind} is gone: {cause}", remedy=REMEDY) from cause
        if not data:
            raise DeviceDisconnected(f"{self.kind} was closed by the other end", remedy=REMEDY)
        return (Chunk(self._clock.now_ns(), data),)

    def close(self) -> None:
        """Close the socket; idempotent."""
        connection, self._socket = self._socket, None
        if connection is not None:
            with contextlib.suppress(OSError):
                connection.close()


def connect_rfcomm(address: str, channel: int, deadline_s: float) -> socket.socket:
    """Open an RFCOMM socket; raises DeviceNotFound where this system or Python has none."""
    family = getattr(socket, "AF_BLUETOOTH", None)
    protocol = getattr(socket, "BTPROTO_RFCOMM", None)
    if family is None or protocol is None:
        raise DeviceNotFound(
            "this Python cannot open Bluetooth sockets",
            remedy="pair it and give the serial port it gets as `port`, or use the "
            "system's own Python",
        )
    connection = socket.socket(family, socket.SOCK_STREAM, protocol)
    try:
        connection.settimeout(max(0.05, deadline_s))
        connection.connect((address, channel))
    except BaseException:
        connection.close()
        raise
    return connection

"""Carry a byte stream over TCP as messages of one chunk each, stamped when they are read."""

import select
import socket
from collections.abc import Sequence

from visavis.devices.transports import Exchange, Frames, Message, NoTopics
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

CHUNK_BYTES = 65_536
WRITE_TIMEOUT_S = 0.5


class StreamSocket(NoTopics):
    """Connect to a TCP peer; `post` writes, `receive` gives the chunks that came."""

    def __init__(
        self, host: str, port: int, clock: Clock, *, remedy: str = "", is_simulated: bool = False
    ) -> None:
        self.is_simulated = is_simulated
        self._host = host
        self._port = port
        self._clock = clock
        self._remedy = remedy
        self._socket: socket.socket | None = None

    @property
    def kind(self) -> str:
        """Name the endpoint."""
        return f"tcp {self._host}:{self._port}"

    def open(self, deadline_s: float) -> None:
        """Connect; raises DeviceNotFound when nobody listens, DeviceTimeout at the deadline."""
        self.close()
        try:
            connection = socket.create_connection((self._host, self._port), timeout=deadline_s)
        except TimeoutError as cause:
            raise DeviceTimeout(
                f"{self.kind} did not take a connection within {deadline_s:g} s",
                remedy=self._remedy,
            ) from cause
        except OSError as cause:
            raise DeviceNotFound(
                f"nobody answers at {self.kind} ({cause.strerror or cause})", remedy=self._remedy
            ) from cause
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.settimeout(WRITE_TIMEOUT_S)
        self._socket = connection

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Write, and return the next chunk as the answer."""
        sent_ns = self._clock.now_ns()
        self.post(frames)
        messages = self.receive(timeout_s)
        if not messages:
            raise DeviceTimeout(f"{self.kind} did not answer within {timeout_s:g} s")
        return Exchange(messages[0].frames, sent_ns, messages[0].t_host_ns)

    def post(self, frames: Frames) -> None:
        """Write everything, or raise DeviceTimeout when the peer takes nothing for 0.5 s."""
        if self._socket is None:
            raise DeviceDisconnected(f"{self.kind} is not connected", remedy=self._remedy)
        try:
            self._socket.sendall(b"".join(frames))
        except TimeoutError as cause:
            raise DeviceTimeout(
                f"{self.kind} takes no more bytes: a write timed out", remedy=self._remedy
            ) from cause
        except OSError as cause:
            raise self._lose(cause) from cause

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the next chunk, if any comes in time; raises DeviceDisconnected at its end."""
        if self._socket is None:
            raise DeviceDisconnected(f"{self.kind} is not connected", remedy=self._remedy)
        ready, _, _ = select.select([self._socket], [], [], max(0.0, timeout_s))
        if not ready:
            return ()
        try:
            chunk = self._socket.recv(CHUNK_BYTES)
        except OSError as cause:
            raise self._lose(cause) from cause
        now_ns = self._clock.now_ns()
        if not chunk:
            raise self._lose(None)
        return (Message(now_ns, (chunk,)),)

    def send(self, port: int, frames: Frames) -> None:
        """Write, as `post` does."""
        self.post(frames)

    def close(self) -> None:
        """Close the socket; idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _lose(self, cause: OSError | None) -> DeviceDisconnected:
        self.close()
        reason = "closed the connection" if cause is None else f"is gone ({cause.strerror})"
        return DeviceDisconnected(f"{self.kind} {reason}", remedy=self._remedy)

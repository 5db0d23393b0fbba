"""Carry text messages to a program on this computer over a WebSocket, as a `ByteLink`."""

import contextlib
import threading
from collections.abc import Sequence
from typing import Any

from visavis.devices.byte_links import Chunk
from visavis.devices.libraries import WEBSOCKETS
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound

MAX_AT_ONCE = 64
MIN_WAIT_S = 0.0005
"""A wait of 0 would give up before looking at the socket."""


class WebSocketLink:
    """One `write` is one text message; one chunk is one received message."""

    def __init__(self, url: str, clock: Clock, *, remedy: str, is_simulated: bool = False) -> None:
        self.is_simulated = is_simulated
        self._url = url
        self._clock = clock
        self._remedy = remedy
        self._socket: Any = None
        self._exit_stack = contextlib.ExitStack()
        self._library: Any = None
        self._writing = threading.RLock()

    @property
    def kind(self) -> str:
        """Name the address without its query."""
        return f"websocket {self._url.partition('?')[0]}"

    def open(self, deadline_s: float) -> None:
        """Connect."""
        self.close()
        self._library = library = WEBSOCKETS.imported("sync.client")
        try:
            self._socket = self._exit_stack.enter_context(
                library.sync.client.connect(
                    self._url,
                    open_timeout=max(0.05, deadline_s),
                    close_timeout=0.2,
                    compression=None,
                )
            )
        except (OSError, TimeoutError, library.exceptions.WebSocketException) as cause:
            raise DeviceNotFound(
                f"nobody answers at {self.kind}: {cause}", remedy=self._remedy
            ) from cause

    def write(self, data: bytes) -> int:
        """Send one text message; see `ByteLink`."""
        if self._socket is None:
            raise DeviceDisconnected("the connection is closed", remedy=self._remedy)
        try:
            with self._writing:
                self._socket.send(data.decode("utf-8"))
        except (OSError, self._library.exceptions.WebSocketException) as cause:
            raise DeviceDisconnected(
                f"{self.kind} is gone: {cause}", remedy=self._remedy
            ) from cause
        return self._clock.now_ns()

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return the messages that came; see `ByteLink`."""
        if self._socket is None:
            raise DeviceDisconnected("the connection is closed", remedy=self._remedy)
        chunks: list[Chunk] = []
        wait_s = max(MIN_WAIT_S, timeout_s)
        try:
            while len(chunks) < MAX_AT_ONCE:
                message = self._socket.recv(timeout=wait_s)
                data = message.encode("utf-8") if isinstance(message, str) else bytes(message)
                chunks.append(Chunk(self._clock.now_ns(), data))
                wait_s = MIN_WAIT_S
        except TimeoutError:
            return chunks
        except (OSError, self._library.exceptions.WebSocketException) as cause:
            raise DeviceDisconnected(
                f"{self.kind} is gone: {cause}", remedy=self._remedy
            ) from cause
        return chunks

    def close(self) -> None:
        """Close the connection; idempotent."""
        connection, self._socket = self._socket, None
        if connection is not None:
            with contextlib.suppress(OSError, self._library.exceptions.WebSocketException):
                self._exit_stack.close()

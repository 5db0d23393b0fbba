"""Host a band's simulator on a real WebSocket of this computer, in threads.

One connection at a time; a refused connection closes the socket at once.
"""

import threading
from typing import Any

from visavis.devices.byte_links import BytePeer
from visavis.lab.clock import Clock
from visavis.lab.closing import Closing
from visavis.lab.errors import DeviceError

LOOK_S = 0.002


class WebSocketHost(Closing):
    """Serve a simulator until closed; a context manager. `paths` are what clients asked for."""

    def __init__(self, peer: BytePeer, clock: Clock, *, address: str = "127.0.0.1") -> None:
        import websockets.exceptions
        import websockets.sync.server

        self._peer = peer
        self._clock = clock
        self._gone = websockets.exceptions.ConnectionClosed
        self._lock = threading.Lock()
        self.paths: list[str] = []
        self._server: Any = websockets.sync.server.serve(
            self._serve, address, 0, compression=None, close_timeout=0.2
        )
        self.port: int = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._thread.join()

    def _serve(self, connection: Any) -> None:
        self.paths.append(connection.request.path)
        try:
            with self._lock:
                self._peer.connect(self._clock.now_ns())
            while True:
                try:
                    message = connection.recv(timeout=LOOK_S)
                except TimeoutError:
                    message = None
                with self._lock:
                    now_ns = self._clock.now_ns()
                    if message is not None:
                        self._peer.accept(message.encode("utf-8"), now_ns)
                    chunks = self._peer.outgoing(now_ns)
                for chunk in chunks:
                    connection.send(chunk.data.decode("utf-8"))
        except (self._gone, DeviceError):
            return

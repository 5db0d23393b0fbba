"""Gazepoint's server on a real socket: the simulator behind a TCP port."""

import selectors
import socket
import threading

from visavis.devices.sim.gazepoint import GazepointSimulator
from visavis.lab.clock import NS_PER_MS, Clock


class GazepointHost:
    """Serve a simulator on a TCP port of this computer, in a thread; a context manager.

    `reads` False accepts clients and never reads what they write. A "disconnect" closes the
    connection and refuses the next ones until it is over.
    """

    def __init__(self, simulator: GazepointSimulator, clock: Clock, *, reads: bool = True) -> None:
        self._simulator = simulator
        self._clock = clock
        self._reads = reads
        self._listener: socket.socket | None = self._listen(0)
        self.port = self._port_of(self._listener)
        self._client: socket.socket | None = None
        self._stopping = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._serve, name="gazepoint-host", daemon=True)
        self._thread.start()

    def __enter__(self) -> "GazepointHost":
        return self

    def __exit__(self, *exception: object) -> None:
        self._stopping.set()
        self._thread.join()
        if self._failure is not None:
            raise self._failure

    @staticmethod
    def _port_of(listener: socket.socket) -> int:
        port: int = listener.getsockname()[1]
        return port

    def _listen(self, port: int) -> socket.socket:
        listener = socket.create_server(("127.0.0.1", port))
        if not self._reads:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        listener.setblocking(False)
        return listener

    def _serve(self) -> None:
        try:
            while not self._stopping.is_set():
                self._turn()
        except Exception as failure:  # top of a thread: leaving the context raises it
            self._failure = failure
        for one in (self._client, self._listener):
            if one is not None:
                one.close()

    def _turn(self) -> None:
        now_ns = self._clock.now_ns()
        if self._simulator.source.is_away(now_ns):
            for one in (self._client, self._listener):
                if one is not None:
                    one.close()
            self._client = self._listener = None
            self._simulator.advance(now_ns)
            self._simulator.outgoing(now_ns)
            self._clock.sleep_until_ns(now_ns + NS_PER_MS)
            return
        if self._listener is None:
            self._listener = self._listen(self.port)
        with selectors.DefaultSelector() as ready:
            ready.register(self._listener, selectors.EVENT_READ)
            if self._client is not None and self._reads:
                ready.register(self._client, selectors.EVENT_READ)
            for key, _ in ready.select(0.001):
                if key.fileobj is self._listener:
                    if self._client is not None:
                        self._client.close()
                    self._client, _ = self._listener.accept()
                    self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                elif key.fileobj is self._client:
                    self._read()
        now_ns = self._clock.now_ns()
        self._simulator.advance(now_ns)
        for message in self._simulator.outgoing(now_ns):
            self._write(message.frames[0])

    def _read(self) -> None:
        assert self._client is not None
        try:
            data = self._client.recv(65_536)
        except OSError:
            data = b""  # a reset by the client ends the connection
        if data:
            self._simulator.handle_request((data,), self._clock.now_ns())
        else:
            self._client.close()
            self._client = None

    def _write(self, data: bytes) -> None:
        if self._client is None:
            return
        try:
            self._client.sendall(data)
        except OSError:
            self._client.close()
            self._client = None

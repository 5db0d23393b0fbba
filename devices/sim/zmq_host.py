"""Host a message simulator on real ZeroMQ sockets of this computer, in a thread.

A "disconnect" is silence on open sockets here: the operating system's own reset is not modelled.
"""

import threading
from typing import Any

from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.closing import Closing

LOOP_MS = 1
FIRST_SAMPLES_NS = 20 * NS_PER_MS


class ZmqHost(Closing):
    """Serve a simulator until closed; a context manager. `port` is the request port."""

    def __init__(
        self, simulator: PupilCoreSimulator, clock: Clock, *, address: str = "127.0.0.1"
    ) -> None:
        import zmq

        self._zmq = zmq
        self._simulator = simulator
        self._clock = clock
        self._context: Any = zmq.Context()
        self._router = self._context.socket(zmq.ROUTER)
        self._publisher = self._context.socket(zmq.PUB)
        self._annotations = self._context.socket(zmq.SUB)
        self._annotations.setsockopt(zmq.SUBSCRIBE, b"")
        endpoint = f"tcp://{address}"
        self.port: int = self._router.bind_to_random_port(endpoint)
        simulator.ports = (
            self._publisher.bind_to_random_port(endpoint),
            self._annotations.bind_to_random_port(endpoint),
        )
        self._stopping = threading.Event()
        self._failure: Exception | None = None
        # compile before anybody waits for an answer: on a new machine this takes seconds
        simulator.advance(clock.now_ns() + FIRST_SAMPLES_NS)
        self._thread = threading.Thread(target=self._serve, name="zmq-host", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop the thread and release the sockets; re-raises what stopped the thread."""
        self._stopping.set()
        self._thread.join()
        for socket in (self._router, self._publisher, self._annotations):
            socket.close(0)
        self._context.term()
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _serve(self) -> None:
        poller = self._zmq.Poller()
        poller.register(self._router, self._zmq.POLLIN)
        poller.register(self._annotations, self._zmq.POLLIN)
        try:
            while not self._stopping.is_set():
                ready = dict(poller.poll(LOOP_MS))
                if self._router in ready:
                    self._answer(self._router.recv_multipart())
                if self._annotations in ready:
                    frames = tuple(self._annotations.recv_multipart())
                    self._simulator.accept(frames, self._clock.now_ns())
                now_ns = self._clock.now_ns()
                self._simulator.advance(now_ns)
                for message in self._simulator.outgoing(now_ns):
                    self._publisher.send_multipart(message.frames)
        except Exception as failure:  # top of a thread: close() raises it
            self._failure = failure

    def _answer(self, parts: list[bytes]) -> None:
        cut = parts.index(b"") + 1
        answer = self._simulator.handle_request(tuple(parts[cut:]), self._clock.now_ns())
        if answer is not None:
            self._router.send_multipart([*parts[:cut], *answer])

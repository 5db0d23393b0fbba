"""Carry multi-part messages between a driver and its device: real ZeroMQ, or memory.

Both carry the same bytes. The memory wire lets its peer catch up before anything is read, and
every message bears its own arrival time, so a driver cannot tell simulation from a socket.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

from visavis.devices.libraries import ZMQ
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceTimeout

Frames = tuple[bytes, ...]

RECEIVE_HIGH_WATER_MARK = 100_000
"""Messages a subscriber holds before ZeroMQ drops silently; its own default is 1000."""

REAL_TIME_STEP_NS = NS_PER_MS
"""How often a memory wire on a real clock looks again while it waits."""


class Message(NamedTuple):
    """A message and its arrival by the session clock.

    `t_sent_ns` is None for a subscribed message; for the reply to a `post` it is the time at
    which that request left.
    """

    t_host_ns: int
    frames: Frames
    t_sent_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Exchange:
    """A request's answer and the session times around it."""

    frames: Frames
    t_send_ns: int
    t_receive_ns: int


class MessageTransport(Protocol):
    """A wire of multi-part messages: one request channel, one subscription, one way out."""

    @property
    def kind(self) -> str:
        """Name for the manifest: "zmq tcp://host:port", "memory", "replay"."""
        ...

    @property
    def is_simulated(self) -> bool:
        """Tell whether a simulator is known to sit at the other end."""
        ...

    def open(self, deadline_s: float) -> None:
        """Make the request channel ready."""
        ...

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Send and wait for the answer; raises DeviceTimeout when none comes."""
        ...

    def post(self, frames: Frames) -> None:
        """Send without waiting; the answer turns up in `receive`, or never."""
        ...

    def subscribe(self, port: int, topics: Sequence[bytes]) -> None:
        """Subscribe to topics (prefixes) at a port; a second call replaces the first."""
        ...

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return everything that has arrived; wait at most `timeout_s` for the first."""
        ...

    def send(self, port: int, frames: Frames) -> None:
        """Publish to a port, for annotations."""
        ...

    def close(self) -> None:
        """Release the wire; idempotent."""
        ...


class NoTopics:
    """A wire without topics: every message has been coming since `open()`."""

    def subscribe(self, port: int, topics: Sequence[bytes]) -> None:
        """Do nothing: everything comes."""


class OnlyListening(NoTopics):
    """A wire over which nothing is told to the other end but by asking it."""

    def send(self, port: int, frames: Frames) -> None:
        """Do nothing: the other end takes no messages."""


class Peer(Protocol):
    """The other end of a memory wire: what a simulator of a message device offers."""

    def advance(self, t_ns: int) -> None:
        """Do everything that is due up to this session time; never goes back."""
        ...

    def outgoing(self, until_ns: int) -> Sequence[Message]:
        """Give up the published messages that have arrived by this time, in arrival order."""
        ...

    def leg_ns(self) -> int:
        """Draw how long the next request or reply travels."""
        ...

    def handle_request(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer a request that reaches the device at `t_ns`; None when it stays silent."""
        ...

    def accept(self, frames: Frames, t_ns: int) -> None:
        """Take a message published to the device."""
        ...


@runtime_checkable
class PatientPeer(Protocol):
    """A peer whose messages may be read later than they arrive, and then all at once."""

    def may_wait(self, t_ns: int) -> bool:
        """Tell whether its messages so far are the same, with the same times, when read later.

        If so, it first does everything that a later `advance` could not do as well.
        """
        ...

    def waits_until_ns(self) -> int:
        """Return a session time before which `may_wait` has nothing to do and returns True."""
        ...

    def arriving(self, until_ns: int) -> Sequence[Message] | None:
        """Return the messages that will have arrived by a coming time, as long as what it measures
        goes on as planned; None where that is not known. It changes nothing.
        """
        ...


class MemoryTransport:
    """Connect a driver to a simulator in the same process, on any clock.

    A blocking call moves a virtual clock by what it waited; `post` and `receive(0)` never do.
    """

    kind = "memory"
    is_simulated = True

    def __init__(self, peer: Peer, clock: Clock) -> None:
        self._peer = peer
        self._patient = peer if isinstance(peer, PatientPeer) else None
        self._clock = clock
        self._topics: tuple[bytes, ...] = ()
        self._replies: deque[Message] = deque()

    def open(self, deadline_s: float) -> None:
        """Let the peer catch up."""
        self._peer.advance(self._clock.now_ns())

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Hand the request to the peer and wait for its reply's arrival time."""
        sent_ns = self._clock.now_ns()
        deadline_ns = sent_ns + round(timeout_s * NS_PER_S)
        reply = self._exchange(frames, sent_ns)
        if reply is None or reply.t_host_ns > deadline_ns:
            self._clock.sleep_until_ns(deadline_ns)
            raise DeviceTimeout(f"no answer to {frames[0][:40]!r} within {timeout_s:g} s")
        self._clock.sleep_until_ns(reply.t_host_ns)
        return Exchange(reply.frames, sent_ns, reply.t_host_ns)

    def post(self, frames: Frames) -> None:
        """Hand the request to the peer; its reply waits for its arrival time."""
        reply = self._exchange(frames, self._clock.now_ns())
        if reply is not None:
            self._replies.append(reply)

    def subscribe(self, port: int, topics: Sequence[bytes]) -> None:
        """Take messages of these topics from now on; earlier ones are gone."""
        self._topics = tuple(topics)
        now_ns = self._clock.now_ns()
        self._peer.advance(now_ns)
        self._peer.outgoing(now_ns)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the messages that have arrived, in order of arrival."""
        messages = self._take_arrived(self._clock.now_ns())
        if messages or timeout_s <= 0:
            return messages
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while not messages and (now_ns := self._clock.now_ns()) < deadline_ns:
            self._clock.sleep_until_ns(min(now_ns + REAL_TIME_STEP_NS, deadline_ns))
            messages = self._take_arrived(self._clock.now_ns())
        return messages

    def put_off(self) -> bool:
        """Tell whether the messages so far may wait for a later `receive`.

        Answers to a `post` may not: `answers` returns them when they have arrived.
        """
        patient = self._patient
        return patient is not None and patient.may_wait(self._clock.now_ns())

    def put_off_until_ns(self) -> int:
        """Return a session time before which `put_off` and `answers` have nothing to do, and
        `put_off` returns True.
        """
        if self._patient is None:
            return 0
        until_ns = self._patient.waits_until_ns()
        return min(until_ns, self._replies[0].t_host_ns) if self._replies else until_ns

    def arriving(self, until_ns: int) -> Sequence[Message] | None:
        """Return what `receive` will return by a coming time, without answers; None: not known."""
        messages = None if self._patient is None else self._patient.arriving(until_ns)
        if messages is None:
            return None
        topics = self._topics
        return [m for m in messages if m.frames[0].startswith(topics)] if topics else []

    def answers(self) -> Sequence[Message]:
        """Return the answers to `post` that have arrived, without other messages."""
        now_ns, messages = self._clock.now_ns(), []
        while self._replies and self._replies[0].t_host_ns <= now_ns:
            messages.append(self._replies.popleft())
        return messages

    def send(self, port: int, frames: Frames) -> None:
        """Hand the message to the peer."""
        self._peer.accept(frames, self._clock.now_ns())

    def close(self) -> None:
        """Forget messages under way."""
        self._topics = ()
        self._replies.clear()

    def _exchange(self, frames: Frames, sent_ns: int) -> Message | None:
        self._peer.advance(sent_ns)
        reached_ns = sent_ns + self._peer.leg_ns()
        answer = self._peer.handle_request(frames, reached_ns)
        if answer is None:
            return None
        return Message(reached_ns + self._peer.leg_ns(), answer, sent_ns)

    def _take_arrived(self, now_ns: int) -> Sequence[Message]:
        self._peer.advance(now_ns)
        all_messages = self._peer.outgoing(now_ns)
        topics = self._topics
        messages = [m for m in all_messages if m.frames[0].startswith(topics)] if topics else []
        if self._replies and self._replies[0].t_host_ns <= now_ns:
            messages += self.answers()
            messages.sort(key=lambda message: message.t_host_ns)
        return messages


class ZmqTransport:
    """Speak to a real device, or to a hosted simulator, over ZeroMQ on TCP.

    Replies that never come do not block the request channel (REQ_RELAXED), and a late reply is
    never taken for the next one's (REQ_CORRELATE).
    """

    def __init__(
        self, host: str, port: int, clock: Clock, *, remedy: str = "", is_simulated: bool = False
    ) -> None:
        self.is_simulated = is_simulated
        self._host = host
        self._port = port
        self._clock = clock
        self._remedy = remedy
        self._zmq: Any = None
        self._context: Any = None
        self._requests: Any = None
        self._subscriber: Any = None
        self._poller: Any = None
        self._publishers: dict[int, Any] = {}
        self._posted_ns: int | None = None

    @property
    def kind(self) -> str:
        """Name the endpoint."""
        return f"zmq tcp://{self._host}:{self._port}"

    def open(self, deadline_s: float) -> None:
        """Import pyzmq and connect; ZeroMQ connects in the background."""
        zmq = ZMQ.imported()
        self.close()
        self._zmq = zmq
        self._context = zmq.Context()
        self._poller = zmq.Poller()
        socket = self._context.socket(zmq.REQ)
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.REQ_RELAXED, 1)
        socket.setsockopt(zmq.REQ_CORRELATE, 1)
        socket.connect(f"tcp://{self._host}:{self._port}")
        self._requests = socket
        self._poller.register(socket, zmq.POLLIN)

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Send and wait; drops the answer to an earlier `post`."""
        self._posted_ns = None
        sent_ns = self._clock.now_ns()
        self._requests.setsockopt(self._zmq.RCVTIMEO, max(1, round(timeout_s * 1e3)))
        self._requests.setsockopt(self._zmq.SNDTIMEO, max(1, round(timeout_s * 1e3)))
        try:
            self._requests.send_multipart(frames)
            answer = self._requests.recv_multipart()
        except self._zmq.Again as cause:
            raise DeviceTimeout(
                f"{self.kind} did not answer {frames[0][:40]!r} within {timeout_s:g} s",
                remedy=self._remedy,
            ) from cause
        return Exchange(tuple(answer), sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Send without waiting; a send that would block counts as never answered."""
        self._posted_ns = self._clock.now_ns()
        try:
            self._requests.send_multipart(frames, self._zmq.DONTWAIT)
        except self._zmq.Again:
            self._posted_ns = None

    def subscribe(self, port: int, topics: Sequence[bytes]) -> None:
        """Connect a subscriber with a raised high-water mark."""
        if self._subscriber is not None:
            self._poller.unregister(self._subscriber)
            self._subscriber.close(0)
        socket = self._context.socket(self._zmq.SUB)
        socket.setsockopt(self._zmq.LINGER, 0)
        socket.setsockopt(self._zmq.RCVHWM, RECEIVE_HIGH_WATER_MARK)
        socket.connect(f"tcp://{self._host}:{port}")
        for topic in topics:
            socket.setsockopt(self._zmq.SUBSCRIBE, topic)
        self._subscriber = socket
        self._poller.register(socket, self._zmq.POLLIN)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Drain both channels; stamps are taken when a message is read."""
        ready = dict(self._poller.poll(timeout_s * 1e3))
        messages: list[Message] = []
        if self._requests in ready:
            answer = tuple(self._requests.recv_multipart())  # a second read is refused by REQ
            if self._posted_ns is not None:
                messages.append(Message(self._clock.now_ns(), answer, self._posted_ns))
                self._posted_ns = None
        if self._subscriber is not None and self._subscriber in ready:
            self._drain(messages)
        return messages

    def send(self, port: int, frames: Frames) -> None:
        """Publish; the first message to a port only makes ZeroMQ connect and may be lost."""
        if port not in self._publishers:
            socket = self._context.socket(self._zmq.PUB)
            socket.setsockopt(self._zmq.LINGER, 0)
            socket.connect(f"tcp://{self._host}:{port}")
            self._publishers[port] = socket
        self._publishers[port].send_multipart(frames)

    def close(self) -> None:
        """Close the sockets and the context."""
        sockets = [self._requests, self._subscriber, *self._publishers.values()]
        for socket in sockets:
            if socket is not None:
                socket.close(0)
        if self._context is not None:
            self._context.term()
        self._context = self._requests = self._subscriber = self._poller = None
        self._publishers = {}
        self._posted_ns = None

    def _drain(self, messages: list[Message]) -> None:
        receive, again = self._subscriber.recv_multipart, self._zmq.Again
        while True:
            try:
                frames = tuple(receive(self._zmq.DONTWAIT))
            except again:
                return
            messages.append(Message(self._clock.now_ns(), frames))

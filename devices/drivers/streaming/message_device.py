"""The common part of drivers on a message wire: open, start, stop, close, faults."""

import struct
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import msgpack

from visavis.devices.contracts import DeviceState, Fault, Sink
from visavis.devices.lifecycle import HasLife, Lifecycle
from visavis.devices.spec import AnySpec
from visavis.devices.transports import Exchange, Frames, Message, MessageTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceError, DeviceTimeout, ProtocolViolation

ATTEMPT_EVERY_NS = 500 * NS_PER_MS
"""How often a driver tries to reach a peer that is gone; less often where samples are rare."""

UNREADABLE = (
    struct.error,
    msgpack.UnpackException,
    ValueError,
    TypeError,
    LookupError,
    OverflowError,
    AttributeError,
)
"""Errors that reading a malformed answer can raise."""


@contextmanager
def legible(what: str, remedy: str) -> Iterator[None]:
    """Turn errors while reading a peer's answer into a ProtocolViolation."""
    try:
        yield
    except UNREADABLE as cause:
        raise ProtocolViolation(f"cannot read {what}: {cause}", remedy=remedy) from cause


def with_role(problem: DeviceError, role: str, remedy: str) -> DeviceError:
    """Return the problem with the role's name, and with `remedy` where it has none."""
    if problem.role and problem.remedy:
        return problem
    message = str(problem).removesuffix(f"; {problem.remedy}").removeprefix(f"{problem.role}: ")
    return type(problem)(message, role=role, remedy=problem.remedy or remedy)


class MessageDevice(HasLife, ABC):
    """Open a wire, say hello, deliver to a sink, close; a driver adds the messages."""

    def __init__(self, role: str, transport: MessageTransport, clock: Clock, spec: AnySpec) -> None:
        self._transport = transport
        self._clock = clock
        self._spec = spec
        self._life = Lifecycle(role)
        self._sink: Sink | None = None
        self._attempt_ns = 0
        self._attempt_every_ns = ATTEMPT_EVERY_NS
        self.info = spec.info(role, transport)

    # ---- what a driver adds -----------------------------------------------------------------

    @abstractmethod
    def _connect(self, deadline_ns: int) -> None:
        """Say hello on the open wire: identity, version, streams. Raises DeviceError."""

    def _prepare(self) -> None:
        """Forget an earlier connection; for `open`."""
        return

    def _subscribe(self) -> None:
        """Subscribe to the messages that the peer sends by itself, before `_connect`."""
        return

    def _begin_stream(self, earlier: Sequence[Message]) -> None:
        """Prepare for `start`, before any delivery; `earlier` are the messages before it."""
        return

    @abstractmethod
    def _reset(self, now_ns: int) -> None:
        """Reset all counts; for `start`."""

    # ---- the contract -----------------------------------------------------------------------

    def open(self, deadline_s: float) -> None:
        """Open the wire and say hello; raises DeviceError with a remedy."""
        self._life.require("open", DeviceState.CLOSED)
        deadline_ns = self._clock.now_ns() + round(deadline_s * NS_PER_S)
        self._prepare()
        try:
            self._transport.open(deadline_s)
            self._subscribe()
            self.info = replace(
                self.info,
                transport=self._transport.kind,
                is_simulated=self._transport.is_simulated,
            )
            with legible("what it answered when it was opened", self._spec.remedy):
                self._connect(deadline_ns)
        except DeviceError as problem:
            self._transport.close()
            raise with_role(problem, self.info.role, self._spec.remedy) from problem
        self._life.state = DeviceState.OPEN

    def start(self, sink: Sink) -> None:
        """Begin delivering; earlier messages are dropped."""
        self._life.require("start", DeviceState.OPEN)
        earlier = self._transport.receive(0.0)
        self._reset(self._clock.now_ns())
        self._begin_stream(earlier)
        self._sink = sink
        self._life.state = DeviceState.STREAMING

    def close(self) -> None:
        """Close the wire; idempotent."""
        self._sink = None
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    # ---- for drivers ------------------------------------------------------------------------

    def _ask(self, frames: Frames, deadline_ns: int) -> Exchange:
        """Send a request and wait; raises DeviceTimeout with the remedy."""
        left_s = max(0.001, (deadline_ns - self._clock.now_ns()) / NS_PER_S)
        try:
            return self._transport.request(frames, left_s)
        except DeviceTimeout as cause:
            raise DeviceTimeout(
                "nobody answered in time", role=self.info.role, remedy=self._spec.remedy
            ) from cause

    def _attempt_is_due(self) -> bool:
        """Tell whether an attempt to reach a lost peer is due, and note the attempt if so."""
        now_ns = self._clock.now_ns()
        if now_ns < self._attempt_ns:
            return False
        self._attempt_ns = now_ns + self._attempt_every_ns
        return True

    def _warning(self, message: str, remedy: str) -> Fault:
        return Fault(self.info.role, "warning", message, remedy)

    def _uncalibrated(self, message: str, remedy: str) -> Fault:
        return Fault(self.info.role, "warning", message, remedy, is_uncalibrated=True)

    def _blocking(self, message: str, remedy: str) -> Fault:
        return Fault(self.info.role, "blocking", message, remedy)

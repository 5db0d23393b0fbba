"""One device's wire to the OpenXR session that it shares with others."""

from collections.abc import Sequence
from typing import Protocol

from visavis.devices.transports import Exchange, Frames, Message, OnlyListening
from visavis.lab.clock import Clock


class SharedSession(Protocol):
    """The part of the session's owner that a wire uses."""

    @property
    def clock(self) -> Clock:
        """The session's clock."""
        ...

    @property
    def is_simulated(self) -> bool:
        """Whether our simulated runtime answers."""
        ...

    def attach(self, user: "OpenXrTransport", deadline_s: float) -> None:
        """Begin the session when it is the first."""
        ...

    def detach(self, user: "OpenXrTransport") -> None:
        """End the session when it is the last."""
        ...

    def call(self, frames: Frames) -> Frames:
        """Perform one call; errors of the runtime are named in the answer."""
        ...


class OpenXrTransport(OnlyListening):
    """One device's wire to the shared session; follows `MessageTransport`."""

    kind = "openxr"

    def __init__(self, library: SharedSession) -> None:
        self._library = library
        self._clock = library.clock

    @property
    def is_simulated(self) -> bool:
        """Tell whether our simulated runtime answers; known once open."""
        return self._library.is_simulated

    def open(self, deadline_s: float) -> None:
        """Begin the session."""
        self._library.attach(self, deadline_s)

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Make a call and return what the runtime answered."""
        sent_ns = self._clock.now_ns()
        answer = self._library.call(frames)
        return Exchange(answer, sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Make a call and ignore its answer."""
        self._library.call(frames)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return nothing: the session's events are dealt with here."""
        return []

    def close(self) -> None:
        """Leave the session; the last one ends it."""
        self._library.detach(self)

"""Layers between a driver and its wire: none, a log being written, or a log played back."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

from visavis.devices.byte_links import ByteLink
from visavis.devices.transports import MessageTransport
from visavis.devices.wirelog import ReplayLink, ReplayTransport, TeeLink, TeeTransport
from visavis.lab.clock import Clock


class Wires(Protocol):
    """Provide the wire of the device that fills a role; `make` makes the one configured."""

    def messages(self, role: str, make: Callable[[], MessageTransport]) -> MessageTransport:
        """Return the message wire a driver gets."""
        ...

    def link(self, role: str, make: Callable[[], ByteLink]) -> ByteLink:
        """Return the byte link a driver gets."""
        ...


class BareWires:
    """Leave every wire as it is."""

    def messages(self, role: str, make: Callable[[], MessageTransport]) -> MessageTransport:
        """Return the wire itself."""
        return make()

    def link(self, role: str, make: Callable[[], ByteLink]) -> ByteLink:
        """Return the link itself."""
        return make()


class CapturedWires:
    """Write everything that crosses one role's wire to a `.wire` file."""

    def __init__(self, role: str, path: Path, clock: Clock, note: Mapping[str, Any]) -> None:
        self._role = role
        self._path = path
        self._clock = clock
        self._note = note
        self._link: TeeLink | None = None
        self.is_captured = False

    def messages(self, role: str, make: Callable[[], MessageTransport]) -> MessageTransport:
        """Return a tee for the role, the wire itself for others."""
        wire = make()
        if role != self._role:
            return wire
        self.is_captured = True
        return TeeTransport(wire, self._path, self._clock, self._note)

    def link(self, role: str, make: Callable[[], ByteLink]) -> ByteLink:
        """Return a tee for the role, the link itself for others."""
        link = make()
        if role != self._role:
            return link
        self.is_captured = True
        self._link = TeeLink(link, self._path, self._clock, self._note)
        return self._link

    def end(self) -> None:
        """Close the file where it outlives a connection; idempotent."""
        if self._link is not None:
            self._link.end()


class ReplayedWires:
    """Play one `.wire` file to the driver that is built; no wire is made."""

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path = path
        self._clock = clock
        self.playing: ReplayTransport | ReplayLink | None = None

    def messages(self, role: str, make: Callable[[], MessageTransport]) -> MessageTransport:
        """Return the replay of a message wire."""
        replay = ReplayTransport(self._path, self._clock)
        self.playing = replay
        return replay

    def link(self, role: str, make: Callable[[], ByteLink]) -> ByteLink:
        """Return the replay of a byte link."""
        replay = ReplayLink(self._path, self._clock)
        self.playing = replay
        return replay


BARE = BareWires()

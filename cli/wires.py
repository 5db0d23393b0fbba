"""What stands between a driver and its wire: nothing, a log being written, or a log played back."""

from pathlib import Path
from typing import Protocol

from devices.byte_links import ByteLink
from devices.byte_wirelog import ReplayLink, TeeLink
from devices.transports import MessageTransport
from devices.wirelog import ReplayTransport, TeeTransport
from lab.clock import Clock


class Wires(Protocol):
    """Put something on the wire of the device that fills a role."""

    def messages(self, role: str, wire: MessageTransport) -> MessageTransport:
        """Return what the driver gets instead of a message wire."""
        ...

    def link(self, role: str, link: ByteLink) -> ByteLink:
        """Return what the driver gets instead of a byte link."""
        ...


class BareWires:
    """Leave every wire as it is."""

    def messages(self, role: str, wire: MessageTransport) -> MessageTransport:
        """Return the wire itself."""
        return wire

    def link(self, role: str, link: ByteLink) -> ByteLink:
        """Return the link itself."""
        return link


class CapturedWires:
    """Write everything that crosses a role's wire to that role's `.wire` file."""

    def __init__(self, paths: dict[str, Path], clock: Clock) -> None:
        self._paths = paths
        self._clock = clock
        self._links: list[TeeLink] = []
        self.captured: set[str] = set()

    def messages(self, role: str, wire: MessageTransport) -> MessageTransport:
        """Return a tee for a role that has a file."""
        if role not in self._paths:
            return wire
        self.captured.add(role)
        return TeeTransport(wire, self._paths[role], self._clock)

    def link(self, role: str, link: ByteLink) -> ByteLink:
        """Return a tee for a role that has a file."""
        if role not in self._paths:
            return link
        self.captured.add(role)
        tee = TeeLink(link, self._paths[role], self._clock)
        self._links.append(tee)
        return tee

    def end(self) -> None:
        """Close the files that outlive a connection; idempotent."""
        for link in self._links:
            link.end()


class ReplayedWires:
    """Give every driver the `.wire` file of its role; the real wire is never touched."""

    def __init__(self, paths: dict[str, Path], clock: Clock) -> None:
        self._paths = paths
        self._clock = clock
        self.playing: dict[str, ReplayTransport | ReplayLink] = {}

    def messages(self, role: str, wire: MessageTransport) -> MessageTransport:
        """Return the replay of a message wire."""
        replay = ReplayTransport(self._paths[role], self._clock)
        self.playing[role] = replay
        return replay

    def link(self, role: str, link: ByteLink) -> ByteLink:
        """Return the replay of a byte link."""
        replay = ReplayLink(self._paths[role], self._clock)
        self.playing[role] = replay
        return replay


BARE = BareWires()

"""Carry bytes between a driver and its device: the contract of such a link, and memory.

A real link (serial port, Bluetooth) and a simulated one carry the same bytes; every chunk bears
its own arrival time, so a driver cannot tell simulation from a cable.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock


class Chunk(NamedTuple):
    """Bytes that arrived together, and when by the session clock."""

    t_host_ns: int
    data: bytes


class ByteLink(Protocol):
    """An ordered two-way stream of bytes, cut anywhere.

    `write` may be called from one thread while another is in `read`.
    """

    @property
    def kind(self) -> str:
        """Name for the manifest: "serial COM4 57600", "ble AA:BB", "memory", "replay"."""
        ...

    @property
    def is_simulated(self) -> bool:
        """Tell whether a simulator is known to sit at the other end."""
        ...

    def open(self, deadline_s: float) -> None:
        """Connect; a second call after `close` connects anew.

        Raises DeviceNotFound when there is nobody, DeviceTimeout when it takes too long.
        """
        ...

    def write(self, data: bytes) -> int:
        """Hand over all bytes and return the session time at which the last one was taken.

        Raises DeviceDisconnected when the peer is gone, DeviceTimeout when it takes nothing.
        """
        ...

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return everything that has arrived; wait at most `timeout_s` for the first byte.

        Raises DeviceDisconnected once the peer is gone.
        """
        ...

    def close(self) -> None:
        """Release the link; idempotent, never raises."""
        ...


class BytePeer(Protocol):
    """The other end of a memory link: what a simulator of a byte device offers."""

    def connect(self, t_ns: int) -> None:
        """Take a new connection; raises DeviceNotFound while the device is away."""
        ...

    def accept(self, data: bytes, t_ns: int) -> None:
        """Take bytes that the host hands over at this session time."""
        ...

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Perform everything due up to this time; return the chunks that have arrived at the host.

        Raises DeviceDisconnected while the device is away.
        """
        ...


@runtime_checkable
class ForeseeingPeer(Protocol):
    """A peer that knows until when nothing of it can reach the host."""

    def quiet_until_ns(self, now_ns: int) -> int:
        """Return until when the host hears nothing unless it writes; `now_ns` where unknown."""
        ...


class MemoryLink:
    """Connect a driver to a simulator in the same process, on any clock.

    `read` moves a virtual clock by what it waited; `read(0)` and `write` never do.
    """

    kind = "memory"
    is_simulated = True

    def __init__(self, peer: BytePeer, clock: Clock) -> None:
        self._peer = peer
        self._foreseen = peer if isinstance(peer, ForeseeingPeer) else None
        self._clock = clock

    def open(self, deadline_s: float) -> None:
        """Connect to the peer."""
        self._peer.connect(self._clock.now_ns())

    def write(self, data: bytes) -> int:
        """Hand the bytes to the peer."""
        now_ns = self._clock.now_ns()
        self._peer.accept(data, now_ns)
        return now_ns

    def read(self, timeout_s: float) -> Sequence[Chunk]:
        """Return the chunks that have arrived, in order of arrival."""
        chunks = self._peer.outgoing(self._clock.now_ns())
        if chunks or timeout_s <= 0:
            return chunks
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while not chunks and (now_ns := self._clock.now_ns()) < deadline_ns:
            self._clock.sleep_until_ns(min(now_ns + NS_PER_MS, deadline_ns))
            chunks = self._peer.outgoing(self._clock.now_ns())
        return chunks

    def quiet_until_ns(self, now_ns: int) -> int:
        """Return until when nothing can arrive unless something is written."""
        return now_ns if self._foreseen is None else self._foreseen.quiet_until_ns(now_ns)

    def close(self) -> None:
        """Do nothing: the peer keeps its own time."""

"""Carry single datagrams between a driver and its device over UDP.

It follows `visavis.devices.transports.MessageTransport`: a message is one datagram, a request is
one sent to the device, and whatever comes back turns up in `receive`. In memory the same bytes
travel by `visavis.devices.transports.MemoryTransport`.
"""

import contextlib
import select
import socket
from collections.abc import Sequence

from visavis.devices.transports import Exchange, Frames, Message, NoTopics
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceError, DeviceNotFound

RECEIVE_BUFFER_BYTES = 4 * 1024 * 1024
MAX_DATAGRAM = 65_535
MAX_AT_ONCE = 1000
"""Datagrams taken in one `receive`, so that a flood cannot hold the caller."""


class UdpTransport(NoTopics):
    """Receive datagrams on one port, and on a multicast group if one is named.

    `peer` is where `post` and `send` send to; None for a device that only streams. Replies to what
    was sent come back to the same socket.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        local_port: int = 0,
        local_address: str = "",
        peer: tuple[str, int] | None = None,
        group: tuple[str, int] | None = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._clock = clock
        self._local = (local_address, local_port)
        self._peer = peer
        self._group = group
        self._sockets: list[socket.socket] = []

    @property
    def kind(self) -> str:
        """Name the port and the peer."""
        peer = "" if self._peer is None else f" peer {self._peer[0]}:{self._peer[1]}"
        return f"udp port {self.port}{peer}"

    @property
    def port(self) -> int:
        """The local port: as bound once open."""
        return int(self._sockets[0].getsockname()[1]) if self._sockets else self._local[1]

    def open(self, deadline_s: float) -> None:
        """Bind; raises DeviceNotFound when the port is taken or the address is not ours."""
        self.close()
        try:
            self._sockets.append(self._bind(self._local))
            if self._group is not None:
                member = self._bind(("", self._group[1]))
                self._sockets.append(member)
                ours = self._local[0] or "0.0.0.0"  # noqa: S104 - any interface may hear the group
                membership = socket.inet_aton(self._group[0]) + socket.inet_aton(ours)
                member.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        except OSError as cause:
            self.close()
            raise DeviceNotFound(
                f"cannot listen on UDP port {self._local[1]}: {cause.strerror or cause}",
                remedy="close the program that uses this port, or configure another port",
            ) from cause

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Raise: the answer to a datagram comes by `receive`."""
        raise DeviceError("UDP has no requests", remedy="use post and receive")

    def post(self, frames: Frames) -> None:
        """Send one datagram; one that cannot leave counts as lost."""
        if self._peer is not None and self._sockets:
            with contextlib.suppress(OSError):  # unreachable now; the pump reports the silence
                self._sockets[0].sendto(frames[0], self._peer)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the datagrams that arrived, stamped when read."""
        if not self._sockets:
            return []
        ready, _, _ = select.select(self._sockets, (), (), max(0.0, timeout_s))
        messages: list[Message] = []
        for source in ready:
            while len(messages) < MAX_AT_ONCE:
                try:
                    data = source.recv(MAX_DATAGRAM)
                except BlockingIOError:
                    break
                except ConnectionError:  # Windows reports here that an earlier send was refused
                    continue
                messages.append(Message(self._clock.now_ns(), (data,)))
        messages.sort(key=lambda message: message.t_host_ns)
        return messages

    def send(self, port: int, frames: Frames) -> None:
        """Send one datagram to the peer, whatever the port."""
        self.post(frames)

    def close(self) -> None:
        """Close the sockets; idempotent."""
        for each in self._sockets:
            each.close()
        self._sockets = []

    def _bind(self, address: tuple[str, int]) -> socket.socket:
        udp_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            udp_socket.setsockopt(
                socket.SOL_SOCKET, socket.SO_REUSEADDR, int(self._group is not None)
            )
            udp_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
            udp_socket.setblocking(False)
            udp_socket.bind(address)
        except OSError:
            udp_socket.close()
            raise
        return udp_socket

"""A computer with several networks listens to Motive on the one that was named."""

import socket
from typing import ClassVar

from visavis.devices.drivers.natnet.spec import NATNET
from visavis.devices.registry import driver_wiring
from visavis.devices.wiring import Site
from visavis.lab.clock import SystemClock


class Joined(socket.socket):
    """A socket that notes which group it joins, and by which of this computer's addresses."""

    groups: ClassVar[list[tuple[str, str]]] = []

    def setsockopt(self, level, option, value):  # type: ignore[no-untyped-def, override]
        if (level, option) == (socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP):
            self.groups.append((socket.inet_ntoa(value[:4]), socket.inet_ntoa(value[4:])))
        else:
            super().setsockopt(level, option, value)


def test_the_group_is_joined_and_motive_asked_by_the_address_that_was_named(monkeypatch):
    monkeypatch.setattr(socket, "socket", Joined)
    options = NATNET.checked_options(
        "body_tracker", {"local_address": "127.0.0.1", "data_port": 15711}
    )
    wire = driver_wiring("natnet").real(Site(NATNET, "body_tracker", SystemClock(), options))

    wire.open(1.0)
    asked_from = wire._sockets[0].getsockname()[0]
    wire.close()

    assert Joined.groups == [("239.255.42.99", "127.0.0.1")]
    assert asked_from == "127.0.0.1"

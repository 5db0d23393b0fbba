"""Xsens MVN: its options, its wire, its simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from visavis.devices.options import StreamOptions
from visavis.devices.spec import DriverSpec, Site, driven_by, streamed_by

if TYPE_CHECKING:
    from visavis.devices.transports import MessageTransport


class XsensOptions(StreamOptions):
    """Options of `xsens`: the port MVN sends to, and which of its characters."""

    of_wire = frozenset({"port"})

    port: int = Field(default=9763, ge=1, le=65535)
    rate_hz: float = Field(default=240.0, ge=1, le=2000)
    character: int = Field(default=0, ge=0, le=255)


Here = Site[XsensOptions]


def _streamer(site: Here) -> "MessageTransport":
    from visavis.devices.datagrams import UdpTransport

    return UdpTransport(site.clock, local_port=site.options.port)


XSENS = DriverSpec(
    name="xsens",
    kind="body tracker",
    options=XsensOptions,
    make=driven_by("visavis.devices.drivers.xsens.driver:XsensMvn"),
    real=_streamer,
    simulated=streamed_by("visavis.devices.sim.xsens:XsensSimulator"),
    vendor="Movella",
    model="Xsens MVN",
    wire="UDP",
    remedy="in MVN's network streamer add this computer and port, choose Position + Orientation "
    "(Quaternion), and let UDP through the firewall",
    listens=("UDP {port}",),
    binds="port",
    stands_for="Xsens MVN",
    checked="our reading of the vendor's document and public parsers; UDP",
    unproven="MVN's axes per message type",
)
SPECS = (XSENS,)

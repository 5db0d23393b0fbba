"""OptiTrack Motive: its options, its wire, its simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from devices.options import StreamOptions
from devices.spec import DriverSpec, Site

if TYPE_CHECKING:
    from devices.drivers.natnet.driver import NatNet
    from devices.transports import MessageTransport


class NatNetOptions(StreamOptions):
    """Options of `natnet`: Motive's computer; without a group the stream is unicast."""

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=1510, ge=1, le=65535)
    multicast_group: str = "239.255.42.99"
    data_port: int = Field(default=1511, ge=1, le=65535)
    bodies: dict[str, str] = Field(default_factory=dict)
    skeleton: str = ""
    yaw_deg: float = Field(
        default=180.0, ge=-360, le=360, json_schema_extra={"any_magnitude": True}
    )


Here = Site[NatNetOptions]


def _motive(site: Here) -> "MessageTransport":
    from devices.datagrams import UdpTransport

    options = site.options
    group = options.multicast_group
    return UdpTransport(
        site.clock,
        peer=(options.address, options.port),
        group=(group, options.data_port) if group else None,
    )


def _simulated_motive(site: Here) -> "MessageTransport":
    from devices.drivers.natnet.driver import MOTIVE_BONES
    from devices.sim.natnet import NatNetSimulator

    bodies = site.options.bodies
    return site.streamed(
        NatNetSimulator,
        site.moving,
        bodies=bodies or MOTIVE_BONES,
        skeleton="" if bodies else site.options.skeleton or "Participant",
    )


def _natnet(site: Here, wire: "MessageTransport") -> "NatNet":
    from devices.drivers.natnet.driver import NatNet

    options = site.options.without("address", "port", "multicast_group", "data_port")
    return NatNet(site.role, wire, site.clock, **options)


NATNET = DriverSpec(
    name="natnet",
    kind="body tracker",
    options=NatNetOptions,
    make=_natnet,
    real=_motive,
    simulated=_simulated_motive,
    vendor="OptiTrack",
    model="Motive",
    wire="UDP",
    remedy="in Motive's streaming settings switch streaming on, with rigid bodies or skeletons "
    "and y up, choose this network, and let UDP 1510 and 1511 through the firewall",
    listens=("UDP {data_port}",),
    binds="data_port",
    stands_for="OptiTrack Motive 3.0–4.2",
    checked="UDP",
    unproven="any Motive; multicast",
)
SPECS = (NATNET,)

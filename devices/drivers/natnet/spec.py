"""OptiTrack Motive: its options, its wire, its simulator."""

from typing import TYPE_CHECKING, Any

from pydantic import Field

from visavis.devices.options import StreamOptions
from visavis.devices.spec import DriverSpec, Site, driven_by, streamed_by

if TYPE_CHECKING:
    from visavis.devices.transports import MessageTransport


class NatNetOptions(StreamOptions):
    """Options of `natnet`: Motive's computer; without a group the stream is unicast."""

    of_wire = frozenset({"address", "port", "multicast_group", "data_port", "local_address"})

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=1510, ge=1, le=65535)
    multicast_group: str = "239.255.42.99"
    data_port: int = Field(default=1511, ge=1, le=65535)
    local_address: str = ""
    """This computer's address on Motive's network; needed where it has several."""
    bodies: dict[str, str] = Field(default_factory=dict)
    skeleton: str = ""
    yaw_deg: float = Field(
        default=180.0, ge=-360, le=360, json_schema_extra={"any_magnitude": True}
    )

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift and what moves: the bodies named, or a skeleton."""
        from visavis.devices.drivers.natnet.driver import MOTIVE_BONES

        skeleton = "" if self.bodies else self.skeleton or "Participant"
        bodies = self.bodies or MOTIVE_BONES
        return {**super().for_simulator(), "bodies": bodies, "skeleton": skeleton}


Here = Site[NatNetOptions]


def _motive(site: Here) -> "MessageTransport":
    from visavis.devices.datagrams import UdpTransport

    options = site.options
    group = options.multicast_group
    return UdpTransport(
        site.clock,
        local_address=options.local_address,
        peer=(options.address, options.port),
        group=(group, options.data_port) if group else None,
    )


NATNET = DriverSpec(
    name="natnet",
    kind="body tracker",
    options=NatNetOptions,
    make=driven_by("visavis.devices.drivers.natnet.driver:NatNet"),
    real=_motive,
    simulated=streamed_by("visavis.devices.sim.natnet:NatNetSimulator"),
    vendor="OptiTrack",
    model="Motive",
    wire="UDP",
    remedy="in Motive's streaming settings switch streaming on, with rigid bodies or skeletons "
    "and y up, choose this network, and let UDP 1510 and 1511 through the firewall",
    listens=("UDP {data_port}",),
    binds="data_port",
    stands_for="OptiTrack Motive 3.0–4.2",
    checked="our reading of the vendor's SDK; UDP",
    unproven="any Motive; multicast",
)
SPECS = (NATNET,)

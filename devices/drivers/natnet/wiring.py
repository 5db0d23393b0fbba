"""OptiTrack Motive: its driver on UDP, and its simulator."""

from visavis.devices.datagrams import UdpTransport
from visavis.devices.drivers.natnet.driver import NatNet
from visavis.devices.drivers.natnet.spec import NATNET, NatNetOptions
from visavis.devices.sim.natnet import NatNetSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streamed_by


def _motive(site: Site[NatNetOptions]) -> MessageTransport:
    options = site.options
    group = options.multicast_group
    return UdpTransport(
        site.clock,
        local_address=options.local_address,
        peer=(options.address, options.port),
        group=(group, options.data_port) if group else None,
    )


WIRINGS = (
    Wiring(
        NATNET,
        make=driven_by(NatNet),
        real=_motive,
        simulated=streamed_by(NatNetSimulator),
    ),
)

"""Vicon Tracker: its driver on UDP, and its simulator."""

from visavis.devices.datagrams import UdpTransport
from visavis.devices.drivers.vicon.driver import Vicon
from visavis.devices.drivers.vicon.spec import VICON, ViconOptions
from visavis.devices.sim.vicon import ViconSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streamed_by


def _object_stream(site: Site[ViconOptions]) -> MessageTransport:
    return UdpTransport(site.clock, local_port=site.options.port)


WIRINGS = (
    Wiring(
        VICON, make=driven_by(Vicon), real=_object_stream, simulated=streamed_by(ViconSimulator)
    ),
)

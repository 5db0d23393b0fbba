"""Xsens MVN: its driver on UDP, and its simulator."""

from visavis.devices.datagrams import UdpTransport
from visavis.devices.drivers.xsens.driver import XsensMvn
from visavis.devices.drivers.xsens.spec import XSENS, XsensOptions
from visavis.devices.sim.xsens import XsensSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streamed_by


def _network_streamer(site: Site[XsensOptions]) -> MessageTransport:
    return UdpTransport(site.clock, local_port=site.options.port)


WIRINGS = (
    Wiring(
        XSENS,
        make=driven_by(XsensMvn),
        real=_network_streamer,
        simulated=streamed_by(XsensSimulator),
    ),
)

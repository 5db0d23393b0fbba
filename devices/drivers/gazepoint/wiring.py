"""Gazepoint: its driver on a socket, and its simulator."""

from visavis.devices.drivers.gazepoint.driver import Gazepoint
from visavis.devices.drivers.gazepoint.spec import GAZEPOINT
from visavis.devices.drivers.links.stream_socket import StreamSocket
from visavis.devices.sim.gazepoint import GazepointSimulator
from visavis.devices.wiring import Wiring, driven_by, streamed_by, wired_by

WIRINGS = (
    Wiring(
        GAZEPOINT,
        make=driven_by(Gazepoint),
        real=wired_by(StreamSocket, "address", "port", remedy=GAZEPOINT.remedy),
        simulated=streamed_by(GazepointSimulator),
    ),
)

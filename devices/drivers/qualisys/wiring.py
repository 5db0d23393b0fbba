"""Qualisys Track Manager: its driver on a socket, and its simulator."""

from visavis.devices.drivers.links.stream_socket import StreamSocket
from visavis.devices.drivers.qualisys.driver import Qualisys
from visavis.devices.drivers.qualisys.spec import QUALISYS
from visavis.devices.sim.qualisys import QualisysSimulator
from visavis.devices.wiring import Wiring, driven_by, streamed_by, wired_by

WIRINGS = (
    Wiring(
        QUALISYS,
        make=driven_by(Qualisys),
        real=wired_by(StreamSocket, "address", "port", remedy=QUALISYS.remedy),
        simulated=streamed_by(QualisysSimulator),
    ),
)

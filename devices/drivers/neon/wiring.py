"""Neon: its driver on the phone's network interface, and its simulator."""

from visavis.devices.drivers.neon.driver import Neon
from visavis.devices.drivers.neon.network import NeonNetwork
from visavis.devices.drivers.neon.spec import NEON
from visavis.devices.sim.neon import NeonSimulator
from visavis.devices.wiring import Wiring, driven_by, streamed_by, wired_by

WIRINGS = (
    Wiring(
        NEON,
        make=driven_by(Neon),
        real=wired_by(NeonNetwork, "address", "port", remedy=NEON.remedy),
        simulated=streamed_by(NeonSimulator),
    ),
)

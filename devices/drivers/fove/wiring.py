"""FOVE: its driver on the vendor's library, and its simulator."""

from visavis.devices.drivers.fove.driver import Fove
from visavis.devices.drivers.fove.library import FoveLibrary
from visavis.devices.drivers.fove.spec import FOVE
from visavis.devices.sim.fove import FoveSimulator
from visavis.devices.wiring import Wiring, driven_by, streamed_by, wired_by

WIRINGS = (
    Wiring(
        FOVE,
        make=driven_by(Fove),
        real=wired_by(FoveLibrary, "library_path"),
        simulated=streamed_by(FoveSimulator),
    ),
)

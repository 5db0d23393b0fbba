"""Vive Pro Eye: its driver on the vendor's library, and its simulator."""

from visavis.devices.drivers.sranipal.driver import ViveProEye
from visavis.devices.drivers.sranipal.library import SranipalLibrary
from visavis.devices.drivers.sranipal.spec import VIVE_PRO_EYE
from visavis.devices.sim.sranipal import SranipalSimulator
from visavis.devices.wiring import Wiring, driven_by, streamed_by, wired_by

WIRINGS = (
    Wiring(
        VIVE_PRO_EYE,
        make=driven_by(ViveProEye),
        real=wired_by(SranipalLibrary, "library_path"),
        simulated=streamed_by(SranipalSimulator),
    ),
)

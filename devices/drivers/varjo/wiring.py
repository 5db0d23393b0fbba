"""Varjo: its driver on the vendor's library, and its simulator."""

from visavis.devices.drivers.varjo.driver import Varjo
from visavis.devices.drivers.varjo.library import VarjoLibrary
from visavis.devices.drivers.varjo.spec import VARJO, VarjoOptions
from visavis.devices.sim.varjo import VarjoSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streamed_by


def _library(site: Site[VarjoOptions]) -> MessageTransport:
    options = site.options
    return VarjoLibrary(options.library_path, site.clock, is_smoothed=options.smoothed)


WIRINGS = (
    Wiring(
        VARJO,
        make=driven_by(Varjo),
        real=_library,
        simulated=streamed_by(VarjoSimulator),
    ),
)

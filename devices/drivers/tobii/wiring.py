"""Tobii Pro: its driver on the maker's SDK, and its simulator."""

from visavis.devices.drivers.tobii.driver import TobiiPro
from visavis.devices.drivers.tobii.library import TobiiSdk
from visavis.devices.drivers.tobii.spec import TOBII_PRO, TobiiProOptions
from visavis.devices.sim.lsl.gaze import TittaSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streamed_by


def _sdk(site: Site[TobiiProOptions]) -> MessageTransport:
    return TobiiSdk(site.clock, serial=site.options.serial, rate_hz=site.options.rate_hz)


WIRINGS = (
    Wiring(
        TOBII_PRO,
        make=driven_by(TobiiPro),
        real=_sdk,
        simulated=streamed_by(TittaSimulator),
    ),
)

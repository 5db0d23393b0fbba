"""Devices of an OpenVR runtime: their drivers on the one connection they share; its simulator."""

from typing import Any

from visavis.devices.contracts import Body
from visavis.devices.drivers.openvr.controllers import OpenVrControllers
from visavis.devices.drivers.openvr.headset import OpenVrHeadset
from visavis.devices.drivers.openvr.library import OpenVrLibrary
from visavis.devices.drivers.openvr.spec import (
    OPENVR_CONTROLLERS,
    OPENVR_HEADSET,
    OPENVR_TRACKERS,
    OpenVrTrackersOptions,
)
from visavis.devices.drivers.openvr.trackers import OpenVrTrackers
from visavis.devices.sim.openvr.runtime import SimulatedVrRuntime
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by


def _library(site: Site[Any]) -> OpenVrLibrary:
    """Return the rig's connection to the runtime."""
    if "openvr" not in site.shared:
        site.shared["openvr"] = OpenVrLibrary(site.clock, application="other")
    library: OpenVrLibrary = site.shared["openvr"]
    return library


def _runtime(site: Site[Any], body: Body) -> SimulatedVrRuntime:
    """Return the rig's simulated runtime, started."""
    if "openvr runtime" not in site.shared:
        rate_hz = getattr(site.options, "display_rate_hz", 90.0)
        runtime = SimulatedVrRuntime(
            body,
            site.clock,
            seed=site.seed,
            faults=site.faults,
            display_rate_hz=rate_hz,
            look_ahead_ms=getattr(site.options, "look_ahead_ms", None),
        )
        site.shared["openvr runtime"] = site.stack.enter_context(runtime)
    rig_runtime: SimulatedVrRuntime = site.shared["openvr runtime"]
    return rig_runtime


def _wire(site: Site[Any]) -> MessageTransport:
    return _library(site).transport()


def _simulated_wire(site: Site[Any]) -> MessageTransport:
    _runtime(site, site.watched)
    return _wire(site)


def _showing_wire(site: Site[Any]) -> MessageTransport:
    _library(site).show_images()
    return _wire(site)


def _simulated_showing_wire(site: Site[Any]) -> MessageTransport:
    _runtime(site, site.watched)
    return _showing_wire(site)


def _worn_wire(site: Site[OpenVrTrackersOptions]) -> MessageTransport:
    _runtime(site, site.moving).wear(site.options.worn)
    return _wire(site)


WIRINGS = (
    Wiring(
        OPENVR_HEADSET,
        make=driven_by(OpenVrHeadset),
        real=_showing_wire,
        simulated=_simulated_showing_wire,
    ),
    Wiring(
        OPENVR_CONTROLLERS,
        make=driven_by(OpenVrControllers),
        real=_wire,
        simulated=_simulated_wire,
    ),
    Wiring(
        OPENVR_TRACKERS,
        make=driven_by(OpenVrTrackers),
        real=_wire,
        simulated=_worn_wire,
    ),
)

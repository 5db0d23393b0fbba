"""Devices of an OpenXR runtime: their drivers on the one session they share, and its simulator."""

from typing import Any

from visavis.devices.drivers.openxr.controllers import OpenXrControllers
from visavis.devices.drivers.openxr.gaze import OpenXrGaze
from visavis.devices.drivers.openxr.hand_joints import OpenXrHands
from visavis.devices.drivers.openxr.headset import OpenXrHeadset
from visavis.devices.drivers.openxr.library import OpenXrLibrary
from visavis.devices.drivers.openxr.spec import (
    OPENXR_CONTROLLERS,
    OPENXR_GAZE,
    OPENXR_HANDS,
    OPENXR_HEADSET,
    OpenXrGazeOptions,
    OpenXrHeadsetOptions,
)
from visavis.devices.sim.openxr.runtime import SimulatedXrRuntime
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by


def _wire(site: Site[Any]) -> MessageTransport:
    """Return a wire to the rig's session."""
    if "openxr" not in site.shared:
        site.shared["openxr"] = OpenXrLibrary(site.clock)
    library: OpenXrLibrary = site.shared["openxr"]
    if isinstance(site.options, OpenXrHeadsetOptions):
        library.headless_rate_hz = site.options.display_rate_hz
    return library.transport()


def _simulated_wire(site: Site[Any]) -> MessageTransport:
    if "openxr runtime" not in site.shared:
        rate_hz = getattr(site.options, "display_rate_hz", 90.0)
        runtime = SimulatedXrRuntime(
            site.watched,
            site.clock,
            faults=site.faults,
            display_rate_hz=rate_hz,
            look_ahead_ms=getattr(site.options, "look_ahead_ms", None),
        )
        site.shared["openxr runtime"] = site.stack.enter_context(runtime)
    if isinstance(site.options, OpenXrGazeOptions):
        site.shared["openxr runtime"].eyes.tell_by(site.options.per_eye)
    return _wire(site)


WIRINGS = (
    Wiring(
        OPENXR_HEADSET,
        make=driven_by(OpenXrHeadset),
        real=_wire,
        simulated=_simulated_wire,
    ),
    Wiring(
        OPENXR_CONTROLLERS,
        make=driven_by(OpenXrControllers),
        real=_wire,
        simulated=_simulated_wire,
    ),
    Wiring(
        OPENXR_HANDS,
        make=driven_by(OpenXrHands),
        real=_wire,
        simulated=_simulated_wire,
    ),
    Wiring(
        OPENXR_GAZE,
        make=driven_by(OpenXrGaze),
        real=_wire,
        simulated=_simulated_wire,
    ),
)

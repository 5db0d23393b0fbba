"""Devices of an OpenVR runtime: options, and the one connection they share."""

from typing import TYPE_CHECKING, Any

from pydantic import Field

from visavis.devices.libraries import OPENVR
from visavis.devices.options import SimulatedOptions, StreamOptions
from visavis.devices.spec import DriverSpec, Site, driven_by

if TYPE_CHECKING:
    from visavis.devices.contracts import Body
    from visavis.devices.drivers.openvr.library import OpenVrLibrary
    from visavis.devices.sim.openvr.runtime import SimulatedVrRuntime
    from visavis.devices.transports import MessageTransport


class OpenVrHeadsetOptions(SimulatedOptions):
    """Options of `openvr_headset`; the rate counts on the simulated runtime only."""

    of_wire = frozenset({"display_rate_hz"})

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)


class OpenVrControllersOptions(SimulatedOptions):
    """Options of `openvr_controllers`: the study's control -> "left trigger", "any grip",
    "right trigger axis"; `rays` records where the controllers point.
    """

    controls: dict[str, str] = Field(default_factory=dict)
    rays: bool = True


class OpenVrTrackersOptions(StreamOptions):
    """Options of `openvr_trackers`: serial number -> segment."""

    worn: dict[str, str] = Field(default_factory=dict)


def _library(site: Site[Any]) -> "OpenVrLibrary":
    """Return the rig's connection to the runtime."""
    from visavis.devices.drivers.openvr.library import OpenVrLibrary

    if "openvr" not in site.shared:
        site.shared["openvr"] = OpenVrLibrary(site.clock, application="other")
    library: OpenVrLibrary = site.shared["openvr"]
    return library


def _runtime(site: Site[Any], body: "Body") -> "SimulatedVrRuntime":
    """Return the rig's simulated runtime, started."""
    from visavis.devices.sim.openvr.runtime import SimulatedVrRuntime

    if "openvr runtime" not in site.shared:
        rate_hz = getattr(site.options, "display_rate_hz", 90.0)
        runtime = SimulatedVrRuntime(
            body,
            site.clock,
            seed=site.seed,
            faults=site.faults,
            display_rate_hz=rate_hz,
        )
        site.shared["openvr runtime"] = site.stack.enter_context(runtime)
    shared: SimulatedVrRuntime = site.shared["openvr runtime"]
    return shared


def _wire(site: Site[Any]) -> "MessageTransport":
    return _library(site).transport()


def _simulated_wire(site: Site[Any]) -> "MessageTransport":
    _runtime(site, site.watched)
    return _wire(site)


def _showing_wire(site: Site[Any]) -> "MessageTransport":
    _library(site).show_images()
    return _wire(site)


def _simulated_showing_wire(site: Site[Any]) -> "MessageTransport":
    _runtime(site, site.watched)
    return _showing_wire(site)


def _worn_wire(site: Site[OpenVrTrackersOptions]) -> "MessageTransport":
    _runtime(site, site.moving).wear(site.options.worn)
    return _wire(site)


OPENVR_HEADSET = DriverSpec(
    name="openvr_headset",
    kind="headset",
    options=OpenVrHeadsetOptions,
    make=driven_by("visavis.devices.drivers.openvr.headset:OpenVrHeadset"),
    real=_showing_wire,
    simulated=_simulated_showing_wire,
    model="OpenVR headset",
    wire="OpenVR",
    remedy="look at SteamVR; start it again if it is not running",
    capabilities=frozenset({"head", "frame_timing", "display"}),
    library=OPENVR,
    runtime="openvr",
    stands_for="SteamVR headset",
    checked="the genuine package and its header's layouts; running start by our reading of the "
    "header; C `vrclient` of our own",
    unproven="SteamVR; what the eye sees",
)
OPENVR_CONTROLLERS = DriverSpec(
    name="openvr_controllers",
    kind="responses",
    options=OpenVrControllersOptions,
    make=driven_by("visavis.devices.drivers.openvr.controllers:OpenVrControllers"),
    real=_wire,
    simulated=_simulated_wire,
    model="OpenVR controllers",
    wire="OpenVR",
    remedy="switch the controllers on and look at SteamVR",
    capabilities=frozenset({"responses", "haptics"}),
    library=OPENVR,
    runtime="openvr",
    stands_for="controllers",
    checked="as the headset",
    unproven="legacy input of each controller",
)
OPENVR_TRACKERS = DriverSpec(
    name="openvr_trackers",
    kind="body tracker",
    options=OpenVrTrackersOptions,
    make=driven_by("visavis.devices.drivers.openvr.trackers:OpenVrTrackers"),
    real=_wire,
    simulated=_worn_wire,
    model="OpenVR trackers",
    wire="OpenVR",
    capabilities=frozenset({"body"}),
    remedy="switch the trackers on, let the base stations see them, and look at SteamVR",
    library=OPENVR,
    runtime="openvr",
    stands_for="Vive trackers",
    checked="as the headset",
    unproven="SteamVR; straps",
)
SPECS = (OPENVR_HEADSET, OPENVR_CONTROLLERS, OPENVR_TRACKERS)

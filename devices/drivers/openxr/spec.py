"""Devices of an OpenXR runtime: options, and the one session they share."""

from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from visavis.devices.libraries import OPENXR
from visavis.devices.options import GazeTiming, SimulatedOptions
from visavis.devices.spec import DriverSpec, Site, driven_by

if TYPE_CHECKING:
    from visavis.devices.transports import MessageTransport


class OpenXrHeadsetOptions(SimulatedOptions):
    """Options of `openxr_headset`; the rate counts on the simulated runtime only."""

    of_wire = frozenset({"display_rate_hz"})

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)


class OpenXrControllersOptions(SimulatedOptions):
    """Options of `openxr_controllers`: the study's control -> "left select", "any menu"."""

    controls: dict[str, str] = Field(default_factory=dict)


class OpenXrGazeOptions(GazeTiming, SimulatedOptions):
    """Options of `openxr_gaze`: `eyes` takes each where the runtime tells them (auto), or the one
    ray of both (combined); `per_eye` is what the simulated runtime has.
    """

    of_wire = frozenset({"per_eye"})

    eyes: Literal["auto", "combined"] = "auto"
    per_eye: Literal["none", "htc", "meta"] = "none"
    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)


def _wire(site: Site[Any]) -> "MessageTransport":
    """Return a wire to the rig's session."""
    from visavis.devices.drivers.openxr.library import OpenXrLibrary

    if "openxr" not in site.shared:
        site.shared["openxr"] = OpenXrLibrary(site.clock)
    library: OpenXrLibrary = site.shared["openxr"]
    return library.transport()


def _simulated_wire(site: Site[Any]) -> "MessageTransport":
    from visavis.devices.sim.openxr.runtime import SimulatedXrRuntime

    if "openxr runtime" not in site.shared:
        rate_hz = getattr(site.options, "display_rate_hz", 90.0)
        runtime = SimulatedXrRuntime(
            site.watched, site.clock, faults=site.faults, display_rate_hz=rate_hz
        )
        site.shared["openxr runtime"] = site.stack.enter_context(runtime)
    if isinstance(site.options, OpenXrGazeOptions):
        site.shared["openxr runtime"].eyes.tell_by(site.options.per_eye)
    return _wire(site)


OPENXR_HEADSET = DriverSpec(
    name="openxr_headset",
    kind="headset",
    options=OpenXrHeadsetOptions,
    make=driven_by("visavis.devices.drivers.openxr.headset:OpenXrHeadset"),
    real=_wire,
    simulated=_simulated_wire,
    model="OpenXR headset",
    wire="OpenXR",
    remedy="look at the OpenXR runtime; start it again if it is not running",
    capabilities=frozenset({"head"}),
    library=OPENXR,
    runtime="openxr",
    stands_for="OpenXR headset: poses and pace",
    checked="genuine loader and pyopenxr, our reading of the specification; C runtime of our own",
    unproven="any runtime",
)
OPENXR_CONTROLLERS = DriverSpec(
    name="openxr_controllers",
    kind="responses",
    options=OpenXrControllersOptions,
    make=driven_by("visavis.devices.drivers.openxr.controllers:OpenXrControllers"),
    real=_wire,
    simulated=_simulated_wire,
    model="OpenXR controllers",
    wire="OpenXR",
    remedy="switch the controllers on and look at the OpenXR runtime",
    capabilities=frozenset({"responses", "pointer", "haptics"}),
    library=OPENXR,
    runtime="openxr",
    stands_for="OpenXR controllers",
    checked="genuine loader and pyopenxr, our reading of the specification; C runtime of our own",
    unproven="any runtime and its profiles",
)
OPENXR_GAZE = DriverSpec(
    name="openxr_gaze",
    kind="eye tracker",
    options=OpenXrGazeOptions,
    make=driven_by("visavis.devices.drivers.openxr.gaze:OpenXrGaze"),
    real=_wire,
    simulated=_simulated_wire,
    model="OpenXR eye gaze",
    wire="OpenXR",
    remedy="make the headset vendor's OpenXR runtime the active one, switch eye tracking on and "
    "allow it there, and calibrate in the vendor's program",
    capabilities=frozenset({"gaze", "may_be_smoothed"}),
    library=OPENXR,
    runtime="openxr",
    stands_for="OpenXR eye gaze",
    checked="genuine loader and pyopenxr, our reading of the specification; of HTC's extension our "
    "transcription of its plugin's structures, laid out by a C compiler; C runtime of our own",
    unproven="any runtime: latency, smoothing, which of them tell each eye",
)
SPECS = (OPENXR_HEADSET, OPENXR_CONTROLLERS, OPENXR_GAZE)

"""Devices of an OpenVR runtime: their options and descriptions."""

from pydantic import Field

from visavis.devices.libraries import OPENVR
from visavis.devices.options import SimulatedOptions, StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class OpenVrHeadsetOptions(SimulatedOptions):
    """Options of `openvr_headset`, which count on the simulated runtime only: its rate, and how
    long after a frame's start its light leaves (None: two frames).
    """

    of_wire = frozenset({"display_rate_hz", "look_ahead_ms"})

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)
    look_ahead_ms: float | None = Field(default=None, ge=0, le=200)


class OpenVrControllersOptions(SimulatedOptions):
    """Options of `openvr_controllers`: the study's control -> "left trigger", "any grip",
    "right trigger axis"; `rays` records where the controllers point.
    """

    controls: dict[str, str] = Field(default_factory=dict)
    rays: bool = True


class OpenVrTrackersOptions(StreamOptions):
    """Options of `openvr_trackers`: serial number -> segment."""

    worn: dict[str, str] = Field(default_factory=dict)


OPENVR_HEADSET = DriverSpec(
    name="openvr_headset",
    kind="headset",
    options=OpenVrHeadsetOptions,
    product=Product(
        model="OpenVR headset", capabilities=frozenset({"head", "frame_timing", "display"})
    ),
    wire=Wire(medium="OpenVR", library=OPENVR, runtime="openvr"),
    remedy="look at SteamVR; start it again if it is not running",
    claims=Claims(
        stands_for="SteamVR headset",
        checked=(
            "the genuine package and its header's layouts; running start by our reading of the "
            "header; C `vrclient` of our own; OpenComposite over Monado 25.0.0"
        ),
        unproven="SteamVR; what the eye sees",
    ),
)
OPENVR_CONTROLLERS = DriverSpec(
    name="openvr_controllers",
    kind="responses",
    options=OpenVrControllersOptions,
    product=Product(model="OpenVR controllers", capabilities=frozenset({"responses", "haptics"})),
    wire=Wire(medium="OpenVR", library=OPENVR, runtime="openvr"),
    remedy="switch the controllers on and look at SteamVR",
    claims=Claims(
        stands_for="controllers",
        checked="the genuine package; C `vrclient` of our own",
        unproven="legacy input of each controller",
    ),
)
OPENVR_TRACKERS = DriverSpec(
    name="openvr_trackers",
    kind="body tracker",
    options=OpenVrTrackersOptions,
    product=Product(model="OpenVR trackers", capabilities=frozenset({"body"})),
    wire=Wire(medium="OpenVR", library=OPENVR, runtime="openvr"),
    remedy="switch the trackers on, let the base stations see them, and look at SteamVR",
    claims=Claims(
        stands_for="Vive trackers",
        checked="the genuine package; C `vrclient` of our own",
        unproven="SteamVR; straps",
    ),
)
SPECS = (OPENVR_HEADSET, OPENVR_CONTROLLERS, OPENVR_TRACKERS)

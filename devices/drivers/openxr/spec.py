"""Devices of an OpenXR runtime: their options and descriptions."""

from typing import Literal

from pydantic import Field

from visavis.devices.libraries import OPENXR
from visavis.devices.options import GazeTiming, SimulatedOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

GENUINE_LOADER = (
    "genuine loader and pyopenxr, our reading of the specification; C runtime of our own"
)


class OpenXrHeadsetOptions(SimulatedOptions):
    """Options of `openxr_headset`: the frames counted where nothing is shown, which is also the
    rate of the simulated runtime, and how long after a frame's start its light leaves (None: two
    frames).
    """

    of_wire = frozenset({"display_rate_hz", "look_ahead_ms"})

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)
    look_ahead_ms: float | None = Field(default=None, ge=0, le=200)


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


class OpenXrHandsOptions(SimulatedOptions):
    """Options of `openxr_hands`: how often the joints are asked for."""

    rate_hz: float = Field(default=90.0, ge=1, le=2000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)


OPENXR_HEADSET = DriverSpec(
    name="openxr_headset",
    kind="headset",
    options=OpenXrHeadsetOptions,
    product=Product(model="OpenXR headset", capabilities=frozenset({"head"})),
    wire=Wire(medium="OpenXR", library=OPENXR, runtime="openxr"),
    remedy="look at the OpenXR runtime; start it again if it is not running",
    claims=Claims(
        stands_for="OpenXR headset: poses and pace",
        checked=f"{GENUINE_LOADER}; Monado 25.0.0 with its remote driver",
        unproven="runtimes of headsets' makers",
    ),
)
OPENXR_CONTROLLERS = DriverSpec(
    name="openxr_controllers",
    kind="responses",
    options=OpenXrControllersOptions,
    product=Product(
        model="OpenXR controllers", capabilities=frozenset({"responses", "pointer", "haptics"})
    ),
    wire=Wire(medium="OpenXR", library=OPENXR, runtime="openxr"),
    remedy="switch the controllers on and look at the OpenXR runtime",
    claims=Claims(
        stands_for="OpenXR controllers",
        checked=GENUINE_LOADER,
        unproven="any runtime and its profiles",
    ),
)
OPENXR_GAZE = DriverSpec(
    name="openxr_gaze",
    kind="eye tracker",
    options=OpenXrGazeOptions,
    product=Product(model="OpenXR eye gaze", capabilities=frozenset({"gaze", "may_be_smoothed"})),
    wire=Wire(medium="OpenXR", library=OPENXR, runtime="openxr"),
    remedy=(
        "make the headset vendor's OpenXR runtime the active one, switch eye tracking on and "
        "allow it there, and calibrate in the vendor's program"
    ),
    claims=Claims(
        stands_for="OpenXR eye gaze",
        checked=(
            "genuine loader and pyopenxr, our reading of the specification; of HTC's extension our "
            "transcription of its plugin's structures, laid out by a C compiler; C runtime of our "
            "own"
        ),
        unproven="any runtime: latency, smoothing, which of them tell each eye",
    ),
)
OPENXR_HANDS = DriverSpec(
    name="openxr_hands",
    kind="body tracker",
    options=OpenXrHandsOptions,
    product=Product(model="OpenXR hand joints"),
    wire=Wire(medium="OpenXR", library=OPENXR, runtime="openxr"),
    remedy=(
        "switch hand tracking on in the headset, put the controllers down, and hold both hands "
        "before its cameras; some runtimes pass it on through a link program only"
    ),
    claims=Claims(
        stands_for="OpenXR hand tracking: 26 joints a hand",
        checked=GENUINE_LOADER,
        unproven="any runtime: how it foresees and smooths, hands made up from controllers",
    ),
)
SPECS = (OPENXR_HEADSET, OPENXR_CONTROLLERS, OPENXR_GAZE, OPENXR_HANDS)

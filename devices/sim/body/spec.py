"""Devices that exist in simulation only: what they measure is a simulated participant's body."""

from typing import ClassVar

from pydantic import Field

from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import DriverSpec, Product, Wire


class SimulatedHeadsetOptions(SimulatedOptions):
    """Options of `simulated_headset`; light leaves `look_ahead_ms` after a frame begins, or with
    the next frame (None). That far the head is foreseen.
    """

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)
    look_ahead_ms: float | None = Field(default=None, ge=0, le=200)


class SimulatedBodyOptions(SimulatedOptions):
    """Options of `simulated_body`."""

    rate_hz: float = Field(default=100.0, ge=1, le=1000)


class SimulatedResponsesOptions(SimulatedOptions):
    """Options of `simulated_responses`, which always has the same `controls`."""

    controls: ClassVar[tuple[str, ...]] = ("trigger",)


SIMULATED_HEADSET = DriverSpec(
    name="simulated_headset",
    kind="headset",
    options=SimulatedHeadsetOptions,
    product=Product(vendor="Visavis", model="simulated headset"),
    wire=Wire(carries="nothing"),
)
SIMULATED_BODY = DriverSpec(
    name="simulated_body",
    kind="body tracker",
    options=SimulatedBodyOptions,
    product=Product(
        vendor="Visavis", model="simulated body tracker", capabilities=frozenset({"body"})
    ),
    wire=Wire(carries="nothing"),
)
SIMULATED_RESPONSES = DriverSpec(
    name="simulated_responses",
    kind="responses",
    options=SimulatedResponsesOptions,
    product=Product(vendor="Visavis", model="simulated responses"),
    wire=Wire(carries="nothing"),
)
SPECS = (SIMULATED_HEADSET, SIMULATED_BODY, SIMULATED_RESPONSES)

"""Devices that exist in simulation only: what they measure is a simulated participant's body."""

from typing import TYPE_CHECKING

from pydantic import Field

from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import DriverSpec, Site, no_wire

if TYPE_CHECKING:
    from visavis.devices.sim.body.headset import SimulatedHeadset
    from visavis.devices.sim.body.responses import SimulatedResponses
    from visavis.devices.sim.body.tracker import SimulatedBodyTracker


class SimulatedHeadsetOptions(SimulatedOptions):
    """Options of `simulated_headset`."""

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)


class SimulatedBodyOptions(SimulatedOptions):
    """Options of `simulated_body`."""

    rate_hz: float = Field(default=100.0, ge=1, le=1000)


class SimulatedResponsesOptions(SimulatedOptions):
    """Options of `simulated_responses`."""


def _headset(site: Site[SimulatedHeadsetOptions], _: None) -> "SimulatedHeadset":
    from visavis.devices.sim.body.headset import SimulatedHeadset

    rate_hz = site.options.display_rate_hz
    return SimulatedHeadset(
        site.role, site.watched, site.clock, display_rate_hz=rate_hz, faults=site.faults
    )


def _tracker(site: Site[SimulatedBodyOptions], _: None) -> "SimulatedBodyTracker":
    from visavis.devices.sim.body.tracker import SimulatedBodyTracker

    rate_hz = site.options.rate_hz
    return SimulatedBodyTracker(
        site.role, site.moving, site.clock, rate_hz=rate_hz, faults=site.faults
    )


def _responses(site: Site[SimulatedResponsesOptions], _: None) -> "SimulatedResponses":
    from visavis.devices.sim.body.responses import SimulatedResponses

    return SimulatedResponses(
        site.role, site.watched, site.clock, faults=site.faults, seed=site.own_seed
    )


SIMULATED_HEADSET = DriverSpec(
    name="simulated_headset",
    kind="headset",
    options=SimulatedHeadsetOptions,
    make=_headset,
    simulated=no_wire,
    carries="nothing",
    vendor="Visavis",
    model="simulated headset",
)
SIMULATED_BODY = DriverSpec(
    name="simulated_body",
    kind="body tracker",
    options=SimulatedBodyOptions,
    make=_tracker,
    simulated=no_wire,
    carries="nothing",
    vendor="Visavis",
    model="simulated body tracker",
    capabilities=frozenset({"body"}),
)
SIMULATED_RESPONSES = DriverSpec(
    name="simulated_responses",
    kind="responses",
    options=SimulatedResponsesOptions,
    make=_responses,
    simulated=no_wire,
    carries="nothing",
    vendor="Visavis",
    model="simulated responses",
)
SPECS = (SIMULATED_HEADSET, SIMULATED_BODY, SIMULATED_RESPONSES)

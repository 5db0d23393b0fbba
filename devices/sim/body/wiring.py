"""Devices that exist in simulation only, on the simulated participant's body."""

from visavis.devices.contracts import Device
from visavis.devices.sim.body.headset import SimulatedHeadset
from visavis.devices.sim.body.responses import SimulatedResponses
from visavis.devices.sim.body.spec import (
    SIMULATED_BODY,
    SIMULATED_HEADSET,
    SIMULATED_RESPONSES,
    SimulatedBodyOptions,
    SimulatedHeadsetOptions,
    SimulatedResponsesOptions,
)
from visavis.devices.sim.body.tracker import SimulatedBodyTracker
from visavis.devices.wiring import Site, Wiring, no_wire


def _headset(site: Site[SimulatedHeadsetOptions], _: None) -> Device:
    return SimulatedHeadset(
        site.role,
        site.watched,
        site.clock,
        display_rate_hz=site.options.display_rate_hz,
        look_ahead_ms=site.options.look_ahead_ms,
        faults=site.faults,
    )


def _tracker(site: Site[SimulatedBodyOptions], _: None) -> Device:
    rate_hz = site.options.rate_hz
    return SimulatedBodyTracker(
        site.role, site.moving, site.clock, rate_hz=rate_hz, faults=site.faults
    )


def _responses(site: Site[SimulatedResponsesOptions], _: None) -> Device:
    return SimulatedResponses(
        site.role, site.watched, site.clock, faults=site.faults, seed=site.own_seed
    )


WIRINGS = (
    Wiring(SIMULATED_HEADSET, make=_headset, simulated=no_wire),
    Wiring(SIMULATED_BODY, make=_tracker, simulated=no_wire),
    Wiring(SIMULATED_RESPONSES, make=_responses, simulated=no_wire),
)

"""Put the simulator that fits a driver of another armband behind a memory link."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from devices.byte_links import MemoryLink
from devices.contracts import MovingBody
from devices.sim.armband.simulator import ArmbandSimulator
from devices.sim.bands.bhaptics import BhapticsPlayerSimulator
from devices.sim.bands.buzz import BuzzSimulator
from devices.sim.bands.plain import ReportBandSimulator, TextBandSimulator
from devices.sim.bands.vhp import SleeveSimulator, SlimBoardSimulator
from devices.sim.faults import FaultSchedule
from lab.clock import Clock
from lab.errors import ConfigError

SIMULATORS: Mapping[str, Any] = {
    "ascii_armband": TextBandSimulator,
    "bhaptics": BhapticsPlayerSimulator,
    "ble_armband": ArmbandSimulator,
    "hid_armband": ReportBandSimulator,
    "neosensory_buzz": BuzzSimulator,
    "spp_armband": ArmbandSimulator,
    "usb_armband": partial(ReportBandSimulator, number=None),
    "vhp_sleeve": SleeveSimulator,
    "vhp_slim": SlimBoardSimulator,
}
"""Driver name -> what stands at the other end of its wire.

The text and report bands understand one set of commands and one layout only, which
`SIMULATED_OPTIONS` gives; a laboratory's own cannot be simulated.
"""

SIMULATED_OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "ascii_armband": {
        "commands": {
            "set_one": "M{motor} {amplitude}\n",
            "stop": "S\n",
            "battery": "B?\n",
            "battery_answer": r"^B (\d+)",
            "refusal_answer": r"^\?",
        }
    },
    "hid_armband": {
        "vid": 0x1209,
        "pid": 0x0001,
        "layout": {"prefix": "a501", "first_motor_byte": 2, "battery_byte": 1},
    },
    "usb_armband": {
        "vid": 0x1209,
        "pid": 0x0001,
        "layout": {"prefix": "a501", "first_motor_byte": 2, "battery_byte": 1},
    },
}
"""Driver options that its simulator understands."""


def simulated_link(
    driver: str,
    role: str,
    clock: Clock,
    *,
    seed: int = 0,
    body: MovingBody | None = None,
    faults: FaultSchedule | None = None,
    options: Mapping[str, Any] | None = None,
) -> MemoryLink:
    """Return the link a driver is given as `link`; the body feels our motors, in our order."""
    if driver not in SIMULATORS:
        raise ConfigError(f"driver {driver!r} has no simulator; known: {', '.join(SIMULATORS)}")
    extra: dict[str, Any] = {}
    given = options or {}
    if driver == "bhaptics":
        extra["position"] = given.get("position", "ForearmL")
        extra["places"] = given.get("points", (0, 2, 3, 5))
    elif driver == "vhp_sleeve":
        extra["places"] = given.get("channels", (5, 7, 8, 6))
    elif driver == "vhp_slim":
        extra["places"] = given.get("channels", (0, 2, 4, 8))
    peer = SIMULATORS[driver](role, clock, seed=seed, body=body, faults=faults, **extra)
    return MemoryLink(peer, clock)

"""Put every armband that is not our own on its simulator, and drive it through virtual time."""

import numpy as np

from tests.devices.band_makers import (
    ascii_armband,
    bhaptics,
    bhaptics_sdk,
    hid_armband,
    neosensory_buzz,
    usb_armband,
    vhp_sleeve,
    vhp_slim,
)
from visavis.devices.byte_links import MemoryLink
from visavis.devices.contracts import BAND, HAPTICS
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.bands.bhaptics import BhapticsPlayerSimulator
from visavis.devices.sim.bands.bhaptics_sdk import BhapticsSdkSimulator
from visavis.devices.sim.bands.buzz import BuzzSimulator
from visavis.devices.sim.bands.plain import ReportBandSimulator, TextBandSimulator
from visavis.devices.sim.bands.vhp import SleeveSimulator, SlimBoardSimulator
from visavis.lab.clock import NS_PER_S, SimClock

COMMANDS = {
    "set_one": "M{motor} {amplitude}\n",
    "stop": "S\n",
    "battery": "B?\n",
    "battery_answer": r"^B (\d+)",
    "refusal_answer": r"^\?",
}
LAYOUT = {"report_bytes": 8, "prefix": "a501", "first_motor_byte": 2, "battery_byte": 1}


def buzz_on(role, clock, link):
    return neosensory_buzz(role, clock, link=link)


def slim_on(role, clock, link):
    return vhp_slim(role, clock, link=link, max_rate_hz=50.0)


def ascii_on(role, clock, link):
    return ascii_armband(role, clock, commands=COMMANDS, link=link)


def hid_on(role, clock, link):
    return hid_armband(role, clock, vid=1, pid=2, layout=LAYOUT, link=link)


def usb_on(role, clock, link):
    return usb_armband(role, clock, vid=1, pid=2, layout=LAYOUT, link=link)


def sleeve_on(role, clock, link):
    return vhp_sleeve(role, clock, link=link)


def bhaptics_on(role, clock, link):
    return bhaptics(role, clock, link=link)


def bhaptics_sdk_on(role, clock, link):
    return bhaptics_sdk(role, clock, link=link)


def usb_simulator(*args, **kwargs):
    return ReportBandSimulator(*args, number=None, **kwargs)


# driver, simulator, where our motors stand among the simulator's, whether messages may be cut
BANDS = {
    "buzz": (buzz_on, BuzzSimulator, (0, 1, 2, 3), True),
    "vhp_sleeve": (sleeve_on, SleeveSimulator, (5, 7, 8, 6), True),
    "vhp_slim": (slim_on, SlimBoardSimulator, (0, 2, 4, 8), False),
    "bhaptics": (bhaptics_on, BhapticsPlayerSimulator, (0, 2, 3, 5), False),
    "bhaptics_sdk": (bhaptics_sdk_on, BhapticsSdkSimulator, (0, 2, 3, 5), False),
    "ascii": (ascii_on, TextBandSimulator, (0, 1, 2, 3), True),
    "hid": (hid_on, ReportBandSimulator, (0, 1, 2, 3), False),
    "usb": (usb_on, usb_simulator, (0, 1, 2, 3), False),
}
RUNS_FOR_EVER = ("buzz", "vhp_sleeve", "ascii", "hid", "usb")


class BandRig:
    """One band of `BANDS`, polled at 90 Hz on a virtual clock."""

    def __init__(self, name, *faults, wrap=None, clock=None, **simulator):
        make, simulate, self.places, splits = BANDS[name]
        self.clock = clock if clock is not None else SimClock()
        schedule = FaultSchedule.from_config(faults)
        self.peer = simulate("arm", self.clock, faults=schedule, splits=splits, **simulator)
        link = MemoryLink(self.peer, self.clock)
        self.driver = make("arm", self.clock, wrap(link, self.clock) if wrap else link)
        self.batches = []

    def start(self):
        self.driver.open(2.0)
        self.driver.start(self.batches.append)
        return self

    def run(self, seconds, *, alive=True):
        end_ns = self.clock.now_ns() + round(seconds * NS_PER_S)
        while self.clock.now_ns() < end_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_S // 90)
            if alive:
                self.driver.keep_alive()
            self.driver.poll(0.0)
        return self

    @property
    def levels(self):
        """What our motors do now, in our order."""
        self.peer.advance(self.clock.now_ns())
        return tuple(round(self.peer.levels_01[i], 2) for i in self.places)

    @property
    def is_silent(self):
        self.peer.advance(self.clock.now_ns() + NS_PER_S // 100)
        return not any(self.peer.levels_01)

    def rows(self, kind=None):
        found = [b.values for b in self.batches if b.schema is HAPTICS]
        values = np.concatenate(found) if found else np.zeros(0, HAPTICS.dtype)
        return values if kind is None else values[values["kind"] == kind]

    def told(self):
        found = [b.values for b in self.batches if b.schema is BAND]
        return np.concatenate(found) if found else np.zeros(0, BAND.dtype)

    def messages(self):
        return " | ".join(fault.message for fault in self.driver.check())

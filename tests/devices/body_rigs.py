"""A body that moves as a plain function of time, and body trackers on simulated wires."""

import numpy as np

from devices.faults import FaultSchedule
from devices.pump import Pump
from devices.transports import MemoryTransport
from lab.clock import NS_PER_S, SimClock
from lab.geometry import quat_multiply
from tests.devices.bodies import FixatingBody

YAW = np.array([np.cos(0.3), 0.0, np.sin(0.3), 0.0])
AXES = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])


class WalkingBody(FixatingBody):
    """Every named segment swings about its own axis at its own place."""

    def segments(self, names, t_ns):
        t_s = t_ns[:, None] * 1e-9
        marks = np.array([sum(map(ord, name)) % 97 for name in names])
        x, y = 0.01 * marks - 0.5 + 0.1 * np.sin(t_s), 0.01 * marks + 0.2 * t_s
        positions = np.stack((x, y, t_s - 0.5 + 0 * x), axis=-1)
        half = 0.2 * np.sin(t_s + marks)
        axes = np.sin(half)[..., None] * AXES[marks % 3]
        turns = quat_multiply(YAW, np.concatenate((np.cos(half)[..., None], axes), axis=-1))
        return positions, turns

    def feel(self, role, amplitudes_01, t_ns):
        pass


class BodyRig:
    """One body tracker pumped at 90 Hz on a virtual clock."""

    def __init__(self, simulate, drive, *faults, seed=1, wrap=None, **simulator):
        self.clock = SimClock()
        self.body = WalkingBody()
        schedule = FaultSchedule.from_config(faults)
        self.simulator = simulate(self.body, self.clock, seed=seed, faults=schedule, **simulator)
        wire = MemoryTransport(self.simulator, self.clock)
        self.driver = drive("body", wrap(wire, self.clock) if wrap else wire, self.clock)
        self.batches = []
        self.pump = Pump(self.driver, self.batches.append, self.clock)

    def start(self):
        self.driver.open(2.0)
        self.pump.start()
        return self

    def run(self, seconds):
        end_ns = self.clock.now_ns() + round(seconds * NS_PER_S)
        while self.clock.now_ns() < end_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_S // 90)
            self.pump.step()
        return self

    def column(self, name):
        return np.concatenate([batch.values[name] for batch in self.batches])

    def stamps(self, name):
        return np.concatenate([getattr(batch, name) for batch in self.batches])

    def messages(self):
        return " | ".join(fault.message for fault in self.pump.faults())

"""A body that moves as a plain function of time, and body trackers on simulated wires."""

import numpy as np

from tests.devices.bodies import FixatingBody
from tests.devices.rigs import PumpedRig
from visavis.devices.faults import FaultSchedule
from visavis.devices.transports import MemoryTransport
from visavis.lab.clock import SimClock
from visavis.lab.geometry import quat_multiply

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


class BodyRig(PumpedRig):
    """One body tracker pumped at 90 Hz on a virtual clock."""

    def __init__(self, simulate, drive, *faults, seed=1, wrap=None, **simulator):
        self.clock = SimClock()
        self.body = WalkingBody()
        schedule = FaultSchedule.from_config(faults)
        self.simulator = simulate(self.body, self.clock, seed=seed, faults=schedule, **simulator)
        wire = MemoryTransport(self.simulator, self.clock)
        self.driver = drive("body", wrap(wire, self.clock) if wrap else wire, self.clock)
        self.listen()

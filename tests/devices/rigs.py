"""A driver on a simulated wire driven through virtual time, and such a Pupil Core."""

import numpy as np

from tests.devices.bodies import FixatingBody
from visavis.devices.drivers.pupil.driver import PupilCore
from visavis.devices.faults import FaultSchedule
from visavis.devices.pump import Pump
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.devices.transports import MemoryTransport
from visavis.lab.clock import NS_PER_S, SimClock


class PumpedRig:
    """One `driver` on the virtual `clock`; a subclass sets both, then calls `listen`."""

    def listen(self):
        self.batches = []
        self.pump = Pump(self.driver, self.batches.append, self.clock)

    def start(self):
        self.driver.open(2.0)
        self.pump.start()
        return self

    def run(self, seconds, *, may_wait=False):
        end_ns = self.clock.now_ns() + round(seconds * NS_PER_S)
        while self.clock.now_ns() < end_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_S // 90)
            self.pump.step(may_wait=may_wait)
        return self

    def column(self, name):
        return np.concatenate([batch.values[name] for batch in self.batches])

    def stamps(self, name):
        return np.concatenate([getattr(batch, name) for batch in self.batches])

    def messages(self):
        return " | ".join(fault.message for fault in self.pump.faults())


class Rig(PumpedRig):
    """One eye tracker, pumped at 90 Hz on a virtual clock."""

    def __init__(self, *faults, seed=1, body=None, wrap=None, **simulator):
        self.clock = SimClock()
        self.body = body if body is not None else FixatingBody(5.0, 3.0)
        schedule = FaultSchedule.from_config(faults)
        self.simulator = PupilCoreSimulator(
            self.body, clock=self.clock, seed=seed, faults=schedule, **simulator
        )
        wire = MemoryTransport(self.simulator, self.clock)
        self.driver = PupilCore("eyes", wrap(wire, self.clock) if wrap else wire, self.clock)
        self.listen()

    def calibrate(self, *, looks=True):
        self.driver.begin_calibration()
        for i in range(9):
            target = FixatingBody(10 * (i % 3 - 1), 5 * (i // 3 - 1))
            if looks:
                self.body.look(10 * (i % 3 - 1), 5 * (i // 3 - 1))
            self.run(0.3)
            for j in range(3):
                t_ns = self.clock.now_ns() - j * 30_000_000
                self.driver.add_reference(target.direction, t_ns)
        return self.driver.end_calibration(3.0)

"""The Pupil Core driver over real sockets, in a thread of its own."""

import pytest

from tests.devices.bodies import FixatingBody
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.pupil.driver import PupilCore
from visavis.devices.faults import FaultSchedule
from visavis.devices.pump import Pump
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.devices.sim.zmq_host import ZmqHost
from visavis.devices.transports import ZmqTransport
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SystemClock
from visavis.lab.clock_fit import offset_ns
from visavis.lab.errors import DeviceTimeout

PATIENCE_NS = 20 * NS_PER_S


class Lab:
    def __init__(self, *faults, **options):
        self.clock = SystemClock()
        schedule = FaultSchedule.from_config(faults)
        self.body = FixatingBody()
        self.simulator = PupilCoreSimulator(self.body, clock=self.clock, seed=1, faults=schedule)
        self.host = ZmqHost(self.simulator, self.clock)
        wire = ZmqTransport("127.0.0.1", self.host.port, self.clock, is_simulated=True)
        self.driver = PupilCore("eyes", wire, self.clock, **options)
        self.batches = []
        self.pump = Pump(self.driver, self.batches.append, self.clock)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.pump.stop()
        self.driver.close()
        self.host.close()

    def step_until(self, reached):
        deadline_ns = self.clock.now_ns() + PATIENCE_NS
        while not reached():
            assert self.clock.now_ns() < deadline_ns, "did not happen in time"
            self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_MS)
            self.pump.step()


def test_threaded_driver_delivers_calibrates_and_annotates():
    with Lab(exchange_interval_s=0.02) as lab:
        lab.driver.open(5.0)
        opening = len(lab.driver.clock_pairs())
        lab.pump.start()
        lab.step_until(lambda: len(lab.driver.clock_pairs()) > opening + 2)
        lab.driver.begin_calibration()
        started_ns = lab.clock.now_ns()
        lab.step_until(lambda: lab.clock.now_ns() > started_ns + 300 * NS_PER_MS)
        for i in range(12):
            lab.driver.add_reference(lab.body.direction, started_ns + (50 + 20 * i) * NS_PER_MS)
        outcome = lab.driver.end_calibration(10.0)

        def annotated():
            lab.driver.annotate("mark", lab.clock.now_ns())
            return bool(lab.simulator.annotations)

        lab.step_until(annotated)  # a publisher's first messages may be lost while it connects

    assert outcome.succeeded
    assert lab.simulator.annotations[0]["label"] == "mark"
    error_ns = offset_ns(lab.driver.clock_pairs()) + lab.simulator.device_ns(0)
    assert abs(error_ns) < 5 * NS_PER_MS


def test_peer_that_is_gone_is_told_and_comes_back():
    fault = {"kind": "disconnect", "start_s": 0.4, "duration_s": 0.8}
    with Lab(fault, exchange_interval_s=0.05, lost_after_s=0.3) as lab:
        lab.driver.open(5.0)
        lab.pump.start()
        events = []

        def back():
            events.extend(event.kind for event in lab.pump.take_events())
            return "reconnected" in events

        lab.step_until(back)

        assert "disconnected" in events
        assert lab.driver.state is DeviceState.STREAMING


def test_port_that_nobody_serves_times_out_with_the_remedy():
    with Lab({"kind": "mute"}) as lab, pytest.raises(DeviceTimeout, match="enable the plug-in"):
        lab.driver.open(0.2)

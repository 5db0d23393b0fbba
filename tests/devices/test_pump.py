"""The pump's rules: delivery in the caller's thread, watchdog, back-off, drops, faults."""

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from visavis.devices import pump as pump_module
from visavis.devices.contracts import DeviceInfo, DeviceState
from visavis.devices.lifecycle import Lifecycle
from visavis.devices.meter import StreamMeter
from visavis.devices.pump import Pump
from visavis.devices.sim.body.headset import SimulatedHeadset
from visavis.lab.clock import SimClock, SystemClock
from visavis.lab.errors import DeviceDisconnected
from visavis.lab.schema import Field, SampleBatch, StreamSchema

SCHEMA = StreamSchema("toy", (Field("x", "f4", "1"),), 100.0)


class ToyDevice:
    """Do at each poll what a script says: "data", "nothing", or an exception to raise."""

    def __init__(self, clock, script=()):
        self.clock = clock
        self.script = list(script)
        self.polls_ns = []
        self.info = DeviceInfo("toy", "toy", "1", "", "toy", "", "usb", False)
        self.life = Lifecycle("toy")
        self.life.state = DeviceState.OPEN
        self.meter = StreamMeter(100.0)
        self.seq = 0

    @property
    def state(self):
        return self.life.state

    def describe(self):
        return (SCHEMA,)

    def start(self, sink):
        self.sink = sink
        self.life.state = DeviceState.STREAMING

    def poll(self, timeout_s):
        now_ns = self.clock.now_ns()
        self.polls_ns.append(now_ns)
        action = self.script.pop(0) if self.script else "data"
        if isinstance(action, Exception):
            self.life.state = DeviceState.FAULT
            raise action
        if action == "nothing":
            return 0
        self.life.state = DeviceState.STREAMING
        stamp = np.array([now_ns])
        batch = SampleBatch(SCHEMA, np.array([self.seq]), stamp, stamp, np.zeros(1, SCHEMA.dtype))
        self.seq += 1
        self.meter.update([now_ns], now_ns)
        self.sink(batch)
        return 1

    def stop(self):
        self.life.state = DeviceState.OPEN

    def check(self):
        return ()

    def health(self):
        return self.meter.health(self.state, self.clock.now_ns())


def run(pump, clock, seconds, step_ns=10_000_000):
    end_ns = clock.now_ns() + round(seconds * 1e9)
    while clock.now_ns() < end_ns:
        clock.sleep_until_ns(clock.now_ns() + step_ns)
        pump.step()


def made(script=()):
    clock, got = SimClock(), []
    device = ToyDevice(clock, script)
    pump = Pump(device, got.append, clock)
    pump.start()
    return device, pump, clock, got


class ForeseeingToy(ToyDevice):
    """Brings something every 50 ms, and knows it."""

    def due_ns(self):
        return (self.polls_ns[-1] if self.polls_ns else 0) + 50_000_000


def test_device_that_knows_when_something_is_due_is_not_polled_before():
    clock, got = SimClock(), []
    device = ForeseeingToy(clock)
    pump = Pump(device, got.append, clock)
    pump.start()

    run(pump, clock, 0.5)

    assert device.polls_ns == [50_000_000 * k for k in range(1, 11)]
    assert len(got) == 10
    assert pump.faults() == ()


def test_step_polls_once_and_hands_over_in_order():
    _, pump, clock, got = made()

    run(pump, clock, 0.5)

    assert [int(batch.seq[0]) for batch in got] == list(range(50))


def test_failing_driver_becomes_a_blocking_fault_with_its_words():
    _, pump, clock, _ = made([ValueError("bad byte")])

    run(pump, clock, 0.1)

    (fault,) = pump.faults()
    assert fault.severity == "blocking"
    assert "ValueError: bad byte" in fault.message
    assert [event.kind for event in pump.take_events()] == ["failed"]


def test_reconnection_backs_off_from_half_a_second_to_eight():
    gone = [DeviceDisconnected("gone") for _ in range(7)]
    device, pump, clock, _ = made(gone)

    run(pump, clock, 32.0)

    waits_s = np.diff(device.polls_ns[:8]) / 1e9
    np.testing.assert_allclose(waits_s, [0.5, 1, 2, 4, 8, 8, 8])


def test_reconnection_records_the_gap():
    _, pump, clock, _ = made(["data"] * 10 + [DeviceDisconnected("gone")])

    run(pump, clock, 2.0)

    events = pump.take_events()
    assert [event.kind for event in events] == ["disconnected", "reconnected"]
    assert events[1].gap_ms == pytest.approx(510.0)
    assert pump.faults() == ()


def test_silence_below_100_ms_is_no_event():
    _, pump, clock, _ = made(["nothing"] * 9)

    run(pump, clock, 0.5)

    assert pump.take_events() == ()


def test_overflowing_queue_counts_what_it_drops(monkeypatch):
    monkeypatch.setattr(pump_module, "QUEUE_BATCHES", 5)
    device, pump, _, got = made()
    for _ in range(8):
        device.poll(0.0)

    pump.step()

    assert len(got) == 5
    assert pump.health().dropped == 4
    assert "4 samples dropped" in pump.faults()[0].message
    assert [event.kind for event in pump.take_events()] == ["dropped"]


def test_thread_delivers_only_within_step():
    clock, got = SystemClock(), []
    device = ToyDevice(clock)
    pump = Pump(device, got.append, clock)
    pump.start()
    while device.seq < 3:
        clock.sleep_until_ns(clock.now_ns() + 1_000_000)
    assert got == []

    pump.step()
    pump.stop()

    assert len(got) >= 3
    assert device.state is DeviceState.OPEN


def test_thread_that_fails_ends_and_is_told():
    clock = SystemClock()
    pump = Pump(ToyDevice(clock, [RuntimeError("boom")]), [].append, clock)
    pump.start()
    while not pump.faults():
        clock.sleep_until_ns(clock.now_ns() + 1_000_000)

    pump.stop()

    assert "RuntimeError: boom" in pump.faults()[0].message


def test_stop_twice_is_harmless_and_start_twice_is_refused():
    _, pump, _, _ = made()
    with pytest.raises(RuntimeError, match="toy"):
        pump.start()
    pump.stop()
    pump.stop()


def test_headset_is_polled_by_step_even_on_a_real_clock():
    clock, got = SystemClock(), []
    headset = SimulatedHeadset("headset", FixatingBody(), clock, display_rate_hz=1000)
    headset.open(1.0)
    pump = Pump(headset, got.append, clock)
    pump.start()
    frame = headset.wait_frame()

    pump.step()
    pump.stop()

    head = [batch for batch in got if batch.schema.name == "head"]
    assert [int(batch.t_host_ns[0]) for batch in head] == [frame.t_ns]


def test_a_device_that_can_wait_is_polled_when_it_may_no_longer():
    clock, got = SimClock(), []
    device = ToyDevice(clock)
    device.put_off = lambda: clock.now_ns() < 50_000_000
    device.put_off_until_ns = lambda: 50_000_000
    pump = Pump(device, got.append, clock)
    pump.start()
    polled = []
    for _ in range(8):
        clock.sleep_until_ns(clock.now_ns() + 10_000_000)
        pump.step(may_wait=True)
        polled.append(not pump.is_put_off)

    assert [False] * 4 + [True] * 4 == polled
    assert [50_000_000, 60_000_000, 70_000_000, 80_000_000] == device.polls_ns

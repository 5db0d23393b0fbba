"""Every device of ours keeps the contract, on every wire it can be put on."""

import contextlib

import pytest

from tests.devices.bodies import FixatingBody
from visavis.devices import conformance
from visavis.devices.drivers.pupil.driver import PupilCore
from visavis.devices.sim.body.headset import SimulatedHeadset
from visavis.devices.sim.body.responses import SimulatedResponses
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.devices.sim.zmq_host import ZmqHost
from visavis.devices.transports import MemoryTransport, ZmqTransport
from visavis.devices.wirelog import ReplayTransport, TeeTransport
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock


class Bench:
    """Factories for fresh devices that share one clock."""

    def __init__(self, clock, make):
        self.clock = clock
        self.make = make

    def let_pass(self, seconds):
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NS_PER_S))


def memory_wire(stack, tmp_path):
    clock = SimClock()

    def make():
        simulator = PupilCoreSimulator(FixatingBody(), clock=clock, seed=1)
        return PupilCore("eyes", MemoryTransport(simulator, clock), clock)

    return Bench(clock, make)


def real_sockets(stack, tmp_path):
    clock = SystemClock()
    simulator = PupilCoreSimulator(FixatingBody(), clock=clock, seed=1)
    host = stack.enter_context(ZmqHost(simulator, clock))

    def make():
        wire = ZmqTransport("127.0.0.1", host.port, clock, is_simulated=True)
        device = PupilCore("eyes", wire, clock)
        stack.callback(device.close)
        return device

    return Bench(clock, make)


def replay(stack, tmp_path):
    clock = SimClock()
    path = tmp_path / "séance 1.wire"
    simulator = PupilCoreSimulator(FixatingBody(), clock=clock, seed=1)
    tee = TeeTransport(MemoryTransport(simulator, clock), path, clock)
    recorded = PupilCore("eyes", tee, clock)
    conformance.collect(
        recorded,
        lambda s: clock.sleep_until_ns(clock.now_ns() + round(s * NS_PER_S)),
        seconds=3.0,
    )
    recorded.close()
    later = SimClock(3600 * NS_PER_S)
    return Bench(later, lambda: PupilCore("eyes", ReplayTransport(path, later), later))


@pytest.fixture(params=[memory_wire, real_sockets, replay], ids=lambda f: f.__name__)
def bench(request, tmp_path):
    with contextlib.ExitStack() as stack:
        yield request.param(stack, tmp_path)


def test_pupil_core_keeps_the_life_of_a_device(bench):
    conformance.check_lifecycle(bench.make, bench.let_pass)


def test_pupil_core_keeps_the_rules_of_batches(bench):
    conformance.check_batches(bench.make, bench.let_pass)


def test_pupil_core_keeps_the_rules_of_eye_trackers(bench):
    conformance.check_eye_tracker(bench.make, bench.let_pass)


def headset_bench():
    clock = SimClock(123)
    return Bench(clock, lambda: SimulatedHeadset("headset", FixatingBody(), clock))


def responses_bench():
    clock = SimClock()
    presses = [(400_000_000 + k * 10_000_000, "trigger", float(k % 2)) for k in range(10)]
    return Bench(clock, lambda: SimulatedResponses("buttons", FixatingBody(presses=presses), clock))


def test_simulated_headset_keeps_its_contract():
    bench = headset_bench()
    conformance.check_lifecycle(bench.make, bench.let_pass)
    conformance.check_headset(bench.make)


def test_simulated_responses_keep_their_contract():
    conformance.check_lifecycle(responses_bench().make, responses_bench().let_pass)
    bench = responses_bench()
    conformance.check_batches(bench.make, bench.let_pass)
    bench = responses_bench()
    conformance.check_response_input(bench.make, bench.let_pass)


def test_suite_finds_a_device_that_delivers_zero_vectors():
    class Zeroing(PupilCore):
        def start(self, sink):
            def zeroed(batch):
                values = batch.values.copy()
                values["direction_head"] = 0
                object.__setattr__(batch, "values", values)
                sink(batch)

            super().start(zeroed)

    clock = SimClock()
    simulator = PupilCoreSimulator(FixatingBody(), clock=clock, seed=1)
    bench = Bench(clock, lambda: Zeroing("eyes", MemoryTransport(simulator, clock), clock))

    with pytest.raises(AssertionError, match="never zero"):
        conformance.check_eye_tracker(bench.make, bench.let_pass)

"""Build any eye tracker's driver on its simulated wire, and drive it through virtual time."""

import contextlib

from tests.devices.bodies import FixatingBody
from tests.devices.rigs import PumpedRig
from visavis.devices import conformance
from visavis.devices.faults import FaultSchedule, WireFault
from visavis.devices.pump import Pump
from visavis.devices.sim.gaze.tracker_error import TrackerErrorModel
from visavis.devices.transports import MemoryTransport
from visavis.devices.wirelog import ReplayTransport, TeeTransport
from visavis.lab.clock import NS_PER_S, SimClock

PERFECT = TrackerErrorModel(
    offset_deg=0, eye_offset_deg=0, gain_sd_01=0, white_deg=0, slow_deg=0, latency_jitter_ms=0
)


class GazeRig(PumpedRig):
    """One eye tracker, pumped at 90 Hz on a virtual clock."""

    def __init__(
        self, driver, simulator, *faults, seed=1, body=None, wrap=None, options=None, **sim
    ):
        self.clock = SimClock()
        self.body = body if body is not None else FixatingBody(5.0, 3.0)
        schedule = FaultSchedule.from_config(faults)
        self.simulator = simulator(self.body, clock=self.clock, seed=seed, faults=schedule, **sim)
        wire = MemoryTransport(self.simulator, self.clock)
        wire = wrap(wire, self.clock) if wrap else wire
        self.driver = driver("eyes", wire, self.clock, **(options or {}))
        self.listen()

    def kinds(self):
        return [event.kind for event in self.pump.take_events()]


def keeps_the_contract(make, let_pass):
    conformance.check_lifecycle(make, let_pass)
    conformance.check_batches(make, let_pass)
    conformance.check_eye_tracker(make, let_pass)


def let_pass_on(clock):
    return lambda s: clock.sleep_until_ns(clock.now_ns() + round(s * NS_PER_S))


def keeps_the_contract_in_memory(driver, simulator, **options):
    clock = SimClock()

    def make():
        peer = simulator(FixatingBody(), clock=clock, seed=1)
        return driver("eyes", MemoryTransport(peer, clock), clock, **options)

    keeps_the_contract(make, let_pass_on(clock))


def keeps_the_contract_on_a_replay(driver, simulator, path, **options):
    clock = SimClock()
    peer = simulator(FixatingBody(), clock=clock, seed=1)
    tee = TeeTransport(MemoryTransport(peer, clock), path, clock)
    recorded = driver("eyes", tee, clock, **options)
    conformance.collect(recorded, let_pass_on(clock), seconds=3.0)
    recorded.close()
    later = SimClock(3600 * NS_PER_S)
    keeps_the_contract(
        lambda: driver("eyes", ReplayTransport(path, later), later, **options), let_pass_on(later)
    )


def step_until(clock, pump, reached, patience_s=20.0):
    deadline_ns = clock.now_ns() + round(patience_s * NS_PER_S)
    while not reached():
        assert clock.now_ns() < deadline_ns, "did not happen in time"
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 1000)
        pump.step()


@contextlib.contextmanager
def pumped(device, clock):
    batches = []
    pump = Pump(device, batches.append, clock)
    pump.start()
    try:
        yield pump, batches
    finally:
        pump.stop()
        device.close()


def lose_for(simulator, clock, seconds):
    """Let the peer be gone from now on for a while; return when it is back."""
    since_s = (clock.now_ns() - simulator.source.origin_ns) / NS_PER_S
    simulator.source.faults = FaultSchedule((WireFault("disconnect", since_s, seconds),))
    return simulator.source.origin_ns + round((since_s + seconds) * NS_PER_S)

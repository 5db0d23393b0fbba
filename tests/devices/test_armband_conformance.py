"""Our armband keeps the contract: simulated, on a pseudo-terminal, as C, and played back."""

import contextlib
import os

import pytest

from tests.devices.band_makers import serial_armband, simulated_armband
from tests.devices.wire_ends.armband_machine import LockstepMachine, build
from visavis.devices import conformance
from visavis.devices.byte_links import MemoryLink
from visavis.devices.drivers.armband.dialect import FramedDialect
from visavis.devices.drivers.armband.driver import ArmbandDriver
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.devices.wirelog import ReplayLink, TeeLink
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.errors import DeviceNotFound


class Bench:
    """Factories for fresh devices that share one clock; `again` starts a replay afresh."""

    def __init__(self, clock, make):
        self.clock = clock
        self.make = make

    def let_pass(self, seconds):
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NS_PER_S))


def memory_link(stack, check, tmp_path):
    clock = SimClock()
    return Bench(clock, lambda: simulated_armband("arm", clock))


def pseudo_terminal(stack, check, tmp_path):
    pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
    if not hasattr(os, "openpty"):
        pytest.skip("this system has no pseudo-terminals; the memory link covers the driver")
    from tests.devices.wire_ends.armband_pty import PtyArmband

    clock = SystemClock()
    peer = stack.enter_context(PtyArmband(clock))

    def make():
        device = serial_armband("arm", clock, port=peer.port)
        stack.callback(device.close)
        return device

    return Bench(clock, make)


def firmware_in_simavr(stack, check, tmp_path):
    try:
        command = build("simavr", tmp_path)
    except DeviceNotFound as missing:
        pytest.skip(f"{missing}; the Python simulator serves instead")
    clock = SimClock()
    machine = stack.enter_context(LockstepMachine(command))
    return Bench(clock, lambda: serial_armband("arm", clock, link=MemoryLink(machine, clock)))


def replay(stack, check, tmp_path):
    clock = SimClock()
    path = tmp_path / "bras gauche é.wire"
    peer = ArmbandSimulator("arm", clock)
    tee = TeeLink(MemoryLink(peer, clock), path, clock)
    recorded = Bench(clock, lambda: serial_armband("arm", clock, link=tee))
    check(recorded)
    tee.end()
    later = SimClock(3600 * NS_PER_S)
    link = ReplayLink(path, later)
    return Bench(later, lambda: serial_armband("arm", later, link=link))


CHECKS = {
    "life": lambda bench: conformance.check_lifecycle(bench.make, bench.let_pass),
    "batches": lambda bench: conformance.check_batches(bench.make, bench.let_pass),
    "armband": lambda bench: conformance.check_armband(bench.make, bench.let_pass),
}


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
@pytest.mark.parametrize(
    "wire", [memory_link, pseudo_terminal, firmware_in_simavr, replay], ids=lambda f: f.__name__
)
def test_armband_keeps_its_contract(wire, check, tmp_path):
    with contextlib.ExitStack() as stack:
        check(wire(stack, check, tmp_path))


def test_replay_acknowledges_what_was_acknowledged(tmp_path):
    def acknowledged(bench):
        device = bench.make()
        batches = []
        device.open(2.0)
        device.start(batches.append)
        device.set_amplitudes((1,) * 4, 500)
        for _ in range(20):
            bench.let_pass(0.01)
            device.keep_alive()
            device.poll(0.0)
        device.close()
        rows = [row for b in batches if b.schema.name == "haptics" for row in b.values]
        return [(int(r["command"]), int(r["kind"]), bool(r["acknowledged"])) for r in rows]

    said = []
    bench = replay(None, lambda recorded: said.append(acknowledged(recorded)), tmp_path)

    assert acknowledged(bench) == said[0]
    assert (0, 0, True) in said[0]


def test_suite_finds_a_band_that_takes_any_amplitude():
    class Careless(ArmbandDriver):
        def set_amplitudes(self, amplitudes_01, ttl_ms, rates_hz=None):
            return super().set_amplitudes([1.0] * 4, max(1, ttl_ms), rates_hz)

    clock = SimClock()

    def make():
        peer = ArmbandSimulator("arm", clock)
        return Careless("arm", MemoryLink(peer, clock), FramedDialect(), clock)

    bench = Bench(clock, make)
    with pytest.raises(AssertionError, match="wrong amplitudes are refused"):
        conformance.check_armband(bench.make, bench.let_pass)

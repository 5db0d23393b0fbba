"""Nothing waits for ever for a band: neither a session's driver nor the machine of a test."""

import os
import stat

import pytest

from benchmarks.armband_round_trip import bare_round_trips_ms
from tests.devices.wire_ends.armband_machine import TerminalMachine
from visavis.devices.byte_links import MemoryLink
from visavis.devices.registry import driver_wiring
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.errors import DeviceTimeout

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a pseudo-terminal is POSIX")


@pytest.fixture
def still_machine(tmp_path):
    """A program that opens and never moves a motor."""
    program = tmp_path / "still"
    program.write_text("#!/bin/sh\necho P /dev/null\necho D 0 0 0 0 0 0\nread line\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    with TerminalMachine([str(program)]) as machine:
        yield machine


def test_motors_that_never_run_are_told_with_a_reason(still_machine):
    with pytest.raises(DeviceTimeout, match=r"motors did not run within 0\.2 s"):
        still_machine.wait_for(running=True, within_s=0.2)


def test_a_host_that_is_gone_is_not_waited_for(still_machine):
    begun_ns = SystemClock().now_ns()

    with pytest.raises(DeviceTimeout, match="the host program ended"):
        still_machine.wait_for(running=True, within_s=30.0, host_runs=lambda: False)
    assert SystemClock().now_ns() - begun_ns < 5 * NS_PER_S


def test_a_lost_answer_ends_the_benchmark_with_a_reason():
    own, other = os.openpty()
    try:
        with pytest.raises(DeviceTimeout, match="no whole answer within"):
            bare_round_trips_ms(os.ttyname(other), 1, within_s=0.1)
    finally:
        os.close(own)
        os.close(other)


def test_a_slow_answer_at_the_start_is_waited_for():
    clock = SimClock()
    driver = driver_wiring("serial_armband").on_wire(
        "arm", clock, MemoryLink(ArmbandSimulator("arm", clock, latency_ms=400.0), clock)
    )
    driver.open(30.0)

    driver.start(lambda batch: None)  # it took more than half a second to be armed
    driver.close()


def test_a_band_that_goes_silent_before_the_start_is_named_within_seconds():
    clock = SimClock()
    peer = ArmbandSimulator("arm", clock)
    driver = driver_wiring("serial_armband").on_wire("arm", clock, MemoryLink(peer, clock))
    driver.open(1.0)
    peer.accept = lambda data, t_ns: None
    begun_ns = clock.now_ns()

    with pytest.raises(DeviceTimeout, match=r"arm: the band does not answer; check that the band"):
        driver.start(lambda batch: None)
    assert clock.now_ns() - begun_ns < 3 * NS_PER_S

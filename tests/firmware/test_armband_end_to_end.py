"""The real driver against the firmware itself: in lockstep on a virtual clock, and on a tty."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from tests.devices.band_makers import serial_armband
from tests.devices.wire_ends.armband_machine import LockstepMachine, TerminalMachine
from visavis.devices.byte_links import MemoryLink
from visavis.devices.contracts import CONTACT_PATTERN, HAPTICS, DeviceState
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock, SystemClock
from visavis.lab.clock_fit import fit_clock

FULL = (255, 255, 255, 255)
OFF = (0, 0, 0, 0)


class Pair:
    """The driver and a machine, polled at 90 Hz on a virtual clock."""

    def __init__(self, machine):
        self.clock = SimClock()
        self.machine = machine
        self.driver = serial_armband("arm", self.clock, link=MemoryLink(machine, self.clock))
        self.batches = []
        self.driver.open(2.0)
        self.driver.start(self.batches.append)

    def run(self, seconds, *, alive=True):
        end_ns = self.clock.now_ns() + round(seconds * NS_PER_S)
        while self.clock.now_ns() < end_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_S // 90)
            if alive:
                self.driver.keep_alive()
            self.driver.poll(0.0)
        return self

    def rows(self, kind):
        values = np.concatenate([b.values for b in self.batches if b.schema is HAPTICS])
        return values[values["kind"] == kind]

    def silent_after_us(self, t_ns):
        return next(
            c.t_us - t_ns / 1000
            for c in self.machine.changes
            if c.t_us * 1000 >= t_ns and not any(c.duties)
        )


@pytest.fixture(params=["simavr", "host"])
def pair(request, built):
    with LockstepMachine(built(request.param)) as machine:
        yield Pair(machine)


def test_commands_reach_the_motors_and_are_acknowledged(pair):
    pair.driver.set_amplitudes((1, 0.5, 0, 0.25), 1000)
    pair.run(0.1)
    assert pair.machine.duties == (255, 185, 0, 150)
    assert pair.rows(0)["acknowledged"].all()
    pair.driver.play(CONTACT_PATTERN, (3,))
    pair.run(0.5)
    assert pair.machine.duties[3] >= 115
    assert pair.rows(1)["acknowledged"].all()
    pair.driver.silence()
    pair.run(0.1)
    assert pair.machine.duties == OFF


def test_hung_experiment_loop_falls_silent_within_300_ms(pair):
    pair.driver.set_amplitudes((1,) * 4, 5000)
    pair.run(0.5)
    stalled_ns = pair.clock.now_ns()
    pair.run(0.4, alive=False)

    assert pair.silent_after_us(stalled_ns) < 300_000


def test_host_that_is_gone_is_followed_by_silence_within_300_ms(pair):
    pair.driver.set_amplitudes((1,) * 4, 5000)
    pair.run(0.5)
    gone_ns = pair.clock.now_ns()
    pair.clock.sleep_until_ns(gone_ns + 400 * NS_PER_MS)
    pair.machine.run_to(pair.clock.now_ns() // 1000)

    assert pair.silent_after_us(gone_ns) < 300_000


def test_band_that_starts_anew_is_silent_and_comes_back_armed(pair):
    pair.driver.set_amplitudes((1,) * 4, 5000)
    pair.run(0.2)
    pair.machine.hang()
    with pytest.raises(Exception, match="started anew"):
        pair.run(1.0)
    assert pair.machine.duties == OFF
    pair.run(1.0)
    assert pair.driver.state is DeviceState.STREAMING
    assert pair.machine.duties == OFF
    pair.driver.set_amplitudes((1,) * 4, 500)
    pair.run(0.1)
    assert pair.machine.duties == FULL


def test_clock_of_the_firmware_is_found_within_a_millisecond(pair):
    pair.run(3.0)
    fit = fit_clock(pair.driver.clock_pairs())
    at_ns = pair.clock.now_ns()
    found_ns = int(fit.to_host_ns(np.array([at_ns]))[0])
    assert found_ns == pytest.approx(at_ns, abs=NS_PER_MS)


HOST_PROGRAM = """
import sys
from tests.devices.band_makers import serial_armband
from visavis.lab.clock import SystemClock
driver = serial_armband("arm", SystemClock(), port=sys.argv[1])
driver.open(20.0)
driver.start(lambda batch: None)
driver.set_amplitudes((1, 1, 1, 1), 10_000)
while True:
    driver.keep_alive()
    driver.poll(0.02)
"""


@pytest.mark.parametrize("kind", ["simavr", "host"])
def test_killed_host_is_followed_by_silence_within_300_ms(built, kind):
    pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
    with TerminalMachine(built(kind)) as machine:
        program = [sys.executable, "-c", HOST_PROGRAM, machine.port]
        host = subprocess.Popen(program, cwd=os.getcwd())
        machine.wait_for(running=True)
        os.kill(host.pid, signal.SIGKILL)
        host.wait()
        off = machine.wait_for(running=False)

    last_us = machine.received_us[-1][0]
    assert 200_000 < off.t_us - last_us <= 300_000


GUARDED_PROGRAM = """
import sys
from tests.devices.band_makers import serial_armband
from visavis.devices.haptic_safety import HapticGuard
from visavis.devices.pump import Pump
from visavis.lab.clock import SystemClock
clock = SystemClock()
driver = serial_armband("arm", clock, port=sys.argv[1])
driver.open(20.0)
pump = Pump(driver, lambda batch: None, clock)
pump.start()
with HapticGuard({"arm": driver}, clock) as guard:
    driver.set_amplitudes((1, 1, 1, 1), 10_000)
    until_ns = clock.now_ns() + 300_000_000
    while sys.argv[2] == "ticks" or clock.now_ns() < until_ns:
        guard.tick()
        pump.step()
        clock.sleep_until_ns(clock.now_ns() + 5_000_000)
    while True:
        pass
"""


def start_guarded(machine, how):
    program = [sys.executable, "-c", GUARDED_PROGRAM, machine.port, how]
    host = subprocess.Popen(program, cwd=os.getcwd())
    machine.wait_for(running=True)
    return host


def test_terminated_host_says_stop_before_it_dies(built):
    pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
    with TerminalMachine(built("simavr")) as machine:
        host = start_guarded(machine, "ticks")
        host.terminate()
        off = machine.wait_for(running=False)
        host.wait()

    assert -signal.SIGTERM == host.returncode
    assert off.t_us - machine.received_us[-1][0] < 100_000


def test_loop_that_hangs_is_silenced_although_the_program_lives(built):
    pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
    with TerminalMachine(built("simavr")) as machine:
        host = start_guarded(machine, "hangs")
        off = machine.wait_for(running=False)
        alive = host.poll() is None
        host.kill()
        host.wait()

    assert alive
    assert off.t_us - machine.received_us[-1][0] < 100_000


def test_closed_driver_leaves_silence_on_a_terminal(built):
    pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
    with TerminalMachine(built("simavr")) as machine:
        driver = serial_armband("arm", SystemClock(), port=machine.port)
        driver.open(20.0)
        driver.start(lambda batch: None)
        driver.set_amplitudes((1,) * 4, 10_000)
        machine.wait_for(running=True)
        driver.close()
        off = machine.wait_for(running=False)

    assert off.duties == OFF
    assert driver.state is DeviceState.CLOSED

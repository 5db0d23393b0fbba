"""However a session ends, armbands are silent."""

import os
import signal
import subprocess
import sys

import pytest

from tests.devices.test_armband_driver import ON, Band
from visavis.devices.haptic_safety import HapticGuard
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock, SystemClock

OFF = (0, 0, 0, 0)


class Counting:
    def __init__(self, failure=None):
        self.silenced = self.kept = 0
        self.failure = failure

    def keep_alive(self):
        self.kept += 1

    def silence(self):
        self.silenced += 1
        if self.failure:
            raise self.failure
        return 0


def test_leaving_the_block_silences():
    band = Band().start()
    with HapticGuard({"arm": band.driver}, band.clock, handle_signals=False) as guard:
        band.driver.set_amplitudes(ON, 5000)
        band.run(0.1, each=guard.tick)
        assert any(band.duties)
    band.run(0.05)
    assert band.duties == OFF


def experiment_that_fails(band):
    with HapticGuard({"arm": band.driver}, band.clock, handle_signals=False):
        band.driver.set_amplitudes(ON, 5000)
        band.run(0.1)
        raise ZeroDivisionError


def test_exception_in_the_experiment_silences_and_goes_on():
    band = Band().start()
    with pytest.raises(ZeroDivisionError):
        experiment_that_fails(band)
    band.run(0.05)
    assert band.duties == OFF


def test_band_that_fails_to_fall_silent_does_not_keep_the_others_running():
    bands = {"left": Counting(OSError("gone")), "right": Counting()}
    with HapticGuard(bands, SimClock(), handle_signals=False):
        pass
    assert bands["right"].silenced == 1


def test_loop_that_stands_still_is_silenced_once_until_it_ticks_again():
    clock, band = SimClock(), Counting()
    with HapticGuard({"arm": band}, clock, handle_signals=False) as guard:
        clock.sleep_until_ns(100 * NS_PER_MS)
        assert not guard.look()
        clock.sleep_until_ns(151 * NS_PER_MS)
        assert guard.look()
        assert guard.look()
        assert (1, 1) == (band.silenced, guard.standstills)
        guard.tick()
        assert not guard.look()


def test_watching_thread_silences_a_hung_loop_by_itself():
    clock, band = SystemClock(), Counting()
    with HapticGuard({"arm": band}, clock, standstill_ms=1, handle_signals=False):
        deadline_ns = clock.now_ns() + 10 * NS_PER_S
        while not band.silenced and clock.now_ns() < deadline_ns:
            clock.sleep_until_ns(clock.now_ns() + NS_PER_MS)
        assert band.silenced == 1


def test_tick_keeps_the_bands_alive():
    band = Counting()
    with HapticGuard({"arm": band}, SimClock(), handle_signals=False) as guard:
        guard.tick()
    assert band.kept == 1


PROGRAM = """
import os, signal, sys
from visavis.devices.haptic_safety import HapticGuard
from visavis.lab.clock import SimClock

class Told:
    def keep_alive(self): pass
    def silence(self):
        os.write(1, b"silent ")
        return 0

# A job in the background of a shell inherits some signals ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
for number in (signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, signal.SIG_DFL)
guard = HapticGuard({"arm": Told()}, SimClock())
guard.__enter__()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX systems")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signal_silences_and_then_does_what_it_would_have_done(name):
    number = getattr(signal, name)
    program = PROGRAM + f"os.kill(os.getpid(), {int(number)})\nsignal.pause()"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, timeout=60)

    assert done.stdout.startswith(b"silent")
    assert done.returncode == -number


def test_interpreter_exit_silences():
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM + "sys.exit(3)"], capture_output=True, timeout=60
    )
    assert (3, b"silent ") == (done.returncode, done.stdout)


def test_signal_in_the_midst_of_a_command_still_silences():
    band = Band().start()
    write = band.peer.accept

    def interrupted(data, t_ns):
        band.peer.accept = write
        write(data[:7], t_ns)
        band.driver.silence()
        write(data[7:], t_ns)

    band.peer.accept = interrupted
    band.driver.set_amplitudes(ON, 5000)
    band.run(0.1)
    assert band.duties == OFF

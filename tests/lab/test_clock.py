"""The system's clock: fine enough to stamp samples by, and awake in time."""

import sys
import time
from dataclasses import replace

import pytest

from tests.faults.sessions import lab, request
from visavis.cli.doctor import machine
from visavis.lab.clock import (
    NS_PER_MS,
    SimClock,
    SystemClock,
    clock_step_ns,
    require_fine_clock,
)
from visavis.lab.errors import ConfigError
from visavis.running.sessions.perform import perform_new


class Ticking:
    """A counter that moves in steps while it is read, and sleeps as coarsely as it is told."""

    def __init__(self, step_ns, reading_ns=100, late_ns=0):
        self.true_ns, self._step_ns = 0, step_ns
        self._reading_ns, self._late_ns = reading_ns, late_ns

    def counter_ns(self):
        self.true_ns += self._reading_ns
        return self.true_ns // self._step_ns * self._step_ns

    def sleep_s(self, seconds):
        if seconds > 0:
            self.true_ns += round(seconds * 1e9) + self._late_ns


def test_session_time_is_the_performance_counter():
    before_ns = time.perf_counter_ns()
    now_ns = SystemClock().now_ns()

    assert before_ns <= now_ns <= time.perf_counter_ns()


@pytest.mark.skipif(sys.platform != "linux", reason="the clocks differ elsewhere")
def test_on_linux_it_is_the_monotonic_clock_of_lsl_and_openxr():
    before_ns = time.monotonic_ns()
    now_ns = SystemClock().now_ns()

    assert before_ns <= now_ns <= time.monotonic_ns()


def test_this_computers_clock_is_fine_enough():
    assert clock_step_ns(SystemClock()) <= 100_000
    require_fine_clock(SystemClock())


def test_a_clock_of_windows_timer_ticks_is_refused_with_the_reason():
    coarse = SystemClock(Ticking(15_625_000, reading_ns=50_000).counter_ns)

    assert clock_step_ns(coarse) == 15_625_000
    with pytest.raises(ConfigError, match=r"moves in steps of 15\.625 ms.*event timer"):
        require_fine_clock(coarse)


def test_doctor_says_that_a_coarse_clock_is_no_clock_for_sessions():
    ticking = Ticking(15_625_000, reading_ns=50_000)
    finding = machine._clock(SystemClock(ticking.counter_ns, ticking.sleep_s, spin_ns=0))

    assert ("clock", "missing") == (finding.subject, finding.level)
    assert "moves in steps of 15.625 ms" in finding.found
    assert "event timer" in finding.remedy


def test_doctor_finds_a_fine_clock_ready():
    ticking = Ticking(100)

    assert "ok" == machine._clock(SystemClock(ticking.counter_ns, ticking.sleep_s)).level


def test_no_session_begins_on_a_coarse_clock(tmp_path):
    ticking = Ticking(15_625_000, reading_ns=50_000)
    coarse = SystemClock(ticking.counter_ns, ticking.sleep_s, spin_ns=0)

    with pytest.raises(ConfigError, match=r"moves in steps of 15\.625 ms"):
        perform_new(replace(request(lab(tmp_path)), clock=coarse))
    assert [] == list(tmp_path.iterdir())


def test_a_virtual_clock_has_no_steps():
    assert clock_step_ns(SimClock()) == 0


def test_a_sleeper_woken_late_is_still_in_time():
    ticking = Ticking(100, late_ns=1_200_000)
    clock = SystemClock(ticking.counter_ns, ticking.sleep_s, spin_ns=1_500_000)

    clock.sleep_until_ns(10 * NS_PER_MS)

    assert 10 * NS_PER_MS <= ticking.true_ns <= 10.5 * NS_PER_MS


def test_sleeping_ends_within_half_a_millisecond():
    clock, late_ns = SystemClock(), []
    for _ in range(20):
        deadline_ns = clock.now_ns() + 2 * NS_PER_MS
        clock.sleep_until_ns(deadline_ns)
        late_ns.append(clock.now_ns() - deadline_ns)

    assert min(late_ns) >= 0
    assert sorted(late_ns)[5] <= 500_000  # the computer may be busy; the clock itself is not late

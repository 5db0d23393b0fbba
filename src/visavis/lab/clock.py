"""Read time: the one module that may import `time`."""

import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Protocol

from visavis.lab.errors import ConfigError

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
NEVER_NS = 2**62
"""A time that does not come."""
SIMULATED_EPOCH_ISO = "2000-01-01T00:00:00+00:00"


class Clock(Protocol):
    """Session time in integer nanoseconds on one monotonic clock."""

    @property
    def is_virtual(self) -> bool:
        """Tell whether time jumps instead of passing."""
        ...

    def now_ns(self) -> int:
        """Return the current session time."""
        ...

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Return once `now_ns() >= deadline_ns`; at once when that is already so."""
        ...

    def wall_iso(self) -> str:
        """Return wall time, ISO 8601 with offset; for manifests only."""
        ...


SPIN_NS = 1_500_000 if sys.platform == "win32" else 0
"""Time before a deadline in which the clock is polled, because Windows may wake a sleeper this
late."""

MAX_STEP_NS = 100_000
"""Largest usable clock step. With coarser steps, samples within one frame get the same time."""

STEPS_LOOKED_AT = 9
MAX_LOOK_NS = NS_PER_S
MAX_LOOKS = 50_000_000


class SystemClock:
    """The machine's performance counter, monotonic; sleeping really sleeps.

    On Linux and macOS it is the monotonic clock itself; on Windows that one moves in steps of
    15.6 ms before Python 3.13. `counter_ns`, `sleep_s` and `spin_ns` stand in for it in tests.
    """

    is_virtual = False

    def __init__(
        self,
        counter_ns: Callable[[], int] = time.perf_counter_ns,
        sleep_s: Callable[[float], None] = time.sleep,
        spin_ns: int = SPIN_NS,
    ) -> None:
        self._counter_ns = counter_ns
        self._sleep_s = sleep_s
        self._spin_ns = spin_ns

    def now_ns(self) -> int:
        """Return the performance counter's nanoseconds."""
        return self._counter_ns()

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Sleep until the deadline; poll the clock at its end where sleeping is coarse."""
        while (left_ns := deadline_ns - self._counter_ns()) > 0:
            self._sleep_s(max(0, left_ns - self._spin_ns) / NS_PER_S)

    def wall_iso(self) -> str:
        """Return local wall time with its offset."""
        return datetime.now().astimezone().isoformat(timespec="milliseconds")


class SimClock:
    """A virtual clock: sleeping jumps, and wall time is a fixed epoch so that runs repeat."""

    is_virtual = True

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Return virtual time."""
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Jump to the deadline; never backwards."""
        if deadline_ns > self._now_ns:
            self._now_ns = deadline_ns

    def wall_iso(self) -> str:
        """Return the fixed date of every simulated session."""
        return SIMULATED_EPOCH_ISO


class StampClock:
    """A clock that follows time stamps, for data recorded elsewhere; it never goes back.

    Session time is the time of the latest stamp since 1970.
    """

    is_virtual = False

    def __init__(self, start_unix_ms: float) -> None:
        self._now_ns = round(start_unix_ms * NS_PER_MS)

    def tell(self, unix_ms: float) -> None:
        """Advance to a stamp."""
        self.sleep_until_ns(round(unix_ms * NS_PER_MS))

    def now_ns(self) -> int:
        """Return the latest time."""
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Jump to the deadline; never backwards."""
        self._now_ns = max(self._now_ns, deadline_ns)

    def wall_iso(self) -> str:
        """Return the latest time, in UTC."""
        wall_time = datetime.fromtimestamp(self._now_ns / NS_PER_S, tz=UTC)
        return wall_time.isoformat(timespec="milliseconds")


def clock_step_ns(clock: Clock) -> int:
    """Return the smallest observed step of a clock in ns; 0 for a virtual clock.

    The clock is polled for one second at most; one that does not move counts as one second coarse.
    """
    if clock.is_virtual:
        return 0
    first_ns = last_ns = clock.now_ns()
    least_ns, n_steps = MAX_LOOK_NS, 0
    for _ in range(MAX_LOOKS):
        now_ns = clock.now_ns()
        if now_ns != last_ns:
            least_ns, last_ns, n_steps = min(least_ns, now_ns - last_ns), now_ns, n_steps + 1
        if n_steps == STEPS_LOOKED_AT or now_ns - first_ns > MAX_LOOK_NS:
            break
    return least_ns


def require_fine_clock(clock: Clock) -> None:
    """Raise ConfigError, with the reason, when a clock is too coarse to stamp samples."""
    step_ns = clock_step_ns(clock)
    if step_ns > MAX_STEP_NS:
        raise ConfigError(
            f"this computer's clock moves in steps of {step_ns / NS_PER_MS:g} ms, more than "
            f"{MAX_STEP_NS / NS_PER_MS:g} ms, so all samples within a frame would get one time; "
            "switch the high precision event timer on in the computer's firmware, or use another "
            "computer"
        )


class StopWatch:
    """Measure elapsed real time for progress displays and benchmarks, never for data."""

    def __init__(self) -> None:
        self._started_s = time.perf_counter()

    def elapsed_s(self) -> float:
        """Return seconds since construction."""
        return time.perf_counter() - self._started_s


def cpu_time_s() -> float:
    """Return the CPU seconds this process has used; for benchmarks."""
    return time.process_time()

"""Read time: the one module that may import `time`."""

import time
from datetime import datetime
from typing import Protocol

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
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


class SystemClock:
    """The machine's monotonic clock; sleeping really sleeps."""

    is_virtual = False

    def now_ns(self) -> int:
        """Return the monotonic clock's nanoseconds."""
        return time.monotonic_ns()

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Sleep until the deadline."""
        while (left_ns := deadline_ns - time.monotonic_ns()) > 0:
            time.sleep(left_ns / NS_PER_S)

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
        """Return the epoch every simulated session claims."""
        return SIMULATED_EPOCH_ISO


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

"""Count what a stream delivers: rate, gaps, repeated and backward stamps."""

from collections import deque
from collections.abc import Iterable

from visavis.devices.contracts import DeviceState, Health
from visavis.lab.clock import NS_PER_MS, NS_PER_S

GAP_PERIODS = 1.5
"""A spacing of device stamps above this many nominal periods is a gap."""

RATE_WINDOW_MARKS = 10
RATE_MARK_NS = NS_PER_S // 2


class StreamMeter:
    """Count one stream's samples; the rate is over about the last five seconds of arrival."""

    def __init__(self, nominal_rate_hz: float) -> None:
        self._nominal_rate_hz = nominal_rate_hz
        self._gap_ns = round(GAP_PERIODS * NS_PER_S / nominal_rate_hz) if nominal_rate_hz else 0
        self.sample_count = 0
        self.gaps = 0
        self.longest_gap_ns = 0
        self.repeat_count = 0
        self.backward = 0
        self.last_host_ns: int | None = None
        self._last_device_ns: int | None = None
        self._marks: deque[tuple[int, int]] = deque(maxlen=RATE_WINDOW_MARKS + 1)
        self._next_mark_ns = -(2**62)

    def update(self, t_device_ns: Iterable[int], t_host_ns: int) -> None:
        """Take the device stamps of a batch and the arrival of its last sample."""
        last = self._last_device_ns
        count = self.sample_count
        for stamp in t_device_ns:
            if last is not None:
                step = stamp - last
                if step > self._gap_ns > 0:
                    self.gaps += 1
                    self.longest_gap_ns = max(self.longest_gap_ns, step)
                elif step == 0:
                    self.repeat_count += 1
                elif step < 0:
                    self.backward += 1
            last = stamp
            count += 1
        self._last_device_ns = last
        self.sample_count = count
        self.last_host_ns = t_host_ns
        if t_host_ns >= self._next_mark_ns:
            self._marks.append((t_host_ns, count))
            self._next_mark_ns = t_host_ns + RATE_MARK_NS

    def health(self, state: DeviceState, now_ns: int) -> Health:
        """Report the counts; the caller adds what it knows of clock, battery and reconnects."""
        age_ms = None
        if self.last_host_ns is not None:
            age_ms = max(0, now_ns - self.last_host_ns) / NS_PER_MS
        return Health(
            state=state,
            received=self.sample_count,
            rate_hz=self._rate_hz(now_ns),
            gaps=self.gaps,
            longest_gap_ms=self.longest_gap_ns / NS_PER_MS,
            last_sample_age_ms=age_ms,
            nominal_rate_hz=self._nominal_rate_hz,
        )

    def _rate_hz(self, now_ns: int) -> float:
        if not self._marks:
            return 0.0
        since_ns, count_then = self._marks[0]
        elapsed_ns = now_ns - since_ns
        return (self.sample_count - count_then) * NS_PER_S / elapsed_ns if elapsed_ns > 0 else 0.0

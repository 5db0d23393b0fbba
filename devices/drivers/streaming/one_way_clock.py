"""Follow a one-way device clock: the least delayed arrivals, and jumps of the clock."""

from collections.abc import Sequence

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.lab.clock_fit import ClockFit, fit_one_way

BUCKET_NS = 100 * NS_PER_MS
MAX_BUCKETS = 6000
JUMP_NS = 250 * NS_PER_MS


class OneWayClock:
    """Keep, per 100 ms of arrival, the sample with the least arrival − device time.

    A device stamp that steps further ahead than the arrivals do by more than 250 ms, or back by
    more, is a jump. All samples are then forgotten, because no single line fits both sides. The
    meter counts smaller steps as gaps, repeats and backward stamps.
    """

    def __init__(self) -> None:
        self.jumps_ms: list[float] = []
        self._best: list[tuple[int, int]] = []
        self._bucket = 0
        self._last: tuple[int, int] | None = None

    def add(self, t_device_ns: Sequence[int], t_host_ns: Sequence[int]) -> None:
        """Take a batch's stamps in arrival order."""
        for device, host in zip(t_device_ns, t_host_ns, strict=True):
            self._add(device, host)

    def restart(self) -> None:
        """Forget all samples, as after reconnecting to a device that was restarted."""
        self._best.clear()
        self._last = None

    def fit(self) -> ClockFit | None:
        """Return the lower-envelope fit; None while there are too few samples."""
        if len(self._best) < 2 or self._best[0][0] == self._best[-1][0]:
            return None
        table = np.array(self._best, np.int64)
        return fit_one_way(table[:, 0], table[:, 1])

    def _add(self, device: int, host: int) -> None:
        last, self._last = self._last, (device, host)
        if last is not None:
            step = device - last[0]
            if step - (host - last[1]) > JUMP_NS or step < -JUMP_NS:
                self.jumps_ms.append((step - (host - last[1])) / NS_PER_MS)
                self._best.clear()
        bucket = host // BUCKET_NS
        if not self._best or bucket != self._bucket:
            self._bucket = bucket
            self._best.append((device, host))
            if len(self._best) > MAX_BUCKETS:
                del self._best[: MAX_BUCKETS // 10]
        elif host - device < self._best[-1][1] - self._best[-1][0]:
            self._best[-1] = (device, host)

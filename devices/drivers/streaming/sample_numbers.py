"""Number a stream's samples by the device's own counter: a hole is a loss."""


class SampleNumbers:
    """Turn a counter, which may restart or be missing, into `seq`; `lost_count` counts the holes.

    A step of more than `most_lost` is a restarted counter, not a loss.
    """

    def __init__(self, most_lost: int) -> None:
        self._most_lost = most_lost
        self._seq = -1
        self._counter: int | None = None
        self.lost_count = 0

    def forget_counter(self) -> None:
        """Accept any next counter: samples missed meanwhile are a gap, not a loss."""
        self._counter = None

    def following(self, counter: int | None) -> int:
        """Return the number of the next sample; `counter` is None where the device has none."""
        step, most, before = 1, self._most_lost, self._counter
        if counter is not None:
            if before is not None and 1 < counter - before <= most:
                step = counter - before
                self.lost_count += step - 1
            if before is None or not -most < counter - before <= 0:
                self._counter = counter
        self._seq += step
        return self._seq

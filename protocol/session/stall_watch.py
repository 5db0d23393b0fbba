"""Notice when the session itself stood still: no frame came, so nothing was shown or answered."""

from visavis.lab.clock import NS_PER_MS, NS_PER_S

STALL_NS = 250 * NS_PER_MS
"""A picture that stands for this long is a stall, not a dropped frame or two."""


class StallWatch:
    """Tell from the times of frames how long the picture stood still."""

    def __init__(self) -> None:
        self._last_ns = 0
        self._allowed = 1

    def allow(self, frames: int) -> None:
        """Do not count the time to the coming frames: something is asked, or made ready."""
        self._allowed = frames

    def stood_ns(self, t_ns: int) -> int:
        """Return how long the picture stood still before this frame, 0 for no stall."""
        gap_ns, self._last_ns = t_ns - self._last_ns, t_ns
        if self._allowed:
            self._allowed -= 1
            return 0
        return gap_ns if gap_ns >= STALL_NS else 0


def as_reason(stood_ns: int) -> str:
    """Return the length of a stall as the reason in a trial's row."""
    return f"the picture stood still for {stood_ns / NS_PER_S:.1f} s"

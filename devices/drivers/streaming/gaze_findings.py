"""Faults of an eye tracker, with remedies for the operator."""

from collections import deque
from collections.abc import Sequence

from visavis.devices.contracts import Fault
from visavis.devices.meter import StreamMeter

ANSWERS_MISSED_S = 3.0
EYES_LOST_BELOW_01 = 0.1
MIN_SAMPLES = 20
RECENT_S = 2.5
"""How far back eyes that are hardly seen are looked for."""


def recent_samples(rate_hz: float) -> int:
    """Return how many samples are looked back over: enough to judge by at slow and unknown rates
    (0), too.
    """
    return max(MIN_SAMPLES, round(RECENT_S * rate_hz))


class SeenEyes:
    """Count the last samples, at least `most` once there are as many, in which each eye was valid.

    It does not matter much how many came at once.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._counts: deque[tuple[int, int, int]] = deque()
        self.samples = self.left = self.right = 0

    def add(self, samples: int, left: int, right: int) -> None:
        """Take the counts of what came at once, and forget the oldest beyond the limit."""
        self._counts.append((samples, left, right))
        self.samples += samples
        self.left += left
        self.right += right
        while self.samples - self._counts[0][0] >= self._most:
            samples, left, right = self._counts.popleft()
            self.samples -= samples
            self.left -= left
            self.right -= right


def stream_faults(
    role: str,
    meter: StreamMeter,
    *,
    malformed: int,
    lost_count: int,
    jumps_ms: Sequence[float],
    unanswered_s: float,
    remedy: str,
) -> list[Fault]:
    """Return faults of stream and clock; `remedy` is for a tracker that does not answer."""
    faults: list[Fault] = []

    def warn(message: str, remedy: str) -> None:
        faults.append(Fault(role, "warning", message, remedy))

    if malformed:
        text = f"{malformed} messages could not be read"
        warn(text, "keep the .wire log and report it")
    if lost_count:
        warn(f"{lost_count} samples were lost on the way", "check cable, network and load")
    if jumps_ms:
        text = f"the tracker's clock jumped {len(jumps_ms)} times, last by {jumps_ms[-1]:.0f} ms"
        warn(text, "stop other programs that set the tracker's clock")
    for count, what in ((meter.repeat_count, "repeated"), (meter.backward, "backward")):
        if count:
            warn(f"{count} {what} time stamps", "restart the tracker if they go on")
    if unanswered_s > ANSWERS_MISSED_S:
        warn(f"no answer to time requests for {unanswered_s:.0f} s", remedy)
    return faults


def eye_faults(role: str, seen_eyes: SeenEyes) -> list[Fault]:
    """Return faults for eyes that were hardly seen lately."""
    if seen_eyes.samples < MIN_SAMPLES:
        return []
    counts = {"left": seen_eyes.left, "right": seen_eyes.right}
    lost_eyes = [eye for eye, n in counts.items() if n / seen_eyes.samples < EYES_LOST_BELOW_01]
    remedy = "adjust the tracker and its wearer, then calibrate again"
    if len(lost_eyes) == len(counts):
        return [Fault(role, "blocking", "neither eye is seen", remedy)]
    return [Fault(role, "warning", f"the {eye} eye is not seen", remedy) for eye in lost_eyes]

"""Put what a Pupil Core driver noticed into words for the operator."""

from collections import deque
from dataclasses import dataclass, field

from devices.contracts import Fault
from devices.meter import StreamMeter

STOPPED = {
    "eye_process.stopped": "the eye camera's process stopped",
    "world_process.stopped": "Pupil Capture's main process stopped",
    "service_process.stopped": "Pupil Service stopped",
    "launcher_process.should_stop": "Pupil Capture is closing",
    "stop_plugin": "a plug-in of Pupil Capture stopped",
}
STARTED_AGAIN = {"eye_process.started": "eye_process.stopped"}
EYE_NAMES = {0: "right", 1: "left"}
EYES_LOST_BELOW_01 = 0.1
ANSWERS_MISSED_S = 3.0
FEWEST_SAMPLES = 20


@dataclass
class Findings:
    """What a driver counted since start."""

    calibrated: bool = False
    malformed: int = 0
    clock_jumps_ms: list[float] = field(default_factory=list)
    stopped: dict[str, str] = field(default_factory=dict)

    def note(self, subject: str, eye_id: object = None) -> None:
        """Remember a notification about a part that stopped, or started again."""
        eye = EYE_NAMES.get(eye_id, "") if isinstance(eye_id, int) else ""
        if subject in STOPPED:
            self.stopped[f"{subject} {eye}"] = f"{STOPPED[subject]}{f' ({eye})' if eye else ''}"
        elif subject in STARTED_AGAIN:
            self.stopped.pop(f"{STARTED_AGAIN[subject]} {eye}", None)


class SeenEyes:
    """Count in how many of the samples of the last polls each eye was valid."""

    def __init__(self, polls: int) -> None:
        self._polls = polls
        self._counts: deque[tuple[int, int, int]] = deque()
        self.samples = self.left = self.right = 0

    def add(self, samples: int, left: int, right: int) -> None:
        """Take one poll's counts and forget the oldest beyond the limit."""
        self._counts.append((samples, left, right))
        self.samples += samples
        self.left += left
        self.right += right
        if len(self._counts) > self._polls:
            samples, left, right = self._counts.popleft()
            self.samples -= samples
            self.left -= left
            self.right -= right


def describe(
    role: str,
    findings: Findings,
    meter: StreamMeter,
    *,
    recent: SeenEyes,
    unanswered_s: float,
) -> tuple[Fault, ...]:
    """Return every fault that the counts and the recent batches show."""
    faults = [
        Fault(role, "blocking", text, "look at Pupil Capture and start it again")
        for text in findings.stopped.values()
    ]
    if not findings.calibrated:
        faults.append(Fault(role, "warning", "not calibrated since it was opened", "calibrate"))
    if findings.malformed:
        text = f"{findings.malformed} messages could not be read"
        faults.append(Fault(role, "warning", text, "keep the .wire log and report it"))
    if findings.clock_jumps_ms:
        count, last_ms = len(findings.clock_jumps_ms), findings.clock_jumps_ms[-1]
        text = f"the tracker's clock jumped {count} times, last by {last_ms:.0f} ms"
        faults.append(Fault(role, "warning", text, "stop other programs that set Capture's clock"))
    for count, what in ((meter.repeated, "repeated"), (meter.backward, "backward")):
        if count:
            text = f"{count} {what} time stamps"
            faults.append(Fault(role, "warning", text, "restart Pupil Capture if they go on"))
    if unanswered_s > ANSWERS_MISSED_S:
        text = f"no answer to time requests for {unanswered_s:.0f} s"
        faults.append(Fault(role, "warning", text, "check that Pupil Remote is still enabled"))
    faults += _lost_eyes(role, recent)
    return tuple(faults)


def _lost_eyes(role: str, recent: SeenEyes) -> list[Fault]:
    if recent.samples < FEWEST_SAMPLES:
        return []
    counts = {"left": recent.left, "right": recent.right}
    lost = [eye for eye, n in counts.items() if n / recent.samples < EYES_LOST_BELOW_01]
    remedy = "adjust the eye cameras and the headset, then calibrate again"
    if len(lost) == len(counts):
        return [Fault(role, "blocking", "neither eye is seen", remedy)]
    return [Fault(role, "warning", f"the {eye} eye is not seen", remedy) for eye in lost]

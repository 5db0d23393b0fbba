"""Put what a Pupil Core driver noticed into words for the operator."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from devices.contracts import Fault
from devices.meter import StreamMeter
from lab.schema import SampleBatch

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


def describe(
    role: str,
    findings: Findings,
    meter: StreamMeter,
    *,
    recent: Sequence[SampleBatch],
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


def _lost_eyes(role: str, recent: Sequence[SampleBatch]) -> list[Fault]:
    if sum(len(batch) for batch in recent) < FEWEST_SAMPLES:
        return []
    seen_01 = {
        eye: float(np.mean(np.concatenate([batch.values[f"{eye}_valid"] for batch in recent])))
        for eye in ("left", "right")
    }
    lost = [eye for eye, share_01 in seen_01.items() if share_01 < EYES_LOST_BELOW_01]
    remedy = "adjust the eye cameras and the headset, then calibrate again"
    if len(lost) == len(seen_01):
        return [Fault(role, "blocking", "neither eye is seen", remedy)]
    return [Fault(role, "warning", f"the {eye} eye is not seen", remedy) for eye in lost]

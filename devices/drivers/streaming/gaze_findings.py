"""What an eye tracker's driver noticed, said as faults an operator can act on."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from devices.contracts import Fault
from devices.drivers.pupil.findings import EYES_LOST_BELOW_01, FEWEST_SAMPLES, SeenEyes
from devices.meter import StreamMeter
from lab.errors import DeviceError

ANSWERS_MISSED_S = 3.0


@dataclass
class Counts:
    """What a driver noticed since start; `notes` are faults that hold until removed."""

    malformed: int = 0
    clock_jumps_ms: list[float] = field(default_factory=list)
    notes: dict[str, Fault] = field(default_factory=dict)


def stream_faults(
    role: str,
    counts: Counts,
    meter: StreamMeter,
    *,
    lost: int,
    jumps_ms: Sequence[float],
    unanswered_s: float,
    remedy: str,
) -> list[Fault]:
    """Name what is odd about stream and clock; `remedy` is for a tracker that does not answer."""
    found: list[Fault] = []

    def warn(message: str, remedy: str) -> None:
        found.append(Fault(role, "warning", message, remedy))

    if counts.malformed:
        text = f"{counts.malformed} messages could not be read"
        warn(text, "keep the .wire log and report it")
    if lost:
        warn(f"{lost} samples were lost on the way", "check cable, network and load")
    if jumps_ms:
        text = f"the tracker's clock jumped {len(jumps_ms)} times, last by {jumps_ms[-1]:.0f} ms"
        warn(text, "stop other programs that set the tracker's clock")
    for count, what in ((meter.repeated, "repeated"), (meter.backward, "backward")):
        if count:
            warn(f"{count} {what} time stamps", "restart the tracker if they go on")
    if unanswered_s > ANSWERS_MISSED_S:
        warn(f"no answer to time requests for {unanswered_s:.0f} s", remedy)
    return found


def eye_faults(role: str, seen: SeenEyes) -> list[Fault]:
    """Name eyes that were hardly seen of late."""
    if seen.samples < FEWEST_SAMPLES:
        return []
    counts = {"left": seen.left, "right": seen.right}
    lost = [eye for eye, n in counts.items() if n / seen.samples < EYES_LOST_BELOW_01]
    remedy = "adjust the tracker and its wearer, then calibrate again"
    if len(lost) == len(counts):
        return [Fault(role, "blocking", "neither eye is seen", remedy)]
    return [Fault(role, "warning", f"the {eye} eye is not seen", remedy) for eye in lost]


def named(problem: DeviceError, role: str, remedy: str) -> DeviceError:
    """Return the problem with the role's name, and with `remedy` where it has none."""
    if problem.role:
        return problem
    message = str(problem).removesuffix(f"; {problem.remedy}")
    return type(problem)(message, role=role, remedy=problem.remedy or remedy)

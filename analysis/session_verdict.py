"""The parts of a session check: limits, findings, verdict."""

from dataclasses import dataclass, field
from enum import IntEnum

RESUME = "continue with `visavis resume`"


class Level(IntEnum):
    """Green: they can leave. Amber: look before they leave. Red: something must be redone."""

    GREEN = 0
    AMBER = 1
    RED = 2


@dataclass(frozen=True)
class CheckLimits:
    """When a trial, a stream or a calibration stops being good."""

    received_amber_01: float = 0.95
    received_red_01: float = 0.80
    valid_amber_01: float = 0.85
    valid_red_01: float = 0.70
    accuracy_amber_deg: float = 1.5
    accuracy_red_deg: float = 2.5
    drift_amber_deg: float = 0.75
    drift_red_deg: float = 1.5


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at; `redo` is what to do now, empty when nothing."""

    level: Level
    subject: str
    message: str
    redo: str = ""


@dataclass(frozen=True)
class TrialCheck:
    """Data of one planned trial; counts are None when it was never finished."""

    trial_id: str
    block: int
    status: str
    attempts: int
    gaze_level: Level
    gaze_expected: int | None
    gaze_received: int | None
    gaze_valid: int | None
    frames: int | None
    frames_dropped: int | None
    flags: str


@dataclass(frozen=True)
class StreamCheck:
    """Data of one stream over the whole session; `expected` is None for irregular streams."""

    stream: str
    rows: int
    expected: int | None
    rate_hz: float | None
    longest_gap_ms: float | None
    level: Level


@dataclass(frozen=True)
class SessionCheck:
    """The verdict with everything behind it."""

    level: Level
    is_simulated: bool
    participant: str
    findings: tuple[Finding, ...]
    trials: tuple[TrialCheck, ...]
    streams: tuple[StreamCheck, ...] = field(default_factory=tuple)

    @property
    def redo(self) -> tuple[str, ...]:
        """What to do while the participant is still there, most pressing first."""
        urgent = sorted((f for f in self.findings if f.redo), key=lambda f: -f.level)
        steps = tuple(dict.fromkeys(f.redo for f in urgent))
        if RESUME not in steps:
            return steps
        return tuple(s for s in steps if s == RESUME or not s.startswith(RESUME))

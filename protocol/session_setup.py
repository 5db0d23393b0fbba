"""Everything a session needs, put together by the composition root."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from devices.contracts import DeviceInfo
from lab.clock import Clock
from protocol.experiment import Experiment, Respondent, ValidationJudge
from protocol.gaze_setup import TargetTiming
from protocol.operator import Operator
from protocol.panel_questions import LEAVE_OUT
from protocol.participants import SimulatedParticipant
from protocol.plan import SessionPlan
from protocol.progress import Progress
from protocol.questionnaires import Questionnaire
from protocol.rig import Rig
from recording.writer import Recorder
from stage.contracts import Stage

LOST_DEVICE_S = 300.0
"""How long a session waits for a device to come back before it ends, resumable."""


@dataclass(frozen=True)
class SessionSetup:
    """Everything a session needs; nothing in it is created or read from disk here.

    `idle_roles` are devices that are recorded though nothing of the study rests on them: what they
    warn of flags no trial, and nobody is told that they are not calibrated.
    """

    experiment: Experiment
    plan: SessionPlan
    participant_label: str
    session_number: int
    part: int
    rig: Rig
    stage: Stage
    recorder: Recorder
    clock: Clock
    operator: Operator
    respondent: Respondent
    judge_validation: ValidationJudge
    questionnaires: tuple[Questionnaire, ...] = ()
    participant: SimulatedParticipant | None = None
    progress: Progress = field(default_factory=Progress)
    blind: bool = False
    idle_roles: frozenset[str] = frozenset()
    timing: TargetTiming = field(default_factory=TargetTiming)
    lost_device_s: float = LOST_DEVICE_S
    leave_out: str = LEAVE_OUT
    on_trial: Callable[[str, int, int], None] | None = None
    on_validation: Callable[[Mapping[str, Any]], None] | None = None
    on_open: Callable[[tuple[DeviceInfo, ...]], None] | None = None

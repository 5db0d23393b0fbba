"""Everything a session needs, put together by the composition root."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from visavis.devices.contracts import DeviceInfo
from visavis.lab.clock import Clock
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.experiment import Experiment, Respondent, ValidationJudge
from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import Operator
from visavis.protocol.session.panel_questions import LEAVE_OUT
from visavis.protocol.session.progress import Progress
from visavis.protocol.session.rig import Rig
from visavis.recording.writer import Recorder
from visavis.stage.contracts import Stage

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

"""Everything a session needs, put together by the composition root."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from visavis.devices.contracts import DeviceInfo, SessionName
from visavis.lab.clock import Clock
from visavis.lab.config import GazeChecks
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.experiment import Experiment, Respondent, ValidationJudge
from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import Operator
from visavis.protocol.session.panel_questions import BoardWords
from visavis.protocol.session.progress import Progress
from visavis.protocol.session.rig import Rig
from visavis.recording.writer import Recorder
from visavis.stage.contracts import Stage

LOST_DEVICE_S = 300.0
"""How long a session waits for a device to come back before it ends, resumable."""


@dataclass(frozen=True)
class SessionListeners:
    """Listeners to events of a session, called at once in the session's thread."""

    on_open: Callable[[tuple[DeviceInfo, ...]], None] | None = None
    """Hears that the devices are open, and which they are."""
    on_validation: Callable[[Mapping[str, Any]], None] | None = None
    """Hears what a validation of gaze found."""
    on_trial: Callable[[str, int, int], None] | None = None
    """Hears of every trial that is done: its name, how many of how many."""


@dataclass(frozen=True)
class SessionSetup:
    """Everything a session needs; nothing in it is created or read from disk here."""

    experiment: Experiment
    """The study with the parameters in force."""
    plan: SessionPlan
    """What the participant will do."""
    name: SessionName
    """Participant, session and part."""
    rig: Rig
    """The devices."""
    stage: Stage
    """Shows scenes."""
    recorder: Recorder
    """Writes everything down."""
    clock: Clock
    """The session's time."""
    operator: Operator
    """Who runs the session."""
    respondent: Respondent
    """Who answers questionnaires."""
    judge_validation: ValidationJudge
    """Decides whether a validation of gaze is good enough."""
    questionnaires: tuple[Questionnaire, ...] = ()
    """The questionnaires that blocks and the plan name."""
    participant: SimulatedParticipant | None = None
    """The simulated participant; None with a real one."""
    progress: Progress = field(default_factory=Progress)
    """What earlier parts of the session did."""
    blind: bool = False
    """Whether the operator's screen hides the condition."""
    idle_roles: frozenset[str] = frozenset()
    """Devices that are recorded although the study does not need them. Their warnings flag no
    trial, and a missing calibration of theirs is not reported.
    """
    timing: TargetTiming = field(default_factory=TargetTiming)
    """How long targets of a calibration are shown."""
    lost_device_s: float = LOST_DEVICE_S
    """How long a device that went away is waited for."""
    gaze_checks: GazeChecks = field(default_factory=GazeChecks)
    """When drift of gaze is checked, and how much of it is let pass."""
    board_words: BoardWords = field(default_factory=BoardWords)
    """What boards say besides their question."""
    listeners: SessionListeners = SessionListeners()
    """Listeners to its events."""

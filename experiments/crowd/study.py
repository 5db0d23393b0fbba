"""The crowd study as the session asks for it."""

from dataclasses import dataclass, field

from experiments.crowd.design import (
    DEFAULT_PARAMETERS,
    NEEDED_SIDE_M,
    STUDY,
    CrowdParameters,
    plan_session,
)
from experiments.crowd.haptics import BAND_ROLES, MOTORS
from experiments.crowd.reflex import load_contact
from experiments.crowd.trial import intertrial, laid_out, run_trial
from lab.geometry import Vector
from protocol.experiment import Demands
from protocol.plan import SessionPlan, Trial
from protocol.steps import Plan
from stimuli.contact.body import ARM_JOINTS
from stimuli.scene import Scene
from stimuli.scenes.station_crowd import MOST_PEOPLE, TRAINING_CONFIGURATION

NOMINAL_TRIAL_S = 65.0


@dataclass(frozen=True)
class CrowdStudy:
    """Walk through a dense crowd and back; armbands answer contact in the middle block."""

    params: CrowdParameters = field(default=DEFAULT_PARAMETERS)
    _moved: set[tuple[str, int]] = field(default_factory=set, init=False, repr=False, compare=False)

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        return STUDY

    @property
    def agent_count(self) -> int:
        """Width of the recorded gaze columns; the crowd is recorded by its seeds, not as agents."""
        return 1

    @property
    def people_count(self) -> int:
        """The densest crowd."""
        return MOST_PEOPLE

    @property
    def trial_s(self) -> float:
        """Usual duration of a walk."""
        return NOMINAL_TRIAL_S

    @property
    def intertrial_s(self) -> float:
        """Duration of the empty station between walks."""
        return self.params.intertrial_s

    @property
    def needed_roles(self) -> tuple[str, ...]:
        """The tracked body and the four bands."""
        return ("body_tracker", *BAND_ROLES)

    @property
    def useful_roles(self) -> tuple[str, ...]:
        """An eye tracker where the study's `record_gaze` wants it: nothing here measures gaze."""
        return ("eye_tracker",) if self.params.record_gaze else ()

    @property
    def spare_roles(self) -> tuple[str, ...]:
        """Any band, as its walks are flagged; an eye tracker measures nothing here."""
        return (*BAND_ROLES, *self.useful_roles)

    @property
    def demands(self) -> Demands:
        """Arms and hips tracked, the pattern within every band's reach, the floor of the crowd."""
        return Demands(
            segments=(*ARM_JOINTS, "hips"),
            vibrations=dict.fromkeys(BAND_ROLES, self.params.vibration),
            motors=MOTORS,
            floor_side_m=NEEDED_SIDE_M,
        )

    def prepare(self) -> None:
        """Lay out every crowd and load the kernels of contact, which takes seconds."""
        for number in (TRAINING_CONFIGURATION, *range(1, self.params.configurations + 1)):
            load_contact(laid_out(number), self.params)

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return everything one participant will do; what their tracker showed is new too."""
        self._moved.clear()
        return plan_session(participant_index, seed, group=group, params=self.params)

    def run_trial(self, trial: Trial) -> Plan:
        """Return the generator that performs a walk."""
        return run_trial(trial, self.params, self._moved)

    def intertrial(self, trial: Trial) -> Plan:
        """Return the generator of the time before a walk."""
        return intertrial(trial, self.params)

    def blank(self, mark_m: Vector | None) -> Scene:
        """Return a dark scene without people, for calibrations and breaks."""
        return Scene(name="blank", agents=(), brightness_01=0.0, mark_m=mark_m)

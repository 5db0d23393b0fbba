"""The stare study as the session asks for it."""

from dataclasses import dataclass, field

from experiments.stare.design import DEFAULT_PARAMETERS, STUDY, StareParameters, plan_session
from experiments.stare.trial import intertrial, run_trial
from lab.geometry import Vector
from protocol.plan import SessionPlan, Trial
from protocol.steps import Plan
from stimuli.scene import Scene
from stimuli.scenes.audience import PLACES


@dataclass(frozen=True)
class StareStudy:
    """Stare in the crowd: eleven seated agents, one of whom may look at the participant."""

    params: StareParameters = field(default=DEFAULT_PARAMETERS)

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        return STUDY

    @property
    def agent_count(self) -> int:
        """Agents in every scene."""
        return len(PLACES)

    @property
    def people_count(self) -> int:
        """The audience; a speaker on the stage is one more."""
        return len(PLACES) + 1

    @property
    def trial_s(self) -> float:
        """Nominal duration of a trial."""
        return self.params.trial_s

    @property
    def intertrial_s(self) -> float:
        """Nominal duration of the dark between trials."""
        return self.params.intertrial_s

    @property
    def needed_roles(self) -> tuple[str, ...]:
        """Where one looks is what the study measures."""
        return ("eye_tracker",)

    @property
    def useful_roles(self) -> tuple[str, ...]:
        """Nothing more."""
        return ()

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return everything one participant will do; the study has no groups."""
        return plan_session(participant_index, seed, group=group, params=self.params)

    def run_trial(self, trial: Trial) -> Plan:
        """Return the generator that performs a trial."""
        return run_trial(trial, self.params)

    def intertrial(self, trial: Trial) -> Plan:
        """Return the generator of the dark before a trial."""
        return intertrial(trial, self.params)

    def blank(self, mark_m: Vector | None) -> Scene:
        """Return a dark scene without agents, for calibrations and breaks."""
        return Scene(name="blank", agents=(), brightness_01=0.0, mark_m=mark_m)

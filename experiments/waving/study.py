"""The waving study as the session asks for it."""

from dataclasses import dataclass, field

from experiments.waving.design import DEFAULT_PARAMETERS, STUDY, WavingParameters, plan_session
from experiments.waving.trial import intertrial, run_trial
from lab.geometry import Vector
from protocol.plan import SessionPlan, Trial
from protocol.steps import Plan
from stimuli.dressing.office import roles_of
from stimuli.scene import Scene

ANSWERING_S = 6.0


@dataclass(frozen=True)
class WavingStudy:
    """Waving at whom: one of three clerks waves at the participant or at somebody beside them."""

    params: WavingParameters = field(default=DEFAULT_PARAMETERS)

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        return STUDY

    @property
    def agent_count(self) -> int:
        """Clerks, bystanders and the other customers."""
        return len(roles_of("place_3"))

    @property
    def people_count(self) -> int:
        """Everybody is an agent."""
        return self.agent_count

    @property
    def trial_s(self) -> float:
        """Usual duration of a scene with its two questions."""
        return self.params.scene_s + ANSWERING_S

    @property
    def intertrial_s(self) -> float:
        """Duration of the dark between trials."""
        return self.params.intertrial_s

    @property
    def needed_roles(self) -> tuple[str, ...]:
        """Nothing beside the headset."""
        return ()

    @property
    def useful_roles(self) -> tuple[str, ...]:
        """A tracked hand points better than a head; gaze is recorded along."""
        return ("eye_tracker", "body_tracker")

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
        """Return a dark scene without people, for calibrations and breaks."""
        return Scene(name="blank", agents=(), brightness_01=0.0, mark_m=mark_m)

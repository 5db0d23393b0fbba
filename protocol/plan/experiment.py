"""What a study gives the session."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import VibrationPattern
from visavis.lab.geometry import Vector
from visavis.protocol.plan.session_plan import Block, SessionPlan, Trial
from visavis.protocol.plan.steps import Plan
from visavis.stimuli.scene import Scene, SceneFrame
from visavis.stimuli.sound import Waveform


class Experiment(Protocol):
    """A study: pure planning, and the plan of one trial as a generator."""

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        ...

    @property
    def agent_count(self) -> int:
        """Number of agents in every scene of a trial; fixes the width of recorded columns."""
        ...

    @property
    def people_count(self) -> int:
        """The most people a picture of it shows, not counting the participant's own body."""
        ...

    @property
    def trial_s(self) -> float:
        """Nominal duration of a trial, for the time left on the operator's screen."""
        ...

    @property
    def intertrial_s(self) -> float:
        """Nominal duration between trials."""
        ...

    @property
    def needed_roles(self) -> tuple[str, ...]:
        """Roles of the devices the study needs besides the headset."""
        ...

    @property
    def useful_roles(self) -> tuple[str, ...]:
        """Roles of the devices it uses where the lab has them."""
        ...

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return everything one participant will do; pure."""
        ...

    def run_trial(self, trial: Trial) -> Plan:
        """Return the generator that performs a trial."""
        ...

    def intertrial(self, trial: Trial) -> Plan:
        """Return the generator that fills the time before a trial."""
        ...

    def blank(self, mark_m: Vector | None) -> Scene:
        """Return the dark scene of calibrations and breaks, with a mark or without."""
        ...


@dataclass(frozen=True)
class Demands:
    """What a study asks of a lab besides its devices; checked before anything is shown.

    The body tracker must deliver `segments`; the band of each role must be able to play
    `vibrations` on `motors`; `floor_side_m` is the side of the square that is walked on; `sounds`
    are prepared before the session; with `own_body`, participants with a body tracker see a body of
    their own.
    """

    segments: tuple[str, ...] = ()
    vibrations: Mapping[str, VibrationPattern] = field(default_factory=dict)
    motors: tuple[int, ...] = ()
    floor_side_m: float = 0.0
    sounds: tuple[Waveform, ...] = ()
    own_body: bool = False


@runtime_checkable
class Demanding(Protocol):
    """An experiment that has demands."""

    @property
    def demands(self) -> Demands:
        """What it asks of a lab."""
        ...


@runtime_checkable
class Sparing(Protocol):
    """An experiment that can go on without some of its devices."""

    @property
    def spare_roles(self) -> tuple[str, ...]:
        """Devices without which a session may go on where the operator says so."""
        ...


@runtime_checkable
class FollowingGaze(Protocol):
    """An experiment that may show windows that follow gaze."""

    @property
    def has_gaze_windows(self) -> bool:
        """Whether a window that follows gaze is seen in a trial."""
        ...


@runtime_checkable
class SelfPaced(Protocol):
    """An experiment whose instructions are read before a screen."""

    @property
    def is_self_paced(self) -> bool:
        """Whether participants go on by themselves after an instruction that they have read."""
        ...


@dataclass(frozen=True)
class AfterPractice:
    """What follows practice: `again`, words before another round ("" where none follows), or
    `ends`, the reason why the session ends.
    """

    again: str = ""
    ends: str = ""


@runtime_checkable
class Guiding(Protocol):
    """An experiment with words and rules between its blocks."""

    def after_practice(self, block: Block, rounds: int) -> AfterPractice:
        """Return what follows the block of practice, performed so many times."""
        ...

    def pause_before(self, plan: SessionPlan, block: Block) -> str:
        """Return what participants read in the break before a block; "" for the usual words."""
        ...


@runtime_checkable
class Foreseeing(Protocol):
    """An experiment that knows what a trial will show first."""

    def first_lit(self, trial: Trial) -> SceneFrame | None:
        """Return the first lit frame of a trial before it is performed; None where it has none."""
        ...


def spare_roles_of(experiment: Experiment) -> tuple[str, ...]:
    """Return the devices an experiment can go on without; most name none."""
    return experiment.spare_roles if isinstance(experiment, Sparing) else ()


def no_progress(count: int, of: int) -> None:
    """Take progress and report it to nobody."""


def demands_of(experiment: Experiment) -> Demands:
    """Return what an experiment asks of a lab; most ask nothing."""
    return experiment.demands if isinstance(experiment, Demanding) else Demands()


@dataclass(frozen=True)
class ValidationPoint:
    """Gaze samples taken while one target was shown.

    `target` (3,) and `combined`, `left`, `right` (n, 3) are unit vectors in the head's frame when
    the target appeared, NaN where lost; `t_ns` (n,). At each sample, in the head's frame,
    `aim_head` (n, 3) is the direction to the target and `combined_head` (n, 3) the gaze; a tracker
    that sits turned on the head turns the latter.
    """

    name: str
    target: Vector
    t_ns: npt.NDArray[np.int64]
    combined: Vector
    left: Vector
    right: Vector
    aim_head: Vector
    combined_head: Vector


@dataclass(frozen=True)
class ValidationVerdict:
    """How good the tracking was at one validation; stored whole, never overwritten.

    `rows` holds one mapping per point and eye. `accuracy_deg` is the mean over points of the
    angle between mean gaze and target (combined eye), `precision_deg` the RMS-S2S. `is_turned` says
    that gaze is mirrored or rotated as a whole (see `reason`); no trial is begun then.
    """

    accepted: bool
    reason: str
    accuracy_deg: float | None
    worst_point_deg: float | None
    precision_deg: float | None
    lost_01: float
    rows: tuple[Mapping[str, str | int | float | bool | None], ...]
    is_turned: bool = False


class ValidationJudge(Protocol):
    """Measure a validation and decide whether it is good enough."""

    def __call__(self, points: Sequence[ValidationPoint], rate_hz: float) -> ValidationVerdict:
        """Return the verdict; never raises on lost data."""
        ...


class Respondent(Protocol):
    """Whoever answers questions: a person at the terminal, or a simulated participant."""

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Return the answer; None when left out."""
        ...

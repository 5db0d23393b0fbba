"""Requests to perform a session: with whom, which study, on which devices."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from visavis.devices.contracts import Device
from visavis.lab.clock import Clock, SimClock
from visavis.lab.config import LabConfig
from visavis.people.person import SEED_STEP
from visavis.protocol.plan.experiment import Respondent, demands_of
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import Operator, UnattendedOperator
from visavis.protocol.session.session_setup import LOST_DEVICE_S
from visavis.recording.writer import (
    Recorder,
)
from visavis.results.opened_study import OpenedStudy
from visavis.running.sessions.device_setup import is_simulated
from visavis.stage.contracts import Stage, Viewer
from visavis.study.experiment import StudyExperiment


@dataclass(frozen=True)
class SessionPerson:
    """Participant of the session."""

    label: str
    """The label under which the ledger has them."""
    index: int
    """Their place in the design, from 0."""
    group: str = ""
    """Their group, "" where the design has none."""
    session: int = 1
    """The number of the session, from 1."""
    consent_version: str = ""
    """What they agreed to; "": what the lab's configuration names."""
    body: str = ""
    """The body ("female" or "male") that they see as their own in a study that wants it."""
    stature_m: float | None = None
    """How tall they say they are."""


@dataclass(frozen=True)
class Request:
    """What to perform: with whom, which study, on what, with which clock and operator."""

    study: OpenedStudy
    """The study."""
    experiment: StudyExperiment
    """The study with the parameters in force."""
    config: LabConfig
    """The lab with its devices, and where data go."""
    person: SessionPerson
    """Participant of the session."""
    seed: int
    """The seed of the plan and of what is simulated."""
    clock: Clock
    """Real time, or a virtual clock for simulations."""
    operator: Operator
    """Who runs the session."""
    respondent: Respondent | None = None
    """Who answers questionnaires; None: the simulated participant."""
    effect: bool = True
    """Whether what is shown makes a difference to simulated people."""
    blind: bool = False
    """Whether the operator's screen hides the condition."""
    on_trial: Callable[[str, int, int], None] | None = None
    """Called for every trial that is done with its name, the number done and their total."""
    timing: TargetTiming = field(default_factory=TargetTiming)
    """How long targets of a calibration are shown."""
    lost_device_s: float = LOST_DEVICE_S
    """How long a device that went away is waited for."""
    stage_for: Callable[[Sequence[Viewer]], Stage] | None = None
    """Makes the stage instead of the configuration."""
    companion: "Companion | None" = None
    """Other programs that follow the session in real time."""
    without: tuple[str, ...] = ()
    """Roles of devices that the operator goes on without."""
    on: str = ""
    """"lab" or "browser"; "" where the study says it."""
    page: "PageAddress | None" = None
    """Where a page is served."""

    @property
    def is_on_page(self) -> bool:
        """Whether it is performed on a page in a browser; the study says so, or whoever asks."""
        usual = self.study.study.procedure.on if isinstance(self.study, OpenedStudy) else "lab"
        return (self.on or usual) == "browser"


@dataclass(frozen=True)
class PageAddress:
    """Where a page is served."""

    port: int = 0
    """0: a free one."""
    on_address: Callable[[str], None] | None = None
    """Called with the address to open."""


class Companion(Protocol):
    """Follows a session in real time: with streams to other programs, or a note of the lab.

    A simulated study's files depend on its seed alone, so nothing follows on a virtual clock.
    """

    def recorder(self, request: Request, part_dir: Path, *, is_simulated: bool) -> Recorder | None:
        """Return a recorder that tells others what it records; None for the usual one."""
        ...

    def on_open(
        self,
        request: Request,
        part_dir: Path,
        devices: Mapping[str, Device],
        recorder: Recorder,
        *,
        is_simulated: bool,
    ) -> None:
        """Called when the devices are open and their streams declared."""
        ...

    def on_close(self) -> None:
        """Called when the session's part has ended in any way, and its files are closed."""
        ...


def behaviour_seed(request: "Request") -> int:
    """Return the seed of what is simulated: another one in every further session of a person."""
    return request.seed + SEED_STEP * (request.person.session - 1)


def device_seed(seed: int, participant_index: int) -> int:
    """Return the seed of a participant's simulated devices."""
    return seed * 100_003 + participant_index


def simulated_request(
    study: OpenedStudy,
    experiment: StudyExperiment,
    config: LabConfig,
    *,
    label: str,
    index: int,
    seed: int,
    effect: bool = True,
    group: str = "",
    on_trial: Callable[[str, int, int], None] | None = None,
    session: int = 1,
) -> Request:
    """Return a request on the virtual clock, unattended."""
    return Request(
        study=study,
        experiment=experiment,
        config=config,
        person=SessionPerson(label, index, group, session),
        seed=seed,
        clock=SimClock(),
        operator=UnattendedOperator(),
        effect=effect,
        on_trial=on_trial,
    )


def body_of(request: Request) -> str:
    """Return which body the participant sees as their own: "female", "male" or "none".

    The lab's setting holds for every study. Otherwise a study that wants a body shows the
    participant's own; simulated participants take turns.
    """
    if request.config.display.own_body != "none":
        return request.config.display.own_body
    if not demands_of(request.experiment).own_body:
        return "none"
    if request.person.body or not is_simulated(request.config):
        return request.person.body or "none"
    return ("female", "male")[request.person.index % 2]

"""What is asked for when a session is to be performed: whom, which study, on what."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from visavis.devices.contracts import Device
from visavis.lab.clock import Clock, SimClock
from visavis.lab.config import LabConfig
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
class Request:
    """What to perform: whom, which study, on what, with which clock and operator.

    `without` are roles of devices that the operator goes on without. `on` is "lab" or "browser",
    left out where the study says it; a `page` is served at its address. `body` ("female" or
    "male") is the one that participants see as their own in a study that wants it, `stature_m` how
    tall they say they are.
    """

    study: OpenedStudy
    experiment: StudyExperiment
    config: LabConfig
    participant_label: str
    participant_index: int
    group: str
    session: int
    seed: int
    clock: Clock
    operator: Operator
    respondent: Respondent | None = None
    effect: bool = True
    blind: bool = False
    consent_version: str = ""
    on_trial: Callable[[str, int, int], None] | None = None
    timing: TargetTiming = field(default_factory=TargetTiming)
    lost_device_s: float = LOST_DEVICE_S
    stage_for: Callable[[Sequence[Viewer]], Stage] | None = None
    companion: "Companion | None" = None
    without: tuple[str, ...] = ()
    on: str = ""
    page: "PageAddress | None" = None
    body: str = ""
    stature_m: float | None = None

    @property
    def is_on_page(self) -> bool:
        """Whether it is performed on a page in a browser; the study says so, or whoever asks."""
        study = self.study.study if isinstance(self.study, OpenedStudy) else None
        return (self.on or getattr(study, "on", "lab")) == "browser"


@dataclass(frozen=True)
class PageAddress:
    """Where a page is served (port 0: a free one); `told` hears the address to be opened."""

    port: int = 0
    told: Callable[[str], None] | None = None


class Companion(Protocol):
    """What goes along with a session in real time: streams to other programs, a note of the lab.

    A simulated study's files depend on its seed alone, so nothing goes along on a virtual clock.
    """

    def recorder(self, request: Request, part_dir: Path, *, is_simulated: bool) -> Recorder | None:
        """Return a recorder that tells others what it records; None for the usual one."""
        ...

    def opened(
        self,
        request: Request,
        part_dir: Path,
        devices: Mapping[str, Device],
        recorder: Recorder,
        *,
        is_simulated: bool,
    ) -> None:
        """Hear that the devices are open and their streams declared."""
        ...

    def closed(self) -> None:
        """Hear that the session's part has ended, however it did; its files are closed."""
        ...


def behaviour_seed(request: "Request") -> int:
    """Return the seed of what is simulated: another one in every further session of a person."""
    return request.seed + 1_000_003 * (request.session - 1)


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
) -> Request:
    """Return a request on the virtual clock, unattended."""
    return Request(
        study=study,
        experiment=experiment,
        config=config,
        participant_label=label,
        participant_index=index,
        group=group,
        session=1,
        seed=seed,
        clock=SimClock(),
        operator=UnattendedOperator(),
        effect=effect,
        on_trial=on_trial,
    )


def body_of(request: Request) -> str:
    """Return which body the participant sees as their own: "female", "male" or "none".

    What the lab writes is for every study; otherwise a study that wants one gives the participant's
    own. Who is simulated has one by turns.
    """
    if request.config.display.own_body != "none":
        return request.config.display.own_body
    if not demands_of(request.experiment).own_body:
        return "none"
    if request.body or not is_simulated(request.config):
        return request.body or "none"
    return ("female", "male")[request.participant_index % 2]

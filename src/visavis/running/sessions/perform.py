"""Perform a session, new or resumed, and leave a closed recording behind."""

import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol
from weakref import WeakSet

from visavis.devices.contracts import Armband, Device, DeviceInfo, OwnRecording, SessionName
from visavis.devices.haptic_safety import HapticGuard
from visavis.devices.shared_body import SharedBody
from visavis.lab.clock import Clock, SimClock, require_fine_clock
from visavis.lab.compiled import forget_old_kernels
from visavis.lab.config import INCIDENTS, LabConfig, with_devices
from visavis.lab.errors import ConfigError, LabError, RecordingError, SessionAborted
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.experiment import Respondent, demands_of, untold
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import Operator, UnattendedOperator
from visavis.protocol.session.progress import Progress, progress_of_recording
from visavis.protocol.session.rig import Rig
from visavis.protocol.session.session import Session
from visavis.protocol.session.session_setup import LOST_DEVICE_S, SessionSetup
from visavis.recording.folder import SessionFolder, create_session, open_session, study_dir
from visavis.recording.journal import as_json
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import provenance
from visavis.recording.reader import Recording
from visavis.recording.writer import (
    REAL_TIME_BATCH_NS,
    VIRTUAL_TIME_BATCH_NS,
    CloseStatus,
    Recorder,
)
from visavis.results.opened_study import OpenedStudy
from visavis.running.sessions.device_setup import build_rig, check_room, devices_for, is_simulated
from visavis.running.sessions.plan_lock import carried_by_session
from visavis.running.sessions.recorded_design import DESIGN_KEY, design_of
from visavis.running.sessions.rehearsal import FewTrials
from visavis.running.sessions.stage_setup import build_stage
from visavis.stage.contracts import Stage, Viewer
from visavis.study.cast import use_cast_of, use_recorded_cast
from visavis.study.experiment import StudyExperiment
from visavis.study.texts import read_texts


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


def perform_new(request: Request) -> Path:
    """Perform a session from its beginning; return its folder.

    Raises:
        UsageError: the session exists already.
        SessionAborted, DeviceError: it ended early; what is finished is kept.
    """
    if request.is_on_page:
        made: Path = _pages().perform_new(request)
        return made
    cast = use_cast_of(request.config)
    plan = request.experiment.plan(request.participant_index, request.seed, request.group)
    config = devices_for(request.config, request.experiment, request.without)
    request = replace(request, config=config)
    check_room(config, request.experiment)
    manifest = Manifest(
        study=request.study.name,
        participant=request.participant_label,
        session=request.session,
        is_simulated=is_simulated(config),
        plan=plan,
        seed=request.seed,
        configuration={
            "devices": {r: d.model_dump() for r, d in config.devices.items()},
            "lab": config.lab,
            "sha256": config.sha256,
            "effect": request.effect,
            **_screen(config),
            **_incidents(config),
            **_locked(request, config),
            DESIGN_KEY: design_of(request.experiment),
            **cast,
        },
        devices=(),
        consent_version=request.consent_version or config.privacy.consent_version,
        created_wall_iso=request.clock.wall_iso(),
        provenance=provenance(),
    )
    with ExitStack() as stack:
        devices = _equip(request, stack)
        folder = stack.enter_context(create_session(config.data_root, manifest))
        _perform_part(request, devices, folder, plan, Progress())
        return folder.path


def perform_rest(request: Request, session_path: Path) -> Path:
    """Go on with a session where it was left; return its folder.

    Raises:
        ConfigError: the plan in the manifest is not the one this version would make.
    """
    if request.is_on_page:
        rest: Path = _pages().perform_rest(request, session_path)
        return rest
    use_recorded_cast(Recording(session_path))
    config = devices_for(request.config, request.experiment, request.without)
    request = replace(request, config=config)
    check_room(config, request.experiment)
    with ExitStack() as stack:
        devices = _equip(request, stack)
        folder, _ = open_session(session_path)
        stack.enter_context(folder)
        recording = Recording(session_path)
        plan = request.experiment.plan(request.participant_index, request.seed, request.group)
        refuse_other_plan(recording, plan)
        _perform_part(request, devices, folder, plan, progress_of_recording(recording))
        return folder.path


def refuse_other_plan(recording: Recording, plan: SessionPlan) -> None:
    """Refuse to go on with a session whose plan this version would not make.

    Raises:
        ConfigError: naming the session.
    """
    if as_json(plan) != recording.manifest.plan:
        raise ConfigError(
            f"{recording.path}: the plan recorded with this session differs from the plan this "
            "version of Visavis makes; check out the version named in manifest.json "
            "(provenance) and resume with that"
        )


def _pages() -> Any:
    """Return what performs sessions on pages, which not every lab needs.

    Raises:
        ConfigError: its libraries are not installed.
    """
    try:
        return importlib.import_module("visavis.running.page.perform")
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"a page in a browser needs {error.name}, which is not installed; run: pip install "
            "'visavis[browser]'"
        ) from error


def _locked(request: Request, config: LabConfig) -> dict[str, Any]:
    """Return what a session keeps of its study's locked plan."""
    simulated = is_simulated(config)
    folder = study_dir(config.data_root, request.study.name, is_simulated=simulated)
    return carried_by_session(folder, request.study, request.experiment, request.seed)


def _incidents(config: LabConfig) -> dict[str, Any]:
    """Return what a session keeps of the lab's own list of reasons; nothing of the usual one."""
    own = dict(config.incidents)
    return {} if own == dict(INCIDENTS) else {"incidents": own}


def _screen(config: LabConfig) -> dict[str, Any]:
    """Return what a session keeps of the screen participants sit before; nothing of a headset's."""
    screen = config.display.on_screen
    return {} if screen is None else {"screen": screen.model_dump()}


@contextmanager
def of_no_session() -> Iterator[None]:
    """Let an interruption be one where what is performed is not kept: nothing could be resumed."""
    try:
        yield
    except SessionAborted as ended:
        if isinstance(ended.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from ended
        raise


_READY: WeakSet[StudyExperiment] = WeakSet()


def get_ready(
    study: OpenedStudy,
    experiment: StudyExperiment,
    config: LabConfig,
    told: Callable[[int, int], None] = untold,
) -> str:
    """Do what would hold up a frame of a session; return why a part was left out, mostly "".

    What the study prepares, then a rehearsal of a few trials by a simulated person on simulated
    devices, unseen and forgotten: code is compiled for what it is called with, so nothing finds
    all of it but calling it. `told` hears how much of how much is done. Done already, it takes no
    time.
    """
    if experiment in _READY:
        return ""
    few = FewTrials(experiment.study, experiment.overrides)
    trials, steps = len(few.plan(0, 0).trials), 0

    def prepared(done: int, of: int) -> None:
        nonlocal steps
        steps = of
        told(done, steps + trials)

    def rehearsed(_: str, done: int, __: int) -> None:
        told(steps + done, steps + trials)

    experiment.prepare(prepared)
    trouble = ""
    with TemporaryDirectory(prefix="visavis-rehearsal-") as folder:
        unseen = config.display.model_copy(update={"show": "none"})
        lab = with_devices(config, "sim").model_copy(
            update={"data_root": Path(folder), "display": unseen}
        )
        request = simulated_request(
            study, few, lab, label="REHEARSAL", index=0, seed=0, on_trial=rehearsed
        )
        try:
            with of_no_session():
                perform_new(replace(request, on="lab"))
        except LabError as problem:
            trouble = f"not rehearsed, so the first frames may be late: {problem}"
    forget_old_kernels()
    told(steps + trials, steps + trials)
    _READY.add(experiment)
    return trouble


@dataclass(frozen=True)
class _Devices:
    """What a session is performed on; made before anything is written, as it may be refused."""

    rig: Rig
    participant: SimulatedParticipant | None
    respondent: Respondent


def _equip(request: Request, stack: ExitStack) -> _Devices:
    participant = _simulated_participant(request)
    respondent = request.respondent or participant
    require_fine_clock(request.clock)
    if respondent is None:
        raise ConfigError("nobody is there to answer the questionnaires; run it in a terminal")
    seed = device_seed(behaviour_seed(request), request.participant_index)
    if not request.clock.is_virtual:
        get_ready(request.study, request.experiment, request.config)
        stack.enter_context(request.experiment.settings.beside.in_process())
    rig = build_rig(request.config, request.clock, participant, seed, stack, request.without)
    return _Devices(rig, participant, respondent)


def _perform_part(
    request: Request,
    devices: _Devices,
    folder: SessionFolder,
    plan: SessionPlan,
    progress: Progress,
) -> None:
    try:
        _perform_companied(request, devices, folder, plan, progress)
    finally:
        if request.companion is not None and not request.clock.is_virtual:
            request.companion.closed()


def _perform_companied(
    request: Request,
    devices: _Devices,
    folder: SessionFolder,
    plan: SessionPlan,
    progress: Progress,
) -> None:
    make = partial(_recorder, request, folder)
    with recorded_part(request.clock, folder, make, "every finished trial is kept") as recorder:
        with _guarded(devices, request.clock) as guarded:
            setup = _setup(request, guarded, folder, plan, progress, recorder)
            Session(setup).run()


def _recorder(request: Request, folder: SessionFolder, part_dir: Path) -> Recorder:
    """Return the part's recorder; the companion's own where it has one."""
    clock, simulated = request.clock, folder.manifest.is_simulated
    if request.companion is not None and not clock.is_virtual:
        own = request.companion.recorder(request, part_dir, is_simulated=simulated)
        if own is not None:
            return own
    return recorder_of(part_dir, clock, is_simulated=simulated, awaits_disk=not clock.is_virtual)


def recorder_of(
    part_dir: Path, clock: Clock, *, is_simulated: bool, awaits_disk: bool = False
) -> Recorder:
    """Return the recorder of a part, in a thread and with short batches in real time."""
    return Recorder(
        part_dir,
        clock,
        threaded=not clock.is_virtual,
        max_batch_ns=VIRTUAL_TIME_BATCH_NS if clock.is_virtual else REAL_TIME_BATCH_NS,
        is_simulated=is_simulated,
        awaits_disk=awaits_disk,
    )


@contextmanager
def recorded_part(
    clock: Clock, folder: SessionFolder, make: Callable[[Path], Recorder], kept: str
) -> Iterator[Recorder]:
    """Record a part of a session; however the block is left, files and manifest say how.

    `make` gets the part's folder, `kept` tells whoever interrupts what is not lost.

    Raises:
        SessionAborted: it ended early.
    """
    part_dir = folder.begin_part(clock)
    recorder: Recorder | None = None
    try:
        recorder = make(part_dir)
        yield recorder
    except KeyboardInterrupt as error:
        reason = "interrupted from the keyboard or by the system"
        end_part(clock, folder, recorder, "aborted", reason, error)
        raise SessionAborted(f"{reason}; {kept}") from error
    except SessionAborted as error:
        end_part(clock, folder, recorder, "aborted", str(error).partition(";")[0], error)
        raise
    except BaseException as error:
        end_part(clock, folder, recorder, "aborted", str(error) or repr(error), error)
        raise
    end_part(clock, folder, recorder, "complete", "", None)


@contextmanager
def _guarded(devices: _Devices, clock: Clock) -> Iterator[_Devices]:
    """Watch over the armbands from here on: they are silent however this block is left."""
    bands = {r: d for r, d in devices.rig.others.items() if isinstance(d, Armband)}
    if not bands:
        yield devices
        return
    with HapticGuard(bands, clock, handle_signals=not clock.is_virtual) as guard:
        yield replace(devices, rig=replace(devices.rig, on_step=guard.tick))


def _setup(
    request: Request,
    devices: _Devices,
    folder: SessionFolder,
    plan: SessionPlan,
    progress: Progress,
    recorder: Recorder,
) -> SessionSetup:
    # A study in one language alone says nothing; its participants read the lab's.
    config = request.config.model_copy(update={"language": request.experiment.language})
    return SessionSetup(
        experiment=request.experiment,
        plan=plan,
        participant_label=request.participant_label,
        session_number=request.session,
        part=folder.manifest.parts[-1].number,
        rig=devices.rig,
        stage=_stage(request, devices),
        recorder=recorder,
        clock=request.clock,
        operator=request.operator,
        respondent=devices.respondent,
        judge_validation=request.study.judge_validation,
        questionnaires=request.study.questionnaires(config),
        leave_out=read_texts((), request.experiment.language).get("no_answer"),
        participant=devices.participant,
        progress=progress,
        blind=request.blind,
        idle_roles=frozenset() if request.experiment.rests_on_gaze else frozenset({"eye_tracker"}),
        timing=request.timing,
        lost_device_s=request.lost_device_s,
        on_trial=request.on_trial,
        on_open=lambda infos: _describe(request, devices, folder, recorder, infos),
        on_validation=lambda found: folder.describe(
            calibrations=[*folder.manifest.calibrations, found]
        ),
    )


def _describe(
    request: Request,
    devices: _Devices,
    folder: SessionFolder,
    recorder: Recorder,
    infos: tuple[DeviceInfo, ...],
) -> None:
    """Keep who the devices are; in real time their own recordings begin and the companion hears."""
    folder.describe(devices=infos)
    if request.clock.is_virtual:
        return
    if (body := body_of(request)) != "none":
        t_ns = request.clock.now_ns()
        recorder.event("own_body", t_ns, body=body, stature_told_m=request.stature_m)
    part = folder.manifest.parts[-1]
    part_dir = folder.path / part.folder
    name = SessionName(request.study.name, request.participant_label, request.session, part.number)
    for device in devices.rig.by_role().values():
        if isinstance(device, OwnRecording):
            device.begin_recording(name, part_dir)
    if request.companion is not None:
        request.companion.opened(
            request,
            part_dir,
            devices.rig.by_role(),
            recorder,
            is_simulated=folder.manifest.is_simulated,
        )


def _stage(request: Request, devices: _Devices) -> Stage:
    viewers = [devices.participant] if devices.participant else []
    if request.stage_for is not None:
        return request.stage_for(viewers)
    display = request.config.display.model_copy(update={"own_body": body_of(request)})
    config = request.config.model_copy(update={"display": display})
    return build_stage(config, request.experiment, devices.rig, request.clock, viewers)


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


def end_part(
    clock: Clock,
    folder: SessionFolder,
    recorder: Recorder | None,
    status: CloseStatus,
    reason: str,
    cause: BaseException | None,
) -> None:
    """Close files and manifest; what fails then never hides what went wrong before."""
    try:
        summary = recorder.close(status) if recorder is not None else None
        folder.end_part(clock, summary, reason=reason)
    except RecordingError as error:
        if cause is None:
            raise
        cause.add_note(str(error))


def _simulated_participant(request: Request) -> SimulatedParticipant | None:
    if not is_simulated(request.config):
        return None
    participant = request.study.participant(
        request.participant_index,
        behaviour_seed(request),
        effect=request.effect,
        experiment=request.experiment,
    )
    # On a real clock the simulated tracker's thread measures while the session moves the body.
    return participant if request.clock.is_virtual else SharedBody(participant)


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

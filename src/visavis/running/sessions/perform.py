"""Perform a session, new or resumed, and leave a closed recording behind."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any
from weakref import WeakSet

from visavis.devices.contracts import (
    Armband,
    DeviceInfo,
    OnScreen,
    OwnRecording,
    ResponseInput,
    SessionName,
)
from visavis.devices.haptic_safety import HapticGuard
from visavis.devices.shared_body import SharedBody
from visavis.lab.clock import Clock, require_fine_clock
from visavis.lab.compiled import forget_old_kernels
from visavis.lab.config import INCIDENTS, LabConfig, with_devices
from visavis.lab.errors import ConfigError, LabError, SessionAborted
from visavis.lab.luminance import LUMINANCE_KEY
from visavis.protocol.people.simulated_participant import KeyPresser, SimulatedParticipant
from visavis.protocol.plan.experiment import Experiment, Respondent, no_progress
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.protocol.session.panel_questions import BoardWords
from visavis.protocol.session.progress import Progress, progress_of_recording
from visavis.protocol.session.rig import Rig
from visavis.protocol.session.session import Session
from visavis.protocol.session.session_setup import SessionListeners, SessionSetup
from visavis.recording.folder import SessionFolder, create_session, open_session, study_dir
from visavis.recording.manifest import DESIGN_KEY, Manifest
from visavis.recording.provenance import provenance
from visavis.recording.reader import Recording
from visavis.recording.writer import (
    Recorder,
)
from visavis.results.opened_study import OpenedStudy
from visavis.running.sessions.device_setup import build_rig, check_room, devices_for, is_simulated
from visavis.running.sessions.plan_lock import carried_by_session
from visavis.running.sessions.recorded_design import design_of
from visavis.running.sessions.recorded_part import recorded_part, recorder_of, refuse_other_plan
from visavis.running.sessions.session_request import (
    Request,
    behaviour_seed,
    body_of,
    device_seed,
    simulated_request,
)
from visavis.stage.contracts import GeometryStage, Stage, Viewer
from visavis.study.cast import use_cast_of, use_recorded_cast
from visavis.study.experiment import StudyExperiment
from visavis.study.files_read import stimulus_files
from visavis.study.texts import read_texts

REHEARSED_TRIALS, REHEARSED_S = 8, 130.0
"""Limits of the rehearsal, in trials and seconds, besides the first trial of every block.

Further levels bring other numbers, but rarely run other code.
"""
BOARD_WORDS = ("no_answer", "board_keys", "go_on", "pause", "coming")


def perform_new(request: Request) -> Path:
    """Perform a session from its beginning; return its folder.

    Raises:
        UsageError: the session exists already.
        SessionAborted, DeviceError: it ended early; what is finished is kept.
    """
    request = _of_its_session(request)
    if request.is_on_page:
        session_path: Path = _pages().perform_new(request)
        return session_path
    if isinstance(request.experiment, StudyExperiment):
        request.experiment.check_at_devices()
    cast = use_cast_of(request.config)
    plan = request.experiment.plan(request.person.index, request.seed, request.person.group)
    config = devices_for(request.config, request.experiment, request.without)
    request = replace(request, config=config)
    check_room(config, request.experiment)
    manifest = Manifest(
        study=request.study.name,
        participant=request.person.label,
        session=request.person.session,
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
            **stimulus_files(request.experiment),
            DESIGN_KEY: design_of(request.experiment),
            **cast,
        },
        devices=(),
        consent_version=request.person.consent_version or config.privacy.consent_version,
        created_wall_iso=request.clock.wall_iso(),
        provenance=provenance(),
    )
    with ExitStack() as stack:
        devices = _equip(request, stack)
        folder = stack.enter_context(create_session(config.data_root, manifest))
        _perform_part(request, devices, folder, plan, Progress())
        return folder.path


def perform_rest(request: Request, session_path: Path, *, in_any_light: bool = False) -> Path:
    """Go on with a session where it was left; return its folder.

    `in_any_light`: whatever was measured of the screen's luminances since; nobody sees it.

    Raises:
        ConfigError: the plan in the manifest is not the one this version would make, or the
            screen's luminances are others.
    """
    request = _of_its_session(request)
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
        plan = request.experiment.plan(request.person.index, request.seed, request.person.group)
        refuse_other_plan(recording, plan)
        if not in_any_light:
            _refuse_other_luminance(recording, config)
        if isinstance(request.experiment, StudyExperiment):
            rows = recording.trials().to_dict("records")
            request.experiment.recall([{str(k): v for k, v in row.items()} for row in rows])
        _perform_part(request, devices, folder, plan, progress_of_recording(recording))
        return folder.path


def _of_its_session(request: Request) -> Request:
    """Return a request whose experiment is that of the session asked for."""
    experiment = request.experiment.of_session(request.person.session)
    return replace(request, experiment=experiment)


def _pages() -> ModuleType:
    """Return what performs sessions on pages.

    Raises:
        ConfigError: its libraries are not installed.
    """
    try:
        # Pages need aiohttp, which not every lab has installed.
        from visavis.running.page import perform as pages
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"a page in a browser needs {error.name}, which is not installed; run: pip install "
            "'visavis[browser]'"
        ) from error
    return pages


def _locked(request: Request, config: LabConfig) -> dict[str, Any]:
    """Return the entries about the study's locked plan that a session keeps."""
    is_simulation = is_simulated(config)
    folder = study_dir(config.data_root, request.study.name, is_simulated=is_simulation)
    return carried_by_session(folder, request.study, request.experiment, request.seed)


def _incidents(config: LabConfig) -> dict[str, Any]:
    """Return the entry for the lab's own list of reasons; nothing for the usual list."""
    own = dict(config.incidents)
    return {} if own == dict(INCIDENTS) else {"incidents": own}


def _screen(config: LabConfig) -> dict[str, Any]:
    """Return the entries for the screen participants sit before and what was measured of its
    luminances; nothing for a headset.
    """
    screen, luminance = config.display.on_screen, config.luminance
    if screen is None:
        return {}
    entry = {"sha256": ""} if luminance is None else luminance.as_entry()
    return {"screen": screen.model_dump(), LUMINANCE_KEY: entry}


def _refuse_other_luminance(recording: Recording, config: LabConfig) -> None:
    """Refuse to go on with a session whose greys would be of other light than at its beginning.

    Raises:
        ConfigError: luminances were measured since, or are no longer there.
    """
    before = recording.manifest.configuration.get(LUMINANCE_KEY, {}).get("sha256", "")
    now = "" if config.luminance is None else config.luminance.sha256
    if now != before:
        first, today = (f"table {sha[:12]}" if sha else "no table" for sha in (before, now))
        raise ConfigError(
            f"{recording.path} began with {first} of luminances, and there is {today} now; put "
            f"{config.luminance_path} back as it was to go on"
        )


@contextmanager
def of_no_session() -> Iterator[None]:
    """Raise KeyboardInterrupt for an interrupted session that is not kept for a resumption."""
    try:
        yield
    except SessionAborted as abort:
        if isinstance(abort.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from abort
        raise


@dataclass(frozen=True, eq=False)
class FewTrials(StudyExperiment):
    """An experiment with the first trial of every block, and trials with further levels."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the plan with those trials alone."""
        whole_plan = super().plan(participant_index, seed, group)
        first = [block.trials[0] for block in whole_plan.blocks if block.trials]
        most = min(REHEARSED_TRIALS, int(REHEARSED_S / max(self.trial_s, 1.0)))
        trial_ids = {
            t.trial_id for t in (*first, *_of_other_levels(whole_plan.trials, first, most))
        }
        blocks = (
            replace(b, trials=tuple(t for t in b.trials if t.trial_id in trial_ids))
            for b in whole_plan.blocks
        )
        return replace(whole_plan, blocks=tuple(blocks))


def _of_other_levels(trials: Sequence[Trial], met_in: Sequence[Trial], most: int) -> list[Trial]:
    """Return trials with levels that `met_in` lacks, those of the smallest factors first."""
    everything = {level for trial in trials for level in trial.factors.items()}
    worth = Counter(name for name, _ in everything)
    met_levels = {level for trial in met_in for level in trial.factors.items()}
    further_trials: list[Trial] = []
    while len(further_trials) < most and met_levels != everything:
        best = max(
            trials,
            key=lambda t: sum(
                1 / worth[k] for k, v in t.factors.items() if (k, v) not in met_levels
            ),
        )
        further_trials.append(best)
        met_levels |= set(best.factors.items())
    return further_trials


_READY: WeakSet[StudyExperiment] = WeakSet()


def get_ready(
    study: OpenedStudy,
    experiment: StudyExperiment,
    config: LabConfig,
    report_progress: Callable[[int, int], None] = no_progress,
) -> str:
    """Do in advance what would delay a frame; return why a part was left out, usually "".

    First the study prepares itself. Then a simulated person rehearses a few trials on simulated
    devices, unseen and without a recording: code is compiled for the types it is called with, so
    only calls compile all of it. `report_progress` is called with the amount done and the total. A
    second call takes no time.
    """
    if experiment in _READY:
        return ""
    few = FewTrials(experiment.study, experiment.overrides, session=experiment.session)
    trials, steps = len(few.plan(0, 0).trials), 0

    def report_preparation(count: int, of: int) -> None:
        nonlocal steps
        steps = of
        report_progress(count, steps + trials)

    def report_rehearsal(_: str, count: int, __: int) -> None:
        report_progress(steps + count, steps + trials)

    experiment.prepare(report_preparation)
    trouble = ""
    with TemporaryDirectory(prefix="visavis-rehearsal-") as folder:
        hidden_display = config.display.model_copy(update={"show": "none"})
        lab = with_devices(config, "sim").model_copy(
            update={"data_root": Path(folder), "display": hidden_display}
        )
        request = simulated_request(
            study, few, lab, label="REHEARSAL", index=0, seed=0, on_trial=report_rehearsal
        )
        person = replace(request.person, session=experiment.session)
        try:
            with of_no_session():
                perform_new(replace(request, person=person, on="lab"))
        except LabError as problem:
            trouble = f"not rehearsed, so the first frames may be late: {problem}"
    forget_old_kernels()
    report_progress(steps + trials, steps + trials)
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
    seed = device_seed(behaviour_seed(request), request.person.index)
    if not request.clock.is_virtual:
        get_ready(request.study, request.experiment, request.config)
        stack.enter_context(request.experiment.settings.beside.in_process())
    rig = build_rig(request.config, request.clock, participant, seed, stack, request.without)
    _say_what_answers(request, rig, participant)
    return _Devices(rig, participant, respondent)


def _say_what_answers(request: Request, rig: Rig, participant: object) -> None:
    """Let a simulated person who has neither a hand nor a gaze that is tracked answer by keys."""
    points = not isinstance(rig.headset, OnScreen) or "body_tracker" in rig.others
    experiment = request.experiment
    gaze_answers = (
        rig.eye_tracker is not None
        and experiment.study.devices.calibrate
        and experiment.settings.ways.dwell is not None
    )
    keys = rig.others.get("responses")
    if isinstance(participant, KeyPresser) and isinstance(keys, ResponseInput):
        if not (points or gaze_answers):
            participant.answer_by_keys(keys.controls)


def _perform_part(
    request: Request,
    devices: _Devices,
    folder: SessionFolder,
    plan: SessionPlan,
    progress: Progress,
) -> None:
    try:
        _perform_recorded(request, devices, folder, plan, progress)
    finally:
        if request.companion is not None and not request.clock.is_virtual:
            request.companion.on_close()


def _perform_recorded(
    request: Request,
    devices: _Devices,
    folder: SessionFolder,
    plan: SessionPlan,
    progress: Progress,
) -> None:
    make = partial(_recorder, request, folder)
    with recorded_part(request.clock, folder, make, "every finished trial is kept") as recorder:
        with _guard_armbands(devices, request.clock) as guarded_devices:
            setup = _setup(request, guarded_devices, folder, plan, progress, recorder)
            Session(setup).run()


def _recorder(request: Request, folder: SessionFolder, part_dir: Path) -> Recorder:
    """Return the part's recorder; the companion's own where it has one."""
    clock, is_simulation = request.clock, folder.manifest.is_simulated
    if request.companion is not None and not clock.is_virtual:
        own = request.companion.recorder(request, part_dir, is_simulated=is_simulation)
        if own is not None:
            return own
    return recorder_of(
        part_dir, clock, is_simulated=is_simulation, awaits_disk=not clock.is_virtual
    )


@contextmanager
def _guard_armbands(devices: _Devices, clock: Clock) -> Iterator[_Devices]:
    """Guard the armbands in this block; they are silent after it, however it ends."""
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
    # A study in a single language names none; its participants read the lab's language.
    config = request.config.model_copy(update={"language": request.experiment.language})
    own_texts = read_texts((), request.experiment.language)
    return SessionSetup(
        experiment=request.experiment,
        plan=plan,
        name=_name_of(request, folder),
        rig=devices.rig,
        stage=_stage(request, devices),
        recorder=recorder,
        clock=request.clock,
        operator=request.operator,
        respondent=devices.respondent,
        judge_validation=request.study.judge_validation,
        questionnaires=request.study.questionnaires(config),
        board_words=BoardWords(*map(own_texts.get, BOARD_WORDS)),
        participant=devices.participant,
        progress=progress,
        blind=request.blind,
        idle_roles=frozenset() if request.experiment.rests_on_gaze else frozenset({"eye_tracker"}),
        timing=request.timing,
        lost_device_s=request.lost_device_s,
        gaze_checks=request.config.gaze,
        listeners=SessionListeners(
            on_open=lambda infos: _describe(request, devices, folder, recorder, infos),
            on_validation=lambda calibration: folder.describe(
                calibrations=[*folder.manifest.calibrations, calibration]
            ),
            on_trial=request.on_trial,
        ),
    )


def _name_of(request: Request, folder: SessionFolder) -> SessionName:
    """Return which part of whose session is performed."""
    who, part = request.person, folder.manifest.parts[-1]
    return SessionName(request.study.name, who.label, who.session, part.number)


def _describe(
    request: Request,
    devices: _Devices,
    folder: SessionFolder,
    recorder: Recorder,
    infos: tuple[DeviceInfo, ...],
) -> None:
    """Record which devices are used; in real time start their recordings, tell the companion."""
    folder.describe(devices=infos)
    if request.clock.is_virtual:
        return
    if (body := body_of(request)) != "none":
        t_ns = request.clock.now_ns()
        recorder.event("own_body", t_ns, body=body, stature_told_m=request.person.stature_m)
    part_dir = folder.path / folder.manifest.parts[-1].folder
    name = _name_of(request, folder)
    for device in devices.rig.by_role().values():
        if isinstance(device, OwnRecording):
            device.begin_recording(name, part_dir)
    if request.companion is not None:
        request.companion.on_open(
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


def build_stage(
    config: LabConfig,
    experiment: Experiment,
    rig: Rig,
    clock: Clock,
    viewers: Sequence[Viewer],
) -> Stage:
    """Build the stage `display.show` asks for; without drawing, no graphics library is loaded.

    Raises:
        ConfigError: the headset cannot show pictures.
        StageError: there is no screen, or nothing that draws on it.
    """
    show, asks = config.display.show, config.display.questions != "terminal"
    if show == "none" or (clock.is_virtual and show != "offscreen"):
        return GeometryStage(viewers, asks=asks)
    # OpenGL, GLFW and the renderer are loaded only to draw; most simulated sessions do not.
    from visavis.running.sessions.drawn_stages import build_drawn_stage

    return build_drawn_stage(config, experiment, rig, clock, viewers)


def _simulated_participant(request: Request) -> SimulatedParticipant | None:
    if not is_simulated(request.config):
        return None
    participant = request.study.participant(
        request.person.index,
        behaviour_seed(request),
        effect=request.effect,
        experiment=request.experiment,
    )
    # In real time the simulated tracker's thread measures while the session moves the body.
    return participant if request.clock.is_virtual else SharedBody(participant)

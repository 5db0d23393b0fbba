"""Perform a session on a page in a browser, new or resumed, and leave a closed recording behind."""

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import ConfigError, SessionAborted, UsageError
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.plan.experiment import no_progress
from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.operator import SessionStatus, TrialCounts
from visavis.protocol.session.states import SessionState
from visavis.recording.folder import SessionFolder, create_session, open_session, study_dir
from visavis.recording.manifest import DESIGN_KEY, Manifest
from visavis.recording.provenance import provenance
from visavis.recording.reader import Recording
from visavis.recording.writer import Recorder
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import (
    ENCODING,
    FILM_QUALITY,
    FILM_VERSION,
    FilmStore,
    film_store,
    require_roles_of_pages,
)
from visavis.running.live_store import LiveStore, page_files, prepare_live_films
from visavis.running.page.client import visit
from visavis.running.page.course import (
    DECLINED,
    FULL,
    STOPPED,
    WITHDRAWN,
    Notes,
    Visit,
    consent_of,
    course,
    texts_of_page,
)
from visavis.running.page.desk import PageDesk
from visavis.running.page.earlier_parts import EarlierParts, returning_to
from visavis.running.page.server import PageServer, PageSession
from visavis.running.page.visitor import Visitor, visitor_of
from visavis.running.picture_store import PictureStore
from visavis.running.sessions.device_setup import is_simulated
from visavis.running.sessions.plan_lock import carried_by_session
from visavis.running.sessions.recorded_design import design_of
from visavis.running.sessions.recorded_part import recorded_part, recorder_of, refuse_other_plan
from visavis.running.sessions.session_request import PageAddress, Request, behaviour_seed
from visavis.running.sound_store import SoundStore
from visavis.study.cast import use_cast_of, use_recorded_cast
from visavis.study.catalogue import typed_reference
from visavis.study.experiment import StudyExperiment
from visavis.study.files_read import stimulus_files
from visavis.study.films import MIME, SOUND_MIME

SERVED_EVENT: Final = "page_served"
DRAWN_EVENT: Final = "films_drawn"
ENDINGS: Final = {
    DECLINED: "consent was declined; nothing was asked",
    FULL: "all places were taken; nothing was asked",
    STOPPED: "the participant stopped; what is finished is kept",
    WITHDRAWN: "the participant stopped and wants everything deleted",
}
"""Why a session ended before its end, by the outcome of its course."""
LAST_STEP_S: Final = 1.5
"""How long the server answers after the end, so that the page can show its thanks."""


def perform_new(request: Request) -> Path:
    """Perform a session from its beginning; return its folder.

    Raises:
        UsageError: the session exists already.
        SessionAborted: it ended early; what is finished is kept.
    """
    experiment = experiment_of(request)
    require_roles_of_pages(experiment)
    manifest = manifest_of(request, experiment, plan_of(request, experiment))
    store = prepared_films(request)
    with create_session(request.config.data_root, manifest) as folder:
        _perform_part(request, experiment, store, folder, None, 0)
        return folder.path


def plan_of(request: Request, experiment: StudyExperiment) -> SessionPlan:
    """Return the plan of the session that is asked for."""
    return experiment.plan(request.person.index, request.seed, request.person.group)


def manifest_of(request: Request, experiment: StudyExperiment, plan: SessionPlan) -> Manifest:
    """Return the manifest with which a session on a page begins."""
    cast = use_cast_of(request.config)
    is_simulation = is_simulated(request.config)
    consent = consent_of(experiment, plan, questionnaires_of(request, experiment))
    folder = study_dir(request.config.data_root, request.study.name, is_simulated=is_simulation)
    return Manifest(
        study=request.study.name,
        participant=request.person.label,
        session=request.person.session,
        is_simulated=is_simulation,
        plan=plan,
        seed=request.seed,
        configuration={
            "on": "browser",
            "devices": {},
            "lab": request.config.lab,
            "sha256": request.config.sha256,
            "effect": request.effect,
            **carried_by_session(folder, request.study, experiment, request.seed),
            **stimulus_files(experiment),
            DESIGN_KEY: design_of(experiment),
            **cast,
        },
        devices=(),
        consent_version=consent.version
        if consent
        else request.person.consent_version or request.config.privacy.consent_version,
        created_wall_iso=request.clock.wall_iso(),
        provenance=provenance(),
    )


def perform_rest(request: Request, session_path: Path) -> Path:
    """Go on with a session where it was left; return its folder.

    Raises:
        ConfigError: the plan in the manifest is not the one this version would make.
        UsageError: it is older than the study lets people go on.
    """
    use_recorded_cast(Recording(session_path))
    experiment = experiment_of(request)
    store = prepared_films(request)
    folder, _ = open_session(session_path)
    with folder:
        recording = Recording(session_path)
        refuse_other_plan(recording, plan_of(request, experiment))
        port, policy = port_before(recording), experiment.study.procedure.returning
        past = returning_to(recording, policy, request.clock.wall_iso())
        if past is None:
            raise UsageError(
                f"{session_path} was begun more than {policy.within_h:g} h ago, and the study lets "
                "nobody go on after that (returning=…); what is finished is kept"
            )
        _perform_part(request, experiment, store, folder, past, port)
        return folder.path


def prepared_films(
    request: Request, report_progress: Callable[[int, int], None] = no_progress
) -> FilmStore:
    """Return a session's films; build them if a person will watch."""
    experiment = experiment_of(request)
    store = film_store(experiment)
    if not request.clock.is_virtual:
        store.build(experiment.films, report_progress)
        prepare_live_films(experiment.lives, store, report_progress)
    return store


def simulated_visitor(request: Request, experiment: StudyExperiment, store: FilmStore) -> Visitor:
    """Return the simulated participant of a session, before a page.

    Raises:
        ConfigError: the study's own simulated person cannot use a page.
    """
    person = request.study.participant(
        request.person.index,
        behaviour_seed(request),
        effect=request.effect,
        experiment=experiment,
    )
    return visitor_of(person, experiment, store)


def experiment_of(request: Request) -> StudyExperiment:
    """Return the experiment of a request; ConfigError if it is not declared on the kit."""
    experiment = request.experiment
    if not isinstance(experiment, StudyExperiment):
        raise ConfigError(f"{request.study.name} is not declared on the kit; it shows no page")
    return experiment


def questionnaires_of(request: Request, experiment: StudyExperiment) -> tuple[Questionnaire, ...]:
    """Return what the study asks besides its trials, in the language of the page.

    Raises:
        ConfigError: the study is not declared on the kit.
    """
    if not isinstance(request.study, OpenedStudy):
        raise ConfigError(f"{request.study.name} is not declared on the kit; it shows no page")
    config = request.config.model_copy(update={"language": experiment.language})
    return request.study.questionnaires(config)


def key_of(request: Request) -> str:
    """Return the secret in the address of a session's page; no recording contains it.

    It is derived from the study's salt, which is stored separately from the data, so that a page
    finds its session again when another process serves it.
    """
    config = request.config
    key_file = KeyFile(config.key_root, request.study.name, [config.data_root])
    return key_file.page_key(request.person.label, request.person.session)


def board_key_of(request: Request) -> str:
    """Return the secret in the address of a study's board, the same whenever it is served."""
    config = request.config
    return KeyFile(config.key_root, request.study.name, [config.data_root]).board_key()


def port_before(recording: Recording) -> int:
    """Return the port at which a session was served last; 0 where it was not."""
    events = recording.events()
    payloads = list(events.loc[events["name"] == SERVED_EVENT, "payload"])
    return int(payloads[-1]["port"]) if payloads else 0


def page_session_of(
    request: Request,
    experiment: StudyExperiment,
    plan: SessionPlan,
    store: FilmStore,
    folder: SessionFolder,
    recorder: Recorder,
    past: EarlierParts | None,
    key: str,
) -> PageSession:
    """Return a session ready to be served: its desk, where it was left, and its films.

    Raises:
        ConfigError: the study is not declared on the kit.
    """
    virtual = request.clock.is_virtual
    notes = Notes()
    lives = LiveStore(experiment.lives)
    folder_of_study, films = experiment.settings.folder, dict[str, Path]()
    pictures = PictureStore(experiment.pictures, folder_of_study, lives.assets, films=films)
    sounds = SoundStore(experiment.settings.sound_of, lives.assets)
    describe = page_files(store, lives, is_simulated=virtual, pictures=pictures, sounds=sounds)
    visit_of = Visit(
        experiment,
        plan,
        request.person.label,
        request.person.session,
        folder.manifest.parts[-1].number,
        questionnaires_of(request, experiment),
        describe,
        request.clock.now_ns,
        notes,
        EarlierParts().attempt_of if past is None else past.attempt_of,
    )
    desk = PageDesk(
        course(visit_of),
        recorder,
        request.clock,
        notes,
        past,
        key=key,
        headset_streams=experiment.headset_streams,
    )
    drawn_films = {} if virtual else {film: store.file_of(film) for film in experiment.films}
    films |= {describe(film)["film"]: file.path for film, file in drawn_films.items() if file}
    if drawn_films:
        _record_drawing(recorder, request.clock.now_ns(), experiment, store)
    about = about_of(experiment, folder.manifest.is_simulated, request.config.privacy.contact)
    return PageSession(desk, about, films, lives.assets)


def _record_drawing(
    recorder: Recorder, t_ns: int, experiment: StudyExperiment, store: FilmStore
) -> None:
    """Record how the films that a session shows were drawn, and by what."""
    renderers = sorted({store.drawn_by(film) for film in experiment.films})
    recorder.event(
        DRAWN_EVENT,
        t_ns,
        version=FILM_VERSION,
        renderers=renderers,
        quality=dict(FILM_QUALITY),
        encoding=dict(ENCODING),
    )


def _perform_part(
    request: Request,
    experiment: StudyExperiment,
    store: FilmStore,
    folder: SessionFolder,
    past: EarlierParts | None,
    port: int,
) -> None:
    make = partial(recorder_of, clock=request.clock, is_simulated=folder.manifest.is_simulated)
    with recorded_part(request.clock, folder, make, "every answer is kept") as recorder:
        outcome = asyncio.run(_serve(request, experiment, store, folder, recorder, past, port))
        if outcome in ENDINGS:
            todo = (
                f"; do it now: visavis participant withdraw "
                f"{typed_reference(request.study.study)} {request.person.label}"
            )
            raise SessionAborted(ENDINGS[outcome] + (todo if outcome == WITHDRAWN else ""))


async def _serve(
    request: Request,
    experiment: StudyExperiment,
    store: FilmStore,
    folder: SessionFolder,
    recorder: Recorder,
    past: EarlierParts | None,
    port: int,
) -> str:
    virtual = request.clock.is_virtual
    server = PageServer()
    address = request.page or PageAddress()
    await server.start(port=address.port or port)
    try:
        recorder.event(SERVED_EVENT, request.clock.now_ns(), port=0 if virtual else server.port)
        key = "simulated" if virtual else key_of(request)
        plan = plan_of(request, experiment)
        session = page_session_of(request, experiment, plan, store, folder, recorder, past, key)
        desk = session.desk
        desk.on_trial = lambda: _tell(request, desk, len(plan.trials))
        server.add(session)
        if virtual:
            visitor = simulated_visitor(request, experiment, store)
            for step in desk.trial_steps[:-1]:  # after a crash the person remembers them
                if step.kind in ("watch", "show"):
                    visitor.look_again(step)
            await visit(server.address_of(session), visitor, request.clock)
        else:
            if address.on_address is not None:
                address.on_address(server.address_of(session))
            await session.over.wait()
            await asyncio.sleep(LAST_STEP_S)
        if session.failures:
            raise session.failures[0]
        return desk.outcome
    finally:
        await server.stop()


def _tell(request: Request, desk: PageDesk, trial_count: int) -> None:
    """Show the operator the current trial, as a session on devices does."""
    if request.on_trial is not None and desk.trials_done:
        request.on_trial(desk.trial_id, desk.trials_done, trial_count)
    if request.operator.status_period_ns:
        request.operator.show(
            SessionStatus(
                SessionState.TRIAL,
                request.person.label,
                desk.trial_id,
                TrialCounts(desk.trials_done, trial_count),
                block="",
                condition="",
            )
        )


def about_of(experiment: StudyExperiment, simulated: bool, contact: str) -> dict[str, Any]:
    """Return the first information for a page: its words, the contact, if it is a rehearsal."""
    xr = experiment.study.procedure.xr
    return {
        "title": experiment.texts.find("page.title") or experiment.study.title,
        "language": experiment.language,
        "words": dict(texts_of_page(experiment)),
        "contact": contact,
        "is_simulated": simulated,
        "mime": "" if not experiment.films else SOUND_MIME if experiment.voices else MIME,
        **({"draws": True} if experiment.lives or experiment.panoramas else {}),
        **({} if xr == "never" else {"xr": xr}),
    }

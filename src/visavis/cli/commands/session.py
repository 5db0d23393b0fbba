"""plan, run, resume: plan a session, perform it, go on with it."""

import shlex
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from visavis.analysis.gaze.aoi import DEFAULT_PAD_DEG
from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import Level
from visavis.cli.app import (
    ConfigOption,
    DevicesOption,
    JsonOption,
    StudyArgument,
    app,
    console,
    errors,
    load_lab,
    say_json,
    verbatim,
)
from visavis.cli.commands.checking import EXIT_RED, print_check
from visavis.cli.desk.link import ACTIONS, About, SessionLink
from visavis.cli.doctor.findings import Finding
from visavis.cli.doctor.station import station_findings
from visavis.cli.ending import ENDING_SIGNALS, let_signals_interrupt
from visavis.cli.lab_companion import LabCompanion
from visavis.cli.notifier import counting, make_ready, prepare_pages
from visavis.cli.operator_screen import TerminalOperator
from visavis.cli.plan_sheet import (
    as_operators_read,
    item_words,
    letter_words,
    luminance_words,
    print_plan,
    screen_words,
)
from visavis.cli.questions import TerminalRespondent
from visavis.cli.studies import StudyHere, require_session, study_here, study_of_lab
from visavis.lab.clock import SimClock, SystemClock
from visavis.lab.config import LabConfig
from visavis.lab.errors import DeviceError, RecordingError, SessionAborted, UsageError
from visavis.protocol.people.identifiers import make_label
from visavis.protocol.people.ledger import Ledger, Participant, UnknownParticipant
from visavis.protocol.people.own_body import OwnBody, read_own_body
from visavis.protocol.plan.experiment import Experiment, demands_of, spare_roles_of
from visavis.protocol.session.operator import Operator, UnattendedOperator
from visavis.recording.folder import REAL_ROOT, SIMULATED_ROOT, session_dir
from visavis.recording.reader import Recording
from visavis.recording.typed_names import typed_study
from visavis.results.opened_study import OpenedStudy, overrides_of
from visavis.running.film_store import film_store, require_roles_of_pages
from visavis.running.sessions.data_root import require_space
from visavis.running.sessions.device_setup import (
    check_rig,
    devices_for,
    is_simulated,
    require_picture,
    simulated_as_before,
)
from visavis.running.sessions.next_session import next_session
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.recorded_design import (
    changes_of_design,
    changes_since,
    design_of,
    design_of_session,
    in_words,
)
from visavis.running.sessions.session_request import PageAddress, Request, SessionPerson
from visavis.running.sessions.study_folder import (
    DEFAULT_SEED,
    SIMULATED_PREFIX,
    StudySettings,
    holds_trial,
    may_become,
    read_settings,
    refuse_other,
    study_of_session,
)
from visavis.study.cast import use_recorded_cast
from visavis.study.catalogue import typed_reference
from visavis.study.experiment import StudyExperiment
from visavis.study.texts import DEFAULT_LANGUAGE

BODIES = ("female", "male")
MIN_STATURE_M, MAX_STATURE_M = 1.2, 2.3

ParticipantOption = Annotated[
    str, typer.Option("--participant", help="Identifier from the ledger, such as 07.")
]
SessionOption = Annotated[
    int | None,
    typer.Option(
        "--session", min=1, help="Session number; left out: 1, or the next one that is due."
    ),
]
SeedOption = Annotated[
    int | None, typer.Option("--seed", help="Seed of the whole study; kept with its folder.")
]
FastOption = Annotated[
    bool, typer.Option("--fast", help="Virtual clock: seconds instead of minutes; simulated only.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Replace a parameter of a new study: --set trial_s=8; kept with its folder.",
    ),
]
LanguageOption = Annotated[
    str | None,
    typer.Option("--language", help="Language of what participants read: en, de, fr …"),
]
WithoutOption = Annotated[
    list[str] | None,
    typer.Option(
        "--without",
        help="Go on without a device that the study can do without; every trial is flagged.",
    ),
]
OnOption = Annotated[
    str | None,
    typer.Option(
        "--on", help="Where to perform it: lab or browser; left out: where the study says."
    ),
]
PortOption = Annotated[
    int, typer.Option("--port", min=0, max=65535, help="Port of a page; a free one left out.")
]
BodyOption = Annotated[
    str | None,
    typer.Option(
        "--body",
        help="The body the participant sees as their own: female or male; asked once left out.",
    ),
]
BlindOption = Annotated[bool, typer.Option("--blind", help="Hide conditions from the operator.")]


@app.command()
def plan(
    study: StudyArgument,
    participant: Annotated[
        str | None,
        typer.Option(help="Identifier from the ledger, such as 07; left out: the next new one."),
    ] = None,
    session: Annotated[int, typer.Option("--session", min=1, help="Session number.")] = 1,
    seed: SeedOption = None,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    assignments: SetOption = None,
    language: LanguageOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the order of all trials before anything runs.

    Without a participant, what the next new one would get. Example: visavis plan ./duel.py
    """
    lab = load_lab(config, devices, only_simulates=True, quiet=as_json)
    here = study_here(study, lab)
    plan_inputs = plan_inputs_of(here, participant, seed, assignments, language)
    lines: list[str] = []
    if here.study.study.procedure.on == "lab":  # a page needs none of the lab's devices
        plan_inputs.experiment.check_at_devices()
        check_rig(devices_for(lab, plan_inputs.experiment))
        lines = luminance_words(lab, plan_inputs.experiment)
        lines += screen_words(lab, plan_inputs.experiment)
    else:
        film_store(plan_inputs.experiment)  # raises where no page can perform it
        require_roles_of_pages(plan_inputs.experiment)
        plan_inputs.experiment.check_in_headset()
    experiment = plan_inputs.experiment.of_session(session)
    session_plan = experiment.plan(plan_inputs.index, plan_inputs.seed, plan_inputs.group)
    lines += item_words(experiment, session_plan)
    if here.study.study.procedure.on == "lab":  # a browser has fonts of its own
        lines += letter_words(experiment, session_plan)
    session_plan = as_operators_read(session_plan, here.study.study)
    if as_json:
        say_json(asdict(session_plan))
    else:
        print_plan(session_plan, plan_inputs.label, plan_inputs.note, experiment)
        for line in lines:
            console.print(f"[dim]{verbatim(line)}[/]", soft_wrap=True)
    if not as_json:
        for voice in plan_inputs.experiment.voices:
            console.print(
                f"{verbatim(voice.file)} from {voice.from_s:g} s: heard with films; before a "
                f"headset or a monitor from the head of {verbatim(voice.speaker)} (of a pair from "
                "between both), for which the lab needs the role sound",
                soft_wrap=True,
            )
    for name in plan_inputs.experiment.still_staircases:
        errors.print(
            f"[yellow]no trial lets the staircase {verbatim(name)} hear of an answer, so that its "
            "level never moves: call its take(answer.is_right), of keys or a choice that say which "
            "option is right (right=…)[/]",
            soft_wrap=True,
        )
    for note in plan_inputs.experiment.areas_in_part:
        errors.print(f"[yellow]{verbatim(note)}[/]", soft_wrap=True)
    for problem in plan_inputs.experiment.unplayable:
        errors.print(
            f"[yellow]{verbatim(problem)}; `visavis run` will refuse: put the file there, or name "
            "another where the study's parameters are set[/]",
            soft_wrap=True,
        )


@dataclass(frozen=True)
class PlanInputs:
    """What a plan is made from: the experiment, a seed, and a person's place and group."""

    experiment: StudyExperiment
    seed: int
    label: str
    index: int
    group: str
    note: str


def plan_inputs_of(
    here: StudyHere,
    participant: str | None,
    seed: int | None,
    assignments: list[str] | None,
    language: str | None,
) -> PlanInputs:
    """Return what the plan of a participant, or of the next new one, is made from.

    Raises:
        UsageError: the study was begun with other parameters.
    """
    settings = read_settings(here.folder)
    requested_settings = here.requested_settings(assignments=assignments, language=language)
    if settings is not None and not may_become(here.folder, settings, requested_settings):
        refuse_other(here.folder, settings, requested_settings)
    in_force = seed if seed is not None else settings.seed if settings else DEFAULT_SEED
    experiment = here.study.experiment_to_run(requested_settings.parameters)
    label, index, group, note = _place_shown(here.ledger, participant, experiment, in_force)
    changes = changes_of_design(here.folder, experiment)
    if changes:
        warning = f"The sessions in {here.folder} had another design: {in_words(changes)}."
        note = " ".join(filter(None, (note, warning)))
    return PlanInputs(experiment, in_force, label, index, group, note)


def _place_shown(
    ledger: Ledger, participant: str | None, experiment: Experiment, seed: int
) -> tuple[str, int, str, str]:
    """Return label, place and group, and a note where that place is not allocated yet."""
    label, person = "", "the next new participant"
    if participant is not None:
        try:
            entry = ledger.resolve(participant)
        except UnknownParticipant as unknown:
            label, person = make_label(unknown.number, ledger.prefix), "they"
        else:
            return entry.label, entry.index, entry.group, ""
    index = ledger.next_place(lambda place: experiment.plan(place, seed).group)
    unknown_one = f"{label} is not in the ledger yet: no place is allocated. " * (person == "they")
    return (
        label,
        index,
        "",
        f"{unknown_one}Shown is place {index + 1}, which {person} would get now.",
    )


@app.command()
def run(
    study: StudyArgument,
    participant: ParticipantOption,
    session: SessionOption = None,
    seed: SeedOption = None,
    devices: DevicesOption = None,
    fast: FastOption = False,
    blind: BlindOption = False,
    config: ConfigOption = None,
    assignments: SetOption = None,
    language: LanguageOption = None,
    without: WithoutOption = None,
    on: OnOption = None,
    port: PortOption = 0,
    body: BodyOption = None,
) -> None:
    """Perform one session on the devices of lab_config.yaml, or on a page in a browser.

    A page needs no device; with --devices sim it is a rehearsal, with --fast a simulation.

    Example: visavis run stare --participant 07
    """
    lab = load_lab(config, devices)
    opened_study = study_of_lab(study, lab)
    where = where_performed(opened_study, on)
    if where == "lab":
        require_picture(lab)
    elif devices != "sim":
        lab = lab.model_copy(update={"devices": {}})
    here = StudyHere(lab, opened_study)
    if fast and not here.is_simulated:
        raise UsageError("--fast runs on a virtual clock, which people cannot; add --devices sim")
    requested_settings = here.requested_settings(
        seed=seed, assignments=assignments, language=language
    )
    experiment = opened_study.experiment_to_run(requested_settings.parameters)
    if where == "lab":
        check_rig(devices_for(lab, experiment, without or ()))
    # From here on the study's folder is written: with its settings, then with the participant.
    require_space(lab)
    settings = here.settle(requested_settings, seed_given=seed is not None)
    note = here.require_same_design(settings, requested_settings)
    if note:
        errors.print(f"[yellow]{verbatim(note)}[/]", soft_wrap=True)
    entry = here.participant(settings, participant)
    if session is None:
        session = _session_due(here, entry)
    # A session is never overwritten: say how to go on with it, or how to run a further one.
    path = _session_dir(here, entry, session)
    if path.exists():
        others = len(list(path.parent.glob("ses-*")))
        is_complete = Recording(path).status == "complete"
        way_on = f"visavis resume {shlex.quote(str(path))}{' --fast' if fast else ''}"
        first = (
            f"look at it: visavis check {shlex.quote(str(path))}"
            if is_complete
            else f"continue: {way_on}"
        )
        raise UsageError(
            f"participant {entry.label} already has session {session}; nothing was overwritten\n"
            f"  {first}\n  or run a further one: add --session {others + 1}"
        )
    if where == "lab" and not fast:
        ask_body(here, settings, entry, body)
    _perform(
        here,
        settings,
        entry,
        session,
        fast=fast,
        blind=blind,
        resume_from=None,
        without=without,
        on=where,
        port=port,
    )


def _session_due(here: StudyHere, entry: Participant) -> int:
    """Return the number of the session that comes next, and tell whether it is late.

    Raises:
        UsageError: it is not due yet, one is not finished, or there were all.
    """
    design = here.study.study.design
    if not design.sessions:
        return 1
    person = _session_dir(here, entry, 1).parent
    # A rehearsal waits for no day.
    days = None if here.is_simulated else design.days_between
    due = next_session(person, design.sessions, days, SystemClock().wall_iso())
    if due.is_early:
        raise UsageError(
            f"{entry.label}: {due.words}, and {due.days:.1f} days have passed; come back then, or "
            f"run it all the same: add --session {due.number}"
        )
    late = f"; it is late, after {due.days:.1f} days" if due.is_late else ""
    errors.print(
        f"session {due.number} of {len(design.sessions)}: {verbatim(due.name)}{late}",
        soft_wrap=True,
    )
    return due.number


def where_performed(study: OpenedStudy, on: str | None) -> str:
    """Return where a session is performed: lab or browser, by the option or else by the study.

    Raises:
        UsageError: the option is neither lab nor browser.
    """
    if on not in (None, "lab", "browser"):
        raise UsageError(f"--on takes lab or browser, not {on!r}")
    return on or study.study.procedure.on


def _session_dir(here: StudyHere, entry: Participant, session: int) -> Path:
    return session_dir(
        here.lab.data_root, here.study.name, entry.label, session, is_simulated=here.is_simulated
    )


@app.command()
def resume(
    session_path: Annotated[
        Path | None,
        typer.Argument(
            help="Folder of the session (ses-…), or a study; the one unfinished when left out."
        ),
    ] = None,
    devices: DevicesOption = None,
    fast: FastOption = False,
    blind: BlindOption = False,
    config: ConfigOption = None,
    without: WithoutOption = None,
) -> None:
    """Go on with an interrupted session: instructions, calibration, then the trials left.

    Example: visavis resume data/simulated/stare/sub-S07H/ses-001
    """
    lab = load_lab(config, devices)
    if session_path is None:
        session_path = _the_unfinished(lab)
    elif not session_path.is_dir():
        opened_study = study_of_lab(str(session_path), lab)
        typed = typed_reference(opened_study.study)
        session_path = _the_unfinished(lab, opened_study.name, typed)
    # A session goes on as it began: simulated or real, in the lab or on a page.
    require_session(session_path)
    require_space(lab.model_copy(update={"data_root": session_path}))
    recording = Recording(session_path)
    manifest = recording.manifest
    where = "browser" if manifest.configuration.get("on") == "browser" else "lab"
    if where == "lab":
        require_picture(lab)
    elif not recording.is_simulated:
        lab = lab.model_copy(update={"devices": {}})
    if recording.is_simulated != is_simulated(lab):
        kind = "simulated" if recording.is_simulated else "real"
        raise UsageError(
            f"{session_path} is a {kind} session; add --devices "
            f"{'sim' if recording.is_simulated else 'real'}"
        )
    if devices is None:
        lab = simulated_as_before(lab, manifest.configuration.get("devices", {}))
    if recording.status == "complete":
        further = f"--participant {manifest.participant} --session {manifest.session + 1}"
        raise UsageError(
            f"{session_path} is complete; nothing is left to do. Look at it: visavis check "
            f"{shlex.quote(str(session_path))}; a further one: visavis run "
            f"{_typed_study(session_path)} {further}"
        )
    if fast and not recording.is_simulated:
        raise UsageError("--fast runs on a virtual clock, which people cannot; leave it out")
    # The rest must have the design of the first part, or the session would mix two studies.
    use_recorded_cast(recording)
    folder = session_path.resolve().parent.parent
    opened_study, change_note = study_of_session(recording)
    if change_note:
        errors.print(f"[yellow]{verbatim(change_note)}[/]", soft_wrap=True)
    settings = read_settings(folder)
    if settings is None:
        raise UsageError(f"{folder} has no study.json; restore it from a copy")
    language = overrides_of(manifest.plan).get("language", DEFAULT_LANGUAGE)
    settings = replace(settings, parameters={**settings.parameters, "language": language})
    changes = changes_since(
        design_of_session(manifest), design_of(opened_study.experiment(settings.parameters))
    )
    if changes and not holds_trial(session_path):
        number = len(list(session_path.resolve().parent.glob("ses-*"))) + 1
        raise UsageError(
            f"{session_path} was begun with another design ({in_words(changes)}) and ended before "
            "its first trial, so nothing is lost; begin another: visavis run "
            f"{typed_reference(opened_study.study)} --participant {manifest.participant} "
            f"--session {number}"
        )
    if changes:
        raise UsageError(
            f"{session_path} was begun with another design: {in_words(changes)}. Put the study "
            "file back as it was and give the same command again"
        )
    prefix = SIMULATED_PREFIX if recording.is_simulated else ""
    entry = Ledger(folder, SystemClock(), prefix=prefix).resolve(manifest.participant)
    _perform(
        StudyHere(lab, opened_study),
        settings,
        entry,
        manifest.session,
        fast=fast,
        blind=blind,
        resume_from=session_path,
        without=without,
        on=where,
    )


def _typed_study(session: Path) -> str:
    """Return the study of a session as it is typed here: its name, or its file."""
    return typed_study(session.resolve().parent.parent)


def _the_unfinished(lab: LabConfig, study: str = "*", typed: str = "STUDY") -> Path:
    kind = SIMULATED_ROOT if is_simulated(lab) else REAL_ROOT
    sessions = sorted((lab.data_root / kind).glob(f"{study}/sub-*/ses-*/manifest.json"))
    unfinished_paths = [
        p.parent for p in sessions if Recording(p.parent).status in ("aborted", "crashed")
    ]
    if len(unfinished_paths) == 1:
        return unfinished_paths[0]
    if not unfinished_paths:
        raise UsageError(
            f"no unfinished session under {lab.data_root / kind}; a new one begins with "
            f"visavis run {typed} --participant ID"
        )
    choices = "\n  ".join(f"visavis resume {shlex.quote(str(p))}" for p in unfinished_paths)
    raise UsageError(f"several sessions are unfinished; choose one:\n  {choices}")


def _perform(
    here: StudyHere,
    settings: StudySettings,
    entry: Participant,
    session: int,
    *,
    fast: bool,
    blind: bool,
    resume_from: Path | None,
    without: list[str] | None,
    on: str = "lab",
    port: int = 0,
) -> None:
    is_rehearsal = here.is_simulated
    blind = blind or here.study.study.procedure.blind
    experiment = here.study.experiment(settings.parameters).of_session(session)
    if not fast and on == "browser" and isinstance(experiment, StudyExperiment):
        if resume_from is None:
            require_roles_of_pages(experiment)
        prepare_pages(film_store(experiment), experiment)
    # Compute and compile before the operator's screen opens, which would stay empty meanwhile.
    if not fast and on == "lab":
        make_ready(here.study, experiment, here.lab)
    station: tuple[Finding, ...] = ()
    if not fast and on == "lab":
        station = station_findings(here.lab, SystemClock())
        _tell_station(station)
    path = resume_from or _session_dir(here, entry, session)
    own = read_own_body(path.parent)
    # Who watches: the terminal for a session in the lab; nobody for a page or a fast simulation.
    with ExitStack() as stack:
        operator: Operator = UnattendedOperator()
        respondent = None
        if on == "browser":
            let_signals_interrupt()
        elif not fast:
            screen = TerminalOperator(
                console,
                is_simulated=is_rehearsal,
                confirm_waits=not is_rehearsal,
                incidents=here.lab.incidents,
            )
            operator = stack.enter_context(screen)
            _let_signals_end(screen)
            if not is_rehearsal:
                respondent = TerminalRespondent(console, screen.suspend)
        # The desk, another process, finds sessions in real time by this link.
        if not fast:
            about = About(
                here.study.name,
                entry.label,
                session,
                str(path.resolve()),
                is_rehearsal,
                blind,
                ACTIONS if on == "lab" else (),
                here.lab.incidents,
                float(experiment.parameters.get("pad_deg", DEFAULT_PAD_DEG)),
            )
            operator = stack.enter_context(SessionLink(operator, about, here.lab.data_root))
        request = Request(
            study=here.study,
            experiment=experiment,
            config=here.lab,
            on_trial=stack.enter_context(_performing(here.study.name)) if fast else None,
            person=SessionPerson(
                entry.label,
                entry.index,
                entry.group,
                session,
                consent_version=entry.consent_version,
                body=own.body,
                stature_m=own.stature_m,
            ),
            seed=settings.seed,
            clock=SimClock() if fast else SystemClock(),
            operator=operator,
            respondent=respondent,
            effect=settings.effect,
            blind=blind,
            companion=LabCompanion(
                lambda text: errors.print(f"[yellow]{verbatim(text)}[/]"), station
            ),
            without=tuple(dict.fromkeys(without or ())),
            on=on,
            page=PageAddress(port, _tell_address),
        )
        try:
            if resume_from is None:
                perform_new(request)
            else:
                perform_rest(request, resume_from)
        except (SessionAborted, DeviceError, RecordingError) as error:
            stack.close()  # the operator's screen goes before anything is printed
            if not isinstance(error, SessionAborted):
                role = error.role if isinstance(error, DeviceError) else ""
                spare = role in spare_roles_of(request.experiment)
                left_out = [*request.without, *([role] if spare else ())]
                _print_way_on(path, fast=fast, blind=blind, without=left_out if spare else ())
                raise
            errors.print(f"[yellow]{verbatim(error)}[/]", soft_wrap=True)
            _print_way_on(path, fast=fast, blind=blind)
            raise typer.Exit(error.exit_code) from error
    verdict = check_session(Recording(path))
    print_check(verdict, path)
    if verdict.level is Level.RED:
        raise typer.Exit(EXIT_RED)


@contextmanager
def _performing(study: str) -> Iterator[Callable[[str, int, int], None]]:
    """Show the progress of a simulated session, from before its first trial."""
    what = f"performing {study} by a simulated participant"
    if not errors.is_terminal:  # without a terminal the bar appears only at its end
        errors.print(what, soft_wrap=True, highlight=False)
    with counting(errors) as bar:
        line = bar.add_task(what, total=None)
        yield lambda _, count, total: bar.update(line, completed=count, total=total)


def ask_body(
    here: StudyHere, settings: StudySettings, entry: Participant, requested_body: str | None
) -> None:
    """Ask once which body a participant sees as their own, where the study needs it; save it.

    Raises:
        UsageError: there is no such body, or no terminal at which to ask.
    """
    if requested_body is not None and requested_body not in BODIES:
        raise UsageError(f"--body is {requested_body!r}; {' or '.join(BODIES)}")
    wants = demands_of(here.study.experiment(settings.parameters)).own_body
    if not wants or here.lab.display.own_body != "none":
        return
    own = here.ledger.own_body(entry.label)
    if requested_body is None and (own.body or here.is_simulated):
        return
    if requested_body is None and not sys.stdin.isatty():
        raise UsageError(
            f"{here.study.name} shows participants a body of their own, and nobody was asked yet "
            f"which is that of {entry.label}: add --body female or --body male"
        )
    body, stature_m = requested_body or "", own.stature_m
    while body not in BODIES:
        answer = console.input(
            f"Which body does {entry.label} see as their own?  1 female  2 male > "
        ).strip()
        body = {"1": BODIES[0], "2": BODIES[1]}.get(answer, answer)
    while requested_body is None and stature_m is None:
        stature_text = console.input(
            "How tall are they with shoes, in m (Enter: unknown)? > "
        ).strip()
        if not stature_text:
            break
        with suppress(ValueError):
            metres = float(stature_text.replace(",", "."))
            stature_m = metres if MIN_STATURE_M <= metres <= MAX_STATURE_M else None
    here.ledger.describe_body(entry.label, OwnBody(body, stature_m))


def _print_way_on(
    path: Path, *, fast: bool, blind: bool = False, without: Sequence[str] = ()
) -> None:
    if not path.exists():
        return
    trials = check_session(Recording(path)).trials
    complete_count = sum(t.status == "complete" for t in trials)
    skip_count = sum(t.status == "skipped" for t in trials)
    options = f"{' --fast' if fast else ''}{' --blind' if blind else ''}"
    again = f"visavis resume {shlex.quote(str(path))}{options}"
    without_options = "".join(f" --without {role}" for role in without)
    errors.print(
        f"{complete_count} of {len(trials)} trials are done and kept"
        + (f", {skip_count} skipped" if skip_count else "")
        + f". Go on with:\n  {again}"
        + (f"\nor, with every trial flagged:\n  {again}{without_options}" if without else ""),
        soft_wrap=True,
        highlight=False,
    )


def _tell_station(findings: tuple[Finding, ...]) -> None:
    """Print how this computer's timing compares with its locked timing, if there is one."""
    for one in findings:
        if one.level == "warning":
            what = f"{one.found}\n  → {one.remedy}" if one.remedy else one.found
            errors.print(f"[yellow]station: {verbatim(what)}[/]", soft_wrap=True, highlight=False)
        elif one.level == "ok":
            errors.print(f"[dim]station: {verbatim(one.found)}[/]", soft_wrap=True, highlight=False)


def _tell_address(address: str) -> None:
    console.print("The participant's page, on this computer:", soft_wrap=True)
    console.print(f"  [b]{verbatim(address)}[/]", soft_wrap=True, highlight=False)
    console.print("It ends by itself; Ctrl-C ends it now, and every answer is kept.")


def _let_signals_end(screen: TerminalOperator) -> None:
    """End the session properly at the first signal, and at once at the second."""

    def end(*_: object) -> None:
        if screen.abort_requested or screen.is_suspended:
            raise KeyboardInterrupt
        screen.abort_requested = True

    for name in ENDING_SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), end)

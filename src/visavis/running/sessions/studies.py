"""Simulate a whole study, and analyse one: the work of the commands with these names.

Messages go to `notifier`: the command line prints them, a script gets only warnings.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

from visavis.analysis.report.notation import count_of
from visavis.analysis.report.sources import on_virtual_clock
from visavis.lab.clock import SimClock, StopWatch, SystemClock
from visavis.lab.compile_ahead import MEASURING, SIMULATING
from visavis.lab.config import LabConfig
from visavis.lab.config_files import CONFIG_NAME
from visavis.lab.errors import DataError, LedgerError, SessionAborted
from visavis.protocol.people.exports_register import ANALYSIS, register_export
from visavis.protocol.people.ledger import Ledger, Participant, UnknownParticipant
from visavis.recording.durable import make_folder, protect
from visavis.recording.folder import SIMULATED_ROOT, session_dir
from visavis.recording.integrity import DamageReport
from visavis.recording.manifest import Manifest, read_manifest
from visavis.recording.reader import Recording
from visavis.results.intake import SessionIntake
from visavis.results.locked_plan.content import PRIMARY_CLAIMS
from visavis.results.locked_plan.deviations import as_locked
from visavis.results.locked_plan.review import LockedPlan, Peek, PlanReview, review_of
from visavis.results.opened_study import OpenedStudy, overrides_of
from visavis.results.picture_delay import SETTING, read_sync_test, required_for
from visavis.results.planned_tests import planned_tests
from visavis.results.selection import IS_ANALYSED
from visavis.results.several_sessions import absence_lines
from visavis.running.sessions.bill_of_lading import short_bill_hash
from visavis.running.sessions.damage import count_damage, describe, require_intact, write_damage
from visavis.running.sessions.data_root import prepare_data_root
from visavis.running.sessions.intake_list import intake_list
from visavis.running.sessions.piecewise import measure_sessions
from visavis.running.sessions.plan_lock import (
    check_interim_analysis,
    content_now,
    read_lock,
    write_deviations,
)
from visavis.running.sessions.recorded_design import (
    as_recorded,
    compare_designs,
    in_words,
    note_on_files,
    recorded_sessions,
    require_recorded_factors,
    require_same_design,
)
from visavis.running.sessions.runners import on_scheduler, on_this_machine
from visavis.running.sessions.session_list import require_whole
from visavis.running.sessions.simulation import (
    MeasuringTask,
    SimulationTask,
    do_job,
    kernels_of,
    make_ready,
    measure_one,
    simulate_one,
    worker_count,
)
from visavis.running.sessions.study_folder import (
    DERIVED_FOLDER,
    MEASURED_FOLDER,
    SIMULATED_PREFIX,
    StudySettings,
    output_files,
    read_parameters,
    read_settings,
    session_folders,
    sessions_of,
    settle,
    study_of_folder,
)
from visavis.running.sessions.trial_counter import TrialCounter, repeating
from visavis.study.cast import use_recorded_cast
from visavis.study.catalogue import reference_of
from visavis.study.experiment import StudyExperiment
from visavis.study.files_read import differing_files, files_gone
from visavis.study.pieces import Pieces
from visavis.study.sections import TrialToSee


class Notifier(Protocol):
    """Receives messages while a study is simulated or analysed."""

    def say(self, text: str) -> None:
        """Receive a message about what was done."""
        ...

    def warn(self, text: str) -> None:
        """Receive a warning about what the result leaves out or rests on."""
        ...

    def progress(self, what: str) -> AbstractContextManager[Callable[[int, int], None]]:
        """Return a context with a function to call with the amount done and the total."""
        ...


class QuietNotifier:
    """Says nothing but warnings, as Python's."""

    def say(self, text: str) -> None:
        """Keep quiet."""

    def warn(self, text: str) -> None:
        """Warn."""
        warnings.warn(text, stacklevel=3)

    def progress(self, what: str) -> AbstractContextManager[Callable[[int, int], None]]:
        """Keep quiet."""
        return nullcontext(lambda count, total: None)


QUIET: Final = QuietNotifier()


def simulate_study(
    lab: LabConfig,
    opened_study: OpenedStudy,
    requested_settings: StudySettings,
    participants: int,
    data_root: Path,
    *,
    processes: int | None = None,
    scheduler: str | None = None,
    session: int | None = None,
    notifier: Notifier = QUIET,
) -> Path:
    """Simulate what is missing of a study; sessions already there are kept.

    Where sessions are a factor, everybody comes to all of them, or to the one of this number.

    Raises:
        UsageError: the folder was begun with other settings, or with another design.
        DesignError: the study has no such session.
    """
    study, effect = reference_of(opened_study.study), requested_settings.effect
    data_root = data_root.resolve()
    lab = lab.model_copy(update={"data_root": data_root})
    folder = data_root / SIMULATED_ROOT / opened_study.name
    opened_study.experiment_to_run(requested_settings.parameters)
    prepare_data_root(lab)
    # A folder holds sessions of one design with one set of settings.
    settings = settle(
        folder, requested_settings, seed_given=True, way_out="choose another --output"
    )
    experiment = opened_study.experiment(settings.parameters)
    require_same_design(
        folder,
        experiment,
        "Choose another --output; or put the study file back as it was, and "
        "the same command goes on with what is missing",
    )
    if note := note_on_files(folder, experiment):
        notifier.warn(note)
    has_changed = settings.source_sha256 not in ("", requested_settings.source_sha256)
    if has_changed and session_folders(folder):
        notifier.say(
            f"{requested_settings.source}, or a text beside it, has changed since {folder} was "
            "begun: sessions there stay as they are, further ones are made with it as it is now"
        )
    entries = [
        _entry(folder, number, experiment.plan, settings.seed)
        for number in range(1, participants + 1)
    ]
    # Simulate only what is neither complete nor being recorded by another process.
    numbers = _session_numbers(experiment, session)
    sessions = [p.parent for n in numbers for p in folder.glob(f"sub-*/ses-{n:03d}/manifest.json")]
    present = {p for p in sessions if Recording(p).status in ("complete", "running")}
    tasks = [
        SimulationTask(
            study, lab, e.label, e.index, e.group, settings.seed, effect, settings.parameters, n
        )
        for e in entries
        for n in numbers
        if folder / f"sub-{e.label}" / f"ses-{n:03d}" not in present
    ]
    if present:
        notifier.say(f"{len(present)} sessions are there already and are kept")
    if len(sessions) > len(present):
        notifier.say(f"{len(sessions) - len(present)} were interrupted; their rest is simulated")
    watch = StopWatch()
    simulated = count_of(len({t.label for t in tasks}), "participant")
    if experiment.study.design.sessions:
        simulated += f" in {count_of(len(tasks), 'session')}"
    work = _Work(
        simulate_one,
        tasks,
        kernels_of(experiment, SIMULATING),
        f"simulating {simulated}, trials",
        _progress_in_trials(tasks, experiment),
    )
    try:
        _do(work, processes, scheduler, notifier)
    except (KeyboardInterrupt, SessionAborted) as stop:
        raise SessionAborted(
            f"interrupted; what is finished is kept in {folder}. Give the same command again: "
            "it goes on from there"
        ) from stop
    if tasks:
        notifier.say(f"{simulated} simulated in {watch.elapsed_s():.0f} s")
    return folder


def _session_numbers(experiment: StudyExperiment, only: int | None) -> tuple[int, ...]:
    """Return the sessions to simulate: all that the study names, or the one asked for."""
    if only is not None:
        experiment.of_session(only)
        return (only,)
    return tuple(range(1, len(experiment.study.design.sessions or (1,)) + 1))


def _entry(folder: Path, number: int, plan: Any, seed: int) -> Participant:
    ledger = Ledger(folder, SimClock(), prefix=SIMULATED_PREFIX)
    try:
        return ledger.resolve(str(number))
    except UnknownParticipant:
        return ledger.add(number, group=lambda index: plan(index, seed).group)


def analyse_study(
    folder: Path,
    output: Path | None = None,
    *,
    mixture: bool = False,
    processes: int | None = None,
    scheduler: str | None = None,
    measure: Sequence[str] = (),
    accept_damage: bool = False,
    peek: str | None = None,
    sync: Path | None = None,
    make_views: Callable[[Path, Sequence[TrialToSee]], None] | None = None,
    notifier: Notifier = QUIET,
) -> Path:
    """Measure every session of a study and analyse them together; return the report's path.

    `peek` is why results of a blinded study are looked at before it is complete; `sync` a test kept
    by `visavis sync-test`, whose delay of pictures is taken off gaze and times to answer.

    Raises:
        DataError: a recording is damaged and that was not accepted, kinds or studies are mixed, or
            the synchronisation test does not fit these sessions.
        UsageError: the study's locked plan keeps results hidden until it is complete.
    """
    folder = folder.resolve()
    manifest_of = {session: read_manifest(session) for session in sessions_of(folder)}
    # An analysis is of one study, and of real or simulated sessions unless a mixture is wanted.
    names = {m.study for m in manifest_of.values()}
    kinds = {m.is_simulated for m in manifest_of.values()}
    if len(names) > 1:
        raise DataError(f"{folder} holds sessions of {', '.join(sorted(names))}; analyse one study")
    if len(kinds) > 1 and not mixture:
        raise DataError(
            f"{folder} holds simulated and real sessions; take them apart, or add --allow-mixture "
            "if you mean it (everything is then marked as simulated)"
        )
    study = names.pop()
    session_names = recorded_sessions([*manifest_of.values()])
    intake = intake_list([*manifest_of], session_names)
    sessions = intake.sessions
    for line in intake.lines():
        notifier.warn(line)
    manifests = [manifest_of[session] for session in sessions]
    for line in absence_lines(manifests, session_names):
        notifier.warn(line)
    # A blinded study shows no results before it is complete, unless they are asked for.
    locked_plan, clock = read_lock(folder), SystemClock()
    peeks = check_interim_analysis(
        folder, locked_plan, manifests, clock, is_requested=peek is not None, reason=peek or ""
    )
    watch = StopWatch()
    for line in require_whole(folder, accept=accept_damage):
        notifier.warn(line)
    reports = require_intact(sessions, accept=accept_damage)
    damage_reports = [report for report in reports if report.is_damaged]
    bill_hash = short_bill_hash(folder)
    if bill_hash:
        notifier.say(f"bill of lading: {bill_hash}, the hash of all that was recorded")
    if damage_reports:
        notifier.warn(
            f"{count_damage(damage_reports, len(sessions))}; what cannot be read is missing\n"
            f"{describe(damage_reports)}"
        )
    out_dir = output.resolve() if output is not None else folder / DERIVED_FOLDER
    is_ours = output is None or not out_dir.exists()
    make_folder(out_dir, exist_ok=True)
    use_recorded_cast(Recording(sessions[0]))  # before anything of the study is made
    for name in differing_files(manifest.configuration for manifest in manifests):
        notifier.warn(f"{name} was not the same file in all sessions: people saw or heard others")
    opened_study, change_warning = study_of_folder(folder, study)
    opened_study = _with_recorded_design(opened_study, change_warning, folder, manifests, notifier)
    settings = read_parameters(list(measure))
    if sync is not None:
        test = read_sync_test(sync)
        settings = {**settings, SETTING: required_for(test, kinds)}
        notifier.say(
            f"pictures {test.picture_delay_ms:g} ms late, by {test.name} of {test.made_at}"
        )
    opened_study.check_settings(settings)  # before anything is measured
    review = None
    if locked_plan is not None:
        opened_study, review = _review(opened_study, locked_plan, manifests, settings, peeks)
        for line in review.lines():
            notifier.warn(line) if review.deviations else notifier.say(line)
    # Long measurements go trial by trial, so that a stop loses at most one.
    pieces = opened_study.pieces
    if pieces is not None:
        intakes = _measure_piecewise(
            opened_study, pieces, sessions, folder, processes, scheduler, settings, notifier
        )
    else:
        intakes = _measure_sessions(
            opened_study, sessions, reports, processes, scheduler, settings, notifier
        )
    # Keep one manifest per session, not two: with a hundred people they take most memory.
    intakes = [replace(one, manifest=m) for one, m in zip(intakes, manifests, strict=True)]
    halves = _unfinished(intakes)
    analysis = opened_study.analysis_of(intakes, settings)
    counts = analysis.selection.people.set_index("participant")[IS_ANALYSED]
    for who, summary in halves.items():
        verdict = "it is included" if counts.get(who, False) else "they are left out"
        notifier.warn(f"not finished: {summary}; {verdict}")
    intakes = [one.without_tables() for one in intakes]  # the analysis holds everybody's
    # The report names the command that makes it again, and simulated data how they were made.
    report_path = replace(opened_study, tell=notifier.warn, make_views=make_views).write(
        analysis,
        intakes,
        out_dir,
        is_simulated=True in kinds,
        commands=(
            *_origin(folder, manifests),
            *([f"visavis check {_from_root(folder)} --against {bill_hash}"] if bill_hash else []),
            " ".join(
                [
                    "visavis analyse",
                    _from_root(folder),
                    *(f"--set {m}" for m in measure),
                    *([] if sync is None else [f"--sync {sync.name}"]),
                    *(["--accept-damage"] if damage_reports else []),
                ]
            ),
        ),
        example=Recording(sessions[0]),
        folder=_from_root(folder),
    )
    write_damage(damage_reports, out_dir)
    write_deviations(review, out_dir)
    if is_ours:
        protect(out_dir)
    labels = sorted({m.participant for m in manifests})
    files = output_files(out_dir) if is_ours else ()
    try:
        register_export(folder, SystemClock(), ANALYSIS, out_dir, labels, files)
    except LedgerError as error:  # a read-only archive
        notifier.warn(str(error))
    notifier.say(f"{count_of(len(sessions), 'session')} analysed in {watch.elapsed_s():.0f} s")
    return report_path


def _with_recorded_design(
    opened_study: OpenedStudy,
    changed: str,
    folder: Path,
    manifests: Sequence[Manifest],
    notifier: Notifier,
) -> OpenedStudy:
    """Return a study with the levels its sessions had; warn of what was changed since, by name.

    Raises:
        DataError: it has a factor now that none of its sessions had.
    """
    settings = read_settings(folder)
    parameters = {} if settings is None else settings.parameters
    now = opened_study.experiment(parameters, is_recorded=True)
    stimuli = opened_study.study.files.trial_folder
    losses = set(now.files_gone.names if now.files_gone else ()).union(
        *(files_gone(m.configuration, stimuli) for m in manifests)
    )
    if losses:
        names, are = ", ".join(sorted(losses)), "is" if len(losses) == 1 else "are"
        notifier.warn(
            f"{names} {are} gone: measures and areas of interest are those of the recordings, and "
            "what would be drawn from files that are gone is left out"
        )
    changes, mixture_warning = compare_designs(manifests, now)
    require_recorded_factors(folder, manifests, now)
    if changes:
        notifier.warn(
            f"the study has changed since {folder} was begun: {in_words(changes)}. Analysed is "
            "what the sessions had"
        )
    elif changed:
        notifier.warn(f"{changed}. What sessions show and ask is the same")
    if mixture_warning:
        notifier.warn(mixture_warning)
    return as_recorded(opened_study, manifests)


def _unfinished(sessions: Sequence[SessionIntake]) -> dict[str, str]:
    """Describe how far unfinished sessions came, by participant."""
    summaries: dict[str, str] = {}
    for one in sessions:
        parts = one.manifest.parts
        if not parts or parts[-1].status != "complete":
            counts = one.rows[~one.rows["is_practice"].astype(bool)]
            trials_done = counts.loc[counts["status"] == "complete", "trial_id"].nunique()
            who = str(one.manifest.participant)
            summary = f"session of {who}, {trials_done} of {count_of(one.planned_count, 'trial')}"
            summaries[who] = "; ".join(filter(None, (summaries.get(who), summary)))
    return summaries


def _review(
    opened_study: OpenedStudy,
    locked: LockedPlan,
    manifests: Sequence[Manifest],
    settings: Mapping[str, Any],
    peeks: Sequence[Peek],
) -> tuple[OpenedStudy, PlanReview]:
    """Compare a study with its locked plan; what the plan does not name becomes exploratory."""
    experiment = opened_study.experiment(overrides_of(manifests[0].plan), is_recorded=True)
    content = content_now(opened_study, experiment, manifests[0].seed, settings)
    review = review_of(locked, content, manifests, peeks)
    compare = as_locked(opened_study.study.analysis.compare, locked.plan)
    study = opened_study.study.with_changes(compare=compare)
    # Its primary claims are those of the plan, whatever the study file says now.
    primary = locked.plan.get(PRIMARY_CLAIMS, study.analysis.primary)
    still_planned = [name for name in planned_tests(study, compare) if name in primary]
    study = study.with_changes(primary=still_planned)
    return replace(opened_study, study=study, plan=review), review


def _measure_sessions(
    study: OpenedStudy,
    sessions: Sequence[Path],
    reports: Sequence[DamageReport],
    processes: int | None,
    scheduler: str | None,
    settings: Mapping[str, Any],
    notifier: Notifier,
) -> list[Any]:
    """Measure session by session, here or on a scheduler."""
    reference = reference_of(study.study)
    jobs = [
        MeasuringTask(reference, session, settings, report)
        for session, report in zip(sessions, reports, strict=True)
    ]
    kernels = kernels_of(study.experiment({}, is_recorded=True), MEASURING)
    work = _Work(measure_one, jobs, kernels, "measuring")
    return _do(work, processes, scheduler, notifier)


@dataclass(frozen=True)
class _Work:
    """Something to be done with each of many sessions, and the kernels that it calls.

    `progress` returns how much is done and how much there is; without it, jobs are counted.
    """

    function: Callable[[Any], Any]
    jobs: Sequence[Any]
    kernels: Sequence[str]
    name: str
    progress: Callable[[], tuple[int, int]] | None = None


def _progress_in_trials(
    tasks: Sequence[SimulationTask], experiment: StudyExperiment
) -> Callable[[], tuple[int, int]]:
    """Return what tells how many trials of all simulated sessions are finished, and how many."""
    counter = TrialCounter(
        [
            session_dir(t.config.data_root, experiment.name, t.label, t.session, is_simulated=True)
            for t in tasks
        ]
    )
    total = sum(len(experiment.plan(t.index, t.seed, t.group).trials) for t in tasks)
    return lambda: (min(counter.count(), total), total)


def _do(work: _Work, processes: int | None, scheduler: str | None, notifier: Notifier) -> list[Any]:
    """Do all jobs, here or on a scheduler; return their results in order.

    Several processes of this machine first compile the kernels, each of them once: processes that
    began with sessions would all compile the same.
    """
    workers = min(worker_count(processes), len(work.jobs))  # kernels alone are worth no process
    kernels = work.kernels if scheduler is None and workers > 1 else ()
    jobs = [*((make_ready, k) for k in kernels), *((work.function, j) for j in work.jobs)]
    finished = _run(do_job, jobs, workers, scheduler)
    results: dict[int, Any] = {}
    if kernels:
        with notifier.progress("getting numeric code ready") as report_progress:
            ready_count = 0
            report_progress(ready_count, len(kernels))
            while ready_count < len(kernels):
                number, results[number] = next(finished)
                if number < len(kernels):  # a session may be finished before the last kernel
                    ready_count += 1
                    report_progress(ready_count, len(kernels))
    progress = work.progress or (lambda: (len(results) - len(kernels), len(work.jobs)))
    with notifier.progress(work.name) as report_progress:
        report_progress(*progress())
        with repeating(lambda: report_progress(*progress())):
            results.update(finished)
    return [results[i] for i in range(len(kernels), len(jobs))]


def _run(
    work: Callable[[Any], Any], jobs: list[Any], processes: int | None, scheduler: str | None
) -> Iterator[tuple[int, Any]]:
    """Yield (job number, result) as jobs finish, on this machine's cores or a scheduler's."""
    if scheduler is not None:
        return on_scheduler(work, jobs, address=scheduler)
    return on_this_machine(work, jobs, processes=worker_count(processes))


def _measure_piecewise(
    study: OpenedStudy,
    pieces: Pieces,
    sessions: Sequence[Path],
    folder: Path,
    processes: int | None,
    scheduler: str | None,
    settings: Mapping[str, Any],
    notifier: Notifier,
) -> list[Any]:
    """Measure trial by trial, here or on a scheduler; those measured before are kept."""
    run = partial(_run, processes=processes, scheduler=scheduler)
    store = folder / DERIVED_FOLDER / MEASURED_FOLDER
    with notifier.progress("measuring") as report_progress:
        return measure_sessions(study, pieces, sessions, store, run, settings, report_progress)


def _from_root(folder: Path) -> str:
    """Name a study folder as it is named in its lab's folder; without a lab, from its data root on.

    Reports hold no path of the machine, and their commands are typed where the lab's file lies.
    """
    lab = next((a for a in folder.resolve().parents if (a / CONFIG_NAME).is_file()), None)
    if lab is None:
        return "/".join(folder.parts[-3:])
    return folder.resolve().relative_to(lab).as_posix()


def _origin(folder: Path, manifests: Sequence[Manifest]) -> tuple[str, ...]:
    """Return the command that simulates these sessions again; none for sessions in real time."""
    settings = read_settings(folder)
    if settings is None or not settings.is_simulated:
        return ()
    if not all(on_virtual_clock(m) and len(m.parts) == 1 for m in manifests):
        return ()
    count = len(list(folder.glob("sub-*")))
    options = [f"--participants {count}", f"--seed {settings.seed}"]
    options += [f"--set {name}={value}" for name, value in settings.parameters.items()]
    options += [] if settings.effect else ["--no-effect"]
    root = _from_root(folder).rsplit("/", 2)[0]
    name = Path(settings.source).name if settings.source else settings.study
    return (f"visavis simulate {name} {' '.join(options)} --output {root}",)

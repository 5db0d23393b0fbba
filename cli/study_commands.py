"""simulate, analyse, report, demo: a whole study."""

import webbrowser
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from cli.app import ConfigOption, StudyArgument, app, console, load_lab, verbatim
from cli.damage import require_intact, write_damage
from cli.data_root import prepare_data_root
from cli.replicate_runners import on_scheduler, on_this_machine
from cli.session_commands import SIMULATED_PREFIX, LanguageOption
from cli.simulation import SimulationTask, in_parallel, measure_one, simulate_one, worker_count
from cli.studies import folder_of, study_of_folder, study_of_lab
from cli.study_folder import (
    DEFAULT_SEED,
    DERIVED,
    MEASURED,
    StudySettings,
    made_files,
    one_per_participant,
    read_parameters,
    read_settings,
    sessions_of,
    settle,
    wanted_settings,
)
from lab.clock import SimClock, StopWatch, SystemClock
from lab.config import LabConfig
from lab.errors import DataError, LedgerError, SessionAborted
from protocol.exports_register import ANALYSIS, register_export
from protocol.ledger import Ledger, Participant, UnknownParticipant
from recording.durable import make_folder, protect
from recording.folder import SIMULATED_ROOT
from recording.manifest import read_manifest
from recording.reader import Recording
from visavis.catalogue import AnyStudy, PiecewiseStudy, reference_of

DEMO_PARTICIPANTS = 8

ProcessesOption = Annotated[
    int | None, typer.Option("--processes", help="Processes to use; one per core when left out.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", help="Measure on the workers of this Dask scheduler (tcp://…) instead."
    ),
]
MeasureOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="Analyse with another limit or rule: --set max_trial_lost_01=0.3"),
]
StudyFolder = Annotated[
    Path,
    typer.Argument(help="A study's folder (holds sub-…/ses-…), its file (./duel.py), or its name."),
]
AcceptDamageOption = Annotated[
    bool,
    typer.Option("--accept-damage", help="Go on with what is left of damaged recordings."),
]


@app.command()
def simulate(
    study: StudyArgument,
    participants: Annotated[int, typer.Option("--participants", min=1, help="How many.")] = 30,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the study.")] = DEFAULT_SEED,
    output: Annotated[
        Path | None,
        typer.Option("--output", help="Data root to write to; the lab's own when left out."),
    ] = None,
    effect: Annotated[
        bool, typer.Option("--effect/--no-effect", help="Whether agents' gaze matters.")
    ] = True,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a parameter of the study: --set trial_s=8"),
    ] = None,
    language: LanguageOption = None,
    processes: ProcessesOption = None,
    config: ConfigOption = None,
) -> None:
    """Simulate a whole study on the virtual clock, on all cores.

    Example: visavis simulate stare --participants 30 --seed 1 --output out/dry_run
    """
    lab = load_lab(config, "sim", only_simulates=True)
    chosen = study_of_lab(study, lab)
    if output is None:
        name = f"{chosen.name}_n{participants}_seed{seed}" + ("" if effect else "_noeffect")
        output = lab.data_root / "dry_runs" / name
    wanted = wanted_settings(
        output.resolve() / SIMULATED_ROOT / chosen.name, chosen, is_simulated=True, seed=seed,
        assignments=parameters, language=language or lab.language, effect=effect,
    )  # fmt: skip
    folder = simulate_study(lab, chosen, wanted, participants, output, processes)
    console.print(f"[magenta]SIMULATED[/] study in [b]{verbatim(folder)}[/]", soft_wrap=True)
    console.print(f"next: visavis analyse {verbatim(folder)}", soft_wrap=True)


def simulate_study(
    lab: LabConfig,
    chosen: AnyStudy,
    wanted: StudySettings,
    participants: int,
    data_root: Path,
    processes: int | None,
) -> Path:
    """Simulate what is missing of a study; sessions already there are kept.

    Raises:
        UsageError: the folder was begun with other settings.
    """
    study, effect = reference_of(chosen), wanted.effect
    data_root = data_root.resolve()
    lab = lab.model_copy(update={"data_root": data_root})
    folder = data_root / SIMULATED_ROOT / chosen.name
    chosen.experiment(wanted.parameters)
    prepare_data_root(lab)
    settings = settle(folder, wanted, seed_given=True)
    experiment = chosen.experiment(settings.parameters)
    entries = [
        _entry(folder, number, experiment.plan, settings.seed)
        for number in range(1, participants + 1)
    ]
    sessions = [p.parent for p in folder.glob("sub-*/ses-001/manifest.json")]
    present = {p.parent.name for p in sessions if Recording(p).status in ("complete", "running")}
    tasks = [
        SimulationTask(
            study, lab, e.label, e.index, e.group, settings.seed, effect, settings.parameters
        )
        for e in entries
        if f"sub-{e.label}" not in present
    ]
    if present:
        console.print(f"{len(present)} sessions are there already and are kept")
    if len(sessions) > len(present):
        console.print(
            f"{len(sessions) - len(present)} broken off before: what is left is simulated"
        )
    watch = StopWatch()
    with _progress() as bar:
        line = bar.add_task("simulating", total=len(tasks))
        try:
            for _ in in_parallel(simulate_one, [(t,) for t in tasks], worker_count(processes)):
                bar.advance(line)
        except (KeyboardInterrupt, SessionAborted) as stop:
            raise SessionAborted(
                f"interrupted; what is finished is kept in {folder}. Give the same command again: "
                "it goes on from there"
            ) from stop
    if tasks:
        console.print(f"{len(tasks)} participants simulated in {watch.elapsed_s():.0f} s")
    return folder


def _entry(folder: Path, number: int, plan: Any, seed: int) -> Participant:
    ledger = Ledger(folder, SimClock(), prefix=SIMULATED_PREFIX)
    try:
        return ledger.resolve(str(number))
    except UnknownParticipant:
        return ledger.add(number, index=number - 1, group=lambda index: plan(index, seed).group)


@app.command()
def analyse(
    folder: StudyFolder,
    output: Annotated[
        Path | None, typer.Option("--output", help="Where to write; derived/ when left out.")
    ] = None,
    mixture: Annotated[
        bool, typer.Option("--allow-mixture", help="Take simulated and real data together.")
    ] = False,
    processes: ProcessesOption = None,
    scheduler: SchedulerOption = None,
    measure: MeasureOption = None,
    accept_damage: AcceptDamageOption = False,
    config: ConfigOption = None,
) -> None:
    """Write one tidy row per trial, statistics, figures and the report.

    Example: visavis analyse data/simulated/stare
    """
    report_path = analyse_study(
        folder_of(folder, config),
        output,
        mixture=mixture,
        processes=processes,
        scheduler=scheduler,
        measure=measure or [],
        accept_damage=accept_damage,
    )
    console.print(
        f"tables, figures and report in [b]{verbatim(report_path.parent)}[/]", soft_wrap=True
    )
    console.print(f"report: [b]{verbatim(report_path)}[/]", soft_wrap=True)


def analyse_study(
    folder: Path,
    output: Path | None,
    *,
    mixture: bool,
    processes: int | None,
    scheduler: str | None = None,
    measure: Sequence[str] = (),
    accept_damage: bool = False,
) -> Path:
    """Measure every session of a study and analyse them together; return the report's path.

    Raises:
        DataError: a recording is damaged and that was not accepted, or kinds or studies are mixed.
    """
    folder = folder.resolve()
    sessions, left_out = one_per_participant(sessions_of(folder))
    for path in left_out:
        console.print(
            f"[yellow]left out: {verbatim(path.parent.name)}/{verbatim(path.name)}; "
            "of several sessions of one person the first complete one is analysed[/]"
        )
    manifests = [read_manifest(s) for s in sessions]
    names = {m.study for m in manifests}
    kinds = {m.is_simulated for m in manifests}
    if len(names) > 1:
        raise DataError(f"{folder} holds sessions of {', '.join(sorted(names))}; analyse one study")
    if len(kinds) > 1 and not mixture:
        raise DataError(
            f"{folder} holds simulated and real sessions; take them apart, or add --allow-mixture "
            "if you mean it (everything is then marked as simulated)"
        )
    study = names.pop()
    watch = StopWatch()
    damaged = require_intact(sessions, accept=accept_damage)
    out_dir = output.resolve() if output is not None else folder / DERIVED
    is_ours = output is None or not out_dir.exists()
    make_folder(out_dir, exist_ok=True)
    chosen, changed = study_of_folder(folder, study)
    if changed:
        console.print(f"[yellow]{verbatim(changed)}[/]", soft_wrap=True)
    settings = read_parameters(list(measure))
    if isinstance(chosen, PiecewiseStudy):
        ordered = _measured_piecewise(chosen, sessions, folder, processes, scheduler, settings)
    else:
        ordered = _measured(reference_of(chosen), sessions, processes, scheduler)
    report_path = chosen.analyse(
        ordered,
        out_dir,
        is_simulated=True in kinds,
        commands=(
            *_origin(folder),
            " ".join(
                [
                    "visavis analyse",
                    _from_root(folder),
                    *(f"--set {m}" for m in measure),
                    *(["--accept-damage"] if damaged else []),
                ]
            ),
        ),
        example=Recording(sessions[0]),
        settings=settings,
    )
    write_damage(damaged, out_dir)
    if is_ours:
        protect(out_dir)
    labels = sorted({m.participant for m in manifests})
    made = made_files(out_dir) if is_ours else ()
    try:
        register_export(folder, SystemClock(), ANALYSIS, out_dir, labels, made)
    except LedgerError as error:  # an archive that only can be read
        console.print(f"[yellow]{verbatim(str(error))}[/]", soft_wrap=True)
    console.print(f"{len(sessions)} sessions analysed in {watch.elapsed_s():.0f} s")
    return report_path


def _measured(
    study: str, sessions: Sequence[Path], processes: int | None, scheduler: str | None
) -> list[Any]:
    """Measure session by session, here or on a scheduler."""
    jobs = [(study, s) for s in sessions]
    run = (
        partial(on_this_machine, processes=worker_count(processes))
        if scheduler is None
        else partial(on_scheduler, address=scheduler)
    )
    measured: dict[int, Any] = {}
    with _progress() as bar:
        line = bar.add_task("measuring", total=len(sessions))
        for number, result in run(measure_one, jobs):
            measured[number] = result
            bar.advance(line)
    return [measured[i] for i in range(len(sessions))]


def _measured_piecewise(
    study: PiecewiseStudy,
    sessions: Sequence[Path],
    folder: Path,
    processes: int | None,
    scheduler: str | None,
    settings: Mapping[str, Any],
) -> list[Any]:
    """Measure walk by walk, here or on a scheduler; walks measured before are kept."""
    if scheduler is not None:
        run = partial(on_scheduler, address=scheduler)
    else:
        run = partial(on_this_machine, processes=worker_count(processes))
    with _progress() as bar:
        line = bar.add_task("measuring", total=None)
        return study.measure_all(
            sessions,
            folder / DERIVED / MEASURED,
            run,
            lambda done, of: bar.update(line, completed=done, total=of),
            settings,
        )


def _from_root(folder: Path) -> str:
    """Name a study folder from its data root on: reports hold no path of the machine."""
    return "/".join(folder.parts[-3:])


def _origin(folder: Path) -> tuple[str, ...]:
    settings = read_settings(folder)
    if settings is None or not settings.is_simulated:
        return ()
    count = len(list(folder.glob("sub-*")))
    options = [f"--participants {count}", f"--seed {settings.seed}"]
    options += [f"--set {name}={value}" for name, value in settings.parameters.items()]
    options += [] if settings.effect else ["--no-effect"]
    root = folder.parent.parent.name
    name = Path(settings.source).name if settings.source else settings.study
    return (f"visavis simulate {name} {' '.join(options)} --output {root}",)


@app.command()
def report(
    folder: StudyFolder,
    open_it: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    processes: ProcessesOption = None,
    measure: MeasureOption = None,
    accept_damage: AcceptDamageOption = False,
    config: ConfigOption = None,
) -> None:
    """Make the study's self-contained HTML report and say where it lies.

    Example: visavis report data/simulated/stare
    """
    path = analyse_study(
        folder_of(folder, config),
        None,
        mixture=False,
        processes=processes,
        measure=measure or [],
        accept_damage=accept_damage,
    )
    console.print(f"report: [b]{verbatim(path)}[/]", soft_wrap=True)
    if open_it:
        webbrowser.open(path.as_uri())


@app.command()
def demo(
    participants: Annotated[
        int, typer.Option("--participants", min=1, help="How many.")
    ] = DEMO_PARTICIPANTS,
    output: Annotated[Path, typer.Option("--output", help="Where to write.")] = Path("demo"),
    processes: ProcessesOption = None,
    config: ConfigOption = None,
) -> None:
    """Simulate a small stare-in-the-crowd study and analyse it.

    Example: visavis demo
    """
    watch = StopWatch()
    lab = load_lab(config, "sim", only_simulates=True)
    console.print(
        f"Simulating [b]stare in the crowd[/]: {participants} simulated "
        f"participant{'s' if participants > 1 else ''}, 72 trials each, through the session "
        "engine, drivers, recorder and analysis."
    )
    wanted = StudySettings("stare", DEFAULT_SEED, is_simulated=True)
    chosen = study_of_lab("stare", lab)
    folder = simulate_study(lab, chosen, wanted, participants, output, processes)
    path = analyse_study(folder, None, mixture=False, processes=processes)
    console.print(f"done in {watch.elapsed_s():.0f} s; everything is marked [magenta]SIMULATED[/]")
    console.print(f"[b]report: {verbatim(path)}[/]", soft_wrap=True)


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )

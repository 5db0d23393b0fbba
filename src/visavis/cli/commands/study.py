"""simulate, analyse, report, demo: commands for a whole study."""

import shlex
import webbrowser
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from visavis.cli.app import ConfigOption, StudyArgument, app, console, load_lab, say, verbatim
from visavis.cli.commands.session import LanguageOption
from visavis.cli.notifier import NOTIFIER
from visavis.cli.studies import DRY_RUNS, folder_of, study_of_lab
from visavis.lab.clock import StopWatch
from visavis.recording.folder import SIMULATED_ROOT
from visavis.running.sessions.data_root import require_space
from visavis.running.sessions.studies import analyse_study, simulate_study
from visavis.running.sessions.study_folder import (
    DEFAULT_SEED,
    StudySettings,
    wanted_settings,
)

DEMO_PARTICIPANTS = 16
"""Enough to find the effect that the study's source found; eight are mostly too few."""

ProcessesOption = Annotated[
    int | None, typer.Option("--processes", help="Processes to use; one per core when left out.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", help="Work on the workers of this Dask scheduler (tcp://…) instead."
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
SyncOption = Annotated[
    Path | None,
    typer.Option(
        "--sync",
        help="A test kept by sync-test: what pictures were late by is taken off gaze and answers.",
    ),
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
        bool, typer.Option("--effect/--no-effect", help="Whether what is shown makes a difference.")
    ] = True,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a parameter of the study: --set trial_s=8"),
    ] = None,
    language: LanguageOption = None,
    session: Annotated[
        int | None,
        typer.Option("--session", min=1, help="Only the session of this number; all left out."),
    ] = None,
    processes: ProcessesOption = None,
    scheduler: SchedulerOption = None,
    config: ConfigOption = None,
) -> None:
    """Simulate a whole study on the virtual clock, on all cores.

    Example: visavis simulate stare --participants 30 --seed 1 --output out/dry_run
    """
    lab = load_lab(config, "sim", only_simulates=True)
    opened_study = study_of_lab(study, lab)
    # The folder's name says what was simulated, so that dry runs do not mix.
    if output is None:
        name = f"{opened_study.name}_n{participants}_seed{seed}" + ("" if effect else "_noeffect")
        output = lab.data_root / DRY_RUNS / name
        require_space(lab)
    requested_settings = wanted_settings(
        output.resolve() / SIMULATED_ROOT / opened_study.name,
        opened_study,
        is_simulated=True,
        seed=seed,
        assignments=parameters,
        language=language,
        usual_language=lab.language,
        effect=effect,
    )
    folder = simulate_study(
        lab,
        opened_study,
        requested_settings,
        participants,
        output,
        processes=processes,
        scheduler=scheduler,
        session=session,
        notifier=NOTIFIER,
    )
    say(f"[magenta]SIMULATED[/] study in [b]{verbatim(folder)}[/]")
    say(f"next: visavis analyse {verbatim(shlex.quote(str(folder)))}")


PeekOption = Annotated[
    str | None,
    typer.Option(
        "--peek",
        help="Look at results of a blinded study before it is complete, for this reason; recorded.",
    ),
]


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
    peek: PeekOption = None,
    sync: SyncOption = None,
    config: ConfigOption = None,
) -> None:
    """Write one tidy row per trial, statistics, figures and the report.

    Example: visavis analyse data/simulated/stare
    """
    report_path = analyse_study(
        folder_of(folder, config, "analyse"),
        output,
        mixture=mixture,
        processes=processes,
        scheduler=scheduler,
        measure=measure or [],
        accept_damage=accept_damage,
        peek=peek,
        sync=sync,
        notifier=NOTIFIER,
    )
    say(f"tables, figures and report in [b]{verbatim(report_path.parent)}[/]")
    say(f"report: [b]{verbatim(report_path)}[/]")


@app.command()
def report(
    folder: StudyFolder,
    open_it: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    processes: ProcessesOption = None,
    measure: MeasureOption = None,
    accept_damage: AcceptDamageOption = False,
    peek: PeekOption = None,
    sync: SyncOption = None,
    views: Annotated[
        bool,
        typer.Option("--views", help="Make pages of the trials to look at; the report links them."),
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Make the study's self-contained HTML report and say where it lies.

    Example: visavis report data/simulated/stare
    """
    where = folder_of(folder, config, "report")
    make_views = None
    if views:
        from visavis.cli.viewer.report_views import write_views  # late: it loads the viewer

        make_views = partial(write_views, where)
    path = analyse_study(
        where,
        None,
        mixture=False,
        processes=processes,
        measure=measure or [],
        accept_damage=accept_damage,
        peek=peek,
        sync=sync,
        make_views=make_views,
        notifier=NOTIFIER,
    )
    say(f"report: [b]{verbatim(path)}[/]")
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
    settings = StudySettings("stare", DEFAULT_SEED, is_simulated=True)
    opened_study = study_of_lab("stare", lab)
    folder = simulate_study(
        lab, opened_study, settings, participants, output, processes=processes, notifier=NOTIFIER
    )
    path = analyse_study(folder, processes=processes, notifier=NOTIFIER)
    console.print(f"done in {watch.elapsed_s():.0f} s; everything is marked [magenta]SIMULATED[/]")
    say(f"[b]report: {verbatim(path)}[/]")

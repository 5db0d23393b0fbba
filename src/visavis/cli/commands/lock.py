"""lock: freeze the plan of a study."""

from pathlib import Path
from typing import Annotated

import typer

from visavis.cli.app import (
    ConfigOption,
    DevicesOption,
    StudyArgument,
    app,
    console,
    load_lab,
    say,
    verbatim,
)
from visavis.cli.commands.session import LanguageOption, SeedOption, SetOption
from visavis.cli.studies import study_here
from visavis.lab.clock import SystemClock
from visavis.running.sessions.plan_lock import LOCK_NAME, PAGE_NAME, lock_plan
from visavis.running.sessions.study_folder import session_folders
from visavis.running.study_check import try_analysis


@app.command()
def lock(
    study: StudyArgument,
    participants: Annotated[
        int, typer.Option("--participants", min=1, help="How many will take part.")
    ],
    rule: Annotated[
        str, typer.Option("--rule", help="Why so many, and when to stop, in words.")
    ] = "",
    blinded: Annotated[
        bool,
        typer.Option("--blinded", help="Hide results until so many participants are complete."),
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", help="Data root; the lab's own when left out.")
    ] = None,
    seed: SeedOption = None,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    assignments: SetOption = None,
    language: LanguageOption = None,
) -> None:
    """Freeze what a study plans, before its results are looked at.

    Hypotheses, measures, exclusions, comparisons, sample and versions stand in the study's folder
    as JSON with a hash, and as Markdown for a registry. Sessions bear the hash; analyse says what
    deviates, and from when.

    Example: visavis lock ./duel.py --participants 24 --rule "80 % power for d = 0.6"
    """
    lab = load_lab(config, devices)
    if output is not None:
        lab = lab.model_copy(update={"data_root": output.resolve()})
    here = study_here(study, lab)
    requested_settings = here.requested_settings(
        seed=seed, assignments=assignments, language=language
    )
    experiment = here.study.experiment_to_run(requested_settings.parameters)
    if here.study.study.files.path is not None:  # those we ship are tried by our own tests
        try_analysis(here.study, experiment)
    settings = here.settle(requested_settings, seed_given=seed is not None)
    folder = here.folder
    before = len(session_folders(folder))
    locked_plan = lock_plan(
        folder,
        here.study,
        experiment,
        settings.seed,
        SystemClock(),
        participants=participants,
        rule=rule,
        is_blinded=blinded,
        sessions_before=before,
    )
    for name in (LOCK_NAME, PAGE_NAME):
        say(f"wrote [b]{verbatim(folder / name)}[/]")
    console.print(f"SHA-256 {locked_plan.sha256}", highlight=False)
    if before:
        say(f"[yellow]{before} sessions were recorded before; the plan says so[/]")

"""export-web, import-web: put a study on another web host, and fetch its results."""

from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import typer

from visavis.cli.app import (
    ConfigOption,
    DevicesOption,
    StudyArgument,
    app,
    console,
    errors,
    verbatim,
)
from visavis.cli.commands.serving import (
    CompletionOption,
    build_films,
    page_study,
    people_wanted,
)
from visavis.cli.commands.session import LanguageOption, SeedOption, SetOption
from visavis.lab.errors import DataError, UsageError
from visavis.running.page.arrivals import check_completion


@app.command("export-web")
def export_web(
    study: StudyArgument,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="A new folder; NAME.jzip makes an archive for JATOS."),
    ],
    places: Annotated[
        str,
        typer.Option("--places", help="For how many people, or 20/group; plan more than you want."),
    ] = "100",
    unused: Annotated[
        bool,
        typer.Option(
            "--unused",
            help="Only for those who are still missing: places that nobody completed, after "
            "import-web.",
        ),
    ] = False,
    results: Annotated[
        str,
        typer.Option("--results", help="Address that takes answers as they come; not with JATOS."),
    ] = "",
    completion: CompletionOption = "",
    seed: SeedOption = None,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    assignments: SetOption = None,
    language: LanguageOption = None,
) -> None:
    """Write a study as files for JATOS or any web host, where no server can run.

    Every place of the plan is written down beforehand, so what a study shows may not depend on
    answers. Without JATOS or --results people save their answers as a file at the end.

    Places that people took and left are given back by a second bundle: import the results of the
    first, then write those that nobody completed with --unused.

    Example: visavis export-web ./lively.py --places 20/group -o lively.jzip
    """
    # Late: aiohttp comes with visavis[browser], which labs without pages need not install.
    from visavis.running.page.other_hosts.bundle import (
        ARCHIVE,
        completed_places,
        open_places,
        write_bundle,
    )

    check_completion(completion)
    parts = urlsplit(results)
    if results and (parts.scheme not in ("http", "https") or not parts.hostname):
        raise UsageError(f"--results takes an address, https://…, not {results!r}")
    here, base = page_study(study, devices, config, seed, assignments, language)
    completions = completed_places(here.ledger.path.parent) if unused else {}
    indices = open_places(base, *people_wanted(places, "--places"), completions)
    bundle = write_bundle(
        base,
        build_films(base, begins_sessions=True),
        output,
        places=indices,
        completion=completion,
        results=results,
    )
    mark = "[magenta]REHEARSAL[/]  " if here.is_simulated else ""
    films = f" and {bundle.films} films" if bundle.films else ""
    console.print(
        f"{mark}{bundle.places} places{films}, {bundle.size_bytes / 1e6:.1f} MB: "
        f"[b]{verbatim(str(bundle.path))}[/]",
        soft_wrap=True,
    )
    if output.suffix == ARCHIVE:
        console.print("In JATOS: Import study. Later: Results, export, and visavis import-web.")
    else:
        console.print("Put the folder behind HTTPS; everybody opens its index.html.")


@app.command("import-web")
def import_web(
    study: StudyArgument,
    files: Annotated[
        list[Path], typer.Argument(help="What JATOS exported, or files people sent; folders, too.")
    ],
    unfinished: Annotated[
        bool,
        typer.Option("--unfinished", help="Also who left before the end and is not expected back."),
    ] = False,
    seed: SeedOption = None,
    devices: DevicesOption = None,
    config: ConfigOption = None,
    assignments: SetOption = None,
    language: LanguageOption = None,
) -> None:
    """Record what people did with a study that was written for another host.

    Everybody gets an identifier and a session like any other, once, however often a file is read.
    Identifiers of a panel go to the key file.

    Example: visavis import-web ./lively.py jatos_results.jrzip
    """
    # Late, as above.
    from visavis.running.page.other_hosts.results import import_runs, read_runs

    here, base = page_study(study, devices, config, seed, assignments, language)
    runs, unreadable = read_runs(files)
    key_file = None if here.is_simulated else here.key_file
    summary = import_runs(
        base,
        build_films(base, begins_sessions=False),
        here.ledger,
        runs,
        identify=lambda label, who: None if key_file is None else key_file.identify(label, who),
        identity_of=lambda label: None if key_file is None else key_file.identity(label),
        unfinished_too=unfinished,
    )
    mark = "[magenta]SIMULATED[/]  " if here.is_simulated else ""
    console.print(
        f"{mark}{len(summary.sessions)} recorded, {summary.recorded_before} were recorded already"
    )
    for label, path in summary.sessions.items():
        place_note = "; its place was taken, so it has the next free one" * (
            label in summary.moved_labels
        )
        console.print(
            f"  {label}  {verbatim(str(path))}{place_note}", soft_wrap=True, highlight=False
        )
    for label, path in summary.continued_sessions.items():
        text = f"  {label}  {verbatim(str(path))}; went on since it was recorded"
        console.print(text, soft_wrap=True, highlight=False)
    for run, label in summary.twice:
        errors.print(
            f"[yellow]run {verbatim(run[:8])} is {verbatim(label)} once more, from another browser "
            "or link: it was not recorded[/]",
            soft_wrap=True,
        )
    if summary.unfinished:
        console.print(f"{summary.unfinished} are not at their end; --unfinished records them, too")
    for run in summary.withdrawn_runs:
        errors.print(
            f"[yellow]run {verbatim(run[:8])} wanted everything deleted: nothing was recorded; "
            "delete it from your files and from the host, too[/]",
            soft_wrap=True,
        )
    if unreadable:
        errors.print(f"[yellow]{unreadable} lines are not results of a bundle, or were cut[/]")
    for why in summary.refused_runs:
        errors.print(f"[red]left out: {verbatim(why)}[/]", soft_wrap=True)
    if summary.refused_runs:
        raise typer.Exit(DataError.exit_code)

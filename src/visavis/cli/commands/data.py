"""import, init: data in, and a lab to start from."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from visavis.analysis.gaze.mapped_csv import read_mapping
from visavis.cli.app import (
    app,
    say,
    verbatim,
)
from visavis.cli.printed_columns import print_columns
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DataError, UsageError

import_app = typer.Typer(help="Read data recorded by other programs.")
app.add_typer(import_app, name="import")


@import_app.command("gaze")
def import_gaze_files(
    files: Annotated[list[Path], typer.Argument(help="Recordings of one format.")],
    format_name: Annotated[
        str, typer.Option("--format", help="vive, bids, pupil or csv (csv needs --mapping).")
    ] = "vive",
    mapping: Annotated[
        Path | None, typer.Option("--mapping", help="YAML: which column is what, in which unit.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write.")] = Path(
        "imported_gaze"
    ),
) -> None:
    """Report quality and fixations of gaze recordings made elsewhere.

    Example: visavis import gaze session1.csv --format vive -o out/session1
    """
    # Late: it loads matplotlib, which `init` and `export` do without.
    from visavis.analysis.gaze.import_report import FORMATS, read_gaze, report

    if format_name not in FORMATS:
        raise UsageError(f"--format takes {', '.join(FORMATS)}, not {format_name!r}")
    columns = read_mapping(mapping) if mapping is not None else None
    failures: list[str] = []
    for file in files:
        try:
            recording = read_gaze(file, format_name, columns)
            result = report(recording, output)
        except DataError as error:
            if len(files) == 1:
                raise
            failures.append(str(error))
            continue
        print_columns(f"{result.name}: quality", result.quality, across="eye")
        print_columns(f"{result.name}: fixations", result.detectors)
    for failure in failures:
        say(f"[yellow]left out: {verbatim(failure)}[/]")
    say(f"tables and figures in [b]{verbatim(output)}[/]")
    if failures:
        raise typer.Exit(DataError.exit_code)


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(help="Folder of the lab.")] = Path(),
    screen: Annotated[
        bool, typer.Option("--screen", help="A lab with a monitor in the place of a headset.")
    ] = False,
) -> None:
    """Write a lab_config.yaml to start from: everything simulated.

    Example: visavis init my_lab
    """
    target = folder / CONFIG_NAME
    if target.exists():
        raise UsageError(
            f"{target} exists already; it was left as it is: edit it, or give another folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(SCREEN_EXAMPLE if screen else EXAMPLE, target)
    say(
        f"wrote [b]{verbatim(target)}[/]; everything in it is simulated until you edit it; next: "
        "visavis doctor"
    )

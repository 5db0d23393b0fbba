"""export, import, devices, init: data in and out, and what is there."""

import shutil
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from analysis.gaze.imported import import_gaze
from cli.app import CONFIG_NAME, REPOSITORY, ConfigOption, app, console, load_lab
from devices.registry import driver_names
from lab.errors import UsageError
from recording.export import export_session

import_app = typer.Typer(help="Read data recorded by other programs.")
app.add_typer(import_app, name="import")
devices_app = typer.Typer(help="What devices there are.")
app.add_typer(devices_app, name="devices")


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
    result = import_gaze(files, format_name, mapping, output)
    for line in result.lines:
        console.print(line, soft_wrap=True)
    console.print(f"tables and figures in [b]{output}[/]", soft_wrap=True)


@app.command()
def export(
    session_path: Annotated[Path, typer.Argument(help="Folder of the session (ses-…).")],
    format_name: Annotated[
        str, typer.Option("--format", help="parquet (streams, with trials as CSV) or bids.")
    ] = "parquet",
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write.")] = Path(
        "exported"
    ),
) -> None:
    """Copy a session into files that other programs read; the recording is not touched.

    Example: visavis export data/simulated/stare/sub-S07H/ses-001 --format bids -o out/bids
    """
    written = export_session(session_path, format_name, output)
    console.print(f"{len(written)} files in [b]{output}[/]", soft_wrap=True)


@devices_app.command("list")
def list_devices(config: ConfigOption = None) -> None:
    """List the roles of this lab and the drivers that exist.

    Example: visavis devices list
    """
    lab = load_lab(config)
    table = Table("role", "driver", "wire", "options")
    for role, device in lab.devices.items():
        options = ", ".join(f"{k} {v}" for k, v in device.options.items())
        wire = "[magenta]simulated[/]" if device.simulated else "real"
        table.add_row(role, device.driver, wire, options)
    console.print(table)
    console.print("drivers: " + ", ".join(driver_names()))


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(help="Folder of the lab.")] = Path(),
) -> None:
    """Write a lab_config.yaml to start from: everything simulated.

    Example: visavis init my_lab
    """
    target = folder / CONFIG_NAME
    if target.exists():
        raise UsageError(f"{target} exists already; it was left as it is")
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(REPOSITORY / CONFIG_NAME, target)
    console.print(f"wrote [b]{target}[/]; edit it, then: visavis devices list", soft_wrap=True)

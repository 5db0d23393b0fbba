"""export, import, init: data in and out, and a lab to start from."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from visavis.analysis.gaze.mapped_csv import read_mapping
from visavis.analysis.report.notation import count_of
from visavis.cli.app import (
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    load_lab,
    say,
    verbatim,
)
from visavis.cli.personal_copies import protect_and_register
from visavis.cli.sharing import (
    BLURRED_RISK,
    LOSS_NAME,
    dataset_about,
    loss_page,
    losses,
    shared_recording,
    withheld_lines,
)
from visavis.cli.studies import folder_of, session_of
from visavis.experiments.crowd.pedestrian_export import export_walks
from visavis.lab.config import LabConfig
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DataError, UsageError
from visavis.recording.export import export_recording, export_together
from visavis.recording.reader import Recording
from visavis.running.sessions.damage import require_intact
from visavis.running.sessions.folder_check import is_study
from visavis.running.sessions.study_folder import sessions_of

FORMATS = ("parquet", "bids", "xdf", "pedpy")
"""What `export` writes."""

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
        _print_columns(f"{result.name}: quality", _columns(result.quality), across="eye")
        _print_columns(f"{result.name}: fixations", _columns(result.detectors))
    for failure in failures:
        say(f"[yellow]left out: {verbatim(failure)}[/]")
    say(f"tables and figures in [b]{verbatim(output)}[/]")
    if failures:
        raise typer.Exit(DataError.exit_code)


def _print_columns(title: str, columns: Mapping[str, list[Any]], across: str = "") -> None:
    """Print a table; with `across`, turn it by 90° so that wide tables stay readable.

    `across` names the column whose values become the headings.
    """
    table = Table(title=title, title_justify="left", box=None)
    if across:
        for name in ("", *columns[across]):
            table.add_column(str(name), justify="right" if name else "left")
        for name, values in columns.items():
            if name not in (across, "recording"):
                table.add_row(name, *(_cell_text(v) for v in values))
    else:
        data_columns = {k: v for k, v in columns.items() if k != "recording"}
        for name in data_columns:
            table.add_column(name)
        for row in zip(*data_columns.values(), strict=True):
            table.add_row(*(_cell_text(v) for v in row))
    console.print(table)


def _columns(frame: Any) -> dict[str, list[Any]]:
    return {str(name): frame[name].tolist() for name in frame.columns}


def _cell_text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


@app.command()
def export(
    session_path: SessionArgument,
    format_name: Annotated[
        str,
        typer.Option(
            "--format", help="parquet (streams, with trials as CSV), bids, xdf or pedpy (walks)."
        ),
    ] = "parquet",
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write.")] = Path(
        "exported"
    ),
    participant: OfParticipant = "",
    accept_damage: Annotated[
        bool, typer.Option("--accept-damage", help="Export what is left of a damaged recording.")
    ] = False,
    tier: Annotated[
        str,
        typer.Option(
            "--tier",
            help="shared: no free text, ages in bands of ten years; raw: everything; public: "
            "heights, limb lengths and movements blurred, too.",
        ),
    ] = "shared",
    keep_label: Annotated[
        bool, typer.Option("--keep-label", help="The ledger's label instead of a pseudonym.")
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Copy a session into files that other programs read; the recording is not touched.

    Given a study, it copies every session, or the one of --participant.

    People bear a pseudonym that only the study's key file links to their label. With --tier
    public the measures are computed before and after the blur, which takes as long as analyse.

    Example: visavis export data/simulated/stare/sub-S07H/ses-001 --format bids -o out/bids
    """
    if format_name not in FORMATS:
        raise UsageError(f"--format takes {', '.join(FORMATS)}, not {format_name!r}")
    sessions = _sessions_to_export(session_path, config, participant)
    require_intact(sessions, accept=accept_damage)
    is_simulated = all(Recording(session).is_simulated for session in sessions)
    # Looking up a study by its name has already printed which configuration is used.
    lab = load_lab(config, only_simulates=is_simulated, quiet=not session_path.is_dir())
    recordings = [shared_recording(s, lab, tier=tier, keep_label=keep_label) for s in sessions]
    loss_table = losses(recordings, lab) if tier == "public" else None
    paths = _write_recordings(recordings, format_name, output, lab)
    for line in withheld_lines(recordings, lab):
        say(f"[yellow]{verbatim(line)}[/]")
    if loss_table is not None:
        note = output / ("README.md" if format_name == "bids" else LOSS_NAME)
        before = f"{note.read_text('utf-8')}\n" if note in paths else ""
        note.write_text(before + loss_page(loss_table), "utf-8")
        paths = (*dict.fromkeys((*paths, note)),)
        _print_columns("what measures lose by the blur", _columns(loss_table))
        say(f"[yellow]{BLURRED_RISK}[/]")
    say(f"{len(paths)} files of {count_of(len(sessions), 'session')} in [b]{verbatim(output)}[/]")
    protect_and_register(format_name, sessions, output, paths, tells_risk=tier != "public")


def _write_recordings(
    recordings: Sequence[Recording], format_name: str, output: Path, lab: LabConfig
) -> tuple[Path, ...]:
    """Export recordings and return the files.

    BIDS is one data set for all; Parquet tables of several sessions go to a folder each.
    """
    if format_name == "bids":
        return export_together(recordings, output, dataset_about(recordings[0], lab))
    paths: list[Path] = []
    for recording in recordings:
        manifest = recording.manifest
        session_folder = output / f"sub-{manifest.participant}" / f"ses-{manifest.session:03d}"
        if format_name == "pedpy":
            paths += export_walks(recording, output)
        else:
            target = session_folder if format_name == "parquet" and len(recordings) > 1 else output
            paths += export_recording(recording, format_name, target)
    return tuple(paths)


def _sessions_to_export(path: Path, config: Path | None, participant: str) -> list[Path]:
    """Return the sessions to export: one given by its folder, or those of a study."""
    if participant or (path.is_dir() and not is_study(path)):
        return [session_of(path, config, participant)]
    return list(sessions_of(folder_of(path, config, "export")))


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

"""import, init: data in, and a lab to start from."""

import re
import shlex
import shutil
from pathlib import Path
from typing import Annotated

import typer

from visavis.analysis.foreign_motion import import_motion
from visavis.analysis.gaze.mapped_csv import read_mapping
from visavis.cli.app import (
    ConfigOption,
    app,
    say,
    verbatim,
)
from visavis.cli.printed_columns import print_columns
from visavis.cli.studies import folder_of
from visavis.lab.config_files import CONFIG_NAME, EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import UsageError
from visavis.lab.screen import FlatScreen
from visavis.protocol.people.file_lock import locked
from visavis.recording.annotations import Annotation, place_annotations, read_annotations
from visavis.recording.durable import protect_files
from visavis.running.sessions.study_folder import sessions_of

SCREEN = re.compile(r"(\d+)x(\d+),([\d.]+)x([\d.]+),([\d.]+)m?")
MAX_SCREEN_M = 50.0
ANNOTATIONS_LOCK = ".annotations.lock"

import_app = typer.Typer(help="Read data recorded by other programs.")
app.add_typer(import_app, name="import")


@import_app.command("gaze")
def import_gaze_files(
    files: Annotated[list[Path], typer.Argument(help="Recordings of one format.")],
    format_name: Annotated[
        str,
        typer.Option(
            "--format",
            help="vive, bids, pupil, eyelink, tobii, glasses2, glasses3, neon, smi, gazepoint, "
            "varjo, gazebase, or csv (csv needs --mapping).",
        ),
    ] = "vive",
    mapping: Annotated[
        Path | None, typer.Option("--mapping", help="YAML: which column is what, in which unit.")
    ] = None,
    screen: Annotated[
        str,
        typer.Option(
            "--screen",
            help="Pixels, metres and distance of the screen that was looked at, where the file "
            "does not say: 1920x1080,0.53x0.30,0.65",
        ),
    ] = "",
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write.")] = Path(
        "imported_gaze"
    ),
) -> None:
    """Report quality and fixations of gaze recordings made elsewhere.

    All files are read and judged first; if one is refused nothing is written.

    Example: visavis import gaze session1.csv --format vive -o out/session1
    """
    # Late: it loads matplotlib, which `init` and `export` do without.
    from visavis.analysis.gaze.import_report import (
        FORMATS,
        read_recordings,
        refuse_files_there,
        report,
    )

    if format_name not in FORMATS:
        raise UsageError(f"--format takes {', '.join(FORMATS)}, not {format_name!r}")
    columns = read_mapping(mapping) if mapping is not None else None
    # All are read and judged before the first table is written, so that none is left half done.
    recordings = read_recordings(files, format_name, columns, screen_of(screen))
    refuse_files_there([recording.name for recording in recordings], output)
    for recording in recordings:
        result = report(recording, output)
        print_columns(f"{result.name}: quality", result.quality, across="eye")
        print_columns(f"{result.name}: fixations", result.detectors)
        for remark in result.remarks:
            say(f"[yellow]{verbatim(result.name)}: {verbatim(remark)}[/]")
    say(f"tables and figures in [b]{verbatim(output)}[/]")


@import_app.command("motion")
def import_motion_files(
    files: Annotated[list[Path], typer.Argument(help="BIDS files that end in _motion.tsv.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the tables.")],
) -> None:
    """Write BIDS motion in metres and quaternions, x right, y up, z backward, and judge it.

    All files are read first; if one is refused nothing is written.

    Example: visavis import motion sub-01_task-walk_tracksys-omc_motion.tsv -o out/sub-01
    """
    for name, remarks in import_motion(files, output).items():
        say(f"[b]{verbatim(name)}[/]")
        for remark in remarks:
            say(f"[yellow]{verbatim(remark)}[/]")
    say(f"tables in [b]{verbatim(output)}[/]")


@import_app.command("annotations")
def import_annotations(
    study: Annotated[Path, typer.Argument(help="A study: its folder, its file, or its name.")],
    files: Annotated[list[Path], typer.Argument(help="Files that the page of view saved.")],
    config: ConfigOption = None,
) -> None:
    """Put spans that people coded on pages of `visavis view` beside the sessions.

    They are then rows of `annotations.csv` in the person's folder, which `analyse` reads; they
    replace what the same coder had in the same session. All files are read first; if one is refused
    nothing is written.

    Example: visavis import annotations stare stare_S01B_ses-001_AM_annotations.csv
    """
    folder = folder_of(study, config, "import annotations")
    people = {session.parent for session in sessions_of(folder)}
    new: dict[Path, list[Annotation]] = {}
    for file in files:
        for one in read_annotations(file):
            person = folder / f"sub-{one.participant}"
            if person not in people or not (person / f"ses-{one.session:03}").is_dir():
                raise UsageError(
                    f"{file}: {folder} has no session {one.session} of {one.participant}"
                )
            new.setdefault(person, []).append(one)
    if not new:
        raise UsageError(f"{', '.join(map(str, files))}: no span is in there")
    for person, spans in new.items():
        with locked(folder / ANNOTATIONS_LOCK):
            path = place_annotations(person, spans)
        protect_files([path])
        coders = ", ".join(sorted({one.coder for one in spans}))
        say(f"{len(spans)} spans by {verbatim(coders)} in [b]{verbatim(path)}[/]")
    say(f"next: visavis analyse {verbatim(shlex.quote(str(folder)))}")


def screen_of(text: str) -> FlatScreen | None:
    """Return the screen that `--screen 1920x1080,0.53x0.30,0.65` describes; None for "".

    Raises:
        UsageError: the text has another form.
    """
    if not text:
        return None
    match = SCREEN.fullmatch(text.replace(" ", ""))
    if match is None:
        raise UsageError(
            f"--screen takes PIXELS,METRES,DISTANCE as 1920x1080,0.53x0.30,0.65, not {text!r}"
        )
    width_px, height_px = int(match[1]), int(match[2])
    try:
        width_m, height_m, distance_m = (float(match[i]) for i in (3, 4, 5))
    except ValueError as error:
        raise UsageError(f"--screen {text}: {error}") from error
    sizes_m = (width_m, height_m, distance_m)
    if min(width_px, height_px, *sizes_m) <= 0 or max(sizes_m) > MAX_SCREEN_M:
        raise UsageError(f"--screen {text}: sizes are in pixels and metres, more than 0")
    return FlatScreen(width_m, height_m, width_px, height_px, distance_m)


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

"""quality: how good a session's gaze is."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from cli.app import ConfigOption, OfParticipant, SessionArgument, app, console, verbatim
from cli.checking_commands import require_session
from cli.studies import folder_of, session_of
from lab.errors import UsageError
from recording.reader import Recording


@app.command()
def quality(
    session_path: SessionArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder to write the page to.")
    ] = Path("gaze_quality"),
    participant: OfParticipant = "",
    config: ConfigOption = None,
) -> None:
    """Write a page on a session's gaze: accuracy, precision, loss, rate, latency, pupil.

    Example: visavis quality data/simulated/stare/sub-S07H/ses-001 -o out/S07H
    """
    from analysis.gaze.session_page import PAGE_NAME, headline_facts, write_session_page
    from analysis.gaze.session_quality import session_quality

    if participant:
        session_path = session_of(session_path, config, participant)
    elif not session_path.is_dir():
        session_path = folder_of(session_path, config)
    require_session(session_path)
    page = output / PAGE_NAME
    if page.exists():
        raise UsageError(f"{page} is already there; give another folder (-o)")
    found = session_quality(Recording(session_path))
    output.mkdir(parents=True, exist_ok=True)
    write_session_page(found, page)
    table = Table(box=None, show_header=False)
    for name, value in headline_facts(found):
        table.add_row(name, value)
    console.print(table)
    console.print(f"the page is [b]{verbatim(page)}[/]", soft_wrap=True)

"""quality: a page on the quality of a session's gaze, and on streams of the lab's own devices."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from visavis.analysis.gaze.session_page import (
    PAGE_NAME,
    headline_facts,
    stream_facts,
    write_session_page,
    write_streams_page,
)
from visavis.analysis.gaze.session_quality import GAZE, session_quality
from visavis.analysis.own_streams import own_streams
from visavis.cli.app import (
    AcceptDamage,
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    say,
    verbatim,
)
from visavis.cli.personal_copies import protect_and_register, require_whole
from visavis.cli.studies import session_of
from visavis.lab.errors import UsageError
from visavis.recording.reader import Recording


@app.command()
def quality(
    session_path: SessionArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder to write the page to.")
    ] = Path("gaze_quality"),
    participant: OfParticipant = "",
    accept_damage: AcceptDamage = False,
    config: ConfigOption = None,
) -> None:
    """Write a page on a session's gaze: accuracy, precision, loss, rate, latency, pupil.

    Devices of the lab's own (a belt, an amplifier) are described and drawn below it.

    Example: visavis quality data/simulated/stare/sub-S07H/ses-001 -o out/S07H
    """
    session_path = session_of(session_path, config, participant)
    page = output / PAGE_NAME
    if page.exists():
        raise UsageError(f"{page} is already there; give another folder (-o)")
    require_whole(session_path, accept=accept_damage)
    recording = Recording(session_path)
    streams = own_streams(recording)
    facts = stream_facts(streams)
    if GAZE in recording.stream_names or not streams:
        gaze_quality = session_quality(recording)
        facts = (*headline_facts(gaze_quality), *facts)
        output.mkdir(parents=True, exist_ok=True)
        write_session_page(gaze_quality, page, streams)
    else:
        output.mkdir(parents=True, exist_ok=True)
        write_streams_page(streams, recording.manifest.study, page)
    table = Table(box=None, show_header=False)
    for name, value in facts:
        table.add_row(name, value)
    console.print(table)
    say(f"the page is [b]{verbatim(page)}[/]")
    protect_and_register("gaze quality", [session_path], output, [page])

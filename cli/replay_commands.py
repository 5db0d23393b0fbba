"""replay: what happened in one recorded trial, as a film."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from cli.app import app, console
from cli.preview_commands import picture_size
from cli.session_commands import require_session
from lab.errors import DataError, UsageError
from recording.integrity import damage_of
from recording.reader import Recording


@app.command()
def replay(
    session_path: Annotated[Path, typer.Argument(help="Folder of the session (ses-…).")],
    trial: Annotated[str, typer.Option("--trial", help="Which trial: T07.")],
    video: Annotated[Path, typer.Option("--video", help="Film to write: .avi, .mp4 or .webm.")],
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="At most so long; the whole when left out.")
    ] = None,
    rate: Annotated[int, typer.Option("--rate", help="Pictures a second.")] = 25,
    size: Annotated[str, typer.Option("--size", help="Width x height in pixels.")] = "1280x720",
    accept_damage: Annotated[
        bool, typer.Option("--accept-damage", help="Film what is left of a damaged trial.")
    ] = False,
) -> None:
    """Film a recorded walk of the crowd study: from above, the body, contacts, vibrations.

    Example: visavis replay data/simulated/crowd/sub-S01B/ses-001 --trial T07 --video walk.avi
    """
    require_session(session_path)
    recording = Recording(session_path)
    if recording.manifest.study != "crowd":
        raise UsageError(
            f"{session_path} is a session of {recording.manifest.study}; films of recorded trials "
            "are made of the crowd study"
        )
    _require_intact_trial(recording, trial, accept=accept_damage)
    from experiments.crowd.film import write_film

    with Progress(console=console, transient=True) as bar:
        line = bar.add_task("drawing", total=None)
        n = write_film(
            recording,
            trial,
            video,
            size_px=picture_size(size),
            rate_hz=rate,
            seconds=seconds,
            on_frame=lambda done, of: bar.update(line, completed=done, total=of),
        )
    console.print(f"written [b]{video}[/], {n / rate:.1f} s", soft_wrap=True)


def _require_intact_trial(recording: Recording, trial_id: str, *, accept: bool) -> None:
    """Refuse to film a trial that lost samples; damage elsewhere in the session does not matter.

    Raises:
        DataError: naming what is missing.
    """
    reasons = [t.reason for t in damage_of(recording).trials if t.trial_id == trial_id]
    if reasons and not accept:
        raise DataError(
            f"{recording.path}: trial {trial_id} cannot be shown as it was ({reasons[0]}); restore "
            "the files from a copy, or add --accept-damage to film what is left"
        )
    for reason in reasons:
        console.print(f"[yellow]trial {trial_id}: {reason}[/]")

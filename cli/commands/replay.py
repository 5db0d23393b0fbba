"""replay: what happened in one recorded trial, as a film; or the whole session performed again."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
from rich.progress import Progress

from cli.app import (
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    load_lab,
    say,
    verbatim,
)
from cli.commands.preview import picture_size
from cli.preview.pictures import Viewpoint
from cli.studies import session_of
from cli.telling import TELLING, Forecast
from lab.errors import UsageError
from recording.kept import KeptRecording
from visavis.opened import OpenedStudy
from visavis.sessions.cast import use_recorded_cast
from visavis.sessions.study_folder import study_of_folder


@app.command()
def replay(
    session_path: SessionArgument,
    trial: Annotated[str, typer.Option("--trial", help="Which trial: T07.")] = "",
    video: Annotated[
        Path | None, typer.Option("--video", help="Film to write: .avi, .mp4 or .webm.")
    ] = None,
    verify: Annotated[
        bool,
        typer.Option(
            "--verify",
            help="Perform a simulated session again and say where the two first differ.",
        ),
    ] = False,
    participant: OfParticipant = "",
    view: Annotated[Viewpoint, typer.Option(help="eyes, above, or orbit.")] = Viewpoint.EYES,
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="At most so long; the whole when left out.")
    ] = None,
    rate: Annotated[int, typer.Option("--rate", help="Pictures a second.")] = 25,
    size: Annotated[str, typer.Option("--size", help="Width x height in pixels.")] = "1280x720",
    config: ConfigOption = None,
) -> None:
    """Film a recorded trial as it was: what was shown, where gaze fell; of the crowd, from above.

    With --verify a simulated session is performed again on the virtual clock, by the same plan and
    drivers, and compared with what was recorded, bit for bit: exit code 5 when anything differs.

    Example: visavis replay data/simulated/stare/sub-S01B/ses-001 --trial T07 --video trial.avi
    """
    session_path = session_of(session_path, config, participant)
    recording = KeptRecording(session_path)
    use_recorded_cast(recording)
    study, changed = study_of_folder(session_path.resolve().parent.parent, recording.manifest.study)
    if changed:
        say(f"[yellow]{verbatim(changed)}[/]")
    if verify:
        _verify(recording, study, config)
        return
    if not trial or video is None:
        raise UsageError("replay needs --trial and --video FILE for a film, or --verify")
    size_px = picture_size(size)
    with Progress(console=console, transient=True) as bar:
        line = bar.add_task("drawing", total=None)

        forecast = Forecast()

        def told(done: int, of: int) -> None:
            bar.update(line, completed=done, total=of)
            if said := forecast.told(done, of):
                TELLING.say(said.removesuffix(", --png draws one"))

        film = study.study.film_of if isinstance(study, OpenedStudy) else None
        if film is not None:
            n = film(
                recording, trial, video, size_px=size_px, rate_hz=rate, seconds=seconds,
                on_frame=told,
            )  # fmt: skip
        else:
            from cli.film.cameras import CameraKind
            from cli.film.film import write_film

            n = write_film(
                study, recording, trial, video, camera=CameraKind(view.value), size_px=size_px,
                rate_hz=rate, seconds=seconds, on_frame=told,
            ).pictures  # fmt: skip
    say(f"written [b]{verbatim(video)}[/], {n / rate:.1f} s")


def _verify(recording: KeptRecording, study: OpenedStudy, config: Path | None) -> None:
    from cli.commands.checking import EXIT_RED
    from visavis.sessions.verifying import verify

    lab = load_lab(config, "sim", only_simulates=True)
    with (
        console.status("performing the session again"),
        TemporaryDirectory(prefix="visavis") as scratch,
    ):
        verdict = verify(recording, study, lab, Path(scratch))
    rows = sum(verdict.compared.values())
    drawn = f"; not compared: {', '.join(verdict.left_out)}" if verdict.left_out else ""
    if verdict.first is None:
        say(
            f"[green]the same, bit for bit[/]: {rows} rows of {len(verdict.compared)} streams, "
            f"events and trial rows{drawn}"
        )
        return
    say(f"[red]differs[/] first in {verbatim(verdict.first.told())}")
    for name, count in verdict.differing.items():
        say(f"  {verbatim(name)}: {count} of {verdict.compared[name]} rows differ")
    raise typer.Exit(EXIT_RED)

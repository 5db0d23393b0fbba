"""film: a recorded trial as a film, by a camera that knows the room."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from visavis.cli.app import (
    AcceptDamage,
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    console,
    new_file,
    verbatim,
)
from visavis.cli.commands.preview import picture_size
from visavis.cli.film.cameras import CameraKind, Cuts
from visavis.cli.film.film import FilmSettings, Overlay, write_film
from visavis.cli.notifier import NOTIFIER, Forecast
from visavis.cli.personal_copies import protect_and_register, require_whole
from visavis.cli.studies import session_of
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import UsageError
from visavis.recording.cached import CachedRecording
from visavis.running.sessions.study_folder import study_of_session
from visavis.stimuli.camera.shots import ShotSize
from visavis.study.cast import use_recorded_cast

CAMERAS = "auto, topology, follow, eyes, above, orbit, or the .json of an earlier film's decisions"


@app.command()
def film(
    session_path: SessionArgument,
    trial: Annotated[str, typer.Option("--trial", help="Which trial: T07.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Film: .mp4, .webm or .avi.")],
    camera: Annotated[str, typer.Option(help=f"{CAMERAS}.")] = "auto",
    shot: Annotated[str, typer.Option(help="extreme-long, long, full, medium or close.")] = "long",
    cuts: Annotated[str, typer.Option(help="auto, none or static.")] = "auto",
    overlay: Annotated[
        str, typer.Option(help="Any of gaze, contacts and clock, with commas; or none.")
    ] = "gaze,contacts,clock",
    seed: Annotated[int, typer.Option(help="Draws the lengths of shots.")] = 0,
    sheet: Annotated[
        Path | None,
        typer.Option("--sheet", help="Write the film's objective measures (.json) here."),
    ] = None,
    participant: OfParticipant = "",
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="At most so long; the whole when left out.")
    ] = None,
    rate: Annotated[int, typer.Option("--rate", help="Pictures a second.")] = 25,
    size: Annotated[str, typer.Option("--size", help="Width x height in pixels.")] = "960x540",
    accept_damage: AcceptDamage = False,
    config: ConfigOption = None,
) -> None:
    """Film a recorded trial of any study by a camera of your choice, whatever was drawn in it.

    The topology camera looks for places in the room that see the participant, and cuts by the
    rules of film; what it decides is written beside the film (.json), to film it so again. A film
    that names no camera looks over the shoulder of somebody who sits, and is made by the orbit
    camera where no place is found in the room.

    Example: visavis film data/simulated/crowd/sub-S01B/ses-001 --trial T02 -o T02.mp4
    """
    # Check every option and file name first, so that nothing is refused after minutes of drawing.
    camera_choice = _camera_named(camera)
    overlays = _overlays_named(overlay)
    size_px = picture_size(size)
    shot_size, rule = (
        ShotSize(_one_of("--shot", shot, [*ShotSize])),
        Cuts(_one_of("--cuts", cuts, [*Cuts])),
    )
    decisions_path = output.with_suffix(".json")
    new_file(output)
    if decisions_path.exists() and camera in ("auto", "topology"):
        raise UsageError(f"{decisions_path} exists already; choose another name for the film")
    if sheet is not None:
        new_file(sheet)
    # Read the recording with the people and the study file it was made with.
    session_path = session_of(session_path, config, participant)
    require_whole(session_path, accept=accept_damage)
    recording = CachedRecording(session_path)
    use_recorded_cast(recording)
    study, change_note = study_of_session(recording)
    if change_note:
        console.print(f"[yellow]{verbatim(change_note)}[/]", soft_wrap=True)
    forecast = Forecast()
    with Progress(console=console, transient=True) as bar:
        line = bar.add_task("drawing", total=None)

        def report_frame(count: int, total: int) -> None:
            bar.update(line, completed=count, total=total)
            if forecast_text := forecast.line_after(count, total):
                NOTIFIER.say(forecast_text.removesuffix(", --png draws one"))

        result = write_film(
            study,
            recording,
            trial,
            output,
            FilmSettings(
                camera=camera_choice,
                shot=shot_size,
                cuts=rule,
                seed=seed,
                overlays=overlays,
                size_px=size_px,
                rate_hz=rate,
                seconds=seconds,
            ),
            on_frame=report_frame,
        )
    summary = f"written [b]{verbatim(output)}[/], {result.pictures / rate:.1f} s"
    if camera == "auto" and result.camera is CameraKind.ORBIT:
        summary += "; no place for the topology camera in this room, so filmed by --camera orbit"
    if camera == "auto" and result.camera is CameraKind.FOLLOW:
        summary += "; over the shoulder of somebody who sits (--camera follow)"
    console.print(summary, soft_wrap=True)
    if result.decisions is not None:
        result.decisions.write(decisions_path)
        console.print(f"written [b]{verbatim(decisions_path)}[/]", soft_wrap=True)
    if result.sheet is not None:
        console.print(result.sheet.sentence(), soft_wrap=True)
        if sheet is not None:
            result.sheet.write(sheet)
            console.print(f"written [b]{verbatim(sheet)}[/]", soft_wrap=True)
    for hidden in [] if result.decisions is None else result.decisions.hidden:
        console.print(
            f"hidden for {hidden['seconds']:.2f} s at {hidden['t_ns'] / NS_PER_S:.1f} s: "
            f"{hidden['why']}",
            soft_wrap=True,
        )
    # A film is personal data: protect its files and register them, so that a withdrawal finds them.
    files = [output] if result.decisions is None else [output, decisions_path]
    files += [] if result.sheet is None or sheet is None else [sheet]
    protect_and_register("film", [session_path], output.parent, files)


def _one_of(option: str, value: str, choices: list[str]) -> str:
    if value not in choices:
        raise UsageError(f"{option} {value!r}; choose one of {', '.join(choices)}")
    return value


def _camera_named(value: str) -> "CameraKind | Path":
    if value.endswith(".json"):
        return Path(value)
    if value not in [*CameraKind]:
        raise UsageError(f"--camera {value!r}; choose one of {CAMERAS}")
    return CameraKind(value)


def _overlays_named(text: str) -> "list[Overlay]":
    names = [name for name in text.replace(" ", "").split(",") if name not in ("", "none")]
    return [Overlay(_one_of("--overlay", name, [*Overlay])) for name in names]

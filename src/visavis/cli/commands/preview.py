"""preview: any trial of any study as pictures, a film, or in a window, before anyone is invited."""

import bisect
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer
from rich.progress import Progress

from visavis.cli.app import (
    ConfigOption,
    StudyArgument,
    app,
    console,
    load_lab,
    new_file,
    say_written,
)
from visavis.cli.commands.session import LanguageOption, SeedOption, SetOption, plan_inputs_of
from visavis.cli.film.renderer import session_drawing
from visavis.cli.notifier import NOTIFIER, Forecast
from visavis.cli.preview.capture import (
    BackgroundPerformance,
    Capture,
    CapturedFrame,
    has_board,
    is_lit,
    spread,
)
from visavis.cli.preview.on_page import preview_page
from visavis.cli.preview.pictures import (
    SIMULATED,
    Viewpoint,
    add_label,
    camera_of,
    camera_through,
    check_picture_name,
    contact_sheet,
    simulated_panel,
)
from visavis.cli.studies import study_here
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.config import Screen
from visavis.lab.errors import UsageError
from visavis.running.sessions.trial_counter import repeating
from visavis.stage.card.context import draws_on_processor
from visavis.stage.card.targets import EyeTarget
from visavis.stage.mirror import Mirror
from visavis.stage.movie import film_program, open_movie
from visavis.stage.renderer import ON_PROCESSOR, Quality, Renderer
from visavis.stage.stills import Stills
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.picture import Camera, Picture
from visavis.stimuli.scene import SceneFrame

SHEET_COLUMNS, SHEET_ROWS = 4, 3
USUAL_AT_S = 3.0
FOLLOWING = 5
"""How many further trials a film may show when its first trial is shorter than the film."""


@app.command()
def preview(
    study: StudyArgument,
    trial: Annotated[int, typer.Option(help="Number of the trial; 0 is practice.")] = 1,
    participant: Annotated[
        str | None,
        typer.Option(help="Whose plan, such as 07, as `plan` shows it; the next new one left out."),
    ] = None,
    session: Annotated[int, typer.Option("--session", min=1, help="Session number.")] = 1,
    seed: SeedOption = None,
    view: Annotated[Viewpoint, typer.Option(help="eyes, above, or orbit.")] = Viewpoint.EYES,
    png: Annotated[Path | None, typer.Option(help="Write one picture, at --at seconds.")] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="Write a contact sheet over the whole trial.")
    ] = None,
    video: Annotated[Path | None, typer.Option(help="Write a film: .avi, .mp4 or .webm.")] = None,
    window: Annotated[
        bool, typer.Option("--window", help="Show it in a window; so too when nothing is asked.")
    ] = False,
    at: Annotated[
        float | None,
        typer.Option(help="Seconds into the trial, for --png; 3, or the middle of a shorter one."),
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="How long a film goes on, trial after trial.")
    ] = 20.0,
    rate: Annotated[int, typer.Option(help="Pictures a second of a film.")] = 25,
    size: Annotated[str, typer.Option(help="Width x height in pixels.")] = "960x600",
    config: ConfigOption = None,
    assignments: SetOption = None,
    language: LanguageOption = None,
) -> None:
    """Show a trial as its participant sees it: a simulated participant performs it.

    Example: visavis preview stare --trial 5 --video trial5.mp4
    """
    output_count = sum((png is not None, sheet is not None, video is not None, window))
    if output_count > 1:
        raise UsageError("choose one of --png FILE, --sheet FILE, --video FILE and --window")
    for path in (png, sheet, video):
        if path is not None:
            new_file(path)
    for path in (png, sheet):
        if path is not None:
            check_picture_name(path)
    if video is not None:
        film_program(video)
    if not (0 <= (at or 0) < inf and 0 < seconds < inf and 1 <= rate <= 240):
        raise UsageError("--at counts from 0, --seconds from above 0, --rate from 1 to 240")
    size_px = picture_size(size)
    here = study_here(study, load_lab(config, only_simulates=True))
    # A study on pages shows films: they have one viewpoint, and no window of ours.
    on_page = here.study.study.procedure.on == "browser"
    if on_page:
        _refuse_on_page(here.study.name, view, png or sheet or video)
    plan_inputs = plan_inputs_of(here, participant, seed, assignments, language)
    # A simulated participant performs the trial of that plan; every device is simulated, too.
    lab = load_lab(config, "sim", only_simulates=True, quiet=True)
    following = FOLLOWING if video is not None else 0
    capture = Capture(
        here.study,
        lab,
        number=trial,
        index=plan_inputs.index,
        seed=plan_inputs.seed,
        group=plan_inputs.group,
        following=following,
        experiment=plan_inputs.experiment.of_session(session),
    )
    factors = ", ".join(f"{k} {v}" for k, v in capture.trial.factors.items())
    label = f"{here.study.name} {capture.trial.trial_id}  {factors}"
    if on_page:
        preview_page(capture, here.study, label, size_px, png, sheet, video, at, seconds, rate)
        return
    showing = _TrialPreview(capture, picture_of, view, size_px, label, lab.display.on_screen)
    if png is not None:
        _write_picture(showing, png, at)
    elif sheet is not None:
        _write_sheet(showing, sheet)
    elif video is not None:
        _write_film(showing, video, rate, seconds)
    else:
        _play(showing)


def _refuse_on_page(study: str, view: Viewpoint, path: Path | None) -> None:
    """Refuse views and windows of a study on pages before anything is performed.

    Raises:
        UsageError: a page cannot be shown like that.
    """
    if view is not Viewpoint.EYES:
        raise UsageError(f"{study} shows its films on a page: leave --view out")
    if path is None:
        raise UsageError(
            f"{study} shows its films on a page: give --png, --sheet or --video FILE, or look at "
            f"the page itself: visavis run {study} --participant ID --devices sim"
        )


@dataclass(frozen=True, eq=False)
class _TrialPreview:
    """A trial to preview, with its viewpoint, the size of pictures and a label."""

    capture: Capture
    dress: Callable[[SceneFrame], Picture]
    view: Viewpoint
    size_px: tuple[int, int]
    label: str
    screen: Screen | None = None
    """The monitor through which the participant looks; without one, a headset."""

    def at(self, frame: CapturedFrame) -> tuple[Picture, Camera]:
        """Return the picture of a frame and the camera that sees it."""
        picture = self.dress(replace(frame.view, t_ns=frame.t_ns))
        aspect = self.size_px[0] / self.size_px[1]
        passed_s = self.passed_s(frame)
        if self.view is Viewpoint.EYES and self.screen is not None:
            return picture, camera_through(self.screen, frame.head, aspect)
        return picture, camera_of(self.view, picture, frame.head, aspect, passed_s=passed_s)

    def passed_s(self, frame: CapturedFrame) -> float:
        """Return the time in seconds since the first lit frame."""
        return (frame.t_ns - self.capture.frames[0].t_ns) / NS_PER_S

    def frames(self, until_s: float | None = None) -> list[CapturedFrame]:
        """Perform the trial and return its frames, up to `until_s` seconds.

        Raises:
            UsageError: the trial showed nothing.
        """
        with console.status("performing the trial") as shown:

            def tell() -> None:
                seconds = self.passed_s(self.capture.frames[-1]) if self.capture.frames else 0.0
                goal = "" if until_s is None else f" of {until_s:g}"
                shown.update(f"performing the trial: {seconds:.1f}{goal} s of it")

            with repeating(tell):
                frames = self.capture.perform(until_s)
        if not frames:
            raise UsageError(
                f"trial {self.capture.trial.number} showed nothing but darkness; the study shows "
                "no scene in it (t.show): choose another with --trial"
            )
        return frames


def _write_picture(showing: _TrialPreview, path: Path, at_s: float | None) -> None:
    frames = showing.frames(USUAL_AT_S if at_s is None else at_s)
    frame = frames[-1]
    length_s = showing.passed_s(frame)
    if showing.capture.is_whole and at_s is not None and at_s > length_s:
        raise UsageError(f"--at {at_s} s: the trial lasts {length_s:.1f} s")
    if at_s is None and (has_board(frame.view) or not is_lit(frame.view) or length_s < USUAL_AT_S):
        lit_frames = [f for f in frames if is_lit(f.view) and not has_board(f.view)] or frames
        frame = lit_frames[len(lit_frames) // 2]
    with console.status("drawing the picture"), Stills() as stills:
        image = stills.image(*showing.at(frame), showing.size_px)
    time_s = showing.passed_s(frame) if at_s is None else at_s
    add_label(image, f"{SIMULATED}  ·  {showing.label}, {time_s:.1f} s").save(path)
    say_written(path)


def _write_sheet(showing: _TrialPreview, path: Path) -> None:
    frames = showing.frames()
    width, height = showing.size_px[0] // 2, showing.size_px[1] // 2
    frame_positions = np.linspace(0.0, 1.0, SHEET_COLUMNS * SHEET_ROWS) * (len(frames) - 1)
    tiles = []
    with Stills() as stills, Progress(console=console, transient=True) as bar:
        for k in bar.track(frame_positions.round().astype(int).tolist(), description="drawing"):
            image = stills.image(*showing.at(frames[k]), (width, height))
            tiles.append(add_label(image, f"{SIMULATED}  {showing.passed_s(frames[k]):.1f} s"))
    contact_sheet(tiles, f"{showing.label}  ·  {SIMULATED}", SHEET_COLUMNS).save(path)
    say_written(path)


def _write_film(showing: _TrialPreview, path: Path, rate_hz: int, most_s: float) -> None:
    frames = spread(showing.frames(most_s), rate_hz, most_s)
    label = f"{SIMULATED}  ·  from {showing.label} on"
    with (
        session_drawing() as drawing,
        open_movie(path, showing.size_px, rate_hz) as film,
        Progress(console=console, transient=True) as bar,
    ):
        forecast = Forecast()
        for number, frame in enumerate(bar.track(frames, description="drawing"), start=1):
            image: npt.NDArray[np.uint8] = drawing.image(*showing.at(frame), showing.size_px)
            film.add(np.asarray(add_label(image, label)))
            if forecast_text := forecast.line_after(number, len(frames)):
                NOTIFIER.say(forecast_text)
    say_written(path, f", {len(frames) / rate_hz:.1f} s")


def _play(showing: _TrialPreview) -> None:
    """Show the trial in a window at its own speed, again and again, until it is closed."""
    from visavis.stage.window import Window  # late: GLFW, which not every server has

    display = Window(f"{showing.label}  ·  {SIMULATED}", showing.size_px)
    clock = SystemClock()
    try:
        quality = ON_PROCESSOR if draws_on_processor(display.context) else Quality()
        with (
            BackgroundPerformance(showing.capture) as meanwhile,
            Renderer(display.context, quality=quality) as renderer,
        ):
            mirror = Mirror(display)
            target = EyeTarget(display.context, showing.size_px, quality.samples)
            frames = showing.capture.frames
            begin_ns = clock.now_ns()
            while not display.closed and "escape" not in display.keys():
                meanwhile.check()
                passed_ns = clock.now_ns() - begin_ns
                until_ns = frames[-1].t_ns - frames[0].t_ns
                if passed_ns > until_ns and showing.capture.is_whole:
                    begin_ns, passed_ns = clock.now_ns(), 0
                t_ns = frames[0].t_ns + min(passed_ns, until_ns)
                k = max(0, bisect.bisect_right(frames, t_ns, key=lambda frame: frame.t_ns) - 1)
                picture, camera = showing.at(replace(frames[k], t_ns=t_ns))
                marked_picture = replace(picture, panels=(*picture.panels, simulated_panel(camera)))
                renderer.draw(marked_picture, [camera], [target])
                mirror.show(display.context, target.texture)
            target.release()
    finally:
        display.close()


def picture_size(text: str) -> tuple[int, int]:
    """Return width and height in pixels of a text such as "960x600", rounded down to even.

    Raises:
        UsageError: it is not a size, or too small or large to draw.
    """
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and 64 <= int(width) <= 7680):
        raise UsageError(f"--size {text!r}; write width x height in pixels, such as 960x600")
    if not 64 <= int(height) <= 4320:
        raise UsageError(f"--size {text!r}; heights go from 64 to 4320 pixels")
    return int(width) - int(width) % 2, int(height) - int(height) % 2

"""preview: any trial of any study as pictures, a film, or in a window, before anyone is invited."""

import bisect
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer
from PIL import Image, ImageDraw, ImageFont
from rich.progress import Progress

from cli.app import ConfigOption, StudyArgument, app, console, load_lab
from cli.preview_capture import Seen, capture, spread
from cli.studies import find_study
from lab.clock import SystemClock
from lab.errors import UsageError
from lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, unit, yaw_pitch_deg_of
from stimuli.picture import Camera, Picture
from stimuli.scene import SceneFrame

EYES_TANGENT = 0.84
"""Half of 80° from top to bottom, for a picture seen on a screen."""
AROUND_TANGENT = 0.45
SHEET_COLUMNS = 4


class Viewpoint(StrEnum):
    """From where a preview looks."""

    EYES = "eyes"
    ABOVE = "above"
    ORBIT = "orbit"


@app.command()
def preview(
    study: StudyArgument,
    trial: Annotated[int, typer.Option(help="Number of the trial; 0 is practice.")] = 1,
    participant: Annotated[int, typer.Option(help="Whose plan: 1, 2, …")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the study.")] = 1,
    view: Annotated[Viewpoint, typer.Option(help="eyes, above, or orbit.")] = Viewpoint.EYES,
    png: Annotated[Path | None, typer.Option(help="Write one picture, at --at seconds.")] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="Write a contact sheet over the whole trial.")
    ] = None,
    video: Annotated[Path | None, typer.Option(help="Write a film: .avi, .mp4 or .webm.")] = None,
    window: Annotated[bool, typer.Option("--window", help="Show it in a window.")] = False,
    at: Annotated[float, typer.Option(help="Seconds into the trial, for --png.")] = 3.0,
    seconds: Annotated[float, typer.Option(help="At most so long, for --video.")] = 20.0,
    rate: Annotated[int, typer.Option(help="Pictures a second of a film.")] = 25,
    size: Annotated[str, typer.Option(help="Width x height in pixels.")] = "960x600",
    config: ConfigOption = None,
) -> None:
    """Show a trial as its participant sees it: a simulated participant performs it.

    Example: visavis preview stare --trial 5 --video trial5.mp4
    """
    from cli.stages import dresser_of
    from stage.renderer import Renderer

    if sum((png is not None, sheet is not None, video is not None, window)) != 1:
        raise UsageError("choose one of --png FILE, --sheet FILE, --video FILE and --window")
    for path in (png, sheet, video):
        if path is not None and path.exists():
            raise UsageError(f"{path} exists already; choose another name")
    width, height = _size(size)
    lab = load_lab(config, "sim")
    chosen = find_study(study)
    dress = dresser_of(chosen.name)
    with console.status("performing the trial"):
        planned, seen = capture(chosen, lab, number=trial, index=participant, seed=seed)
    if not seen:
        raise UsageError(f"trial {trial} of {study} showed nothing")
    start_ns = seen[0].t_ns
    length_s = (seen[-1].t_ns - start_ns) * 1e-9
    factors = ", ".join(f"{k} {v}" for k, v in planned.factors.items())
    label = f"{study} {planned.trial_id}  {factors}  ·  simulated"

    def picture_of(k: int) -> Picture:
        return dress(replace(seen[k].view, t_ns=seen[k].t_ns))

    def camera_of(k: int, picture: Picture) -> Camera:
        turn_deg = 40.0 + 12.0 * (seen[k].t_ns - start_ns) * 1e-9
        return _camera(view, picture, seen[k].head, width / height, turn_deg)

    if window:
        _play(label, seen, dress, view, (width, height))
        return
    with Renderer() as renderer:
        if png is not None:
            if not 0 <= at <= length_s:
                raise UsageError(f"--at {at} s: the trial lasts {length_s:.1f} s")
            k = _nearest([s.t_ns for s in seen], start_ns + round(at * 1e9))
            picture = picture_of(k)
            image = renderer.image(picture, camera_of(k, picture), (width, height))
            _labelled(image, f"{label}, {at:.1f} s").save(png)
            console.print(f"written [b]{png}[/]", soft_wrap=True)
        elif sheet is not None:
            chosen_k = np.linspace(0.02, 0.98, SHEET_COLUMNS * 3) * (len(seen) - 1)
            tiles = []
            for k in chosen_k.round().astype(int).tolist():
                picture = picture_of(k)
                image = renderer.image(picture, camera_of(k, picture), (width // 2, height // 2))
                tiles.append(_labelled(image, f"{(seen[k].t_ns - start_ns) * 1e-9:.1f} s"))
            _contact_sheet(tiles, label).save(sheet)
            console.print(f"written [b]{sheet}[/]", soft_wrap=True)
        elif video is not None:
            from stage.movie import open_movie

            seen = spread(seen, rate, seconds)
            with (
                open_movie(video, (width, height), rate) as film,
                Progress(console=console, transient=True) as bar,
            ):
                for k in bar.track(range(len(seen)), description="drawing"):
                    picture = picture_of(k)
                    image = renderer.image(picture, camera_of(k, picture), (width, height))
                    film.add(np.asarray(_labelled(image, label)))
            console.print(
                f"written [b]{video}[/], {len(seen) / rate:.1f} s of {length_s:.1f} s",
                soft_wrap=True,
            )


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and 64 <= int(width) <= 7680):
        raise UsageError(f"--size {text!r}; write width x height in pixels, such as 960x600")
    if not 64 <= int(height) <= 4320:
        raise UsageError(f"--size {text!r}; heights go from 64 to 4320 pixels")
    return int(width) - int(width) % 2, int(height) - int(height) % 2


def _nearest(times_ns: list[int], t_ns: int) -> int:
    return int(np.argmin(np.abs(np.array(times_ns) - t_ns)))


def _camera(
    view: Viewpoint, picture: Picture, head: Pose, aspect: float, turn_deg: float
) -> Camera:
    """Return the camera of a viewpoint; those from outside hold the people and the head."""
    if view is Viewpoint.EYES:
        return _framed(head, EYES_TANGENT, aspect)
    points = np.concatenate([picture.people.root_m, head.position_m[None]])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    middle[1] = 1.0
    radius = max(1.6, float(np.linalg.norm((points - middle)[:, [0, 2]], axis=1).max()) + 0.5)
    if view is Viewpoint.ABOVE:
        height = radius / AROUND_TANGENT
        towards = np.array([0.0, -height, -0.02])
        place = middle - towards
    else:
        back = min(radius / AROUND_TANGENT, 3.4 + radius)
        angle = np.radians(turn_deg)
        place = middle + np.array([np.sin(angle) * back, 1.4 + 0.12 * back, np.cos(angle) * back])
        towards = middle - place
    return _framed(_looking(place, towards), AROUND_TANGENT, aspect)


def _looking(place: Vector, towards: Vector) -> Pose:
    yaw_deg, pitch_deg = yaw_pitch_deg_of(unit(towards))
    return Pose(place, quat_from_yaw_pitch_deg(float(yaw_deg), float(pitch_deg)))


def _framed(pose: Pose, top: float, aspect: float) -> Camera:
    return Camera(pose, -top * aspect, top * aspect, -top, top)


def _labelled(image: npt.NDArray[np.uint8], text: str) -> Image.Image:
    """Write a line along the lower edge."""
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture, "RGBA")
    font = ImageFont.load_default(max(11, picture.height // 44))
    _, top, right, bottom = draw.textbbox((0, 0), text, font=font)
    y = picture.height - (bottom - top) - 12
    draw.rectangle((0, y - 4, right + 16, picture.height), fill=(0, 0, 0, 140))
    draw.text((8, y - top + 2), text, fill=(255, 255, 255), font=font)
    return picture


def _contact_sheet(tiles: list[Image.Image], title: str) -> Image.Image:
    width, height = tiles[0].size
    rows = -(-len(tiles) // SHEET_COLUMNS)
    sheet = Image.new("RGB", (SHEET_COLUMNS * width, rows * height + 40), (250, 250, 250))
    ImageDraw.Draw(sheet).text((10, 9), title, (20, 20, 20), ImageFont.load_default(20))
    for k, tile in enumerate(tiles):
        sheet.paste(tile, ((k % SHEET_COLUMNS) * width, 40 + (k // SHEET_COLUMNS) * height))
    return sheet


def _play(
    title: str,
    seen: list[Seen],
    dress: Callable[[SceneFrame], Picture],
    view: Viewpoint,
    size_px: tuple[int, int],
) -> None:
    """Show the trial in a window at its own speed, again and again, until it is closed."""
    from stage.mirror import Mirror
    from stage.renderer import Renderer
    from stage.targets import EyeTarget
    from stage.window import Window

    clock = SystemClock()
    display = Window(title, size_px)
    times_ns = [s.t_ns for s in seen]
    length_ns = max(1, times_ns[-1] - times_ns[0])
    aspect = size_px[0] / size_px[1]
    try:
        with Renderer(display.context) as renderer:
            mirror = Mirror(display)
            target = EyeTarget(display.context, size_px, renderer.quality.samples)
            begin_ns = clock.now_ns()
            while not display.closed and "escape" not in display.keys():
                passed_ns = (clock.now_ns() - begin_ns) % length_ns
                k = max(0, bisect.bisect_right(times_ns, times_ns[0] + passed_ns) - 1)
                picture = dress(replace(seen[k].view, t_ns=times_ns[0] + passed_ns))
                turn_deg = 40.0 + 12.0 * passed_ns * 1e-9
                camera = _camera(view, picture, seen[k].head, aspect, turn_deg)
                renderer.draw(picture, [camera], [target])
                mirror.show(display.context, target.texture)
            target.release()
    finally:
        display.close()

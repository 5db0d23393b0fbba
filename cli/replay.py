"""A film of one recorded trial of any study, drawn again from the recording alone.

What was shown is rebuilt frame by frame from the recorded scenes, so it does not matter what was
drawn in the session. From the participant's eyes a ring marks where gaze was measured; outside
views show the head as a point.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from cli.commands.preview import film_renderer
from cli.preview.pictures import SIMULATED, Viewpoint, camera_of, labelled
from cli.recorded_trial import RecordedTrial, factors_of, recorded_trial
from lab.clock import NS_PER_S
from lab.errors import UsageError
from lab.geometry import Vector, quat_conjugate, rotate
from recording.reader import Recording
from stimuli.dressing.picture_of import picture_of
from stimuli.picture import Camera
from visavis.catalogue import AnyStudy

RING_PX: Final = 16
RING: Final = (255, 190, 40)
DARK_PX: Final = (16, 16, 18)


def write_film(
    study: AnyStudy,
    recording: Recording,
    trial_id: str,
    video: Path,
    *,
    view: Viewpoint = Viewpoint.EYES,
    size_px: tuple[int, int] = (1280, 720),
    rate_hz: int = 25,
    seconds: float | None = None,
    on_frame: Callable[[int, int], None] | None = None,
) -> int:
    """Write the film of a trial and return its number of pictures.

    Raises:
        UsageError: the session has no such trial, or no rate of a film.
        StageError: the film cannot be written, or nothing draws here.
    """
    from stage.movie import open_movie

    if not 1 <= rate_hz <= 240:
        raise UsageError(f"--rate {rate_hz}; give 1 to 240 pictures a second")
    trial = recorded_trial(recording, trial_id)
    start_ns, end_ns = trial.span_ns
    if seconds is not None:
        end_ns = min(end_ns, start_ns + round(seconds * NS_PER_S))
    times = list(range(start_ns, end_ns + 1, NS_PER_S // rate_hz))
    factors = ", ".join(str(trial.row[name]) for name in factors_of(recording, trial_id))
    label = f"{recording.manifest.study} {recording.manifest.participant} {trial_id}  {factors}"
    label = f"{SIMULATED}  ·  {label}" if recording.is_simulated else label
    with film_renderer() as renderer, open_movie(video, size_px, rate_hz) as film:
        for k, image in enumerate(_pictures(study, trial, times, view, size_px, renderer.image)):
            passed_s = (times[k] - start_ns) / NS_PER_S
            film.add(np.asarray(labelled(image, f"{label}  {passed_s:.1f} s")))
            if on_frame is not None:
                on_frame(k + 1, len(times))
    return len(times)


def _pictures(
    study: AnyStudy,
    trial: RecordedTrial,
    times: list[int],
    view: Viewpoint,
    size_px: tuple[int, int],
    image: Callable[..., npt.NDArray[np.uint8]],
) -> Iterator[npt.NDArray[np.uint8]]:
    aspect = size_px[0] / size_px[1]
    for t_ns in times:
        shown = trial.shown_at(t_ns)
        head = trial.head_at(t_ns)
        if shown.scene.brightness_01 <= 0:
            yield np.full((size_px[1], size_px[0], 3), DARK_PX, np.uint8)
            continue
        picture = picture_of(next(iter(study.views_of(shown))))
        passed_s = (t_ns - times[0]) / NS_PER_S
        camera = camera_of(view, picture, head, aspect, passed_s=passed_s)
        drawn = image(picture, camera, size_px)
        gaze = trial.gaze_at(t_ns)
        aim = None if gaze is None else head.position_m + 2.5 * gaze
        yield _ringed(drawn, camera, aim, size_px)


def _ringed(
    drawn: npt.NDArray[np.uint8], camera: Camera, aim_m: Vector | None, size_px: tuple[int, int]
) -> npt.NDArray[np.uint8]:
    """Mark where gaze fell; nothing where it was lost or lies outside."""
    if aim_m is None:
        return drawn
    own = rotate(quat_conjugate(camera.pose.orientation_wxyz), aim_m - camera.pose.position_m)
    if own[2] >= 0:
        return drawn
    x = (own[0] / -own[2] - camera.left) / (camera.right - camera.left) * size_px[0]
    y = (camera.top - own[1] / -own[2]) / (camera.top - camera.bottom) * size_px[1]
    marked = Image.fromarray(drawn)
    pen = ImageDraw.Draw(marked)
    for r, colour in ((RING_PX + 2, (30, 30, 30)), (RING_PX, RING)):
        pen.ellipse((x - r, y - r, x + r, y + r), outline=colour, width=3)
    return np.asarray(marked)

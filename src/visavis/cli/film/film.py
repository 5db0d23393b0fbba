"""A film of one recorded trial of any study, drawn again from the recording alone.

What was shown is rebuilt frame by frame from the recorded scenes, so it does not matter what was
drawn in the session. From outside the participant is there, too: as the body tracker saw them, or
standing under their head.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.cli.film.cameras import (
    CameraKind,
    Cuts,
    Decisions,
    FilmCamera,
    FollowCamera,
    RecordedCamera,
    TopologyCamera,
    ViewpointCamera,
    camera_for,
    films_by_topology,
    style_of,
)
from visavis.cli.film.on_page import write_page_film
from visavis.cli.film.renderer import session_drawing
from visavis.cli.film.stand_in import StandIn, posture_of
from visavis.cli.preview.pictures import SIMULATED, Viewpoint, add_label
from visavis.cli.recorded_trial import RecordedTrial, factors_of, recorded_trial
from visavis.cli.redraw import board_at
from visavis.cli.session_lanes import lanes_of
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy
from visavis.running.page.seen_trial import is_on_page
from visavis.stage.identity import IdentityBuffer
from visavis.stage.movie import open_movie, picture_times_ns
from visavis.stage.renderer import Renderer
from visavis.stimuli.camera.filming import capsules
from visavis.stimuli.camera.sheet import SEEN_FROM_01, FilmLog, Sheet
from visavis.stimuli.camera.shots import ShotSize
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.picture import Camera, Picture
from visavis.stimuli.surfaces import Surfaces
from visavis.stimuli.text_font import font_for
from visavis.study.parts import Posture

RING_PX: Final = 16
RING: Final = (255, 190, 40)
DARK_PX: Final = (16, 16, 18)
LOOK_EVERY_NS: Final = NS_PER_S // 4
LOOK_PX: Final = (256, 144)
"""How often, and in how large a picture, the participant is looked for."""
MAX_GAZE_M: Final = 50.0
"""Length of the drawn gaze where it ends on nothing: seen from outside, without a ring."""
COLOURS: Final = {"contact": (255, 107, 94), "vibration": (94, 200, 255)}


class Overlay(StrEnum):
    """What a film shows besides the scene."""

    GAZE = "gaze"
    CONTACTS = "contacts"
    CLOCK = "clock"


ALL_OVERLAYS: Final = tuple(Overlay)


@dataclass(frozen=True)
class FilmSettings:
    """How a trial is filmed; a film of a page has no camera, shots or cuts."""

    camera: CameraKind | Path = CameraKind.EYES
    """The camera, or a file of the decisions of one."""
    shot: ShotSize = ShotSize.LONG
    """How large people appear."""
    cuts: Cuts = Cuts.AUTO
    """When the camera that knows the place cuts."""
    seed: int = 0
    """Seed of what that camera leaves to chance."""
    overlays: Sequence[Overlay] = ALL_OVERLAYS
    size_px: tuple[int, int] = (1280, 720)
    rate_hz: int = 25
    """Pictures per second, 1 to 240."""
    seconds: float | None = None
    """Length of the film from the trial's begin; the whole trial if left out."""

    @property
    def aspect(self) -> float:
        """Width by height."""
        return self.size_px[0] / self.size_px[1]


@dataclass(frozen=True, eq=False)
class FilmResult:
    """A film as it was made: the number of pictures, the camera, its decisions if it takes any, and
    the film's objective sheet. For a page, which has no camera, all but `pictures` are None.
    """

    pictures: int
    camera: CameraKind | Path | None
    decisions: Decisions | None
    sheet: Sheet | None = None


def write_film(
    study: OpenedStudy,
    recording: Recording,
    trial_id: str,
    video: Path,
    settings: FilmSettings,
    *,
    on_frame: Callable[[int, int], None] | None = None,
) -> FilmResult:
    """Write the film of a trial; a trial on a page is filmed as the page was, without a camera.

    A question asked in the dark is seen from the participant's eyes, whatever the camera.

    Raises:
        UsageError: the session has no such trial, no rate of a film, no file of decisions, or no
            place in this room from where the camera could film.
        StageError: the film cannot be written, or nothing draws here.
    """
    rate_hz, camera = settings.rate_hz, settings.camera
    if not 1 <= rate_hz <= 240:
        raise UsageError(f"--rate {rate_hz}; give 1 to 240 pictures a second")
    if is_on_page(recording):
        shows_clock = Overlay.CLOCK in settings.overlays
        n = write_page_film(
            study,
            recording,
            trial_id,
            video,
            clock=shows_clock,
            size_px=settings.size_px,
            rate_hz=rate_hz,
            seconds=settings.seconds,
            on_frame=on_frame,
        )
        return FilmResult(n, None, None)
    trial = recorded_trial(recording, trial_id)
    start_ns, end_ns = trial.span_ns
    if settings.seconds is not None:
        end_ns = min(end_ns, start_ns + round(settings.seconds * NS_PER_S))
    times = picture_times_ns(start_ns, end_ns, rate_hz)
    factors = ", ".join(str(trial.row[name]) for name in factors_of(recording, trial_id))
    label = f"{recording.manifest.study} {recording.manifest.participant} {trial_id}  {factors}"
    label = f"{SIMULATED}  ·  {label}" if recording.is_simulated else label

    shown_at = pictures_of(study, trial)
    posture = study.study.procedure.posture
    # The camera that knows the place needs room to stand in every scene of the trial.
    if camera is CameraKind.AUTO:
        scenes = recording.events_named("scene", trial.part)["t_ns"]
        scene_starts_ns = [start_ns, *(int(t) for t in scenes if start_ns < t <= end_ns)]
        sits_or_stands = posture or posture_of(float(trial.head_at(start_ns).position_m[1]))
        camera = camera_for(
            sits_or_stands,
            has_places=films_by_topology(shown_at(t) for t in scene_starts_ns),
        )
        settings = replace(settings, camera=camera)
    looks = _camera(settings, start_ns, trial, shown_at)
    log = FilmLog(None if isinstance(camera, Path) or camera is CameraKind.EYES else settings.shot)
    scene = FilmedTrial(trial, shown_at, looks, settings.overlays, settings.size_px, log, posture)
    with ExitStack() as stack:
        drawing = stack.enter_context(session_drawing())
        scene.looks_from(drawing.renderer)
        pictures = scene.pictures(times, drawing.image)
        first = next(pictures)  # a camera that finds no place says so before there is a file
        film = stack.enter_context(open_movie(video, settings.size_px, rate_hz))
        for k, image in enumerate(chain((first,), pictures)):
            caption = f"{label}  {(times[k] - start_ns) / NS_PER_S:.1f} s"
            shown_caption = caption if Overlay.CLOCK in settings.overlays else label
            film.add(np.asarray(add_label(image, shown_caption)))
            if on_frame is not None:
                on_frame(k + 1, len(times))
    decisions = looks.decisions() if isinstance(looks, TopologyCamera) else None
    cut_ns = None if decisions is None else np.array([cut["t_ns"] for cut in decisions.cuts])
    return FilmResult(len(times), camera, decisions, log.sheet(cut_ns))


def pictures_of(study: OpenedStudy, trial: RecordedTrial) -> Callable[[int], Picture]:
    """Return what gives the picture of a trial at a time, with the board that asked then."""

    def shown_at(t_ns: int) -> Picture:
        picture = picture_of(next(iter(study.views_of(trial.shown_at(t_ns)))))
        board = board_at(trial.recording, study, trial.part, t_ns)
        return picture if board is None else replace(picture, panels=(*picture.panels, board))

    return shown_at


def _camera(
    settings: FilmSettings,
    start_ns: int,
    trial: RecordedTrial,
    shown_at: Callable[[int], Picture],
) -> FilmCamera:
    camera, aspect = settings.camera, settings.aspect
    if isinstance(camera, Path):
        return RecordedCamera(camera, aspect)
    if camera is CameraKind.TOPOLOGY:
        style = style_of(settings.shot, settings.cuts)
        return TopologyCamera(style, aspect, shown_at, trial.head_at, settings.seed)
    if camera is CameraKind.FOLLOW:
        return FollowCamera(aspect)
    return ViewpointCamera(Viewpoint(camera.value), aspect, start_ns)


class FilmedTrial:
    """One trial as pictures: what was shown, who stood there, and what is written over it."""

    def __init__(
        self,
        trial: RecordedTrial,
        shown_at: Callable[[int], Picture],
        looks: FilmCamera,
        overlays: Sequence[Overlay],
        size_px: tuple[int, int],
        log: FilmLog,
        posture: Posture | None = None,
    ) -> None:
        self._log = log
        self._identity: IdentityBuffer | None = None
        self._looked_ns = -LOOK_EVERY_NS
        self._trial, self._shown_at, self._looks = trial, shown_at, looks
        self._overlays, self._size_px = overlays, size_px
        self._surfaces = Surfaces()
        self._from_eyes = isinstance(looks, ViewpointCamera) and looks.view is Viewpoint.EYES
        self._eyes = ViewpointCamera(Viewpoint.EYES, size_px[0] / size_px[1], trial.span_ns[0])
        self._stand_in = None if self._from_eyes else StandIn(trial, posture)
        wants = Overlay.CONTACTS in overlays
        self._lanes = lanes_of(trial.recording, trial.part) if wants else []

    def looks_from(self, renderer: Renderer) -> None:
        """Look for the participant in identity images of this renderer."""
        self._identity = IdentityBuffer(renderer)

    def _note_camera(self, t_ns: int, picture: Picture, camera: Camera, head_m: Vector) -> None:
        """Note where the camera is and, now and then, whether it sees the participant."""
        self._log.add(t_ns, camera, head_m, picture.room, capsules(picture))
        if self._from_eyes or self._identity is None or t_ns < self._looked_ns + LOOK_EVERY_NS:
            return
        self._looked_ns = t_ns
        person_at_px = self._identity.views(picture, [camera], LOOK_PX, level=1).person
        share = float((person_at_px == len(picture.cast)).mean())  # the stand-in is the last person
        self._log.visibility.append((t_ns, share >= SEEN_FROM_01))

    def pictures(
        self, times: list[int], image: Callable[..., npt.NDArray[np.uint8]]
    ) -> Iterator[npt.NDArray[np.uint8]]:
        """Yield the film's pictures."""
        for t_ns in times:
            head = self._trial.head_at(t_ns)
            picture = self._shown_at(t_ns)
            if picture.brightness_01 <= 0:
                if picture.panels:
                    yield image(picture, self._eyes.at(t_ns, picture, head), self._size_px)
                else:
                    width, height = self._size_px
                    yield np.full((height, width, 3), DARK_PX, np.uint8)
                continue
            camera = self._looks.at(t_ns, picture, head)
            if self._stand_in is not None:
                picture = self._stand_in.in_picture(picture, t_ns, head)
            self._note_camera(t_ns, picture, camera, head.position_m)
            pixels = image(picture, camera, self._size_px)
            if Overlay.GAZE in self._overlays:
                pixels = self._with_gaze(pixels, camera, t_ns)
            yield _with_lanes(pixels, [lane for lane in self._lanes if lane.is_on(t_ns)])

    def _with_gaze(
        self, image: npt.NDArray[np.uint8], camera: Camera, t_ns: int
    ) -> npt.NDArray[np.uint8]:
        """Mark where gaze fell, from outside with its ray; nothing where it was lost."""
        ray = self._trial.gaze_at(t_ns)
        if ray is None:
            return image
        eyes_m, gaze = ray
        shown = self._shown_at(t_ns)  # without the body whose eyes these are
        met_m = self._surfaces.end_m(shown, eyes_m, gaze)
        aim = self._pixel_of(camera, eyes_m + min(met_m, MAX_GAZE_M) * gaze)
        if aim is None:
            return image
        canvas = Image.fromarray(image)
        pen = ImageDraw.Draw(canvas)
        begin = None if self._from_eyes else self._pixel_of(camera, eyes_m + 0.12 * gaze)
        if begin is not None:
            pen.line((*begin, *aim), fill=RING, width=max(2, self._size_px[1] // 300))
        if np.isinf(met_m) and not self._from_eyes:
            return np.asarray(canvas)
        radius = RING_PX * self._size_px[1] // 720 if self._from_eyes else 6
        for r, colour in ((radius + 2, (30, 30, 30)), (radius, RING)):
            pen.ellipse((aim[0] - r, aim[1] - r, aim[0] + r, aim[1] + r), outline=colour, width=3)
        return np.asarray(canvas)

    def _pixel_of(self, camera: Camera, place_m: Vector) -> tuple[float, float] | None:
        """Return the pixel that shows a place; None behind the camera."""
        own = rotate(quat_conjugate(camera.pose.orientation_wxyz), place_m - camera.pose.position_m)
        if own[2] >= -camera.near_m:
            return None
        width, height = self._size_px
        x = (own[0] / -own[2] - camera.left) / (camera.right - camera.left) * width
        y = (camera.top - own[1] / -own[2]) / (camera.top - camera.bottom) * height
        return float(x), float(y)


def _with_lanes(image: npt.NDArray[np.uint8], lanes: Sequence[Any]) -> npt.NDArray[np.uint8]:
    """Write what touches or vibrates into the upper left corner."""
    if not lanes:
        return image
    canvas = Image.fromarray(image)
    pen = ImageDraw.Draw(canvas, "RGBA")
    size_px = max(11, canvas.height // 40)
    for k, lane in enumerate(lanes):
        font = font_for(lane.name, size_px)
        y = 8 + k * (size_px + 8)
        _, _, right, bottom = pen.textbbox((12, y), lane.name, font=font)
        pen.rectangle((6, y - 2, right + 6, bottom + 3), fill=(0, 0, 0, 140))
        pen.text((12, y), lane.name, fill=COLOURS[lane.kind], font=font)
    return np.asarray(canvas)

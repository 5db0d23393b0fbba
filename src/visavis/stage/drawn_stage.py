"""Show a study's scenes as pictures: in a headset, in a window, or off-screen."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import LabError
from visavis.lab.frame import EyeView, FrameInfo
from visavis.lab.geometry import Pose, Vector, quat_multiply, rotate
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.stage import frame_truth
from visavis.stage.card.small_picture import SmallPicture
from visavis.stage.card.targets import EyeTarget
from visavis.stage.card.timer import CardTimer
from visavis.stage.contracts import Glance, Viewer
from visavis.stage.errors import StageError
from visavis.stage.fades import Fades, FadeTimes, fading_out, with_brightness
from visavis.stage.mirror import Mirror, gaze_on_eye
from visavis.stage.own_body import OwnBody
from visavis.stage.renderer import Image, Renderer
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.panels import PanelFrame
from visavis.stimuli.picture import Camera, Picture, PosedPeople, Room
from visavis.stimuli.scene import Scene, SceneFrame

if TYPE_CHECKING:
    from visavis.stage.window import Window

Dresser = Callable[[SceneFrame], Picture]
RETRY_NS = NS_PER_S
GLANCE_PERIOD_NS = 500 * NS_PER_MS
HALF_EYE_DISTANCE_M = 0.0315
DEFAULT_TANGENT = 1.0
NOWHERE = Room("nowhere", (), (), np.zeros(3), np.zeros(3))
NOBODY = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))


def default_views(aspect: float = 0.9) -> tuple[EyeView, EyeView]:
    """Return two eyes 63 mm apart that see 90° up and down."""
    wide = DEFAULT_TANGENT * aspect
    return (
        EyeView((-HALF_EYE_DISTANCE_M, 0, 0), (1, 0, 0, 0), -wide, wide, -1.0, 1.0),
        EyeView((HALF_EYE_DISTANCE_M, 0, 0), (1, 0, 0, 0), -wide, wide, -1.0, 1.0),
    )


def eye_camera(head: Pose, eye: EyeView) -> Camera:
    """Return the camera of one eye of a head."""
    offset = np.asarray(eye.offset_m, np.float64)
    turn = np.asarray(eye.orientation_wxyz, np.float64)
    place: Vector = head.position_m + rotate(head.orientation_wxyz, offset)
    pose = Pose(place, quat_multiply(head.orientation_wxyz, turn))
    return Camera(pose, eye.tangent_left, eye.tangent_right, eye.tangent_bottom, eye.tangent_top)


def as_drawn(view: SceneFrame, t_ns: int) -> SceneFrame:
    """Return a scene as it is drawn for a moment: with the gaze as exact as it is recorded."""
    gaze = view.gaze_direction.astype(np.float32).astype(np.float64)
    openness = view.eye_openness_01.astype(np.float32).astype(np.float64)
    distance_m = view.gaze_distance_m
    if distance_m is not None:
        distance_m = distance_m.astype(np.float32).astype(np.float64)
    return replace(
        view, t_ns=t_ns, gaze_direction=gaze, eye_openness_01=openness, gaze_distance_m=distance_m
    )


@dataclass(frozen=True, eq=False)
class Display:
    """What is drawn for: how each eye looks and how many pixels it has (both asked at the first
    frame, when the headset is open), and at most how many people a picture holds. `hands_over`
    says whether the images go on to the headset. With `views_from` the eyes look another way from
    every place of the head, as through a screen: it is asked in every frame. `late_head`
    tells once more where the head will be, just before the picture is drawn from there.
    """

    views: Callable[[], Sequence[EyeView]]
    size_px: Callable[[], tuple[int, int]]
    people_count: int
    rate_hz: float = 90.0
    hands_over: bool = True
    views_from: Callable[[Pose], Sequence[EyeView]] | None = None
    late_head: Callable[[], Pose | None] | None = None


class DrawnStage:
    """A `Stage` that draws and logs every frame and informs the viewers.

    `open_renderer` is called in the thread that draws, at the first frame, and again a second
    after the graphics driver has failed: nothing but pictures is lost then. `mirror` shows the
    operator the left eye; `window` is the participant's own, which is closed with the stage.
    """

    def __init__(
        self,
        dresser: Dresser,
        open_renderer: Callable[[], Renderer],
        display: Display,
        clock: Clock,
        *,
        viewers: Sequence[Viewer] = (),
        mirror: Mirror | None = None,
        window: "Window | None" = None,
        asks: bool = False,
        own_body: OwnBody | None = None,
        fades: FadeTimes | None = None,
    ) -> None:
        self._dresser = dresser
        self._open_renderer = open_renderer
        self._display = display
        self._clock = clock
        self._viewers = tuple(viewers)
        self._mirror = mirror
        self._window = window
        self.asks = asks
        self._own_body = own_body
        self._fades = Fades(FadeTimes() if fades is None else fades)
        self._renderer: Renderer | None = None
        self._targets: list[EyeTarget] = []
        self._views: Sequence[EyeView] = ()
        self._schema = frame_truth.drawn_schema(display.people_count, display.rate_hz)
        self._sink: Callable[[SampleBatch], None] | None = None
        self._seq = self._views_seq = self._gpu_seq = 0
        self._timer: CardTimer | None = None
        self._retry_ns = 0
        self._trouble: StageError | None = None
        self._dressing_thread = ThreadPoolExecutor(1, "dress")
        self._coming: Future[Picture | None] | None = None
        self._pieces: Iterator[None] | None = None
        self._is_calm = True
        self._small: SmallPicture | None = None
        self._drawn_from: Pose | None = None
        self._glanced_from: Camera | None = None
        self._next_glance_ns = 0

    @property
    def schemas(self) -> tuple[StreamSchema, ...]:
        """The streams of drawn frames, of how they are drawn, and of what they cost the card.

        There is no such stream on the virtual clock, because a card's time does not repeat with the
        seed.
        """
        gpu_schemas = () if self._clock.is_virtual else (frame_truth.DRAWN_GPU,)
        return (self._schema, frame_truth.DRAWN_VIEWS, *gpu_schemas)

    def start(self, sink: Callable[[SampleBatch], None]) -> None:
        """Log what is drawn from now on."""
        self._sink = sink

    def trouble(self) -> StageError | None:
        """Return the problem that prevents drawing; None when there is none."""
        return self._trouble

    @property
    def is_preparing(self) -> bool:
        """Whether what was foreseen is being made ready: not while people are seen."""
        is_left = self._coming is not None or self._pieces is not None
        return is_left and self._is_calm and self._trouble is None

    def foresee(self, coming: Callable[[], SceneFrame | None]) -> None:
        """Dress what comes beside the frames; it is sent to the card while nobody can be seen, a
        piece a frame.
        """

        def dress_coming() -> Picture | None:
            view = coming()
            return None if view is None else self._picture(view)

        if self._coming is not None:
            self._coming.cancel()
        self._pieces, self._coming = None, self._dressing_thread.submit(dress_coming)

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[moderngl.Texture]:
        """Draw both eyes and return their textures, left first; none while the driver fails.

        People are drawn as they stand when the frame's light leaves, however long ago a plan
        showed them. The head's prediction is requested once more at the end, when only the view
        depends on it; or earlier, when other work depends on it, too: a body below the head, or a
        processor that leaves out invisible parts.
        """
        for viewer in self._viewers:
            viewer.see(view, frame.predicted_display_ns)
        now_ns = self._clock.now_ns()
        if self._trouble is not None and now_ns < self._retry_ns:
            return ()
        view = as_drawn(view, frame.predicted_display_ns)
        picture = self._fades.apply(self._picture(view))
        self._is_calm = picture.brightness_01 <= 0.0 or not picture.cast
        late: Callable[[], Sequence[Camera]] | None = None
        try:
            renderer = self._ready()
            if self._own_body is not None or renderer.quality.fast:
                head = self._late_head(head)
            elif self._display.late_head is not None:

                def late() -> Sequence[Camera]:
                    nonlocal head
                    head = self._late_head(head)
                    return [eye_camera(head, eye) for eye in self._views]

            if self._own_body is not None:
                picture = self._own_body.add_to(picture, head)
            self._look_from(head, renderer)
            cameras = [eye_camera(head, eye) for eye in self._views]
            with nullcontext() if self._timer is None else self._timer.time_frame(frame):
                result = renderer.draw(picture, cameras, self._targets, late=late)
            self._drawn_from = head
            if self._is_calm:
                self._make_ready(renderer, cameras)
        except StageError as problem:
            self._fail(problem, now_ns)
            self._log(view, frame, head, picture, np.zeros(0, np.int64), is_failed=True)
            return ()
        self._trouble = None
        self._log(view, frame, head, picture, result.level)
        if not self._display.hands_over:
            return ()
        return [target.texture for target in self._targets]

    def handed_over(self) -> None:
        """Show the operator the left eye, now that the headset has its images."""
        if self._mirror is None or self._renderer is None or self._trouble is not None:
            return
        try:
            self._mirror.show(self._renderer.context, self._targets[0].texture)
        except StageError as problem:
            self._fail(problem, self._clock.now_ns())

    def glance(self) -> Glance | None:
        """Return a small copy of the left eye's picture, taken at the last call."""
        if self._small is None or self._drawn_from is None or self._trouble is not None:
            return None
        now_ns = self._clock.now_ns()
        if self._glanced_from is not None:
            camera, self._glanced_from = self._glanced_from, None
            return Glance(self._small.take(), camera)
        if now_ns >= self._next_glance_ns:
            self._next_glance_ns = now_ns + GLANCE_PERIOD_NS
            self._glanced_from = eye_camera(self._drawn_from, self._views[0])
            self._small.ask(self._targets[0].texture)
        return None

    def redraw(
        self,
        views: Iterable[SceneFrame],
        row: np.void,
        lit: Iterable[SceneFrame] = (),
        bodies: Sequence[OwnBody] = (),
    ) -> list[Image]:
        """Draw a recorded frame again from its row and the first of `views` whose checksum is the
        row's; return the images, left first.

        `lit` are what may have been shown last before darkness, at their own moments: their light
        may still be going. `bodies` are what participants may have seen as their own.

        Raises:
            StageError: no view is the one that was drawn, or the driver fails.
        """
        head, levels = frame_truth.read_row(row)
        pictures = (
            picture
            for bare in self._pictures(views, row, lit)
            for picture in (bare, *(body.add_to(bare, head) for body in bodies))
        )
        same = (p for p in pictures if frame_truth.picture_crc32(p) == int(row["picture_crc32"]))
        picture = next(same, None)
        if picture is None:
            raise StageError(
                f"frame {int(row['frame'])} was drawn from another picture than this scene gives",
                remedy="draw it with the version, cast and configuration of its recording",
            )
        renderer = self._ready()
        cameras = [eye_camera(head, eye) for eye in self._views]
        renderer.draw(picture, cameras, self._targets, levels=levels)
        return self.images()

    def images(self) -> list[Image]:
        """Return what the eyes were shown last, left first, (height, width, 3) sRGB bytes."""
        return [target.read() for target in self._targets]

    def watch(self, role: str, batch: SampleBatch) -> None:
        """Receive the participant's gaze for the mirror and body for the avatar."""
        if role == "body_tracker" and self._own_body is not None:
            self._own_body.take(batch)
        if role == "eye_tracker" and self._mirror is not None and self._views:
            self._mirror.gaze_01 = gaze_on_eye(batch.values[-1], self._views[0])

    def close(self) -> None:
        """Release textures, renderer and mirror; idempotent."""
        self._dressing_thread.shutdown(cancel_futures=True)
        self._drop()
        for display in (self._mirror, self._window):
            if display is not None:
                display.close()

    # ---- private --------------------------------------------------------------------------

    def _make_ready(self, renderer: Renderer, cameras: Sequence[Camera]) -> None:
        """Send the next piece of what comes to the card."""
        if self._coming is not None and self._coming.done():
            coming, self._coming = self._coming, None
            try:
                picture = coming.result()
            except LabError:
                return  # the trial itself will report the error
            if picture is not None:
                width_px = self._targets[0].size_px[0]
                self._pieces = renderer.prepare(picture, cameras, width_px)
        if self._pieces is not None and next(self._pieces, self) is self:
            self._pieces = None

    def _pictures(
        self, views: Iterable[SceneFrame], row: np.void, lit: Iterable[SceneFrame]
    ) -> Iterator[Picture]:
        """Yield the pictures that a recorded frame may have shown: each view, with and without
        fades.
        """
        recorded_01 = float(row["brightness_01"])
        darkness = []
        for view in views:
            picture = self._picture(as_drawn(view, int(row["t_scene_ns"])))
            yield picture
            if 0.0 < recorded_01 < picture.brightness_01:
                yield with_brightness(picture, recorded_01)
            if picture.brightness_01 <= 0.0:
                darkness.append(picture)
        for view in lit:
            before = self._picture(as_drawn(view, view.t_ns))
            yield from (fading_out(before, dark, recorded_01) for dark in darkness)

    def _picture(self, view: SceneFrame) -> Picture:
        picture = self._dress(view)
        panels = view.panels if isinstance(view, PanelFrame) else ()
        return replace(picture, panels=(*picture.panels, *panels)) if panels else picture

    def _dress(self, view: SceneFrame) -> Picture:
        """Dress a scene; a dark or empty one needs no dressing."""
        scene = view.scene
        is_empty = type(scene) is Scene and not scene.agents and scene.room is None
        if not is_empty and scene.brightness_01 > 0.0:
            return self._dresser(view)
        return Picture(
            view.t_ns,
            NOWHERE,
            (),
            NOBODY,
            brightness_01=scene.brightness_01,
            mark_m=scene.mark_m,
        )

    def _ready(self) -> Renderer:
        if self._renderer is None:
            self._views = tuple(self._display.views())
            size_px = self._display.size_px()
            try:
                self._renderer = self._open_renderer()
                quality, context = self._renderer.quality, self._renderer.context
                self._targets = [
                    EyeTarget(context, size_px, quality.samples, eye) for eye in self._views
                ]
                self._small = SmallPicture(context, size_px)
                if self._sink is not None and not self._clock.is_virtual:
                    self._timer = CardTimer(context)
            except moderngl.Error as problem:
                raise StageError(
                    f"the graphics driver cannot begin to draw: {problem}",
                    remedy="close other graphics programs and resume the session",
                ) from problem
            self._tell_views(self._renderer)
        return self._renderer

    def _late_head(self, head: Pose) -> Pose:
        """Return the head's newest prediction; `head` when there is none."""
        if self._display.late_head is None:
            return head
        return self._display.late_head() or head

    def _look_from(self, head: Pose, renderer: Renderer) -> None:
        """Let the eyes look as they do from where the head is, where that makes a difference."""
        if self._display.views_from is None:
            return
        views = tuple(self._display.views_from(head))
        if views != self._views:
            self._views = views
            self._tell_views(renderer)

    def _tell_views(self, renderer: Renderer) -> None:
        if self._sink is not None:
            target, now_ns = self._targets[0], self._clock.now_ns()
            # A card may have fewer samples than are asked for.
            quality = replace(renderer.quality, samples=target.samples)
            self._sink(
                frame_truth.views_row(self._views_seq, self._views, target.size_px, quality, now_ns)
            )
            self._views_seq += 1

    def _fail(self, problem: StageError, now_ns: int) -> None:
        self._trouble = problem
        self._retry_ns = now_ns + RETRY_NS
        try:
            self._drop()
        except moderngl.Error as second:
            # The context is lost with everything in it; only the first failure matters.
            problem.add_note(str(second))
            self._renderer, self._timer, self._targets = None, None, []
            self._small = self._drawn_from = self._glanced_from = None

    def _drop(self) -> None:
        for target in self._targets:
            target.release()
        self._targets, self._pieces = [], None
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.release()
        if self._small is not None:
            self._small.release()
            self._small = self._drawn_from = self._glanced_from = None
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _log(
        self,
        view: SceneFrame,
        frame: FrameInfo,
        head: Pose,
        picture: Picture,
        level: npt.NDArray[np.int64],
        *,
        is_failed: bool = False,
    ) -> None:
        if self._sink is None:
            return
        row = frame_truth.DrawnFrame(
            frame,
            head,
            level,
            frame_truth.picture_crc32(picture),
            picture.brightness_01,
            view.t_ns,
            self._clock.now_ns(),
        )
        self._sink(frame_truth.truth_row(self._schema, self._seq, row, is_failed=is_failed))
        self._seq += 1
        gpu_times = [] if self._timer is None else self._timer.results()
        if gpu_times:
            self._sink(frame_truth.gpu_rows(self._gpu_seq, gpu_times, self._clock.now_ns()))
            self._gpu_seq += len(gpu_times)

"""A stage that draws: what it hands over, what it logs, what it does when the driver fails."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt
import pytest

from tests.stage import figures
from tests.stage.gl_counts import counted
from tests.stage.test_own_body import SEGMENTS, sample
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import DesignError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.lab.schema import SampleBatch
from visavis.stage.card.small_picture import PROCESSOR_WIDTH_PX, WIDTH_PX
from visavis.stage.drawn_stage import (
    GLANCE_PERIOD_NS,
    Display,
    DrawnStage,
    as_drawn,
    default_views,
    eye_camera,
)
from visavis.stage.errors import StageError
from visavis.stage.frame_truth import picture_crc32, read_views
from visavis.stage.own_body import OwnBody
from visavis.stage.renderer import ON_PROCESSOR, Quality, Renderer
from visavis.stage.stills import shrink
from visavis.stimuli.dressing.picture_of import NOBODY, NOWHERE
from visavis.stimuli.picture import Camera, Picture, Sheet
from visavis.stimuli.scene import Agent, Scene, SceneFrame

SIZE = (60, 72)
AHEAD = Pose(np.array([0.0, 1.5, -2.0]), np.array([1.0, 0.0, 0.0, 0.0]))
HEAD = Pose(np.array([0.05, 1.55, 0.4]), quat_from_yaw_pitch_deg(4.0, -3.0))


class _Watcher:
    def __init__(self) -> None:
        self.seen: list[int] = []

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        self.seen.append(t_display_ns)


def _scene(eyes_01: float = 1.0) -> SceneFrame:
    agent = Agent("a", "a", "", np.zeros(3), 0.1, np.array([0, 0, 1.0]), np.zeros(3))
    return SceneFrame(Scene("people", (agent,)), 0, np.zeros((1, 3)), np.full(1, eyes_01))


def _dressed(view: SceneFrame) -> Picture:
    """People who drift to the right as time goes by, and up as they close their eyes."""
    picture = figures.picture(3)
    right, up = 0.1 * view.t_ns / NS_PER_S, 1.0 - view.eye_openness_01[0]
    root_m = picture.people.root_m + np.array([right, up, 0])
    return replace(picture, t_ns=view.t_ns, people=replace(picture.people, root_m=root_m))


def _renderer() -> Renderer:
    try:
        return Renderer()
    except StageError as problem:
        pytest.skip(str(problem))


def _stage(
    rows: list[SampleBatch], watcher: _Watcher, clock: SimClock, size_px: tuple[int, int] = SIZE
) -> DrawnStage:
    display = Display(default_views, lambda: size_px, people_count=4)
    stage = DrawnStage(_dressed, _renderer, display, clock, viewers=[watcher])
    stage.start(lambda batch: rows.append(batch) if batch.schema.name == "drawn" else None)
    return stage


def test_a_picture_has_the_checksum_that_earlier_recordings_have_of_it() -> None:
    sheet = Sheet(np.full((2, 3, 4), 7, np.uint8), AHEAD, (0.5, 0.25))
    empty = Picture(0, NOWHERE, (), NOBODY)
    assert 3_369_932_798 == picture_crc32(empty)
    assert 2_511_435_407 == picture_crc32(replace(empty, sheets=(sheet,)))


def test_frame_is_logged_shown_and_handed_over() -> None:
    rows: list[SampleBatch] = []
    watcher, clock = _Watcher(), SimClock()
    stage = _stage(rows, watcher, clock)
    textures = stage.draw(_scene(), FrameInfo(5, 100, 900, dropped=2), HEAD)
    left, right = stage.images()
    stage.close()
    assert [t.size for t in textures] == [SIZE, SIZE]
    assert (left != right).any()
    assert watcher.seen == [900]
    (batch,) = rows
    row = batch.values[0]
    assert (row["frame"], row["predicted_display_ns"], row["skipped"]) == (5, 900, 2)
    assert row["head_position_m"].tolist() == HEAD.position_m.tolist()
    assert row["level"].tolist() == [2, 2, 2, -2]  # faces of fewer than nine pixels
    assert row["drawn"]


def test_redrawn_frame_equals_the_original() -> None:
    rows: list[SampleBatch] = []
    clock = SimClock()
    stage = _stage(rows, _Watcher(), clock)
    originals = []
    for i in range(3):
        view = _scene()
        stage.draw(view, FrameInfo(i, i, i * NS_PER_S), HEAD)
        originals.append((view, stage.images()))
    stage.close()
    again = _stage([], _Watcher(), clock)
    for (view, images), batch in reversed(list(zip(originals, rows, strict=True))):
        redrawn = again.redraw([view], batch.values[0])
        for before, after in zip(images, redrawn, strict=True):
            assert np.abs(before.astype(int) - after.astype(int)).max() <= 1
    again.close()


def test_redraw_refuses_another_scene() -> None:
    rows: list[SampleBatch] = []
    stage = _stage(rows, _Watcher(), SimClock())
    stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD)
    with pytest.raises(StageError, match="another picture"):
        stage.redraw([_scene(eyes_01=0.5)], rows[0].values[0])
    stage.close()


def test_people_move_with_the_display_though_the_scene_was_shown_once() -> None:
    rows: list[SampleBatch] = []
    stage = _stage(rows, _Watcher(), SimClock())
    view, images = _scene(), []
    for i in range(2):
        stage.draw(view, FrameInfo(i, i, i * NS_PER_S), HEAD)
        images.append(stage.images()[0])
    stage.close()
    assert (images[0] != images[1]).any()
    assert [0, NS_PER_S] == [int(batch.values[0]["t_scene_ns"]) for batch in rows]


def test_gaze_is_drawn_as_exactly_as_it_is_recorded() -> None:
    view = replace(_scene(), gaze_direction=np.array([[0.1, 0.2, -0.97467943]]))
    assert (
        as_drawn(view, 7).gaze_direction.tolist() == np.float32([[0.1, 0.2, -0.97467943]]).tolist()
    )


def test_lost_driver_shows_nothing_and_comes_back() -> None:
    rows: list[SampleBatch] = []
    watcher, clock = _Watcher(), SimClock()
    working = [_renderer()]

    def reopened() -> Renderer:
        if not working:
            raise StageError("nothing here can draw", remedy="restart")
        return working.pop()

    display = Display(default_views, lambda: SIZE, people_count=3)
    stage = DrawnStage(_dressed, reopened, display, clock, viewers=[watcher])
    stage.start(lambda batch: rows.append(batch) if batch.schema.name == "drawn" else None)
    assert len(stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD)) == 2
    stage._renderer.draw = _failing
    assert stage.draw(_scene(), FrameInfo(1, 0, 0), HEAD) == ()
    assert "refused" in str(stage.trouble())
    assert stage.draw(_scene(), FrameInfo(2, 0, 0), HEAD) == ()
    clock.sleep_until_ns(clock.now_ns() + 2 * NS_PER_S)
    working.append(_renderer())
    assert len(stage.draw(_scene(), FrameInfo(3, 0, 0), HEAD)) == 2
    assert stage.trouble() is None
    assert len(watcher.seen) == 4
    assert [bool(b.values[0]["drawn"]) for b in rows] == [True, False, True]
    stage.close()


def test_driver_that_cannot_even_begin_pauses_the_session() -> None:
    def refused() -> Renderer:
        raise moderngl.Error("cannot create buffer")

    display = Display(default_views, lambda: SIZE, people_count=3)
    stage = DrawnStage(_dressed, refused, display, SimClock())
    assert stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD) == ()
    assert "cannot begin to draw: cannot create buffer" in str(stage.trouble())


def _failing(*_: object, **__: object) -> None:
    raise StageError("the graphics driver refused to draw", remedy="resume")


class _Mirror:
    def __init__(self, problem: StageError | None = None) -> None:
        self.shown: list[moderngl.Texture] = []
        self._problem = problem

    def show(self, _: moderngl.Context, texture: moderngl.Texture) -> None:
        self.shown.append(texture)
        if self._problem is not None:
            raise self._problem

    def close(self) -> None:
        pass


def test_operator_s_picture_waits_until_the_images_are_handed_over() -> None:
    mirror = _Mirror()
    display = Display(default_views, lambda: SIZE, people_count=4)
    stage = DrawnStage(_dressed, _renderer, display, SimClock(), mirror=mirror)
    left, _ = stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD)
    assert mirror.shown == []
    stage.handed_over()
    assert mirror.shown == [left]
    stage.close()


def test_mirror_that_fails_is_trouble_of_the_display() -> None:
    mirror = _Mirror(StageError("the window is gone", remedy="resume"))
    display = Display(default_views, lambda: SIZE, people_count=4)
    stage = DrawnStage(_dressed, _renderer, display, SimClock(), mirror=mirror)
    stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD)
    stage.handed_over()
    assert "window is gone" in str(stage.trouble())
    stage.close()


def test_eyes_stand_either_side_of_the_head() -> None:
    left, right = (eye_camera(HEAD, eye) for eye in default_views())
    middle = (left.pose.position_m + right.pose.position_m) / 2
    assert middle == pytest.approx(HEAD.position_m)
    apart = right.pose.position_m - left.pose.position_m
    assert np.linalg.norm(apart) == pytest.approx(0.063)


def test_dark_scene_is_black_but_for_its_mark() -> None:
    stage = _stage([], _Watcher(), SimClock(), (480, 540))
    dark = Scene("dark", (), brightness_01=0.0, mark_m=np.array([0.0, 1.5, -1.0]))
    stage.draw(SceneFrame(dark, 0, np.zeros((0, 3)), np.zeros(0)), FrameInfo(0, 0, 0), HEAD)
    left, _ = stage.images()
    stage.close()
    assert 0 < (left.max(axis=2) > 0).mean() < 0.05


def test_own_body_is_drawn_once_it_is_tracked_and_logged_as_one_person_more() -> None:
    rows: list[SampleBatch] = []
    display = Display(default_views, lambda: SIZE, people_count=4)
    own_body = OwnBody(figures.picture(1).cast[0], SEGMENTS)
    stage = DrawnStage(_dressed, _renderer, display, SimClock(), own_body=own_body)
    stage.start(lambda batch: rows.append(batch) if batch.schema.name == "drawn" else None)
    for i in range(2):
        stage.draw(_scene(), FrameInfo(i, i, i), HEAD)
        stage.watch("body_tracker", sample())
    stage.close()
    assert [-2, False] == [
        int(rows[0].values[0]["level"][3]),
        int(rows[1].values[0]["level"][3]) == -2,
    ]


def test_how_pictures_are_made_is_logged_when_drawing_begins() -> None:
    views: list[SampleBatch] = []
    display = Display(default_views, lambda: SIZE, people_count=4)
    stage = DrawnStage(_dressed, _renderer, display, SimClock())
    stage.start(lambda batch: views.append(batch) if batch.schema.name == "drawn_views" else None)
    for i in range(2):
        stage.draw(_scene(), FrameInfo(i, i, i), HEAD)
    quality = stage._renderer.quality
    assert stage._targets[0].samples == quality.samples
    stage.close()
    (batch,) = views
    eyes, size_px, recorded = read_views(batch.values[0])
    assert default_views() == eyes
    assert size_px == SIZE
    assert replace(recorded, detail=quality.detail) == quality


NEAR_PX = 480, 540
"""So many that people are drawn finer than a small copy would ask for."""


def _foreseen(stage: DrawnStage, t_ns: int = 0) -> int:
    """Draw darkness until what is foreseen is ready; return how many frames that took."""
    dark = replace(_scene(), scene=replace(_scene().scene, brightness_01=0.0))
    frames = 0
    while stage.is_preparing:
        stage.draw(dark, FrameInfo(frames, t_ns + frames, t_ns + frames), HEAD)
        frames += 1
    return frames


@pytest.mark.parametrize("quality", [None, ON_PROCESSOR], ids=["card", "processor"])
def test_nothing_is_sent_to_the_card_with_the_first_lit_frame_of_a_scene_that_was_foreseen(
    quality: Quality | None,
) -> None:
    people = figures.picture(3)

    def dress(view: SceneFrame) -> Picture:
        return replace(people, t_ns=view.t_ns)

    def opened() -> Renderer:
        try:
            return Renderer(quality=quality)
        except StageError as problem:
            pytest.skip(str(problem))

    def count_sent(foreseen: bool) -> int:
        """Return how much the first lit frame makes."""
        display = Display(default_views, lambda: NEAR_PX, people_count=4)
        stage = DrawnStage(dress, opened, display, SimClock())
        stage.foresee(_scene if foreseen else lambda: None)
        frames = _foreseen(stage)
        with counted() as counts:
            stage.draw(_scene(), FrameInfo(frames, frames, frames), HEAD)
        stage.close()
        return counts["made"]

    assert 0 < count_sent(foreseen=False)
    assert 0 == count_sent(foreseen=True)


def test_a_scene_foreseen_is_made_ready_a_piece_a_frame_and_never_in_the_light() -> None:
    pieces: list[str] = []

    class Preparing(Renderer):
        def prepare(
            self, picture: Picture, cameras: Sequence[Camera], width_px: int
        ) -> Iterator[None]:
            for _ in super().prepare(picture, cameras, width_px):
                pieces.append("piece")
                yield

    def opened() -> Renderer:
        try:
            return Preparing()
        except StageError as problem:
            pytest.skip(str(problem))

    stage = DrawnStage(_dressed, opened, Display(default_views, lambda: SIZE, 4), SimClock())
    dark = replace(_scene(), scene=replace(_scene().scene, brightness_01=0.0))
    stage.draw(dark, FrameInfo(0, 0, 0), HEAD)
    stage.foresee(_scene)
    assert stage._coming is not None
    stage._coming.result()
    seen = []
    for i, view in enumerate((_scene(), dark, dark, dark, dark), start=1):
        stage.draw(view, FrameInfo(i, i, i), HEAD)
        seen.append((len(pieces), stage.is_preparing))
    stage.close()
    # While people are seen nothing is made ready, so nobody should wait for it.
    assert [(0, False), (1, True), (2, True), (3, True), (3, False)] == seen


def test_every_person_whom_the_processor_draws_is_a_piece_of_their_own() -> None:
    def count_pieces(people: int) -> int:
        picture = figures.picture(people)
        renderer = Renderer(quality=ON_PROCESSOR)
        cameras = [eye_camera(HEAD, eye) for eye in default_views()]
        pieces = sum(1 for _ in renderer.prepare(picture, cameras, NEAR_PX[0]))
        renderer.close()
        return pieces

    assert 2 == count_pieces(4) - count_pieces(2)


def test_what_cannot_be_foreseen_is_left_to_the_trial() -> None:
    def fails() -> SceneFrame:
        raise DesignError("no such scene")

    stage = DrawnStage(_dressed, _renderer, Display(default_views, lambda: SIZE, 4), SimClock())
    dark = replace(_scene(), scene=replace(_scene().scene, brightness_01=0.0))
    for coming in (fails, lambda: None):
        stage.foresee(coming)
        stage.draw(dark, FrameInfo(0, 0, 0), HEAD)
    assert stage.trouble() is None
    stage.close()


def test_samples_are_recorded_as_the_driver_gives_them() -> None:
    views: list[SampleBatch] = []
    display = Display(default_views, lambda: SIZE, people_count=4)
    most = _renderer().context.max_samples
    asked = Quality(samples=2 * most, shadows="none")
    stage = DrawnStage(_dressed, lambda: Renderer(quality=asked), display, SimClock())
    stage.start(lambda batch: views.append(batch) if batch.schema.name == "drawn_views" else None)
    stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD)
    stage.close()
    assert most == views[0].values[0]["samples"]


LATE = Pose(HEAD.position_m + np.array([0.02, 0.0, -0.03]), quat_from_yaw_pitch_deg(5.5, -2.0))


@pytest.mark.parametrize("quality", [None, ON_PROCESSOR], ids=["card", "processor"])
@pytest.mark.parametrize("bodied", [False, True])
def test_a_frame_is_drawn_from_and_logged_with_the_pose_that_was_foreseen_last(
    quality: Quality | None, bodied: bool
) -> None:
    rows: list[SampleBatch] = []

    def opened() -> Renderer:
        try:
            return Renderer(quality=quality)
        except StageError as problem:
            pytest.skip(str(problem))

    def images(head: Pose, late: Pose | None) -> tuple[DrawnStage, list[npt.NDArray[np.uint8]]]:
        own_body = OwnBody(figures.picture(1).cast[0], SEGMENTS) if bodied else None
        display = Display(default_views, lambda: SIZE, 4, late_head=lambda: late)
        stage = DrawnStage(_dressed, opened, display, SimClock(), own_body=own_body)
        stage.start(lambda batch: rows.append(batch) if batch.schema.name == "drawn" else None)
        if bodied:
            stage.watch("body_tracker", sample())
        stage.draw(_scene(), FrameInfo(0, 0, 0), head)
        return stage, stage.images()

    stage, late = images(HEAD, LATE)
    row = rows[0].values[0]
    bodies = [] if stage._own_body is None else [stage._own_body]
    again = stage.redraw([_scene()], row, bodies=bodies)
    stage.close()
    assert LATE.position_m.tolist() == row["head_position_m"].tolist()
    assert LATE.orientation_wxyz.tolist() == row["head_orientation_wxyz"].tolist()
    for head, foreseen, same in ((LATE, None, True), (HEAD, None, False)):
        stage, expected = images(head, foreseen)
        stage.close()
        assert [same] * 2 == [bool((a == b).all()) for a, b in zip(late, expected, strict=True)]
    assert all((a == b).all() for a, b in zip(late, again, strict=True))


def test_the_pose_is_asked_for_again_when_only_the_views_are_left_to_be_sent() -> None:
    order: list[str] = []

    class Watched(Renderer):
        def light(self, *arguments: Any, **options: Any) -> None:
            super().light(*arguments, **options)
            order.append("people and light")

        def look_from(self, *arguments: Any) -> None:
            super().look_from(*arguments)
            order.append("view")

    def opened() -> Renderer:
        try:
            return Watched()
        except StageError as problem:
            pytest.skip(str(problem))

    def late_head() -> None:
        order.append("pose")

    display = Display(default_views, lambda: SIZE, 4, late_head=late_head)
    stage = DrawnStage(_dressed, opened, display, SimClock())
    stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD)
    stage.close()
    assert ["people and light", "pose", "view", "view"] == order


def test_the_operator_is_given_the_left_eye_small_twice_a_second() -> None:
    clock, size = SimClock(), (4 * WIDTH_PX, 2 * WIDTH_PX)
    stage = _stage([], _Watcher(), clock, size)
    assert None is stage.glance()  # nothing is drawn yet
    stage.draw(_scene(), FrameInfo(0, 0, 0), HEAD)
    left = stage.images()[0]
    assert None is stage.glance()  # asked for
    later = replace(_scene(), scene=replace(_scene().scene, brightness_01=0.0))
    stage.draw(later, FrameInfo(1, 1, 1), HEAD)
    glance = stage.glance()
    assert glance is not None
    assert None is stage.glance()
    clock.sleep_until_ns(GLANCE_PERIOD_NS)
    assert [None, True] == [stage.glance(), stage.glance() is not None]
    stage.close()
    eye = eye_camera(HEAD, default_views()[0])
    assert eye.pose.position_m.tolist() == glance.camera.pose.position_m.tolist()
    height, width, _ = glance.image.shape
    assert width in (WIDTH_PX, PROCESSOR_WIDTH_PX)
    assert 2 * height == width
    small = shrink(left, (width, height)).astype(int)
    assert np.abs(small - glance.image).mean() < 1.0

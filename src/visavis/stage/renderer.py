"""Draw pictures: people, room, lamps and shadows, fade, mark and panels."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.lab.closing import Closing
from visavis.lab.geometry import Vector
from visavis.stage.card.context import GL_FRAMEBUFFER_SRGB, offscreen_context, release_offscreen
from visavis.stage.card.crowd_buffers import CrowdBuffers
from visavis.stage.card.lamps import (
    KIND_NUMBERS,
    LIGHTING_BYTES,
    ShadowView,
    lighting_block,
    shadow_views,
)
from visavis.stage.card.lit_programs import Family, LitPrograms
from visavis.stage.card.overlays import Overlays
from visavis.stage.card.shaders.lighting import MAX_SHADOWS, lamp_constants
from visavis.stage.card.targets import EyeTarget
from visavis.stage.card.vertices import Run
from visavis.stage.contacts import Contacts
from visavis.stage.errors import StageError
from visavis.stage.geometry.projection import projection, view, world_from
from visavis.stage.levels import BODY_RADIUS_M, DetailRule, choose_levels, faces_px, in_view
from visavis.stage.processor.crowd import PixelGrid, ProcessorCrowd
from visavis.stage.processor.vertex_light import lamp_rows
from visavis.stage.scene_buffers import Crowd, SceneBuffers
from visavis.stage.shadow_maps import ShadowMaps
from visavis.stimuli.picture import Camera, Picture, Room

FRAME_BYTES = 96
LIT_STEP_M = 0.5
UNSEEN_PX = 64, 64
MAX_OLD_ERRORS = 8
TEXTURED_PX_PER_M = 55.0
"""Below this size the fast quality omits textures, because vertices are denser than pixels."""
GL_SAMPLE_ALPHA_TO_COVERAGE = 0x809E

Shadows = Literal["maps", "area", "blobs", "none"]
Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Quality:
    """How much work a picture is worth.

    `samples` per pixel smooth edges (0: none). `shadows` are drawn as maps of `shadow_map_px`, as
    such of lamps with an `area`, whose edges are sharp only where things touch, as soft blobs under
    the feet, or not at all; but for the last, floors are darkened where soles stand. `fast`
    computes light at vertices, without highlights or maps; `detail` says how fine people are drawn
    where. Cloth is as sharp as in a picture `shrink_factor` times smaller, for pictures made so.
    """

    samples: int = 4
    shadows: Shadows = "maps"
    shadow_map_px: int = 1024
    shadow_softness_m: float = 0.03
    fast: bool = False
    detail: DetailRule = field(default_factory=DetailRule)
    shrink_factor: int = 1


LIGHTEST = Quality(samples=0, shadows="blobs", fast=True, detail=DetailRule(finest=2))
"""For computers without a graphics card: people at their lightest, soft blobs for shadows."""
ON_PROCESSOR = replace(LIGHTEST, detail=DetailRule(budget_triangles=100_000))
"""The same with faces fit to be looked at: the nearest at full detail, as many as are drawn in
time, the next in 6 thousand triangles.
"""


@dataclass(frozen=True, eq=False)
class Drawn:
    """Levels (n,) of everybody in the last picture, −1 where out of view, and their distances."""

    level: npt.NDArray[np.int64]
    distance_m: Vector


@dataclass(eq=False)
class _Backdrop:
    """A room as a camera sees it: drawn here at the second of its `looks`, then taken from here."""

    target: EyeTarget | None = None
    room: Room | None = None
    view_key: bytes = b""
    looks: int = 0


class Renderer(Closing):
    """Draw into textures or arrays; one per graphics context, in the thread of that context."""

    def __init__(
        self, context: moderngl.Context | None = None, *, quality: Quality | None = None
    ) -> None:
        self._owns_context = context is None
        self.context = offscreen_context() if context is None else context
        self.quality = Quality() if quality is None else quality
        self.last_choice = Drawn(np.zeros(0, np.int64), np.zeros(0))
        ctx = self.context
        self._buffers = SceneBuffers(ctx, fast=self.quality.fast)
        self._frame = ctx.buffer(reserve=FRAME_BYTES, dynamic=True)
        self._lighting = ctx.buffer(reserve=LIGHTING_BYTES, dynamic=True)
        # Cards encode what is drawn into several samples a pixel; what is fast writes codes.
        self._in_light = min(self.quality.samples, ctx.max_samples) > 0 and not self.quality.fast
        self._programs = LitPrograms(
            ctx,
            fast=self.quality.fast,
            shadows=self._with_maps(),
            area=self.quality.shadows == "area",
            in_light=self._in_light,
            shrink_factor=self.quality.shrink_factor,
        )
        self._targets: dict[tuple[int, int], EyeTarget] = {}
        self._backdrops: dict[tuple[int, int], _Backdrop] = {}
        self._lit_before: tuple[object, Room, tuple[ShadowView, ...], bytes] | None = None
        self._constants_of: tuple[Room, str] | None = None
        self._overlays = Overlays(ctx, in_light=self._in_light)
        self._contacts = Contacts(
            ctx,
            in_light=self._in_light,
            with_maps=self._with_maps(),
            is_separate=self.quality.fast,
        )
        self._shadow_maps = ShadowMaps(
            ctx, self.quality.shadow_map_px, area=self.quality.shadows == "area"
        )
        self._is_closed = False

    # ---- public ----------------------------------------------------------------------------

    def image(self, picture: Picture, camera: Camera, size_px: tuple[int, int]) -> Image:
        """Return the picture as (height, width, 3) sRGB bytes, top row first.

        Where the camera stands still its room is drawn once, not in every picture.
        """
        return self._draw_target(picture, camera, size_px).read()

    def codes(self, picture: Picture, camera: Camera, size_px: tuple[int, int]) -> Image:
        """Return the picture as `image` does, but as the card has it (`EyeTarget.codes`)."""
        return self._draw_target(picture, camera, size_px).codes()

    def draw(
        self,
        picture: Picture,
        cameras: Sequence[Camera],
        targets: Sequence[EyeTarget],
        *,
        levels: npt.NDArray[np.int64] | None = None,
        late: Callable[[], Sequence[Camera]] | None = None,
        as_wide_px: int | None = None,
    ) -> Drawn:
        """Draw the picture once per camera into the targets.

        `levels` (n,) repeats recorded levels of detail instead of choosing them. `late` is asked
        for the cameras once more when only they are left to be sent to the card. People are as
        fine and as textured as in pictures `as_wide_px`, where these are not the targets' own.

        Raises:
            StageError: the graphics driver failed; what was recorded is not touched.
        """
        # Headset runtimes, and targets released while bound, leave their own errors behind.
        for _ in range(MAX_OLD_ERRORS):
            if self.context.error == "GL_NO_ERROR":
                break
        try:
            choice = self._draw(picture, cameras, targets, levels, late, as_wide_px)
        except moderngl.Error as problem:
            raise StageError(
                f"the graphics driver refused to draw: {problem}",
                remedy="close other graphics programs and resume the session",
            ) from problem
        error = self.context.error
        if error != "GL_NO_ERROR":
            raise StageError(
                f"the graphics driver reported {error}",
                remedy="close other graphics programs, update the driver, and resume the session",
            )
        return choice

    def prepare(self, picture: Picture, cameras: Sequence[Camera], width_px: int) -> Iterator[None]:
        """Send what a picture is drawn from to the card, piece by piece, and draw it unseen once.

        People are as fine as in a picture of `width_px`. The choice of levels for the next picture
        is not affected.
        """
        crowd = self._buffers.crowd(picture.cast)
        yield
        self._buffers.room(picture.room)
        yield
        if picture.surround is not None:
            for eye in range(len(picture.surround.eyes)):
                self._overlays.send(picture.surround, eye)
            yield
        before = self.last_choice
        crowd.joints.pose(picture.people)
        level, _ = self._levels(crowd, cameras, _px_per_tangent(cameras, width_px))
        if isinstance(crowd, ProcessorCrowd):
            yield from crowd.build(level)
        target = self._target(UNSEEN_PX)
        self.draw(picture, cameras[:1], [target], levels=level, as_wide_px=width_px)
        self.last_choice = before
        yield

    def close(self) -> None:
        """Free everything; idempotent."""
        if self._is_closed:
            return
        self._is_closed = True
        backdrops = (backdrop.target for backdrop in self._backdrops.values())
        for target in (*self._targets.values(), *backdrops):
            if target is not None:
                target.release()
        self._buffers.release()
        self._shadow_maps.release()
        self._contacts.release()
        self._overlays.release()
        self._programs.release()
        self._frame.release()
        self._lighting.release()
        if self._owns_context:
            release_offscreen(self.context)

    # ---- one picture -----------------------------------------------------------------------

    def _draw(
        self,
        picture: Picture,
        cameras: Sequence[Camera],
        targets: Sequence[EyeTarget],
        levels: npt.NDArray[np.int64] | None,
        late: Callable[[], Sequence[Camera]] | None,
        as_wide_px: int | None,
    ) -> Drawn:
        ctx = self.context
        ctx.disable_direct(GL_FRAMEBUFFER_SRGB)
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.depth_func = "<"
        ctx.front_face = "ccw"
        dark = picture.brightness_01 <= 0.0
        crowd = None if dark else self._buffers.crowd(picture.cast)
        choice = Drawn(np.full(len(picture.cast), -1), np.full(len(picture.cast), np.nan))
        if crowd is not None:
            width_px = as_wide_px or max((t.size_px[0] for t in targets), default=1)
            px_per_tangent = _px_per_tangent(cameras, width_px)
            choice = self.pose(picture, crowd, cameras, levels, px_per_tangent)
            grid = None
            # A head asked for once more sees other pixels.
            if late is None and isinstance(crowd, ProcessorCrowd):
                grid = _grid(cameras, targets)
            self.light(picture, crowd, choice, cameras, width_px, grid)
        if late is not None:
            cameras = late()
        for eye, (camera, target) in enumerate(zip(cameras, targets, strict=True)):
            self.look_from(camera, picture.brightness_01, 0.15 if target.samples else 0.5)
            if crowd is not None and target.samples:
                ctx.enable_direct(GL_SAMPLE_ALPHA_TO_COVERAGE)
            backdrop = None if crowd is None else self._backdrop(picture, camera, target)
            if backdrop is None:
                self._begin(picture, target)
            else:
                self._begin_over(backdrop, picture, target)
            if crowd is not None:
                self.paint(picture, crowd, identity=False, with_room=backdrop is None)
                ctx.disable_direct(GL_SAMPLE_ALPHA_TO_COVERAGE)
                if self.quality.shadows != "none":
                    self._contacts.draw(crowd, picture.room, with_furniture=backdrop is None)
            self._overlays.draw(picture, camera, target, eye)
            target.finish()
        self.last_choice = choice
        return choice

    def pose(
        self,
        picture: Picture,
        crowd: Crowd,
        cameras: Sequence[Camera],
        levels: npt.NDArray[np.int64] | None = None,
        px_per_tangent: float = 1.0,
    ) -> Drawn:
        """Place everyone, choose who is drawn and how finely, and send it to the card.

        Pictures have `px_per_tangent` pixels a tangent of 1; `levels` (n,) are used as they are.
        """
        joints = crowd.joints
        joints.pose(picture.people)
        if not crowd.cast:
            return Drawn(np.zeros(0, np.int64), np.zeros(0))
        level, distance_m = self._levels(crowd, cameras, px_per_tangent)
        if levels is None:
            crowd.level_before = level
            is_in_view = in_view(joints.watched_m[:, 0], BODY_RADIUS_M, cameras)
        else:
            level, is_in_view = np.maximum(levels, 0), levels >= 0
        level = np.minimum(level, crowd.level_count - 1)
        crowd.upload()
        if isinstance(crowd, ProcessorCrowd):
            crowd.choose(level, is_in_view)
        else:
            # People out of view may still cast a shadow into it.
            crowd.choose(level, is_in_view, casts=self._casts(picture.room))
        return Drawn(np.where(is_in_view, level, -1), distance_m)

    def light(
        self,
        picture: Picture,
        crowd: Crowd,
        choice: Drawn,
        cameras: Sequence[Camera],
        width_px: int | None,
        grid: PixelGrid | None = None,
    ) -> None:
        """Send the lamps, move people into their poses, draw the shadow maps.

        `width_px` of the pictures says who can do without textures; None is for buffers, whose
        light is linear. Nothing is looked at but the pixels of a `grid`.
        """
        views, block = self._lit(picture, crowd)
        self._lighting.write(block)
        self._lighting.bind_to_uniform_block(1)
        self._frame.bind_to_uniform_block(0)
        if isinstance(crowd, ProcessorCrowd):
            textured_to_m = np.inf
            if width_px is not None:
                widest = min(c.right - c.left for c in cameras)
                textured_to_m = width_px / widest / TEXTURED_PX_PER_M
            crowd.skin(
                lamp_rows(picture.room),
                np.array([c.pose.position_m for c in cameras]),
                choice.distance_m,
                textured_to_m,
                encode=width_px is not None,
                grid=grid,
            )
            return
        if crowd.cast:
            crowd.skin(self._programs.skinning())
        self._shadow_maps.draw(picture, crowd, views, self._buffers, self._programs)

    def look_from(self, camera: Camera, brightness_01: float, alpha_threshold: float) -> None:
        """Send the camera."""
        matrix = projection(camera) @ view(camera.pose)
        block = np.zeros(24, np.float32)
        block[:16] = matrix.T.ravel()
        block[16:19] = camera.pose.position_m
        block[20:24] = (brightness_01, 1.0, alpha_threshold, max(brightness_01, 0.0) ** (1 / 2.2))
        self._frame.write(block)
        self._frame.bind_to_uniform_block(0)

    def paint(
        self, picture: Picture, crowd: Crowd, *, identity: bool, with_room: bool = True
    ) -> None:
        """Draw room, things and people from the camera sent, with the light sent."""
        self._shadow_maps.use()
        if isinstance(crowd, CrowdBuffers) and not identity:
            self._hide(picture, crowd, with_room=with_room)
        # People first: where depth was not drawn before they hide much of the room.
        if crowd.cast:
            family: Family = "lit_people" if self.quality.fast else "people"
            crowd.draw(self._program(family, picture.room, identity=identity))
        if with_room:
            self._paint_room(picture.room, identity=identity)
        for thing in picture.moving:
            self._buffers.thing(thing.prop).draw(
                self._program("room", picture.room, identity=identity), world_from(thing.pose)
            )
        self.context.depth_func = "<"

    def _hide(self, picture: Picture, crowd: CrowdBuffers, *, with_room: bool) -> None:
        """Draw depth before light, so that no pixel computes the light of what is hidden there."""
        target = self.context.fbo
        target.color_mask = False, False, False, False
        if crowd.cast:
            crowd.draw_depth(self._programs.depth("people"))
        if with_room:
            self._buffers.room(picture.room).draw_depth(self._programs.depth("room"))
        target.color_mask = True, True, True, True
        self.context.depth_func = "<="

    def crowd_of(self, picture: Picture) -> Crowd:
        """Return the cast's buffers."""
        return self._buffers.crowd(picture.cast)

    # ---- parts -----------------------------------------------------------------------------

    def _levels(
        self, crowd: Crowd, cameras: Sequence[Camera], px_per_tangent: float
    ) -> tuple[npt.NDArray[np.int64], Vector]:
        """Return how finely everybody posed is drawn, and how far they are from the nearest eye."""
        eyes = np.array([c.pose.position_m for c in cameras])
        offset = crowd.joints.watched_m[:, 1, None, :] - eyes[None]
        distance_m = np.sqrt((offset * offset).sum(axis=2)).min(axis=1)
        heights_px = faces_px(distance_m, px_per_tangent)
        level = choose_levels(heights_px, crowd.level_before, self.quality.detail, crowd.triangles)
        return level, distance_m

    def _program(
        self, family: Family, room: Room, *, identity: bool
    ) -> Callable[[Run], moderngl.Program]:
        light = self._light_constants(room)
        return lambda run: self._programs.lit(family, run, light, identity=identity)

    def _paint_room(self, room: Room, *, identity: bool) -> None:
        in_codes = self.quality.fast and not identity
        family: Family = "baked_room" if in_codes else "room"
        self._buffers.room(room).draw(self._program(family, room, identity=identity))

    def _with_maps(self) -> bool:
        return self.quality.shadows in ("maps", "area") and not self.quality.fast

    def _light_constants(self, room: Room) -> str:
        """Return the lamps of a room as the shaders are compiled for them."""
        if self._constants_of is not None and self._constants_of[0] is room:
            return self._constants_of[1]
        kinds, maps, n_maps = [], [], 0
        for lamp in room.lights:
            kinds.append(int(KIND_NUMBERS[lamp.kind]))
            casts = self._with_maps() and lamp.casts_shadow and n_maps < MAX_SHADOWS
            maps.append(n_maps if casts else -1)
            n_maps += casts
        self._constants_of = room, lamp_constants(kinds, maps)
        return self._constants_of[1]

    def _casts(self, room: Room) -> bool:
        return self._with_maps() and any(lamp.casts_shadow for lamp in room.lights)

    def _lit(self, picture: Picture, crowd: Crowd) -> tuple[tuple[ShadowView, ...], bytes]:
        """Return the views of shadow maps and the lamps as the shaders read them."""
        key: tuple[object, ...] = (id(picture.room),)
        with_maps = self._casts(picture.room)
        if with_maps:
            low, high = self._lit_box(picture, crowd)
            key = (*key, *low.tolist(), *high.tolist())
        if self._lit_before is None or self._lit_before[0] != key:
            views: tuple[ShadowView, ...] = ()
            if with_maps:
                views = shadow_views(
                    picture.room,
                    low,
                    high,
                    map_px=self.quality.shadow_map_px,
                    softness_m=self.quality.shadow_softness_m,
                )
            self._lit_before = key, picture.room, views, lighting_block(picture.room, views)
        return self._lit_before[2:]

    def _backdrop(self, picture: Picture, camera: Camera, target: EyeTarget) -> _Backdrop | None:
        """Return what may hold the room as the camera sent sees it.

        None: a target of somebody else's, or people who throw shadows into the room.
        """
        if self._targets.get(target.size_px) is not target or self._casts(picture.room):
            return None
        edges = camera.left, camera.right, camera.bottom, camera.top, camera.near_m, camera.far_m
        pose = camera.pose.position_m, camera.pose.orientation_wxyz
        view_key = np.concatenate([*pose, edges, [picture.brightness_01]]).tobytes()
        backdrop = self._backdrops.setdefault(target.size_px, _Backdrop())
        if backdrop.view_key != view_key or backdrop.room is not picture.room:
            backdrop.view_key, backdrop.room, backdrop.looks = view_key, picture.room, 0
        return backdrop

    def _begin(self, picture: Picture, target: EyeTarget) -> None:
        """Begin with the background, which is in codes."""
        target.begin(_background(picture))
        self._encode()

    def _encode(self) -> None:
        """Let the card encode what is drawn from now on, where light is drawn."""
        if self._in_light:
            self.context.enable_direct(GL_FRAMEBUFFER_SRGB)

    def _begin_over(self, backdrop: _Backdrop, picture: Picture, target: EyeTarget) -> None:
        """Draw the room first in every picture, so that coplanar surfaces do not flicker."""
        backdrop.looks += 1
        if backdrop.looks == 1:
            self._begin(picture, target)
            self._paint_backdrop(picture.room)
            return
        if backdrop.target is None:
            backdrop.target = EyeTarget(self.context, target.size_px, self.quality.samples)
        if backdrop.looks == 2:
            self._begin(picture, backdrop.target)
            self._paint_backdrop(picture.room)
        target.begin_over(backdrop.target)
        self._encode()

    def _paint_backdrop(self, room: Room) -> None:
        """Draw a room and the shades of its furniture, which stay as they are while it is seen."""
        self._paint_room(room, identity=False)
        if self.quality.shadows != "none":
            self._contacts.draw_furniture(room)

    def _lit_box(self, picture: Picture, crowd: Crowd) -> tuple[Vector, Vector]:
        """Return the box around everyone, within the room; shadows are finest where people are.

        It grows and shrinks in steps, so that shadows do not swim while people walk.
        """
        room = self._buffers.room(picture.room)
        if not crowd.cast:
            return room.low_m.astype(np.float64), room.high_m.astype(np.float64)
        hips = crowd.joints.watched_m[:, 0]
        low = LIT_STEP_M * np.floor((hips.min(axis=0) - 1.5) / LIT_STEP_M)
        high = LIT_STEP_M * np.ceil((hips.max(axis=0) + 1.5) / LIT_STEP_M)
        return np.maximum(low, room.low_m), np.minimum(high, room.high_m)

    def _draw_target(self, picture: Picture, camera: Camera, size_px: tuple[int, int]) -> EyeTarget:
        target = self._target(size_px)
        self.draw(picture, [camera], [target])
        return target

    def _target(self, size_px: tuple[int, int]) -> EyeTarget:
        if size_px not in self._targets:
            self._targets[size_px] = EyeTarget(self.context, size_px, self.quality.samples)
        return self._targets[size_px]


def _px_per_tangent(cameras: Sequence[Camera], width_px: int) -> float:
    """Return how many pixels of a picture so wide a tangent of 1 has at most."""
    return max((width_px / (c.right - c.left) for c in cameras), default=1.0)


def _grid(cameras: Sequence[Camera], targets: Sequence[EyeTarget]) -> PixelGrid:
    """Return the pixels that pictures have; samples lie between the middles of theirs."""
    has_samples = any(target.samples for target in targets)
    return PixelGrid.of(cameras, [target.size_px for target in targets], between=not has_samples)


def _background(picture: Picture) -> tuple[float, float, float]:
    share = max(0.0, min(1.0, picture.brightness_01))
    r, g, b = (share * channel / 255 for channel in picture.room.background_srgb)
    return r, g, b

"""Draw pictures: people, room, lamps and shadows, fade, mark and panels."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import moderngl
import numpy as np
import numpy.typing as npt

from lab.geometry import Vector
from stage.context import GL_FRAMEBUFFER_SRGB, offscreen_context
from stage.crowd_buffers import CharacterMeshes, CrowdBuffers
from stage.errors import StageError
from stage.glsl_lighting import MOST_SHADOWS, lamp_constants
from stage.lamps import KIND_NUMBERS, LIGHTING_BYTES, ShadowView, lighting_block, shadow_views
from stage.levels import BODY_RADIUS_M, DetailRule, choose_levels, in_view
from stage.lit_programs import LitPrograms
from stage.overlays import Overlays
from stage.programs import UNITS, set_bytes
from stage.projection import for_gl, projection, view, world_from
from stage.room_buffers import PropBuffers
from stage.targets import EyeTarget
from stage.textures import Textures
from stage.vertices import Run
from stimuli.characters.character import Character
from stimuli.picture import Camera, Picture, Prop, Room

FRAME_BYTES = 96
ROOMS_KEPT = 4
VERTEX_LIT_EDGE_M = 1.0
LIT_STEP_M = 0.5
CASTS_KEPT = 3
GL_SAMPLE_ALPHA_TO_COVERAGE = 0x809E

Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Quality:
    """How much work a picture is worth.

    `samples` per pixel smooth edges (0: none); `shadows` are drawn as maps of `shadow_map_px`,
    as soft blobs under the feet, or not at all; `fast` computes light at vertices, without
    highlights; `detail` says how fine people are drawn where.
    """

    samples: int = 4
    shadows: Literal["maps", "blobs", "none"] = "maps"
    shadow_map_px: int = 1024
    shadow_softness_m: float = 0.03
    fast: bool = False
    detail: DetailRule = field(default_factory=DetailRule)


LIGHTEST = Quality(samples=0, shadows="blobs", fast=True, detail=DetailRule(finest=2))
"""For computers without a graphics card: people at their lightest, soft blobs for shadows."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """What the last picture was made of: `level` (n,) of every person, −1 where out of view."""

    level: npt.NDArray[np.int64]
    distance_m: Vector


class Renderer:
    """Draw into textures or arrays; one per graphics context, in the thread of that context."""

    def __init__(
        self, context: moderngl.Context | None = None, *, quality: Quality | None = None
    ) -> None:
        self._owns_context = context is None
        self.context = offscreen_context() if context is None else context
        self.quality = Quality() if quality is None else quality
        self.drawn = Drawn(np.zeros(0, np.int64), np.zeros(0))
        ctx = self.context
        self._textures = Textures(ctx, fast=self.quality.fast)
        self._meshes = CharacterMeshes()
        self._frame = ctx.buffer(reserve=FRAME_BYTES, dynamic=True)
        self._lighting = ctx.buffer(reserve=LIGHTING_BYTES, dynamic=True)
        self._programs = LitPrograms(ctx, fast=self.quality.fast, shadows=self._with_maps())
        self._crowds: dict[tuple[int, ...], CrowdBuffers] = {}
        self._rooms: dict[int, tuple[Room, PropBuffers]] = {}
        self._things: dict[int, tuple[Prop, PropBuffers]] = {}
        self._levels: dict[int, npt.NDArray[np.int64]] = {}
        self._targets: dict[tuple[int, int], EyeTarget] = {}
        self._lit_before: tuple[object, Room, tuple[ShadowView, ...], bytes] | None = None
        self._overlays = Overlays(ctx)
        self._shadow_maps: list[tuple[moderngl.Texture, moderngl.Framebuffer]] = []
        self._closed = False

    # ---- what callers use ------------------------------------------------------------------

    def image(self, picture: Picture, camera: Camera, size_px: tuple[int, int]) -> Image:
        """Return the picture as (height, width, 3) sRGB bytes, top row first."""
        target = self._target(size_px)
        self.draw(picture, [camera], [target])
        return target.read()

    def draw(
        self,
        picture: Picture,
        cameras: Sequence[Camera],
        targets: Sequence[EyeTarget],
        *,
        levels: npt.NDArray[np.int64] | None = None,
    ) -> Drawn:
        """Draw the picture once per camera into the targets.

        `levels` (n,) repeats recorded levels of detail instead of choosing them.

        Raises:
            StageError: the graphics driver failed; what was recorded is not touched.
        """
        try:
            drawn = self._draw(picture, cameras, targets, levels)
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
        return drawn

    def prepare(self, cast: tuple[Character, ...], room: Room) -> None:
        """Send a cast and a room to the card now, so that the first frame is not late."""
        self._crowd(cast)
        self._room(room)

    def close(self) -> None:
        """Free everything; idempotent."""
        if self._closed:
            return
        self._closed = True
        for crowd in self._crowds.values():
            crowd.release()
        for _, props in (*self._rooms.values(), *self._things.values()):
            props.release()
        for target in self._targets.values():
            target.release()
        for texture, frame in self._shadow_maps:
            frame.release()
            texture.release()
        self._overlays.release()
        self._textures.release()
        self._programs.release()
        self._frame.release()
        self._lighting.release()
        if self._owns_context:
            self.context.release()

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- one picture -----------------------------------------------------------------------

    def _draw(
        self,
        picture: Picture,
        cameras: Sequence[Camera],
        targets: Sequence[EyeTarget],
        levels: npt.NDArray[np.int64] | None,
    ) -> Drawn:
        ctx = self.context
        ctx.disable_direct(GL_FRAMEBUFFER_SRGB)
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.depth_func = "<"
        ctx.front_face = "ccw"
        dark = picture.brightness_01 <= 0.0
        crowd = None if dark else self._crowd(picture.cast)
        drawn = Drawn(np.full(len(picture.cast), -1), np.full(len(picture.cast), np.nan))
        if crowd is not None:
            drawn = self.pose(picture, crowd, cameras, levels)
            self.light(picture, crowd)
        for camera, target in zip(cameras, targets, strict=True):
            target.begin(_background(picture))
            self.look_from(camera, picture.brightness_01, 0.35 if target.samples else 0.5)
            if crowd is not None:
                if target.samples:
                    ctx.enable_direct(GL_SAMPLE_ALPHA_TO_COVERAGE)
                self.paint(picture, crowd, identity=False)
                ctx.disable_direct(GL_SAMPLE_ALPHA_TO_COVERAGE)
                if self.quality.shadows == "blobs" and len(picture.cast):
                    self._overlays.blobs(crowd.joints.watched_m[drawn.level >= 0, 2:])
            self._overlays.draw(picture, camera)
            target.finish()
        self.drawn = drawn
        return drawn

    def pose(
        self,
        picture: Picture,
        crowd: CrowdBuffers,
        cameras: Sequence[Camera],
        levels: npt.NDArray[np.int64] | None = None,
    ) -> Drawn:
        """Place everyone, choose who is drawn and how finely, and send it to the card."""
        joints = crowd.joints
        joints.pose(picture.people)
        if not crowd.cast:
            return Drawn(np.zeros(0, np.int64), np.zeros(0))
        eyes = np.array([c.pose.position_m for c in cameras])
        apart = joints.watched_m[:, 1, None, :] - eyes[None]
        distance_m = np.sqrt((apart * apart).sum(axis=2)).min(axis=1)
        if levels is None:
            before = self._levels.get(id(crowd), np.full(len(crowd.cast), -1))
            chosen = choose_levels(distance_m, before, self.quality.detail)
            self._levels[id(crowd)] = chosen
            seen = in_view(joints.watched_m[:, 0], BODY_RADIUS_M, cameras)
        else:
            chosen, seen = np.maximum(levels, 0), levels >= 0
        chosen = np.minimum(chosen, crowd.level_count - 1)
        crowd.upload()
        # Who is out of view may still throw a shadow into it.
        crowd.choose(chosen, np.ones_like(seen) if self._casts(picture.room) else seen)
        return Drawn(np.where(seen, chosen, -1), distance_m)

    def light(self, picture: Picture, crowd: CrowdBuffers) -> None:
        """Send the lamps, move people into their poses, draw the shadow maps."""
        views, block = self._lit(picture, crowd)
        self._lighting.write(block)
        self._lighting.bind_to_uniform_block(1)
        self._frame.bind_to_uniform_block(0)
        if crowd.cast:
            crowd.skin(self._programs.skinning(self._light_constants(picture.room)))
        self._draw_shadows(picture, crowd, views)

    def look_from(self, camera: Camera, brightness_01: float, alpha_threshold: float) -> None:
        """Send the camera."""
        matrix = projection(camera) @ view(camera.pose)
        block = np.zeros(24, np.float32)
        block[:16] = matrix.T.ravel()
        block[16:19] = camera.pose.position_m
        block[20:24] = (brightness_01, 1.0, alpha_threshold, max(brightness_01, 0.0) ** (1 / 2.2))
        self._frame.write(block)
        self._frame.bind_to_uniform_block(0)

    def paint(self, picture: Picture, crowd: CrowdBuffers, *, identity: bool) -> None:
        """Draw room, things and people from the camera sent, with the light sent."""
        for k, (texture, _) in enumerate(self._shadow_maps):
            texture.use(UNITS[f"shadow_map_{k}"])
        light = self._light_constants(picture.room)

        def room_program(run: Run) -> moderngl.Program:
            return self._programs.lit("room", run, light, identity=identity)

        def people_program(run: Run) -> moderngl.Program:
            return self._programs.lit("people", run, light, identity=identity)

        # People first: they hide much of the room, which is then not computed.
        if crowd.cast:
            crowd.draw(people_program, (light, identity))
        self._room(picture.room).draw(room_program)
        for placed in picture.moving:
            self._thing(placed.prop).draw(room_program, world_from(placed.pose))

    def crowd_of(self, picture: Picture) -> CrowdBuffers:
        """Return the cast's buffers."""
        return self._crowd(picture.cast)

    # ---- parts -----------------------------------------------------------------------------

    def _with_maps(self) -> bool:
        return self.quality.shadows == "maps"

    def _light_constants(self, room: Room) -> str:
        """Return the lamps of a room as the shaders are compiled for them."""
        kinds, maps, used = [], [], 0
        for lamp in room.lights:
            kinds.append(int(KIND_NUMBERS[lamp.kind]))
            casts = self._with_maps() and lamp.casts_shadow and used < MOST_SHADOWS
            maps.append(used if casts else -1)
            used += casts
        return lamp_constants(kinds, maps)

    def _casts(self, room: Room) -> bool:
        return self._with_maps() and any(lamp.casts_shadow for lamp in room.lights)

    def _lit(self, picture: Picture, crowd: CrowdBuffers) -> tuple[tuple[ShadowView, ...], bytes]:
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

    def _lit_box(self, picture: Picture, crowd: CrowdBuffers) -> tuple[Vector, Vector]:
        """Return the box around everyone, within the room; shadows are finest where people are.

        It grows and shrinks in steps, so that shadows do not swim while people walk.
        """
        room = self._room(picture.room)
        if not crowd.cast:
            return room.low_m.astype(np.float64), room.high_m.astype(np.float64)
        hips = crowd.joints.watched_m[:, 0]
        low = LIT_STEP_M * np.floor((hips.min(axis=0) - 1.5) / LIT_STEP_M)
        high = LIT_STEP_M * np.ceil((hips.max(axis=0) + 1.5) / LIT_STEP_M)
        return np.maximum(low, room.low_m), np.minimum(high, room.high_m)

    def _draw_shadows(
        self, picture: Picture, crowd: CrowdBuffers, views: tuple[ShadowView, ...]
    ) -> None:
        if not views:
            return
        ctx = self.context
        while len(self._shadow_maps) < MOST_SHADOWS:
            self._shadow_maps.append(_shadow_map(ctx, self.quality.shadow_map_px))
        ctx.disable(moderngl.CULL_FACE)
        ctx.polygon_offset = 1.5, 3.0
        for shadow_view, (_, frame) in zip(views, self._shadow_maps, strict=False):
            frame.use()
            frame.clear(depth=1.0)
            matrix = for_gl(shadow_view.from_world)
            program = self._programs.outline("room")
            set_bytes(program, "shadow_projection", matrix)
            self._room(picture.room).draw_outlines(program)
            for placed in picture.moving:
                if placed.prop.casts_shadow:
                    self._thing(placed.prop).draw_outlines(program, world_from(placed.pose))
            if crowd.cast:
                program = self._programs.outline("people")
                set_bytes(program, "shadow_projection", matrix)
                crowd.draw_outlines(program)
        ctx.polygon_offset = 0.0, 0.0
        ctx.enable(moderngl.CULL_FACE)

    def _target(self, size_px: tuple[int, int]) -> EyeTarget:
        if size_px not in self._targets:
            self._targets[size_px] = EyeTarget(self.context, size_px, self.quality.samples)
        return self._targets[size_px]

    def _crowd(self, cast: tuple[Character, ...]) -> CrowdBuffers:
        key = tuple(map(id, cast))
        found = self._crowds.get(key)
        if found is None:
            while len(self._crowds) >= CASTS_KEPT:
                oldest = self._crowds.pop(next(iter(self._crowds)))
                self._levels.pop(id(oldest), None)
                oldest.release()
            found = CrowdBuffers(
                self.context, cast, self._meshes, self._textures, self.quality.detail.finest
            )
            self._crowds[key] = found
        return found

    def _room(self, room: Room) -> PropBuffers:
        found = self._rooms.get(id(room))
        if found is None:
            while len(self._rooms) >= ROOMS_KEPT:
                self._rooms.pop(next(iter(self._rooms)))[1].release()
            found = (
                room,
                PropBuffers(
                    self.context,
                    room.props,
                    self._textures,
                    VERTEX_LIT_EDGE_M if self.quality.fast else None,
                ),
            )
            self._rooms[id(room)] = found
        return found[1]

    def _thing(self, prop: Prop) -> PropBuffers:
        found = self._things.get(id(prop))
        if found is None:
            found = (prop, PropBuffers(self.context, (prop,), self._textures))
            self._things[id(prop)] = found
        return found[1]


def _background(picture: Picture) -> tuple[float, float, float]:
    share = max(0.0, min(1.0, picture.brightness_01))
    r, g, b = (share * channel / 255 for channel in picture.room.background_srgb)
    return r, g, b


def _shadow_map(
    context: moderngl.Context, size_px: int
) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
    texture = context.depth_texture((size_px, size_px))
    texture.compare_func = "<="
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture, context.framebuffer(depth_attachment=texture)

"""Rooms and things that move, on the graphics card."""

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np

from lab.geometry import Vector
from stage.baked_room import baked_room
from stage.programs import UNITS, set_bytes
from stage.projection import for_gl
from stage.textures import Textures
from stage.vertices import ROOM_LAYOUT, Run, room_vertices
from stimuli.picture import Prop, Room

STILL = np.eye(4)


class PropBuffers:
    """Props that keep their places against each other; `lit_by` a room once and for all, or as
    they are drawn.
    """

    def __init__(
        self,
        context: moderngl.Context,
        props: tuple[Prop, ...],
        textures: Textures,
        lit_by: Room | None = None,
    ) -> None:
        self._context, self._textures = context, textures
        laid_out = room_vertices(props)
        self._light: moderngl.Buffer | None = None
        if lit_by is not None and len(laid_out.indices):
            baked = baked_room(laid_out, lit_by)
            laid_out = baked.vertices
            self._light = context.buffer(baked.light.tobytes())
        self._runs = tuple(run for run in laid_out.runs if run.count)
        self._casting = laid_out.casting
        self._empty = not len(laid_out.indices)
        self._arrays: dict[int, moderngl.VertexArray] = {}
        places = laid_out.vertices["place_m"]
        self.low_m: Vector = places.min(axis=0) if len(places) else np.zeros(3)
        self.high_m: Vector = places.max(axis=0) if len(places) else np.zeros(3)
        if not self._empty:
            self._vertices = context.buffer(laid_out.vertices.tobytes())
            self._indices = context.buffer(laid_out.indices.tobytes())

    def draw(
        self,
        program_of: Callable[[Run], moderngl.Program],
        world_from_prop: Vector = STILL,
    ) -> None:
        """Draw all of it."""
        for run in self._runs:
            program = program_of(run)
            array = self._array(program)
            (self._context.disable if run.double_sided else self._context.enable)(
                moderngl.CULL_FACE
            )
            set_bytes(program, "world_from_prop", for_gl(world_from_prop))
            self._textures.use(run.texture, UNITS["picture"])
            array.render(vertices=run.count, first=run.first)

    def draw_outlines(self, program: moderngl.Program, world_from_prop: Vector = STILL) -> None:
        """Draw what casts a shadow into a shadow map."""
        if not self._casting:
            return
        array = self._array(program)
        set_bytes(program, "world_from_prop", for_gl(world_from_prop))
        for first, count in self._casting:
            array.render(vertices=count, first=first)

    def _array(self, program: moderngl.Program) -> moderngl.VertexArray:
        array = self._arrays.get(id(program))
        if array is None:
            content: list[tuple[Any, ...]] = [(self._vertices, *ROOM_LAYOUT)]
            if self._light is not None:
                content.append((self._light, "3f4", "in_light"))
            array = self._arrays[id(program)] = self._context.vertex_array(
                program, content, self._indices, index_element_size=4, skip_errors=True
            )
        return array

    def release(self) -> None:
        """Free the card's memory."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        if self._light is not None:
            self._light.release()
            self._light = None
        if not self._empty:
            self._vertices.release()
            self._indices.release()
            self._empty = True

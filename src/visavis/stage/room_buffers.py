"""Rooms and things that move, on the graphics card."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stage.card.programs import UNITS, set_bytes
from visavis.stage.card.textures import Layers
from visavis.stage.card.vertices import (
    ROOM_LAYOUT,
    RoomVertices,
    Run,
    TextureArray,
    join_stretches,
    room_vertices,
)
from visavis.stage.geometry.projection import for_gl
from visavis.stage.processor.baked_room import baked_room
from visavis.stimuli.picture import Prop, Room

STILL = np.eye(4)


class PropBuffers:
    """Props that keep their places against each other; `lit_by` a room once and for all, or as
    they are drawn. Their pictures are layers of one array per shape, so that a few calls draw all.
    """

    def __init__(
        self,
        context: moderngl.Context,
        props: tuple[Prop, ...],
        make_array: Callable[[list[TextureArray]], moderngl.TextureArray],
        lit_by: Room | None = None,
    ) -> None:
        self._context = context
        laid_out = room_vertices(props)
        pictures = (run.texture for run in laid_out.runs)
        self._layers = Layers((p for p in pictures if p is not None), make_array)
        _place_layers(laid_out, self._layers)
        places = laid_out.vertices["place_m"]
        self.low_m: Vector = places.min(axis=0) if len(places) else np.zeros(3)
        self.high_m: Vector = places.max(axis=0) if len(places) else np.zeros(3)
        casting = [laid_out.indices[first : first + count] for first, count in laid_out.casting]
        self._buffers: list[moderngl.Buffer] = []
        self._content: list[tuple[Any, ...]] = []
        light: moderngl.Buffer | None = None
        if lit_by is not None and len(laid_out.indices):
            lit_room = baked_room(laid_out, lit_by)
            laid_out, light = lit_room.vertices, self._buffer(lit_room.light)
        self._runs = _join_runs(laid_out.runs, self._layers)
        self._solid = join_stretches(
            [(r.first, r.count) for r in self._runs if r.is_solid and not r.double_sided]
        )
        self._outline_count = sum(map(len, casting))
        self._arrays: dict[tuple[int, bool], moderngl.VertexArray] = {}
        if len(laid_out.indices):
            self._indices = self._buffer(laid_out.indices)
            self._outlines = self._buffer(np.concatenate(casting)) if casting else None
            self._content = [(self._buffer(laid_out.vertices), *ROOM_LAYOUT)]
            if light is not None:
                self._content.append((light, "3f4", "in_light"))

    def draw(
        self,
        program_of: Callable[[Run], moderngl.Program],
        world_from_prop: Vector = STILL,
    ) -> None:
        """Draw all of it."""
        for run in self._runs:
            program = program_of(run)
            (self._context.disable if run.double_sided else self._context.enable)(
                moderngl.CULL_FACE
            )
            set_bytes(program, "world_from_prop", for_gl(world_from_prop))
            if run.texture is not None:
                self._layers.arrays[self._layers.place(run.texture)[0]].use(UNITS["picture"])
            self._array(program, self._indices).render(vertices=run.count, first=run.first)

    def draw_depth(self, program: moderngl.Program) -> None:
        """Draw the depth of all that is solid and stands still."""
        set_bytes(program, "world_from_prop", for_gl(STILL))
        self._context.enable(moderngl.CULL_FACE)
        for first, count in self._solid:
            self._array(program, self._indices).render(vertices=count, first=first)

    def draw_outlines(self, program: moderngl.Program, world_from_prop: Vector = STILL) -> None:
        """Draw what casts a shadow into a shadow map."""
        if not self._outline_count:
            return
        set_bytes(program, "world_from_prop", for_gl(world_from_prop))
        self._array(program, self._outlines).render(vertices=self._outline_count)

    def release(self) -> None:
        """Free the card's memory."""
        for array in self._arrays.values():
            array.release()
        for buffer in self._buffers:
            buffer.release()
        self._arrays.clear()
        self._buffers.clear()
        self._layers.release()

    def _buffer(self, rows: npt.NDArray[Any]) -> moderngl.Buffer:
        buffer = self._context.buffer(rows.tobytes())
        self._buffers.append(buffer)
        return buffer

    def _array(
        self, program: moderngl.Program, indices: moderngl.Buffer | None
    ) -> moderngl.VertexArray:
        key = id(program), indices is self._indices
        array = self._arrays.get(key)
        if array is None:
            array = self._arrays[key] = self._context.vertex_array(
                program, self._content, indices, index_element_size=4, skip_errors=True
            )
        return array


def _place_layers(laid_out: RoomVertices, layers: Layers) -> None:
    """Tell vertices in which layer their picture is."""
    for run in laid_out.runs:
        if run.texture is not None:
            vertices = laid_out.indices[run.first : run.first + run.count]
            layer = layers.place(run.texture)[1]
            laid_out.vertices["look"][vertices, 2:] = layer % 256, layer // 256


def _join_runs(runs: tuple[Run, ...], layers: Layers) -> tuple[Run, ...]:
    """Join runs that follow one another and whose pictures are in one array."""

    def drawn_as(run: Run) -> tuple[int, bool]:
        array = -1 if run.texture is None else layers.place(run.texture)[0]
        return array, run.double_sided

    out: list[Run] = []
    for run in runs:
        if out and drawn_as(out[-1]) == drawn_as(run):
            out[-1] = replace(out[-1], count=out[-1].count + run.count)
        elif run.count:
            out.append(run)
    return tuple(out)

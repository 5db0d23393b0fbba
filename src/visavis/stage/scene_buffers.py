"""Casts, rooms and things on the graphics card, kept while pictures use them."""

from functools import partial

import moderngl

from visavis.stage.card.crowd_buffers import CrowdBuffers
from visavis.stage.card.gl_calls import GlCalls
from visavis.stage.card.models import CharacterMeshes, ModelsOnCard
from visavis.stage.card.textures import Layers, Looks, SharedLayers, code_layers, srgb_layers
from visavis.stage.processor.crowd import ProcessorCrowd
from visavis.stage.room_buffers import PropBuffers
from visavis.stimuli.characters.character import Character
from visavis.stimuli.picture import Prop, Room

ROOMS_KEPT = 4
CASTS_KEPT = 3

Crowd = CrowdBuffers | ProcessorCrowd


class SceneBuffers:
    """Build at first use, keep the latest; `fast` has people and rooms lit by the processor."""

    def __init__(self, context: moderngl.Context, *, fast: bool) -> None:
        self._context, self._fast = context, fast
        self._calls = GlCalls(context)
        in_codes = partial(code_layers, context, self._calls)
        self._make_array = in_codes if fast else partial(srgb_layers, context, self._calls)
        self._meshes = CharacterMeshes()
        self._layers = SharedLayers(in_codes)
        self._looks = Looks(context, self._calls)
        self._models = ModelsOnCard(context, self._meshes, self._looks)
        self._crowds: dict[tuple[int, ...], Crowd] = {}
        self._rooms: dict[int, tuple[Room, PropBuffers]] = {}
        self._things: dict[int, tuple[Prop, PropBuffers]] = {}

    def crowd(self, cast: tuple[Character, ...]) -> Crowd:
        """Return the cast's buffers."""
        key = tuple(map(id, cast))
        crowd = self._crowds.get(key)
        if crowd is None:
            while len(self._crowds) >= CASTS_KEPT:
                self._crowds.pop(next(iter(self._crowds))).release()
            if self._fast:
                crowd = ProcessorCrowd(self._context, cast, self._meshes, self._layers_of(cast))
            else:
                crowd = CrowdBuffers(self._context, cast, self._models, self._calls)
            self._crowds[key] = crowd
        return crowd

    def _layers_of(self, cast: tuple[Character, ...]) -> Layers:
        layers_in_use = [c.layers for c in self._crowds.values() if isinstance(c, ProcessorCrowd)]
        return self._layers.of(cast, layers_in_use)

    def room(self, room: Room) -> PropBuffers:
        """Return the room's buffers."""
        entry = self._rooms.get(id(room))
        if entry is None:
            while len(self._rooms) >= ROOMS_KEPT:
                self._rooms.pop(next(iter(self._rooms)))[1].release()
            lit_by = room if self._fast else None
            entry = self._rooms[id(room)] = (room, self._props(room.props, lit_by))
        return entry[1]

    def thing(self, prop: Prop) -> PropBuffers:
        """Return the buffers of a thing that moves."""
        entry = self._things.get(id(prop))
        if entry is None:
            entry = self._things[id(prop)] = (prop, self._props((prop,)))
        return entry[1]

    def _props(self, props: tuple[Prop, ...], lit_by: Room | None = None) -> PropBuffers:
        return PropBuffers(self._context, props, self._make_array, lit_by)

    def release(self) -> None:
        """Free the card's memory."""
        for crowd in self._crowds.values():
            crowd.release()
        for _, props in (*self._rooms.values(), *self._things.values()):
            props.release()
        self._layers.release()
        self._models.release()
        self._looks.release()

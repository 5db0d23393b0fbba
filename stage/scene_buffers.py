"""Casts, rooms and things on the graphics card, kept while pictures ask for them."""

import moderngl

from stage.crowd_buffers import CharacterMeshes, CrowdBuffers
from stage.processor_crowd import ProcessorCrowd
from stage.room_buffers import PropBuffers
from stage.textures import Layers, SharedLayers, Textures
from stimuli.characters.character import Character
from stimuli.picture import Prop, Room

ROOMS_KEPT = 4
CASTS_KEPT = 3

Crowd = CrowdBuffers | ProcessorCrowd


class SceneBuffers:
    """Build at first use, keep the latest; `fast` has people and rooms lit by the processor."""

    def __init__(self, context: moderngl.Context, *, fast: bool, finest: int) -> None:
        self._context, self._fast, self._finest = context, fast, finest
        self._textures = Textures(context, fast=fast)
        self._meshes = CharacterMeshes()
        self._layers = SharedLayers(context)
        self._crowds: dict[tuple[int, ...], Crowd] = {}
        self._rooms: dict[int, tuple[Room, PropBuffers]] = {}
        self._things: dict[int, tuple[Prop, PropBuffers]] = {}

    def crowd(self, cast: tuple[Character, ...]) -> Crowd:
        """Return the cast's buffers."""
        key = tuple(map(id, cast))
        found = self._crowds.get(key)
        if found is None:
            while len(self._crowds) >= CASTS_KEPT:
                self._crowds.pop(next(iter(self._crowds))).release()
            if self._fast:
                found = ProcessorCrowd(self._context, cast, self._meshes, self._layers_of(cast))
            else:
                found = CrowdBuffers(
                    self._context, cast, self._meshes, self._textures, self._finest
                )
            self._crowds[key] = found
        return found

    def _layers_of(self, cast: tuple[Character, ...]) -> Layers:
        drawn = [c.layers for c in self._crowds.values() if isinstance(c, ProcessorCrowd)]
        return self._layers.of(cast, drawn)

    def room(self, room: Room) -> PropBuffers:
        """Return the room's buffers."""
        found = self._rooms.get(id(room))
        if found is None:
            while len(self._rooms) >= ROOMS_KEPT:
                self._rooms.pop(next(iter(self._rooms)))[1].release()
            lit_by = room if self._fast else None
            buffers = PropBuffers(self._context, room.props, self._textures, lit_by)
            found = self._rooms[id(room)] = (room, buffers)
        return found[1]

    def thing(self, prop: Prop) -> PropBuffers:
        """Return the buffers of a thing that moves."""
        found = self._things.get(id(prop))
        if found is None:
            found = (prop, PropBuffers(self._context, (prop,), self._textures))
            self._things[id(prop)] = found
        return found[1]

    def release(self) -> None:
        """Free the card's memory."""
        for crowd in self._crowds.values():
            crowd.release()
        for _, props in (*self._rooms.values(), *self._things.values()):
            props.release()
        self._layers.release()
        self._textures.release()

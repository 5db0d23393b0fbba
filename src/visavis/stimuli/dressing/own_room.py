"""Read a laboratory's own room from a glTF binary: its meshes, and how it looks."""

import hashlib
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.geometry import quat_from_yaw_pitch_deg, rotate, unit
from visavis.lab.yaml_lines import did_you_mean
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf.figure import Surface, places_of_nodes, surfaces_of
from visavis.stimuli.characters.gltf.file import GltfFile, read_glb
from visavis.stimuli.characters.gltf.looks import Looks, colour_factor, shine_as_roughness, srgb_of
from visavis.stimuli.own_room import PlacedRoom
from visavis.stimuli.picture import Light, Prop, Room, StaticMesh
from visavis.stimuli.room_areas import RoomMesh, RoomShape, to_world

MAX_BYTES: Final = 256 * 1024**2
MAX_TRIANGLES: Final = 300_000
"""Rooms with more would be drawn too slowly, and gaze be met with them too late."""


@dataclass(frozen=True, eq=False)
class _OwnRoom:
    shape: RoomShape
    props: tuple[Prop, ...]


def room_shape(own_room: PlacedRoom) -> RoomShape:
    """Return the meshes of a room's file.

    Raises:
        DesignError: it cannot be read, has no meshes or too many triangles, or two have one name.
    """
    return _read(own_room.of_file()).shape


@lru_cache(maxsize=8)
def drawn_room(own_room: PlacedRoom) -> Room:
    """Return a room as it is drawn around who looks, in even light; the same object each time."""
    room = own_room.room
    turn = quat_from_yaw_pitch_deg(room.yaw_deg)
    props = tuple(
        Prop(
            prop.name,
            StaticMesh(
                to_world(prop.mesh.vertices_m, room.stand_m, room.yaw_deg),
                rotate(turn, prop.mesh.normals.astype(np.float64)).astype(np.float32),
                prop.mesh.colour_srgb,
                prop.mesh.triangles,
                prop.mesh.uv,
            ),
            prop.material,
            prop.emission_01,
        )
        for prop in _read(own_room.of_file()).props
    )
    return Room(
        name=f"{room.file} {_read(own_room.of_file()).shape.sha256}",
        props=props,
        lights=(
            Light("sun", np.full(3, 1.1), direction=unit(np.array([0.35, -0.8, -0.5]))),
            Light("sun", np.full(3, 0.4), direction=unit(np.array([-0.5, -0.3, 0.8]))),
        ),
        sky=np.full(3, 0.5),
        ground=np.full(3, 0.4),
        background_srgb=(110, 114, 118),
    )


@lru_cache(maxsize=4)
def _read(own_room: PlacedRoom) -> _OwnRoom:
    path = own_room.path
    if not path.is_file():
        near = did_you_mean(path.name, (p.name for p in path.parent.glob("*.gl*")))
        near = near if near.startswith("; did") else "; put it beside the study's file"
        raise DesignError(f"there is no room {path}{near}")
    if (size := path.stat().st_size) > MAX_BYTES:
        raise DesignError(
            f"{path} has {size / 1024**2:.0f} MiB, rooms at most {MAX_BYTES // 1024**2}; export it "
            "with smaller pictures"
        )
    try:
        file = read_glb(path)
        shine_as_roughness(file)
        _, place = places_of_nodes(file)
        surfaces = [
            surface
            for i, node in enumerate(file.items("nodes"))
            if "mesh" in node
            for surface in surfaces_of(
                file,
                {k: v for k, v in node.items() if k != "skin"},
                np.array([0]),
                place(i)[None],
                i,
            )
        ]
        return _OwnRoom(
            RoomShape(own_room.room.file, _sha256(own_room), _meshes_of(own_room, file, surfaces)),
            _props_of(file, surfaces),
        )
    except CharacterError as error:
        raise DesignError(str(error)) from error
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise DesignError(
            f"{path}: its description does not fit its data ({error}); export it again"
        ) from error


def _sha256(room: PlacedRoom) -> str:
    return hashlib.sha256(room.path.read_bytes()).hexdigest()


def _meshes_of(
    own_room: PlacedRoom, file: GltfFile, surfaces: list[Surface]
) -> tuple[RoomMesh, ...]:
    """Return the meshes of all nodes that have one, each with a name of its own or none."""
    path = own_room.path
    parts: dict[int, list[Surface]] = {}
    for surface in surfaces:
        parts.setdefault(surface.node, []).append(surface)
    count = sum(len(surface.triangles) for surface in surfaces)
    if not count:
        raise DesignError(
            f"{path} has no meshes, so that there is nothing to see; export the room's surfaces, "
            "not its cameras and lamps alone"
        )
    if count > MAX_TRIANGLES:
        raise DesignError(
            f"{path} has {count} triangles, rooms at most {MAX_TRIANGLES}; export it with simpler "
            "meshes"
        )
    meshes: list[RoomMesh] = []
    names: dict[str, str] = {}
    for i, members in parts.items():
        if not np.isfinite(np.concatenate([s.vertices_m for s in members])).all():
            raise DesignError(f"{path}: some of its points are not numbers; export it again")
        own = _name_of(file, i)
        name = _column_name(own)
        if name and name in names:
            raise DesignError(
                f"{path} has two meshes called {own!r}"
                + ("" if names[name] == own else f" or {names[name]!r}")
                + (f", in columns {name}" if name != own else "")
                + "; gaze could not tell which is meant: call one otherwise, or join them"
            )
        if name:
            names[name] = own
        begins = np.cumsum([0, *(len(s.vertices_m) for s in members[:-1])])
        meshes.append(
            RoomMesh(
                name,
                np.concatenate([s.vertices_m for s in members]).astype(np.float32),
                np.concatenate(
                    [s.triangles + first for s, first in zip(members, begins, strict=True)]
                ).astype(np.int32),
            )
        )
    return tuple(meshes)


def _name_of(file: GltfFile, node: int) -> str:
    entry = file.items("nodes")[node]
    return str(entry.get("name") or file.tree["meshes"][entry["mesh"]].get("name") or "")


def _column_name(name: str) -> str:
    """Return a name for columns: letters, digits and _ ("Desk lamp.001": Desk_lamp_001)."""
    plain = re.sub(r"\W+", "_", name).strip("_")
    return plain if not plain or plain.isidentifier() else f"_{plain}"


def _props_of(file: GltfFile, surfaces: list[Surface]) -> tuple[Prop, ...]:
    looks = Looks(file)
    return tuple(_prop_of(file, looks, surface) for surface in surfaces if len(surface.triangles))


def _prop_of(file: GltfFile, looks: Looks, surface: Surface) -> Prop:
    light = colour_factor(file, surface.material)
    colour = np.broadcast_to(light, surface.vertices_m.shape)
    if surface.colour is not None:
        colour = colour * surface.colour
    entry = {} if surface.material is None else file.items("materials")[surface.material]
    glow = np.array(entry.get("emissiveFactor", (0.0, 0.0, 0.0)), np.float64)
    return Prop(
        _column_name(_name_of(file, surface.node)) or surface.name,
        StaticMesh(
            surface.vertices_m.astype(np.float32),
            surface.normals.astype(np.float32),
            np.round(255 * srgb_of(colour)).astype(np.uint8),
            surface.triangles.astype(np.int32),
            None if surface.uv is None else surface.uv.astype(np.float32),
        ),
        looks.material(surface.material, "other", is_shared=False),
        float(np.clip(glow.max(), 0.0, 1.0)),
        casts_shadow=False,
    )

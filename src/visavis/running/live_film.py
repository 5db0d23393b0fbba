"""Films that pages draw themselves, as files: who is in them, how they move, and the room.

Poses are those of the film's pictures, in steps so small that no joint is 0.1 mm from where it was;
between two pictures the page goes straight.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.running.film_store import FilmStore
from visavis.stage.card.vertices import room_vertices
from visavis.stage.processor.baked_room import baked_room
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.gltf.exporting import glb_of_character
from visavis.stimuli.motion.faces import NEUTRAL
from visavis.stimuli.motion.rotations import one_way_round
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.page_arrays import packed_arrays
from visavis.stimuli.picture import Room
from visavis.study.films import Film
from visavis.study.scenes import Maker

LEVEL: Final = 1
"""Level of detail of people in a room: several are seen from metres away, once for each eye."""
STILL: Final = 1e-6
"""Joints whose turns differ by less are written once."""
STEP: Final = 2e-5
"""What moves is written in steps of it from the first picture on, roots in metres and the four
numbers of turns: each is off by half a step at most.
"""
WEBP_QUALITY: Final = 80


@dataclass(frozen=True, eq=False)
class LiveFilmFiles:
    """What a page draws a film from: its room, everybody in it and how they move."""

    room: Room
    room_file: bytes
    people: tuple[bytes, ...]
    poses: tuple[bytes, ...]


def live_film_files(film: Film, store: FilmStore) -> LiveFilmFiles:
    """Return the files of a film that a page draws, made once in a process.

    Raises:
        DesignError: things move in it, its people or room change, or somebody makes a face.
    """
    return _files(film, tuple(store.makers.items()), store.study_folder)


@lru_cache(maxsize=256)
def _files(film: Film, makers: tuple[tuple[str, Maker], ...], folder: Path) -> LiveFilmFiles:
    pictures = list(FilmStore(dict(makers), folder).pictures(film))
    first = pictures[0]
    if any(p.moving or p.room is not first.room or p.cast != first.cast for p in pictures):
        raise DesignError(
            f"{film.scene.name}: things move in it, or people come and go; watch it as a film"
        )
    scene = FilmStore(dict(makers), folder).stage_film(film).scene
    if any(person.face != NEUTRAL for person in getattr(scene, "people", ())):
        raise DesignError(
            f"{film.scene.name}: somebody makes a face, and people that a page draws have still "
            "ones; watch it as a film"
        )
    root_m = np.array([p.people.root_m for p in pictures])
    turns = one_way_round(np.array([p.people.orientation_wxyz for p in pictures]))
    poses = (
        _poses(character.skeleton, film.rate_hz, root_m[:, k], turns[:, k])
        for k, character in enumerate(first.cast)
    )
    people = tuple(map(_person, first.cast))
    return LiveFilmFiles(first.room, _room(first.room), people, tuple(poses))


def _poses(skeleton: Skeleton, rate_hz: int, root_m: Vector, turns: Vector) -> bytes:
    """Return a motion: roots (n, 3) and turns (n, 55, 4), of joints that move in every picture."""
    is_moving = (np.ptp(turns, axis=0) > STILL).any(axis=1)
    moves = np.concatenate([root_m, turns[:, is_moving].reshape(len(turns), -1)], axis=1)
    first = {"offsets_m": skeleton.offsets_m, "root_m": root_m[0], "rest": turns[0]}
    arrays: Mapping[str, npt.NDArray[np.generic]] = {
        **{name: np.asarray(a, "<f4") for name, a in first.items()},
        "changes": _changes(moves),
    }
    head = {
        "joints": len(skeleton.names),
        "parents": skeleton.parents.tolist(),
        "moving": np.flatnonzero(is_moving).tolist(),
        "frames": len(root_m),
        "rate_hz": rate_hz,
        "step": STEP,
    }
    return packed_arrays(head, arrays)


def _changes(moves: Vector) -> npt.NDArray[np.uint8]:
    """Return how every column goes on from its first row, as bytes that deflate well.

    These are second differences in steps, column by column: 2d, or -2d - 1 where d is negative. The
    lowest bytes of all come first, the highest last.
    """
    steps = np.rint((moves - moves[0]) / STEP).astype(np.int64)
    seconds = np.diff(steps, n=2, axis=0, prepend=np.zeros_like(steps, shape=(2, moves.shape[1])))
    whole = np.where(seconds >= 0, 2 * seconds, -2 * seconds - 1).T.astype("<u4")
    changes: npt.NDArray[np.uint8] = whole.reshape(-1, 1).view(np.uint8).T
    return changes


@cache
def _person(character: Character) -> bytes:
    return glb_of_character(character, level=min(LEVEL, len(character.levels) - 1))


@lru_cache(maxsize=16)
def _room(room: Room) -> bytes:
    """Return a room with its light at every vertex, and its pictures."""
    lit_room = baked_room(room_vertices(room.props), room)
    vertices = lit_room.vertices.vertices
    light = np.zeros((len(vertices), 4), np.uint8)
    light[:, :3] = np.rint(127 * np.clip(lit_room.light, 0, 2))
    arrays: dict[str, npt.NDArray[np.generic]] = {
        "place": np.asarray(vertices["place_m"], "<f4"),
        "uv": np.asarray(vertices["uv"], "<f4"),
        "light": light,
        "index": lit_room.vertices.indices.astype("<u4"),
    }
    runs = []
    for run in lit_room.vertices.runs:
        picture = ""
        if run.texture is not None:
            picture = f"picture_{len(arrays)}"
            arrays[picture] = _webp(run.texture)
        runs.append([run.first, run.count, picture])
    return packed_arrays({"runs": runs}, arrays)


def _webp(texture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    content = io.BytesIO()
    Image.fromarray(texture).save(content, "WEBP", quality=WEBP_QUALITY, method=4)
    return np.frombuffer(content.getvalue(), np.uint8)

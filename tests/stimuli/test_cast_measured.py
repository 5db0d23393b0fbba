"""What motions and results are taken from: recorded sessions are analysed with it again."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from character_making.rehair import Arrays, with_new_hair
from visavis.lab.plain_files import parse_json, read_arrays
from visavis.stimuli.characters.cast import DATA
from visavis.stimuli.characters.levels import keep_triangles
from visavis.stimuli.characters.storage import read_character

DIGESTS = {
    "anna": "82dcf02c4ab2960c",
    "bela": "23a312813a303836",
    "chloe": "fc1810816705e13e",
    "dai": "627dbd2a4c64fe5b",
    "elif": "6216f588672c232b",
    "freya": "776dda38fe20d4a6",
    "gabriel": "cf240aff697d1773",
    "henrik": "0a70047e07bf8881",
    "ike": "22aef1e1d1c7cf7a",
    "jun": "72c078f031c31093",
    "karim": "e2c2a545c4ef36f8",
    "luca": "1f113a2eebf9bcab",
}
"""The first digits of the SHA-256 of all arrays but hair and lashes of the full level."""


def _digest(arrays: Arrays) -> str:
    materials = parse_json(arrays["head"].tobytes())["materials"]
    names = [material["name"] for material in materials]
    hair = [names.index(name) for name in ("hair", "lash")]
    digest = hashlib.sha256()
    stays = ~np.isin(arrays["level0_material"], hair)
    if "former hair" in names:
        picture = f"picture{materials[names.index('hair')]['pictures']['colour']}"
        arrays = {name: array for name, array in arrays.items() if name != picture}
    for name, array in sorted(arrays.items()):
        if name.startswith("level0_"):
            field = name.removeprefix("level0_")
            if field in ("part", "material"):
                digest.update(array[stays].tobytes())
            elif field != "triangles" and not field.startswith("morph"):
                digest.update(array[arrays["level0_triangles"][stays]].tobytes())
        elif name != "head":
            digest.update(f"{name} {array.dtype} {array.shape}".encode())
            digest.update(array.tobytes())
    return digest.hexdigest()[:16]


@pytest.mark.parametrize("name", DIGESTS)
def test_bodies_clothes_and_copies_for_measuring_stay_whatever_hair_people_have(name: str) -> None:
    """With other hair everything was thinned otherwise: elbows were held elsewhere, and customers
    saw other waves.
    """
    assert DIGESTS[name] == _digest(read_arrays(DATA / f"{name}.npz"))


def test_hair_made_anew_takes_the_place_of_the_former_and_of_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "luca.npz"
    path.write_bytes((DATA / "luca.npz").read_bytes())
    person = read_character(path)
    full, names = person.levels[0], [material.name for material in person.materials]
    is_hair = full.triangle_material == names.index("hair")
    locks = keep_triangles(full, is_hair & (np.cumsum(is_hair) <= 500))

    arrays = with_new_hair(path, replace(person, levels=(locks,), measuring=(), closed=None))

    assert DIGESTS["luca"] == _digest(arrays)
    materials = arrays["level0_material"]
    assert 500 == (materials == names.index("hair")).sum()
    assert 0 == (materials == names.index("lash")).sum()
    assert len(arrays["level0_vertices"]) == arrays["level0_triangles"].max() + 1

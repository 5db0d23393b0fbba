"""Other clothes on somebody imported: cloth changes; skin, hair, shoes and trims never do."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.stimuli.valid_avatars import avatar_files, needs_avatars
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.character import Character, Material, MaterialKind, SkinnedMesh
from visavis.stimuli.characters.garments import _between_others
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.outfits import TOPS, in_other_clothes

CELL_PX = 16
Colour = tuple[int, int, int]
SKIN, PALM = (190, 140, 110), (225, 190, 165)
SHIRT, TIE, JEANS, BLACK = (60, 90, 130), (200, 60, 60), (70, 80, 100), (20, 20, 22)
WORN: tuple[tuple[str, Colour, str], ...] = (
    ("face", SKIN, "skin"),
    ("neck", SKIN, "skin"),
    ("scalp", BLACK, "hair"),
    ("left_hand", PALM, "cloth"),
    ("right_hand", SKIN, "skin"),
    ("torso", SHIRT, "cloth"),
    ("torso", SHIRT, "cloth"),
    ("torso", TIE, "cloth"),
    ("left_upper_arm", SHIRT, "cloth"),
    ("right_upper_arm", SHIRT, "skin"),
    ("left_forearm", SKIN, "skin"),
    ("right_forearm", SKIN, "cloth"),
    ("left_thigh", JEANS, "cloth"),
    ("right_thigh", JEANS, "cloth"),
    ("left_shin", JEANS, "cloth"),
    ("right_shin", JEANS, "cloth"),
    ("left_foot", JEANS, "cloth"),
    ("right_foot", JEANS, "cloth"),
)
"""Cells of one picture: part, colour, and what an import takes it for; palms are lighter than the
face, as people's are, and shoes are of the trousers' colour.
"""


def imported(worn: tuple[tuple[str, Colour, str], ...] = WORN) -> Character:
    """Return somebody whose one picture covers all; every cell is a square of two triangles."""
    rng = np.random.default_rng(7)
    n = len(worn)
    cells = [
        np.clip(np.array(colour) * (1 + 0.04 * rng.standard_normal((CELL_PX, CELL_PX, 1))), 0, 255)
        for _, colour, _ in worn
    ]
    picture = np.concatenate(cells, axis=1).astype(np.uint8)
    kinds: tuple[MaterialKind, ...] = ("skin", "cloth", "hair")
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 0.98 + 0.01
    uv = np.concatenate([(square + np.array([i, 0])) / [n, 1] for i in range(n)])
    corners = np.concatenate([4 * i + np.array([[0, 1, 2], [0, 2, 3]]) for i in range(n)])
    pattern = load_character("anna")
    mesh = SkinnedMesh(
        vertices_m=np.concatenate([uv, 0 * uv[:, :1]], axis=1).astype(np.float32),
        normals=np.tile([0, 0, 1], (4 * n, 1)).astype(np.float32),
        colour_srgb=np.full((4 * n, 3), 255, np.uint8),
        uv=uv.astype(np.float32),
        joints=np.zeros((4 * n, 4), np.uint8),
        weights=np.tile([1, 0, 0, 0], (4 * n, 1)).astype(np.float32),
        triangles=corners.astype(np.int32),
        triangle_part=np.repeat([PART_INDEX[part] for part, _, _ in worn], 2).astype(np.uint8),
        triangle_material=np.repeat([kinds.index(k) for _, _, k in worn], 2).astype(np.uint8),
        morphs={},
    )
    materials = tuple(Material(f"_Body:{kind}", kind, 0.7, picture) for kind in kinds)
    return replace(pattern, name="visitor", levels=(mesh,), measuring=(mesh,), materials=materials)


def shown(person: Character) -> npt.NDArray[np.float64]:
    """Return the mean colour (t, 3) at which triangles are shown, in sRGB codes."""
    mesh = person.levels[0]
    assert mesh.uv is not None
    inner = np.random.default_rng(1).dirichlet(np.ones(3), 40)
    places = np.einsum("sk,tkc->tsc", inner, mesh.uv[mesh.triangles])
    found = np.einsum("sk,tkc->tsc", inner, mesh.colour_srgb[mesh.triangles].astype(float))
    for number, material in enumerate(person.materials):
        picture = material.texture_srgb
        if picture is not None and material.kind != "eye":
            mine = mesh.triangle_material == number
            column = np.floor(places[mine, :, 0] % 1 * picture.shape[1]).astype(int)
            row = np.floor(places[mine, :, 1] % 1 * picture.shape[0]).astype(int)
            found[mine] *= picture[row, column, :3] / 255
    mean: npt.NDArray[np.float64] = found.mean(axis=1)
    return mean


@pytest.mark.parametrize("outfit", range(1, 7))
def test_only_clothes_change_on_a_picture_that_covers_everything(outfit: int) -> None:
    person = imported()
    changed = np.linalg.norm(shown(in_other_clothes(person, outfit)) - shown(person), axis=1)
    changed = changed.reshape(-1, 2).max(axis=1)
    cloth = [c in (SHIRT, JEANS) and not part.endswith("foot") for part, c, _ in WORN]

    assert 3 > changed[~np.array(cloth)].max()
    assert 30 < changed[cloth].min()


def test_clothes_of_the_colour_of_skin_stay_as_they_were_authored() -> None:
    worn = tuple((part, SKIN if c in (SHIRT, JEANS) else c, kind) for part, c, kind in WORN)
    person = imported(worn)

    assert in_other_clothes(person, 1) is person


def test_shirt_of_many_colours_stays_and_trousers_change() -> None:
    patches: list[Colour] = [(200, 40, 40), (40, 180, 60), (240, 220, 60), (30, 30, 160)]
    shirts = iter(patches)
    worn = tuple((part, next(shirts) if c == SHIRT else c, kind) for part, c, kind in WORN)
    person = imported(worn)
    changed = np.linalg.norm(shown(in_other_clothes(person, 2)) - shown(person), axis=1)
    changed = changed.reshape(-1, 2).max(axis=1)
    jeans = np.array([c == JEANS and not part.endswith("foot") for part, c, _ in worn])

    assert 3 > changed[~jeans].max()
    assert 30 < changed[jeans].min()


def test_stronger_patches_of_a_red_sleeve_change_with_it() -> None:
    reds: list[Colour] = [(115, 12, 7), (115, 12, 7), (138, 5, 5), (92, 22, 17)]
    shirts = iter(reds)
    worn = tuple((part, next(shirts) if c == SHIRT else c, kind) for part, c, kind in WORN)
    worn = tuple((part, SKIN if c == TIE else c, kind) for part, c, kind in worn)
    person = imported(worn)
    red = np.array([c in reds for _, c, _ in worn])
    for outfit in range(1, 6):
        now = shown(in_other_clothes(person, outfit)).reshape(-1, 2, 3).mean(axis=1)[red]
        assert 30 < np.linalg.norm(now[0] - reds[0])
        assert 25 > np.linalg.norm(now - now[0], axis=1).max()


def test_dark_clothes_made_light_keep_their_grain() -> None:
    dark = tuple((part, BLACK if c in (SHIRT, JEANS) else c, kind) for part, c, kind in WORN)
    person = imported(dark)
    torso = slice(CELL_PX * 5 + 2, CELL_PX * 6 - 2)
    for outfit in range(1, 6):
        picture = in_other_clothes(person, outfit).materials[1].texture_srgb
        assert picture is not None
        assert 3 > picture[2:-2, torso].std(axis=(0, 1)).max()


def test_plain_cloth_without_a_picture_changes_too() -> None:
    person = imported()
    plain = tuple(replace(m, texture_srgb=None) for m in person.materials)
    mesh = person.levels[0]
    colour = np.repeat([c for _, c, _ in WORN], 4, axis=0).astype(np.uint8)
    person = replace(person, materials=plain, levels=(replace(mesh, colour_srgb=colour),))
    changed = np.linalg.norm(shown(in_other_clothes(person, 1)) - shown(person), axis=1)
    kind = np.repeat([kind for _, _, kind in WORN], 2)

    assert 3 > changed[kind != "cloth"].max()


def test_ground_of_a_tie_is_none_of_the_suit_it_looks_like_and_hangs_together_with() -> None:
    laid = np.ones((400, 240), bool)
    suit = laid.copy()
    suit[:120, 60:180] = False  # shirt
    suit[30:90, 105:135] = True  # ground of a tie
    suit[90:120, 112:128] = True  # and where it goes below the suit
    suit[30:120:12, 60:180] = False  # stripes
    suit[31:120:12, 60:180] = False
    between = _between_others(suit, laid & ~suit)

    assert between[30:115, 105:135].sum() > 0.95 * suit[30:115, 105:135].sum()
    assert not between[:, :58].any()
    assert not between[125:].any()


def test_ground_of_a_pattern_is_all_of_the_garment() -> None:
    laid = np.ones((400, 240), bool)
    checked = laid.copy()
    checked[::12] = checked[:, ::12] = False

    assert not _between_others(checked, laid & ~checked).any()


@pytest.mark.parametrize("name", ["elif", "gabriel"])
def test_pattern_takes_the_hue_of_the_colour_it_is_given(name: str) -> None:
    """What blue the checks had was taken out twice: beige came out orange."""
    character = load_character(name)
    top = [material.name for material in character.materials].index("top")
    for outfit in range(1, 9):
        other = in_other_clothes(character, outfit)
        mesh = other.levels[0]
        tint = mesh.colour_srgb[mesh.triangles[mesh.triangle_material == top]]
        picture = other.materials[top].texture_srgb
        assert picture is not None
        seen = tint.reshape(-1, 3).mean(axis=0) * picture.reshape(-1, 3).mean(axis=0)
        off = [np.ptp(seen / colour) / (seen / colour).mean() for colour in TOPS]
        assert min(off) == pytest.approx(0, abs=0.08), outfit


@pytest.mark.parametrize("name", cast_names())
def test_shade_keeps_the_hue_of_cloth_in_other_clothes(name: str) -> None:
    """A light colour cut off at 255 in lit places alone left brown stains below collars."""
    character = load_character(name)
    own = character.levels[0]
    for outfit in range(1, 9):
        other = in_other_clothes(character, outfit).levels[0]
        for i, material in enumerate(character.materials):
            if material.name not in {"top", "bottom", "shoe"}:
                continue
            used = np.unique(own.triangles[own.triangle_material == i])
            bright = used[own.colour_srgb[used].min(axis=1) > 60]
            if not len(bright) or other.colour_srgb[bright].min() < 40:
                continue  # too dark: steps of one in 255 are much of it
            share = other.colour_srgb[bright] / own.colour_srgb[bright]
            hue = share / share[:, :1]
            assert np.ptp(hue / hue.mean(axis=0), axis=0) == pytest.approx(0, abs=0.06), outfit


@needs_avatars
def test_valid_people_keep_skin_hair_and_shoes_in_other_clothes() -> None:
    for path in avatar_files()[2:4]:
        person = import_gltf(path)
        own, mesh = shown(person), person.levels[0]
        kind = np.array([m.kind for m in person.materials])[mesh.triangle_material]
        part = mesh.triangle_part
        never = np.isin(part, [PART_INDEX[p] for p in ("face", "scalp")]) | (kind != "cloth")
        never &= part != PART_INDEX["torso"]
        upper = np.isin(part, [PART_INDEX[p] for p in ("torso", "left_thigh", "right_thigh")])
        for outfit in (1, 2, 3):
            changed = np.linalg.norm(shown(in_other_clothes(person, outfit)) - own, axis=1)
            assert 0.02 > (changed[never] > 12).mean(), path.stem
            feet = np.isin(part, [PART_INDEX["left_foot"], PART_INDEX["right_foot"]])
            assert 0.2 > (changed[feet] > 12).mean(), path.stem
            hands = np.isin(part, [PART_INDEX["left_hand"], PART_INDEX["right_hand"]])
            assert 0.4 > (changed[hands] > 12).mean(), path.stem
            assert 0.25 < (changed[upper & (kind == "cloth")] > 30).mean(), path.stem

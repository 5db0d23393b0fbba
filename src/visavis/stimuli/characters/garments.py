"""Find the garments painted on an imported person's picture, and paint them in other colours.

One picture of such a figure often covers skin, clothes, shoes and hair at once. A garment is what
lies on trunk or limbs in one colour that nothing of the skin has; what looks like skin, and
everything else (collars, ties, trims, shoes, hair), stays as authored.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import Character

GarmentKind = Literal["top", "bottom", "whole"]
Colour = tuple[int, int, int]
Pixels = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Weights = npt.NDArray[np.float32]

MAX_SIDE_PX: Final = 1024
"""Largest side of recoloured pictures: 2 mm of cloth a pixel in a VALID figure."""
CHROMA_WITHIN: Final = 14.0
LIGHT_WITHIN: Final = 80.0
"""How far, in 8-bit codes of Cb and Cr together and of luma, a garment reaches from its colour."""
SURE_01: Final = 0.6
"""Up to this part of the reach a pixel is wholly of the garment."""
MIN_SHARE_01: Final = 0.4
"""Least share of the non-skin pixels with one colour; below it there is no ground colour."""
MIN_AREA_01: Final = 0.15
"""Least share of a region that a garment covers; below it the region is bare."""
MAX_SKIN_01: Final = 0.03
"""Largest share of the skin of face, neck and hands that may look like a garment."""
SAME_GARMENT: Final = 16.0
"""Ground colours of top and bottom nearer than this are one garment: a suit, a dress."""
BARE_CHROMA: Final = 22.0
"""Cloth whose chroma is nearer than this to that of skin may look bare."""
WHITE: Final = 250
DEEPENING_01: Final = (0.4, 1.7)
"""Between these parts of the ground's, its chroma may change with folds and wear."""
SETTLING_ROUNDS: Final = 5
SEAM_PX: Final = 4
BARE: Final = 32
BESIDE: Final = 64
"""Added to the part of a pixel: it is on skin; it can be of no garment."""
HALF_WIDTH_PX: Final = 12.0
MAX_BETWEEN_01: Final = 0.03
"""Cloth narrower than twice this between other things is part of them, as stripes of a tie are,
unless there is so much of it that it is the ground of a pattern."""
_TOP: Final = ("torso", "left_upper_arm", "right_upper_arm", "left_forearm", "right_forearm")
_BOTTOM: Final = ("left_thigh", "right_thigh", "left_shin", "right_shin")
_NEVER: Final = ("none", "face", "left_eye", "right_eye", "scalp", "held_object")
_SKIN: Final = ("face", "neck", "left_hand", "right_hand")
_LUMA: Final = np.array([0.299, 0.587, 0.114], np.float32)


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment on a picture: `share_01` (h, w) of each pixel that it is, its ground colour."""

    kind: GarmentKind
    ground_srgb: Vector
    share_01: Weights


@dataclass(frozen=True, eq=False)
class _Ground:
    """A colour as luma, Cb and Cr (3,); where it `fades`, its chroma is not alike all over."""

    tone: Weights
    fades: bool = False


@dataclass(frozen=True, eq=False)
class Wardrobe:
    """The garments on one picture of a person; `picture` (h, w, 3 or 4) as small as it is painted.

    `materials` are the numbers of those that show it on a garment. Where `has_tint` the picture
    bears the colour that their vertices had. `skins` (s, 3) are luma, Cb and Cr of bare skin.
    """

    picture: Pixels
    garments: tuple[Garment, ...]
    materials: tuple[int, ...]
    skins: Weights
    has_tint: bool = False


@cache
def wardrobe_of(character: Character) -> tuple[Wardrobe, ...]:
    """Return the garments that can be recognised with confidence, one wardrobe a picture.

    A cloth without a picture, or one that is tinted, counts where it is of one colour and no skin
    shares its picture.
    """
    together: dict[int, list[int]] = {}
    for i, material in enumerate(character.materials):
        if material.kind == "cloth":
            picture = material.texture_srgb
            together.setdefault(-i - 1 if picture is None else id(picture), []).append(i)
    wardrobes = (_wardrobe(character, cloth) for cloth in together.values())
    return tuple(wardrobe for wardrobe in wardrobes if wardrobe is not None)


def looks_bare(wardrobe: Wardrobe, colour: Colour) -> bool:
    """Return whether cloth of a colour could look like the person's skin."""
    tone = np.array(Image.new("RGB", (1, 1), colour).convert("YCbCr").getpixel((0, 0)), float)
    difference = np.abs(wardrobe.skins - tone)
    far = np.hypot(difference[:, 1], difference[:, 2]) > BARE_CHROMA
    return bool((~far & (difference[:, 0] < LIGHT_WITHIN)).any())


def paint_wardrobe(wardrobe: Wardrobe, colours: Mapping[GarmentKind, Colour]) -> Pixels:
    """Return a wardrobe's picture, its garments in other colours (sRGB); shades stay."""
    out = wardrobe.picture.copy()
    for garment in wardrobe.garments:
        at = garment.share_01 > 0
        share = garment.share_01[at][:, None]
        own = out[at][:, :3].astype(np.float32)
        to = np.asarray(colours[garment.kind], np.float32)
        ground, aim = float(garment.ground_srgb @ _LUMA), float(to @ _LUMA)
        # Shades are kept as parts of the lighter of both: dark cloth made light is not made noisy.
        gain = 1.0 + (own @ _LUMA - ground) / max(ground, aim, 24.0)
        new = to * np.clip(gain, 0.0, 2.0)[:, None]
        out[at, :3] = np.round(np.clip(own + share * (new - own), 0, 255)).astype(np.uint8)
    return out


def _wardrobe(character: Character, cloth: list[int]) -> Wardrobe | None:
    mesh = character.levels[0]
    picture = character.materials[cloth[0]].texture_srgb
    materials = [i for i, m in enumerate(character.materials) if m.texture_srgb is picture]
    if picture is None:
        materials, picture = cloth, np.full((1, 1, 3), 255, np.uint8)
    mine = np.isin(mesh.triangle_material, materials)
    kinds = np.array([m.kind for m in character.materials])[mesh.triangle_material]
    on_body = mine & np.isin(kinds, ["skin", "cloth"])
    tint = mesh.colour_srgb[mesh.triangles[on_body]].reshape(-1, 3)
    if mesh.uv is None or not len(tint):
        return None
    small = _at_most(picture, MAX_SIDE_PX)
    has_tint = bool(tint.min() < WHITE)
    if has_tint:
        if np.ptp(tint, axis=0).max() > 255 - WHITE or (kinds[mine] != "cloth").any():
            return None
        small = small.copy()
        small[..., :3] = np.round(small[..., :3] * (tint.mean(axis=0) / 255))
    parts = mesh.triangle_part.astype(np.int64)
    # Shoes are separate islands; the part of a trouser leg that moves with the foot is not one.
    island = _islands(mesh.triangles)
    feet = np.isin(parts, [PART_INDEX["left_foot"], PART_INDEX["right_foot"]])
    share = np.bincount(island, feet) / np.maximum(np.bincount(island), 1)
    can_be = on_body & ~(share[island] > 0.5)
    can_be &= ~np.isin(parts, [PART_INDEX[name] for name in _NEVER])
    codes = parts + BARE * (kinds == "skin") + BESIDE * ~can_be
    # What lies beside a garment is drawn last, so that no seam runs over it.
    order = np.concatenate([np.flatnonzero(can_be), np.flatnonzero(mine & ~can_be)])
    tag_codes = _tag_image(mesh.uv, mesh.triangles[order], codes[order], small.shape[:2])
    tags = np.where(tag_codes < BESIDE, tag_codes % BARE, 0).astype(np.uint8)
    on_skin = np.where(tag_codes & BARE > 0, tag_codes % BARE, 0)
    tones = np.asarray(Image.fromarray(small[..., :3]).convert("YCbCr")).astype(np.float32)
    skin_tones = [tones[on_skin == PART_INDEX[name]] for name in _SKIN]
    skins = [_like_most(tone) for tone in skin_tones if len(tone)]
    garments = _garments(tones, tags, skins)
    if not garments:
        return None
    is_garment = np.logical_or.reduce([garment.share_01 > 0 for garment in garments])
    showing = on_body & _touch_pixels(mesh.uv, mesh.triangles, is_garment)
    return Wardrobe(
        small,
        garments,
        tuple(np.unique(mesh.triangle_material[showing]).tolist()),
        np.array([np.median(skin, axis=0) for skin in skins], np.float32).reshape(-1, 3),
        has_tint,
    )


def _garments(
    tones: Weights, tags: npt.NDArray[np.uint8], skins: list[Weights]
) -> tuple[Garment, ...]:
    """Return what of trunk and limbs is a garment; `skins` are tones (n, 3) that are bare."""
    bare = [_Ground(np.median(skin, axis=0)) for skin in skins]
    grounds: dict[GarmentKind, _Ground] = {}
    regions: tuple[tuple[GarmentKind, tuple[str, ...]], ...] = (("top", _TOP), ("bottom", _BOTTOM))
    for garment_kind, names in regions:
        region = np.isin(tags, [PART_INDEX[name] for name in names])
        worn_there = tones[region]
        area = len(worn_there)
        for skin in bare:
            worn_there = worn_there[_share(worn_there, skin) == 0]
        if len(worn_there) >= MIN_AREA_01 * max(area, 1):
            ground = _ground(worn_there, skins)
            if ground is not None:
                grounds[garment_kind] = ground
    if len(grounds) == 2:
        top, bottom = grounds["top"], grounds["bottom"]
        if np.linalg.norm(top.tone - bottom.tone) < SAME_GARMENT:
            grounds = {"whole": top}
    shares: dict[GarmentKind, Weights] = {}
    for garment_kind, ground in grounds.items():
        shares[garment_kind] = np.zeros(tags.shape, np.float32)
        shares[garment_kind][tags > 0] = _share(tones[tags > 0], ground)
    garments = []
    is_other = tags > 0
    for theirs in shares.values():
        is_other &= theirs <= 0.5
    for garment_kind, ground in grounds.items():
        others = [theirs for other, theirs in shares.items() if other != garment_kind]
        nearest = np.logical_and.reduce(
            [shares[garment_kind] >= theirs for theirs in others], axis=0
        )
        share = _connected_share(
            np.where(nearest, shares[garment_kind], 0), tags, is_other, garment_kind
        )
        garments.append(Garment(garment_kind, _srgb_of(ground.tone), share))
    return tuple(garments)


def _ground(tones: Weights, skins: list[Weights]) -> _Ground | None:
    """Return the one colour that most of what is worn has and no skin; None where there is none."""
    bins = (tones / [16.0, 8.0, 8.0]).astype(np.int64)
    code = (bins[:, 0] * 64 + bins[:, 1]) * 64 + bins[:, 2]
    values, counts = np.unique(code, return_counts=True)
    tone: Weights = np.median(tones[code == values[counts.argmax()]], axis=0)
    for _ in range(SETTLING_ROUNDS):
        tone = np.median(tones[_share(tones, _Ground(tone)) > 0], axis=0)
    for ground in (_Ground(tone, fades=True), _Ground(tone)):
        most = (_share(tones, ground) > 0.5).mean() >= MIN_SHARE_01
        if most and all((_share(skin, ground) > 0.1).mean() <= MAX_SKIN_01 for skin in skins):
            return ground
    return None


def _share(tones: Weights, ground: _Ground) -> Weights:
    """Return how much of tones (..., 3) is of that ground: 1 near it, 0 beyond its reach."""
    own = ground.tone.astype(np.float32)
    difference = tones - own
    if ground.fades:
        chroma = own[1:] - 128.0
        strength = max(float(np.linalg.norm(chroma)), 1.0)
        along = difference[..., 1:] @ (chroma / strength)
        fainter, stronger = (strength * (share - 1.0) for share in DEEPENING_01)
        within = np.clip(along, fainter, stronger)
        difference[..., 1:] -= within[..., None] * (chroma / strength)
    far = np.hypot(
        np.hypot(difference[..., 1], difference[..., 2]) / CHROMA_WITHIN,
        difference[..., 0] / LIGHT_WITHIN,
    )
    x = np.clip((1.0 - far) / (1.0 - SURE_01), 0.0, 1.0)
    share: Weights = (x * x * (3.0 - 2.0 * x)).astype(np.float32)
    return share


def _like_most(skin: Weights) -> Weights:
    """Leave out brows, lips and what else on skin is unlike most of it."""
    return skin[_share(skin, _Ground(np.median(skin, axis=0))) > 0]


def _srgb_of(tone: Weights) -> Vector:
    y, cb, cr = np.round(tone).astype(int).tolist()
    return np.array(Image.new("YCbCr", (1, 1), (y, cb, cr)).convert("RGB").getpixel((0, 0)), float)


def _connected_share(
    share: Weights, tags: npt.NDArray[np.uint8], is_other: Mask, kind: GarmentKind
) -> Weights:
    """Leave out what hangs together with nothing where such a garment is worn (socks, nails), and
    what only looks like it between other things: stripes of a tie.
    """
    from scipy import ndimage  # imported here, because pictures of other people do not need it

    where = {"top": _TOP, "bottom": _BOTTOM, "whole": _TOP + _BOTTOM}[kind]
    is_garment = share > 0.5
    between = _between_others(is_garment, is_other)
    is_garment &= ~between
    label, n = ndimage.label(is_garment, structure=np.ones((3, 3)))
    worn_there = np.isin(tags, [PART_INDEX[name] for name in where])
    is_worn = np.bincount(label.ravel(), worn_there.ravel(), n + 1) > 0
    is_worn[0] = False
    near = ndimage.binary_dilation(is_worn[label], iterations=SEAM_PX)
    near_share: Weights = np.where(near & ~between, share, 0).astype(np.float32)
    return near_share


def _between_others(is_garment: Mask, is_other: Mask) -> Mask:
    """Return which pixels are narrow pieces whose rim mostly touches what is not a garment, though
    they look like the garment and may hang together with it.
    """
    from scipy import ndimage  # late, as above

    inner = ndimage.distance_transform_edt(is_garment) > HALF_WIDTH_PX
    wide = ndimage.distance_transform_edt(~inner) <= HALF_WIDTH_PX
    narrow, n = ndimage.label(is_garment & ~wide)
    rim, others_on_rim = np.zeros(n + 1), np.zeros(n + 1)
    for axis in (0, 1):
        for step in (-1, 1):
            leaves = (narrow > 0) & (np.roll(narrow, step, axis) == 0)
            rim += np.bincount(narrow[leaves], minlength=n + 1)
            others_on_rim += np.bincount(
                narrow[leaves], np.roll(is_other, step, axis)[leaves], minlength=n + 1
            )
    between: Mask = (others_on_rim > 0.5 * np.maximum(rim, 1))[narrow]
    if between.sum() >= MAX_BETWEEN_01 * is_garment.sum():
        between[:] = False
    return between


def _islands(triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    """Return on which piece of the picture triangles lie (t,): those that share vertices."""
    from scipy.sparse import coo_matrix  # late, as above
    from scipy.sparse.csgraph import connected_components

    n = int(triangles.max()) + 1 if len(triangles) else 0
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    island_of: npt.NDArray[np.int64] = label[triangles[:, 0]].astype(np.int64)
    return island_of


def _tag_image(
    uv: npt.NDArray[np.float32],
    triangles: npt.NDArray[np.int32],
    tags: npt.NDArray[np.int64],
    shape: tuple[int, int],
) -> npt.NDArray[np.uint8]:
    """Return the tag at each pixel (h, w), extended a few pixels beyond seams; 0 where there is
    none.
    """
    from scipy import ndimage  # late, as above

    height, width = shape
    image = Image.new("L", (width, height))
    draw = ImageDraw.Draw(image)
    corners = uv[triangles].astype(np.float64)
    corners -= np.floor(corners.mean(axis=1, keepdims=True))
    at = corners * [width, height] - 0.5
    for points, tag in zip(at.reshape(-1, 6).tolist(), tags.tolist(), strict=True):
        draw.polygon(points, fill=tag)
    drawn_tags = np.asarray(image)
    away, (row, column) = ndimage.distance_transform_edt(drawn_tags == 0, return_indices=True)
    tags_near: npt.NDArray[np.uint8] = np.where(away <= SEAM_PX, drawn_tags[row, column], 0)
    return tags_near


def _touch_pixels(
    uv: npt.NDArray[np.float32], triangles: npt.NDArray[np.int32], is_garment: Mask
) -> Mask:
    height, width = is_garment.shape
    places = uv[triangles]
    places = np.concatenate([places, places.mean(axis=1, keepdims=True)], axis=1)
    column = np.floor(places[..., 0] % 1.0 * width).astype(np.int64) % width
    row = np.floor(places[..., 1] % 1.0 * height).astype(np.int64) % height
    touches: Mask = is_garment[row, column].any(axis=1)
    return touches


def _at_most(picture: Pixels, side_px: int) -> Pixels:
    factor = -(-max(picture.shape[:2]) // side_px)
    return picture if factor == 1 else np.asarray(Image.fromarray(picture).reduce(factor))

"""Levels of characters as the arrays that the processor moves and lights."""

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.stage.card.shaders.people import KINDS
from visavis.stage.card.textures import Layers
from visavis.stage.card.vertices import PersonVertices, Run, TextureArray
from visavis.stage.processor.vertex_light import EYE_KIND, Floats
from visavis.stimuli.characters.character import MORPHS

WRAPS = {"skin": (0.34, 0.17, 0.11), "hair": (0.3, 0.3, 0.3)}
OTHER_WRAP = (0.12, 0.12, 0.12)
"""How far light bleeds round an edge, per colour, as in `glsl_people`."""
SHELLS = tuple(KINDS.index(name) for name in ("skin", "cloth", "leather"))
MAX_THUMBNAIL_PX = 128
_codes = np.arange(256) / 255
LINEAR_OF_CODE: Floats = np.where(
    _codes <= 0.04045, _codes / 12.92, ((_codes + 0.055) / 1.055) ** 2.4
).astype(np.float32)

STILL_VERTEX = np.dtype(
    [("detail", "<f4", (3,)), ("colour", "u1", (4,)), ("surface", "u1", (4,)), ("person", "<u4")]
)
STILL_LAYOUT = ("3f4 4f1 4u1 1u4", "in_detail", "in_colour", "in_surface", "in_person")
POSED_LAYOUT = ("3f4 3f4", "in_place", "in_light")


@dataclass(frozen=True, order=True)
class Group:
    """What one draw call draws: eyes or all else, textured from which array (−1: none)."""

    eye: bool
    array: int
    double_sided: bool

    def run(self, channels: int | None) -> Run:
        """Return a run of this look, by which its program is chosen."""
        texture = None if channels is None else np.zeros((1, 1, channels), np.uint8)
        return Run(0, 0, texture, self.double_sided, "eye" if self.eye else "other")


PLAIN = Group(eye=False, array=-1, double_sided=False)


@dataclass(frozen=True, eq=False)
class Model:
    """One level of one character, v vertices. `still` is what never moves, STILL_VERTEX;
    `column` (v, 4) is the first texel of each joint; `wrap` (v, 6) bleeding and its share;
    `albedo` and `plain_albedo` (v, 3) are linear, the latter with the texture in it.
    """

    still: npt.NDArray[np.void]
    rest: Floats
    normal: Floats
    column: npt.NDArray[np.int32]
    weight: Floats
    morph: npt.NDArray[np.int32]
    deltas: Floats
    albedo: Floats
    plain_albedo: Floats
    wrap: Floats
    kind: npt.NDArray[np.uint8]
    has_picture: npt.NDArray[np.bool_]
    triangles: dict[Group, npt.NDArray[np.int32]]


def model(level: PersonVertices, layers: Layers, *, is_finest: bool) -> Model:
    """Rearrange a level: neighbouring vertices lie together, triangles are sorted by how they are
    drawn. Of people at their finest the insides of clothes are drawn, too: one looks into sleeves.
    """
    order = _by_place(level)
    back = np.empty(len(order), np.int32)
    back[order] = np.arange(len(order), dtype=np.int32)
    source = level.vertices[order]
    n = len(source)
    still = np.zeros(n, STILL_VERTEX)
    for name in ("detail", "colour", "surface"):
        still[name] = source[name]
    albedo = linear_light(source["colour"][:, :3])
    plain_albedo, has_picture = albedo.copy(), np.zeros(n, np.bool_)
    kind = source["surface"][:, 0] % len(KINDS)
    triangles: dict[Group, list[npt.NDArray[np.int32]]] = {}
    for run in level.runs:
        corners = back[level.indices[run.first : run.first + run.count]].reshape(-1, 3)
        vertices_used = np.unique(corners)
        array = -1
        if run.texture is not None:
            array, layer = layers.place(run.texture)
            has_picture[vertices_used] = True
            uv = still["detail"][:, :2]
            side_px = _side_px(uv[corners])
            plain_albedo[vertices_used] *= linear_light(
                _colours_at(run.texture, uv[vertices_used], side_px)
            )
            still["detail"][vertices_used, 2] = layer
        # Farther away nobody sees the inside of skin, shoes and clothes; sheets have two sides.
        cut_out = run.texture is not None and run.texture.shape[2] == 4
        is_shell = not is_finest and bool(np.isin(kind[vertices_used], SHELLS).all())
        thin = run.double_sided and (cut_out or not is_shell)
        triangles.setdefault(Group(run.kind == "eye", array, thin), []).append(corners)
    wrap = np.array([WRAPS.get(name, OTHER_WRAP) for name in KINDS], np.float32)[kind]
    weight, joints = source["weights"].astype(np.float32), source["joints"]
    heaviest = np.argsort(-weight, axis=1, kind="stable")
    weight = np.take_along_axis(weight, heaviest, axis=1)
    return Model(
        still,
        np.ascontiguousarray(source["rest_m"]),
        source["normal"][:, :3].astype(np.float32),
        3 * np.take_along_axis(joints, heaviest, axis=1).astype(np.int32),
        weight,
        source["morph"].astype(np.int32),
        np.ascontiguousarray(level.deltas[:, : len(MORPHS), :3]),
        albedo,
        plain_albedo,
        np.concatenate([wrap, 1 / (1 + wrap) ** 2], axis=1).astype(np.float32),
        np.where(kind == KINDS.index("eye"), EYE_KIND, kind).astype(np.uint8),
        has_picture,
        {group: _local(np.concatenate(parts)) for group, parts in triangles.items()},
    )


def coarser(fine: Model, cell_m: float) -> Model:
    """Return a model for people so far away that vertices within a cell of their surface cannot be
    told apart: they become one, unless they face different ways or are drawn differently.
    """
    group_of = np.zeros(len(fine.rest), np.int64)
    for k, corners in enumerate(fine.triangles.values()):
        group_of[corners] = k
    cell = np.floor(fine.rest / cell_m).astype(np.int64)
    widest = np.abs(fine.normal).argmax(axis=1)
    forward = np.take_along_axis(fine.normal, widest[:, None], axis=1)[:, 0] > 0
    cluster_key = np.stack([*cell.T, widest, forward, group_of, fine.kind], axis=1)
    # Eyes stay whole: they are small already, and nothing lies behind them.
    cluster_key[fine.kind == EYE_KIND, 0] = 1000 + np.flatnonzero(fine.kind == EYE_KIND)
    _, cluster = np.unique(cluster_key, axis=0, return_inverse=True)
    cluster = cluster.ravel()
    many = np.bincount(cluster)
    middle = np.stack([np.bincount(cluster, fine.rest[:, k]) / many for k in range(3)], axis=1)
    off = np.linalg.norm(fine.rest - middle[cluster], axis=1)
    order = np.lexsort((off, cluster))
    first = order[np.searchsorted(cluster[order], np.arange(len(many)))]
    colour = np.stack(
        [np.bincount(cluster, fine.plain_albedo[:, k]) / many for k in range(3)], axis=1
    )
    representatives = np.sort(first)
    back = np.empty(len(many), np.int32)
    back[cluster[representatives]] = np.arange(len(representatives), dtype=np.int32)
    triangles: dict[Group, npt.NDArray[np.int32]] = {}
    for group, corners in fine.triangles.items():
        merged_corners = back[cluster[corners]]
        a, b, c = np.sort(merged_corners, axis=1).T
        _, once = np.unique(np.stack([a, b, c], axis=1), axis=0, return_index=True)
        triangles[group] = merged_corners[np.sort(once[(a != b)[once] & (b != c)[once]])]
    columns = {
        f.name: getattr(fine, f.name)[representatives]
        for f in fields(Model)
        if f.name not in ("deltas", "triangles")
    }
    columns["plain_albedo"] = colour[cluster[representatives]].astype(np.float32)
    return Model(**columns, deltas=fine.deltas, triangles=triangles)


def _by_place(level: PersonVertices) -> npt.NDArray[np.int64]:
    """Return an order of the vertices in which neighbours on the body are near each other."""
    rest = level.vertices["rest_m"]
    span = np.ptp(rest, axis=0).max() + 1e-6
    cell = ((rest - rest.min(axis=0)) / span * 63).astype(np.int64)
    code = np.zeros(len(rest), np.int64)
    for bit in range(6):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _local(triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    return triangles[np.argsort(triangles.min(axis=1), kind="stable")]


def linear_light(codes: npt.NDArray[np.uint8]) -> Floats:
    """Return the linear light of sRGB codes."""
    return LINEAR_OF_CODE[codes]


def _side_px(corners: Floats) -> int:
    """Return the side of a thumbnail whose pixels are as large as triangles (t, 3, 2) on it."""
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    edge = float(np.percentile(length, 75))
    return int(np.clip(round(1 / max(edge, 1e-3)), 1, MAX_THUMBNAIL_PX))


def _colours_at(texture: TextureArray, uv: Floats, side_px: int) -> TextureArray:
    """Return the mean colours (k, 3) of a texture around places in it."""
    image = Image.fromarray(np.ascontiguousarray(texture[..., :3]))
    thumbnail = np.asarray(image.resize((side_px, side_px), Image.Resampling.BOX))
    at = np.floor(uv % 1.0 * side_px).astype(np.int64) % side_px
    colours: TextureArray = thumbnail[at[:, 1], at[:, 0]]
    return colours

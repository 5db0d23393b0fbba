"""Lay a character or a room out as the vertices a graphics card reads."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.stage.card.shaders.people import KINDS, SHADERS
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import MORPHS, Character, Maps, Material, SkinnedMesh
from visavis.stimuli.characters.skin_tone import skin_of_face_01
from visavis.stimuli.picture import Prop

PERSON_VERTEX = np.dtype(
    [
        ("rest_m", "<f4", (3,)),
        ("normal", "<f2", (4,)),
        ("detail", "<f4", (3,)),
        ("colour", "u1", (4,)),
        ("surface", "u1", (4,)),
        ("joints", "u1", (4,)),
        ("weights", "<f2", (4,)),
        ("morph", "<i4"),
    ]
)
ROOM_VERTEX = np.dtype(
    [
        ("place_m", "<f4", (3,)),
        ("normal", "<f2", (4,)),
        ("colour", "u1", (4,)),
        ("look", "u1", (4,)),
        ("uv", "<f4", (2,)),
    ]
)
ROOM_LAYOUT = ("3f4 4f2 4f1 4f1 2f4", "in_place_m", "in_normal", "in_colour", "in_look", "in_uv")

SKIN_STEPS = 32
"""How finely eyes are told the lightness of the skin about them, in the bits above their kind."""

TextureArray = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Run:
    """Triangles drawn alike: `first` and `count` are counted in indices, `kind` is a shader's."""

    first: int
    count: int
    texture: TextureArray | None
    double_sided: bool
    kind: str = "other"
    maps: Maps | None = None

    @property
    def is_solid(self) -> bool:
        """Whether it hides all that is behind it."""
        return self.texture is None or self.texture.shape[2] < 4


@dataclass(frozen=True, eq=False)
class PersonVertices:
    """One level of a character: `vertices` of PERSON_VERTEX, `indices` (k,) int32 in runs.

    `deltas` (m, 8, 4) float32 are the displacements of the vertices whose `morph` is not −1, in
    the order of MORPHS (one spare).
    """

    vertices: npt.NDArray[np.void]
    indices: npt.NDArray[np.int32]
    runs: tuple[Run, ...]
    deltas: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class RoomVertices:
    """Props of one look: `vertices` of ROOM_VERTEX, `indices` (k,) int32, runs; `shadow_count`
    indices from the start belong to props that cast shadows.
    """

    vertices: npt.NDArray[np.void]
    indices: npt.NDArray[np.int32]
    runs: tuple[Run, ...]
    casting: tuple[tuple[int, int], ...]


def person_vertices(character: Character, mesh: SkinnedMesh) -> PersonVertices:
    """Split a mesh where part or material changes, and order its triangles into runs."""
    materials = character.materials
    material_of, part_of = mesh.triangle_material, mesh.triangle_part
    eyes = _eye_sides(character, mesh)
    looks: dict[tuple[object, ...], list[int]] = {}
    for i in np.unique(material_of).tolist():
        texture = materials[i].texture_srgb if materials[i].kind != "eye" else None
        shader = materials[i].kind if materials[i].kind in SHADERS else "other"
        maps = materials[i].maps if texture is not None else None
        key = (shader, id(texture), materials[i].double_sided, *_identities(maps))
        looks.setdefault(key, []).append(i)
    order, runs, first = [], [], 0
    # Surfaces with holes or soft edges come last, so that they are blended over the rest.
    for members in sorted(looks.values(), key=lambda of: _opacity_rank(materials, of)):
        first_of = materials[members[0]]
        shader = first_of.kind if first_of.kind in SHADERS else "other"
        triangles_of_run = np.flatnonzero(np.isin(material_of, members))
        order.append(triangles_of_run)
        texture = first_of.texture_srgb if shader != "eye" else None
        maps = first_of.maps if texture is not None else None
        count = 3 * len(triangles_of_run)
        runs.append(Run(first, count, texture, first_of.double_sided, shader, maps))
        first += count
    rows = np.concatenate(order) if order else np.zeros(0, np.int64)
    corners = mesh.triangles[rows].astype(np.int64)
    tags = part_of[rows].astype(np.int64) * 256 + material_of[rows]
    keys = corners * 65536 + tags[:, None]
    unique, indices = np.unique(keys, return_inverse=True)
    source, part, material = unique // 65536, unique // 256 % 256, unique % 256

    out = np.zeros(len(unique), PERSON_VERTEX)
    out["rest_m"] = mesh.vertices_m[source]
    out["normal"][:, :3] = mesh.normals[source]
    out["colour"][:, :3] = mesh.colour_srgb[source]
    out["joints"] = mesh.joints[source]
    out["weights"] = mesh.weights[source]
    out["detail"] = out["rest_m"]
    out["surface"][:, 0] = np.array([KINDS.index(m.kind) for m in materials], np.uint8)[material]
    roughness = np.array([m.roughness_01 for m in materials])
    out["surface"][:, 1] = np.round(np.clip(roughness, 0, 1) * 255)[material]
    out["surface"][:, 2] = part
    if mesh.uv is not None:
        # Kind + 128: vertex lighting leaves these vertices to the pixels.
        has_texture = np.array([m.texture_srgb is not None and m.kind != "eye" for m in materials])
        triangles_of_run = has_texture[material]
        out["detail"][triangles_of_run, :2] = mesh.uv[source[triangles_of_run]]
        out["surface"][triangles_of_run, 0] |= 128
    is_eye = np.array([m.kind == "eye" for m in materials], bool)[material]
    _place_irises(out, character, eyes[source], is_eye)
    deltas = _morph_rows(out, mesh, source)
    return PersonVertices(out, indices.ravel().astype(np.int32), tuple(runs), deltas)


def _identities(maps: Maps | None) -> tuple[int, ...]:
    if maps is None:
        return ()
    return tuple(id(p) for p in (maps.normal, maps.surface, maps.glow_srgb, maps.sheen_srgb))


def _opacity_rank(materials: tuple[Material, ...], members: list[int]) -> int:
    ranks = {"lash": 3, "hair": 2}
    return max(
        ranks.get(m.kind, 1 if m.texture_srgb is not None else 0)
        for m in (materials[i] for i in members)
    )


def _eye_sides(character: Character, mesh: SkinnedMesh) -> npt.NDArray[np.int64]:
    """Return for every vertex whether it belongs to the left (0) or right (1) eye."""
    side = np.zeros(len(mesh.vertices_m), np.int64)
    right = mesh.triangle_part == PART_INDEX["right_eye"]
    side[mesh.triangles[right].ravel()] = 1
    return side


def _place_irises(
    out: npt.NDArray[np.void],
    character: Character,
    side: npt.NDArray[np.int64],
    is_eye: npt.NDArray[np.bool_],
) -> None:
    """Give eyeballs their place in the eye's own axes, in radii, instead of a texture."""
    skeleton, ball = character.skeleton, character.eyeball
    if ball is None or not is_eye.any():
        return
    centres = skeleton.rest_m[[skeleton.index("left_eye"), skeleton.index("right_eye")]]
    local = (out["rest_m"][is_eye] - centres[side[is_eye]]) / ball.radius_m
    out["detail"][is_eye] = local
    length = np.maximum(np.linalg.norm(local, axis=1, keepdims=True), 1e-6)
    normals = out["normal"][is_eye]
    normals[:, :3] = local / length
    out["normal"][is_eye] = normals
    surface = out["surface"][is_eye]
    surface[:, 0] += np.uint8(len(KINDS) * round((SKIN_STEPS - 1) * skin_of_face_01(character)))
    surface[:, 1] = round(255 * min(1.0, ball.iris_radius_m / ball.radius_m))
    surface[:, 3] = round(255 * min(1.0, ball.pupil_radius_m / ball.radius_m))
    out["surface"][is_eye] = surface
    colour = out["colour"][is_eye]
    colour[:, :3] = ball.iris_srgb
    out["colour"][is_eye] = colour


def _morph_rows(
    out: npt.NDArray[np.void], mesh: SkinnedMesh, source: npt.NDArray[np.int64]
) -> npt.NDArray[np.float32]:
    all_deltas = np.zeros((len(mesh.vertices_m), 8, 4), np.float32)
    for k, name in enumerate(MORPHS):
        morph = mesh.morphs.get(name)
        if morph is not None:
            all_deltas[morph.vertices, k, :3] = morph.delta_m
    moving = np.abs(all_deltas).max(axis=(1, 2)) > 1e-6
    moving_out = moving[source]
    out["morph"] = -1
    out["morph"][moving_out] = np.arange(int(moving_out.sum()))
    deltas: npt.NDArray[np.float32] = all_deltas[source[moving_out]]
    return deltas if len(deltas) else np.zeros((1, 8, 4), np.float32)


def room_vertices(props: tuple[Prop, ...]) -> RoomVertices:
    """Join props that share a texture into runs."""
    groups: dict[tuple[int, bool], list[Prop]] = {}
    for prop in props:
        texture = prop.material.texture_srgb if prop.mesh.uv is not None else None
        key = (id(texture) if texture is not None else 0, prop.material.double_sided)
        groups.setdefault(key, []).append(prop)
    vertices, indices, runs, casting = [], [], [], []
    base = first = 0
    # Those whose pictures have one shape follow one another, so that one call can draw them.
    for (texture_id, double_sided), members in sorted(groups.items(), key=_shape_of):
        count = 0
        for prop in members:
            mesh = prop.mesh
            out = np.zeros(len(mesh.vertices_m), ROOM_VERTEX)
            out["place_m"] = mesh.vertices_m
            out["normal"][:, :3] = mesh.normals
            out["colour"][:, :3] = mesh.colour_srgb
            out["look"][:, 0] = round(255 * min(1.0, max(0.0, prop.material.roughness_01)))
            out["look"][:, 1] = round(255 * min(1.0, max(0.0, prop.emission_01)))
            if mesh.uv is not None:
                out["uv"] = mesh.uv
            vertices.append(out)
            corners = mesh.triangles.ravel().astype(np.int32) + base
            indices.append(corners)
            if prop.casts_shadow and len(corners):
                casting.append((first + count, len(corners)))
            base += len(out)
            count += len(corners)
        texture = members[0].material.texture_srgb if texture_id else None
        runs.append(Run(first, count, texture, double_sided))
        first += count
    return RoomVertices(
        np.concatenate(vertices) if vertices else np.zeros(0, ROOM_VERTEX),
        np.concatenate(indices) if indices else np.zeros(0, np.int32),
        tuple(runs),
        join_stretches(casting),
    )


def _shape_of(group: tuple[tuple[int, bool], list[Prop]]) -> tuple[bool, tuple[int, ...]]:
    (texture_id, double_sided), members = group
    texture = members[0].material.texture_srgb if texture_id else None
    return double_sided, () if texture is None else texture.shape


def join_stretches(stretches: list[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    """Join stretches that follow one another."""
    out: list[tuple[int, int]] = []
    for first, count in stretches:
        if out and sum(out[-1]) == first:
            out[-1] = (out[-1][0], out[-1][1] + count)
        else:
            out.append((first, count))
    return tuple(out)

"""Build one person of the default cast from a recipe."""

from dataclasses import replace

import numpy as np

from lab.geometry import Vector
from stimuli.characters.body_parts import PART_INDEX
from stimuli.characters.capsules import fitted_capsules
from stimuli.characters.character import Character, Eyeball, Material, SkinnedMesh
from stimuli.characters.levels import LEVEL_TRIANGLES, thinned
from stimuli.characters.making.assembly import assembled
from stimuli.characters.making.clothes import (
    TOPS,
    Tailor,
    finished,
    skirt,
    top,
    top_field,
    trousers,
    uncovered,
)
from stimuli.characters.making.eyes import eyeballs
from stimuli.characters.making.figure import Figure, figure_of
from stimuli.characters.making.hair import shell
from stimuli.characters.making.makehuman import BODY_VERTICES, MakeHuman
from stimuli.characters.making.pieces import Piece, kept, parts_of_weights, triangulated
from stimuli.characters.making.recipes import Garment, Recipe
from stimuli.characters.making.shoes import SOLE_M, shoe_field, shoes

SOURCE = "Visavis, from the MakeHuman base mesh"
LICENCE = "CC0-1.0"
_FACE_UNITS = {
    "left_blink": {"eyeBlinkLeft": 1.0},
    "right_blink": {"eyeBlinkRight": 1.0},
    "lids_up": {"eyeLookUpLeft": 1.0, "eyeLookUpRight": 1.0},
    "lids_down": {"eyeLookDownLeft": 1.0, "eyeLookDownRight": 1.0},
    "jaw_open": {"jawOpen": 1.0},
    "smile": {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8,
              "cheekSquintLeft": 0.5, "cheekSquintRight": 0.5},
}  # fmt: skip


def rgb(colour: tuple[int, int, int]) -> Vector:
    """Return a colour as shares."""
    return np.array(colour, dtype=np.float64) / 255


def face_morphs(figure: Figure) -> dict[str, Vector]:
    """Return the shapes of the face as displacements of all vertices, to the figure's size."""
    eye_gap = float(np.linalg.norm(figure.at("left_eye") - figure.at("right_eye")))
    base = figure.source.base_m
    cubes = figure.source.joint_vertices
    base_gap = np.linalg.norm(base[cubes["l-eye"]].mean(axis=0) - base[cubes["r-eye"]].mean(axis=0))
    morphs = {}
    for name, units in _FACE_UNITS.items():
        delta = np.zeros_like(figure.vertices_m)
        for unit_name, amount in units.items():
            target = figure.source.target(unit_name)
            delta[target.vertices] += amount * target.delta_m * (eye_gap / base_gap)
        morphs[name] = delta
    return morphs


def body_piece(figure: Figure, colour: Vector, morphs: dict[str, Vector]) -> Piece:
    """Return the bare body, tagged."""
    triangles = triangulated(figure.source.quads("body"))
    parts = parts_of_weights(figure.weights, triangles, figure.rig.skeleton.names)
    centre = figure.vertices_m[triangles].mean(axis=1)
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    k = figure.stature_m / 1.72
    on_head = (parts == PART_INDEX["scalp"]) | (parts == PART_INDEX["face"])
    is_face = (centre[:, 2] < eye[2] + 0.075 * k) & (centre[:, 1] < eye[1] + 0.075 * k)
    parts = np.where(on_head, np.where(is_face, PART_INDEX["face"], PART_INDEX["scalp"]), parts)
    quad_uv = figure.source.uv[figure.source.quad_uvs("body")]
    corner_uv = np.concatenate([quad_uv[:, [0, 1, 2]], quad_uv[:, [0, 2, 3]]])
    n = BODY_VERTICES
    return Piece(
        vertices_m=figure.body_m,
        triangles=triangles,
        weights=figure.weights[:n],
        colour=np.tile(colour, (n, 1)),
        part=parts,
        material="skin",
        corner_uv=corner_uv,
        morphs={name: delta[:n] for name, delta in morphs.items()},
    )


def closed_body(figure: Figure, body: Piece) -> SkinnedMesh:
    """Return the bare body as one closed surface of about 15,000 triangles."""
    bare = replace(body, corner_uv=None, morphs={})
    mesh = assembled(figure, [bare], (Material("skin", "skin"),))
    whole = replace(mesh, triangle_part=np.zeros_like(mesh.triangle_part))
    thin = thinned(whole, 15000)
    dense = np.zeros((len(thin.vertices_m), len(figure.rig.skeleton.names)))
    np.put_along_axis(dense, thin.joints.astype(np.int64), thin.weights.astype(float), axis=1)
    parts = parts_of_weights(dense, thin.triangles.astype(np.int64), figure.rig.skeleton.names)
    return replace(thin, triangle_part=parts.astype(np.uint8), uv=None)


def built(source: MakeHuman, tailor: Tailor, recipe: Recipe, seed: int) -> Character:
    """Return the person of a recipe."""
    sole = SOLE_M[recipe.shoes]
    figure = figure_of(source, recipe.shape, recipe.stature_m, sole)
    stuff = tailor.stuff(figure)
    lines = stuff.lines
    morphs = face_morphs(figure)
    body = body_piece(figure, rgb(recipe.face.skin), morphs)
    closed = closed_body(figure, body)
    pieces: list[Piece] = [*eyeballs(figure)]
    pieces.append(shell(figure, body, rgb(recipe.face.hair), 0.0, 0.008))
    upper, lower = recipe.garments
    cut = replace(TOPS[upper.kind], **upper.cut)
    shirt = top(figure, stuff, upper, seed)
    pieces.append(finished(figure, shirt, rgb(upper.colour), cut.thickness_m))
    fields = [top_field(figure, lines, cut, body.vertices_m, body.weights)]
    if cut.open_m:
        inner = Garment("tee", upper.second, cut={"sleeve": 0.2, "hem": 0.5, "neck": 0.008})
        inner_cut = replace(TOPS["tee"], **inner.cut)
        pieces.append(
            finished(figure, top(figure, stuff, inner, seed + 2), rgb(upper.second), 0.003)
        )
        fields.append(top_field(figure, lines, inner_cut, body.vertices_m, body.weights))
    hem = lines.hip + cut.hem * (lines.crotch - lines.hip)
    if lower.kind == "skirt":
        below = skirt(figure, tailor, lower, hem + 0.06, seed)
        down_to = lines.knee - 0.06
    else:
        below = trousers(figure, stuff, lower, hem + 0.06, seed + 1)
        down_to = lines.ankle - 0.015
    pieces.append(finished(figure, below, rgb(lower.colour), 0.003))
    pieces += shoes(figure, stuff, recipe.shoes, rgb(recipe.shoe_colour))
    bare = body
    p = body.vertices_m
    fields.append(np.maximum(p[:, 1] - hem - 0.06, down_to - p[:, 1]))
    covered = np.minimum.reduce(fields)
    covered = np.minimum(covered, shoe_field(figure, stuff, recipe.shoes, p))
    bare = uncovered(body, covered, 0.02)
    pieces.insert(0, kept(bare, np.ones(len(bare.triangles), dtype=bool)))
    materials = (
        Material("skin", "skin", 0.55),
        Material("eye", "eye", 0.1),
        Material("hair", "hair", 0.5, double_sided=True),
        Material("top", "cloth", 0.9, double_sided=True),
        Material("bottom", "cloth", 0.9, double_sided=True),
        Material("shoe", "leather", 0.6, double_sided=True),
    )
    mesh = assembled(figure, pieces, materials)
    levels = tuple(thinned(mesh, n) for n in LEVEL_TRIANGLES)
    crown = float(max(mesh.vertices_m[:, 1]))
    floor = figure.floor_m - sole - figure.at("hips")[1]
    return Character(
        name=recipe.name,
        gender=recipe.shape.gender,
        stature_m=round(crown - floor, 4),
        age_years=recipe.shape.age_years,
        skeleton=figure.rig.skeleton,
        levels=levels,
        materials=materials,
        capsules=fitted_capsules(figure.rig.skeleton, closed),
        eyeball=Eyeball(figure.eye_radius_m, 0.0062, 0.0022, recipe.face.iris),
        source=SOURCE,
        licence=LICENCE,
        closed=closed,
    )

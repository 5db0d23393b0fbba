"""Build one person of the default cast from a recipe."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from character_making.assembly import assembled
from character_making.clothes import (
    Stuff,
    Tailor,
    cut_of,
    finished,
    shirt_below,
    shirt_field,
    top,
    top_field,
    trousers,
)
from character_making.collars import collar
from character_making.cutting import clipped
from character_making.eyes import eyeballs, lashes, mouth_pieces
from character_making.fabrics import fabric
from character_making.feet_seen import feet_hold
from character_making.figure import Figure, figure_of
from character_making.hair import STYLES, Locks, locks, pieces_of, seen_of, shell
from character_making.hair_texture import coils, streaks
from character_making.hems import with_hems
from character_making.lids import with_neutral_lids
from character_making.makehuman import BODY_VERTICES, MakeHuman
from character_making.mantle import Sheet
from character_making.occlusion import shaded
from character_making.pieces import Piece, kept, triangulated, vertex_normals
from character_making.recipes import Garment, Recipe
from character_making.shoes import SOLE_M, shoe_field, shoes
from character_making.skin_canvas import SIZE, SkinCanvas
from character_making.skin_paint import base_colour, painted
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.capsules import fit_capsules
from visavis.stimuli.characters.character import Character, Eyeball, Material, SkinnedMesh
from visavis.stimuli.characters.coverage import seen_tags, view_from
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.levels import (
    LEVELS,
    LevelBudget,
    join_skinned_meshes,
    keep_triangles,
    lighter,
    thin_mesh,
)
from visavis.stimuli.characters.measuring import MEASURING_TRIANGLES, match_areas, worst_area_error
from visavis.stimuli.characters.tagging import face_of_head, parts_of_weights

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


def with_closed_lips(figure: Figure, morphs: dict[str, Vector]) -> tuple[Figure, dict[str, Vector]]:
    """Return the figure with its jaw raised until no tooth is seen from in front, and shapes that
    open it from there. Raises `CharacterError` when teeth are seen whatever is tried.
    """
    opening = morphs["jaw_open"]
    for share in _RAISED:
        closed = replace(figure, vertices_m=figure.vertices_m - share * opening)
        if _teeth_m2(closed) < MAX_TEETH_M2:
            # Thinned, lips are not quite where they were.
            share += _LIPS_MEET
            closed = replace(figure, vertices_m=figure.vertices_m - share * opening)
            return closed, {**morphs, "jaw_open": (1 + share) * opening}
    raise CharacterError(
        f"{figure.shape}: teeth are seen with the jaw raised by {_RAISED[-1]:.2f} of its way; "
        "set them farther back or change the shape of the mouth"
    )


def _teeth_m2(figure: Figure) -> float:
    """Return how much of the teeth is seen between the lips, at most of some directions."""
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    k = figure.stature_m / 1.72
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    within = eye + k * (np.array([0.0, -0.072, -0.02]) + corners * [0.036, 0.022, 0.04])
    pieces = [body_piece(figure, np.zeros(3), {}), *mouth_pieces(figure)]
    start = np.cumsum([0, *(len(piece.vertices_m) for piece in pieces)])
    triangles = np.concatenate([p.triangles + n for p, n in zip(pieces, start, strict=False)])
    vertices_m = np.concatenate([piece.vertices_m for piece in pieces])
    light = np.concatenate([piece.colour.min(axis=1) for piece in pieces])[triangles].mean(axis=1)
    bare = np.arange(len(triangles)) < len(pieces[0].triangles)
    tags = np.where(~bare & (light > _LIGHT_TEETH), 2, 1)
    near = (np.abs(vertices_m[triangles].mean(axis=1) - within.mean(axis=0)) < 0.08).all(axis=1)
    seen = [
        seen_tags(
            vertices_m,
            triangles[near].astype(np.int32),
            tags[near].astype(np.uint8),
            view_from(yaw_deg, down_deg),
            _TEETH_STEP_M,
            within.astype(np.float32),
        )
        for yaw_deg, down_deg in ((0.0, 0.0), (25.0, 0.0), (-25.0, 0.0), (0.0, 15.0))
    ]
    return max(float((tags_seen == 2).sum()) for tags_seen in seen) * _TEETH_STEP_M**2


MAX_TEETH_M2, _LIGHT_TEETH, _TEETH_STEP_M = 0.5e-6, 0.25, 0.0003
_RAISED = np.arange(0.0, 0.16, 0.005).tolist()
"""By which share of its way open the jaw is raised, tried in turn."""
_LIPS_MEET = 0.02


@dataclass(frozen=True, eq=False)
class Workshop:
    """What is made once and used for everybody."""

    tailor: Tailor
    canvas: SkinCanvas


def workshop_of(source: MakeHuman) -> Workshop:
    """Lay out cloth and skin of the base mesh."""
    return Workshop(Tailor(source), SkinCanvas(source))


def body_piece(figure: Figure, colour: Vector, morphs: dict[str, Vector]) -> Piece:
    """Return the bare body, tagged."""
    triangles = triangulated(figure.source.quads("body"))
    parts = parts_of_weights(figure.weights, triangles, figure.rig.skeleton.names)
    centre = figure.vertices_m[triangles].mean(axis=1)
    eye = (figure.at("left_eye") + figure.at("right_eye")) / 2
    k = figure.stature_m / 1.72
    parts = face_of_head(parts, centre, eye, k)
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


def mouth_apart(body: Piece, canvas: SkinCanvas, shown: npt.NDArray[np.bool_]) -> list[Piece]:
    """Return the skin that shows and the inside of the mouth, which has no picture: so lips keep
    their own colour however few triangles are left of them.
    """
    if body.corner_uv is None:
        return [kept(body, shown)]
    column, row = np.clip((body.corner_uv.mean(axis=1) * SIZE).astype(np.int64), 0, SIZE - 1).T
    inside = canvas.mask("mpfb_inside-mouth", row * SIZE + column) > 0.5
    mouth = replace(
        kept(body, shown & inside),
        material="mouth",
        corner_uv=None,
    )
    dark = np.tile([0.33, 0.13, 0.12], (len(mouth.vertices_m), 1))
    return [kept(body, shown & ~inside), replace(mouth, colour=dark)]


_SUNK_M, _SUNK_OVER_M = 0.008, 0.006


def _below_clothes(body: Piece, covered_m: Vector) -> Piece:
    """Return the body with skin below clothes, metres (v,) inside their edges, drawn in a little,
    so that it does not come through them where they are thinned.
    """
    deep = np.clip(-covered_m / _SUNK_OVER_M, 0, 1)
    normals = vertex_normals(body.vertices_m, body.triangles)
    return replace(body, vertices_m=body.vertices_m - (_SUNK_M * deep)[:, None] * normals)


def closed_body(figure: Figure, body: Piece) -> SkinnedMesh:
    """Return the bare body as one closed surface of about 15,000 triangles."""
    bare = replace(body, corner_uv=None, morphs={})
    mesh = assembled(figure, [bare], (Material("skin", "skin"),))
    whole = replace(mesh, triangle_part=np.zeros_like(mesh.triangle_part))
    thin = thin_mesh(whole, 15000)
    dense = np.zeros((len(thin.vertices_m), len(figure.rig.skeleton.names)))
    np.put_along_axis(dense, thin.joints.astype(np.int64), thin.weights.astype(float), axis=1)
    parts = parts_of_weights(dense, thin.triangles.astype(np.int64), figure.rig.skeleton.names)
    return replace(thin, triangle_part=parts.astype(np.uint8), uv=None)


_SHOE_HEM_M = 0.004
_BELOW_JACKET = {
    "sleeve": 0.2,
    "hem": 0.5,
    "neck": -0.004,
    "collar": 0.75,
    "buttoned_m": 0.27,
    "placket": False,
}


def clothed(
    figure: Figure, stuff: Stuff, recipe: Recipe, body: Piece, seed: int
) -> tuple[list[Piece], list[Piece], Vector]:
    """Return everything worn, the same for coarse levels, and metres outside all of it for the
    body's vertices.
    """
    upper, lower = recipe.garments
    lines, p = stuff.lines, body.vertices_m
    cut = cut_of(upper)
    rng = np.random.default_rng(seed)
    tone, _ = fabric(upper.pattern, rgb(upper.colour), rgb(upper.second), rng)
    waist = lines.hip + cut.hem * (lines.crotch - lines.hip) + 0.06
    below = trousers(figure, stuff, lower, waist, seed + 1)
    worn_below = [below]
    inner = Garment("tee", upper.second, cut=_BELOW_JACKET)
    if cut.open_m:
        collared = upper.kind == "jacket"
        worn_below.append(shirt_below(figure, stuff, inner, collared=collared))
    coat = top(figure, stuff, upper, seed, worn_below)
    pieces = [finished(figure, coat, tone, cut.thickness_m)]
    pieces += collar(figure, coat, upper, tone)
    far = list(pieces)
    fields = [top_field(figure, lines, cut, p, body.weights)]
    if cut.open_m:
        shirt = worn_below[1]
        # Only what the open front shows is kept; of coarse levels less still, and that deeper, or
        # it would poke through.
        under = top_field(figure, lines, cut, shirt.vertices_m, shirt.weights)
        low_m = lines.waist - 0.05 - shirt.vertices_m[:, 1]
        inner = replace(inner, kind="shirt" if collared else "tee")
        turnover = collar(figure, shirt, inner, rgb(upper.second))
        for some, reach_m, depth_m in ((pieces, 0.04, 0.0), (far, 0.012, 0.007)):
            shown = clipped(shirt, np.maximum(-reach_m - under, low_m))
            in_m = depth_m * vertex_normals(shown.vertices_m, shown.triangles)
            shown = replace(shown, vertices_m=shown.vertices_m - in_m)
            some += [finished(figure, shown, rgb(upper.second), 0.002), *turnover]
        fields.append(shirt_field(figure, stuff, inner, p, body.weights, collared=collared))
    tone, _ = fabric(lower.pattern, rgb(lower.colour), rgb(lower.second), rng)
    down_to = lines.ankle - 0.015
    fields.append(np.maximum(p[:, 1] - waist, down_to - p[:, 1]))
    fields.append(shoe_field(figure, recipe.shoes, p))
    # Thinned, the hem of a low shoe folds; without one, one would see into a boot.
    far_hem_m = _SHOE_HEM_M if recipe.shoes == "boot" else 0.0
    for some, hem_m in ((pieces, _SHOE_HEM_M), (far, far_hem_m)):
        some.append(finished(figure, below, tone, 0.003))
        some += shoes(figure, stuff, recipe.shoes, rgb(recipe.shoe_colour), hem_m)
    return pieces, far, np.asarray(np.minimum.reduce(fields))


_TRIM = 1200
"""Triangles of a neckline's band or a collar in the finest level at most."""
_HAIR = (0, 1, 2)
"""How coarse the hair of each level is."""
_SCALP = (0, 300, 110)
"""Triangles of the scalp below it in the coarser ones."""
_NOT_FROM_AFAR = ("teeth", "lash", "hair")
"""What thinning does not touch: teeth and lashes are smaller than what it leaves."""
_LIGHTER_BY = tuple(range(0, 240, 8))
"""Levels are tried with so many triangles fewer, until what is seen of feet holds."""
_FEWER = (0, 30, 60, 90, 120, 150)
_TRIED = (
    *((fewer, 0) for fewer in _FEWER),
    *((0, first) for first in range(1, 9)),
    *((40 * first, first) for first in range(1, 9)),
    *((25 * first + 15, first) for first in range(9)),
    *((15 * first + 10, 9 - first) for first in range(9)),
    *((10 * k + 5, k % 2) for k in range(24)),
    *((90 * first, first) for first in range(1, 7)),
)
"""Copies for measuring are tried with so many triangles fewer, then with other locks of hair, then
with both in many ways.
"""
_GOOD_COPY, _FAIR_COPY, _WORST_COPY = 0.035, 0.045, 0.05
"""A part may be seen larger or smaller by this share: at once, after some tries, after all."""


def levels_of(
    figure: Figure,
    pieces: Sequence[Piece],
    from_afar: Sequence[Piece],
    hair: Sequence[Locks | Sheet],
    materials: Sequence[Material],
    plain: Sequence[Piece],
    holds: Callable[[tuple[SkinnedMesh, ...]], bool],
) -> tuple[tuple[SkinnedMesh, ...], tuple[SkinnedMesh, ...]]:
    """Return all levels and the copies for measuring: surfaces are thinned, of the hair fewer and
    wider locks are drawn. `plain` are the pieces from afar without shade, by which copies for
    measuring are thinned: their outlines count, and shade must not. Levels are tried with fewer
    triangles until it `holds` with those so far.

    Raises:
        CharacterError: nothing that was tried holds.
    """
    # Among large surfaces the folds of a collar would be thinned to rags.
    whole = assembled(figure, [p for p in pieces if not p.is_trim], materials)
    trim = [thin_mesh(assembled(figure, [p], materials), _TRIM) for p in pieces if p.is_trim]
    far, unshaded = (
        assembled(figure, [p for p in some if p.material not in _NOT_FROM_AFAR], materials)
        for some in (from_afar, plain)
    )
    scalp = assembled(figure, [p for p in from_afar if p.material == "hair"], materials)

    def hair_at(coarse: int, first: int = 0) -> SkinnedMesh:
        locks = assembled(figure, pieces_of(figure, hair, coarse, first), materials)
        # With the body a scalp would lose its roundness, and hair would stand off it.
        return join_skinned_meshes([thin_mesh(scalp, _SCALP[coarse]), locks]) if coarse else locks

    locks_of = {coarse: hair_at(coarse) for coarse in sorted(set(_HAIR))}
    levels: list[SkinnedMesh] = []
    for budget, coarse in zip(LEVELS, _HAIR, strict=True):
        mine = locks_of[coarse]
        for fewer in _LIGHTER_BY:
            n_rest = budget.triangles - fewer - len(mine.triangles)
            if not levels:
                n_trim = sum(len(mesh.triangles) for mesh in trim)
                surfaces = join_skinned_meshes([thin_mesh(whole, n_rest - n_trim), *trim])
            else:
                surfaces = lighter(far, LevelBudget(n_rest, budget.face))
            level = join_skinned_meshes([surfaces, mine])
            if holds((*levels, level)):
                break
        else:
            raise CharacterError(
                f"{figure.shape}: level {len(levels)} shows the inside of a shoe, or a shoe "
                f"through trousers, with up to {_LIGHTER_BY[-1]} triangles fewer; add to what is "
                "tried"
            )
        levels.append(level)
    copies = []
    for n, coarse in zip(MEASURING_TRIANGLES, (1, 2), strict=True):
        tried: list[tuple[float, SkinnedMesh]] = []
        for fewer, first in _TRIED:
            mine = hair_at(coarse, first) if first else locks_of[coarse]
            thin = thin_mesh(unshaded, n - fewer - len(mine.triangles))
            copy = join_skinned_meshes([_coloured_as(thin, unshaded, far), mine])
            copy = match_areas(copy, levels[0])
            tried.append((worst_area_error(copy, levels[0]), copy))
            if tried[-1][0] < (_FAIR_COPY if first else _GOOD_COPY):
                break
            if len(tried) == len(_FEWER) and min(e for e, _ in tried) < _FAIR_COPY:
                break
        least, copy = min(tried, key=lambda row: row[0])
        if least > _WORST_COPY:
            raise CharacterError(
                f"{figure.shape}: of {len(tried)} copies of {n} triangles for measuring the best "
                f"shows a part {least:.1%} larger or smaller; add to what is tried"
            )
        copies.append(copy)
    return tuple(levels), tuple(copies)


def _coloured_as(thin: SkinnedMesh, whole: SkinnedMesh, other: SkinnedMesh) -> SkinnedMesh:
    """Return a copy thinned from `whole` with the colours of `other`, which has its vertices."""

    def known_by(mesh: SkinnedMesh) -> Vector:
        colour_m = mesh.colour_srgb / 255 * 1e-3
        return np.concatenate([mesh.vertices_m, colour_m], axis=1)

    _, index = cKDTree(known_by(whole)).query(known_by(thin))
    return replace(thin, colour_srgb=other.colour_srgb[index])


def with_lashes(person: Character, figure: Figure, pieces: Sequence[Piece]) -> Character:
    """Return the person in full with all lashes of the pieces: they are finer than what thinning
    leaves.
    """
    full, whole = person.levels[0], assembled(figure, pieces, person.materials)
    lash = [m.name for m in person.materials].index("lash")
    others = keep_triangles(full, full.triangle_material != lash)
    full = join_skinned_meshes([others, keep_triangles(whole, whole.triangle_material == lash)])
    return replace(person, levels=(full, *person.levels[1:]))


_COILED_LIGHTER = 2.2


def hair_colour_of(recipe: Recipe) -> Vector:
    """Return what the picture of hair is tinted with: that of coils is darker than that of strands,
    for between them lies shade.
    """
    return rgb(recipe.face.hair) * (_COILED_LIGHTER if STYLES[recipe.hair].curl_m else 1.0)


def built(source: MakeHuman, workshop: Workshop, recipe: Recipe, seed: int) -> Character:
    """Return the person of a recipe."""
    sole = SOLE_M[recipe.shoes]
    figure = figure_of(source, recipe.shape, recipe.stature_m, sole)
    stuff = workshop.tailor.stuff(figure)
    morphs = face_morphs(figure)
    body = body_piece(figure, base_colour(recipe.face), morphs)
    closed = closed_body(figure, body)
    figure, morphs = with_closed_lips(*with_neutral_lids(figure, morphs))
    body = body_piece(figure, base_colour(recipe.face), morphs)
    worn, worn_far, covered = clothed(figure, stuff, recipe, body, seed)
    bare = np.asarray((covered >= -0.02)[body.triangles].any(axis=1))
    rng = np.random.default_rng(seed)
    style = STYLES[recipe.hair]
    hair_colour = hair_colour_of(recipe)
    cloth = [piece for piece in worn if piece.material != "shoe"]
    own = [
        *mouth_apart(_below_clothes(body, covered), workshop.canvas, bare),
        *eyeballs(figure),
        *mouth_pieces(figure),
        *lashes(figure, rgb(recipe.face.brow) * 0.4, base_colour(recipe.face), morphs),
        shell(figure, body, hair_colour, style, seed),
    ]
    hair = locks(figure, body, cloth, hair_colour, style, seed, recipe.face.grey)
    over = seen_of(hair) if style.combing is not None else None
    skin = painted(figure, workshop.canvas, body, bare, recipe.face, style, seed, over)
    upper, lower = recipe.garments
    weave = {
        g.kind: fabric(g.pattern, rgb(g.colour), rgb(g.second), rng)[1] for g in recipe.garments
    }
    strands = coils(rng) if style.curl_m else streaks(rng)
    # Light glances off strands side by side, not off coils.
    hair_picture = Material(
        "hair", "hair", 1.0 if style.curl_m else 0.6, strands, double_sided=True
    )
    materials = (
        Material("skin", "skin", 0.55, skin),
        Material("eye", "eye", 0.1),
        Material("teeth", "teeth", 0.3),
        Material("mouth", "teeth", 0.5),
        Material("lash", "lash", 0.8, double_sided=True),
        hair_picture,
        Material("top", "cloth", 0.9, weave[upper.kind], double_sided=True),
        Material("bottom", "cloth", 0.9, weave[lower.kind], double_sided=True),
        Material("under", "cloth", 0.9, double_sided=True),
        Material("shoe", "leather", 0.5, double_sided=True),
    )
    locks_near = pieces_of(figure, hair, 0)
    near, far = (shaded([*own, *clothes], locks_near) for clothes in (worn, worn_far))
    blank = Character(
        name=recipe.name,
        gender=recipe.shape.gender,
        stature_m=0.0,
        age_years=recipe.shape.age_years,
        skeleton=figure.rig.skeleton,
        levels=(),
        measuring=(),
        materials=materials,
        capsules=fit_capsules(figure.rig.skeleton, closed),
        eyeball=Eyeball(figure.eye_radius_m, 0.0062, 0.0022, recipe.face.iris),
        source=SOURCE,
        licence=LICENCE,
        closed=closed,
    )

    def dressed(levels: Sequence[SkinnedMesh], copies: Sequence[SkinnedMesh]) -> Character:
        stature = float(closed.vertices_m[:, 1].max() - levels[0].vertices_m[:, 1].min())
        person = replace(
            blank, stature_m=round(stature, 4), levels=tuple(levels), measuring=tuple(copies)
        )
        return with_hems(person, cut_of(upper).length)

    def holds(levels: tuple[SkinnedMesh, ...]) -> bool:
        missing = len(LEVELS) - len(levels)
        return feet_hold(dressed((*levels, *levels[-1:] * missing), ()), len(levels) - 1)

    levels, copies = levels_of(figure, near, far, hair, materials, own + worn_far, holds)
    return with_lashes(dressed(levels, copies), figure, own)

"""People and furniture stand on floors: what is beside a sole is as dark as what hides the sky."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from tests.stage import figures
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg
from visavis.stage.errors import StageError
from visavis.stage.geometry.contact_shapes import soles_of
from visavis.stage.geometry.joint_rows import JointRows
from visavis.stage.geometry.projection import projection, view
from visavis.stage.identity import FAITHFUL, IdentityBuffer
from visavis.stage.renderer import LIGHTEST, Quality, Renderer
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.character import MORPHS, Character, Material
from visavis.stimuli.dressing.casting import build_of
from visavis.stimuli.dressing.office import room_from
from visavis.stimuli.motion.kinds import Idle
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.picture import Block, Camera, Light, Picture, PosedPeople, Room
from visavis.stimuli.rooms import furniture
from visavis.stimuli.rooms.audience_room import audience_room
from visavis.stimuli.rooms.gallery import gallery
from visavis.stimuli.rooms.office import office
from visavis.stimuli.rooms.solids import cylinder
from visavis.stimuli.rooms.station import station

SIZE_PX = (480, 360)
AWAY_M = 3.5
GREY = np.full(3, 0.6)
RAYS = 200
BESIDE_M = (0.015, 0.04, 0.08, 0.16, 0.28)
WITHIN = 0.09
"""Of all the sky: a shoe is not a disc, and the body above is a leg as high as the sky."""
SHAPES_OF_NOBODY = (3,), (55, 4), (len(MORPHS),)
PART_OF_WALLS = "door", "riser", "step"
QUALITIES = {"card": Quality(samples=4), "processor": LIGHTEST}


@pytest.fixture(params=QUALITIES)
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    try:
        engine = Renderer(quality=QUALITIES[request.param])
    except StageError as problem:
        pytest.skip(str(problem))
    with engine:
        yield engine


@cache
def room(high_m: float = 0.0) -> Room:
    """A floor below an even sky: nothing else makes one place of it darker than another."""
    floor = figures.plane("floor", (-4, high_m, -6), (0, 0, 8), (8, 0, 0), (160, 160, 160))
    return Room("grey", (floor,), (), GREY, GREY)


@cache
def somebody() -> Character:
    return load_cast()[9]


def standing(high_m: float = 0.0, person: int = 1) -> PosedPeople:
    idle = Person(build_of(somebody()), Idle(lively=0.0), person, (0.0, high_m, -AWAY_M), 180.0)
    return PeopleMotion((idle,)).at(1.0)


def picture(people: PosedPeople | None, high_m: float = 0.0) -> Picture:
    given = standing() if people is None else people
    shown = Picture(0, room(high_m), (somebody(),), given)
    if people is not None:
        return shown
    away = replace(given, root_m=given.root_m + np.array([0.0, 0.0, 60.0]))
    return replace(shown, people=away)


def eye(high_m: float = 0.0) -> Camera:
    top = float(np.tan(np.radians(15.0)))
    pose = Pose(np.array([0.0, high_m + 1.6, 0.0]), quat_from_yaw_pitch_deg(0.0, -20.0))
    return Camera(pose, -top * 4 / 3, top * 4 / 3, -top, top)


def soles(people: PosedPeople) -> Vector:
    """Return heel and ball of both soles (2, 2, 4): centre and radius."""
    joints = JointRows((somebody(),))
    joints.pose(people)
    first = joints.sole_column
    found: Vector = joints.rows[0, first : first + 4].astype(np.float64).reshape(2, 2, 4)
    return found


def beside(people: PosedPeople) -> Vector:
    """Return points (k, 3) of the floor beside and before both soles, away from the other one."""
    out = []
    for (heel, ball), side in zip(soles(people), (1.0, -1.0), strict=True):
        along = (ball - heel)[[0, 2]] / np.linalg.norm((ball - heel)[[0, 2]])
        aside = side * np.array([along[1], -along[0]])
        middle = (heel + ball) / 2
        for disc, way in ((middle, aside), (ball, along)):
            for away in BESIDE_M:
                x, z = disc[[0, 2]] + way * (disc[3] + away)
                out.append((x, min(heel[1], ball[1]), z))
    return np.array(out)


def struck(points_m: Vector, rays: Vector, people: PosedPeople) -> npt.NDArray[np.bool_]:
    """Return whether the body's triangles stop each of the rays (r, 3) of each point (k, r)."""
    joints = JointRows((somebody(),))
    joints.pose(people)
    mesh = somebody().levels[-1]
    rows = joints.rows[0, : 3 * joints.joint_count].reshape(-1, 3, 4)
    matrix = np.einsum("vk,vkab->vab", mesh.weights, rows[mesh.joints])
    moved = np.einsum("vab,vb->va", matrix[..., :3], mesh.vertices_m) + matrix[..., 3]
    return stopped(points_m, rays, moved[mesh.triangles])


def stopped(points_m: Vector, rays: Vector, corners_m: Vector) -> npt.NDArray[np.bool_]:
    """Return whether triangles (t, 3, 3) stop each of the rays (r, 3) of each point (k, r)."""
    a, b, c = corners_m.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    slope = rays @ normal.T
    inverse = 1.0 / np.where(abs(slope) < 1e-12, np.inf, slope)
    out = []
    for point in points_m + np.array([0.0, 0.001, 0.0]):
        # Where a ray meets a triangle's plane, and on which side of each of its edges.
        u = (rays @ np.cross(c - point, b - point).T) * inverse
        v = (rays @ np.cross(a - point, c - point).T) * inverse
        w = (rays @ np.cross(b - point, a - point).T) * inverse
        ahead = ((a - point) * normal).sum(axis=1) * inverse > 1e-4
        same = ((u <= 0) & (v <= 0) & (w <= 0)) | ((u >= 0) & (v >= 0) & (w >= 0))
        out.append((same & ahead).any(axis=1))
    return np.array(out)


def hidden_sky_01(points_m: Vector, people: PosedPeople) -> Vector:
    """Return the share of an even sky that the body hides from points of the floor."""
    share: Vector = struck(points_m, even_rays(), people).mean(axis=1)
    return share


def even_rays() -> Vector:
    """Return directions (r, 3) from which a floor gets as much light each from an even sky."""
    k = np.arange(RAYS)
    radius, turn = np.sqrt((k + 0.5) / RAYS), k * np.pi * (3 - np.sqrt(5))
    return np.stack([radius * np.cos(turn), np.sqrt(1 - radius**2), radius * np.sin(turn)], axis=1)


def seen(points_m: Vector, people: PosedPeople) -> Vector:
    """Return the points that the body does not hide from the eye."""
    towards = eye().pose.position_m - points_m
    pairs = zip(points_m, towards, strict=True)
    is_seen = [not struck(p[None], t[None], people)[0, 0] for p, t in pairs]
    found: Vector = points_m[is_seen]
    return found


def light_at(image: npt.NDArray[np.uint8], points_m: Vector, camera: Camera) -> Vector:
    """Return the linear light of the pixels that show points (k,)."""
    clip = (
        np.column_stack([points_m, np.ones(len(points_m))])
        @ (projection(camera) @ view(camera.pose)).T
    )
    x = (clip[:, 0] / clip[:, 3] * 0.5 + 0.5) * SIZE_PX[0]
    y = (0.5 - clip[:, 1] / clip[:, 3] * 0.5) * SIZE_PX[1]
    codes = image[y.astype(int), x.astype(int)].mean(axis=-1) / 255
    light: Vector = np.where(codes < 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    return light


def darker(
    renderer: Renderer, people: PosedPeople, points_m: Vector, high_m: float = 0.0
) -> Vector:
    """Return by what share of its light each point of the floor is darker for the people."""
    camera = eye(high_m)
    with_people = renderer.image(picture(people, high_m), camera, SIZE_PX)
    open_floor = renderer.image(picture(None, high_m), camera, SIZE_PX)
    lit, open_lit = (light_at(image, points_m, camera) for image in (with_people, open_floor))
    shade: Vector = 1.0 - lit / open_lit
    return shade


@pytest.mark.parametrize("person", [1, 2, 4])
def test_floors_beside_soles_are_as_dark_as_the_sky_the_body_hides(
    renderer: Renderer, person: int
) -> None:
    people = standing(person=person)
    points = seen(beside(people), people)
    assert len(points) > 12
    traced = hidden_sky_01(points, people)
    assert traced.max() > 0.25
    shade = darker(renderer, people, points)
    if renderer.quality.shadows == "blobs":
        # What lamps would throw comes on top.
        near = traced > 0.15
        assert (shade[near] > traced[near]).all()
    else:
        assert abs(shade - traced).mean() < WITHIN / 2
        assert (abs(shade - traced) < WITHIN * 2).all()


def test_shade_lies_on_the_step_a_person_stands_on(renderer: Renderer) -> None:
    low, high = standing(), standing(0.57)
    expected = darker(renderer, low, beside(low))
    found = darker(renderer, high, beside(high), 0.57)
    np.testing.assert_allclose(found, expected, atol=0.02)


@pytest.mark.parametrize("depth_m", [0.008, 0.03])
def test_soles_that_sink_into_the_ground_shade_it_like_those_on_it(
    renderer: Renderer, depth_m: float
) -> None:
    """Recorded walks do so by centimetres, and showed a shade in some frames and none in others."""
    people = standing()
    points = seen(beside(people), people)
    points[:, 1] = 0.0
    sunk = replace(people, root_m=people.root_m - np.array([0.0, depth_m, 0.0]))
    expected = darker(renderer, people, points)
    np.testing.assert_allclose(darker(renderer, sunk, points), expected, atol=0.06)


def test_a_lifted_foot_shades_the_floor_softly(renderer: Renderer) -> None:
    down = standing()
    index = somebody().skeleton.index
    turns = down.orientation_wxyz.copy()
    half = np.radians(35.0) / 2
    for joint, way in (("left_upper_leg", 1.0), ("left_lower_leg", -1.8)):
        turns[0, index(joint)] = np.cos(way * half), np.sin(way * half), 0.0, 0.0
    up = replace(down, orientation_wxyz=turns)
    assert soles(up)[0, :, 1].min() > 0.04
    points = beside(up)[: len(BESIDE_M)]
    points[:, 1] = soles(up)[1, :, 1].min()
    shade, traced = darker(renderer, up, points), hidden_sky_01(points, up)
    if renderer.quality.shadows == "maps":
        assert (abs(shade - traced) < WITHIN).all()
    planted = darker(renderer, down, beside(down)[: len(BESIDE_M)])
    assert 0.0 < shade[0] - shade[2] < 0.7 * (planted[0] - planted[2])


FURNITURE = {
    "desk": furniture.desk("desk", (0, 0, -AWAY_M), 25.0),
    "closed desk": furniture.desk("desk", (0, 0, -AWAY_M), 155.0, front=(226, 226, 222)),
    "chair": furniture.chair("chair", (0, 0, -AWAY_M), 30.0),
    "pot": furniture.plant("plant", (0, 0, -AWAY_M), seed=1)[:1],
    "shelf": furniture.shelf("shelf", (0, 0, -AWAY_M), 20.0, seed=1),
}


@pytest.mark.parametrize("name", FURNITURE)
def test_floors_at_furniture_are_as_dark_as_the_sky_it_hides(renderer: Renderer, name: str) -> None:
    things = FURNITURE[name]
    corners = np.concatenate([p.mesh.vertices_m[p.mesh.triangles] for p in things])
    x, z = np.meshgrid(np.linspace(-1.0, 1.0, 17), -AWAY_M + np.linspace(-0.8, 0.8, 13))
    points = np.column_stack([x.ravel(), np.zeros(x.size), z.ravel()])
    towards = eye().pose.position_m - points
    pairs = zip(points, towards, strict=True)
    points = points[[not stopped(p[None], t[None], corners)[0, 0] for p, t in pairs]]
    traced = stopped(points, even_rays(), corners.astype(np.float64)).mean(axis=1)
    grey = tuple(
        replace(p, material=Material(p.name, "other", 0.9), casts_shadow=False) for p in things
    )
    furnished = replace(empty(), room=replace(room(), props=(*room().props, *grey)))
    images = (renderer.image(given, eye(), SIZE_PX) for given in (furnished, empty()))
    lit, open_lit = (light_at(image, points, eye()) for image in images)
    shade = 1.0 - lit / open_lit
    assert traced.max() > 0.15
    assert abs(shade - traced).mean() < WITHIN / 2
    assert (abs(shade - traced) < WITHIN * 2).mean() > 0.95


def test_shade_grows_up_to_the_foot_of_what_is_round(renderer: Renderer) -> None:
    near_m, radius, foot = 4.3, 0.15, 0.142  # round feet are narrower than their blocks
    things = furniture.place_prop(
        "column",
        cylinder((0, 0, 0), (0, 0.3, 0), foot, (160, 160, 160), sides=64),
        (0, 0, -near_m - radius),
        0.0,
        casts_shadow=False,
        blocks=(Block((0, 0, 0), radius, radius, 0.3, round=True),),
    )
    given = Picture(0, replace(room(), props=(*room().props, things)), (), nobody())
    away = np.array([-0.005, 0.004, 0.012, 0.025, 0.05, 0.1])
    points = np.column_stack([0 * away, 0 * away, away - near_m])
    wide = replace(eye(), left=-0.04, right=0.04, bottom=-0.03, top=0.03)
    lit = light_at(renderer.image(given, wide, SIZE_PX), points, wide)
    corners = things.mesh.vertices_m[things.mesh.triangles].astype(np.float64)
    traced = stopped(points, even_rays(), corners).mean(axis=1)
    shade = 1.0 - lit / light_at(renderer.image(empty(), wide, SIZE_PX), points, wide)
    assert (np.diff(shade) < 0.01).all()
    assert abs(shade - traced)[1:].max() < WITHIN


def empty() -> Picture:
    return Picture(0, room(), (), nobody())


def nobody() -> PosedPeople:
    return PosedPeople(*(np.zeros((0, *s)) for s in SHAPES_OF_NOBODY))


def test_everything_that_stands_in_a_room_has_its_shade() -> None:
    for place in (audience_room(), station(), office(), room_from("place_3"), gallery()):
        blocks = [block for prop in place.props for block in prop.blocks]
        for prop in place.props:
            vertices = prop.mesh.vertices_m.astype(np.float64)
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            for block in prop.blocks:
                x, _, z = block.at_m
                assert (low[[0, 2]] - 0.1 < [x, z]).all(), prop.name
                assert (high[[0, 2]] + 0.1 > [x, z]).all(), prop.name
            if not prop.casts_shadow or low[1] != 0.0 or prop.name.split("_")[0] in PART_OF_WALLS:
                continue
            feet = vertices[vertices[:, 1] < 0.01][:, [0, 2]]
            assert feet_in(blocks, feet).all(), prop.name


def feet_in(blocks: list[Block], feet: Vector) -> npt.NDArray[np.bool_]:
    """Return whether a block stands or ends low above each of the points (k, 2) of the floor."""
    found = np.zeros(len(feet), np.bool_)
    for block in blocks:
        turn = np.radians(block.yaw_deg)
        x, z = (feet - np.array(block.at_m)[[0, 2]]).T
        own = np.cos(turn) * x - np.sin(turn) * z, np.sin(turn) * x + np.cos(turn) * z
        within = (abs(own[0]) < block.half_x_m + 0.03) & (abs(own[1]) < block.half_z_m + 0.03)
        found |= within & (block.at_m[1] < 0.15)
    return found


def test_a_sole_is_as_long_and_wide_as_the_shoe() -> None:
    for person in load_cast():
        left, right = soles_of(person).reshape(2, 2, 4)
        for heel, ball in (left, right):
            long_m = np.linalg.norm(ball[:3] - heel[:3]) + heel[3] + ball[3]
            assert 0.12 < long_m / person.stature_m < 0.18
            assert 0.02 < heel[3] < ball[3] < 0.075
        np.testing.assert_allclose(abs(left), abs(right), atol=0.03)


def test_what_is_measured_knows_no_shade() -> None:
    images = []
    for shadows in ("blobs", "none"):
        try:
            engine = Renderer(quality=replace(FAITHFUL, shadows=shadows))
        except StageError as problem:
            pytest.skip(str(problem))
        with engine, IdentityBuffer(engine) as buffer:
            images.append(buffer.views(picture(standing()), [eye()], (96, 72)))
    for name in ("person", "part", "luminance_01", "distance_m"):
        np.testing.assert_array_equal(*(getattr(image, name) for image in images))


def test_what_stands_still_throws_its_shadow_in_every_frame() -> None:
    floor, *_ = room().props
    board = figures.plane("board", (-1, 1.4, -3), (0, 0, 2), (2, 0, 0), (90, 90, 90))
    sun = Light("sun", GREY, direction=np.array([0.0, -1.0, 0.0]), casts_shadow=True)
    below = Room("board", (floor, replace(board, casts_shadow=True)), (sun,), GREY / 2, GREY / 2)
    camera, place = eye(), np.array([[0.3, 0.0, -2.8]])
    try:
        engine = Renderer(quality=QUALITIES["card"])
    except StageError as problem:
        pytest.skip(str(problem))
    people = standing()
    aside = replace(people, root_m=people.root_m + np.array([3.0, 0.0, 0.0]))
    with engine:
        given = replace(picture(people), room=replace(below, props=(floor,)))
        lit = light_at(engine.image(given, camera, SIZE_PX), place, camera)[0]
        given = replace(given, room=below)
        for now in (people, people, aside, aside, people):
            image = engine.image(replace(given, people=now), camera, SIZE_PX)
            assert light_at(image, place, camera)[0] < 0.6 * lit

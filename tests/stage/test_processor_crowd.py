"""People and rooms lit by the processor, against the same lit by shaders."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.stage import figures
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stage.card.targets import EyeTarget
from visavis.stage.card.vertices import room_vertices
from visavis.stage.errors import StageError
from visavis.stage.identity import FAITHFUL, IdentityBuffer, IdentityImages
from visavis.stage.processor import crowd as processor_crowd
from visavis.stage.processor.baked_room import baked_room
from visavis.stage.processor.layout import FreeRows
from visavis.stage.processor.vertex_light import (
    CODES_OF_ROOT,
    FACTORS_OF_ROOT,
    GroupedTriangles,
    PeopleRows,
    Views,
    gather_front,
    lamp_rows,
    light_points,
    looked_up,
)
from visavis.stage.renderer import LIGHTEST, Quality, Renderer
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.picture import Light, Picture

CHEQUERED = np.kron(
    np.array([[220, 60], [60, 220]], np.uint8)[..., None] * np.ones(3, np.uint8),
    np.ones((8, 8, 1), np.uint8),
)


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    try:
        made = Renderer(quality=LIGHTEST)
    except StageError as problem:
        pytest.skip(str(problem))
    with made:
        yield made


def _dressed(character: Character) -> Character:
    """Return a figure whose clothes have a picture on them, two dozen times a metre."""
    levels = tuple(
        replace(mesh, uv=(24 * mesh.vertices_m[:, :2]).astype(np.float32))
        for mesh in character.levels
    )
    materials = tuple(
        replace(m, texture_srgb=CHEQUERED) if m.kind == "cloth" else m for m in character.materials
    )
    return replace(character, levels=levels, materials=materials)


def _pictured(n: int = 3) -> Picture:
    picture = figures.picture(n)
    return replace(picture, cast=tuple(_dressed(character) for character in picture.cast))


def _views(quality_level: int, picture: Picture, *, fast: bool) -> IdentityImages:
    quality = replace(LIGHTEST if fast else FAITHFUL, shadows="none")
    try:
        renderer = Renderer(quality=quality)
    except StageError as problem:
        pytest.skip(str(problem))
    with renderer, IdentityBuffer(renderer) as buffer:
        cameras = [figures.camera(), figures.camera(place_m=(0.4, 1.2, 0.4), yaw_deg=10)]
        return buffer.views(picture, cameras, (96, 72), level=quality_level)


def test_processor_and_card_see_the_same_people_parts_and_distances() -> None:
    picture = _pictured()
    by_card, by_processor = (_views(0, picture, fast=fast) for fast in (False, True))
    assert np.mean(by_card.person != by_processor.person) < 0.002
    same = by_card.person == by_processor.person
    assert np.mean((by_card.part != by_processor.part)[same]) < 0.002
    apart = np.abs(by_card.distance_m - by_processor.distance_m)[same & (by_card.person > 0)]
    assert np.percentile(apart, 99) < 0.005


def test_processor_lights_cloth_as_the_card_does() -> None:
    picture = _pictured()
    by_card, by_processor = (_views(0, picture, fast=fast) for fast in (False, True))
    # Cloth has no highlights; a sheen at the edges is left out by the processor.
    cloth = (by_card.person == by_processor.person) & (by_card.person > 0)
    apart = np.abs(by_card.luminance_01 - by_processor.luminance_01)[cloth]
    assert np.median(apart) < 0.012


def test_patterned_cloth_shows_its_pattern_near_and_its_mean_colour_far(
    renderer: Renderer,
) -> None:
    def contrast(size_px: tuple[int, int]) -> float:
        image = renderer.image(_pictured(1), figures.camera(half_deg=25), size_px).astype(float)
        height, width = image.shape[:2]
        chest = image[
            int(0.62 * height) : int(0.75 * height), int(0.47 * width) : int(0.53 * width)
        ]
        return float(chest[..., 1].std() / chest[..., 1].mean())

    near, far = contrast((640, 480)), contrast((96, 72))
    assert near > 0.3
    assert far < 0.15


@pytest.mark.parametrize("quality", [LIGHTEST, FAITHFUL], ids=["processor", "card"])
def test_every_shape_of_a_face_is_drawn(quality: Quality) -> None:
    base, camera = figures.picture(1), figures.camera()

    def smiling(character: Character, shape: str) -> Character:
        """Return a character whose only shape, by this name, is a grin from ear to ear."""
        smiles = [mesh.morphs["smile"] for mesh in character.levels]
        grins = [replace(smile, delta_m=20 * smile.delta_m) for smile in smiles]
        levels = zip(character.levels, grins, strict=True)
        return replace(
            character, levels=tuple(replace(mesh, morphs={shape: grin}) for mesh, grin in levels)
        )

    images = []
    try:
        renderer = Renderer(quality=quality)
    except StageError as problem:
        pytest.skip(str(problem))
    with renderer:
        at_rest = renderer.image(base, camera, (96, 72))
        for weights, shape in zip(np.eye(len(MORPHS)), MORPHS, strict=True):
            people = replace(base.people, morphs_01=weights[None])
            cast = (smiling(base.cast[0], shape),)
            images.append(renderer.image(replace(base, cast=cast, people=people), camera, (96, 72)))
    assert not np.array_equal(at_rest, images[0])
    assert all(np.array_equal(images[0], image) for image in images)


def test_fading_darkens_people_and_room_alike(renderer: Renderer) -> None:
    camera = figures.camera()
    full = renderer.image(_pictured(), camera, (160, 120)).astype(float)
    half = renderer.image(replace(_pictured(), brightness_01=0.5), camera, (160, 120)).astype(float)
    bright = full.min(axis=2) > 60
    assert (half[bright] / full[bright]).mean() == pytest.approx(0.5 ** (1 / 2.2), abs=0.02)
    assert (half[bright] / full[bright]).std() < 0.02


def test_drawing_again_gives_the_same_bytes(renderer: Renderer) -> None:
    camera = figures.camera()
    first = renderer.image(_pictured(), camera, (160, 120))
    renderer.image(_pictured(2), figures.camera(yaw_deg=30), (160, 120))
    assert np.array_equal(first, renderer.image(_pictured(), camera, (160, 120)))


def test_people_who_leave_and_come_back_are_drawn_at_their_new_level(renderer: Renderer) -> None:
    picture, camera = _pictured(2), figures.camera()

    target = EyeTarget(renderer.context, (160, 120), 0)
    images = []
    for levels in ([2, 2], [-1, 2], [0, 2], [2, 2]):
        drawn = renderer.draw(picture, [camera], [target], levels=np.array(levels))
        assert levels == drawn.level.tolist()
        images.append(target.read())
    target.release()
    assert np.array_equal(images[0], images[3])
    assert not np.array_equal(images[0], images[1])
    assert not np.array_equal(images[0], images[2])


def test_room_is_drawn_when_everybody_is_out_of_view(renderer: Renderer) -> None:
    picture, behind = _pictured(), figures.camera(yaw_deg=180)
    image = renderer.image(picture, behind, (160, 120))
    assert renderer.last_choice.level.tolist() == [-1, -1, -1]
    assert np.array_equal(image, renderer.image(figures.picture(0), behind, (160, 120)))
    assert renderer.image(picture, figures.camera(), (160, 120)).std() > image.std()


def _counted(monkeypatch: pytest.MonkeyPatch, *names: str) -> Counter[str]:
    """Return how often functions of `visavis.stage.processor.crowd` are called from now on."""
    calls: Counter[str] = Counter()

    def counting(name: str, called: Callable[..., object]) -> Callable[..., object]:
        def call(*args: object, **named: object) -> object:
            calls[name] += 1
            return called(*args, **named)

        return call

    for name in names:
        owner_name, _, attribute = name.rpartition(".")
        owner = getattr(processor_crowd, owner_name) if owner_name else processor_crowd
        monkeypatch.setattr(owner, attribute, counting(name, getattr(owner, attribute)))
    return calls


def test_change_of_level_writes_only_whoever_changed(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = _counted(
        monkeypatch,
        "model",
        "coarser",
        "ProcessorCrowd._lay_out_afresh",
        "ProcessorCrowd._constant_part",
    )
    picture = _pictured(4)
    crowd = renderer.crowd_of(picture)
    everyone = np.ones(4, np.bool_)

    def spent(*levels: int) -> dict[str, int]:
        calls.clear()
        crowd.choose(np.array(levels), everyone)
        return dict(calls)

    characters = len({id(c) for c in picture.cast})
    assert {
        "model": characters,
        "coarser": characters,
        "ProcessorCrowd._lay_out_afresh": 1,
        "ProcessorCrowd._constant_part": 8,
    } == spent(1, 1, 1, 1)
    # One person is there twice, from near and from far.
    assert {"model": 1, "coarser": 1, "ProcessorCrowd._constant_part": 2} == spent(1, 2, 1, 1)
    assert {"ProcessorCrowd._constant_part": 2} == spent(1, 1, 1, 1)
    assert {"ProcessorCrowd._constant_part": 2} == spent(1, 2, 1, 1)
    assert {} == spent(1, 2, 1, 1)


def test_people_look_the_same_whatever_levels_they_had_before(renderer: Renderer) -> None:
    picture, camera = _pictured(6), figures.camera()
    rng = np.random.default_rng(5)
    history = [np.full(6, 2), *rng.integers(-1, 3, (6, 6)), np.zeros(6, np.int64)]
    target = EyeTarget(renderer.context, (160, 120), 0)

    def drawn(picture: Picture, levels: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
        renderer.draw(picture, [camera], [target], levels=levels)
        return target.read()

    crowd = renderer.crowd_of(picture)
    seen = [drawn(picture, levels) for levels in history]
    assert renderer.crowd_of(picture) is crowd
    for levels, image in zip(history, seen, strict=True):
        # Other people of the same looks are a crowd without a past.
        fresh = replace(picture, cast=tuple(replace(c) for c in picture.cast))
        assert np.array_equal(drawn(fresh, levels), image), levels
    target.release()


def test_rows_kept_for_people_are_bounded_by_the_most_they_needed(renderer: Renderer) -> None:
    picture = _pictured(6)
    crowd = renderer.crowd_of(picture)
    assert isinstance(crowd, processor_crowd.ProcessorCrowd)
    most = 0
    for levels in np.random.default_rng(6).integers(0, 3, (60, 6)):
        crowd.choose(levels, np.ones(6, np.bool_))
        room = crowd._room
        assert room is not None
        used = int(crowd._sizes(np.arange(12)).sum())
        most = max(most, used)
        free = sum(end - start for start, end in room.free.stretches)
        assert len(room.positions) == used + free
        assert len(room.positions) <= (1 + processor_crowd.SPARE_01) * most


def test_triangles_have_room_as_people_come_nearer_one_by_one(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = _counted(monkeypatch, "ProcessorCrowd._lay_out_afresh")
    cast = 40 * load_cast()[:1]
    picture = Picture(0, figures.plain_room(), cast, figures.standing(cast, 40 * [(0, 0, -3)]))
    crowd = renderer.crowd_of(picture)
    assert isinstance(crowd, processor_crowd.ProcessorCrowd)
    grown_alone = 0
    for near in range(41):
        room, times = crowd._room, calls.total()
        rows = 0 if room is None else len(room.corners)
        crowd.choose(np.where(np.arange(40) < near, 1, 2), np.ones(40, np.bool_))
        assert crowd._room is not None
        assert crowd._triangles() <= len(crowd._room.corners)
        assert 12 * len(crowd._room.corners) == crowd._room.indices.size
        grown_alone += len(crowd._room.corners) > rows and calls.total() == times
    assert grown_alone


@pytest.mark.parametrize("odd", [np.nan, np.inf, 1e30])
def test_light_that_is_no_number_is_looked_up_within_the_table(odd: float) -> None:
    table = np.array([0.0, 0.25, 1.0], np.float32)
    assert looked_up(table, np.float32(odd)) == 1.0


def test_far_people_look_as_large_as_near_ones_with_fewer_triangles(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    cast = load_cast()[:6]
    places = [(0.9 * (i - 2.5), 0.0, -4.5) for i in range(6)]
    room = replace(figures.plain_room(), props=(), background_srgb=(0, 255, 0))
    picture = Picture(0, room, cast, figures.standing(cast, places))
    seen, shown = [], []
    for limit in (55.0, 1e-3):
        monkeypatch.setattr("visavis.stage.renderer.TEXTURED_PX_PER_M", limit)
        image = renderer.image(picture, figures.camera(half_deg=40), (240, 180)).astype(int)
        seen.append((image != (0, 255, 0)).any(axis=2).sum())
        shown.append(image[(image != (0, 255, 0)).any(axis=2)].mean(axis=0))
    assert seen[0] == pytest.approx(seen[1], rel=0.03)
    assert shown[0] == pytest.approx(shown[1], abs=6)


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 30)), max_size=40))
def test_rows_taken_never_overlap_and_join_when_given_back(steps: list[tuple[bool, int]]) -> None:
    free, owner = FreeRows(100), np.zeros(100, np.int64)
    held: dict[int, tuple[int, int]] = {}
    for k, (takes, number) in enumerate(steps, 1):
        if takes:
            start = free.take(number)
            if start is None:
                assert not np.convolve(owner == 0, np.ones(number), "valid").max() >= number
                continue
            assert not owner[start : start + number].any()
            owner[start : start + number] = k
            held[k] = start, number
        elif held:
            start, count = held.pop(sorted(held)[number % len(held)])
            free.give(start, count)
            owner[start : start + count] = 0
        assert (owner == 0).sum() == sum(end - start for start, end in free.stretches)
    for start, count in held.values():
        free.give(start, count)
    assert [(0, 100)] == free.stretches


# ---- kernels --------------------------------------------------------------------------------


FACING_Z = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
NO_PICTURE = np.zeros((3, 0, 2), np.float32)


def _kept(
    eye_m: npt.ArrayLike, pixel: npt.NDArray[np.float32] = NO_PICTURE, *, between: bool = True
) -> bool:
    """Tell whether a triangle is kept whose corners fall on `pixel` (3, e, 2) of 20 by 10."""
    count, out = np.zeros(1, np.int64), np.zeros((1, 3), np.int32)
    drawn = np.zeros(3, np.bool_)
    gather_front(
        np.array([0]),
        PeopleRows(np.array([0]), np.array([[0, 3]]), np.array([0]), np.array([False])),
        GroupedTriangles(
            triangles=np.array([[0, 1, 2]], np.int32),
            stretches=np.array([[[0, 1]]]),
            single_sided=np.array([True]),
            group_of=np.array([[0]]),
            first=np.array([0]),
        ),
        np.concatenate([FACING_Z, np.zeros((3, 3), np.float32)], axis=1),
        pixel,
        Views(
            np.asarray(eye_m, np.float32).reshape(1, 3),
            np.tile(np.array([20, 10], np.float32), (pixel.shape[1], 1)),
            between,
        ),
        drawn,
        count,
        out,
    )
    assert drawn.all() == drawn.any() == (count[0] == 1)
    return bool(count[0])


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_only_triangles_that_face_an_eye_are_kept(x: float, y: float, z: float) -> None:
    eye_m = np.array([3 * x, 3 * y, 3 * z + 0.5], np.float32)
    assert _kept(eye_m) == (eye_m[2] > 0)


@pytest.mark.parametrize(
    ("pixels", "kept"),
    [
        ([[[3.1, 3.1], [3.9, 3.1], [3.1, 3.9]]], True),
        ([[[2.6, 3.1], [3.4, 3.1], [2.6, 3.9]]], False),  # between the middles of two columns
        ([[[3.1, 2.6], [3.9, 2.6], [3.1, 3.4]]], False),  # and of two rows
        ([[[2.6, 3.1], [3.4, 3.1], [2.6, 3.9]], [[2.4, 3.1], [3.2, 3.1], [2.4, 3.9]]], True),
        ([[[3.1, 3.1], [3.1, 3.9], [3.9, 3.1]]], False),  # turned away
        ([[[-9, 1], [-1, 1], [-9, 9]]], False),
        ([[[21, 1], [29, 1], [21, 9]]], False),
        ([[[1, -9], [9, -1], [1, -1]]], False),
        ([[[1, 11], [9, 11], [1, 19]]], False),
        ([[[-9, -9], [40, -9], [-9, 40]]], True),
        ([[[np.nan, np.nan], [-9, 1], [-9, 9]]], True),  # in part beside the eye
    ],
)
def test_triangles_that_fall_on_no_pixel_of_any_eye_are_left_out(
    pixels: list[list[list[float]]], kept: bool
) -> None:
    eye_m = (0.2, 0.2, 1.0)
    on = np.ascontiguousarray(np.array(pixels, np.float32).transpose(1, 0, 2))
    assert kept == _kept(eye_m, on)


def test_samples_lie_between_the_middles_of_pixels() -> None:
    on = np.array([[[2.6, 3.1]], [[3.4, 3.1]], [[2.6, 3.9]]], np.float32)
    assert _kept((0.2, 0.2, 1.0), on, between=False)


def test_pictures_are_the_same_without_what_falls_on_no_pixel(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture, camera = figures.picture(5), figures.camera(aspect=1.5)
    sizes = (48, 32), (150, 100)
    without = [renderer.image(picture, camera, size) for size in sizes]
    monkeypatch.setattr("visavis.stage.renderer._grid", lambda *_: None)
    for expected, image in zip(
        [renderer.image(picture, camera, size) for size in sizes], without, strict=True
    ):
        assert np.array_equal(expected, image)


def test_a_head_asked_for_once_more_sees_what_fell_on_no_pixel_before(renderer: Renderer) -> None:
    picture, before = figures.picture(5), figures.camera(aspect=1.0)
    turned = Pose(before.pose.position_m, quat_from_yaw_pitch_deg(8.0))
    camera = replace(before, pose=turned)
    target = EyeTarget(renderer.context, (120, 120), 0)
    renderer.draw(picture, [camera], [target])
    expected = target.read()
    renderer.draw(picture, [before], [target], late=lambda: [camera])
    assert np.array_equal(expected, target.read())
    target.release()


def _lit(place_m: npt.ArrayLike, light: Light, *, textured: bool) -> npt.NDArray[np.float32]:
    room = replace(figures.plain_room(), lights=(light,), sky=np.zeros(3), ground=np.zeros(3))
    place = np.asarray(place_m, np.float32).reshape(-1, 3)
    n, out = len(place), np.zeros((np.size(place) // 3, 3), np.float32)
    light_points(
        place,
        np.tile(np.float32([0, 1, 0]), (n, 1)),
        np.ones((n, 3), np.float32),
        np.zeros(n, np.float32),
        np.full(n, textured),
        *lamp_rows(room),
        CODES_OF_ROOT,
        FACTORS_OF_ROOT,
        out,
    )
    return out


def test_light_of_a_point_falls_with_the_square_of_the_distance() -> None:
    lamp = Light("point", np.full(3, 0.4), np.array([0.0, 1.0, 0.0]))
    near, far = _lit([[0, 0, 0], [0, -1, 0]], lamp, textured=True)
    assert near**2.2 == pytest.approx(0.4, rel=5e-3)
    assert far**2.2 == pytest.approx(0.1, rel=5e-3)


def test_a_spot_is_dark_outside_its_cone() -> None:
    lamp = Light("spot", np.ones(3), np.array([0.0, 2.0, 0.0]), np.array([0.0, -1.0, 0.0]), 30.0)
    inside, outside = _lit([[0, 0, 0], [1.3, 0, 0]], lamp, textured=False)
    assert inside.min() > 0.4
    assert outside.max() == 0.0


def test_light_in_codes_is_srgb_up_to_a_half() -> None:
    lamp = Light("sun", np.full(3, 0.2140), direction=np.array([0.0, -1.0, 0.0]))
    assert _lit([[0, 0, 0]], lamp, textured=False)[0] == pytest.approx(0.5, abs=1.5e-3)


def test_a_baked_room_has_vertices_where_the_light_changes_and_keeps_its_surface() -> None:
    room = figures.plain_room()
    plain = room_vertices(room.props)
    baked = baked_room(plain, room)
    assert len(plain.indices) == sum(run.count for run in plain.runs)
    assert 60 < len(baked.vertices.indices) // 3 < 2000

    def area_m2(laid_out: object) -> float:
        vertices, indices = laid_out.vertices, laid_out.indices  # type: ignore[attr-defined]
        a, b, c = (vertices["place_m"][indices.reshape(-1, 3)[:, k]] for k in range(3))
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)

    assert area_m2(plain) == pytest.approx(area_m2(baked.vertices), rel=1e-5)


def test_edges_of_a_baked_room_at_one_place_are_cut_alike() -> None:
    room = figures.plain_room()
    baked = baked_room(room_vertices(room.props), room).vertices
    corners = np.round(baked.vertices["place_m"][baked.indices] / 1e-3).astype(int)
    triangles = corners.reshape(-1, 3, 3)
    edges: dict[tuple[tuple[int, ...], ...], int] = {}
    for triangle in triangles.tolist():
        for k in range(3):
            ends = tuple(sorted((tuple(triangle[k]), tuple(triangle[(k + 1) % 3]))))
            edges[ends] = edges.get(ends, 0) + 1
    places = np.unique(corners.reshape(-1, 3), axis=0)
    for (a, b), times in edges.items():
        if times > 1:
            continue
        # An edge used once is the border of the room: nothing else lies between its ends.
        line, along = np.subtract(b, a), places - np.array(a)
        share = along @ line / (line @ line)
        off = np.linalg.norm(along - share[:, None] * line, axis=1)
        assert not ((share > 0.01) & (share < 0.99) & (off < 2)).any()

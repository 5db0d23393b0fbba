"""Identity images against rays followed one by one."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.stage import figures
from visavis.lab.geometry import rotate
from visavis.stage.errors import StageError
from visavis.stage.identity import IdentityBuffer, IdentityImages
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Camera, Picture

LEVEL = 1


@pytest.fixture(scope="module")
def buffer() -> Iterator[IdentityBuffer]:
    try:
        made = IdentityBuffer()
    except StageError as problem:
        pytest.skip(str(problem))
    with made:
        yield made


def _triangles(picture: Picture) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return corners (t, 3, 3) in world and (person, part) (t, 2) of everything drawn."""
    corners, tags = [], []
    for prop in picture.room.props:
        mesh = prop.mesh
        corners.append(mesh.vertices_m[mesh.triangles].astype(float))
        tags.append(np.zeros((len(mesh.triangles), 2), int))
    for i, character in enumerate(picture.cast):
        mesh = character.measuring[LEVEL]
        placed = forward(
            character.skeleton, picture.people.root_m[i], picture.people.orientation_wxyz[i]
        )
        rest = mesh.vertices_m.astype(float)
        smile = mesh.morphs["smile"]
        rest[smile.vertices] += picture.people.morphs_01[i, 5] * smile.delta_m
        world = np.zeros_like(rest)
        for k in range(4):
            joint = mesh.joints[:, k]
            local = rest - character.skeleton.rest_m[joint]
            moved = placed.position_m[joint] + rotate(placed.orientation_wxyz[joint], local)
            world += mesh.weights[:, k, None] * moved
        corners.append(world[mesh.triangles])
        part = mesh.triangle_part.astype(int)
        tags.append(np.stack([np.full(len(part), i + 1), part], axis=1))
    return np.concatenate(corners), np.concatenate(tags)


def _cast_rays(
    picture: Picture, camera: Camera, width: int, height: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    corners, tags = _triangles(picture)
    _, rays = figures.rays(camera, (width, height))
    nearest = np.full(len(rays), np.inf)
    seen = np.zeros((len(rays), 2), int)
    for (a, b, c), tag in zip(corners, tags, strict=True):
        e1, e2, s = b - a, c - a, camera.pose.position_m - a
        if np.dot(np.cross(e1, e2), s) <= 0:
            continue
        p = np.cross(rays, e2)
        det = p @ e1
        with np.errstate(divide="ignore", invalid="ignore"):
            u = p @ s / det
            q = np.cross(s, e1)
            v = rays @ q / det
            t = (q @ e2) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0.05) & (t < nearest)
        nearest[hit] = t[hit]
        seen[hit] = tag
    return seen.reshape(height, width, 2), nearest.reshape(height, width)


def _edges(
    tags: npt.NDArray[np.int64], distance_m: npt.NDArray[np.float64]
) -> npt.NDArray[np.bool_]:
    """Tell which pixels have a neighbour of another tag, or one much nearer or farther."""
    edge = np.zeros(tags.shape[:2], bool)
    flat = np.where(np.isfinite(distance_m), distance_m, 1e3)
    for axis in (0, 1):
        other = np.abs(np.diff(tags[..., 0] * 64 + tags[..., 1], axis=axis)) > 0
        other |= np.abs(np.diff(flat, axis=axis)) > 0.1
        before = [slice(None), slice(None)]
        after = [slice(None), slice(None)]
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        edge[tuple(before)] |= other
        edge[tuple(after)] |= other
    return edge


def test_pixels_agree_with_ray_casting_but_at_edges(buffer: IdentityBuffer) -> None:
    base = figures.picture(3)
    morphs = base.people.morphs_01.copy()
    morphs[1, 5] = 1.0
    turns = base.people.orientation_wxyz.copy()
    bent = base.cast[0].skeleton.index("left_lower_arm")
    turns[:, bent] = (np.cos(0.5), 0.0, np.sin(0.5), 0.0)
    picture = replace(base, people=replace(base.people, morphs_01=morphs, orientation_wxyz=turns))
    cameras = [
        figures.camera((0.0, 1.5, 0.2), half_deg=30),
        figures.camera((1.0, 1.2, -0.4), yaw_deg=40, pitch_deg=-8, half_deg=30),
    ]
    images = buffer.views(picture, cameras, (96, 72), level=LEVEL)
    for i, camera in enumerate(cameras):
        expected, distance_m = _cast_rays(picture, camera, 96, 72)
        inner = ~_edges(expected, distance_m)
        assert inner.mean() > 0.65
        found = np.stack([images.person[i], images.part[i]], axis=-1)
        wrong = (expected != found).any(axis=-1) & inner
        assert wrong.mean() <= 0.005
        both = inner & ~wrong & np.isfinite(distance_m)
        off_m = np.abs(images.distance_m[i][both] - distance_m[both])
        assert off_m.max() < 0.01  # grazing surfaces; pixels are placed to 1/256
        assert np.median(off_m) < 1e-4
        assert (np.isnan(images.distance_m[i]) == np.isinf(distance_m))[inner].mean() > 0.995


def test_each_view_of_an_atlas_is_what_it_is_alone(buffer: IdentityBuffer) -> None:
    picture = figures.picture(2)
    cameras = [figures.camera((0.1 * i, 1.4, 0.5), yaw_deg=3.0 * i) for i in range(7)]
    together = buffer.views(picture, cameras, (40, 32), level=LEVEL)
    alone = [buffer.views(picture, [c], (40, 32), level=LEVEL) for c in cameras]
    for i, one in enumerate(alone):
        assert (one.person[0] == together.person[i]).all()
        assert (one.part[0] == together.part[i]).all()
        # A card computes what lies between corners from where they are in the atlas: of an eye's
        # picture that is a few parts in 100,000, a hundredth of a step of 8 bits.
        assert one.luminance_01[0] == pytest.approx(together.luminance_01[i], abs=0.01 / 255)


def test_person_ids_are_exact_beyond_one_byte(buffer: IdentityBuffer) -> None:
    picture = figures.picture(300)
    people = replace(picture.people, root_m=np.tile((0.0, 0.9, 40.0), (300, 1)))
    people.root_m[299] = (0.0, 1.0, -2.0)
    images = buffer.views(
        replace(picture, people=people), [figures.camera()], (32, 24), level=LEVEL
    )
    assert {0, 300} == set(np.unique(images.person).tolist())


def test_darker_room_is_darker_in_luminance(buffer: IdentityBuffer) -> None:
    def mean_luminance(images: IdentityImages) -> float:
        return float(images.luminance_01.mean())

    picture = figures.picture(1)
    dim = replace(picture, brightness_01=0.5)
    camera = [figures.camera()]
    bright = mean_luminance(buffer.views(picture, camera, (32, 24)))
    assert mean_luminance(buffer.views(dim, camera, (32, 24))) == pytest.approx(
        bright / 2, rel=1e-3
    )

"""Where rays end, against the identity pass that draws the same people and room."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stage import figures
from visavis.lab.geometry import Pose
from visavis.stage.errors import StageError
from visavis.stage.identity import IdentityBuffer
from visavis.stimuli.characters.skinning import skin_vertices
from visavis.stimuli.dressing.audience import audience_picture
from visavis.stimuli.dressing.picture_of import NOBODY, NOWHERE
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Panel, Picture, Sheet
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import audience_scene
from visavis.stimuli.surfaces import Surfaces

NAMES = [f"{g}_{i:02d}" for g, n in (("female", 6), ("male", 5)) for i in range(1, n + 1)]
EYE_M = np.array([0.0, 1.2, 0.3])
SIZE_PX = (96, 72)


@cache
def audience() -> Picture:
    scene = audience_scene(NAMES)
    n = len(NAMES)
    return audience_picture(SceneFrame(scene, 0, np.tile([0.0, 0, 1], (n, 1)), np.ones(n)))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10), st.integers(0, 10**6), st.floats(0.05, 0.9), st.floats(0.05, 0.9))
def test_a_ray_to_a_point_of_a_body_ends_there_or_before(
    person: int, triangle: int, u: float, v: float
) -> None:
    picture = audience()
    person %= len(picture.cast)
    character = picture.cast[person]
    mesh = character.levels[0]
    placement = forward(
        character.skeleton, picture.people.root_m[person], picture.people.orientation_wxyz[person]
    )
    morphs_01 = picture.people.morphs_01[person]
    vertices = skin_vertices(mesh, character.skeleton, placement, morphs_01).astype(float)
    a, b, c = vertices[mesh.triangles[triangle % len(mesh.triangles)]]
    share = v * (1.0 - u)
    point = a + u * (b - a) + share * (c - a)
    to = point - EYE_M
    far_m = float(np.linalg.norm(to))
    ends = Surfaces().ends(picture, EYE_M[None], to[None] / far_m)
    assert ends.distance_m[0] <= far_m + 1e-5
    assert ends.name[0]


def test_a_ray_ends_on_the_board_before_the_wall_behind_it() -> None:
    pose = Pose(np.array([0.0, 1.2, -1.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    picture = replace(audience(), panels=(Panel("How near?", (), pose, (0.4, 0.2)),))
    ahead = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    ends = Surfaces().ends(picture, np.repeat(EYE_M[None], 2, axis=0), ahead)
    assert pytest.approx(1.3, abs=1e-6) == ends.distance_m[0]
    assert "board" == ends.name[0]
    assert "board" != ends.name[1]


def test_a_ray_ends_on_a_flat_stimulus() -> None:
    pose = Pose(np.array([0.2, 1.2, -1.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    sheet = Sheet(np.zeros((2, 4, 4), np.uint8), pose, (0.4, 0.2))
    picture = Picture(0, NOWHERE, (), NOBODY, sheets=(sheet,))
    towards = np.array([[0.39, 0.0, -1.3], [-0.01, 0.0, -1.3]])
    towards[:, 1] = 1.2 - EYE_M[1]
    far_m = np.linalg.norm(towards, axis=1)
    ends = Surfaces().ends(picture, np.repeat(EYE_M[None], 2, axis=0), towards / far_m[:, None])
    assert pytest.approx(far_m[0], abs=1e-6) == ends.distance_m[0]
    assert ["stimulus", ""] == list(ends.name)


def test_where_nothing_is_a_ray_ends_nowhere() -> None:
    empty = replace(audience(), room=replace(audience().room, props=()))
    ends = Surfaces().ends(empty, EYE_M[None], np.array([[0.0, 0.0, 1.0]]))
    assert (np.inf, "") == (ends.distance_m[0], ends.name[0])


@pytest.mark.slow
def test_rays_end_on_whom_and_where_the_identity_pass_shows() -> None:
    base = audience()
    picture = replace(base, cast=tuple(replace(c, levels=c.measuring) for c in base.cast))
    camera = figures.camera(tuple(EYE_M), half_deg=30)
    ends = Surfaces().ends(picture, *figures.rays(camera, SIZE_PX))
    try:
        with IdentityBuffer() as buffer:
            image = buffer.views(base, [camera], SIZE_PX, level=0)
    except StageError as problem:
        pytest.skip(str(problem))
    names = np.array(["", *(c.name for c in picture.cast)], dtype=object)
    on_people = np.where(np.isin(ends.name, names), ends.name, "")
    drawn = names[image.person[0].ravel()]

    assert 0.15 < (drawn != "").mean()
    assert 0.98 < (drawn == on_people).mean()  # edges of people are within half a pixel
    same = (drawn == on_people) & np.isfinite(image.distance_m[0].ravel())
    off_m = np.abs(ends.distance_m - image.distance_m[0].ravel())[same]
    assert 0.002 > np.median(off_m)
    assert 0.98 < (off_m < 0.02).mean()

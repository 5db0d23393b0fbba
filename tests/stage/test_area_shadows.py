"""Shadows of lamps with an area: sharp where things touch, softer the farther things are away."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from tests.stage import figures
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg
from visavis.stage.errors import StageError
from visavis.stage.frame_truth import DRAWN_VIEWS, SHADOWS
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.picture import Camera, Light, Room

SIZE_PX = (240, 240)
WIDE_M = 2.0
LAMPS = {
    "sun": Light("sun", np.full(3, 0.7), direction=np.array([0, -1.0, 0]), casts_shadow=True),
    "spot": Light(
        "spot",
        np.full(3, 6.0),
        np.array([0, 3.0, -3.0]),
        np.array([0, -1.0, 0]),
        60.0,
        casts_shadow=True,
    ),
}


@pytest.fixture(scope="module", params=["area", "maps"])
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    try:
        made = Renderer(quality=Quality(samples=0, shadows=request.param, shadow_map_px=2048))
    except StageError as problem:
        pytest.skip(str(problem))
    with made:
        yield made


def edge_m(renderer: Renderer, lamp: str, high_m: float) -> float:
    """Return how wide (m) the edge is of the shadow of half a floor's roof so high above it."""
    floor = figures.plane("floor", (-2, 0, -5), (0, 0, 4), (4, 0, 0), (150, 150, 150))
    roof = figures.plane("roof", (-2, high_m, -5), (0, 0, 4), (2, 0, 0), (90, 90, 90))
    grey = np.full(3, 0.2)
    room = Room("half", (floor, replace(roof, casts_shadow=True)), (LAMPS[lamp],), grey, grey)
    # Beneath the roof, above the floor; the edge lies below x = 0.
    pose = Pose(np.array([0.0, 0.04, -3.0]), quat_from_yaw_pitch_deg(0.0, -90.0))
    wide = WIDE_M / 2 / 0.04
    camera = Camera(pose, -wide, wide, -wide, wide, near_m=0.01)
    nobody = replace(figures.picture(1), room=room, cast=(), people=figures.standing((), []))
    image = renderer.image(nobody, camera, SIZE_PX)
    codes: Vector = image[100:140].mean(axis=(0, 2))
    share = (codes - codes[:40].mean()) / (codes[-40:].mean() - codes[:40].mean())
    assert codes[-40:].mean() > codes[:40].mean() + 30
    return float(((share > 0.1) & (share < 0.9)).sum() * WIDE_M / SIZE_PX[0])


@pytest.mark.parametrize("lamp", LAMPS)
def test_edges_soften_with_distance_where_lamps_have_an_area(renderer: Renderer, lamp: str) -> None:
    low, middle, high = (edge_m(renderer, lamp, h) for h in (0.06, 0.7, 1.4))
    if renderer.quality.shadows == "area":
        assert low < 0.05
        assert 2.0 * low < middle < high
        assert 0.1 < high < 0.45
    else:
        assert abs(high - low) < 0.05


def test_sessions_record_which_shadows_they_drew() -> None:
    described = next(f.description for f in DRAWN_VIEWS.fields if f.name == "shadows")
    assert described == "index into: " + ", ".join(SHADOWS)
    assert ("maps", "blobs", "none") == SHADOWS[:3]

"""What is drawn for a screen stands in the pixels through which the eyes see it."""

import numpy as np
import pytest

from visavis.lab.geometry import Pose
from visavis.lab.screen import FlatScreen
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import NOBODY, NOWHERE, eye_camera
from visavis.stage.renderer import ON_PROCESSOR, Renderer
from visavis.stimuli.picture import Picture

SCREEN = FlatScreen(0.5, 0.3, 500, 300, 0.6, 0.03, -0.02)
PLACE_M = np.array([0.0, 1.2, 0.0])
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def drawn_mark_px(mark_m, eye_m):
    """Draw a mark for an eye and return the middle of its pixels, right and down."""
    head = Pose(PLACE_M + eye_m, UPRIGHT)
    picture = Picture(0, NOWHERE, (), NOBODY, brightness_01=0.0, mark_m=PLACE_M + mark_m)
    with Renderer(quality=ON_PROCESSOR) as renderer:
        target = EyeTarget(renderer.context, (SCREEN.width_px, SCREEN.height_px), 0)
        renderer.draw(picture, [eye_camera(head, SCREEN.view_from(eye_m))], [target])
        bright = target.read().astype(int).sum(axis=2)
        target.release()
    rows, columns = np.nonzero(bright > bright.max() / 2)
    assert len(rows) > 3
    return columns.mean() + 0.5, rows.mean() + 0.5


@pytest.mark.parametrize("eye_m", [(0, 0, 0), (0.08, -0.03, 0.1), (-0.15, 0.1, -0.2)])
@pytest.mark.parametrize("mark_m", [(0.05, 0.02, -0.6), (-0.2, 0.1, -1.8), (0.3, -0.15, -3.0)])
def test_a_mark_is_drawn_where_the_line_from_the_eye_to_it_crosses_the_screen(mark_m, eye_m):
    eye, mark = np.array(eye_m, float), np.array(mark_m)
    to = (mark - eye) / np.linalg.norm(mark - eye)
    crossing = SCREEN.meets_m(eye[None], to[None])
    if not SCREEN.is_on(crossing)[0]:
        pytest.skip("from there it is beside the screen")
    assert drawn_mark_px(mark, eye) == pytest.approx(SCREEN.pixels_of(crossing)[0], abs=1.0)

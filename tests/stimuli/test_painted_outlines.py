"""Outlines of painted areas: exact for rectangles, near for what is round, apart where it is."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest

from visavis.stimuli.areas import Area, pack_runs, unpack_runs
from visavis.stimuli.painted_outlines import MAX_CORNERS, Ints, outlines_of, painted_outlines

Mask = npt.NDArray[np.bool_]


def outlines_in(mask: Mask, tolerance_px: float = 1.0) -> list[Ints]:
    return outlines_of(unpack_runs(pack_runs(mask)), tolerance_px)


def within(outlines: list[Ints], shape: tuple[int, ...]) -> Mask:
    """Return which pixels' middles lie within an odd number of outlines."""
    y, x = (np.ravel(a) + 0.5 for a in np.indices(shape))
    polygons = [Area("one", tuple(map(tuple, o.tolist()))) for o in outlines]
    inside = np.zeros(x.shape, np.bool_)
    for polygon in polygons:
        inside ^= polygon.holds(x, y)
    return inside.reshape(shape)


def length_px(outline: Ints) -> float:
    closed = [*outline.tolist(), outline[0].tolist()]
    return float(sum(np.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(closed)))


def test_a_rectangle_has_its_four_corners() -> None:
    mask = np.zeros((40, 60), np.bool_)
    mask[5:25, 10:50] = True
    (outline,) = outlines_in(mask)
    assert {(10, 5), (50, 5), (50, 25), (10, 25)} == set(map(tuple, outline.tolist()))


def test_a_hole_and_a_part_of_its_own_have_outlines_of_their_own() -> None:
    mask = np.zeros((50, 80), np.bool_)
    mask[5:45, 5:45] = True
    mask[15:30, 15:30] = False
    mask[10:20, 60:75] = True
    outlines = outlines_in(mask)
    assert 3 == len(outlines)
    assert np.array_equal(mask, within(outlines, mask.shape))


def test_pixels_that_touch_at_a_corner_are_apart() -> None:
    mask = np.zeros((30, 30), np.bool_)
    mask[:10, :10] = mask[10:20, 10:20] = mask[20:, :10] = True
    outlines = outlines_in(mask)
    assert [4, 4, 4] == [len(o) for o in outlines]
    assert np.array_equal(mask, within(outlines, mask.shape))


@pytest.mark.parametrize("tolerance_px", [1.0, 3.0])
def test_a_disc_is_outlined_within_the_tolerance_by_few_corners(tolerance_px: float) -> None:
    y, x = np.indices((200, 200))
    (outline,) = outlines_in(np.hypot(x - 99.5, y - 99.5) < 80, tolerance_px)
    radii = np.hypot(*(outline - 100).T)
    assert np.abs(radii - 80).max() < 1.5
    assert 8 < len(outline) < 70
    assert length_px(outline) == pytest.approx(2 * np.pi * 80, rel=0.03)


def test_noise_and_speckles_have_no_more_corners_than_a_page_takes() -> None:
    mask = np.random.default_rng(1).random((200, 200)) < 0.6
    outlines = outlines_in(mask, 1.0)
    assert sum(map(len, outlines)) <= MAX_CORNERS
    assert [] == outlines_in(np.eye(1, dtype=np.bool_))
    # Without a tolerance, and few enough corners, an outline is that of the pixels.
    small = mask[:12, :12]
    outlines = outlines_in(small, 0.0)
    assert sum(map(len, outlines)) <= MAX_CORNERS
    assert np.array_equal(small, within(outlines, small.shape))


def test_what_the_edge_of_a_panorama_cuts_is_whole_across_it() -> None:
    mask = np.zeros((10, 40), np.bool_)
    mask[2:6, :4] = mask[2:6, 37:] = mask[4, 10:12] = True
    area = Area("sofa", pixels=pack_runs(mask))
    cut, whole = (painted_outlines(area, 0.5, around_px) for around_px in (0, 40))
    assert [[0, 4], [10, 12], [37, 40]] == sorted([o[:, 0].min(), o[:, 0].max()] for o in cut)
    assert [[-3, 4], [10, 12]] == sorted([o[:, 0].min(), o[:, 0].max()] for o in whole)
    everywhere = Area("floor", pixels=pack_runs(np.ones((3, 40), np.bool_)))
    (floor,) = painted_outlines(everywhere, 0.5, 40)
    assert (0, 40) == (floor[:, 0].min(), floor[:, 0].max())

"""Outlines of painted areas: along the edges of their pixels, with few corners."""

from collections import defaultdict
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.stimuli.areas import Area, Values, unpack_runs

Ints = npt.NDArray[np.int64]
MAX_CORNERS: Final = 400
"""Of all outlines of an area; of more the smallest bends are left out."""
STEPS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Ways along an edge, each a right turn after the one before (x right, y down)."""


def painted_outlines(area: Area, tolerance_px: float, around_px: int = 0) -> list[Values]:
    """Return the outlines (n, 2) of a painted area, as `outlines_of` does; of pixels too few for
    one its middle. In a picture that goes all around, `around_px` wide, what its edge cuts is
    whole: corners may lie beyond the edge.
    """
    runs = unpack_runs(area.pixels)
    if around_px:
        runs = _join_seam(runs, around_px)
    outlines = [one.astype(np.float64) for one in outlines_of(runs, tolerance_px)]
    return outlines or [np.array([area.middle()])]


def _join_seam(runs: npt.NDArray[np.int32], around_px: int) -> npt.NDArray[np.int32]:
    """Return runs with what lies beyond the last empty column moved to before the first."""
    changes = np.zeros(around_px + 1, np.int64)
    np.add.at(changes, runs[:, 1], 1)
    np.add.at(changes, runs[:, 2], -1)
    is_empty = np.cumsum(changes)[:-1] == 0
    if is_empty[0] or is_empty[-1] or not is_empty.any():
        return runs
    beyond = runs[:, 1] > np.flatnonzero(is_empty)[-1]
    whole: npt.NDArray[np.int32] = runs - beyond[:, None] * np.array(
        [0, around_px, around_px], np.int32
    )
    return whole


def outlines_of(runs: npt.NDArray[np.int32], tolerance_px: float) -> list[Ints]:
    """Return the outlines (n, 2) of pixels that are given as runs (k, 3) of row, first and end:
    x and y of their corners, holes and separate parts as outlines of their own, the longest first.

    No corner that is left out is farther from its outline than `tolerance_px`, at least where
    `MAX_CORNERS` are enough; what is smaller than that has no outline. Pixels that touch at a
    corner alone are separate. Corners are chosen as by Douglas and Peucker (Cartographica 10,
    1973).
    """
    loops = sorted(_loops(_edges(runs)), key=len, reverse=True)
    while True:
        outlines = [_simplify(loop, tolerance_px) for loop in loops]
        outlines = [outline for outline in outlines if len(outline) > 2]
        if sum(map(len, outlines)) <= MAX_CORNERS:
            return outlines
        tolerance_px *= 2


def _edges(runs: npt.NDArray[np.int32]) -> dict[tuple[int, int], list[int]]:
    """Return the ways (numbers of `STEPS`) that edges of the area go from each of their ends, with
    the area at their right.
    """
    row, first, end = runs.astype(np.int64).T
    top, left = row.min(), first.min()
    mask = np.zeros((row.max() - top + 3, end.max() - left + 2), np.int8)
    for y, begin, stop in zip(row - top, first - left, end - left, strict=True):
        mask[y + 1, begin + 1 : stop + 1] = 1
    ways: dict[tuple[int, int], list[int]] = defaultdict(list)
    down, across = np.diff(mask, axis=0), np.diff(mask, axis=1)
    for way, (change, sign, x_by, y_by) in enumerate(
        ((down, 1, -1, 0), (across, -1, 0, -1), (down, -1, 0, 0), (across, 1, 0, 0))
    ):
        y, x = np.nonzero(change == sign)
        for at in zip((x + x_by + left).tolist(), (y + y_by + top).tolist(), strict=True):
            ways[at].append(way)
    return ways


def _loops(ways: dict[tuple[int, int], list[int]]) -> list[Ints]:
    """Return closed lines of the places where edges turn; empties `ways`."""
    loops = []
    while ways:
        begin = at = next(iter(ways))
        corners, way = [], -1
        while at in ways:
            # Where two parts touch, the right turn stays with one's own.
            choice = (way + 1) % 4 if (way + 1) % 4 in ways[at] else ways[at][0]
            ways[at].remove(choice)
            if not ways[at]:
                del ways[at]
            if choice != way:
                corners.append(at)
            way = choice
            at = (at[0] + STEPS[way][0], at[1] + STEPS[way][1])
            if at == begin and (way + 1) % 4 not in ways.get(at, ()):
                break
        loops.append(np.array(corners, np.int64))
    return loops


def _simplify(loop: Ints, tolerance_px: float) -> Ints:
    """Return the corners of a closed line that stay."""
    far = int(np.argmax(((loop - loop[0]) ** 2).sum(axis=1)))
    closed = np.concatenate([loop, loop[:1]])
    stays = np.zeros(len(closed), np.bool_)
    stays[[0, far, len(loop)]] = True
    spans = [(0, far), (far, len(loop))]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        chord, between = closed[b] - closed[a], closed[a + 1 : b] - closed[a]
        length = np.hypot(*chord)
        off = between[:, 0] * chord[1] - between[:, 1] * chord[0]
        distances = np.abs(off) / length if length else np.hypot(*between.T)
        k = int(np.argmax(distances))
        if distances[k] > tolerance_px:
            stays[a + 1 + k] = True
            spans += [(a, a + 1 + k), (a + 1 + k, b)]
    return closed[:-1][stays[:-1]]

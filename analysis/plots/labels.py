"""Words beside points of a panel, placed by how wide they are drawn so that none hides another."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any, Final, TypeVar

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation

AWAY_PT: Final = 3.0
"""How far words stand from their point."""
FARTHER_PT: Final = (AWAY_PT, 9.0, 16.0)
"""How far they may, where there is no room nearer."""
ROOM_PT: Final = 1.0
"""What stays free around words."""
POINTS_PER_INCH: Final = 72.0

Box = tuple[float, float, float, float]
"""Left, bottom, right and top in pixels of a figure."""
Side = tuple[float, float]
"""Where words stand beside their point: left -1 or right 1, below -1 or above 1; 0 in line."""
SIDES: Final[Sequence[Side]] = (
    *((1, 1), (1, -1), (-1, 1), (-1, -1)),
    *((0, 1), (0, -1), (1, 0), (-1, 0)),
)
_HORIZONTAL: Final = {1: "left", 0: "center", -1: "right"}
_VERTICAL: Final = {1: "bottom", 0: "center", -1: "top"}
Group = TypeVar("Group")


@dataclass(frozen=True)
class Anchor:
    """A point of a panel in its data's units, and the side of it on which words stand."""

    point: tuple[float, float]
    side: Side
    away_pt: float = AWAY_PT


def settle(figure: Figure) -> None:
    """Give panels the places that they will have; the figure must be whole but for such words."""
    FigureCanvasAgg(figure)
    for _ in range(2):  # panels of a given aspect move once more
        figure.draw_without_rendering()


@dataclass(frozen=True, eq=False)
class Lettering:
    """A panel of a figure that is settled, and how words are drawn in it."""

    axes: Axes
    size_pt: float
    look: Mapping[str, Any]
    marks: Sequence[tuple[float, float]] = ()
    """Points, in the data's units, on which words lie only where there is no other room."""

    def write(self, words: str, anchor: Anchor) -> Annotation:
        """Write words at an anchor; they take no part in the layout."""
        across, up = anchor.side
        text = self.axes.annotate(
            words,
            anchor.point,
            (anchor.away_pt * across, anchor.away_pt * up),
            textcoords="offset points",
            fontsize=self.size_pt,
            ha=_HORIZONTAL[int(across)],
            va=_VERTICAL[int(up)],
            **self.look,
        )
        text.set_in_layout(False)
        return text

    def size_px(self, words: str) -> tuple[float, float]:
        """Return how wide and high words are drawn."""
        text = self.axes.text(0.5, 0.5, words, fontsize=self.size_pt, transform=self.axes.transAxes)
        drawn = text.get_window_extent()
        text.remove()
        return drawn.width, drawn.height

    def box(self, size_px: tuple[float, float], anchor: Anchor) -> Box:
        """Return the box of words of a size at an anchor, with the room around them."""
        figure = self.axes.get_figure(root=True)
        assert figure is not None  # noqa: S101 - axes that are drawn into have one
        px_per_pt = figure.dpi / POINTS_PER_INCH
        x, y = self.axes.transData.transform(anchor.point)
        wide, high = size_px
        away_px = anchor.away_pt * px_per_pt
        left = x + away_px * anchor.side[0] + wide * (anchor.side[0] - 1) / 2
        low = y + away_px * anchor.side[1] + high * (anchor.side[1] - 1) / 2
        room = ROOM_PT * px_per_pt
        return left - room, low - room, left + wide + room, low + high + room

    def marks_hidden(self, box: Box) -> int:
        """Return how many marks lie within a box."""
        if not self.marks:
            return 0
        x, y = self.axes.transData.transform(self.marks).T
        is_hidden = (box[0] <= x) & (x <= box[2]) & (box[1] <= y) & (y <= box[3])
        return int(is_hidden.sum())

    def is_inside(self, box: Box) -> bool:
        """Return whether a box lies within the panel."""
        left, low, right, top = (float(end) for end in self.axes.bbox.extents)
        is_across: bool = left <= box[0] and box[2] <= right
        is_up: bool = low <= box[1] and box[3] <= top
        return is_across and is_up


def overlap_px2(one: Box, other: Box) -> float:
    """Return how much of two boxes is the same."""
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(wide, 0.0) * max(high, 0.0)


def best_anchor(
    lettering: Lettering, words: str, anchors: Iterable[Anchor], taken: Sequence[Box]
) -> tuple[Anchor, Box, bool]:
    """Return the anchor where words lie within the panel, hide least of what is taken, are nearest
    and hide the fewest marks, the first of such; their box, and whether it is free and inside.
    """
    size_px = lettering.size_px(words)
    boxes = [(anchor, lettering.box(size_px, anchor)) for anchor in anchors]
    costs = [
        (
            not lettering.is_inside(box),
            sum(overlap_px2(box, other) for other in taken),
            anchor.away_pt,
            lettering.marks_hidden(box),
            k,
        )
        for k, (anchor, box) in enumerate(boxes)
    ]
    is_outside, hidden_px2, _, _, best = min(costs)
    anchor, box = boxes[best]
    return anchor, box, not is_outside and hidden_px2 == 0


def write_apart(
    lettering: Lettering,
    groups: Sequence[Group],
    words_of: Callable[[Group], str],
    point_of: Callable[[Group], tuple[float, float]],
    join: Callable[[Group, Group], Group],
) -> list[Annotation]:
    """Write the words of groups beside their points. Where there is no room for one, it is joined
    with the nearest of those before it, and all are placed anew.
    """
    left = list(groups)
    while True:
        anchors: list[tuple[str, Anchor]] = []
        taken: list[Box] = []
        for k, group in enumerate(left):
            point = point_of(group)
            here = [Anchor(point, side, away) for away in FARTHER_PT for side in SIDES]
            anchor, box, is_free = best_anchor(lettering, words_of(group), here, taken)
            if k and not is_free:
                nearest = min(range(k), key=lambda i: _apart(lettering, point_of(left[i]), point))
                left[nearest] = join(left[nearest], group)
                del left[k]
                break
            anchors.append((words_of(group), anchor))
            taken.append(box)
        else:
            return [lettering.write(words, anchor) for words, anchor in anchors]


def _apart(lettering: Lettering, one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the distance of two points in pixels."""
    (x, y), (u, v) = lettering.axes.transData.transform([one, other]).tolist()
    return hypot(x - u, y - v)

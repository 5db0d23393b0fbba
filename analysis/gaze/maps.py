"""Maps of gaze over a picture: how long people looked where, and where two conditions differ.

A map is a grid over the plane of a picture. Coordinates are tangents from the eye that sees it:
0, 0 straight ahead, x to the right, y up.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage, special
from scipy.sparse import coo_array, csgraph

Values = npt.NDArray[np.float64]
Labels = npt.NDArray[np.signedinteger[Any]]
SMOOTHING_DEG: Final = 1.0
"""Standard deviation of the smoothing, about the fovea's radius."""
CLUSTER_ALPHA: Final = 0.05
"""Cells with a t beyond this, two-sided, form clusters; a cluster below it is a difference."""
PERMUTATIONS: Final = 2000
MIN_PEOPLE: Final = 6
"""With fewer, no exchange of signs can be rarer than one in 20."""


@dataclass(frozen=True)
class Grid:
    """Cells over a picture that reaches `half_width` and `half_height` (tangents) to each side."""

    half_width: float
    half_height: float
    columns: int
    rows: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows from top to bottom, columns from left to right."""
        return self.rows, self.columns

    @property
    def reach(self) -> tuple[float, float, float, float]:
        """Where it ends: left, right, bottom, top."""
        return -self.half_width, self.half_width, -self.half_height, self.half_height

    def centres(self) -> tuple[Values, Values]:
        """Return x (columns,) and y (rows,) of the cells' centres, y from the top downwards."""
        x = (np.arange(self.columns) + 0.5) / self.columns * 2 - 1
        y = 1 - (np.arange(self.rows) + 0.5) / self.rows * 2
        return x * self.half_width, y * self.half_height

    def centres_deg(self) -> tuple[Values, Values]:
        """Return degrees to the right (columns,) and upwards (rows,) of the cells' centres."""
        x, y = self.centres()
        return np.degrees(np.arctan(x)), np.degrees(np.arctan(y))

    def area_deg2(self) -> Values:
        """Return the solid angle of every cell (rows, columns) in square degrees."""
        x, y = self.centres()
        cell = (2 * self.half_width / self.columns) * (2 * self.half_height / self.rows)
        far = 1 + x[None, :] ** 2 + y[:, None] ** 2
        area: Values = np.degrees(1.0) ** 2 * cell / far**1.5
        return area


def dwell_map(grid: Grid, x: Values, y: Values, seconds: Values) -> Values:
    """Return seconds per square degree (rows, columns) of gaze at tangents x, y (n,), smoothed.

    Gaze beyond the picture counts nowhere; what smoothing would carry beyond its edge is lost.
    """
    column = np.floor((x / grid.half_width + 1) / 2 * grid.columns).astype(np.int64)
    row = np.floor((1 - y / grid.half_height) / 2 * grid.rows).astype(np.int64)
    inside = (column >= 0) & (column < grid.columns) & (row >= 0) & (row < grid.rows)
    counts = np.zeros(grid.shape)
    np.add.at(counts, (row[inside], column[inside]), seconds[inside])
    sigma = np.tan(np.radians(SMOOTHING_DEG))
    cells = sigma * grid.rows / (2 * grid.half_height), sigma * grid.columns / (2 * grid.half_width)
    smooth: Values = ndimage.gaussian_filter(counts, cells, mode="constant", truncate=4.0)
    return smooth / grid.area_deg2()


@dataclass(frozen=True, eq=False)
class Cluster:
    """Neighbouring cells that differ in one direction: `cells` (rows, columns), its p."""

    cells: npt.NDArray[np.bool_]
    is_more: bool
    p: float


def clusters_of_difference(
    differences: Values, seed: int = 0, *, cell_deg2: Values | None = None
) -> list[Cluster]:
    """Return clusters of cells in which the differences of people (n, rows, columns) are not 0.

    With `cell_deg2` (rows, columns) the grid goes all around: cells count by their solid angle, the
    last column is beside the first, and at a pole all cells touch.

    Cluster-based permutation test (Maris & Oostenveld, 2007, J Neurosci Methods 164:177): cells
    with a t beyond the two-sided 5 % form clusters. Their summed t is compared with the largest of
    each exchange of signs of people. All exchanges are made where there are no more than
    `PERMUTATIONS`, else so many are drawn.

    Raises:
        ValueError: there are fewer than `MIN_PEOPLE`.
    """
    n = len(differences)
    if n < MIN_PEOPLE:
        raise ValueError(f"{n} people; {MIN_PEOPLE} are the fewest that can show a difference")
    limit = float(special.stdtrit(n - 1, 1 - CLUSTER_ALPHA / 2))
    here = _clusters(_t_values(differences, np.ones((1, n)))[0], limit, cell_deg2)
    if not here:
        return []
    if 2**n <= PERMUTATIONS:
        signs = np.array(list(product((1.0, -1.0), repeat=n)))
    else:
        random = np.random.default_rng(seed).choice((1.0, -1.0), (PERMUTATIONS - 1, n))
        signs = np.concatenate([np.ones((1, n)), random])  # what was observed is one of them
    largest = np.zeros(len(signs))
    for k in range(0, len(signs), 100):
        for i, t in enumerate(_t_values(differences, signs[k : k + 100])):
            largest[k + i] = max(
                (mass for _, mass, _ in _clusters(t, limit, cell_deg2)), default=0.0
            )
    return [
        Cluster(cells, is_more, float((largest >= mass - 1e-9).mean()))
        for cells, mass, is_more in here
    ]


def _t_values(differences: Values, signs: Values) -> Values:
    """Return t (permutations, rows, columns) of differences with exchanged signs; 0 without any."""
    n, shape = len(differences), differences.shape[1:]
    flat = differences.reshape(n, -1)
    mean = signs @ flat / n
    square = (flat**2).sum(axis=0)
    variance = np.maximum((square - n * mean**2) / (n - 1), 0.0)
    error = np.sqrt(variance / n)
    # Far from all gaze there is next to nothing, and next to nothing divided by itself.
    usable = error > 1e-6 * np.sqrt(square.max() / n)
    t: Values = np.divide(mean, error, out=np.zeros_like(mean), where=usable)
    return t.reshape(len(signs), *shape)


def _clusters(
    t: Values, limit: float, cell_deg2: Values | None
) -> list[tuple[npt.NDArray[np.bool_], float, bool]]:
    clusters = []
    weight = np.abs(t) if cell_deg2 is None else np.abs(t) * cell_deg2
    for is_more, beyond in ((True, t > limit), (False, t < -limit)):
        labels, count = ndimage.label(beyond)
        if cell_deg2 is not None and count > 1:
            labels, count = _join_around(labels, count)
        masses = ndimage.sum_labels(weight, labels, np.arange(1, count + 1))
        clusters += [(labels == k + 1, float(masses[k]), is_more) for k in range(count)]
    return clusters


def _join_around(labels: Labels, count: int) -> tuple[Labels, int]:
    """Return labels of clusters (rows, columns), joined where left and right edge meet and at the
    poles, and how many there are.
    """
    seam = labels[:, [0, -1]]
    pairs = [seam[(seam > 0).all(axis=1)]]
    for row in (labels[0], labels[-1]):
        at_pole = np.unique(row[row > 0])
        pairs.append(np.stack([at_pole[:-1], at_pole[1:]], axis=1))
    one, other = np.concatenate(pairs).T
    links = coo_array((np.ones(len(one)), (one, other)), shape=(count + 1, count + 1))
    count_around, number = csgraph.connected_components(links, directed=False)
    # 0, what is in none, touches nothing and stays the first
    labels_around: Labels = number[labels]
    return labels_around, count_around - 1

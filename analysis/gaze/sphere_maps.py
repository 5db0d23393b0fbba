"""Maps of gaze all around: time per solid angle on a grid of longitude and latitude, smoothed by
the distance on the sphere, so that a place counts the same wherever it lies.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
SPHERE_SMOOTHING_DEG: Final = 2.0
"""Standard deviation of the smoothing, twice that in a plane: gaze in a headset is less accurate;
our choice."""
TRUNCATE: Final = 4.0
"""Beyond so many standard deviations a kernel is 0."""


@dataclass(frozen=True)
class SphereGrid:
    """Cells over all directions, even in degrees: `columns` from the left (-180) to the right,
    `rows` from the top (90) downwards.
    """

    columns: int = 360
    rows: int = 180

    @property
    def shape(self) -> tuple[int, int]:
        """Rows from top to bottom, columns from left to right."""
        return self.rows, self.columns

    @property
    def reach(self) -> tuple[float, float, float, float]:
        """Where it ends, in degrees: left, right, bottom, top."""
        return -180.0, 180.0, -90.0, 90.0

    def centres(self) -> tuple[Values, Values]:
        """Return degrees to the right (columns,) and upwards (rows,) of the cells' centres."""
        right = ((np.arange(self.columns) + 0.5) / self.columns - 0.5) * 360.0
        return right, (0.5 - (np.arange(self.rows) + 0.5) / self.rows) * 180.0

    def centres_deg(self) -> tuple[Values, Values]:
        """Return the same, as of a grid in a plane."""
        return self.centres()

    def cells_of(
        self, right_deg: Values, up_deg: Values
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return row and column (n,) of the cells in which directions (n,) lie."""
        column = np.floor((right_deg / 360.0 + 0.5) * self.columns).astype(np.int64)
        row = np.floor((0.5 - up_deg / 180.0) * self.rows).astype(np.int64)
        return row.clip(0, self.rows - 1), column % self.columns

    def area_deg2(self) -> Values:
        """Return the solid angle of every cell (rows, columns) in square degrees."""
        edges = np.sin(np.radians(90.0 - np.arange(self.rows + 1) / self.rows * 180.0))
        of_row = np.degrees(1.0) * (edges[:-1] - edges[1:]) * 360.0 / self.columns
        return np.broadcast_to(of_row[:, None], self.shape).copy()


def sphere_map(grid: SphereGrid, right_deg: Values, up_deg: Values, seconds: Values) -> Values:
    """Return seconds per square degree (rows, columns) of gaze at directions (n,), smoothed by a
    Gaussian of the great-circle distance; their integral over the sphere is the time of all gaze.
    """
    counts = np.zeros(grid.shape)
    np.add.at(counts, grid.cells_of(right_deg, up_deg), seconds)
    # Between two rows the kernel depends on the difference of longitudes alone: a convolution.
    rows, kernels = _kernels(grid)
    waves = np.fft.rfft(counts, axis=1)
    smooth = np.zeros_like(waves)
    for source in np.flatnonzero(counts.any(axis=1)).tolist():
        smooth[rows[source]] += waves[source] * kernels[source]
    density: Values = np.fft.irfft(smooth, grid.columns, axis=1)
    density[density < 1e-9 * density.max()] = 0.0  # what rounding leaves far from all gaze
    return density


@lru_cache(maxsize=2)
def _kernels(grid: SphereGrid) -> tuple[list[slice], list[npt.NDArray[np.complex128]]]:
    """Return for gaze in each row which rows it reaches, and how, as waves along longitude."""
    _, up_deg = grid.centres()
    up, area = np.radians(up_deg), grid.area_deg2()[:, :1]
    apart = np.arange(grid.columns) / grid.columns * 2 * np.pi
    limit_deg = TRUNCATE * SPHERE_SMOOTHING_DEG
    slices, kernels = [], []
    for k in range(grid.rows):
        (near,) = np.nonzero(np.abs(up_deg - up_deg[k]) <= limit_deg)
        some = slice(int(near[0]), int(near[-1]) + 1)
        # by the haversine, which is exact for short distances
        share = np.sin((up[some, None] - up[k]) / 2) ** 2
        share = share + np.cos(up[some, None]) * np.cos(up[k]) * np.sin(apart / 2) ** 2
        far_deg = np.degrees(2 * np.arcsin(np.sqrt(np.clip(share, 0.0, 1.0))))
        kernel = np.exp(-0.5 * (far_deg / SPHERE_SMOOTHING_DEG) ** 2) * (far_deg <= limit_deg)
        kernel /= (kernel * area[some]).sum()
        slices.append(some)
        kernels.append(np.fft.rfft(kernel, axis=1))
    return slices, kernels


def cc(grid: SphereGrid, density: Values, other: Values) -> float:
    """Return Pearson's correlation of two maps (rows, columns), cells counting by their size: the
    CC of salient360 (Gutiérrez et al. 2018, Signal Process Image Commun 69:35).

    Raises:
        ValueError: a map is the same everywhere, or not of the grid.
    """
    one, two = _standardised(grid, density), _standardised(grid, other)
    return float((_weights(grid) * one * two).sum())


def kld(grid: SphereGrid, density: Values, other: Values) -> float:
    """Return the Kullback-Leibler divergence of a map (rows, columns) from another, in nats: how
    much is lost where `other` stands for `density`, cells counting by their size; their KLD.

    Raises:
        ValueError: a map has no time in it, or is not of the grid.
    """
    tiny = np.finfo(np.float64).eps
    weight = _weights(grid)
    sums = [_weighted_sum(grid, one) for one in (density, other)]
    if not min(sums) > 0:
        raise ValueError("a map has no time in it")
    p, q = density / sums[0], other / sums[1]
    return float((weight * p * np.log(tiny + p / (q + tiny))).sum())


def nss(grid: SphereGrid, density: Values, right_deg: Values, up_deg: Values) -> float:
    """Return the normalised scanpath saliency of fixations (n,) on a map (rows, columns): how many
    standard deviations over its mean it is there, mean and deviation by solid angle; their NSS.

    Raises:
        ValueError: the map is the same everywhere or not of the grid, or there are no fixations.
    """
    if not len(right_deg):
        raise ValueError("there are no fixations")
    return float(_standardised(grid, density)[grid.cells_of(right_deg, up_deg)].mean())


def auc(grid: SphereGrid, density: Values, right_deg: Values, up_deg: Values) -> float:
    """Return how often a map (rows, columns) is higher where a fixation (n,) is than at a place
    anywhere on the sphere, by solid angle, ties counting half: the area under the curve of AUC-Judd
    (Judd et al. 2009, ICCV), which salient360 takes, too. 0.5 is chance, also of a map that is the
    same everywhere.

    Raises:
        ValueError: the map is not of the grid, or there are no fixations.
    """
    if not len(right_deg):
        raise ValueError("there are no fixations")
    _weighted_sum(grid, density)  # which looks at its size
    levels, of_cell = np.unique(density, return_inverse=True)
    weight = np.bincount(of_cell.ravel(), _weights(grid).ravel(), len(levels))
    lower_01 = np.cumsum(weight) - weight / 2
    numbers = of_cell.reshape(grid.shape)[grid.cells_of(right_deg, up_deg)]
    return float(lower_01[numbers].mean())


def _weights(grid: SphereGrid) -> Values:
    area = grid.area_deg2()
    weights: Values = area / area.sum()
    return weights


def _weighted_sum(grid: SphereGrid, density: Values) -> float:
    if density.shape != grid.shape:
        of_map, of_grid = (f"{rows} × {columns}" for rows, columns in (density.shape, grid.shape))
        raise ValueError(f"a map has {of_map} cells, not {of_grid}")
    return float((_weights(grid) * density).sum())


def _standardised(grid: SphereGrid, density: Values) -> Values:
    weight = _weights(grid)
    mean = _weighted_sum(grid, density)
    off = density - mean
    sd = np.sqrt((weight * off**2).sum())
    if not sd > 1e-9 * abs(mean):
        raise ValueError("a map is the same everywhere; nothing is above or below its mean")
    values: Values = off / sd
    return values

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

    def area_deg2(self) -> Values:
        """Return the solid angle of every cell (rows, columns) in square degrees."""
        edges = np.sin(np.radians(90.0 - np.arange(self.rows + 1) / self.rows * 180.0))
        of_row = np.degrees(1.0) * (edges[:-1] - edges[1:]) * 360.0 / self.columns
        return np.broadcast_to(of_row[:, None], self.shape).copy()


def sphere_map(grid: SphereGrid, right_deg: Values, up_deg: Values, seconds: Values) -> Values:
    """Return seconds per square degree (rows, columns) of gaze at directions (n,), smoothed by a
    Gaussian of the great-circle distance; their integral over the sphere is the time of all gaze.
    """
    column = np.floor((right_deg / 360.0 + 0.5) * grid.columns).astype(np.int64) % grid.columns
    row = np.floor((0.5 - up_deg / 180.0) * grid.rows).astype(np.int64).clip(0, grid.rows - 1)
    counts = np.zeros(grid.shape)
    np.add.at(counts, (row, column), seconds)
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

"""The body's texture space as a picture: which point of the body each pixel shows."""

import io
from functools import cached_property

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy.ndimage import distance_transform_edt

from character_making.makehuman import Indices, MakeHuman
from character_making.pieces import triangulated
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

SIZE = 1024


@compiled
def _rasterise(uv: Vector, owner: Indices, shares: Vector, size: int) -> None:
    for t in range(uv.shape[0]):
        ax, ay = uv[t, 0, 0] * size - 0.5, uv[t, 0, 1] * size - 0.5
        bx, by = uv[t, 1, 0] * size - 0.5, uv[t, 1, 1] * size - 0.5
        cx, cy = uv[t, 2, 0] * size - 0.5, uv[t, 2, 1] * size - 0.5
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0:
            continue
        for y in range(max(int(min(ay, by, cy)), 0), min(int(max(ay, by, cy)) + 2, size)):
            for x in range(max(int(min(ax, bx, cx)), 0), min(int(max(ax, bx, cx)) + 2, size)):
                b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
                c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
                if b >= -0.01 and c >= -0.01 and b + c <= 1.01:
                    owner[y, x] = t
                    shares[y, x, 0] = 1 - b - c
                    shares[y, x, 1] = b
                    shares[y, x, 2] = c


class SkinCanvas:
    """Pixels of the body's texture space; the same for every figure."""

    def __init__(self, source: MakeHuman) -> None:
        self._source = source
        quads, quad_uvs = source.quads("body"), source.quad_uvs("body")
        self._triangles = triangulated(quads)
        uv = source.uv[triangulated(quad_uvs)]
        owner = np.full((SIZE, SIZE), -1, dtype=np.int64)
        shares = np.zeros((SIZE, SIZE, 3))
        _rasterise(uv, owner, shares, SIZE)
        self._owner = owner
        self._shares = shares

    @cached_property
    def filled(self) -> Indices:
        """For every pixel the flat index of the nearest one on the body."""
        rows, columns = distance_transform_edt(
            self._owner < 0, return_distances=False, return_indices=True
        )
        flat: Indices = (rows * SIZE + columns).astype(np.int64)
        return flat

    def pixels(self, visible: npt.NDArray[np.bool_]) -> Indices:
        """Return flat indices of the pixels that show the triangles `visible` (t,)."""
        owner = self._owner.ravel()
        return np.flatnonzero((owner >= 0) & visible[np.maximum(owner, 0)])

    def spread(self, values: Vector, pixels: Indices) -> Vector:
        """Return what vertices (v, ...) bear at pixels."""
        corners = self._triangles[self._owner.ravel()[pixels]]
        shares = self._shares.reshape(-1, 3)[pixels]
        mixed = sum(
            values[corners[:, k]] * shares[:, k].reshape(-1, *([1] * (values.ndim - 1)))
            for k in range(3)
        )
        return np.asarray(mixed)

    def mask(self, name: str, pixels: Indices) -> Vector:
        """Return a painted mask of the base mesh at pixels, 0…1."""
        if name not in self.__dict__:
            image = Image.open(io.BytesIO(self._source.image_bytes(name)))
            small = image.convert("L").resize((SIZE, SIZE), Image.Resampling.BOX)
            self.__dict__[name] = np.asarray(small, dtype=np.float64).ravel() / 255
        values: Vector = self.__dict__[name][pixels]
        return values

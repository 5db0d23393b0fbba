"""Where the models and the people of a crowd lie in memory that outlasts a change of levels."""

from bisect import bisect_left
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.stage.processor.models import PLAIN, Group, Model
from visavis.stage.processor.vertex_light import VertexLooks, VertexShapes

MODEL_ARRAYS = (*VertexShapes._fields, *VertexLooks._fields)
Rank = Callable[[Group], tuple[object, ...]]


class JoinedModels:
    """Models one after the other in one set of arrays, in the order they came; none ever leaves.

    `arrays` hold MODEL_ARRAYS and `triangles` with room behind; `vertices_of` (k, 2) is each
    model's stretch, `stretches` (k, groups, 2) are its triangles by `groups`, ranked by `rank`.
    """

    def __init__(self, rank: Rank) -> None:
        self._rank = rank
        self.models: list[Model] = []
        self.arrays: dict[str, npt.NDArray[Any]] = {}
        self._row_counts: dict[str, int] = {}
        self.vertices_of = np.zeros((0, 2), np.int64)
        self.groups: tuple[Group, ...] = (PLAIN,)
        self.stretches = np.zeros((0, 1, 2), np.int64)
        self._triangles_of: list[dict[Group, tuple[int, int]]] = []

    def add(self, model: Model) -> int:
        """Append a model; return its number."""
        if not self.models:
            self._append("triangles", np.zeros((0, 3), np.int32))
        for name in MODEL_ARRAYS:
            own = getattr(model, name)
            if name == "morph":  # counts displacements in the joined array
                shift = self._row_counts.get("deltas", 0)
                own = np.where(own >= 0, own + shift, -1).astype(np.int32)
            self._append(name, own)
        end = self._row_counts["rest"]
        self.vertices_of = np.concatenate([self.vertices_of, [[end - len(model.rest), end]]])
        self._triangles_of.append(
            {group: self._append("triangles", own) for group, own in model.triangles.items()}
        )
        self.models.append(model)
        self.groups = tuple(sorted({*self.groups, *model.triangles}, key=self._rank))
        self.stretches = np.array(
            [[own.get(g, (0, 0)) for g in self.groups] for own in self._triangles_of], np.int64
        )
        return len(self.models) - 1

    @property
    def shapes(self) -> VertexShapes:
        """How the vertices of all models are moved."""
        return VertexShapes(*(self.arrays[name] for name in VertexShapes._fields))

    @property
    def looks(self) -> VertexLooks:
        """How the vertices of all models are lit."""
        return VertexLooks(*(self.arrays[name] for name in VertexLooks._fields))

    def _append(self, name: str, own: npt.NDArray[Any]) -> tuple[int, int]:
        """Copy rows behind those there are, into twice the room where it ends."""
        start = self._row_counts.get(name, 0)
        end = start + len(own)
        before = self.arrays.get(name)
        if before is None or end > len(before):
            larger = np.zeros((end if before is None else 2 * end, *own.shape[1:]), own.dtype)
            if before is not None:
                larger[:start] = before[:start]
            self.arrays[name] = larger
        self.arrays[name][start:end] = own
        self._row_counts[name] = end
        return start, end


class FreeRows:
    """The free ones of `size` rows."""

    def __init__(self, size: int) -> None:
        self.stretches: list[tuple[int, int]] = [(0, size)] if size else []

    def take(self, count: int) -> int | None:
        """Return the first of `count` free rows that lie together, the lowest; None: there are
        none.
        """
        for k, (start, end) in enumerate(self.stretches):
            if end - start >= count:
                self.stretches[k : k + 1] = [(start + count, end)] if end - start > count else []
                return start
        return None

    def give(self, start: int, count: int) -> None:
        """Free rows; they are merged with adjacent free ones."""
        end = start + count
        k = bisect_left(self.stretches, (start, end))
        if k < len(self.stretches) and self.stretches[k][0] == end:
            end = self.stretches.pop(k)[1]
        if k and self.stretches[k - 1][1] == start:
            k -= 1
            start = self.stretches.pop(k)[0]
        self.stretches.insert(k, (start, end))

"""Collect rows of a stream the session itself makes, and pass them on in batches."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.schema import SampleBatch, StreamSchema, empty_values


class RowBuffer:
    """Fill columns in place; hand a batch to `sink` every `hold_ns` of session time.

    Use: `i = buffer.room(n)`, write `buffer.columns[name][i:i + n]`, then `buffer.commit(n, t)`.
    `columns` is a new dictionary after `room` had to enlarge the buffer.
    """

    def __init__(
        self,
        schema: StreamSchema,
        sink: Callable[[SampleBatch], None],
        *,
        hold_ns: int,
        capacity: int = 512,
    ) -> None:
        self._schema = schema
        self._sink = sink
        self._hold_ns = hold_ns
        self._n = 0
        self._seq = 0
        self._first_ns = 0
        self._make(capacity)

    def spare_columns(self) -> dict[str, npt.NDArray[Any]]:
        """Return columns as this buffer has now, whose rows are not handed over."""
        values = empty_values(self._schema, self._capacity)
        return {f.name: values[f.name] for f in self._schema.fields}

    def _make(self, capacity: int) -> None:
        self._capacity = capacity
        self._values = empty_values(self._schema, capacity)
        self._t_ns: npt.NDArray[np.int64] = np.zeros(capacity, dtype=np.int64)
        self.columns = {f.name: self._values[f.name] for f in self._schema.fields}

    def room(self, n: int) -> int:
        """Return the index where n rows may be written."""
        if self._n + n > self._capacity:
            self.flush()
            if n > self._capacity:  # after a pause a device delivers all it kept at once
                self._make(n)
        return self._n

    def add(self, row: tuple[object, ...], t_ns: int) -> None:
        """Write and count one row of scalars, in the order of the schema's fields."""
        self._values[self.room(1)] = row
        self.commit(1, t_ns)

    def add_rows(self, rows: Sequence[tuple[object, ...]], t_ns: Sequence[int]) -> None:
        """Write and count rows of scalars, each stamped with its time, in ascending order."""
        start = self.room(len(rows))
        self._values[start : start + len(rows)] = rows
        self.commit_stamped(np.array(t_ns))

    def commit(self, n: int, t_ns: int) -> None:
        """Count n written rows, all stamped `t_ns`."""
        start = self._n
        if start == 0:
            self._first_ns = t_ns
        if n == 1:
            self._t_ns[start] = t_ns
        else:
            self._t_ns[start : start + n] = t_ns
        self._n = start + n
        if t_ns - self._first_ns >= self._hold_ns:
            self.flush()

    def commit_stamped(self, t_ns: npt.NDArray[np.int64]) -> None:
        """Count written rows by the stamp of each, in ascending order; hand them over when due."""
        n = t_ns.shape[0]
        start = self._n
        if start == 0:
            self._first_ns = int(t_ns[0])
        self._t_ns[start : start + n] = t_ns
        self._n = start + n
        if int(t_ns[-1]) - self._first_ns >= self._hold_ns:
            self.flush()

    @property
    def rows(self) -> int:
        """Rows committed since construction."""
        return self._seq + self._n

    def flush(self) -> None:
        """Hand over what is there."""
        n = self._n
        if n == 0:
            return
        t_ns = self._t_ns[:n].copy()
        seq = np.arange(self._seq, self._seq + n, dtype=np.int64)
        self._sink(SampleBatch(self._schema, seq, t_ns, t_ns, self._values[:n].copy()))
        self._seq += n
        self._n = 0

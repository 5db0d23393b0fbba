"""A recording that is read once and kept in memory, for code that reads it frame after frame."""

from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from visavis.recording.reader import Recording, rows_between
from visavis.recording.stream_file import Columns

T = TypeVar("T")


class CachedRecording(Recording):
    """A session folder whose streams, events and trials stay in memory once asked for.

    What it returns is shared: leave it as it is.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._arrays: dict[tuple[str, int | None], Columns] = {}
        self._tables: dict[tuple[str, int | None], pd.DataFrame] = {}
        self._products: dict[Hashable, Any] = {}

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what `make` returns, made once for a key."""
        if key not in self._products:
            self._products[key] = make()
        product: T = self._products[key]
        return product

    def amend(self, part: int, name: str, columns: Columns) -> None:
        """Give these columns for a part's stream from now on, as `Recording` does."""
        super().amend(part, name, columns)
        self._arrays = {key: arrays for key, arrays in self._arrays.items() if key[0] != name}
        self._products = {}

    def stream_arrays(
        self,
        name: str,
        *,
        part: int | None = None,
        t_start_ns: int | None = None,
        t_end_ns: int | None = None,
    ) -> Columns:
        """Return a stream as `Recording` does."""
        if (name, part) not in self._arrays:
            self._arrays[name, part] = super().stream_arrays(name, part=part)
        return rows_between(self._arrays[name, part], t_start_ns, t_end_ns)

    def events(self) -> pd.DataFrame:
        """Return all events as `Recording` does."""
        if ("", None) not in self._tables:
            self._tables["", None] = super().events()
        return self._tables["", None]

    def events_named(self, name: str, part: int) -> pd.DataFrame:
        """Return a part's events of one name as `Recording` does."""
        if (name, part) not in self._tables:
            self._tables[name, part] = super().events_named(name, part)
        return self._tables[name, part]

    def trials(self) -> pd.DataFrame:
        """Return the trials as `Recording` does."""
        if ("trials", None) not in self._tables:
            self._tables["trials", None] = super().trials()
        return self._tables["trials", None]

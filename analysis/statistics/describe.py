"""Describe cells and average repetitions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.design import Frame, Levels, column_of, levels_and_codes
from visavis.analysis.statistics.errors import TooFewLevels
from visavis.analysis.statistics.inputs import numbers
from visavis.analysis.statistics.results import Result, Row, number


@dataclass(frozen=True)
class Cell(Result):
    """One cell of a design; quartiles interpolate linearly (type 7), sd divides by n − 1."""

    labels: Mapping[str, object]
    n: int
    mean: float
    sd: float
    median: float
    q1: float
    q3: float

    def sentence(self) -> str:
        """Return the cell as text."""
        where = ", ".join(f"{k} {v}" for k, v in self.labels.items())
        return f"{where}: M = {number(self.mean)}, SD = {number(self.sd)}, n = {self.n}"

    def row(self) -> Row:
        """Return the cell as one flat table row."""
        return {
            **{k: str(v) for k, v in self.labels.items()},
            "n": self.n,
            "mean": self.mean,
            "sd": self.sd,
            "median": self.median,
            "q1": self.q1,
            "q3": self.q3,
        }


def describe(
    frame: Frame, dv: str, *, factors: Sequence[str], levels: Levels | None = None
) -> tuple[Cell, ...]:
    """Describe every cell that has rows, in the order of the levels (last factor fastest).

    `sd` of a single row is NaN: it is not defined.
    """
    y = numbers(column_of(frame, dv), name=dv)
    codings = [levels_and_codes(column_of(frame, f), f, (levels or {}).get(f)) for f in factors]
    cells = []
    for index in np.ndindex(*(len(names) for names, _ in codings)):
        inside = np.ones(y.size, dtype=bool)
        for place, (_, codes) in zip(index, codings, strict=True):
            inside &= codes == place
        if not inside.any():
            continue
        values = y[inside]
        q1, median, q3 = np.quantile(values, (0.25, 0.5, 0.75))
        cells.append(
            Cell(
                {
                    f: codings[i][0][place]
                    for i, (f, place) in enumerate(zip(factors, index, strict=True))
                },
                int(values.size),
                float(values.mean()),
                float(values.std(ddof=1)) if values.size > 1 else float("nan"),
                float(median),
                float(q1),
                float(q3),
            )
        )
    return tuple(cells)


def cell_means(
    frame: Frame, dv: str, *, by: Sequence[str]
) -> dict[str, npt.NDArray[np.float64] | list[object]]:
    """Average repetitions: one row per combination of the `by` columns, as columns of a frame."""
    if not by:
        raise TooFewLevels("name the columns to average by, at least the subject")
    y = numbers(column_of(frame, dv), name=dv)
    codings = [levels_and_codes(column_of(frame, name), name, None) for name in by]
    joint = np.ravel_multi_index(
        [codes for _, codes in codings], [len(names) for names, _ in codings]
    )
    cells, back = np.unique(joint, return_inverse=True)
    places = np.unravel_index(cells, [len(names) for names, _ in codings])
    columns: dict[str, npt.NDArray[np.float64] | list[object]] = {
        name: [names[int(i)] for i in place]
        for name, (names, _), place in zip(by, codings, places, strict=True)
    }
    columns[dv] = np.bincount(back, y) / np.bincount(back)
    return columns

"""Check and repair time stamps: repeated, contradictory, backward; and the step between them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.errors import DataError
from visavis.lab.sampling import step_ns_of, time_returns

Times = npt.NDArray[np.int64]

FALLBACK_STEP_NS = 8_333_333
"""The step assumed when fewer than three stamps show one: 120 Hz."""


@dataclass(frozen=True, slots=True)
class Order:
    """Which rows to use, in time order, and what was wrong with the others.

    `rows` is None when every row is used as it stands.
    """

    rows: npt.NDArray[np.int64] | None
    repeated: int
    conflicting: int
    backward: int


@compiled
def _is_increasing(t_ns: Times) -> bool:
    for i in range(1, t_ns.shape[0]):
        if t_ns[i] <= t_ns[i - 1]:
            return False
    return True


def order_of(
    t_ns: Times,
    values: npt.NDArray[np.generic],
    *,
    backward: Literal["error", "sort"] = "error",
    conflicts: Literal["error", "keep_first"] = "error",
    what: str = "gaze",
) -> Order:
    """Choose rows with strictly increasing stamps.

    `values` (n,) or (n, k) tells whether two rows with one stamp agree (NaN agrees with NaN).
    A row that repeats stamp and value is left out. A row that contradicts an earlier one of
    the same stamp, or goes back in time, raises DataError naming the row, unless `conflicts` is
    "keep_first" or `backward` is "sort". What begins anew, a second recording or a clock that was
    set back, is never sorted in.
    """
    if _is_increasing(t_ns):
        return Order(None, 0, 0, 0)
    rows = np.arange(t_ns.shape[0])
    back = np.flatnonzero(np.diff(t_ns) < 0)
    if back.size:
        if backward == "error":
            row = int(back[0]) + 1
            raise DataError(
                f"{what}: row {row} is stamped {int(t_ns[row])} ns, before row {row - 1} at "
                f"{int(t_ns[row - 1])} ns; mend the stamps or ask to sort them"
            )
        returns = time_returns(t_ns)
        if returns.restarts:
            row = returns.restarts[0]
            raise DataError(
                f"{what}: time begins anew at row {row} ({int(t_ns[row])} ns after "
                f"{int(t_ns[row - 1])} ns), a {returns.reasons[0]}; take the parts one by one"
            )
        rows = np.argsort(t_ns, kind="stable")
    same = np.concatenate([[False], np.diff(t_ns[rows]) == 0])
    table = values.reshape(values.shape[0], -1)[rows]
    first = np.maximum.accumulate(np.where(same, 0, np.arange(rows.shape[0])))
    other = table[first]
    with np.errstate(invalid="ignore"):
        agrees = table == other
    if table.dtype.kind == "f":
        agrees |= np.isnan(table) & np.isnan(other)
    clash = same & ~agrees.all(axis=1)
    if clash.any() and conflicts == "error":
        row = int(rows[np.flatnonzero(clash)[0]])
        raise DataError(
            f"{what}: row {row} repeats the stamp {int(t_ns[row])} ns with another value; "
            "mend the rows or ask to keep the first of each stamp"
        )
    return Order(rows[~same], int(same.sum()), int(clash.sum()), int(back.size))


def typical_step_ns(t_ns: Times) -> int:
    """Return the period of increasing stamps, holes left out; see `visavis.lab.sampling`."""
    return FALLBACK_STEP_NS if t_ns.shape[0] < 3 else max(1, int(step_ns_of(t_ns)))

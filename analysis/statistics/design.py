"""Read a tidy frame as a factorial design, or say which row or cell is wrong."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property
from itertools import combinations
from typing import Any, Literal, TypeAlias, TypedDict, get_args

import numpy as np
import numpy.typing as npt

from visavis.analysis.statistics.errors import (
    ConstantResponse,
    DuplicateCell,
    InfiniteValue,
    MissingCell,
    MissingValue,
    SubjectInTwoGroups,
    TooFewLevels,
    TooFewSubjects,
    UnequalLength,
    UnknownColumn,
    UnknownMethod,
    option_text,
)
from visavis.analysis.statistics.inputs import (
    as_column,
    is_constant,
    is_missing,
    numbers,
    refuse_text,
)
from visavis.analysis.statistics.results import Array

Frame: TypeAlias = Any
"""A pandas frame, or a mapping from column name to values."""
Codes: TypeAlias = npt.NDArray[np.intp]
Missing: TypeAlias = Literal["error", "listwise", "mixed"]
Levels: TypeAlias = Mapping[str, Sequence[object]]


@dataclass(frozen=True)
class Factor:
    """A factor with its levels in order and the level code of every row."""

    name: str
    levels: tuple[object, ...]
    codes: Codes
    is_within: bool

    @property
    def k(self) -> int:
        """Number of levels."""
        return len(self.levels)


@dataclass(frozen=True)
class Design:
    """A checked design: one row per subject and cell of the within factors, or several where
    `is_repeated` (models of single trials; then there is no `table`).

    Factors stand between first, then within, in the order given. `rows` are the row numbers
    (from 0) of the frame that were kept; `dropped` says what was left out and why.
    """

    dv: str
    y: Array
    subject: Codes
    subjects: tuple[object, ...]
    factors: tuple[Factor, ...]
    rows: Codes
    is_complete: bool
    dropped: tuple[str, ...] = ()
    is_repeated: bool = False
    covariates: Mapping[str, Array] = field(default_factory=dict)
    """Numbers of subjects by name, each (n,), which the model holds constant."""

    @cached_property
    def within(self) -> tuple[Factor, ...]:
        """The factors that vary within a subject."""
        return tuple(f for f in self.factors if f.is_within)

    @cached_property
    def between(self) -> tuple[Factor, ...]:
        """The factors that vary between subjects."""
        return tuple(f for f in self.factors if not f.is_within)

    @cached_property
    def n(self) -> int:
        """Number of subjects."""
        return len(self.subjects)

    @cached_property
    def terms(self) -> tuple[tuple[str, ...], ...]:
        """All main effects, then all interactions, by order."""
        names = [f.name for f in self.factors]
        return tuple(t for size in range(1, len(names) + 1) for t in combinations(names, size))

    @cached_property
    def group_of_subject(self) -> tuple[Codes, ...]:
        """Level codes of the between factors, one entry per subject."""
        if not self.between:
            return ()
        first = np.unique(self.subject, return_index=True)[1]
        return tuple(f.codes[first] for f in self.between)

    @cached_property
    def group_sizes(self) -> Codes:
        """Subjects in each cell of the between factors."""
        if not self.between:
            return np.array([self.n])
        shape = tuple(f.k for f in self.between)
        cells = np.ravel_multi_index(self.group_of_subject, shape)
        return np.bincount(cells, minlength=int(np.prod(shape)))

    @cached_property
    def cells(self) -> Codes:
        """Cell of all factors in which each row lies; the last factor's levels are neighbours."""
        shape = tuple(f.k for f in self.factors)
        return np.ravel_multi_index(tuple(f.codes for f in self.factors), shape)

    def around_cell_means(self, y: Array) -> Array:
        """Return values, one per row, less the means of their cells."""
        means = np.bincount(self.cells, y) / np.maximum(np.bincount(self.cells), 1)
        away: Array = y - means[self.cells]
        return away

    def cell_text(self, cell: int) -> str:
        """Return one of `cells` in words: 'A low, B 2'."""
        return _cell_text(cell, self.factors)

    @cached_property
    def is_balanced(self) -> bool:
        """Tell whether every subject has every cell and the groups are of equal size."""
        return self.is_complete and bool((self.group_sizes == self.group_sizes[0]).all())

    def table(self, values: Array) -> Array:
        """Arrange one value per row as (subjects, levels of within 1, levels of within 2, …)."""
        shape = (self.n, *(f.k for f in self.within))
        table = np.empty(shape)
        table.reshape(-1)[self._places] = values
        return table

    @cached_property
    def _places(self) -> Codes:
        """Where each row stands in the flat `table`."""
        shape = (self.n, *(f.k for f in self.within))
        return np.ravel_multi_index((self.subject, *(f.codes for f in self.within)), shape)

    def factor(self, name: str) -> Factor:
        """Return a factor by name."""
        for candidate in self.factors:
            if candidate.name == name:
                return candidate
        names = ", ".join(f.name for f in self.factors)
        raise UnknownMethod(f"no factor {name!r} in this design; its factors are {names}")

    def term(self, term: str | Sequence[str]) -> tuple[str, ...]:
        """Return a term, given as 'A:B' or ('A', 'B'), in the order of the design."""
        names = set(_split(term, [f.name for f in self.factors]))
        for name in names:
            self.factor(name)
        return tuple(f.name for f in self.factors if f.name in names)


class DesignColumns(TypedDict, total=False):
    """The keywords by which tests are told the columns of a design; see `read_design`."""

    subject: str | None
    within: Sequence[str]
    between: Sequence[str]
    levels: Levels | None
    missing: Missing


def read_design(
    frame: Frame,
    dv: str,
    *,
    subject: str | None,
    within: Sequence[str] = (),
    between: Sequence[str] = (),
    levels: Levels | None = None,
    missing: Missing = "error",
    allow_repeats: bool = False,
) -> Design:
    """Check a tidy frame and return it as a `Design`.

    `subject` may be None for purely between designs (every row another subject). Levels are
    taken from `levels`, a pandas categorical, or sorted. `missing`: "error" names every missing
    cell, "listwise" drops incomplete subjects, "mixed" keeps the rows that are there.
    `allow_repeats` allows several rows in a cell, for models of single trials; a cell is then
    missing when none of its rows has a response.
    """
    if missing not in get_args(Missing):
        raise UnknownMethod(
            f"no rule {missing!r} for missing cells; use one of {get_args(Missing)}"
        )
    within, between = _as_names(within), _as_names(between)
    if not within and not between:
        raise TooFewLevels("no factor was named; name at least one within or between factor")
    if subject is None and within:
        raise UnknownColumn("within factors need the column that names the subject")
    columns = {c: column_of(frame, c) for c in (dv, *between, *within)}
    if subject is not None:
        columns[subject] = column_of(frame, subject)
    if len({len(v) for v in columns.values()}) > 1:
        sizes = ", ".join(f"{c}: {len(v)}" for c, v in columns.items())
        raise UnequalLength(f"the columns differ in length ({sizes})")
    n_rows = len(columns[dv])
    ids: tuple[object, ...]
    if subject is None:
        ids, codes = tuple(range(1, n_rows + 1)), np.arange(n_rows)
    else:
        ids, codes = levels_and_codes(columns[subject], subject, None)
    factors = tuple(
        Factor(
            name, *levels_and_codes(columns[name], name, (levels or {}).get(name)), name in within
        )
        for name in (*between, *within)
    )
    for factor in factors:
        if factor.k < 2:
            only = factor.levels[0] if factor.levels else "nothing"
            raise TooFewLevels(f"factor {factor.name} has one level only ({only}); it needs two")
    y = _response(columns[dv], dv, ids, codes, factors)
    return _complete_design(dv, y, codes, ids, factors, missing, allow_repeats)


def with_covariates(design: Design, frame: Frame, names: Sequence[str]) -> Design:
    """Return a design that holds numbers of subjects constant.

    Raises:
        StatisticsError: a covariate is a factor too, is missing, does not vary, or differs within a
            subject.
    """
    covariates: dict[str, Array] = {}
    for name in _as_names(names):
        if name in (design.dv, *(f.name for f in design.factors)):
            raise UnknownColumn(f"{name} is the response or a factor; it cannot be held constant")
        values = numbers(column_of(frame, name), name=name)[design.rows]
        of_subject = np.full(design.n, np.nan)
        of_subject[design.subject] = values
        differing = np.flatnonzero(of_subject[design.subject] != values)
        if differing.size:
            who = design.subjects[int(design.subject[differing[0]])]
            raise DuplicateCell(
                f"subject {who} has several values of {name}; a covariate is one number of a "
                "subject: average it first, or take it as a factor"
            )
        if is_constant(of_subject):
            raise ConstantResponse(f"{name} is {of_subject[0]:g} for all; it explains nothing")
        covariates[name] = of_subject
    return replace(design, covariates=covariates)


def column_of(frame: Frame, name: str) -> Any:
    """Return one column of a frame; `UnknownColumn` names the nearest match."""
    names = [str(c) for c in (frame.columns if hasattr(frame, "columns") else frame.keys())]
    try:
        return frame[name]
    except KeyError:
        near = get_close_matches(name, names, 1)
        hint = f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join(names)}"
        raise UnknownColumn(f"no column {name!r} in the data{hint}") from None


def levels_and_codes(
    column: Any, name: str, levels: Sequence[object] | None
) -> tuple[tuple[object, ...], Codes]:
    """Return the levels of a label column and the code of every row."""
    categories = getattr(getattr(column, "cat", None), "categories", None)
    raw = as_column(column)
    values: list[Any] = raw.tolist()
    if raw.dtype.kind not in "biuUS":
        for row, value in enumerate(values):
            if is_missing(value):
                raise MissingValue(f"{name} is missing in row {row + 1}; every row needs its label")
    try:
        present: list[object] = sorted(set(values))
    except TypeError:
        present = sorted(set(values), key=str)
    place = {value: i for i, value in enumerate(present)}
    codes = np.fromiter(map(place.__getitem__, values), np.intp, len(values))
    if levels is None and categories is not None:
        levels = [c for c in categories.tolist() if c in set(present)]
    if levels is None:
        return tuple(present), codes
    level_list = list(levels)
    for value in present:
        if value not in level_list:
            row = int(np.flatnonzero(codes == present.index(value))[0])
            raise TooFewLevels(f"{name} has the level {value!r} in row {row + 1}, not in its list")
    for value in level_list:
        if value not in present:
            raise TooFewLevels(f"{name} never takes its level {value!r}")
    order = np.array([level_list.index(value) for value in present], dtype=np.intp)
    return tuple(level_list), order[codes]


def _response(
    column: Any, dv: str, ids: tuple[object, ...], codes: Codes, factors: tuple[Factor, ...]
) -> Array:
    """Return the response with missing entries as NaN; errors name row, subject and cell."""
    raw = as_column(column)
    if raw.ndim == 1 and raw.dtype.kind not in "biuf":
        refuse_text(raw, dv, lambda row: _where(row, ids, codes, factors))
    if raw.ndim == 1 and raw.dtype.kind == "f" and np.isinf(raw).any():
        row = int(np.flatnonzero(np.isinf(raw))[0])
        raise InfiniteValue(
            f"{dv} is infinite in row {row + 1} ({_where(row, ids, codes, factors)}); "
            "find out how it was computed"
        )
    return numbers(raw, name=dv, allow_missing=True)


def _complete_design(
    dv: str,
    y: Array,
    codes: Codes,
    ids: tuple[object, ...],
    factors: tuple[Factor, ...],
    missing: Missing,
    allow_repeats: bool,
) -> Design:
    _refuse_two_groups(codes, ids, [f for f in factors if not f.is_within])
    # Number the cells of subject × within factors; every one of them needs a response.
    within = [f for f in factors if f.is_within]
    shape = (len(ids), *(f.k for f in within))
    cell = np.ravel_multi_index((codes, *(f.codes for f in within)), shape)
    counts = np.bincount(cell, minlength=math.prod(shape))
    if (counts > 1).any() and not allow_repeats:
        rows = np.flatnonzero(cell == int(np.argmax(counts > 1)))
        raise DuplicateCell(
            f"{_where(int(rows[0]), ids, codes, tuple(within))} has {len(rows)} rows "
            f"({', '.join(str(int(r) + 1) for r in rows[:5])}); average repetitions first "
            "(statistics.cell_means)"
        )
    # A cell is empty when none of its rows has a response, or it has no row.
    is_missing_row = np.isnan(y)
    has_gaps = bool(is_missing_row.any())
    responses_per_cell = counts
    if has_gaps:
        responses_per_cell = np.bincount(cell[~is_missing_row], minlength=counts.size)
    is_empty_cell = responses_per_cell.reshape(len(ids), -1) == 0
    keep = ~is_missing_row
    exclusions: tuple[str, ...] = ()
    if is_empty_cell.any():
        if missing == "error":
            row_of = np.full(is_empty_cell.shape, -1)
            row_of[codes, cell % is_empty_cell.shape[1]] = np.arange(y.size)
            _refuse_missing(dv, is_empty_cell, row_of, ids, within)
        if missing == "listwise":
            incomplete = is_empty_cell.any(axis=1)
            keep &= ~incomplete[codes]
            exclusions = tuple(f"subject {ids[i]} (incomplete)" for i in np.flatnonzero(incomplete))
        else:
            exclusions = tuple(
                f"subject {ids[s]}, {_cell_text(int(c), within)} (missing)"
                for s, c in zip(*np.nonzero(is_empty_cell), strict=True)
            )
    is_extra_gap = is_missing_row
    if has_gaps:  # other rows of the cell have a response
        is_extra_gap = is_missing_row & ~is_empty_cell[codes, cell % is_empty_cell.shape[1]]
    if is_extra_gap.any():
        row = int(np.flatnonzero(is_extra_gap)[0])
        if missing == "error":
            raise MissingValue(
                f"{dv} is missing in row {row + 1} ({_where(row, ids, codes, tuple(within))})"
                + (
                    f" and {int(is_extra_gap.sum()) - 1} more rows"
                    if is_extra_gap.sum() > 1
                    else ""
                )
                + f"; repair them, or take {option_text('missing', 'mixed')} "
                "to use the rows that are there"
            )
        exclusions = (*exclusions, f"{int(is_extra_gap.sum())} rows without {dv}")
    kept_rows = np.flatnonzero(keep)
    subjects, new_codes = ids, codes
    if kept_rows.size < y.size:  # renumber the subjects that are left
        left, new_codes = np.unique(codes[kept_rows], return_inverse=True)
        subjects = tuple(ids[i] for i in left)
    design = Design(
        dv=dv,
        y=y[kept_rows],
        subject=new_codes,
        subjects=subjects,
        factors=tuple(Factor(f.name, f.levels, f.codes[kept_rows], f.is_within) for f in factors),
        rows=kept_rows,
        is_complete=missing != "mixed" or not is_empty_cell.any(),
        dropped=exclusions,
        is_repeated=bool((counts > 1).any() and (np.bincount(cell[kept_rows]) > 1).any()),
    )
    _refuse_too_little(design)
    return design


def _refuse_two_groups(codes: Codes, ids: tuple[object, ...], between: list[Factor]) -> None:
    for factor in between:
        low = np.full(len(ids), factor.k, dtype=np.intp)
        high = np.full(len(ids), -1, dtype=np.intp)
        np.minimum.at(low, codes, factor.codes)
        np.maximum.at(high, codes, factor.codes)
        if (low != high).any():
            who = int(np.argmax(low != high))
            rows = np.flatnonzero(codes == who)
            other = rows[np.argmax(factor.codes[rows] != factor.codes[rows[0]])]
            a, b = (factor.levels[factor.codes[r]] for r in (rows[0], other))
            raise SubjectInTwoGroups(
                f"subject {ids[who]} is {factor.name} {a} in row {rows[0] + 1} and {b} in row "
                f"{other + 1}; name {factor.name} as a within factor or repair the rows"
            )


def _refuse_missing(
    dv: str,
    is_empty_cell: npt.NDArray[np.bool_],
    row_of: Codes,
    ids: tuple[object, ...],
    within: list[Factor],
) -> None:
    places = list(zip(*np.nonzero(is_empty_cell), strict=True))
    descriptions = []
    for s, c in places[:6]:
        cell = f", {_cell_text(int(c), within)}" if within else ""
        row = int(row_of[s, c])
        descriptions.append(f"subject {ids[s]}{cell} ({'no row' if row < 0 else f'row {row + 1}'})")
    more = f" and {len(places) - 6} more" if len(places) > 6 else ""
    text = (
        f"{dv} is missing in {len(places)} cell{'s' if len(places) > 1 else ''}: "
        f"{'; '.join(descriptions)}{more}. Repair them, or take "
        f"{option_text('missing', 'listwise')} to drop these subjects or "
        f"{option_text('missing', 'mixed')} for a mixed model"
    )
    raise (MissingCell(text) if (row_of < 0).any() else MissingValue(text))


def _refuse_too_little(design: Design) -> None:
    if design.n < 3:
        raise TooFewSubjects(
            f"{design.n} subjects are left in {design.dv}; a test needs at least three"
        )
    sizes = design.group_sizes
    for group in np.flatnonzero(sizes < 2):
        cell = _cell_text(int(group), design.between)
        text = f"the group {cell} has too few subjects ({sizes[group]}); it needs at least two"
        raise MissingCell(text) if sizes[group] == 0 else TooFewSubjects(text)
    if is_constant(design.y):
        raise ConstantResponse(
            f"{design.dv} is {design.y[0]:g} in all {design.y.size} rows; there is nothing to test"
        )
    possible = math.prod(f.k for f in design.factors)
    empty = np.flatnonzero(np.bincount(design.cells, minlength=possible) == 0)
    if empty.size:
        cell = design.cell_text(int(empty[0]))
        raise MissingCell(f"no row is left with {cell}; the effects cannot be separated")


def _where(row: int, ids: tuple[object, ...], codes: Codes, factors: tuple[Factor, ...]) -> str:
    cell = "".join(f", {f.name} {f.levels[f.codes[row]]}" for f in factors)
    return f"subject {ids[codes[row]]}{cell}"


def _cell_text(cell: int, factors: Sequence[Factor]) -> str:
    places = np.unravel_index(cell, tuple(f.k for f in factors))
    return ", ".join(f"{f.name} {f.levels[int(i)]}" for f, i in zip(factors, places, strict=True))


def _as_names(names: Sequence[str]) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _split(term: str | Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(term, str):
        return (term,) if term in names else tuple(part.strip() for part in term.split(":"))
    return tuple(term)

"""Items: a table with one row for each stimulus, and which of them a session's trials show.

Every trial gets a row, whose columns are its attributes. A column with the name of a factor says at
which level the item may be shown.
"""

import csv
import io
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.lab.errors import DataError, DesignError
from visavis.lab.foreign_text import require_csv
from visavis.lab.kinds import of_kinds
from visavis.lab.plain_files import read_plain
from visavis.lab.yaml_lines import did_you_mean
from visavis.protocol.plan.design import SESSION, Factor
from visavis.protocol.plan.orders import Constraint, no_more_than
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.protocol.plan.steps import Scalar
from visavis.stimuli.sound import read_sound
from visavis.study.names import is_name, reserved_names
from visavis.study.scenes import picture_size

ITEM_STREAM: Final = 0x17E
SLIP_01, SLIP_OF_PART_01 = 0.85, 0.7
"""How alike names are, and each of their words, of which one is the other misspelt."""
"""Random stream of a session that draws its items."""
TRIES: Final = 300
"""How often an order is begun anew that its limits led nowhere."""
MAX_ROWS: Final = 20_000
MAX_PROBLEMS: Final = 8
PICTURES: Final = (".png", ".jpg", ".jpeg", ".gif", ".bmp", ".webp", ".tif", ".tiff")
SOUNDS: Final = (".wav", ".flac", ".ogg")
NUMBER: Final = re.compile(r"[+-]?(0|[1-9]\d*)(\.\d+)?")


@dataclass(frozen=True)
@of_kinds()
class Items:
    """Stimuli of a table (CSV beside the study's file), one in a row, drawn without replacement.

    Columns are attributes of a trial (`t.face`); one with the name of a factor holds the level at
    which its item is shown. `name` is the column that names items (left out: "item", or the first).
    `lists` is a column that shares items out over participants: each sees one list; with a factor
    `over`, each sees all, and a Latin square says at which of its levels. `weight` is a column of
    chances to be drawn. `alike={"gender": 3}` lets at most three with one value follow each other,
    `apart=4` keeps four trials between two showings of an item. With `again` items are shown anew
    once all were shown. Pictures are of one size unless `any_size`.
    """

    file: str
    name: str = ""
    lists: str | None = None
    over: str | None = None
    weight: str | None = None
    alike: Mapping[str, int] = field(default_factory=dict)
    apart: int = 0
    again: bool = False
    any_size: bool = False
    levels: Mapping[str, Mapping[Any, Any]] = field(default_factory=dict)
    """How the table calls levels of factors that have other names in the study."""

    def __post_init__(self) -> None:
        if any(isinstance(n, bool) or n < 1 for n in self.alike.values()) or self.apart < 0:
            raise DesignError(f"Items {self.file!r}: alike is 1 or more, apart 0 or more")


@dataclass(frozen=True)
class ItemTable:
    """A table of items as read: its rows, each with its line in the file, and the naming column."""

    file: str
    name: str
    columns: tuple[str, ...]
    rows: tuple[Mapping[str, Scalar], ...]
    lines: tuple[int, ...]


def read_items(items: Items, folder: Path, factors: Sequence[Factor]) -> ItemTable:
    """Read and check a table of items.

    Raises:
        DesignError: all that is wrong with it, by line.
    """
    table = _read(items, folder)
    problems = [*_of_columns(items, table, factors), *_of_rows(items, table, factors)]
    problems = problems or [*_of_pictures(items, table, folder), *_of_sounds(table, folder)]
    if problems:
        more = len(problems) - MAX_PROBLEMS
        lines = [*problems[:MAX_PROBLEMS], *([f"and {more} more"] if more > 0 else [])]
        raise DesignError("\n  ".join([f"{table.file}: {lines[0]}", *lines[1:]]))
    return table


def order_rules(items: Items | None, factors: Sequence[Factor]) -> tuple[Constraint, ...]:
    """Return the limits on values in a row that the order of trials has to keep: of factors."""
    names = {factor.name for factor in factors if not factor.between}
    alike = {} if items is None else items.alike
    return tuple(no_more_than(most, name) for name, most in alike.items() if name in names)


def fits(items: Items, table: ItemTable, row: int, cell: Mapping[str, Any]) -> bool:
    """Tell whether a row may be shown in a condition."""
    return all(
        table.rows[row][name] == items.levels.get(name, {}).get(level, level)
        for name, level in cell.items()
        if name in table.columns
    )


def items_of_plan(
    items: Items,
    table: ItemTable,
    plan: SessionPlan,
    factors: Sequence[Factor],
    first: SessionPlan | None = None,
    session: int = 1,
) -> dict[str, Mapping[str, Scalar]]:
    """Return the row of every trial of a session, by the trial's id.

    Practice shows what the other trials leave over, where there is enough of it. A later `session`
    shows the choice of the `first` in an order of its own, so that what is tested was learnt.

    Raises:
        DesignError: there are too few items, or no order keeps the limits.
    """
    ordered = {factor.name for factor in factors}  # the order of trials keeps limits on these
    items = replace(items, alike={n: v for n, v in items.alike.items() if n not in ordered})
    index = plan.participant_index
    rng = np.random.default_rng([plan.seed, index, ITEM_STREAM])
    rows_of = _RowsOf(items, table, factors, index)
    main = [t for t in plan.trials if not t.is_practice]
    practice = [t for t in plan.trials if t.is_practice]
    rows_of_main = rows_of
    if first is not None:
        trials_of_first = [t for t in first.trials if not t.is_practice]
        choice = _drawn(items, table, trials_of_first, rows_of, rng, set())
        rows_of_main = _RowsOf(items, table, factors, index, frozenset(choice))
        rng = np.random.default_rng([plan.seed, index, ITEM_STREAM, session])
    main_rows = _drawn(items, table, main, rows_of_main, rng, set())
    spare = _drawn(items, table, practice, rows_of, rng, set(main_rows), is_practice=True)
    trials, rows = [*main, *practice], [*main_rows, *spare]
    return {t.trial_id: table.rows[row] for t, row in zip(trials, rows, strict=True)}


# ---- drawing ---------------------------------------------------------------------------------


class _RowsOf:
    """The rows that a participant may see in a trial, all of `choice` where it is given."""

    def __init__(
        self,
        items: Items,
        table: ItemTable,
        factors: Sequence[Factor],
        index: int,
        choice: frozenset[int] | None = None,
    ) -> None:
        self._items, self._table, self._choice = items, table, choice
        self._own: list[Mapping[str, Any] | None] = []
        over = next((f for f in factors if f.name == items.over), None)
        names = [row[items.lists] for row in table.rows] if items.lists else range(len(table.rows))
        lists = list(dict.fromkeys(names))
        for name in names:
            number = lists.index(name)
            if over is not None:  # the square: each list at another level for the next participant
                self._own.append({over.name: over.levels[(number + index) % len(over.levels)]})
            elif items.lists is None or number == index % len(lists):
                self._own.append({})
            else:
                self._own.append(None)

    def __call__(self, trial: Trial) -> tuple[int, ...]:
        return tuple(
            row
            for row, own in enumerate(self._own)
            if own is not None
            and (self._choice is None or row in self._choice)
            and all(trial.factors.get(name) == level for name, level in own.items())
            and fits(self._items, self._table, row, trial.factors)
        )


def _drawn(
    items: Items,
    table: ItemTable,
    trials: Sequence[Trial],
    rows_of: _RowsOf,
    rng: np.random.Generator,
    shown: set[int],
    *,
    is_practice: bool = False,
) -> list[int]:
    """Return a row for every trial; practice leaves out those `shown` where enough are left."""
    candidates = [rows_of(trial) for trial in trials]
    if is_practice:
        candidates = [tuple(r for r in rows if r not in shown) or rows for rows in candidates]
    again = items.again or is_practice
    for rows, count in Counter(candidates).items():
        if count > len(rows) and not (again and rows):
            trial = trials[candidates.index(rows)]
            cell = {n: v for n, v in trial.factors.items() if n in (*table.columns, items.over)}
            which = ", ".join(f"{name} {level}" for name, level in cell.items())
            raise DesignError(
                f"{table.file} has {len(rows)} items for {which or 'a participant'}, of whose "
                f"trials a session has {count}; lower the repetitions, add rows, or show items "
                "anew: Items(…, again=True)"
            )
    for _ in range(TRIES):
        order = _one_order(items, table, candidates, again, rng)
        if order is not None:
            return order
    limits = [f"alike={dict(items.alike)}"] if items.alike else []
    limits += [f"apart={items.apart}"] if items.apart else []
    raise DesignError(
        f"{table.file}: {TRIES} orders were tried, and none keeps {', '.join(limits) or 'to it'}; "
        "loosen a limit, or add rows"
    )


def _one_order(
    items: Items,
    table: ItemTable,
    candidates: Sequence[Sequence[int]],
    again: bool,
    rng: np.random.Generator,
) -> list[int] | None:
    """Draw a row for one trial after the other; None where the limits leave none."""
    order: list[int] = []
    counts: Counter[int] = Counter()
    for rows in candidates:
        free = [r for r in rows if _may_follow(items, table, order, r)]
        least = min((counts[r] for r in free), default=0)
        if not again:
            free = [r for r in free if counts[r] == 0]
        elif items.weight is None:
            free = [r for r in free if counts[r] == least]
        if not free:
            return None
        chances = None
        if items.weight is not None:
            weights = np.array([float(table.rows[r][items.weight]) for r in free])
            if not weights.sum():
                return None
            chances = weights / weights.sum()
        row = int(rng.choice(free, p=chances))
        counts[row] += 1
        order.append(row)
    return order


def _may_follow(items: Items, table: ItemTable, order: Sequence[int], row: int) -> bool:
    if items.apart and row in order[-items.apart :]:
        return False
    for column, most in items.alike.items():
        last = [table.rows[r][column] for r in order[-most:]]
        if len(last) == most and set(last) == {table.rows[row][column]}:
            return False
    return True


# ---- reading ---------------------------------------------------------------------------------


def _read(items: Items, folder: Path) -> ItemTable:
    path = folder / items.file
    if not path.is_file():
        near = [p.name for p in path.parent.glob("*.csv")] if path.parent.is_dir() else []
        raise DesignError(
            f"there is no table {path}{did_you_mean(path.name, near)}; put it beside the study"
        )
    try:
        text = read_plain(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DesignError(
            f"{items.file} is not UTF-8 (byte {error.start}); save it as CSV UTF-8"
        ) from error
    lines = text.splitlines() or [""]
    delimiter = max(",;\t", key=lines[0].count)
    require_csv(path, text, delimiter)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    numbered = [(reader.line_num, [c.strip() for c in row]) for row in reader if any(row)]
    if not numbered:
        raise DesignError(f"{items.file} is empty; its first line names the columns")
    header = numbered[0][1]
    if len(numbered) == 1:
        raise DesignError(f"{items.file} has a header and no rows; give each stimulus a row")
    if len(numbered) > MAX_ROWS:
        raise DesignError(f"{items.file} has {len(numbered)} rows; at most {MAX_ROWS}")
    twice = [name for name, count in Counter(header).items() if count > 1]
    if twice:
        raise DesignError(f"{items.file} has the column {twice[0]!r} twice")
    for line, row in numbered[1:]:
        if len(row) != len(header):
            raise DesignError(
                f"{items.file}, line {line}: {len(row)} cells below {len(header)} columns"
            )
    columns = {name: _values([row[k] for _, row in numbered[1:]]) for k, name in enumerate(header)}
    rows = tuple(
        {name: values[k] for name, values in columns.items()} for k in range(len(numbered) - 1)
    )
    name = items.name or ("item" if "item" in header else header[0])
    return ItemTable(items.file, name, tuple(header), rows, tuple(n for n, _ in numbered[1:]))


def _values(texts: Sequence[str]) -> list[Scalar]:
    """Return a column's values: numbers where all are."""
    if not all(NUMBER.fullmatch(text) for text in texts):
        return list(texts)
    if any("." in text for text in texts):
        return [float(text) for text in texts]
    return [int(text) for text in texts]


# ---- what can be wrong -----------------------------------------------------------------------


def is_slip(name: str, other: str) -> bool:
    """Tell whether a name is another one misspelt, and not a like one for something else.

    `seen_befor` is `seen_before`; `target_side` is not `cue_side`, for a word of it differs.
    """
    a, b = name.casefold(), other.casefold()
    parts_a, parts_b = a.split("_"), b.split("_")
    is_same_count = len(parts_a) == len(parts_b)
    parts = zip(parts_a, parts_b, strict=True) if is_same_count else ()
    return SequenceMatcher(None, a, b).ratio() >= SLIP_01 and all(
        SequenceMatcher(None, x, y).ratio() >= SLIP_OF_PART_01 for x, y in parts
    )


def _of_columns(items: Items, table: ItemTable, factors: Sequence[Factor]) -> Iterator[str]:
    reserved = reserved_names(factors)
    own = {f.name for f in factors}
    for name in table.columns:
        if name == SESSION:
            yield (
                f"{name!r} is a column of every trial, and an item has one row for all sessions: "
                "give what each session shows a column of its own, such as picture_before and "
                "picture_after, and let the trial choose by t.session"
            )
        elif name in reserved:
            yield f"{name!r} is a column of every trial; name yours otherwise"
        elif not is_name(name):
            yield f"the column {name!r} is no name; give letters, digits and _"
    for factor in (f for f in factors if f.name not in table.columns):
        levels = {*factor.levels, *factor.practice_only}
        for name in sorted({*table.columns} - own):
            if is_slip(name, factor.name) and {row[name] for row in table.rows} <= levels:
                yield (
                    f"line 1: the column {name!r} holds levels of the factor {factor.name!r} and "
                    "is called otherwise, so that items would be shown at any level; call it "
                    f"{factor.name!r}, or give it a name unlike a factor's"
                )
    options = {"name": table.name, "lists": items.lists, "weight": items.weight}
    named = [*options.items(), *(("alike", column) for column in items.alike)]
    for what, column in named:
        if column is not None and column not in table.columns:
            near = did_you_mean(column, table.columns)
            yield f"{what} names {column!r}, which is no column{near}"
    if items.over is not None and (items.over not in own or items.over in table.columns):
        yield f"over names {items.over!r}, which is no factor that the table leaves open"


def _of_rows(items: Items, table: ItemTable, factors: Sequence[Factor]) -> Iterator[str]:
    names = [row.get(table.name) for row in table.rows]
    firsts: dict[Any, int] = {}
    for line, name in zip(table.lines, names, strict=True):
        if name == "":
            yield f"line {line}: {table.name} is empty"
        elif name in firsts:
            yield f"line {line}: {name!r} is in line {firsts[name]} already; name each row once"
        firsts.setdefault(name, line)
    for factor in factors:
        if factor.name not in table.columns:
            continue
        calls = items.levels.get(factor.name, {})
        levels = [calls.get(level, level) for level in (*factor.levels, *factor.practice_only)]
        values = {row[factor.name] for row in table.rows}
        for level in levels:
            if level not in values:
                yield f"no row has {factor.name} {level!r}, a level of the factor"
        for line, row in zip(table.lines, table.rows, strict=True):
            if row[factor.name] not in levels:
                near = did_you_mean(str(row[factor.name]), [str(level) for level in levels])
                yield f"line {line}: {factor.name} is {row[factor.name]!r}, no level{near}"
    for line, row in zip(table.lines, table.rows, strict=True):
        weight = 1 if items.weight is None else row.get(items.weight, 1)
        if isinstance(weight, str) or weight < 0:
            yield f"line {line}: {items.weight} is {weight!r}; a weight is 0 or more"


def _of_pictures(items: Items, table: ItemTable, folder: Path) -> Iterator[str]:
    """Yield what is wrong with the pictures that the table names: missing, spelled otherwise, no
    pictures, or of another size than most in their column.
    """
    for column in table.columns:
        sizes: list[tuple[int, tuple[int, int]]] = []
        for line, file in _files_in(table, column, PICTURES):
            try:
                sizes.append((line, picture_size(_spelled(folder, file))))
            except DesignError as problem:
                yield f"line {line}: {problem}"
        usual = Counter(size for _, size in sizes).most_common(1)
        for line, size in () if items.any_size else sizes:
            if size != usual[0][0]:
                wide, high = usual[0][0]
                yield (
                    f"line {line}: its {column} is {size[0]} x {size[1]} pixels, most are "
                    f"{wide} x {high}; make them alike, or Items(…, any_size=True)"
                )


def _of_sounds(table: ItemTable, folder: Path) -> Iterator[str]:
    """Yield what is wrong with the sounds that the table names: missing, spelled otherwise, or
    nothing that can be played.
    """
    for column in table.columns:
        for line, file in _files_in(table, column, SOUNDS):
            try:
                read_sound(_spelled(folder, file))
            except (DataError, DesignError) as problem:
                yield f"line {line}: {problem}"


def _files_in(table: ItemTable, column: str, endings: tuple[str, ...]) -> list[tuple[int, str]]:
    """Return line and name of each file in a column of files of one kind; nothing of others."""
    files = [str(row[column]) for row in table.rows]
    is_of_kind = any(file.lower().endswith(endings) for file in files)
    return list(zip(table.lines, files, strict=True)) if is_of_kind else []


def _spelled(folder: Path, file: str) -> Path:
    """Return the path of a file.

    Raises:
        DesignError: its name is spelled otherwise there.
    """
    path = folder / file
    there = {p.name for p in path.parent.iterdir()} if path.parent.is_dir() else set()
    same = [n for n in sorted(there) if _bare(n) == _bare(path.name)]
    if same and path.name not in there:
        raise DesignError(f"{file!r} is called {same[0]!r} there; write it so")
    return path


def _bare(name: str) -> str:
    """Return a file's name as it is the same on every system."""
    return unicodedata.normalize("NFC", name).casefold()

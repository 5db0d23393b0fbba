"""Read tables of text as other programs write them: encodings, delimiters, numbers.

What is read otherwise than it stands is told in remarks; what may mean two things is refused.
"""

import csv
import io
import itertools
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from visavis.lab.errors import DataError

MISSING_WORDS = frozenset({"", "na", "nan", "n/a", "null", "none", "#n/a", ".", "-nan", "nan(ind)"})
"""Texts that mean a missing number, in any case."""
_BOMS = ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))
_SEP_LINE = re.compile(r'"?sep=(.)"?\s*')
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?")
_POINT_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?")
_COMMA_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?")
_OTHER_THOUSANDS = re.compile("[+-]?[1-9]\\d{0,2}(['’\u00a0\u202f ]\\d{3})+([.,]\\d*)?")
_GROUPING_SIGNS = frozenset(",'’\u00a0\u202f ")
_UNGROUPED = re.compile(r"[+-]?\d{4,}([.,]\d*)?")
_BETWEEN_THOUSANDS = re.compile("['’\u00a0\u202f ]")
MAX_CELLS_JUDGED = 2000
"""So many cells of a column say what its file's decimal sign is."""
MAX_CODE_ROWS_01 = 0.5
_CODE = re.compile(r"-?(9{2,}(\.9+)?|8{2,}|7{2,})|-(1|9)")
_SCALE_CODES = frozenset({8.0, 9.0})
"""Codes for missing beside answers from 1 to 7."""
MIN_CODE_GAPS = 3.0
"""A code lies apart from so many times the largest gap between other values."""
MIN_PILED_CODES = 3
MIN_ROWS_BEFORE_CUT = 4
"""So many rows show how long a number is before the last one can be judged cut."""
_WITHIN_WORD = re.compile(rb"[A-Za-z][\x80-\xff]+[A-Za-z]")
MAX_WORDS_JUDGED = 2000
_LETTERS_OR_SIGNS_OF_WORDS = frozenset(b"\x83\x8a\x8c\x8e\x9a\x9c\x9e\x9f\x85\x92\x96\x97")
"""Bytes of Windows-1252 below 0xA0 that stand within words: letters, and ’ – — …"""


def decode_text(raw: bytes) -> tuple[str, tuple[str, ...]]:
    """Return a file's text and remarks on how it was read.

    UTF-8 and UTF-16 with or without a byte order mark, else Windows-1252, or Mac OS Roman by the
    letters within words. Of UTF-16 that is cut within a character the rest is read. Raises
    ValueError for what is no text.
    """
    for mark, encoding in _BOMS:
        if raw.startswith(mark):
            return _utf16(raw[2:], encoding)
    nulls = (raw[:4096:2].count(0), raw[1:4096:2].count(0))
    if any(nulls):
        half = len(raw[:4096]) // 2
        if max(nulls) > 0.6 * half and min(nulls) < 0.1 * half:
            return _utf16(raw, "utf-16-be" if nulls[0] > nulls[1] else "utf-16-le")
        raise ValueError("it holds bytes of zero")
    try:
        return raw.decode("utf-8-sig"), ()
    except UnicodeDecodeError as error:
        if error.end >= len(raw) and error.reason == "unexpected end of data":
            return _without_last_line(raw[: error.start].decode("utf-8-sig"))
        return _one_byte_text(raw)


def _one_byte_text(raw: bytes) -> tuple[str, tuple[str, ...]]:
    """Return a text of one byte a letter as Windows or as older Macs wrote it, and which."""
    of_mac, of_windows, doubtful = b"", b"", b""
    for match in itertools.islice(_WITHIN_WORD.finditer(raw), MAX_WORDS_JUDGED):
        word, high = match[0], match[0][1:-1]
        # § within a word is ß of a Mac, and so is a capital after a letter: fŸr is für.
        is_capital_within = any(b in b"\x8a\x8c\x8e\x9f" for b in high) and word[-1:].islower()
        if all(b >= 0xC0 for b in high):
            of_windows = of_windows or word
        elif (
            is_capital_within
            or 0xA7 in high
            or any(0x80 <= b < 0xA0 and b not in _LETTERS_OR_SIGNS_OF_WORDS for b in high)
        ):
            of_mac = of_mac or word
        elif any(b in b"\x9a\x9c\x9e" for b in high):
            doubtful = doubtful or word
    if of_mac and not of_windows:
        text = raw.decode("mac_roman")
        example = of_mac.decode("mac_roman")
        return text, (f"read as Mac OS Roman, it is neither UTF-8 nor Windows-1252 ({example})",)
    remark = "read as Windows-1252, it is not UTF-8"
    if doubtful and not of_windows:
        as_read, other = doubtful.decode("cp1252"), doubtful.decode("mac_roman")
        remark += f"; if {as_read} should be {other}, save it as UTF-8"
    return raw.decode("cp1252", errors="replace"), (remark,)


def _utf16(raw: bytes, encoding: str) -> tuple[str, tuple[str, ...]]:
    text = raw[: len(raw) // 2 * 2].decode(encoding, errors="replace")
    return _without_last_line(text) if len(raw) % 2 else (text, ())


def _without_last_line(text: str) -> tuple[str, tuple[str, ...]]:
    """Return a text that is cut within a character up to its last whole line, and that it is."""
    remark = "the file is cut off in the middle of a character; its last line was left out"
    return text[: text.rfind("\n") + 1], (remark,)


@dataclass(frozen=True)
class ForeignRows:
    """A table's cells as text: names of columns, rows, and each row's line in the file.

    `remarks` say what was read otherwise than it stands.
    """

    names: tuple[str, ...]
    rows: Sequence[Sequence[str]] = field(repr=False)
    lines: Sequence[int] = field(repr=False)
    delimiter: str
    remarks: tuple[str, ...]


def read_rows(
    text: str,
    *,
    what: str,
    delimiter: str | None = None,
    names: Sequence[str] | None = None,
) -> ForeignRows:
    """Return the rows of a table below its header; empty lines are passed over.

    `what` names the table in messages. The delimiter is found in the header when left out; a first
    line `sep=;` says it; columns that are aligned by blanks may have several between them. `names`
    stands for a header that the file lacks. Names of rows as R writes them and columns without a
    name or value are left out, a last line that is cut as well.

    Raises:
        DataError: rows of different lengths, a column named twice, no header or no row.
    """
    remarks: list[str] = []
    skip_count = 0
    first_line, _, rest = text.partition("\n")
    if match := _SEP_LINE.fullmatch(first_line.strip("\ufeff\r")):
        delimiter, text, skip_count = match[1], rest, 1
    if delimiter is None:
        delimiter = _delimiter(text)
    numbered_rows = _numbered_rows(text, delimiter, what, skip_count)
    if names is None:
        if not numbered_rows:
            raise DataError(f"{what}: the file is empty; leave it out")
        names = [cell.strip() for cell in numbered_rows[0][1]]
        numbered_rows = numbered_rows[1:]
    if not numbered_rows:
        raise DataError(
            f"{what}: a header but no samples, no rows below it; a recording that never started: "
            "leave the file out"
        )
    header = list(names)
    if _has_row_names(header, numbered_rows, text, delimiter):
        header.insert(0, "")
    header, numbered_rows = _whole_rows(header, numbered_rows, delimiter, what, remarks)
    if not text.endswith(("\n", "\r", '"')):
        numbered_rows = _without_cut_number(numbered_rows, remarks)
    header, rows = _without_nameless(header, [row for _, row in numbered_rows], what, remarks)
    twice = sorted(name for name, n in Counter(header).items() if n > 1)
    if twice:
        raise DataError(f"{what} names the column {twice[0]!r} twice; rename one")
    return ForeignRows(
        tuple(header), rows, [line for line, _ in numbered_rows], delimiter, tuple(remarks)
    )


def _delimiter(text: str) -> str:
    header = next((line for line in text.splitlines() if line.strip()), "")
    bare = re.sub(r'"[^"]*"', "", header)
    best = max((",", ";", "\t"), key=bare.count)
    if bare.count(best) == 0 and " " in bare.strip():
        return " "
    return best


def require_csv(path: Path, text: str, delimiter: str = ",") -> None:
    """Refuse a table of the laboratory's that no reader of CSV can take, such as an endless cell.

    Raises:
        DataError: naming the line.
    """
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    try:
        for _ in reader:
            pass
    except csv.Error as error:
        raise DataError(f"{path}, line {reader.line_num}: {error}; repair the line") from error


def _numbered_rows(
    text: str, delimiter: str, what: str, skipped: int
) -> list[tuple[int, list[str]]]:
    if delimiter == " ":
        text = "\n".join(line.rstrip(" ") for line in text.splitlines())

    def read(quoting: Literal[0, 3]) -> list[tuple[int, list[str]]]:
        reader = csv.reader(
            io.StringIO(text, newline=""),
            delimiter=delimiter,
            strict=True,
            quoting=quoting,
            skipinitialspace=delimiter == " ",
        )
        try:
            rows = [(reader.line_num + skipped, row) for row in reader]
        except csv.Error as error:
            line = reader.line_num + skipped
            raise DataError(f"{what}, line {line}: {error}; repair the line") from error
        return [(line, row) for line, row in rows if any(cell.strip() for cell in row)]

    try:
        return read(csv.QUOTE_MINIMAL)
    except DataError:
        # A quote that is none, as in 5" of a message: then every row is as long as the header.
        rows = read(csv.QUOTE_NONE)
        if len({len(row) for _, row in rows}) != 1 or '\n"' in text:
            raise
        return rows


def _has_row_names(
    header: Sequence[str], numbered_rows: Sequence[tuple[int, list[str]]], text: str, delimiter: str
) -> bool:
    """Say whether every row begins with a name that the header has no column for (R).

    R quotes it in files, and prints it bare in front of columns that blanks align.
    """
    if any(len(row) != len(header) + 1 or not row[-1] for _, row in numbered_rows):
        return False
    if delimiter == " ":
        return len({row[0] for _, row in numbered_rows}) == len(numbered_rows)
    return all(line.lstrip().startswith('"') for line in text.splitlines() if line.strip())


def _whole_rows(
    header: list[str],
    numbered_rows: list[tuple[int, list[str]]],
    delimiter: str,
    what: str,
    remarks: list[str],
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return rows as long as the header; the last may be cut, others may end in delimiters."""
    n = len(header)
    if numbered_rows and len(numbered_rows) > 1 and len(numbered_rows[-1][1]) < n:
        line, row = numbered_rows[-1]
        remarks.append(
            f"line {line}, the last, is cut off: {len(row)} cells of {n}; it was left out"
        )
        numbered_rows = numbered_rows[:-1]
    whole = []
    for line, row in numbered_rows:
        if len(row) > n and not any(cell.strip() for cell in row[n:]):
            row = row[:n]  # delimiters at the end of the line
        if len(row) != n:
            hint = (
                "; if its numbers have decimal commas, save it with semicolons between columns"
                if delimiter == "," and len(row) > n
                else f"; was it cut off, or is the delimiter not {delimiter!r}?"
            )
            raise DataError(f"{what}: line {line} has {len(row)} cells, the header has {n}{hint}")
        whole.append((line, row))
    return header, whole


def _without_cut_number(
    numbered_rows: list[tuple[int, list[str]]], remarks: list[str]
) -> list[tuple[int, list[str]]]:
    """Return the rows of a file without a line end at its end, whose last cell may be cut.

    A last number with fewer decimals than all above it is: its row is left out. A whole number or a
    word may be what it is, as may one below thousands: it is read, and the doubt is told.
    """
    cells = [row[-1].strip() for _, row in numbered_rows[-MAX_CELLS_JUDGED:]]
    last, others = cells[-1], [c for c in cells[:-1] if c.lower() not in MISSING_WORDS]
    if not last or len(others) < MIN_ROWS_BEFORE_CUT:
        return numbered_rows
    line = numbered_rows[-1][0]
    are_numbers = all(map(_is_number, others))
    decimals = min(map(_digits_after_sign, others)) if are_numbers else 0
    is_below_thousands = last.isdigit() and _are_thousands(others, numbered_rows)
    is_cut = _digits_after_sign(last) < decimals and not is_below_thousands
    if are_numbers and (last in ("-", "+") or is_cut):
        remarks.append(
            f"line {line}, the last, has no end and its {last} fewer digits than all numbers above "
            "it: the file is cut off there; the line was left out"
        )
        return numbered_rows[:-1]
    n_digits = [sum(map(str.isdigit, c)) for c in (last, *others)]
    if (are_numbers and n_digits[0] < min(n_digits[1:])) or (
        not are_numbers and last not in others and any(c.startswith(last) for c in others)
    ):
        remarks.append(
            f"line {line}, the last, has no end and its {last} is shorter than all above it: was "
            "the file cut off there? It is read as it stands"
        )
    return numbered_rows


def _are_thousands(numbers: list[str], numbered_rows: list[tuple[int, list[str]]]) -> bool:
    """Tell whether signs part thousands: one stands twice, or decimals elsewhere have the other."""
    sign = "." if any("." in number for number in numbers) else ","
    if any(number.count(sign) > 1 for number in numbers):
        return True
    decimal = re.compile(r"\d+" + ("," if sign == "." else r"\.") + r"\d+")
    rows = (row for _, row in numbered_rows[-MAX_CELLS_JUDGED:])
    return any(decimal.fullmatch(cell.strip()) for row in rows for cell in row[:-1])


def _digits_after_sign(number: str) -> int:
    """Return how many digits stand after the last point or comma of a number; 0 without one."""
    at = max(number.rfind("."), number.rfind(","))
    return len(number) - at - 1 if at >= 0 else 0


def _without_nameless(
    header: list[str], rows: list[list[str]], what: str, remarks: list[str]
) -> tuple[list[str], list[list[str]]]:
    nameless = [i for i, name in enumerate(header) if not name]
    if not nameless:
        return header, rows
    for i in nameless:
        cells = [row[i].strip() for row in rows]
        if i == 0 and len(set(cells)) == len(cells):
            remarks.append("the first column has no name: its cells are names of rows, left out")
        elif any(cells):
            row = next(k for k, cell in enumerate(cells) if cell)
            raise DataError(
                f"{what}: column {i + 1} has no name but holds {cells[row]!r}; name it or empty it"
            )
    others = [i for i in range(len(header)) if i not in nameless]
    return [header[i] for i in others], [[row[i] for i in others] for row in rows]


# ---- numbers -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class NumberStyle:
    """How a column writes numbers: its decimal sign, and the sign between thousands ("" for none).

    `remark` says so where a reader could take it otherwise.
    """

    decimal: str = "."
    thousands: str = ""
    remark: str = ""

    def plain(self, text: str) -> str:
        """Return a number's text with a decimal point and nothing between thousands."""
        if self.thousands:
            text = _BETWEEN_THOUSANDS.sub("", text.replace(self.thousands, ""))
        return text.replace(",", ".") if self.decimal == "," else text


def file_decimal(columns: Mapping[str, Sequence[str]]) -> str:
    """Return the decimal sign that the columns of a file use beyond doubt; "" if none is."""
    signs = set()
    for texts in columns.values():
        signs |= _certain_signs(texts[:MAX_CELLS_JUDGED])
    return signs.pop() if len(signs) == 1 else ""


def _certain_signs(texts: Sequence[str]) -> set[str]:
    """Return the signs that must be decimal in a column of numbers; none if it holds other texts.

    A sign is decimal where it stands after a leading 0, before other than three digits, or beside
    the other sign between thousands; a sign that stands twice makes the other one decimal.
    """
    signs: set[str] = set()
    for text in texts:
        word = text.strip()
        if word.lower() in MISSING_WORDS:
            continue
        if not _is_number(word):
            return set()
        for sign, other, pattern, by_other in (
            (",", ".", _COMMA_THOUSANDS, _POINT_THOUSANDS),
            (".", ",", _POINT_THOUSANDS, _COMMA_THOUSANDS),
        ):
            if sign not in word:
                continue
            if other in word:
                signs.add(sign if by_other.fullmatch(word) else other)
            elif word.count(sign) > 1:
                signs.add(other)
            elif not pattern.fullmatch(word):
                signs.add(sign)
    return signs


def _is_number(word: str) -> bool:
    patterns = (_POINT, _COMMA, _POINT_THOUSANDS, _COMMA_THOUSANDS, _OTHER_THOUSANDS)
    return any(p.fullmatch(word) for p in patterns)


def style_of_numbers(
    texts: Sequence[str],
    *,
    delimiter: str,
    of_file: str = "",
    place: Callable[[int], str] = "row {}".format,
) -> NumberStyle:
    """Return how a column writes its numbers, by evidence of all its cells.

    `delimiter` parts the file's columns, `of_file` is the decimal sign that other columns show
    beyond doubt, `place` names a row in messages.

    Raises:
        ValueError: it may mean two things; the message says which cell and what to do.
    """
    words = [text.strip() for text in texts]
    signs = set("".join(words))
    points_are_clear = "." not in signs or (delimiter == "," and of_file != ",")
    if not signs & _GROUPING_SIGNS and points_are_clear:
        return NumberStyle()  # nearly every column; what follows looks at each cell
    rows = {sign: [i for i, w in enumerate(words) if sign in w and _is_number(w)] for sign in ",."}
    spaced = [i for i, w in enumerate(words) if _OTHER_THOUSANDS.fullmatch(w)]
    certain = _certain_signs(words)
    if len(certain) > 1:
        comma, point = (
            next(i for i in rows[sign] if sign in _certain_signs([words[i]])) for sign in ",."
        )
        raise ValueError(
            f"has decimal commas ({place(comma)}: {words[comma]}) and decimal points "
            f"({place(point)}: {words[point]}); write all numbers one way"
        )
    decimal = next(iter(certain), "") or of_file
    if not decimal:
        decimal = _decimal_without_evidence(words, rows, delimiter, place)
    if decimal == "." and not certain and delimiter != ",":
        _refuse_both_grouped_and_not(words, rows["."], place)
    grouped = rows["." if decimal == "," else ","] or spaced
    if not grouped:
        return NumberStyle(decimal)
    # Where thousands are parted they are parted everywhere: 1.012 beside 1500 is neither.
    example = grouped[0]
    ungrouped = next((i for i, w in enumerate(words) if _UNGROUPED.match(w)), None)
    if ungrouped is not None:
        raise ValueError(
            f"holds {words[example]} in {place(example)} and {words[ungrouped]} in "
            f"{place(ungrouped)}: a decimal sign or thousands? Write numbers without grouping"
        )
    style = NumberStyle(decimal, ("." if decimal == "," else ",") if not spaced else " ")
    plain = style.plain(words[example])
    return replace(style, remark=f"{words[example]} is read as {plain}: its thousands are parted")


def _refuse_both_grouped_and_not(
    words: Sequence[str], with_point: Sequence[int], place: Callable[[int], str]
) -> None:
    """Refuse 1.047 beside 978: thousands of a program that writes commas, or three decimals."""
    if not with_point or not all(_POINT_THOUSANDS.fullmatch(words[i]) for i in with_point):
        return
    whole = next((i for i, w in enumerate(words) if w.isdecimal() and len(w) == 3), None)
    if whole is not None:
        raise ValueError(
            f"holds {words[with_point[0]]} in {place(with_point[0])} and {words[whole]} in "
            f"{place(whole)}: a decimal point or thousands? Write numbers without grouping"
        )


_WAY_OUT = "write numbers without grouping, or part the columns by commas if it is decimal"


def _decimal_without_evidence(
    words: Sequence[str],
    rows: Mapping[str, Sequence[int]],
    delimiter: str,
    place: Callable[[int], str],
) -> str:
    """Return the decimal sign of a column in which every sign has three digits after it."""
    for sign, grouped in ((",", _COMMA_THOUSANDS), (".", _POINT_THOUSANDS)):
        doubtful = [i for i in rows[sign] if grouped.fullmatch(words[i])]
        # Points between commas are English decimals, and between tabs where numbers without stand
        # beside them; 1.012.345 are thousands.
        is_english = delimiter == "," or (
            delimiter != ";" and len(doubtful) < sum(map(_is_number, words))
        )
        if not doubtful or (sign == "." and is_english):
            continue
        row = doubtful[0]
        name = "comma" if sign == "," else "point"
        raise ValueError(
            f"holds {words[row]} in {place(row)}, which may be a decimal {name} or thousands; "
            + ("write numbers without grouping" if sign == "," or delimiter == ";" else _WAY_OUT)
        )
    return "."


def codes_for_missing(values: Mapping[float, int]) -> dict[float, int]:
    """Return the values that look like codes for missing, with how often each stands there.

    `values` counts each value of a column. 99, 999, -9 and the like count when they lie beyond all
    that is no code, and far from it: by more than the others reach, by several times the largest
    gap between them, or piled up as none of them is; 8 and 9 beside whole numbers up to 7 as well.
    """
    others = sorted(v for v in values if not _CODE.fullmatch(f"{v:g}"))
    is_scale = (
        len(others) > 2
        and {v for v in others if v not in _SCALE_CODES} <= set(range(8))
        and bool(_SCALE_CODES & set(others))
    )
    if is_scale:
        others = [v for v in others if v not in _SCALE_CODES]
    if len(others) < 3:
        return {}
    low, high = others[0], others[-1]
    span = max(high - low, abs(high), abs(low), 1e-12)
    gap = max(b - a for a, b in itertools.pairwise(others))
    most = max(values[v] for v in others)
    codes = {}
    for value, count in values.items():
        away = max(value - high, low - value)
        if value in others or away <= 0:
            continue
        is_far = away > span or (value < 0 <= low) or away > MIN_CODE_GAPS * gap
        is_piled = count >= MIN_PILED_CODES and count > most
        if value in _SCALE_CODES:
            is_far, is_piled = away > 1 and count > 1, False
        if is_far or is_piled:
            codes[value] = count
    return codes


def remark_on_codes(name: str, numbers: Sequence[float]) -> str:
    """Return a remark on values that look like codes for missing; "" where there are none."""
    counts: dict[float, int] = {}
    for value in numbers:
        if value == value:  # missing is NaN
            counts[value] = counts.get(value, 0) + 1
    codes = codes_for_missing(counts)
    if not codes or sum(codes.values()) > MAX_CODE_ROWS_01 * sum(counts.values()):
        return ""
    others = [v for v in counts if v not in codes]
    rows = ", ".join(f"{v:g} in {n} row{'s' if n > 1 else ''}" for v, n in sorted(codes.items()))
    return (
        f"{name} holds {rows}, apart from all others ({min(others):g} to {max(others):g}): a code "
        "for missing? If so, empty these cells"
    )

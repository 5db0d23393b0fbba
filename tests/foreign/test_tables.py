"""Tables as people have them: numbers, names, encodings and shapes are read right or refused."""

import json
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from visavis.analysis.statistics.errors import NotNumeric
from visavis.analysis.statistics_report import (
    Question,
    answer,
    long_table,
    read_table,
    table_of,
    with_numbers_for_words,
    with_one_spelling,
)
from visavis.analysis.statistics_report.spelling import (
    OneNameSpeltTwice,
    refuse_spellings,
)
from visavis.cli.main import app
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import decode_text, read_rows, remark_on_codes, style_of_numbers
from visavis.lab.spelling import plain_name

FILES = Path(__file__).parent / "files" / "tables"
PAIRED = Question("paired", dv="rt", within=("condition",), subject="participant")
GROUPS = Question("t", dv="rt", between=("group",), subject="participant")


def ran(file: Path, out: Path, *options: str) -> dict[str, Any]:
    result = CliRunner().invoke(
        app, ["stats", str(file), "--dv", "rt", *options, "--json", "-o", str(out)]
    )
    assert 0 == result.exit_code, result.output
    return json.loads(result.output)


# ---- the files ---------------------------------------------------------------------------------


def test_people_written_as_1_and_1_0_are_16_or_refused(tmp_path: Path) -> None:
    table = read_table(FILES / "ids_1_and_1.0.csv")
    with pytest.raises(OneNameSpeltTwice, match=r"'1' \(row 1 \(line 2\)\) and '1\.0' \(row 2"):
        answer(table, GROUPS)
    said = ("--test", "t", "--between", "group", "--subject", "participant")
    (row,) = ran(FILES / "ids_1_and_1.0.csv", tmp_path / "a", *said, "--spelling", "same")["rows"]
    assert (pytest.approx(0.119, abs=5e-4), pytest.approx(12.36, abs=5e-3)) == (row["p"], row["df"])
    (row,) = ran(FILES / "ids_1_and_1.0.csv", tmp_path / "b", *said, "--spelling", "apart")["rows"]
    assert pytest.approx(28.11, abs=5e-3) == row["df"]


def test_people_that_differ_by_case_zeros_and_blanks_are_named() -> None:
    with pytest.raises(OneNameSpeltTwice) as raised:
        answer(read_table(FILES / "ids_P05_p05_P6.csv"), GROUPS)
    for pair in ("'P05' (row 9 (line 10)) and 'p05'", "'P06' (row 11", "'P09' (row 17"):
        assert pair in str(raised.value)


@pytest.mark.parametrize(("delimiter", "of_file"), [("\t", ""), (";", ".")])
def test_thousands_beside_whole_hundreds_are_no_decimals(delimiter: str, of_file: str) -> None:
    with pytest.raises(ValueError, match=r"holds 1\.047 in row 1 and 978 in row 0: a decimal"):
        style_of_numbers(["978", "1.047", "1.831"], delimiter=delimiter, of_file=of_file)
    assert "." == style_of_numbers(["9.78", "1.047", "978"], delimiter=delimiter).decimal


def test_german_thousands_are_thousands_by_the_other_columns() -> None:
    outcome = answer(read_table(FILES / "german_thousands.csv"), PAIRED)
    frame = pd.read_csv(FILES / "german_thousands.csv", sep=";", decimal=",", thousands=".")
    expected = frame.groupby("condition")["rt"].mean()
    assert expected.round(6).to_dict() == {
        str(row["condition"]): round(float(row["mean"]), 6) for row in outcome.cells
    }
    assert any("1.063 is read as 1063" in note for note in outcome.notes)


def test_three_decimals_after_a_comma_are_decimals() -> None:
    values = read_table(FILES / "three_decimals_with_commas.csv").numbers("rt")
    frame = pd.read_csv(FILES / "three_decimals_with_commas.csv", sep=";", decimal=",")
    assert frame["rt"].tolist() == values.tolist()


def test_a_line_that_names_the_separator_is_no_header() -> None:
    table = read_table(FILES / "sep_line.csv")
    assert ["participant", "group", "condition", "rt"] == list(table.cells.columns)
    assert (32, 3) == (len(table.lines), table.lines[0])
    assert 562.2 == table.numbers("rt")[0]


def test_a_file_cut_within_a_character_is_read_without_its_last_line(tmp_path: Path) -> None:
    table = read_table(FILES / "utf16_cut.csv")
    assert 31 == len(table.lines)
    assert any("cut off in the middle of a character" in note for note in table.notes)
    arguments = ["--test", "paired", "--dv", "rt", "--within", "condition"]
    result = CliRunner().invoke(
        app,
        ["stats", str(FILES / "utf16_cut.csv"), *arguments, "--subject", "participant"],
    )
    assert "cut off" in result.output  # beside the refusal of the person who then lacks a cell


# ---- further members of the kind ---------------------------------------------------------------


def german(value: float, decimals: int) -> str:
    return f"{value:,.{decimals}f}".translate(str.maketrans(",.", ".,"))


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(st.integers(1, 9_999_999), min_size=2, max_size=12),
    style=st.sampled_from(["german", "english", "swiss", "plain"]),
)
def test_thousands_are_read_right_or_refused_never_a_thousand_times_too_small(
    values: list[int], style: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("t") / "t.csv"
    cells = {
        "german": [german(v, 0) for v in values],
        "english": [f"{v:,}" for v in values],
        "swiss": [f"{v:,}".replace(",", "’") for v in values],
        "plain": [str(v) for v in values],
    }[style]
    other = {"german": "1,5", "english": "1.5", "swiss": "1.5", "plain": "1.5"}[style]
    lines = ["n;y;other", *(f"{i};{cell};{other}" for i, cell in enumerate(cells))]
    path.write_text("\n".join(lines), encoding="utf-8")
    assert [float(v) for v in values] == read_table(path).numbers("y").tolist()
    # Without the other column some are in doubt: then refused, and else the same.
    path.write_text("\n".join(line.rsplit(";", 1)[0] for line in lines), encoding="utf-8")
    with suppress(NotNumeric):
        assert [float(v) for v in values] == read_table(path).numbers("y").tolist()


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(st.floats(-5000, 5000, allow_nan=False), min_size=1, max_size=12),
    decimals=st.integers(1, 6),
    sign=st.sampled_from([".", ","]),
)
def test_decimals_are_read_right_or_refused(values: list[float], decimals: int, sign: str) -> None:
    texts = [f"{v:.{decimals}f}" for v in values]
    with suppress(ValueError) if decimals == 3 else nullcontext():
        style = style_of_numbers([t.replace(".", sign) for t in texts], delimiter=";")
        read = [float(style.plain(t.replace(".", sign))) for t in texts]
        assert [float(t) for t in texts] == read


def test_thousands_that_are_not_parted_everywhere_are_refused() -> None:
    with pytest.raises(ValueError, match=r"1\.012 in row 0 and 1500 in row 1"):
        style_of_numbers(["1.012", "1500", "1,5"], delimiter=";")


names = st.from_regex(r"[A-Za-z]{0,3}[1-9][0-9]{0,3}", fullmatch=True)
spellings = st.sampled_from(
    [
        str.upper,
        str.lower,
        lambda n: f" {n}",
        lambda n: f"{n[:1]} {n[1:]}",
        lambda n: (
            "".join(c for c in n if not c.isdigit()) + "0" + "".join(c for c in n if c.isdigit())
        ),
        lambda n: f"{n}.0" if n.isdigit() else n,
    ]
)


@settings(max_examples=80, deadline=None)
@given(people=st.lists(names, min_size=2, max_size=6, unique_by=str.casefold), how=spellings)
def test_one_name_spelt_twice_is_refused_and_different_names_are_not(
    people: list[str], how: Any
) -> None:
    frame = pd.DataFrame({"who": people, "y": range(len(people))})
    refuse_spellings(table_of(frame), "who")
    other = how(people[0])
    if other == people[0]:
        return
    twice = table_of(pd.DataFrame({"who": [*people, other], "y": range(len(people) + 1)}))
    with pytest.raises(OneNameSpeltTwice):
        refuse_spellings(twice, "who")
    assert len(people) == len(set(with_one_spelling(twice, ["who"]).texts("who")))


@pytest.mark.parametrize(
    ("one", "other"), [("0.5", "0.05"), ("P1", "P10"), ("a1", "b1"), ("1", "-1"), ("v1.5", "v1.05")]
)
def test_names_that_differ_by_more_stay_apart(one: str, other: str) -> None:
    assert plain_name(one) != plain_name(other)


def test_groups_that_differ_by_case_are_refused() -> None:
    frame = pd.DataFrame({"p": range(4), "group": ["Control", "control", "b", "b"], "rt": range(4)})
    with pytest.raises(OneNameSpeltTwice, match="'Control'"):
        answer(frame, Question("t", dv="rt", between=("group",), subject="p"))


@settings(max_examples=40, deadline=None)
@given(
    text=st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), min_size=1),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"]),
    cut=st.booleans(),
)
def test_text_is_read_in_every_encoding(text: str, encoding: str, cut: bool) -> None:
    content = f"name,value\nabcdefghijklmnop,1\nqrstuvwxyz,2\n{text},3"
    raw = content.encode(encoding)
    if encoding == "utf-16-be" or (encoding == "utf-16-le"):
        content = f"name,value\n{'abcdefgh' * 30},1\n"
        raw = content.encode(encoding)
    if not cut:
        assert (content, ()) == decode_text(raw)
        return
    read, remarks = decode_text(raw[:-1])
    assert content.startswith(read)
    assert len(content) - len(read) <= len(text) + 3 or remarks


def test_row_names_of_r_and_empty_columns_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text('"s";"y"\n"1";"a";1,5\n"2";"b";2,5\n', encoding="utf-8")
    table = read_table(path)
    assert ["s", "y"] == list(table.cells.columns)
    assert [1.5, 2.5] == table.numbers("y").tolist()
    path.write_text(",s,y,,\n1,a,1.5,,\n2,b,2.5,,\n", encoding="utf-8")
    table = read_table(path)
    assert [1.5, 2.5] == table.numbers("y").tolist()
    assert any("names of rows" in note for note in table.notes)
    path.write_text("s,y,\na,1.5,x\nb,2,\n", encoding="utf-8")
    with pytest.raises(DataError, match="column 3 has no name but holds 'x'"):
        read_table(path)


def test_a_last_line_that_is_cut_is_left_out_and_another_is_refused(tmp_path: Path) -> None:
    read = read_rows("a,b,c\n1,2,3\n4,5", what="t")
    assert (
        [["1", "2", "3"]],
        ("line 3, the last, is cut off: 2 cells of 3; it was left out",),
    ) == (
        list(read.rows),
        read.remarks,
    )
    with pytest.raises(DataError, match="line 2 has 2 cells, the header has 3"):
        read_rows("a,b,c\n4,5\n1,2,3\n", what="t")


def test_a_quote_that_quotes_nothing_is_a_sign_like_others() -> None:
    read = read_rows('t\tword\n1\ta 5" screen\n2\t"5 in"s\n', what="t")
    assert ['a 5" screen', '"5 in"s'] == [row[1] for row in read.rows]
    with pytest.raises(DataError, match="repair the line"):
        read_rows('a,b\n"1,2\n3,4\n', what="t")


@pytest.mark.parametrize("code", [999, -9, -999, 99])
def test_codes_for_missing_are_told(code: int) -> None:
    values = [*np.linspace(1, 7, 20).round(1).tolist(), code, code]
    assert f"{code} in 2 rows" in remark_on_codes("y", values)
    assert "" == remark_on_codes("y", values[:-2])


def test_numbers_that_reach_that_far_are_no_codes() -> None:
    assert "" == remark_on_codes("rt", [*range(800, 1200), 999])
    assert "" == remark_on_codes("change", [-3.0, -2.0, -1.0, 0.0, 2.0, 5.0])


@pytest.mark.parametrize(
    ("values", "code", "n"),
    [
        (range(18, 66), 99, 1),  # ages
        (range(18, 66), 999, 2),
        (range(1, 8), 9, 2),  # answers
        (range(1, 6), 8, 3),
        (range(1, 6), 99, 1),
        ([300 + 7.3 * k for k in range(80)], 999, 5),  # reaction times up to 877
        ([300.25 + 7 * k for k in range(80)], 9999.99, 1),
        ([-0.5 + 0.05 * k for k in range(30)], -9, 1),
    ],
)
def test_usual_codes_are_told_beside_usual_values(values: Any, code: float, n: int) -> None:
    numbers = [*map(float, values), *map(float, values)]
    assert "" == remark_on_codes("y", numbers)
    assert f"{code:g} in {n} row" in remark_on_codes("y", [*numbers, *[float(code)] * n])


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(st.floats(1, 30), min_size=8, max_size=40, unique=True),
    code=st.sampled_from([-1, -9, -99, 99, 999, 9999, 888, 77]),
)
def test_any_code_far_from_any_values_is_told(values: list[float], code: int) -> None:
    assert f"{code} in 1 row" in remark_on_codes("y", [*values, float(code)])


def test_codes_of_covariates_are_told(tmp_path: Path) -> None:
    rows = [f"{k},{'ab'[k % 2]},{20 + k if k != 5 else 99},{500 + 13 * (k % 7)}" for k in range(20)]
    (tmp_path / "t.csv").write_text("who,group,age,rt\n" + "\n".join(rows) + "\n", encoding="utf-8")
    question = Question("anova", dv="rt", between=("group",), subject="who", covariates=("age",))
    notes = answer(read_table(tmp_path / "t.csv"), question).notes
    assert any("age holds 99 in 1 row" in note for note in notes)


# ---- older encodings, blanks, cuts ---------------------------------------------------------------

WORDS = ["für", "größer", "Mädchen", "crème brûlée", "naïf", "Öl übrig", "España ñandú", "garçon"]


@settings(max_examples=40, deadline=None)
@given(
    words=st.lists(st.sampled_from(WORDS), min_size=1, max_size=5),
    encoding=st.sampled_from(["mac_roman", "cp1252"]),
)
def test_macs_and_windows_are_told_apart_by_letters_within_words(
    words: list[str], encoding: str
) -> None:
    text = "word,n\n" + "".join(f"{word} {k},{k}\n" for k, word in enumerate(["Käse für", *words]))
    read, (remark,) = decode_text(text.encode(encoding))
    assert text == read
    assert ("Mac OS Roman" if encoding == "mac_roman" else "Windows-1252") in remark


def test_letters_of_both_are_read_as_windows_and_the_other_reading_is_told() -> None:
    _, (remark,) = decode_text("schön\n".encode("mac_roman"))
    assert "Windows-1252" in remark
    assert "if hšn should be hön, save it as UTF-8" in remark
    assert ("don’t", "read as Windows-1252, it is not UTF-8") == (
        decode_text("don’t".encode("cp1252"))[0],
        decode_text("don’t".encode("cp1252"))[1][0],
    )


aligned_cells = st.from_regex(r"[a-z]{1,6}|[1-9]{1,4}(\.[0-9]{1,3})?", fullmatch=True)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(st.lists(aligned_cells, min_size=3, max_size=3), min_size=2, max_size=8),
    right=st.booleans(),
    has_row_names=st.booleans(),
)
def test_columns_that_blanks_align_are_read(
    rows: list[list[str]], right: bool, has_row_names: bool
) -> None:
    lines = [["one", "two", "three"], *rows]
    widths = [max(len(line[k]) for line in lines) + 1 for k in range(3)]
    texts = []
    for number, line in enumerate(lines):
        cells = [c.rjust(w) if right else c.ljust(w) for c, w in zip(line, widths, strict=True)]
        texts.append((f"{number or ''}".ljust(3) if has_row_names else "") + "".join(cells))
    read = read_rows("\n".join(texts) + "\n", what="t")
    assert (("one", "two", "three"), rows) == (read.names, [list(row) for row in read.rows])


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(st.integers(10_000, 99_999), min_size=8, max_size=12),
    decimals=st.integers(1, 4),
    cut=st.integers(1, 4),
    delimiter=st.sampled_from([",", ";", "\t"]),
)
def test_a_file_that_ends_within_its_last_number_is_read_without_it(
    values: list[int], decimals: int, cut: int, delimiter: str
) -> None:
    lines = [
        f"n{delimiter}y",
        *(f"{k}{delimiter}{v / 10**decimals:.{decimals}f}" for k, v in enumerate(values)),
    ]
    whole = "\n".join(lines)
    assert ((), len(values)) == ((r := read_rows(whole, what="t")).remarks, len(r.rows))
    read = read_rows(whole[:-cut], what="t")
    assert len(values) - 1 == len(read.rows)
    assert "cut off" in read.remarks[0]
    assert len(values) == len(read_rows(whole[:-cut] + "\n", what="t").rows)


@pytest.mark.parametrize(
    "rows",
    [
        ["a;1.000", "b;1.000", "c;2.000", "d;1.000.000", "e;1"],
        ["1,5;1.000", "2,5;1.000", "2,5;2.000", "3,5;4.000", "4,5;1"],
    ],
)
def test_a_last_number_below_a_thousand_is_read(rows: list[str]) -> None:
    assert len(rows) == len(read_rows("\n".join(["n;y", *rows]), what="t").rows)


@pytest.mark.parametrize("cells", [["Control", "Treated"], ["512", "498"]])
def test_a_last_word_or_whole_number_that_may_be_cut_is_told(cells: list[str]) -> None:
    text = "\n".join(["n,y", *(f"{k},{cells[k % 2]}" for k in range(8))])
    assert () == read_rows(text, what="t").remarks
    read = read_rows(text[:-2], what="t")
    assert (8, True) == (len(read.rows), "was the file cut off there?" in read.remarks[0])
    assert () == read_rows(text[:-2] + "\n", what="t").remarks


def test_thousands_between_tabs_that_no_other_column_explains_are_refused(tmp_path: Path) -> None:
    lines = ["who\trt", *(f"p{k}\t{german(1012 + 37 * k, 0)}" for k in range(8))]
    path = tmp_path / "t.tsv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(NotNumeric, match=r"1\.012 .*may be a decimal point or thousands"):
        read_table(path).numbers("rt")
    lines = [f"{line}\t{'share' if k == 0 else '0.5'}" for k, line in enumerate(lines)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert 1.012 == read_table(path).numbers("rt")[0]


def test_a_condition_on_names_spelt_twice_is_refused_before_it_loses_half(tmp_path: Path) -> None:
    groups = ["Control", "control", "Treated", "Treated"]
    rows = [f"{k},{groups[k % 4]},{'xy'[k % 2]},{500 + 31 * (k % 5)}" for k in range(24)]
    file = tmp_path / "t.csv"
    file.write_text("who,group,half,rt\n" + "\n".join(rows) + "\n", encoding="utf-8")
    said = ["--test", "t", "--between", "half", "--subject", "who", "--where", "group=Control"]
    result = CliRunner().invoke(app, ["stats", str(file), "--dv", "rt", *said])
    assert isinstance(result.exception, OneNameSpeltTwice)
    read = ran(file, tmp_path / "out", *said, "--spelling", "same")
    assert 12 == sum(cell["n"] for cell in read["cells"])


def test_a_wide_table_gives_what_the_long_one_gives(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    wide = pd.DataFrame({"who": range(12), **{c: rng.normal(size=12) for c in ("near", "far")}})
    wide.to_csv(tmp_path / "wide.csv", index=False)
    long = wide.melt("who", var_name="condition", value_name="rt")
    question = Question("paired", dv="rt", within=("condition",), subject="who")
    said = ("--test", "paired", "--within", "condition", "--subject", "who")
    read = ran(tmp_path / "wide.csv", tmp_path / "out", *said, "--wide", "near", "far")
    levels = Question(
        "paired",
        dv="rt",
        within=("condition",),
        subject="who",
        levels={"condition": ["near", "far"]},
    )
    expected = answer(long, levels)
    assert question.dv == "rt"
    assert pytest.approx(dict(expected.rows[0])["p"]) == read["rows"][0]["p"]


def test_columns_of_two_factors_part_into_levels() -> None:
    names = ["rt_near_1", "rt_near_2", "rt_far_1", "rt_far_2"]
    frame = pd.DataFrame({"who": ["a"], **{n: [float(i)] for i, n in enumerate(names)}})
    table = long_table(table_of(frame), names, dv="rt", factors=("distance", "block"))
    assert [("near", "1", "0.0"), ("far", "2", "3.0")] == [
        tuple(table.cells.loc[i, ["distance", "block", "rt"]]) for i in (0, 3)
    ]
    with pytest.raises(UsageError, match="do not part into levels"):
        long_table(table_of(frame), ["rt_near_1", "who"], dv="y", factors=("a", "b"))


def test_words_become_the_numbers_that_are_given_for_them() -> None:
    table = table_of(pd.DataFrame({"y": ["Never", "often ", "", "rarely"]}))
    read = with_numbers_for_words(table, "y", "never=1,rarely=2,often=3")
    assert [1.0, 3.0, 2.0] == read.numbers("y")[[0, 1, 3]].tolist()
    assert np.isnan(read.numbers("y")[2])
    with pytest.raises(DataError, match="'often ' in row 2"):
        with_numbers_for_words(table, "y", "never=1,rarely=2")

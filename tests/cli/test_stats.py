"""The stats command: any table in, the right test out, bad input named by row and cell."""

import json
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from visavis.analysis.statistics import art_anova, cell_means, paired_t, rm_anova
from visavis.analysis.statistics.errors import (
    DuplicateCell,
    InfiniteValue,
    MissingCell,
    MissingValue,
    NotNumeric,
    SubjectInTwoGroups,
    UnknownColumn,
)
from visavis.analysis.statistics_report import TESTS, read_table
from visavis.analysis.statistics_report.table_file import natural_order
from visavis.cli.commands.statistics import SEVERAL, read_levels, repeat_options
from visavis.cli.main import app
from visavis.lab.errors import DataError, UsageError

TWO = ["--dv", "accuracy", "--within", "technique", "direction", "--subject", "participant"]
ONE = ["--dv", "accuracy", "--within", "technique", "--subject", "participant"]
PAIR = ["--dv", "accuracy", "--within", "direction", "--subject", "participant"]


def trials(repetitions: int = 1) -> pd.DataFrame:
    rng = np.random.default_rng(4)
    rows = []
    for person in range(1, 13):
        level = rng.normal(0.8, 0.05)
        for technique, t in (("ray", 0.0), ("touch", 0.05), ("gaze", -0.04)):
            for direction, d in (("left", 0.0), ("right", 0.03)):
                for repetition in range(1, repetitions + 1):
                    value = level + t + d + rng.normal(0, 0.02)
                    rows.append(
                        {
                            "participant": person,
                            "technique": technique,
                            "direction": direction,
                            "repetition": repetition,
                            "group": "old" if person % 2 else "young",
                            "accuracy": round(float(value), 4),
                            "rating": int(np.clip(round(4 + 20 * (value - 0.82)), 1, 7)),
                        }
                    )
    return pd.DataFrame(rows)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "données d'essai.csv"
    trials().to_csv(path, index=False)
    return path


def stats(path: Path, *arguments: str, output: Path | None = None):
    folder = output or path.parent / "out"
    return CliRunner().invoke(app, ["stats", str(path), *arguments, "-o", str(folder)])


def answer(path: Path, *arguments: str) -> dict:
    result = stats(path, *arguments, "--json")
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


# ---- options with several values ----


def test_several_values_may_follow_one_option() -> None:
    both = ["f.csv", "--within", "a", "--within", "b", "--test", "art"]
    assert both == repeat_options(["f.csv", "--within", "a", "b", "--test", "art"], SEVERAL)
    assert both == repeat_options(both, SEVERAL)
    assert ["--dv", "x", "y"] == repeat_options(["--dv", "x", "y"], SEVERAL)
    assert ["--within", "a", "--", "b"] == repeat_options(["--within", "a", "--", "b"], SEVERAL)
    assert ["--within", "a", "-o", "b"] == repeat_options(["--within", "a", "-o", "b"], SEVERAL)


def test_both_ways_of_naming_factors_give_the_same(table: Path) -> None:
    one = answer(table, "--test", "art", *TWO)
    other = answer(
        table,
        "--test",
        "art",
        "--within",
        "technique",
        "--within",
        "direction",
        "--dv",
        "accuracy",
        "--subject",
        "participant",
    )
    assert one["rows"] == other["rows"]


def test_levels_are_read_in_their_order() -> None:
    assert {"t": ["b", "a"]} == read_levels(["t=b, a"])
    for wrong in ("t", "=a,b", "t=a"):
        with pytest.raises(UsageError, match="FACTOR=first"):
            read_levels([wrong])


def test_the_order_of_levels_turns_contrasts_round(table: Path) -> None:
    by_name = answer(table, "--test", "rm", *PAIR)["contrasts"][0]
    turned = answer(table, "--test", "rm", *PAIR, "--levels", "direction=right,left")
    assert by_name["estimate"] == pytest.approx(-turned["contrasts"][0]["estimate"])


# ---- the numbers are the library's ----


def test_art_is_that_of_the_library(table: Path) -> None:
    expected = art_anova(
        trials(), "accuracy", subject="participant", within=["technique", "direction"]
    )
    printout = answer(table, "--test", "art", *TWO)
    assert [e.F for e in expected.effects] == pytest.approx([r["F"] for r in printout["rows"]])
    assert any(r["family"] == "technique" for r in printout["contrasts"])
    assert any("inverse-normal ranks" in line for line in printout["path"])


def test_repeated_rows_are_averaged_and_that_is_said(tmp_path: Path) -> None:
    frame = trials(repetitions=5)
    path = tmp_path / "many.csv"
    frame.to_csv(path, index=False)
    means = cell_means(frame, "accuracy", by=["participant", "technique", "direction"])
    expected = rm_anova(means, "accuracy", subject="participant", within=["technique", "direction"])
    printout = answer(path, "--test", "rm", *TWO)
    assert [e.F for e in expected.effects] == pytest.approx([r["F"] for r in printout["rows"]])
    assert any("360 rows averaged to 72" in note for note in printout["notes"])


# ---- which rows ----


def with_rows_that_do_not_count(tmp_path: Path) -> Path:
    practice = trials().assign(accuracy=0.1, is_analysed=False, left_out_because="practice")
    frame = pd.concat([trials().assign(is_analysed=True, left_out_because=""), practice])
    path = tmp_path / "trials.csv"
    frame.to_csv(path, index=False)
    return path


def test_rows_that_do_not_count_are_left_out_and_that_is_said(table: Path, tmp_path: Path) -> None:
    path = with_rows_that_do_not_count(tmp_path)
    printout = answer(path, "--test", "rm", *TWO)
    assert answer(table, "--test", "rm", *TWO)["rows"] == printout["rows"]
    assert any("72 of 144 rows do not count" in n and "72 practice" in n for n in printout["notes"])
    printed = stats(path, "--test", "rm", *TWO).stdout
    assert 1 == printed.count("72 of 144 rows do not count")
    assert printed.index("do not count") < printed.index("How it was decided")


def test_rows_that_do_not_count_are_tested_when_asked_for(tmp_path: Path) -> None:
    printout = answer(with_rows_that_do_not_count(tmp_path), "--test", "rm", "--all-rows", *TWO)
    assert any("144 rows averaged to 72" in note for note in printout["notes"])


def test_a_table_without_a_row_that_counts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trials.csv"
    trials().assign(is_analysed=False).to_csv(path, index=False)
    with pytest.raises(DataError, match="no row is left to test"):
        answer(path, "--test", "rm", *TWO)


def test_where_takes_levels_and_numbers(table: Path) -> None:
    two = trials().query("technique != 'gaze' and rating > 1")
    expected = answer(
        table,
        "--test",
        "lmm",
        *ONE,
        "--levels",
        "technique=ray,touch",
        "--where",
        "technique=ray,touch",
        "rating>1",
    )
    other = answer(
        table, "--test", "lmm", *ONE, "--where", "technique!=gaze", "--where", "rating>=2"
    )
    assert expected["rows"][0]["F"] == pytest.approx(other["rows"][0]["F"])
    assert f"where rating>1: {len(two)} of 48 rows" in expected["notes"]


def test_a_level_with_a_comma_in_its_name_is_one_level(tmp_path: Path) -> None:
    path = tmp_path / "trials.csv"
    trials().replace({"technique": {"ray": "ray, slow"}}).to_csv(path, index=False)
    printout = answer(path, "--test", "paired", *PAIR, "--where", "technique=ray, slow")
    assert "where technique=ray, slow: 24 of 72 rows" in printout["notes"]


@pytest.mark.parametrize(
    ("condition", "error", "message"),
    [
        ("technique", UsageError, "takes COLUMN=LEVEL"),
        ("technique=", UsageError, "takes COLUMN=LEVEL"),
        ("technique=rai", UsageError, "no technique 'rai'; there are gaze, ray, touch"),
        ("technic=ray", UnknownColumn, "did you mean 'technique'"),
        ("technique>2", NotNumeric, "must be a number"),
        ("rating>much", UsageError, "'much' is no number"),
        ("rating>99", DataError, "no row is left"),
    ],
)
def test_a_condition_that_makes_no_sense_is_refused(
    condition: str, error: type[Exception], message: str, table: Path
) -> None:
    with pytest.raises(error, match=message):
        answer(table, "--test", "rm", *TWO, "--where", condition)


def test_a_factor_left_out_is_averaged_over(table: Path) -> None:
    printout = answer(table, "--test", "paired", *PAIR)
    wide = trials().pivot_table(index="participant", columns="direction", values="accuracy")
    expected = paired_t(wide["left"], wide["right"])
    assert expected.t == pytest.approx(printout["rows"][0]["t"])
    assert any("Shapiro-Wilk" in line for line in printout["path"])


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("art", [*TWO, "--transform", "int"]),
        ("art", [*TWO, "--between", "group", "--posthoc", "holm"]),
        ("art", [*TWO, "--error", "pooled"]),
        ("rm", [*TWO, "--between", "group", "--posthoc", "tukey", "--always-posthoc"]),
        ("mixed", TWO),
        ("lmm", TWO),
        ("lmm", [*TWO, "--random", "components"]),
        ("lmm", [*TWO, "--between", "group", "--always-posthoc"]),
        ("gee", [*TWO, "--always-posthoc"]),
        ("clmm", ["--dv", "rating", *TWO[2:], "--always-posthoc"]),
        ("gee", [*ONE, "--between", "group", "--family", "gaussian", "--posthoc", "tukey"]),
        ("anova", ["--dv", "accuracy", "--between", "group", "--subject", "participant"]),
        ("welch", ["--dv", "accuracy", "--between", "group", "--subject", "participant"]),
        ("welch", ["--dv", "accuracy", "--between", "group", "--always-posthoc"]),
        ("rm", [*TWO, "--correction", "hf"]),
        ("friedman", ONE),
        ("conditions", ONE),
        ("kruskal", ["--dv", "accuracy", "--between", "group", "--subject", "participant"]),
        ("kruskal", ["--dv", "accuracy", "--between", "direction", "--always-posthoc"]),
        ("paired", ONE),
        ("t", PAIR),
        ("t", ["--dv", "accuracy", "--between", "group", "--subject", "participant"]),
        ("t", ["--dv", "accuracy", "--subject", "participant", "--mu", "0.5"]),
        ("wilcoxon", ONE),
        ("mannwhitney", ["--dv", "accuracy", "--between", "group", "--subject", "participant"]),
        ("shapiro", PAIR),
        ("shapiro", ["--dv", "accuracy", "--subject", "participant"]),
        ("spearman", ["--dv", "accuracy", "--with", "participant"]),
        ("pearson", ["--dv", "accuracy", "--with", "participant"]),
        ("sign", PAIR),
        ("sign", ["--dv", "accuracy", "--subject", "participant", "--mu", "0.5"]),
        ("tost", [*PAIR, "--low", "-0.1", "--high", "0.1"]),
        ("tost", ["--dv", "accuracy", "--subject", "participant", "--low", "0", "--high", "1"]),
    ],
)
def test_every_test_prints_a_sentence_and_writes_its_table(
    table: Path, name: str, arguments: list[str]
) -> None:
    result = stats(table, "--test", name, *arguments)
    assert result.exception is None, result.output
    out = table.parent / "out"
    assert len(pd.read_csv(out / "tests.csv")) >= 1
    words = (out / "report.txt").read_text(encoding="utf-8")
    assert " = " in words
    assert "undefined" not in words


def test_all_tests_are_tried_above_or_below() -> None:
    mark = test_every_test_prints_a_sentence_and_writes_its_table.pytestmark[0]
    others = {"cronbach", "bradleyterry", "binomial", "icc", "kappa", "krippendorff"}
    assert {p[0] for p in mark.args[1]} | others == set(TESTS)


def rated(tmp_path: Path) -> Path:
    rng = np.random.default_rng(5)
    truth = rng.normal(4, 1.5, 20)
    path = tmp_path / "rated.csv"
    pd.DataFrame(
        {
            "clip": f"c{i}",
            "rater": rater,
            "rating": int(np.clip(round(t + rng.normal()), 1, 7)),
            "word": "good" if t + rng.normal() > 4 else "bad",
            "hit": int(t + rng.normal() > 4),
        }
        for i, t in enumerate(truth)
        for rater in ("ann", "bob")
    ).to_csv(path, index=False)
    return path


def test_raters_of_the_same_things_are_compared(tmp_path: Path) -> None:
    path, roles = rated(tmp_path), ("--within", "rater", "--subject", "clip")
    printout = answer(path, "--test", "icc", "--dv", "rating", *roles)
    kinds = [row["kind"] for row in printout["rows"]]
    assert ["ICC1", "ICC2", "ICC3", "ICC1k", "ICC2k", "ICC3k"] == kinds
    alpha = answer(path, "--test", "krippendorff", "--dv", "word", *roles, "--scale", "nominal")
    kappa = answer(path, "--test", "kappa", "--dv", "word", *roles)
    for one in (alpha, kappa):
        assert 0.2 < one["rows"][0]["agreement"] < 1
    weighted = answer(path, "--test", "kappa", "--dv", "rating", *roles, "--scale", "ordinal")
    assert weighted["rows"][0]["agreement"] > 0.2
    with pytest.raises(UsageError, match="needs scale"):
        answer(path, "--test", "krippendorff", "--dv", "rating", *roles)


def test_counts_are_tested_where_rows_are_independent(tmp_path: Path) -> None:
    path = rated(tmp_path)
    printout = answer(path, "--test", "binomial", "--dv", "hit", "--where", "rater=ann")
    assert 20 == printout["rows"][0]["of"]
    with pytest.raises(DuplicateCell, match="not independent"):
        answer(path, "--test", "binomial", "--dv", "hit", "--subject", "clip")
    twice = pd.concat([pd.read_csv(path)] * 2)
    twice.to_csv(path, index=False)
    with pytest.raises(DuplicateCell, match="rater ann rated clip c0 twice"):
        answer(path, "--test", "icc", "--dv", "rating", "--within", "rater", "--subject", "clip")


def test_choices_between_two_are_read_from_two_columns_or_one(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    likes = {"orbit": 0.0, "follow": 0.5, "still": 1.0}
    frame = pd.DataFrame(
        [(f"P{who}", a, b) for who in range(12) for a, b in permutations(likes, 2)],
        columns=["participant", "left", "right"],
    )
    lead = frame["left"].map(likes) - frame["right"].map(likes) + rng.logistic(size=len(frame))
    frame["vote"] = np.where(lead.abs() < 0.4, 0, np.sign(lead))
    frame["pair"] = frame["left"] + "|" + frame["right"]
    path = tmp_path / "votes.csv"
    frame.to_csv(path, index=False)
    options = ("--test", "bradleyterry", "--dv", "vote", "--subject", "participant", "--side")
    printout = answer(path, *options, "--within", "left", "right")
    again = answer(path, *options, "--within", "pair")
    assert ["left:right"] == [row["term"] for row in printout["rows"]]
    assert printout["rows"][0]["p"] == pytest.approx(again["rows"][0]["p"])
    assert printout["cells"] == again["cells"]
    assert ["items"] * 3 + ["place"] == [row["family"] for row in printout["contrasts"]]


def test_alpha_of_a_scale_reads_items_one_after_another(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    trait = rng.normal(0, 1, 30)
    frame = pd.DataFrame({f"q{i}": np.round(trait + rng.normal(0, 0.5, 30), 2) for i in range(3)})
    frame["q2"] *= -1
    path = tmp_path / "scale.csv"
    frame.to_csv(path, index=False)
    printout = answer(path, "--test", "cronbach", "--items", "q0", "q1", "q2", "--reverse", "q2")
    assert printout["rows"][0]["alpha"] > 0.7
    assert 3 == len(printout["contrasts"])


# ---- how files are written ----


def test_decimal_commas_and_semicolons_read_as_the_same_numbers(
    table: Path, tmp_path: Path
) -> None:
    comma = tmp_path / "excel.csv"
    text = trials().to_csv(index=False, sep=";", decimal=",")
    comma.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    parquet = tmp_path / "t.parquet"
    trials().to_parquet(parquet)
    expected = answer(table, "--test", "rm", *TWO)["rows"]
    assert expected == answer(comma, "--test", "rm", *TWO)["rows"]
    assert expected == answer(parquet, "--test", "rm", *TWO)["rows"]


def test_a_mixture_of_decimal_signs_names_both_rows(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("s;c;y\n1;a;0,5\n1;b;0.7\n", encoding="utf-8")
    with pytest.raises(NotNumeric, match=r"row 1 \(line 2\): 0,5.*row 2 \(line 3\): 0\.7"):
        read_table(path).numbers("y")


def test_commas_that_may_be_thousands_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text('s,y\n1,"1,234"\n2,"2,500"\n', encoding="utf-8")
    with pytest.raises(NotNumeric, match="thousands"):
        read_table(path).numbers("y")


def test_decimal_commas_between_commas_say_how_to_save(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("s,y\n1,0,5\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"line 2 has 3 cells.*semicolons"):
        read_table(path)


def test_empty_and_doubled_headers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("s,y,y\n1,2,3\n", encoding="utf-8")
    with pytest.raises(DataError, match="'y' twice"):
        read_table(path)
    path.write_text("s,y\n", encoding="utf-8")
    with pytest.raises(DataError, match="no rows"):
        read_table(path)
    with pytest.raises(UsageError, match=r"did you mean .*t\.csv"):
        read_table(tmp_path / "tt.csv")


def test_levels_that_are_numbers_stand_in_their_order() -> None:
    assert ["2", "10", "30"] == natural_order(["10", "30", "2", "10"])
    assert ["a", "b10", "b2"] == natural_order(["b2", "a", "b10"])


# ---- bad input ----


def broken(path: Path, row: int, column: str, value: object) -> Path:
    frame = trials().astype(object)
    frame.loc[row, column] = value
    frame.to_csv(path, index=False)
    return path


def test_an_unknown_column_is_answered_with_the_nearest(table: Path) -> None:
    with pytest.raises(UnknownColumn, match="did you mean 'accuracy'"):
        answer(table, "--test", "art", *["acuracy" if a == "accuracy" else a for a in TWO])


def test_text_in_the_response_names_row_line_and_cell(tmp_path: Path) -> None:
    path = broken(tmp_path / "t.csv", 7, "accuracy", "lost")
    with pytest.raises(NotNumeric, match=r"'lost' in row 8 \(line 9\) \(subject 2, technique ray"):
        answer(path, "--test", "art", *TWO)


def test_an_infinite_response_names_its_row(tmp_path: Path) -> None:
    path = broken(tmp_path / "t.csv", 7, "accuracy", "inf")
    with pytest.raises(InfiniteValue, match="row 8"):
        answer(path, "--test", "rm", *TWO)


def test_a_missing_cell_names_subject_and_cell(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    trials().drop(index=8).to_csv(path, index=False)
    with pytest.raises(MissingCell, match="subject 2, technique touch, direction left"):
        answer(path, "--test", "art", *TWO)
    dropped = answer(path, "--test", "art", *TWO, "--missing", "listwise")
    assert 11 == dropped["rows"][0]["n"]
    assert any("left out: subject 2" in note for note in dropped["notes"])
    kept = answer(path, "--test", "art", *TWO, "--missing", "mixed")
    assert 12 == kept["rows"][0]["n"]


def test_a_missing_value_among_repetitions_is_not_left_out_silently(tmp_path: Path) -> None:
    frame = trials(repetitions=3)
    frame.loc[4, "accuracy"] = np.nan
    path = tmp_path / "t.csv"
    frame.to_csv(path, index=False)
    with pytest.raises(MissingValue, match=r"row 5 \(line 6\) \(subject 1, technique ray"):
        answer(path, "--test", "rm", *TWO)
    printout = answer(path, "--test", "rm", *TWO, "--missing", "listwise")
    assert 12 == printout["rows"][0]["n"]
    assert any("1 rows without accuracy" in note for note in printout["notes"])


def test_a_missing_label_names_its_row(tmp_path: Path) -> None:
    path = broken(tmp_path / "t.csv", 3, "technique", "")
    with pytest.raises(MissingValue, match="technique is missing in row 4"):
        answer(path, "--test", "rm", *TWO)


def test_a_subject_in_two_groups_names_both_rows(tmp_path: Path) -> None:
    path = broken(tmp_path / "t.csv", 2, "group", "young")
    with pytest.raises(SubjectInTwoGroups, match="subject 1 is group old in row 1"):
        answer(path, "--test", "rm", *TWO, "--between", "group")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--test", "artt", *TWO], "did you mean art"),
        (["--test", "friedman", *TWO], "one factor"),
        (["--test", "friedman", *ONE, "--posthoc", "tukey"], "holm, bonferroni"),
        (
            ["--test", "friedman", *ONE, "--missing", "mixed"],
            "missing='listwise' (--missing listwise)",
        ),
        (["--test", "rm", "--dv", "accuracy", "--within", "technique"], "needs subject"),
        (["--test", "tost", *PAIR], "needs low and high"),
        (["--test", "spearman", "--dv", "accuracy"], "needs with"),
        (["--test", "art", *TWO, "--transform", "log"], "transform takes art, int"),
        (["--test", "lmm", *TWO, "--random", "all"], "random takes maximal, components"),
        (["--test", "art", *TWO, "--correction", "box"], "correction takes mauchly, gg"),
        (["--test", "art", *TWO, "--missing", "ignore"], "missing takes error"),
        (["--test", "art", *TWO, "--between", "technique"], "two roles"),
        (["--test", "art", *TWO, "--levels", "hand=a,b"], "no factor"),
    ],
)
def test_a_question_that_makes_no_sense_is_refused_with_the_way_out(
    table: Path, arguments: list[str], message: str
) -> None:
    result = stats(table, *arguments)
    assert isinstance(result.exception, UsageError)
    assert message in str(result.exception)


# ---- simulated data, figures ----


def marked(path: Path, values: list[object]) -> Path:
    frame = trials()
    frame["is_simulated"] = [values[i % len(values)] for i in range(len(frame))]
    frame.to_csv(path, index=False)
    return path


def test_figures_of_simulated_data_are_marked(table: Path, tmp_path: Path) -> None:
    real = answer(table, "--test", "rm", *TWO)
    assert real["is_simulated"] is False
    for file in (f for f in real["files"] if f.endswith(".svg")):
        assert "simulated-watermark" not in Path(file).read_text()
    made_up = answer(marked(tmp_path / "sim.csv", [True]), "--test", "rm", *TWO)
    figures = [f for f in made_up["files"] if f.endswith(".svg")]
    assert 4 == len(figures)  # two factors, their cells, the assumptions
    for file in figures:
        assert "simulated-watermark" in Path(file).read_text()
    assert pd.read_csv(tmp_path / "out" / "tests.csv")["is_simulated"].all()


def test_a_mixture_of_simulated_and_real_rows_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="mixes simulated and real"):
        answer(marked(tmp_path / "mix.csv", [True, False]), "--test", "rm", *TWO)


def test_the_printed_answer_holds_table_sentence_path_and_contrasts(table: Path) -> None:
    result = stats(table, "--test", "art", *TWO)
    for part in ("Contrasts of technique", "How it was decided", "η²p", "F(1.", "ε(GG)"):
        assert part in result.output


def test_effect_sizes_are_named_and_a_term_without_one_says_so(table: Path) -> None:
    for test, dv, name in (
        ("clmm", "rating", "odds ratio"),
        ("lmm", "accuracy", "d_total"),
        ("art", "accuracy", "r_rb"),
    ):
        printed = stats(table, "--test", test, "--dv", dv, *TWO[2:]).output
        assert f"Contrasts of technique (effect size: {name})" in printed
        assert (test == "clmm") == ("no effect size for 2 df together" in printed)


def test_labels_of_the_user_are_printed_as_they_are(tmp_path: Path) -> None:
    frame = trials().replace({"ray": ":B:", "touch": "[b]x[/b]"})
    path = tmp_path / "t.csv"
    frame.to_csv(path, index=False)
    folder = tmp_path / "[red]out"
    result = stats(path, "--test", "conditions", *ONE, output=folder)
    assert result.exception is None
    lines = result.output.splitlines()
    assert 1 <= sum(line.startswith(" :B:") for line in lines)
    assert 1 <= sum(line.startswith(" [b]x[/b]") for line in lines)
    assert "[red]out" in result.output


def test_a_folder_used_again_keeps_nothing_of_the_test_before(table: Path) -> None:
    folder = table.parent / "out"
    answer(table, "--test", "rm", *TWO)
    own = folder / "my notes.txt"
    own.write_text("mine")
    answer(table, "--test", "wilcoxon", *PAIR)
    left = {p.name for p in folder.iterdir()}
    assert own.name in left
    assert "contrasts.csv" not in left
    assert {"estimation_direction.svg"} == {n for n in left if n.endswith(".svg")}

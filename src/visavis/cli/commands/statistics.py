"""stats: one test of a table in a file, with tables, sentences, decision path and figures."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
import typer
from rich.table import Table
from typer.core import TyperCommand

from visavis.analysis.statistics.design import Missing
from visavis.analysis.statistics.results import Row, degrees, number
from visavis.analysis.statistics_report import (
    TESTS,
    Outcome,
    Question,
    answer,
    counted_rows,
    long_table,
    read_table,
    rows_where,
    with_error_rates,
    with_numbers_for_words,
    with_one_spelling,
)
from visavis.analysis.statistics_report.chosen_rows import condition_parts
from visavis.analysis.statistics_report.outcome_files import outcome_data, write_outcome
from visavis.cli.app import JsonOption, app, console, say, say_json, say_plainly, verbatim
from visavis.lab.errors import LabError, UsageError

SEVERAL = ("--within", "--between", "--items", "--reverse", "--levels", "--where", "--wide")
SPELLINGS = ("", "same", "apart")
EFFECT_COLUMNS = (
    "term",
    "F",
    "df1",
    "df2",
    "p",
    "p_used",
    "contrast",
    "effect_size",
    "effect_ci_low",
    "effect_ci_high",
    "ges",
    "gg_epsilon",
)
CONTRAST_COLUMNS = (
    "contrast",
    "level_1",
    "level_2",
    "item",
    "estimate",
    "se",
    "df",
    "t",
    "V",
    "z",
    "p",
    "p_adjusted",
    "effect_size",
    "effect_ci_low",
    "effect_ci_high",
    "alpha_without",
)
HEADINGS = {
    "p_used": "p",
    "effect_size": "effect size",
    "effect_ci_low": "low",
    "effect_ci_high": "high",
    "gg_epsilon": "ε (GG)",
    "p_adjusted": "p adj.",
}
ERROR_RATE_COLUMNS = ("term", "rate", "low", "high", "expected", "holds", "studies")
ERROR_RATE_SEED = 1
OF_PROVENANCE = ("test", "error_term", "correction", "dropped", "notes")


class SeveralValues(TyperCommand):
    """A command whose list options take values one after another: `--within a b`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read arguments after repeating the option before each of its further values."""
        return super().parse_args(ctx, repeat_options(args, SEVERAL))


def repeat_options(arguments: Sequence[str], several: Sequence[str]) -> list[str]:
    """Return `--within a b` as `--within a --within b`; values end at the next option."""
    out: list[str] = []
    option = ""
    value_count = 0
    for i, argument in enumerate(arguments):
        if argument == "--":
            return [*out, *arguments[i:]]
        if argument.startswith("--"):
            option, value_count = (argument if argument in several else ""), 0
        elif option and not argument.startswith("-"):
            if value_count:
                out.append(option)
            value_count += 1
        else:
            option = ""
        out.append(argument)
    return out


@app.command(cls=SeveralValues)
def stats(
    file: Annotated[Path, typer.Argument(help="CSV (comma, semicolon, tab) or Parquet; first.")],
    test: Annotated[str, typer.Option("--test", help=f"One of {', '.join(TESTS)}.")],
    dv: Annotated[str, typer.Option("--dv", help="Column of the response.")] = "",
    within: Annotated[
        list[str] | None,
        typer.Option("--within", help="Factors that vary within a subject: --within a b"),
    ] = None,
    between: Annotated[
        list[str] | None, typer.Option("--between", help="Factors that tell groups apart.")
    ] = None,
    subject: Annotated[str, typer.Option("--subject", help="Column that names the person.")] = "",
    transform: Annotated[
        str, typer.Option("--transform", help="art, or int: normal scores of plain ranks.")
    ] = "art",
    error: Annotated[
        str, typer.Option("--error", help="Error of ART: strata, pooled or mixed.")
    ] = "strata",
    missing: Annotated[
        str, typer.Option("--missing", help="error, listwise, or mixed: a mixed model.")
    ] = "error",
    posthoc: Annotated[
        str, typer.Option("--posthoc", help="tukey, mvt, holm, bonferroni, bh or none.")
    ] = "",
    always: Annotated[
        bool, typer.Option("--always-posthoc", help="Contrasts of effects not significant too.")
    ] = False,
    simple: Annotated[
        str,
        typer.Option(
            "--simple", help="After an interaction: this factor at each level of the other."
        ),
    ] = "",
    alpha: Annotated[float, typer.Option("--alpha", help="Level of significance.")] = 0.05,
    partner: Annotated[str, typer.Option("--with", help="Second column of a correlation.")] = "",
    items: Annotated[
        list[str] | None, typer.Option("--items", help="Items of a scale, for cronbach.")
    ] = None,
    reverse: Annotated[
        list[str] | None, typer.Option("--reverse", help="Items keyed the other way.")
    ] = None,
    low: Annotated[float | None, typer.Option("--low", help="Lower bound, for tost and t.")] = None,
    high: Annotated[
        float | None, typer.Option("--high", help="Upper bound, for tost and t.")
    ] = None,
    unit: Annotated[str, typer.Option("--unit", help="Unit of the bounds: raw or sd.")] = "raw",
    mu: Annotated[
        float,
        typer.Option("--mu", help="What to test against: t, sign, binomial, icc, α and κ."),
    ] = 0.0,
    levels: Annotated[
        list[str] | None,
        typer.Option("--levels", help="Order of levels: --levels technique=ray,touch,gaze"),
    ] = None,
    family: Annotated[
        str, typer.Option("--family", help="For gee: gaussian, binomial or poisson.")
    ] = "gaussian",
    random: Annotated[
        str,
        typer.Option(
            "--random",
            help="How people differ. For lmm: maximal, or components (one variance per effect); "
            "for clmm: intercept, maximal, effects (method+gesture); for bradleyterry: alike, "
            "maximal.",
        ),
    ] = "",
    nodes: Annotated[
        int,
        typer.Option(
            "--nodes",
            min=0,
            help="With several random effects: quadrature nodes, not Laplace (three at most).",
        ),
    ] = 0,
    correction: Annotated[
        str,
        typer.Option(
            "--correction",
            help="For sphericity, of rm (mauchly) and art (gg): mauchly, gg, hf or none.",
        ),
    ] = "",
    equal_variances: Annotated[
        bool,
        typer.Option("--equal-variances", help="For t between groups: Student's, not Welch's."),
    ] = False,
    bayes: Annotated[
        bool, typer.Option("--bayes", help="For t; rm, anova of one factor: the Bayes factor.")
    ] = False,
    covariates: Annotated[
        list[str] | None,
        typer.Option("--covariates", help="For rm, anova: numbers of people held constant."),
    ] = None,
    side: Annotated[
        bool, typer.Option("--side", help="For bradleyterry: the odds of what stands first, too.")
    ] = False,
    scale: Annotated[
        str,
        typer.Option("--scale", help="For krippendorff, kappa: nominal, ordinal, interval, ratio."),
    ] = "",
    kind: Annotated[
        str, typer.Option("--kind", help="For icc: only this one (ICC2 …); all when left out.")
    ] = "",
    error_rate: Annotated[
        int,
        typer.Option(
            "--error-rate",
            metavar="STUDIES",
            min=0,
            help="Simulate so many studies like this one per effect, without it: how often is it "
            "found? 500 take about ten seconds.",
        ),
    ] = 0,
    where: Annotated[
        list[str] | None,
        typer.Option(
            "--where", help="Rows to test: --where condition=DA,AD --where 'duration_s>2'"
        ),
    ] = None,
    all_rows: Annotated[
        bool,
        typer.Option("--all-rows", help="Rows that do not count, too (is_analysed says no)."),
    ] = False,
    wide: Annotated[
        list[str] | None,
        typer.Option(
            "--wide",
            help="Columns that hold the response, one per level of --within: --wide near far; of "
            "two factors near_1 near_2 far_1 far_2.",
        ),
    ] = None,
    words: Annotated[
        str,
        typer.Option("--words", help="Numbers for words of --dv: --words 'never=1,rarely=2,…'"),
    ] = "",
    spelling: Annotated[
        str,
        typer.Option(
            "--spelling",
            help="Names that differ by case, blanks, leading zeros or .0: same, or apart.",
        ),
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder; FILE_TEST when left out.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Test a table: print table, sentences, decision path and contrasts; write them with figures.

    Rows that do not count (is_analysed says no) are left out, rows repeated within subject and cell
    are averaged, and both are said.

    Example: visavis stats trials.csv --dv accuracy --within technique direction
    --subject participant --test art
    """
    # Every option is a field of the question; what fits together is checked by `answer`.
    question = Question(
        test=test,
        dv=dv,
        within=tuple(within or ()),
        between=tuple(between or ()),
        subject=subject,
        missing=cast(Missing, missing),
        transform=transform,
        error=error,
        posthoc=posthoc,
        always_posthoc=always,
        simple=simple,
        alpha=alpha,
        partner=partner,
        items=tuple(items or ()),
        reverse=tuple(reverse or ()),
        low=low,
        high=high,
        unit=unit,
        mu=mu,
        levels=read_levels(levels or []),
        family=family,
        random=random,
        nodes=nodes,
        correction=correction,
        equal_variances=equal_variances,
        bayes=bayes,
        covariates=tuple(covariates or ()),
        side=side,
        scale=scale,
        kind=kind,
    )
    # Rows are chosen before the test, so that its notes can say how many were left out.
    if spelling not in SPELLINGS:
        raise UsageError(f"--spelling takes same or apart, not {spelling!r}")
    table = replace(read_table(file), spellings_differ=spelling == "apart")
    conditions = [parts[0] for text in where or [] if (parts := condition_parts(text))]
    names = (subject, *question.between, *question.within, *conditions)
    if spelling == "same":  # before rows are chosen: a condition names one spelling
        table = with_one_spelling(table, [name for name in names if name in table.cells])
    table = rows_where(table if all_rows else counted_rows(table), where or [])
    if wide:
        table = long_table(table, wide, dv=question.dv, factors=question.within)
    if words:
        table = with_numbers_for_words(table, question.dv, words)
    try:
        outcome = answer(table, question)
    except LabError:
        _print_lines("", table.notes)  # such as a cut file, which explains what is missing
        raise
    if error_rate:
        rng = np.random.default_rng(ERROR_RATE_SEED)
        outcome = with_error_rates(outcome, table, rng, n_studies=error_rate)
    folder = Path(f"{file.stem}_{test}") if output is None else output
    files, problems = write_outcome(outcome, folder)
    if as_json:
        say_json(outcome_data(outcome, files))
        return
    print_outcome(outcome, table.notes)
    for problem in problems:
        say(f"[yellow]{verbatim(problem)}[/]")
    say(f"tables, text and figures in [b]{verbatim(folder)}[/]")


def read_levels(texts: Sequence[str]) -> dict[str, list[str]]:
    """Read the order of levels given as FACTOR=first,second,… texts.

    Raises:
        UsageError: a text has another form.
    """
    read: dict[str, list[str]] = {}
    for text in texts:
        name, sign, level_text = text.partition("=")
        levels = [v.strip() for v in level_text.split(",") if v.strip()]
        if not sign or not name.strip() or len(levels) < 2:
            raise UsageError(f"--levels takes FACTOR=first,second,…, not {text!r}")
        read[name.strip()] = levels
    return read


def print_outcome(outcome: Outcome, row_notes: Sequence[str] = ()) -> None:
    """Print an outcome on the terminal; the lines of `row_notes` say which rows were tested."""
    mark = "[magenta]SIMULATED[/]  " if outcome.is_simulated else ""
    of = outcome.question.dv or "the items"
    console.print(f"{mark}[b]{verbatim(outcome.title)}[/] of {verbatim(of)}")
    _print_lines("", row_notes)
    if outcome.cells:
        _print_rows("", outcome.cells, tuple(outcome.cells[0]))
    if "term" in outcome.rows[0]:
        other = "p" if "p_used" in outcome.rows[0] else "p_used"
        _print_rows("", outcome.rows, [c for c in EFFECT_COLUMNS if c != other])
    elif len(outcome.rows) > 1:
        names = [n for n in outcome.rows[0] if n not in OF_PROVENANCE]
        _print_rows("", outcome.rows, tuple(names[:10]))
    _print_lines("", outcome.sentences)
    steps = [f"{i}. {line}" for i, line in enumerate(outcome.path, 1)]
    _print_lines("How it was decided", steps)
    for family in dict.fromkeys(str(row["family"]) for row in outcome.contrasts):
        rows = [row for row in outcome.contrasts if row["family"] == family]
        title = f"\n[b]Contrasts of {verbatim(family)}[/]{_sizes(rows)}"
        _print_rows(title, rows, CONTRAST_COLUMNS)
    if outcome.error_rates:
        title = "\n[b]Found where it is not, in simulated studies like this one[/]"
        _print_rows(title, outcome.error_rates, ERROR_RATE_COLUMNS)
    _print_lines("Notes", [f"- {note}" for note in outcome.notes if note not in row_notes])


def _print_lines(heading: str, lines: Sequence[str]) -> None:
    if lines and heading:
        console.print(f"\n[b]{heading}[/]")
    for line in lines:
        say_plainly(line)


def _print_rows(title: str, rows: Sequence[Row], columns: Sequence[str]) -> None:
    filled_columns = [c for c in columns if any(row.get(c) is not None for row in rows)]
    table = Table(title=title or None, title_justify="left", box=None, pad_edge=not title)
    for column in filled_columns:
        is_text = any(isinstance(row.get(column), str) for row in rows)
        table.add_column(
            HEADINGS.get(column, verbatim(column)),
            justify="left" if is_text else "right",
            no_wrap=column == "contrast",
        )
    for row in rows:
        table.add_row(*(_cell(column, row.get(column)) for column in filled_columns))
    console.print(table)


def _sizes(rows: Sequence[Row]) -> str:
    """Return the names of the rows' effect sizes in brackets; empty where there are none."""
    names = dict.fromkeys(str(row["effect"]) for row in rows if row.get("effect") is not None)
    return f" (effect size: {verbatim(', '.join(names))})" if names else ""


def _cell(column: str, value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if column.startswith("p") and isinstance(value, float):
        return "< .001" if value < 0.001 else f"{value:.3f}".removeprefix("0")
    if column.startswith("df") and isinstance(value, float):
        return degrees(value)
    if isinstance(value, float):
        return number(value, 3) if abs(value) < 10 else number(value, 2)
    return verbatim(value)

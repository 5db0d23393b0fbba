"""From tidy data to a test with its table, sentences, decision path and figures.

    from visavis.analysis.statistics_report import Question, answer

    outcome = answer(frame, Question("rm", dv="dwell_ms", within=("gaze",), subject="participant"))
    print(outcome.sentences, outcome.p("gaze"))

Nothing here reads the command line or prints; `read_table` alone touches a file. `written`, which
writes an outcome with its figures, is imported by itself: figures load matplotlib.
"""

import difflib
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from visavis.analysis.statistics_report.agreement import AGREEMENT_TESTS
from visavis.analysis.statistics_report.choices import CHOICE_TESTS
from visavis.analysis.statistics_report.chosen_rows import counted_rows, rows_where
from visavis.analysis.statistics_report.error_rate import error_rate_notes, error_rates
from visavis.analysis.statistics_report.factorial import FACTORIAL_TESTS, TestRun
from visavis.analysis.statistics_report.level_words import level_words_of
from visavis.analysis.statistics_report.outcome import Outcome, Question, Samples
from visavis.analysis.statistics_report.simple import SIMPLE_TESTS
from visavis.analysis.statistics_report.spelling import refuse_spellings, with_one_spelling
from visavis.analysis.statistics_report.table_file import DataTable, read_table, table_of
from visavis.analysis.statistics_report.wide import long_table, with_numbers_for_words
from visavis.lab.errors import LabError, UsageError

TESTS: Mapping[str, TestRun] = {
    **FACTORIAL_TESTS,
    **CHOICE_TESTS,
    **SIMPLE_TESTS,
    **AGREEMENT_TESTS,
}
"""Every test by the name a question gives it."""


def answer(
    data: pd.DataFrame | DataTable, question: Question, *, name: str = "the data"
) -> Outcome:
    """Return what a test says of tidy data, one row per subject and cell, or per trial.

    Rows repeated within subject and cell are averaged first, except for models of single rows
    (lmm, gee, clmm, bradleyterry). Categorical columns keep the order of their levels; a column
    `is_simulated` marks the outcome. `name` is what messages call the data. Raises UsageError for a
    question that makes no sense, and a `StatisticsError` naming row, subject and cell for data a
    test cannot accept, such as people or groups whose names differ by spelling alone.
    """
    if question.test not in TESTS:
        near = difflib.get_close_matches(question.test, TESTS, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise UsageError(f"there is no test {question.test!r}{hint} Known: {', '.join(TESTS)}")
    table = data if isinstance(data, DataTable) else table_of(data, name=name)
    for column in (question.subject, *question.between, *question.within):
        if column in table.cells and column not in table.levels:
            refuse_spellings(table, column)
    words = level_words_of(question)
    if words is None:
        return TESTS[question.test](table, question)
    try:
        return words.with_words(TESTS[question.test](*words.with_marks(table, question)), question)
    except LabError as error:
        words.put_words_in(error)
        raise


def with_error_rates(
    outcome: Outcome,
    data: pd.DataFrame | DataTable,
    rng: np.random.Generator,
    *,
    n_studies: int = 500,
) -> Outcome:
    """Return an outcome with its test's error rates in data like these, and notes if they are off.

    One effect after the other is taken away from simulated studies with the cell sizes, ties,
    bounds and skew of the data; see `error_rate.error_rates`.
    """
    table = data if isinstance(data, DataTable) else table_of(data)
    question = outcome.question
    rows = error_rates(table, question, TESTS[question.test], rng, n_studies)
    notes = (*outcome.notes, *error_rate_notes(rows))
    return replace(outcome, error_rates=rows, notes=notes)


__all__ = [
    "TESTS",
    "DataTable",
    "Outcome",
    "Question",
    "Samples",
    "answer",
    "counted_rows",
    "long_table",
    "read_table",
    "rows_where",
    "table_of",
    "with_error_rates",
    "with_numbers_for_words",
    "with_one_spelling",
]

"""From a table in a file to a test with its table, sentences, decision path and figures."""

from analysis.statistics_report.factorial import FACTORIAL_TESTS
from analysis.statistics_report.outcome import Outcome, Question, Samples
from analysis.statistics_report.simple import SIMPLE_TESTS
from analysis.statistics_report.table_file import DataTable, read_table
from analysis.statistics_report.written import outcome_data, write_outcome

TESTS = {**FACTORIAL_TESTS, **SIMPLE_TESTS}
"""Every test by the name it has on the command line."""

__all__ = [
    "TESTS",
    "DataTable",
    "Outcome",
    "Question",
    "Samples",
    "outcome_data",
    "read_table",
    "write_outcome",
]

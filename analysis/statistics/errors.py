"""Name what is wrong with data handed to a test; every message points to the row or cell."""

from visavis.lab.errors import DataError


class StatisticsError(DataError):
    """Data or arguments a test cannot accept; base of the named errors below."""


class UnknownColumn(StatisticsError):
    """A column that was named is not in the frame."""


class NotNumeric(StatisticsError):
    """The response holds text or another thing that is not a number."""


class MissingValue(StatisticsError):
    """A response is missing (NaN, None) and no rule for missing values was given."""


class InfiniteValue(StatisticsError):
    """A response is infinite."""


class MissingCell(StatisticsError):
    """A subject has no row for a cell of the design."""


class DuplicateCell(StatisticsError):
    """A subject has more than one row for a cell of the design."""


class TooFewLevels(StatisticsError):
    """A factor has one level only, or a test got fewer samples than it compares."""


class TooFewSubjects(StatisticsError):
    """There are too few observations for the test."""


class ConstantResponse(StatisticsError):
    """The response, or the difference tested, does not vary."""


class SubjectInTwoGroups(StatisticsError):
    """A subject appears under two levels of a between-subject factor."""


class UnequalLength(StatisticsError):
    """Paired samples, or columns of a frame, differ in length."""


class UnknownMethod(StatisticsError):
    """An argument names a method, level or term that does not exist here."""


class NotConverged(StatisticsError):
    """A model could not be fitted to the data."""


RANKS_NEED_NO_ERROR = (
    "tests of ranks need no error (friedman, of two levels wilcoxon), but look for copied or "
    "constructed rows first"
)
"""What to do where everybody differs alike, for messages."""


def option_text(name: str, value: str | float) -> str:
    """Return how an option is chosen, in Python and study files and on the command line.

    Messages reach people who wrote either.
    """
    return f"{name}={value!r} (--{name} {value})"

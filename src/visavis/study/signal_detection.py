"""Signal detection in a study: hits, false alarms, d′ and criterion of every person and cell."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

from visavis.lab.errors import DesignError
from visavis.lab.kinds import takes_kinds
from visavis.study.measures import Measure
from visavis.study.responses import Response

if TYPE_CHECKING:
    import pandas as pd

Value: TypeAlias = Literal["dprime", "criterion", "hit_01", "false_alarm_01"]
WORDS: Final[Mapping[Value, str]] = {
    "dprime": "Sensitivity d′ of",
    "criterion": "Criterion c of",
    "hit_01": "Hits of",
    "false_alarm_01": "False alarms of",
}


@dataclass(frozen=True)
class DetectionValue:
    """A number of signal detection over the trials of a cell; None without trials of both kinds.

    Trials whose column `signal` is `present` had a signal, all others none; the answer `yes` in the
    column `answer` claims one. Trials without an answer are left out. d′ and criterion take rates
    with the log-linear correction (Hautus 1995, Behav Res Methods Instrum Comput 27:46): a half is
    added to each count, and one to each number of trials.
    """

    answer: str
    yes: str
    signal: str
    present: str
    value: Value

    @property
    def reads(self) -> tuple[str, ...]:
        """The columns of trials that it reads."""
        return self.answer, self.signal

    def __call__(self, trials: "pd.DataFrame") -> float | None:
        """Return the number for some trials."""
        rows = trials[list(self.reads)].dropna()
        is_signal = _is(rows[self.signal], self.present)
        says_yes = _is(rows[self.answer], self.yes)
        signals, others = int(is_signal.sum()), int((~is_signal).sum())
        if not signals or not others:
            return None
        hits, alarms = int((says_yes & is_signal).sum()), int((says_yes & ~is_signal).sum())
        if self.value == "hit_01":
            return hits / signals
        if self.value == "false_alarm_01":
            return alarms / others
        z = NormalDist().inv_cdf
        z_hits, z_alarms = z((hits + 0.5) / (signals + 1)), z((alarms + 0.5) / (others + 1))
        return z_hits - z_alarms if self.value == "dprime" else -(z_hits + z_alarms) / 2

    def uses(
        self,
        columns: Iterable[str],
        responses: Iterable[Response],
        levels: Mapping[str, tuple[object, ...]],
    ) -> Iterator[tuple[str, str, tuple[str, ...]]]:
        """Yield each name that it takes from a study: what it names, and all that there are.

        `columns` are those of trials, `responses` all that is asked, `levels` those of factors.
        """
        there = tuple(columns)
        yield from ((name, "column of trials", there) for name in self.reads)
        options = [
            r.value(option) for r in responses if r.name == self.answer for option in r.options
        ]
        for name, of, values in (
            (self.yes, f"option of {self.answer}", options),
            (self.present, f"level of {self.signal}", levels.get(self.signal, ())),
        ):
            if values and not any(_are_same(value, name) for value in values):
                yield name, of, tuple(dict.fromkeys(map(str, values)))


def _are_same(value: object, name: str) -> bool:
    """Tell whether a value of a table is the one that is written so: 1.0 is 1."""
    try:
        return str(value) == name or float(str(value)) == float(name)
    except ValueError:
        return False


def _is(values: "pd.Series[Any]", name: str) -> "pd.Series[bool]":
    """Tell which values of a column are the one that is written so."""
    return values.map(lambda value: _are_same(value, name)).astype(bool)


@takes_kinds()
def detection(answer: str, *, yes: object, signal: str, present: object) -> tuple[Measure, ...]:
    """Return the measures of signal detection of an answer, of every person and cell:
    `ANSWER_dprime`, `ANSWER_criterion` (above 0: rather "no"), `ANSWER_hit_01` and
    `ANSWER_false_alarm_01`.

    `yes` is the option of the response `answer` that claims a signal; there was one in trials whose
    factor or column `signal` is `present`, and none in all others. Trials without an answer are
    left out, and a cell needs trials of both kinds. d′ and criterion take rates with the log-linear
    correction of Hautus (1995), so that they exist where every answer is right.

    Raises:
        DesignError: answer and signal are the same column.
    """
    if answer == signal:
        raise DesignError(
            f"detection: {answer!r} is both the answer and what tells of a signal; name the factor "
            "or column of trials that says whether there was one"
        )
    words = answer.replace("_", " ")
    return tuple(
        Measure(
            f"{answer}_{value}",
            "1",
            f"{what} {words}",
            None,
            "fit",
            of_cell=DetectionValue(answer, str(yes), signal, str(present), value),
        )
        for value, what in WORDS.items()
    )

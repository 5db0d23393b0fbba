"""Signal detection in a study: hits, false alarms, d′ and criterion of every person and cell."""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from visavis.lab.errors import DesignError
from visavis.study.measures import Measure

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
        is_signal = rows[self.signal].astype(str) == self.present
        says_yes = rows[self.answer].astype(str) == self.yes
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

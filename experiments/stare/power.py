"""Power of the stare study: whole studies over the quick path, or people drawn from a pool.

Both go through the exclusion rules, means and tests of `visavis analyse`; a test keeps the
Bonferroni threshold of its family of thirty, whether or not the other tests are shown.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from analysis.power import Found, Source, Verdicts
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.comparisons import (
    ALL_MEASURES,
    ANXIETY_TESTS,
    CONDITION_TESTS,
    DWELL,
    FIXATION_COUNT,
    MEASURES,
    SCORE_COLUMN,
    condition_means,
)
from experiments.stare.conclusions import STARED_AT, conclude
from experiments.stare.design import AVERTED, CONDITIONS
from experiments.stare.exclusions import select_trials
from experiments.stare.published import COMPARISONS
from experiments.stare.quick_study import QuickStudy, TrackerModel, run_study
from lab.errors import DataError, UsageError
from visavis.measures import Measure
from visavis.observer.temperament import DEFAULT_POPULATION, Population
from visavis.pairs import CorrelationTest, PairTest, compare, correlate, scores_of

MakeTracker = Callable[[int, int], TrackerModel]

N_TESTS: Final = len(COMPARISONS) * len(MEASURES)
COLUMNS: Final = tuple(m.column for m in MEASURES)
HYPOTHESES: Final = {"stare-effect": 0, "caught-staring": 1, "catching-staring": 2}
"""Conclusions of the study, as `conclusions.conclude` orders them."""
HYPOTHESIS_PAIRS: Final = ((AVERTED, "D"), (AVERTED, "AD"), (AVERTED, "DA"))
HYPOTHESIS_MEASURES: Final = (DWELL, FIXATION_COUNT)


def test_name(pair: tuple[str, str], measure: Measure) -> str:
    """Return the name of a comparison on the command line: 'A-D:dwell_ms'."""
    return f"{pair[0]}-{pair[1]}:{measure.column}"


test_name.__test__ = False  # type: ignore[attr-defined]  # not a test of pytest's

_COMPARED: Final = {
    test_name(pair, measure): (pair, measure) for pair in COMPARISONS for measure in MEASURES
}
_CORRELATED: Final = {f"anxiety-{c}:{DWELL.column}": c for c in STARED_AT}
_TESTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        **{n: f"{p[0]} – {p[1]}, {m.words.lower()}" for n, (p, m) in _COMPARED.items()},
        "stare-effect": "A – D, dwell time and fixation count both greater",
        "caught-staring": "A – AD, dwell time and fixation count both greater",
        "catching-staring": "A – DA, dwell time and fixation count both greater",
        **{n: f"anxiety and dwell time under {c}" for n, c in _CORRELATED.items()},
    }
)


@dataclass(frozen=True)
class StarePower:
    """Implement `analysis.power.PowerStudy`; `make_tracker` gives each person a tracker."""

    make_tracker: MakeTracker = field(repr=False)
    population: Population = DEFAULT_POPULATION
    name: str = "stare"
    smallest_n: int = 3

    @property
    def tests(self) -> Mapping[str, str]:
        """Every planned test by name, with what it claims."""
        return _TESTS

    @property
    def shown_tests(self) -> Sequence[str]:
        """Tests shown by default; the effect on dwell time decides."""
        shown = [test_name(("A", c), DWELL) for c in ("D", "AD", "DA")]
        return (*shown, test_name(("A", "D"), FIXATION_COUNT), "stare-effect")

    def rule(self, alpha: float) -> str:
        """Return how a test becomes significant."""
        return f"Shapiro-Wilk, then paired t or Wilcoxon, two-sided, p < {alpha:g}/{N_TESTS}"

    def effect_meaning(self, effect: float, source: Source) -> str:
        """Return what the multiplier did."""
        if effect == 1:
            return {
                "studies": "Simulated people fitted to the published means and spreads",
                "simulated pool": "People drawn with replacement from a pool of simulated people "
                "fitted to the published means and spreads",
                "study folder": "People drawn with replacement from those recorded, their effect "
                "as it was found",
            }[source]
        if source == "study folder":
            return (
                "People drawn with replacement from those recorded, the mean differences of "
                f"conditions to A multiplied by {effect:g}"
            )
        if effect == 0:
            return "Simulated people blind to gaze contact: whatever is significant is false"
        return (
            "Simulated people whose responses to gaze contact are scaled by "
            f"{effect:g} (durations multiplied, factors raised to that power)"
        )

    def simulate(
        self,
        numbers: Sequence[int],
        tests: Sequence[str],
        *,
        effect: float,
        seed: int,
        alpha: float,
    ) -> Mapping[int, Verdicts]:
        """Simulate the largest study over the quick path and test its first n people for all n."""
        study = self._study(range(max(numbers)), effect, seed)
        parameters = AnalysisParameters(alpha=alpha)
        return _at_every_number(_people(study.trials, study.answers, parameters), numbers, tests,
                                parameters)  # fmt: skip

    def simulate_people(self, indices: Sequence[int], *, effect: float, seed: int) -> pd.DataFrame:
        """Return condition means and anxiety of some simulated people."""
        study = self._study(indices, effect, seed)
        return _people(study.trials, study.answers, AnalysisParameters())

    def people_of(self, folder: Path, *, effect: float) -> tuple[pd.DataFrame, bool]:
        """Return condition means and anxiety of the people in a study's folder.

        Raises:
            DataError: no trial table there, simulated and real people together, or too few.
        """
        trials = _table(folder, "trials.csv")
        if trials is None:
            raise DataError(
                f"{folder} holds no trials.csv; make it with `visavis analyse {folder}` and give "
                "that folder or its derived/ folder"
            )
        simulated = trials.get("is_simulated", pd.Series(False, index=trials.index)).astype(bool)
        if simulated.any() and not simulated.all():
            raise DataError(
                f"{folder} mixes simulated and real people; take them apart before drawing"
            )
        answers = _table(folder, "participants.csv")
        people = _people(
            trials, pd.DataFrame() if answers is None else answers, AnalysisParameters()
        )
        count = people["participant"].nunique()
        if count < self.smallest_n:
            raise DataError(
                f"{folder} holds {count} people after exclusions; drawing from fewer than "
                f"{self.smallest_n} says nothing"
            )
        return _scaled_means(people, effect), bool(simulated.any())

    def resample(
        self,
        people: pd.DataFrame,
        numbers: Sequence[int],
        tests: Sequence[str],
        *,
        seed: int,
        alpha: float,
    ) -> Mapping[int, Verdicts]:
        """Draw people with all their rows, with replacement."""
        parameters = AnalysisParameters(alpha=alpha)
        drawn = draw_people(people, max(numbers), np.random.default_rng(seed))
        return _at_every_number(drawn, numbers, tests, parameters)

    def _study(self, indices: Sequence[int], effect: float, seed: int) -> QuickStudy:
        return run_study(
            self.make_tracker,
            seed=seed,
            participants=indices,
            effect=effect > 0,
            population=scaled_population(self.population, effect),
        )


def scaled_population(population: Population, effect: float) -> Population:
    """Scale everything that gaze contact does to people; what they do otherwise stays.

    Durations and additions are multiplied by `effect`, factors are raised to its power, so that
    1 is the fitted population and the limit 0 is nobody moved by contact. The scale is one of
    mechanisms: means move with it, not in proportion. Raises UsageError above 2, where the
    model was never looked at.
    """
    if not 0 <= effect <= 2:
        raise UsageError(
            f"the stare participants can scale their effect from 0 to 2, not {effect:g}"
        )
    p = population
    if effect in (0, 1):
        return p
    return replace(
        p,
        hold_s=p.hold_s * effect,
        startle_s=p.startle_s * effect,
        recheck_gain=p.recheck_gain * effect,
        capture_gain=p.capture_gain * effect,
        hold_growth=p.hold_growth**effect,
        caught_hold=p.caught_hold**effect,
        caught_return=p.caught_return**effect,
        return_gain=p.return_gain**effect,
        return_between_log_sd=p.return_between_log_sd * effect,
        return_habituation=p.return_habituation**effect,
    )


def draw_people(people: pd.DataFrame, n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Draw n people with replacement, each with all rows; the drawn get numbers as names."""
    rows_of = list(people.groupby("participant", sort=True).indices.values())
    chosen = [rows_of[i] for i in rng.integers(0, len(rows_of), n)]
    drawn = people.iloc[np.concatenate(chosen)].reset_index(drop=True)
    drawn["participant"] = np.repeat(_names(n), [len(rows) for rows in chosen])
    return drawn


def _names(n: int) -> npt.NDArray[np.object_]:
    return np.array([f"{i:05d}" for i in range(n)], dtype=object)


def _people(
    trials: pd.DataFrame, answers: pd.DataFrame, parameters: AnalysisParameters
) -> pd.DataFrame:
    """Return one row per person and condition with the six means and the anxiety score."""
    means = condition_means(select_trials(trials, parameters).kept)
    scores = scores_of(answers, SCORE_COLUMN)
    kept = means[["participant", "condition", *COLUMNS]]
    return kept.assign(**{SCORE_COLUMN: kept["participant"].map(scores).astype(float)})


def _scaled_means(people: pd.DataFrame, effect: float) -> pd.DataFrame:
    """Move each condition so that its mean difference to A is multiplied; spreads stay."""
    if effect == 1:
        return people
    moved = people.copy()
    grand = people.groupby("condition")[list(COLUMNS)].mean()
    for condition in CONDITIONS:
        if condition == AVERTED or condition not in grand.index:
            continue
        here = moved["condition"] == condition
        shift = (effect - 1) * (grand.loc[condition] - grand.loc[AVERTED])
        moved.loc[here, list(COLUMNS)] += shift.to_numpy(float)
    return moved


def _table(folder: Path, name: str) -> pd.DataFrame | None:
    for path in (folder / name, folder / "derived" / name):
        if path.exists():
            try:
                return pd.read_csv(path, dtype={"participant": str})
            except (ValueError, UnicodeDecodeError) as error:
                raise DataError(f"{path} cannot be read ({error}); make it again") from error
    return None


def _at_every_number(
    people: pd.DataFrame,
    numbers: Sequence[int],
    tests: Sequence[str],
    parameters: AnalysisParameters,
) -> dict[int, Verdicts]:
    """Test the first n names for every n; a person left out by the rules leaves a gap."""
    names = sorted(people["participant"].unique())
    place = people["participant"].map({name: int(name) for name in names}).to_numpy()
    return {n: _verdicts(people[place < n], tests, parameters) for n in numbers}


def _verdicts(
    means: pd.DataFrame, tests: Sequence[str], parameters: AnalysisParameters
) -> dict[str, Found]:
    made: dict[tuple[tuple[str, str], str], PairTest] = {}

    def compared(pair: tuple[str, str], measure: Measure) -> PairTest:
        key = (pair, measure.column)
        if key not in made:
            made[key] = compare(
                means, measure, pair, CONDITION_TESTS, parameters.tests, n_tests=N_TESTS
            )
        return made[key]

    correlated: dict[str, CorrelationTest] = {}
    if any(name in _CORRELATED for name in tests):
        scores = scores_of(means.drop_duplicates("participant"), SCORE_COLUMN)
        made_of = correlate(
            ANXIETY_TESTS, means, scores, ALL_MEASURES, CONDITIONS, parameters.tests
        )
        correlated = {c.level: c for c in made_of if c.measure == DWELL}
    wide = means.pivot(index="participant", columns="condition", values=list(COLUMNS))
    found = {}
    for name in tests:
        if name in _COMPARED:
            found[name] = _found(compared(*_COMPARED[name]), wide)
        elif name in HYPOTHESES:
            all_ = [compared(p, m) for p in HYPOTHESIS_PAIRS for m in HYPOTHESIS_MEASURES]
            found[name] = Found(conclude(all_, ())[HYPOTHESES[name]].is_found)
        else:
            outcome = correlated[_CORRELATED[name]]
            r = float("nan") if outcome.outcome is None else outcome.outcome.r
            found[name] = Found(outcome.is_significant, r, r)
    return found


def _found(comparison: PairTest, wide: pd.DataFrame) -> Found:
    """Return the outcome; `wide` holds measures by condition, one row per participant."""
    if comparison.outcome is None:
        return Found(None)
    column = comparison.measure.column
    off = (wide[column, comparison.second] - wide[column, comparison.first]).dropna()
    sd = float(off.std(ddof=1))
    dz = float(off.mean()) / sd if sd > 0 else float("nan")
    return Found(comparison.is_significant, float(off.mean()), dz)

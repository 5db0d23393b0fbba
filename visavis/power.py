"""Power and studies of the null hypothesis, for every study on the kit.

Both follow from what the study declares: simulated people perform its trials over the quick path,
its exclusion rules decide what counts, its planned comparisons are tested with the correction of
their family. `effect` 0 gives people to whom what is shown makes no difference, so that whatever
is significant is false.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from analysis.power import Found, Source, Verdicts
from lab.errors import DataError, UsageError
from protocol.participants import SimulatedParticipant
from visavis.analysis import Finding, answered, corrected
from visavis.catalogue import find_study
from visavis.exclusions import COUNTED
from visavis.experiment import StudyExperiment
from visavis.opened import OpenedStudy
from visavis.quick import MakeTracker, quick_rows

MIN_N = 3


@dataclass(frozen=True)
class KitPower:
    """Implement `analysis.power.PowerStudy` for a study on the kit.

    `reference` finds the study again in any process; `make_tracker` gives each person a tracker.
    """

    reference: str
    make_tracker: MakeTracker = field(repr=False)
    smallest_n: int = MIN_N

    @property
    def _opened(self) -> OpenedStudy:
        found = find_study(self.reference)
        if not isinstance(found, OpenedStudy):
            raise UsageError(f"{self.reference} is not on the kit; its power is its own")
        return found

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        return self._opened.name

    @property
    def tests(self) -> Mapping[str, str]:
        """Every effect of every planned comparison by name, with what it claims."""
        found = {}
        for compare in self._opened.study.compare:
            if compare.exploratory:
                continue
            for term in terms_of((*compare.within, *compare.between)):
                claim = compare.claim or f"{compare.dv} depends on {term.replace(':', ' × ')}"
                found[f"{compare.dv}:{term}"] = claim
        if not found:
            raise UsageError(
                f"{self.name} plans no comparison, so there is no power to find; declare one: "
                'compare=[Compare("…", within="…")]'
            )
        return found

    @property
    def shown_tests(self) -> Sequence[str]:
        """Every planned effect; the first decides the number of participants."""
        return tuple(self.tests)

    def rule(self, alpha: float) -> str:
        """Return how a test becomes significant."""
        ways = {c.correction for c in self._opened.study.compare if not c.exploratory}
        return f"the study's own tests, corrected within families ({', '.join(sorted(ways))}), " \
               f"p < {alpha:g}"  # fmt: skip

    def effect_meaning(self, effect: float, source: Source) -> str:
        """Return what the multiplier did."""
        if effect == 0:
            return "Simulated people to whom nothing shown makes a difference: whatever is " \
                   "significant is false"  # fmt: skip
        if source == "study folder":
            return "People drawn with replacement from those recorded, their effect as found"
        return "Simulated people as the study declares them"

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
        rows = self.simulate_people(range(max(numbers)), effect=effect, seed=seed)
        return self._at_every_number(rows, numbers, tests, alpha)

    def simulate_people(self, indices: Sequence[int], *, effect: float, seed: int) -> pd.DataFrame:
        """Return the trials of some simulated people that count.

        Raises:
            UsageError: the effect is neither 0 nor 1.
        """
        if effect not in (0, 1):
            raise UsageError(
                f"people of a study on the kit see what is shown or do not: --effect is "
                f"published or none, not {effect:g}"
            )
        opened = self._opened
        experiment = opened.experiment({})
        measures = [m for m in opened.measures(experiment) if m.of is not None]
        tables = []
        for index in indices:
            person: SimulatedParticipant = opened.participant(
                index, seed, effect=effect > 0, experiment=experiment
            )
            tracker = self.make_tracker(seed, index)
            tables.append(quick_rows(experiment, person, tracker, measures, index=index, seed=seed))
        return _counted(opened, experiment, pd.concat(tables, ignore_index=True))

    def people_of(self, folder: Path, *, effect: float) -> tuple[pd.DataFrame, bool]:
        """Return the trials that count of the people in a study's folder.

        Raises:
            DataError: no trial table of this study there, simulated and real people together, or
                too few people.
        """
        path = next(
            (p for p in (folder / "trials.csv", folder / "derived" / "trials.csv") if p.exists()),
            None,
        )
        if path is None or effect != 1:
            raise DataError(
                f"{folder} holds no trials.csv; make it with `visavis analyse {folder}`"
                if path is None
                else "people who were recorded keep the effect that was found in them: leave "
                "--effect out"
            )
        rows = pd.read_csv(path, dtype={"participant": str})
        if COUNTED not in rows:
            raise DataError(f"{path} was not made by a study on the kit; analyse it again")
        simulated = rows["is_simulated"].astype(bool)
        if simulated.any() and not simulated.all():
            raise DataError(f"{path} mixes simulated and real people; take them apart")
        kept: pd.DataFrame = rows[rows[COUNTED].astype(bool)].reset_index(drop=True)
        if kept["participant"].nunique() < MIN_N:
            raise DataError(
                f"{path} holds {kept['participant'].nunique()} people who count; drawing from "
                f"fewer than {MIN_N} says nothing"
            )
        return kept, bool(simulated.any())

    def resample(
        self,
        people: pd.DataFrame,
        numbers: Sequence[int],
        tests: Sequence[str],
        *,
        seed: int,
        alpha: float,
    ) -> Mapping[int, Verdicts]:
        """Draw people with all their trials, with replacement."""
        drawn = draw_people(people, max(numbers), np.random.default_rng(seed))
        return self._at_every_number(drawn, numbers, tests, alpha)

    def _at_every_number(
        self, rows: pd.DataFrame, numbers: Sequence[int], tests: Sequence[str], alpha: float
    ) -> dict[int, Verdicts]:
        """Test the first n names for every n; a person left out by the rules leaves a gap."""
        opened = self._opened
        experiment = opened.experiment({})
        place = rows["participant"].astype(int).to_numpy()
        return {
            n: self._verdicts(rows[place < n], tests, alpha, opened, experiment) for n in numbers
        }

    def _verdicts(
        self,
        rows: pd.DataFrame,
        tests: Sequence[str],
        alpha: float,
        opened: OpenedStudy,
        experiment: StudyExperiment,
    ) -> dict[str, Found]:
        known = {m.column: m for m in opened.measures(experiment)}
        levels = experiment.levels
        findings = corrected(
            [
                answered(compare, rows, known, levels, is_simulated=True)
                for compare in opened.study.compare
                if not compare.exploratory
            ]
        )
        found: dict[str, Found] = dict.fromkeys(tests, Found(None))
        for finding in findings:
            for term in finding.terms:
                name = f"{finding.compare.dv}:{term.name}"
                if name in found:
                    found[name] = Found(
                        bool(term.p_corrected < alpha), *_difference(finding, rows, levels)
                    )
        return found


def terms_of(factors: Sequence[str]) -> tuple[str, ...]:
    """Return the effects of some factors as tests name them: "a", "b", "a:b"."""
    if len(factors) == 1:
        return (factors[0],)
    names = list(factors)
    pairs = [f"{a}:{b}" for i, a in enumerate(names) for b in names[i + 1 :]]
    return (*names, *pairs, *([":".join(names)] if len(names) > 2 else []))


def draw_people(people: pd.DataFrame, n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Draw n people with replacement, each with all rows; the drawn get numbers as names."""
    rows_of = list(people.groupby("participant", sort=True).indices.values())
    chosen = [rows_of[i] for i in rng.integers(0, len(rows_of), n)]
    drawn = people.iloc[np.concatenate(chosen)].reset_index(drop=True)
    names: npt.NDArray[np.object_] = np.array([f"{i:05d}" for i in range(n)], dtype=object)
    drawn["participant"] = np.repeat(names, [len(rows) for rows in chosen])
    return drawn


def _difference(
    finding: Finding, rows: pd.DataFrame, levels: Mapping[str, tuple[Any, ...]]
) -> tuple[float, float]:
    """Return mean difference and dz of two levels within people; NaN for anything else."""
    compare = finding.compare
    if len(compare.within) != 1 or compare.between or len(levels[compare.within[0]]) != 2:
        return float("nan"), float("nan")
    first, second = levels[compare.within[0]]
    wide = rows.pivot_table(index="participant", columns=compare.within[0], values=compare.dv)
    if first not in wide or second not in wide:
        return float("nan"), float("nan")
    off = (wide[second] - wide[first]).dropna()
    sd = float(off.std(ddof=1))
    return float(off.mean()), float(off.mean()) / sd if sd > 0 else float("nan")


def _counted(opened: OpenedStudy, experiment: StudyExperiment, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the trials that the study's rules let count."""
    planned = {str(name): int(n) for name, n in rows.groupby("participant").size().items()}
    return opened.selection_of(experiment, rows, planned=planned).counted

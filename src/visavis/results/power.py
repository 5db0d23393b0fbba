"""Power and studies of the null hypothesis, for every study on the kit.

Both follow from what the study declares: simulated people perform its trials over the quick path,
its exclusion rules decide what counts, its planned comparisons are tested with the correction of
their family. With `effect` 0 conditions make no difference to people, so that every significant
result is false.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.power import (
    ANYTHING,
    PRIMARY,
    PlannedTestResult,
    PrintedTest,
    Source,
    Verdicts,
)
from visavis.analysis.statistics.results import number
from visavis.lab.errors import DataError, UsageError
from visavis.results.analysis import (
    Results,
    StudyAnalysis,
    answer_comparison,
    columns_of,
    rows_to_compare,
    with_corrected_p,
)
from visavis.results.claims import answer_claim, claimed_finding_term
from visavis.results.family_tests import (
    DEFAULT_TEST_RULES,
    CorrelationTest,
    Test,
    compare_pairs,
    printed_pair_tests,
    results_of,
    scores_of,
)
from visavis.results.findings import Finding
from visavis.results.intake import SimulatedStudy
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.planned_tests import (
    claims_of,
    effect_name,
    families_of,
    name_of_test,
    names_of_finding,
    pair_name,
    planned_tests,
    primary_tests,
)
from visavis.results.selection import IS_ANALYSED, Selection
from visavis.study.comparisons import AGREEMENT, Compare
from visavis.study.conditions import with_people
from visavis.study.declaration import Study
from visavis.study.distances import WhenNear
from visavis.study.experiment import StudyExperiment
from visavis.study.gaze_on import WhenGazeOn
from visavis.study.measures import aggregate_cells, count_column
from visavis.study.pairs import Correlate, Family, Pairs
from visavis.study.race import Race
from visavis.study.responses import Response
from visavis.study.study_functions import MakeTracker, Seen

MIN_N = 3
SOMETHING: Final = ("found", "partly", "reversed")
"""The verdicts that report something."""
_OF_ALL: Final = frozenset((PRIMARY, ANYTHING))
"""The tests that ask of all others at once."""


class SimulateStudy(Protocol):
    """Simulate people of a study without recordings, such as `visavis.running.quick.quick_study`.

    `effect` multiplies the difference that conditions make.
    """

    def __call__(
        self,
        opened_study: OpenedStudy,
        experiment: StudyExperiment,
        make_tracker: MakeTracker,
        indices: Iterable[int],
        /,
        *,
        seed: int,
        effect: float,
    ) -> SimulatedStudy:
        """Return the trials and the people with these indices."""
        ...


@dataclass(frozen=True)
class KitPower:
    """Implement `visavis.analysis.power.PowerStudy` for a study on the kit.

    `reference` finds the study again in any process; `make_tracker` makes the tracker with
    which `simulate_study` performs a person's trials; `overrides` replace parameters of the study.
    """

    reference: str
    make_tracker: MakeTracker = field(repr=False)
    simulate_study: SimulateStudy = field(repr=False)
    smallest_n: int = MIN_N
    overrides: Mapping[str, Any] = field(default_factory=dict)

    @property
    def _opened_study(self) -> OpenedStudy:
        return find_study(self.reference)

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        return self._opened_study.name

    @property
    def tests(self) -> Mapping[str, str]:
        """Every planned test by name, with what it claims (`planned_tests`).

        Of several tests the last two are whether any primary claim, and whether any headline finds
        something.

        Raises:
            UsageError: the study plans none.
        """
        comparisons = self._opened_study.experiment(self.overrides).compare
        claims = planned_tests(self._opened_study.study, comparisons)
        if not claims:
            raise UsageError(
                f"{self.name} plans no comparison, so there is no power to find; declare one: "
                'compare=[Compare("…", within="…")]'
            )
        if len(claims) == 1:
            return claims
        return claims | {
            PRIMARY: "any primary claim finds something",
            ANYTHING: "any headline finds something",
        }

    @property
    def primary_tests(self) -> Sequence[str]:
        """The study's primary claims by name."""
        comparisons = self._opened_study.experiment(self.overrides).compare
        return primary_tests(self._opened_study.study, comparisons)

    @property
    def printed_tests(self) -> Mapping[str, PrintedTest]:
        """The F tests of effects within people, and paired t tests, that the source prints."""
        study = self._opened_study.study
        tests = {name: test for of in families_of(study) for name, test in _printed_t(study, of)}
        comparisons = self._opened_study.experiment(self.overrides).compare
        for compare in comparisons:
            for term in compare.terms:
                printed_result = compare.published_of(term)
                if compare.between or printed_result is None or printed_result.statistic is None:
                    continue
                if printed_result.df is not None:
                    df1, df2 = printed_result.df
                    tests[effect_name(compare, term, comparisons)] = PrintedTest(
                        f"F({df1:g}, {df2:g}) = {number(printed_result.statistic)}",
                        printed_result.statistic,
                        df1,
                        df2,
                        round(df2 / df1) + 1,
                    )
        return tests

    @property
    def shown_tests(self) -> Sequence[str]:
        """The tests shown by default; the first one decides the number of participants.

        Every effect of a comparison, the tests of the first measure of the first family, and
        questions.
        """
        study, every = self._opened_study.study, self.tests
        families = families_of(study)
        first = claims_of(study, families[0], families[0].measures[:1]) if families else {}
        further = {n for of in families for n in claims_of(study, of)}
        return tuple(n for n in every if n in first or n not in _OF_ALL | further)

    def rule(self, alpha: float) -> str:
        """Return in words when a test is significant."""
        study = self._opened_study.study
        pairs = [of for of in families_of(study) if isinstance(of, Pairs)]
        if pairs and not study.analysis.compare:
            n = len(pairs[0].levels) * len(pairs[0].measures)
            return f"Shapiro-Wilk, then paired t or Wilcoxon, two-sided, p < {alpha:g}/{n}"
        ways = {c.correction for c in study.analysis.compare if not c.exploratory}
        return (
            f"the study's own tests, corrected within families ({', '.join(sorted(ways))}), "
            f"p < {alpha:g}"
        )

    def effect_meaning(self, effect: float, source: Source) -> str:
        """Return in words what the multiplier changed."""
        if source == "study folder":
            as_found = "People drawn with replacement from those recorded"
            if effect == 1:
                return f"{as_found}, their effect as found"
            return f"{as_found}, mean differences to the first level multiplied by {effect:g}"
        if effect == 0:
            return (
                "Simulated people to whom nothing shown makes a difference: whatever is "
                "significant is false"
            )
        if effect == 1:
            return "Simulated people as the study declares them"
        return (
            f"Simulated people whose responses to what is shown are scaled by {effect:g} "
            "(durations multiplied, factors raised to that power)"
        )

    @property
    def unplanted_times(self) -> tuple[str, ...]:
        """Times to answer that are compared though simulated people have no model of them.

        One person is simulated: a time is modelled where every answer that they give comes with
        its time. A study with people of its own makes what it makes.
        """
        opened_study = self._opened_study
        simulated = opened_study.study.simulated
        if simulated.person_of or simulated.scaled_of or simulated.quick_of:
            return ()
        experiment = opened_study.experiment(self.overrides)
        names = {f"{name}_ms": name for name in experiment.responses}
        times = tuple(dict.fromkeys(c.dv for c in experiment.compare if c.dv in names))
        answer_of = simulated.answer_of
        if not times or answer_of is None:
            return times
        has_time: dict[str, set[bool]] = {}

        def note(view: Seen, response: Response, rng: np.random.Generator) -> Any:
            reply = answer_of(view, response, rng)
            if reply is not None:
                is_timed = isinstance(reply, Race | WhenNear | WhenGazeOn)
                has_time.setdefault(response.name, set()).add(is_timed)
            return reply

        watching_study = replace(
            opened_study, study=opened_study.study.with_changes(answer_of=note)
        )
        self.simulate_study(
            watching_study,
            watching_study.experiment(self.overrides),
            self.make_tracker,
            [0],
            seed=1,
            effect=1,
        )
        return tuple(time for time in times if has_time.get(names[time]) != {True})

    def prepare(self, on_progress: Callable[[int, int], None]) -> None:
        """Prepare the study before its first trial: a study on waving makes its waves."""
        self._opened_study.experiment(self.overrides).prepare(on_progress)

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
        return self.verdicts_at(rows, numbers, tests, alpha)

    def simulate_people(self, indices: Sequence[int], *, effect: float, seed: int) -> pd.DataFrame:
        """Return the rows of simulated people that tests need: trials that count, or means.

        Raises:
            UsageError: the study's people cannot be given such an effect.
        """
        opened_study = self._opened_study
        experiment = opened_study.experiment(self.overrides)
        simulation = self.simulate_study(
            opened_study, experiment, self.make_tracker, indices, seed=seed, effect=effect
        )
        trials = _trials_that_count(opened_study, experiment, simulation.trials)
        return _rows_for_tests(opened_study, experiment, trials, simulation.people)

    def people_of(self, folder: Path, *, effect: float) -> tuple[pd.DataFrame, bool]:
        """Return the rows of the people in a study's folder that tests need.

        Raises:
            DataError: no trial table of this study there, simulated and real people together, too
                few people, or an effect that cannot be changed in recorded people.
        """
        opened_study = self._opened_study
        families = families_of(opened_study.study)
        path = _table(folder, "trials.csv")
        if path is None:
            raise DataError(
                f"{folder} holds no trials.csv; make it with `visavis analyse {folder}` and give "
                "that folder or its derived/ folder"
            )
        if effect != 1 and (opened_study.study.analysis.compare or not families):
            raise DataError(
                "people who were recorded keep the effect that was found in them: "
                "leave --effect out"
            )
        rows = pd.read_csv(path, dtype={"participant": str})
        if IS_ANALYSED not in rows:
            raise DataError(f"{path} was not made by a study on the kit; analyse it again")
        is_simulated = rows["is_simulated"].astype(bool)
        if is_simulated.any() and not is_simulated.all():
            raise DataError(f"{path} mixes simulated and real people; take them apart")
        trials: pd.DataFrame = rows[rows[IS_ANALYSED].astype(bool)].reset_index(drop=True)
        if trials["participant"].nunique() < MIN_N:
            raise DataError(
                f"{path} holds {trials['participant'].nunique()} people who count; drawing from "
                f"fewer than {MIN_N} says nothing"
            )
        answers = _table(folder, "participants.csv")
        people = None if answers is None else pd.read_csv(answers, dtype={"participant": str})
        test_rows = _rows_for_tests(
            opened_study, opened_study.experiment(self.overrides), trials, people
        )
        for of in (of for of in families if isinstance(of, Pairs)):
            test_rows = _scaled(test_rows, of, effect)
        return test_rows, bool(is_simulated.any())

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
        sample = draw_people(people, max(numbers), np.random.default_rng(seed))
        return self.verdicts_at(sample, numbers, tests, alpha)

    def verdicts_at(
        self, rows: pd.DataFrame, numbers: Sequence[int], tests: Sequence[str], alpha: float
    ) -> dict[int, Verdicts]:
        """Test the first n people for every n; anyone left out by the rules is not replaced."""
        opened_study = self._opened_study
        experiment = opened_study.experiment(self.overrides)
        place = rows["participant"].astype(int).to_numpy()
        return {
            n: self._verdicts(rows[place < n], tests, alpha, opened_study, experiment)
            for n in numbers
        }

    def _verdicts(
        self,
        rows: pd.DataFrame,
        tests: Sequence[str],
        alpha: float,
        opened_study: OpenedStudy,
        experiment: StudyExperiment,
    ) -> dict[str, PlannedTestResult]:
        measures = {m.column: m for m in opened_study.measures(experiment)}
        groups = opened_study.study.analysis.groups
        levels = {**experiment.levels, **{name: tuple(of) for name, of in groups.items()}}
        asks = any(name in _OF_ALL | set(opened_study.study.analysis.questions) for name in tests)
        findings = with_corrected_p(
            [
                answer_comparison(
                    compare,
                    rows_to_compare(compare, rows, None, groups),
                    measures,
                    levels,
                    is_simulated=True,
                )
                for compare in (c.with_alphas({"alpha": alpha}) for c in experiment.compare)
                if not compare.exploratory and (asks or _is_asked(compare, tests, experiment))
            ]
        )
        verdicts: dict[str, PlannedTestResult] = dict.fromkeys(tests, PlannedTestResult(None))
        for finding in findings:
            claimed = claimed_finding_term(finding)
            for term in finding.terms:
                name = effect_name(finding.compare, term.name, experiment.compare)
                if name not in verdicts:
                    continue
                # A claim succeeds only in its own direction.
                success = bool(term.p_corrected < alpha)
                if claimed is not None and term.name == claimed.name:
                    success = answer_claim(finding).status == "found"
                verdicts[name] = PlannedTestResult(success, *_difference(finding, rows, levels))
        return verdicts | _of_families(opened_study, experiment, rows, tests, alpha, findings)


def _is_asked(compare: Compare, tests: Sequence[str], experiment: StudyExperiment) -> bool:
    """Tell whether a comparison, or another that shares its correction, is asked for."""
    family = [
        c
        for c in experiment.compare
        if c is compare or (c.correction != "none" and c.family == compare.family)
    ]
    return any(name.partition(":")[0] == c.dv for c in (compare, *family) for name in tests)


def _of_families(
    opened_study: OpenedStudy,
    experiment: StudyExperiment,
    rows: pd.DataFrame,
    tests: Sequence[str],
    alpha: float,
    findings: tuple[Finding, ...],
) -> dict[str, PlannedTestResult]:
    """Make the requested tests of families; a question needs every test of every family."""
    study, levels = opened_study.study, experiment.levels
    measures = {m.column: m for m in opened_study.measures(experiment)}
    asks = any(name in _OF_ALL | set(study.analysis.questions) for name in tests)
    rules = DEFAULT_TEST_RULES.with_settings({"alpha": alpha})
    people = rows.drop_duplicates("participant")
    verdicts: dict[str, PlannedTestResult] = {}
    results = []
    for of in families_of(study):
        is_asked = asks or not claims_of(study, of).keys().isdisjoint(tests)
        if not is_asked or not all(measure in rows for measure in of.measures):
            continue
        family_tests: Sequence[Test]
        if isinstance(of, Pairs):
            every = {(pair, m) for pair in of.levels for m in of.measures}
            only = {(p, m) for p, m in every if asks or pair_name(p, m) in tests}
            family_tests = compare_pairs(of, rows, measures, levels, rules, only=only)
        else:
            family_tests = results_of(of, rows, people, measures, levels, rules)
        results.append(Results(of, tuple(family_tests)))
        verdicts |= dict(_verdicts_by_name(rows, family_tests))
    if asks:
        selection = Selection(rows, people, len(rows), (), {})
        analysis = StudyAnalysis(
            study,
            True,
            selection,
            people,
            levels,
            tuple(measures.values()),
            findings,
            (),
            tuple(results),
            rules=rules,
        )
        verdicts |= {c.name: PlannedTestResult(c.is_found) for c in analysis.conclusions}
        finders = {name for name, finds in _what_finds(analysis) if finds}
        verdicts[ANYTHING] = PlannedTestResult(bool(finders))
        verdicts[PRIMARY] = PlannedTestResult(not finders.isdisjoint(analysis.primary))
    return {name: verdict for name, verdict in verdicts.items() if name in tests}


def _what_finds(analysis: StudyAnalysis) -> Iterator[tuple[str, bool]]:
    """Yield every planned test by name, and whether it finds something: an effect, a claim in part
    or turned, an answer.

    The tests of families make no headlines where the study's own conclusions rest on them. That two
    things are equivalent is true without an effect, and no false finding.
    """
    every = [f.compare for f in analysis.findings]
    planned_findings = (f for f in analysis.findings if not f.compare.exploratory)
    for finding in (f for f in planned_findings if f.compare.test != "tost"):
        claim = claimed_finding_term(finding)
        for name, term in zip(names_of_finding(finding, every), finding.terms, strict=False):
            if claim is not None and term.name == claim.name:
                yield name, answer_claim(finding).status in SOMETHING
            else:
                doubts = finding.outcome is not None and finding.outcome.doubts(term.name)
                yield name, term.is_significant and not doubts
    if analysis.study.analysis.conclude_of is not None:
        yield from ((c.name, c.status in SOMETHING) for c in analysis.conclusions)
        return
    for test in (test for results in analysis.results for test in results.tests):
        yield name_of_test(test), bool(test.is_significant)


def _printed_t(study: Study, of: Family) -> Iterator[tuple[str, PrintedTest]]:
    """Yield the paired t tests of a family that its source prints, by name."""
    if not isinstance(of, Pairs) or of.printed is None or study.report.source is None:
        return
    n = study.report.source.participants
    if n is None:
        return
    for test in printed_pair_tests(study, of):
        printed_result = test.published_result
        if printed_result is not None and printed_result.statistic is not None:
            yield (
                pair_name((test.first, test.second), test.measure.column),
                PrintedTest(
                    f"t({n - 1}) = {number(printed_result.statistic)}",
                    printed_result.statistic**2,
                    1,
                    n - 1,
                    n,
                    test.n_tests,
                ),
            )


def _verdicts_by_name(
    rows: pd.DataFrame, tests: Sequence[Test]
) -> Iterator[tuple[str, PlannedTestResult]]:
    """Yield the verdict of every test by its name."""
    for test in tests:
        name, column = name_of_test(test), test.measure.column
        if isinstance(test, CorrelationTest):
            r = float("nan") if test.outcome is None else test.outcome.r
            yield name, PlannedTestResult(test.is_significant, r, r)
        elif test.outcome is None:
            yield name, PlannedTestResult(None)
        else:
            off = _off(rows, test.of.factor, column, test.first, test.second)
            yield name, PlannedTestResult(test.is_significant, *off)


def _rows_for_tests(
    opened_study: OpenedStudy,
    experiment: StudyExperiment,
    trials: pd.DataFrame,
    people: pd.DataFrame | None,
) -> pd.DataFrame:
    """Return the rows that tests need: means by level where all compare levels of one factor.

    Every row of a person has their scores, so that resampling keeps them together.
    """
    families = families_of(opened_study.study)
    factors = {of.factor for of in families}
    test_rows = trials
    for compare in experiment.compare:
        columns = columns_of(compare, opened_study.study.analysis.groups)
        test_rows = with_people(test_rows, people, columns, {})
    if not opened_study.study.analysis.compare and len(factors) == 1:
        names = {name for of in families for name in of.measures}
        measures = [m for m in opened_study.measures(experiment) if m.column in names]
        test_rows = aggregate_cells(trials, measures, list(factors)).drop(
            columns=count_column(list(factors))
        )
    for of in families:
        if isinstance(of, Correlate):
            scores = scores_of(pd.DataFrame() if people is None else people, of.score)
            test_rows = test_rows.assign(
                **{of.score: test_rows["participant"].map(scores).astype(float)}
            )
    return test_rows


def _scaled(people: pd.DataFrame, of: Pairs, effect: float) -> pd.DataFrame:
    """Move each level so that its mean difference to the first is multiplied; spreads stay."""
    if effect == 1:
        return people
    scaled_people, columns = people.copy(), list(of.measures)
    grand = people.groupby(of.factor)[columns].mean()
    first = of.levels[0][0]
    for level in grand.index:
        if str(level) != first and first in grand.index:
            here = scaled_people[of.factor] == level
            shift = (effect - 1) * (grand.loc[level] - grand.loc[first])
            scaled_people.loc[here, columns] += shift.to_numpy(float)
    return scaled_people


def _table(folder: Path, name: str) -> Path | None:
    return next((p for p in (folder / name, folder / "derived" / name) if p.exists()), None)


def draw_people(people: pd.DataFrame, n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Draw n people with replacement, each with all rows; their new names are numbers."""
    rows_of = list(people.groupby("participant", sort=True).indices.values())
    row_groups = [rows_of[i] for i in rng.integers(0, len(rows_of), n)]
    sample = people.iloc[np.concatenate(row_groups)].reset_index(drop=True)
    names: npt.NDArray[np.object_] = np.array([f"{i:05d}" for i in range(n)], dtype=object)
    sample["participant"] = np.repeat(names, [len(rows) for rows in row_groups])
    return sample


def _difference(
    finding: Finding, rows: pd.DataFrame, levels: Mapping[str, tuple[Any, ...]]
) -> tuple[float, float]:
    """Return mean difference and dz of two levels within people; NaN for anything else."""
    compare = finding.compare
    if compare.test in AGREEMENT:
        return float("nan"), float("nan")
    if len(compare.within) != 1 or compare.between or len(levels[compare.within[0]]) != 2:
        return float("nan"), float("nan")
    factor, measure = compare.within[0], finding.measure
    if measure.of_cell is not None:
        rows = aggregate_cells(rows, [measure], [factor])
    return _off(rows, factor, compare.dv, *levels[factor])


def _off(
    rows: pd.DataFrame, factor: str, column: str, first: Any, second: Any
) -> tuple[float, float]:
    """Return the mean difference of two levels over people, second minus first, and dz."""
    if column not in rows:
        return float("nan"), float("nan")
    wide = rows.pivot_table(index="participant", columns=factor, values=column)
    if first not in wide or second not in wide:
        return float("nan"), float("nan")
    off = (wide[second] - wide[first]).dropna()
    sd = float(off.std(ddof=1))
    return float(off.mean()), float(off.mean()) / sd if sd > 0 else float("nan")


def _trials_that_count(
    opened_study: OpenedStudy, experiment: StudyExperiment, rows: pd.DataFrame
) -> pd.DataFrame:
    """Return the trials that count by the study's rules."""
    planned_counts = {str(name): int(n) for name, n in rows.groupby("participant").size().items()}
    return opened_study.selection_of(experiment, rows, planned_counts=planned_counts).counted

"""Count what the replicates found and read the number of participants off the curve."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from visavis.analysis.power.contract import (
    ANYTHING,
    PRIMARY,
    PlannedTestResult,
    PowerStudy,
    Source,
)
from visavis.analysis.power.replicates import PowerRequest, Replicate
from visavis.analysis.statistics import PowerCurve, power_curve
from visavis.analysis.statistics.power_estimates import AdequacyRule, proportion_interval
from visavis.analysis.statistics.results import Row, number, threshold_text
from visavis.lab.errors import UsageError

MAX_PARTING = 0.05
"""How far simulated power may lie from the closed form without a warning."""


@dataclass(frozen=True)
class TestPower:
    """Power of one planned test.

    `untestable` counts replicates, by number of participants, in which the test could not be made.
    `difference` and `standardised` are means over the replicates at the largest number.
    `printed_power` is the closed-form power of the statistic that a source printed, by number of
    participants.
    """

    __test__ = False  # not a test of pytest's

    name: str
    claim: str
    curve: PowerCurve
    untestable: tuple[int, ...]
    difference: float
    standardised: float
    printed_power: tuple[float, ...] = ()


@dataclass(frozen=True)
class PowerSummary:
    """Power of every test shown; the first decides."""

    study: str
    source: Source
    people_are_simulated: bool
    request: PowerRequest
    rule_of_significance: str
    effect_meaning: str
    tests: tuple[TestPower, ...]
    notes: tuple[str, ...] = ()

    @property
    def smallest_n(self) -> int | None:
        """The smallest adequate number of participants for the first test."""
        return self.tests[0].curve.smallest

    def rows(self) -> Iterator[Row]:
        """Yield one flat row per test and number of participants."""
        for test in self.tests:
            closed_forms = test.printed_power or (None,) * len(test.untestable)
            columns = zip(test.curve.rows(), test.untestable, closed_forms, strict=True)
            for row, n_untestable, closed_form in columns:
                yield {
                    "study": self.study,
                    "test": test.name,
                    **row,
                    "not_testable": n_untestable,
                    "power_of_printed": closed_form,
                    "target": test.curve.target,
                    "rule": test.curve.rule,
                    "alpha": self.request.alpha,
                    "effect": self.request.effect,
                    "source": self.source,
                    "seed": self.request.seed,
                    "is_simulated": True,
                    "people_are_simulated": self.people_are_simulated,
                }

    def sentence(self) -> str:
        """Return the answer in words."""
        first = self.tests[0]
        how = (
            "whole simulated studies"
            if self.source == "studies"
            else f"studies resampled from a {self.source}"
        )
        if self.request.effect == 0:
            point = first.curve.points[-1]
            low, high = point.interval.low, point.interval.high
            return (
                f"{first.claim}: significant in {point.power:.3f} of studies without an effect "
                f"(n = {self.request.numbers[-1]}, 95% CI [{low:.3f}, {high:.3f}]); "
                f"α = {self.request.alpha:g} is nominal; {how}, {self.rule_of_significance}."
            )
        return (
            f"{first.claim}: {first.curve.sentence()}; {how}, "
            f"effect × {self.request.effect:g}, {self.rule_of_significance}."
        )


def summarise(
    study: PowerStudy,
    request: PowerRequest,
    replicates: Iterable[Replicate],
    *,
    source: Source,
    people_are_simulated: bool,
    target: float = 0.8,
    rule: AdequacyRule = "lower bound",
    notes: tuple[str, ...] = (),
) -> PowerSummary:
    """Make the curves; replicates may come in any order, the result does not depend on it.

    `rule` "lower bound" asks the lower end of the Monte-Carlo interval to reach `target`,
    "estimate" the share itself.
    """
    if not 0 < target < 1:
        raise UsageError(f"the power to reach lies between 0 and 1, got {target:g}")
    by_number = sorted(replicates, key=lambda r: r.number)
    tests = tuple(_of_test(study, request, by_number, name, target, rule) for name in request.tests)
    return PowerSummary(
        study.name,
        source,
        people_are_simulated,
        request,
        study.rule(request.alpha),
        study.effect_meaning(request.effect, source),
        tests,
        (
            *_anything_notes(request, by_number),
            *_primary_notes(study, request),
            *_notes(tests, request, len(by_number), rule, target),
            *_printed_notes(study, tests, request),
            *notes,
        ),
    )


def _anything_notes(request: PowerRequest, replicates: list[Replicate]) -> Iterator[str]:
    """Say, without an effect, how often a study finds anything: the error rate of its headlines."""
    if request.effect != 0 or len(request.tests) < 2 or not replicates:
        return
    n = request.numbers[-1]
    whole = [name for name in (PRIMARY, ANYTHING) if name in request.tests]
    single = [name for name in request.tests if name not in whole]
    for name in whole:
        of = "a primary claim" if name == PRIMARY else "any planned test, secondary ones included,"
        yield (
            f"without an effect, {of} finds something in {_share(replicates, n, [name])}; a claim "
            "in part or the other way round counts, equivalence, which then holds, does not"
        )
    if not whole:
        yield (
            f"without an effect, any of these {len(single)} tests succeeds in "
            f"{_share(replicates, n, single)}; claims succeed in one direction only, and one of "
            "equivalence holds then"
        )


def _share(replicates: list[Replicate], n: int, names: list[str]) -> str:
    """Return in how many studies of n people one of some tests was significant."""
    hits = sum(
        any(r.verdicts[n][name].is_significant is True for name in names) for r in replicates
    )
    share = proportion_interval(hits, len(replicates))
    return (
        f"{hits / len(replicates):.3f} of studies (n = {n}, 95% CI [{share.low:.3f}, "
        f"{share.high:.3f}])"
    )


def _primary_notes(study: PowerStudy, request: PowerRequest) -> Iterator[str]:
    """Say which claims are primary, where the first test, which decides, is none of them."""
    primary = study.primary_tests
    if primary and request.tests[0] not in (*primary, PRIMARY, ANYTHING):
        yield (
            f"{request.tests[0]}, off which the number of participants is read, is secondary; the "
            f"primary claims are {', '.join(primary)}: --test {primary[0]}"
        )


def _of_test(
    study: PowerStudy,
    request: PowerRequest,
    replicates: list[Replicate],
    name: str,
    target: float,
    rule: AdequacyRule,
) -> TestPower:
    results: dict[int, list[PlannedTestResult]] = {
        n: [r.verdicts[n][name] for r in replicates] for n in request.numbers
    }
    curve = power_curve(
        {
            n: (sum(f.is_significant is True for f in all_), len(all_))
            for n, all_ in results.items()
        },
        target=target,
        rule=rule,
    )
    last = results[request.numbers[-1]]
    return TestPower(
        name,
        study.tests[name],
        curve,
        tuple(sum(f.is_significant is None for f in results[n]) for n in request.numbers),
        _mean([f.difference for f in last]),
        _mean([f.standardised for f in last]),
        _printed_power(study, request, name),
    )


def _printed_power(study: PowerStudy, request: PowerRequest, name: str) -> tuple[float, ...]:
    """Return closed-form power of what a source printed; nothing for another effect than that."""
    test = study.printed_tests.get(name)
    if test is None or request.effect != 1:
        return ()
    return tuple(test.power(n, request.alpha) for n in request.numbers)


def _printed_notes(
    study: PowerStudy, tests: tuple[TestPower, ...], request: PowerRequest
) -> Iterator[str]:
    """Quote closed-form power beside the simulated one, and warn where they part."""
    for test in tests:
        if not test.printed_power:
            continue
        pairs = list(zip(test.curve.points, test.printed_power, strict=True))
        powers = ", ".join(f"{number(power)} at {point.n}" for point, power in pairs)
        printed = study.printed_tests[test.name].text
        note = f"{test.claim}: the printed {printed} alone has power {powers}"
        deviations = [(p, power) for p, power in pairs if abs(p.power - power) > MAX_PARTING]
        by_chance = [p.n for p, power in deviations if p.interval.low <= power <= p.interval.high]
        if deviations:
            chance = (
                f" (at n = {_number_list(by_chance)} replicates are too few to tell it from chance)"
            )
            note += (
                f"; WARNING: simulated people part from it by more than {number(MAX_PARTING)} at "
                f"n = {_number_list([p.n for p, _ in deviations])}{chance if by_chance else ''}: "
                f"plan with the smaller power of the two{_why_parted(study, test, request)}"
            )
        yield note


def _number_list(numbers: list[int]) -> str:
    return ", ".join(map(str, numbers))


def _why_parted(study: PowerStudy, test: TestPower, request: PowerRequest) -> str:
    """Say how much of the parting is the size of the difference, and how much its shape."""
    printed_test = study.printed_tests[test.name]
    last = request.numbers[-1]
    # dz of a few people is too large on average (Hedges)
    dz = abs(test.standardised) * (1 - 3 / (4 * (last - 1) - 1))
    if not np.isfinite(dz) or not np.isfinite(printed_test.dz):
        return ""
    alone = ", ".join(
        f"{number(printed_test.of_dz(dz).power(n, request.alpha))} at {n}" for n in request.numbers
    )
    return (
        f". They differ by dz {number(dz)}, the printed statistic by {number(printed_test.dz)}: "
        f"that alone gives {alone}; the rest is the shape of their differences, which are not "
        "normal"
    )


def _mean(values: list[float]) -> float:
    finite = np.array([v for v in values if np.isfinite(v)])
    return float(finite.mean()) if finite.size else float("nan")


def _notes(
    tests: tuple[TestPower, ...],
    request: PowerRequest,
    replicates: int,
    rule: AdequacyRule,
    target: float,
) -> tuple[str, ...]:
    notes = [
        "the study of n is the first n participants of each replicate's largest study, so the "
        "points of a curve share participants and go up and down together"
    ]
    if len(tests) > 1:
        notes.append(f"the number of participants is read off the first test, {tests[0].name}")
    lowest = tests[0].curve.points[0]
    if tests[0].curve.smallest == lowest.n:
        notes.append(f"the smallest n simulated ({lowest.n}) is adequate already; try smaller ones")
    if rule == "lower bound":
        most = 1 / (1 + 3.8414588 / replicates)  # Wilson's lower end when every replicate hits
        if most < target:
            notes.append(
                f"with {replicates} replicates the interval cannot lie above "
                f"{number(target)} even if all of them find it; ask for more"
            )
    for test in tests:
        if any(test.untestable):
            counts = ", ".join(
                f"{u} at n = {n}"
                for n, u in zip(request.numbers, test.untestable, strict=True)
                if u
            )
            notes.append(f"{test.name} could not be tested in {counts} of {replicates} replicates")
    return tuple(notes)


def target_text(target: float, rule: AdequacyRule) -> str:
    """Return the rule of adequacy in words."""
    what = "the lower end of its 95% Monte-Carlo interval" if rule == "lower bound" else "power"
    return (
        f"smallest n from which {what} stays at or above {threshold_text(target)} "
        "for every larger n simulated"
    )

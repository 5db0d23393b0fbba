"""The study's questions answered in words, each by a stated rule."""

from collections.abc import Sequence
from dataclasses import replace

from visavis.analysis.report.blocks import Status
from visavis.analysis.report.notation import count_of
from visavis.experiments.stare.comparisons import DWELL, FIXATION_COUNT
from visavis.results.family_tests import CorrelationTest, PairTest, find_test
from visavis.study.sections import Conclusion

STARED_AT = ("D", "AD", "DA")
"""Conditions in which the active agent looks at the participant for some time."""

RULE = (
    "An effect of gaze counts as found when dwell time and fixation count both differ "
    "significantly, after correction, in the direction the hypothesis names; as partly found when "
    "one of them does and the other does not differ significantly; as the other way round when "
    "what differs significantly does so in the other direction only; as mixed when the two "
    "measures differ significantly in opposite directions. Less looking with more social anxiety "
    "counts as found when dwell time falls with the score (negative Spearman coefficient, p below "
    "the threshold after Holm's correction over all correlations) under D, AD and DA; as partly "
    "found when it does in one or two of them; as the other way round when it rises in at least "
    "one and falls in none; as mixed when it does both. Otherwise the answer is “not significant” "
    "with the number of participants, which is not proof of absence, or “undecided” when a test "
    "was not made or could not have reached its threshold with that number whatever the data (an "
    "exact Wilcoxon test of n differences cannot give less than p = 2/2ⁿ)."
)


def conclude(
    comparisons: Sequence[PairTest], anxiety: Sequence[CorrelationTest]
) -> tuple[Conclusion, ...]:
    """Answer hypothesis 1 in its static and two dynamic forms, and hypothesis 2."""
    return (
        _effect("stare-effect", "Stare-in-the-crowd effect", ("A", "D"), comparisons),
        _effect(
            "caught-staring", "Being caught staring (averted to directed)", ("A", "AD"), comparisons
        ),
        _effect(
            "catching-staring",
            "Catching someone staring (directed to averted)",
            ("A", "DA"),
            comparisons,
        ),
        _anxiety(anxiety),
    )


def _effect(
    name: str, question: str, pair: tuple[str, str], comparisons: Sequence[PairTest]
) -> Conclusion:
    """Answer whether both measures differ in the direction of the hypothesis."""
    return replace(_answer(question, pair, comparisons), name=name)


def _answer(question: str, pair: tuple[str, str], comparisons: Sequence[PairTest]) -> Conclusion:
    tests = [find_test(comparisons, measure.column, pair) for measure in (DWELL, FIXATION_COUNT)]
    evidence = tuple(t.sentence() for t in tests)
    if any(t.outcome is None for t in tests):
        return Conclusion("undecided", question, "not tested", evidence, was_tested=False)
    more = [t.measure.words.lower() for t in tests if t.is_significant and t.direction > 0]
    less = [t.measure.words.lower() for t in tests if t.is_significant and t.direction < 0]
    out_of_reach = [t.measure.words.lower() for t in tests if not t.can_reach]
    n = min(t.n_pairs for t in tests)
    by_how_much = "; ".join(t.which_way() for t in tests)
    if more and less:
        answer = f"mixed (more {more[0]}, less {less[0]}: {by_how_much})"
        return Conclusion("not_found", question, answer, evidence)
    if less:
        where = "" if len(less) == len(tests) else f" for {less[0]} only"
        answer = f"significant, but the other way round{where} ({by_how_much})"
        return Conclusion("reversed", question, answer, evidence)
    if len(more) == len(tests):
        return Conclusion("found", question, f"found ({by_how_much})", evidence)
    if more:
        answer = f"found for {more[0]} only ({by_how_much})"
        return Conclusion("partly", question, answer, evidence)
    return _nothing_found(question, n, out_of_reach, len(tests), evidence, by_how_much)


def _nothing_found(
    question: str,
    n: int,
    out_of_reach: Sequence[str],
    tests: int,
    evidence: tuple[str, ...],
    by_how_much: str,
) -> Conclusion:
    """Conclude without any significant test; `out_of_reach` names tests that could not be."""
    if out_of_reach:
        where = "" if len(out_of_reach) == tests else f" for {', '.join(out_of_reach)}"
        answer = f"undecided: n = {n} cannot reach the threshold{where}"
        return Conclusion("undecided", question, answer, evidence)
    answer = f"not significant with n = {n} ({by_how_much})"
    return Conclusion("not_found", question, answer, evidence)


def _anxiety(correlations: Sequence[CorrelationTest]) -> Conclusion:
    question = "Less looking with more social anxiety"
    dwell = [c for c in correlations if c.measure == DWELL and c.level in STARED_AT]
    evidence = tuple(c.sentence() for c in dwell)
    with_outcome = [(c, c.outcome.r) for c in dwell if c.outcome is not None]
    if not with_outcome:
        return Conclusion("undecided", question, "not tested", evidence, was_tested=False)
    falling = [(c, r) for c, r in with_outcome if c.is_significant and r < 0]
    rising = [(c, r) for c, r in with_outcome if c.is_significant and r > 0]
    if rising:
        listed = _correlation_list([*falling, *rising])
        if falling:
            return Conclusion("not_found", question, f"mixed ({listed})", evidence)
        answer = f"significant, but the other way round ({listed})"
        return Conclusion("reversed", question, answer, evidence)
    if falling:
        of_all = f"{len(falling)} of {count_of(len(dwell), 'condition')}"
        answer = f"found in {of_all} ({_correlation_list(falling)})"
        status: Status = "found" if len(falling) == len(dwell) else "partly"
        return Conclusion(status, question, answer, evidence)
    out_of_reach = [c.level for c, _ in with_outcome if not c.can_reach]
    n = min(c.n for c, _ in with_outcome)
    listed = _correlation_list(with_outcome)
    return _nothing_found(question, n, out_of_reach, len(with_outcome), evidence, listed)


def _correlation_list(correlations: Sequence[tuple[CorrelationTest, float]]) -> str:
    return "; ".join(f"{c.level} {c.coefficient()}" for c, _ in correlations)

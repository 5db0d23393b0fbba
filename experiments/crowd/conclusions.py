"""The study's hypotheses answered in words, each by a stated rule."""

from collections.abc import Sequence
from typing import Final

from visavis.analysis.report.blocks import Status
from visavis.analysis.report.notation import decimal, signed
from visavis.analysis.statistics.adjust import adjust_p
from visavis.analysis.statistics.results import p_text, percent
from visavis.experiments.crowd.comparisons import (
    COLLISIONS,
    PRIMARY,
    RATINGS,
    SPEED,
    TO_GAP,
    VOLUME,
)
from visavis.experiments.crowd.design import AFTER, BEFORE, HAPTIC
from visavis.experiments.crowd.paths import GroupPaths
from visavis.results.analysis import StudyAnalysis
from visavis.results.differences import difference_of_means, means_of_levels
from visavis.results.findings import Finding
from visavis.study.measures import Measure
from visavis.study.sections import Conclusion

RULE: Final = (
    "A hypothesis about two blocks counts as found when every measure it names differs "
    "significantly between them (post-hoc, Bonferroni over three pairs, after a test over blocks "
    "that is significant after Holm's correction over the four measures of movement) in the "
    "direction it names, as partly found when some do and none differs the "
    "other way, as the other way round when one does, otherwise as not found; as undecided when a "
    "test could not be made. Ratings count as changed (partly found) when a test over blocks is "
    "significant after Holm's correction over all of them. Equal paths count as found when the "
    "person-wise excess of similarity within a block lies within the bounds (two one-sided tests) "
    "for every pair of blocks, as partly found for some."
)
CAREFUL: Final = "Do people move more carefully with haptics? (H2₁)"
FEWER: Final = "Fewer collisions and smaller volumes with haptics? (H2₂)"
OUTLASTS: Final = "Does care outlast the haptics? (H3)"
RATINGS_CHANGE: Final = "Do presence and embodiment change with haptics? (H4)"
QUESTIONS: Final = {
    "careful": "shoulders turn more towards gaps and speed falls with haptics",
    "fewer-collisions": "collisions and volumes both fall with haptics",
    "care-outlasts": "fewer collisions and more shoulder rotation in the last block",
}
"""Questions whose power can be simulated; paths need recordings, ratings have no direction."""


def movement_p(analysis: StudyAnalysis) -> dict[str, float]:
    """Return p of the tests over blocks of what people do, by measure, after Holm's correction.

    The hypotheses about movement are the study's primary claims: together they find something by
    chance in at most alpha of studies. Single tests stay as the source made them.
    """
    findings = [(m.column, f) for m in PRIMARY if (f := analysis.finding(m.column)) is not None]
    p_by_measure = {column: f.terms[0].p for column, f in findings if f.terms}
    corrected = adjust_p(list(p_by_measure.values()), "holm") if p_by_measure else ()
    return dict(zip(p_by_measure, map(float, corrected), strict=True))


def conclude(analysis: StudyAnalysis) -> tuple[Conclusion, ...]:
    """Answer hypotheses 1 to 4 of the source."""
    return (
        _paths(analysis),
        _direction(analysis, "careful", CAREFUL, (BEFORE, HAPTIC), ((TO_GAP, -1), (SPEED, 1))),
        _direction(
            analysis, "fewer-collisions", FEWER, (BEFORE, HAPTIC), ((COLLISIONS, 1), (VOLUME, 1))
        ),
        _direction(
            analysis, "care-outlasts", OUTLASTS, (BEFORE, AFTER), ((COLLISIONS, 1), (TO_GAP, -1))
        ),
        _ratings(analysis),
    )


def _paths(analysis: StudyAnalysis) -> Conclusion:
    question = "The same paths in every block? (H1)"
    groups: Sequence[GroupPaths] = analysis.further or ()
    if not groups:
        return Conclusion("undecided", question, "not tested", (), was_tested=False)
    sentences = []
    same = []
    equivalence = groups[0].paths.equivalence
    for result in equivalence:
        names = f"{result.pair[0]} and {result.pair[1]}"
        if result.test is None:
            sentences.append(f"{names}: not tested, {result.problem}.")
            continue
        same.append(result.test.is_equivalent)
        sentences.append(f"{names}: {result.test.sentence()}.")
    evidence = tuple(sentences)
    if len(same) < len(equivalence) or not same:
        return Conclusion("undecided", question, "undecided", evidence, was_tested=False)
    if all(same):
        answer = f"equivalent within ±{analysis.thresholds.dice_bound:g} of Dice similarity"
        return Conclusion("found", question, answer, evidence)
    answer = "for some pairs of blocks" if any(same) else "not shown"
    return Conclusion("partly" if any(same) else "not_found", question, answer, evidence)


def _direction(
    analysis: StudyAnalysis,
    name: str,
    question: str,
    pair: tuple[str, str],
    measures: Sequence[tuple[Measure, int]],
) -> Conclusion:
    """`measures` with the expected sign of first minus second."""
    verdicts: list[int] = []
    sentences, differences = [], []
    corrected_p = movement_p(analysis)
    for measure, sign in measures:
        finding = analysis.finding(measure.column)
        contrast = None if finding is None else finding.contrast(pair)
        if finding is None or finding.outcome is None or contrast is None:
            why = "not measured" if finding is None else finding.why_not or "not compared"
            sentences.append(f"{measure.words}: not tested, {why}.")
            continue
        over_all = " ".join(finding.outcome.sentences)
        over_movement, overall = corrected_p[measure.column], finding.terms[0]
        is_lost = overall.is_significant and over_movement >= overall.alpha
        not_any_more = ", not significant any more" if is_lost else ""
        sentences.append(
            f"{measure.words}: {over_all} Over the {len(corrected_p)} measures of movement, "
            f"corrected (holm): {p_text(over_movement)}{not_any_more}. {contrast.sentence}"
        )
        differences.append(_difference(measure, finding, pair))
        as_said = 1 if sign * contrast.difference > 0 else -1
        is_found = contrast.is_significant and over_movement < finding.compare.alpha
        verdicts.append(as_said if is_found else 0)
    evidence = tuple(sentences)
    if len(verdicts) < len(measures):
        return Conclusion("undecided", question, "undecided", evidence, was_tested=False, name=name)
    status: Status = "not_found"
    if all(v == 1 for v in verdicts):
        status, answer = "found", "yes"
    elif -1 in verdicts:
        status = "reversed"
        answer = "significant, but the other way round" + (" in part" if 1 in verdicts else "")
    elif 1 in verdicts:
        status, answer = "partly", "in part"
    else:
        answer = "no significant difference"
    answer = f"{answer} ({pair[1]} minus {pair[0]}: {'; '.join(differences)})"
    return Conclusion(status, question, answer, evidence, name=name)


def _ratings(analysis: StudyAnalysis) -> Conclusion:
    findings = [(m, f) for m in RATINGS if (f := analysis.finding(m.column)) is not None]
    tested_findings = [(m, f) for m, f in findings if f.outcome is not None]
    sentences = tuple(
        f"{m.words}: "
        + (f"not tested, {f.why_not}." if f.outcome is None else " ".join(f.outcome.sentences))
        for m, f in findings
    )
    if not tested_findings:
        return Conclusion("undecided", RATINGS_CHANGE, "undecided", sentences, was_tested=False)
    different = [
        _rating_by_block(m, f) for m, f in tested_findings if any(t.is_significant for t in f.terms)
    ]
    if different:
        return Conclusion("partly", RATINGS_CHANGE, "; ".join(different), sentences)
    ratings = "; ".join(_rating_by_block(m, f) for m, f in tested_findings)
    answer = f"no significant difference ({ratings})"
    return Conclusion("not_found", RATINGS_CHANGE, answer, sentences)


def _rating_by_block(measure: Measure, finding: Finding) -> str:
    """Return a rating with its mean in every block, in their order, and how haptics change it."""
    means = means_of_levels(finding, finding.terms[0])
    words = f"{measure.words.lower()} {', '.join(decimal(mean) for mean in means.values())}"
    change = _difference(measure, finding, (BEFORE, HAPTIC)).removeprefix(measure.words.lower())
    return f"{words}, {HAPTIC} minus {BEFORE}{change}"


def _difference(measure: Measure, finding: Finding, pair: tuple[str, str]) -> str:
    """Return a measure with the second block minus the first, and the interval of that."""
    value, interval = difference_of_means(finding, {"condition": (pair[1], pair[0])})
    unit = "" if measure.unit == "1" else f" {measure.unit}"
    between = ""
    if interval is not None:
        ends = ", ".join(signed(v) for v in (interval.low, interval.high))
        between = f", {percent(interval.level)} CI [{ends}]"
    return f"{measure.words.lower()} {signed(value)}{unit}{between}"

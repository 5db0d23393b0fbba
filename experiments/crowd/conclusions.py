"""The study's hypotheses answered in words, each by a stated rule."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from analysis.report.blocks import Status
from analysis.report.notation import decimal, probability
from experiments.crowd.analysis import CrowdAnalysis, GroupAnalysis
from experiments.crowd.comparisons import MeasureComparison
from experiments.crowd.design import AFTER, BEFORE, CONDITIONS, HAPTIC
from experiments.crowd.terms import (
    BLOCK_NAMES,
    COLLISIONS,
    PAIRS,
    RATINGS,
    SPEED,
    TO_GAP,
    VOLUME,
    Measure,
)

RULE: Final = (
    "A hypothesis about two blocks counts as found when every measure it names differs "
    "significantly between them (post-hoc, Bonferroni over three pairs, after a significant test "
    "over blocks) in the direction it names, as partly found when some do and none differs the "
    "other way, otherwise as not found; as undecided when a test could not be made. Equal paths "
    "count as found when the person-wise excess of similarity within a block lies within the "
    "bounds (two one-sided tests) for every pair of blocks, as partly found for some."
)


@dataclass(frozen=True)
class Conclusion:
    """One hypothesis with its answer and the sentences it rests on."""

    status: Status
    question: str
    answer: str
    evidence: tuple[str, ...]

    @property
    def headline(self) -> str:
        """Question and answer in one line."""
        return f"{self.question}: {self.answer}"


def conclude(analysis: CrowdAnalysis) -> tuple[Conclusion, ...]:
    """Answer hypotheses 1 to 4 of the source."""
    main = analysis.main
    return (
        _paths(main),
        _direction(
            main,
            "Do people move more carefully with haptics? (H2₁)",
            (BEFORE, HAPTIC),
            ((TO_GAP, -1), (SPEED, 1)),
        ),
        _direction(
            main,
            "Fewer collisions and smaller volumes with haptics? (H2₂)",
            (BEFORE, HAPTIC),
            ((COLLISIONS, 1), (VOLUME, 1)),
        ),
        _direction(
            main,
            "Does care outlast the haptics? (H3)",
            (BEFORE, AFTER),
            ((COLLISIONS, 1), (TO_GAP, -1)),
        ),
        _ratings(main),
    )


def _paths(group: GroupAnalysis) -> Conclusion:
    question = "The same paths in every block? (H1)"
    sentences = []
    same = []
    for found in group.paths.equivalence:
        names = f"{found.pair[0]} and {found.pair[1]}"
        if found.test is None:
            sentences.append(f"{names}: not tested, {found.problem}.")
            continue
        same.append(found.test.is_equivalent)
        sentences.append(f"{names}: {found.test.sentence()}.")
    if len(same) < len(PAIRS):
        return Conclusion("undecided", question, "undecided", tuple(sentences))
    if all(same):
        return Conclusion("found", question, "equivalent within the bounds", tuple(sentences))
    answer = "for some pairs of blocks" if any(same) else "not shown"
    return Conclusion("partly" if any(same) else "not_found", question, answer, tuple(sentences))


def _direction(
    group: GroupAnalysis,
    question: str,
    pair: tuple[str, str],
    measures: Sequence[tuple[Measure, int]],
) -> Conclusion:
    """`measures` with the expected sign of first minus second."""
    verdicts: list[int | None] = []
    sentences = []
    for measure, sign in measures:
        found = group.comparison(measure)
        verdict = found.differs(pair)
        sentences.append(sentence_of(found, pair))
        if verdict is None:
            verdicts.append(None)
        elif not verdict:
            verdicts.append(0)
        else:
            a, b = (CONDITIONS.index(c) for c in pair)
            verdicts.append(1 if sign * (found.means[a] - found.means[b]) > 0 else -1)
    evidence = tuple(sentences)
    if None in verdicts:
        return Conclusion("undecided", question, "undecided", evidence)
    if all(v == 1 for v in verdicts):
        return Conclusion("found", question, "yes", evidence)
    if -1 in verdicts:
        return Conclusion("not_found", question, "no, the other way in part", evidence)
    if 1 in verdicts:
        return Conclusion("partly", question, "in part", evidence)
    return Conclusion("not_found", question, "no significant difference", evidence)


def _ratings(group: GroupAnalysis) -> Conclusion:
    question = "Do presence and embodiment change with haptics? (H4)"
    found = [group.comparison(m) for m in RATINGS]
    tested = [c for c in found if c.test is not None]
    sentences = tuple(
        f"{c.measure.label}: {c.test.sentence()}"
        if c.test is not None
        else f"{c.measure.label}: not tested, {c.problem}."
        for c in found
    )
    if not tested:
        return Conclusion("undecided", question, "undecided", sentences)
    different = [
        c.measure.label.lower() for c in tested if c.test is not None and c.test.significant
    ]
    if different:
        return Conclusion("partly", question, ", ".join(different), sentences)
    return Conclusion("not_found", question, "no significant difference", sentences)


def sentence_of(found: MeasureComparison, pair: tuple[str, str]) -> str:
    """Return the comparison of two blocks in one measure as a sentence."""
    label, unit = found.measure.label, found.measure.unit
    if found.test is None:
        return f"{label}: not tested, {found.problem}."
    a, b = (CONDITIONS.index(c) for c in pair)
    values = [decimal(found.means[k], found.measure.digits) for k in (a, b)]
    test = next(t for t in found.pairs if t.pair == pair)
    verdict = "differs" if found.differs(pair) else "does not differ significantly"
    unit = f" {unit}" if unit not in ("", "°") else unit
    over_blocks = found.test.test.sentence().removeprefix("block: ")
    return (
        f"{label} {verdict} between {pair[0]} ({BLOCK_NAMES[pair[0]]}) and {pair[1]}: "
        f"{values[0]}{unit} and {values[1]}{unit}, n = {len(found.people)}; over blocks, "
        f"{over_blocks}; post-hoc adjusted p {_equals(test.p)}."
    )


def _equals(p: float) -> str:
    text = probability(p)
    return text if text.startswith(("<", ">")) else f"= {text}"

"""Sections of the report on families of tests: every test with its source's result."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from visavis.analysis.report import (
    Block,
    Bullets,
    Cell,
    Column,
    Fold,
    Paragraph,
    Picture,
    Section,
    Table,
    Verdict,
)
from visavis.analysis.report.notation import (
    MISSING,
    count_of,
    decimal,
    fraction,
    interval,
    mean_sd,
    probability,
    threshold,
)
from visavis.results.analysis import StudyAnalysis
from visavis.results.family_tests import (
    Agreement,
    CorrelationTest,
    PairTest,
    agreement,
    count_agreement,
    same_verdicts,
)
from visavis.results.figures.family_figures import figure_names
from visavis.results.planned_tests import name_of_test
from visavis.study.pairs import Printed

HERE, SOURCE = "This study", "Published"
ARROWS = {1: "↗", -1: "↘"}
EFFECT_NAMES: Final = {"r_rb": "rank r"}
"""Shorter names of effect sizes, which the table's note explains."""


def family_verdicts(analysis: StudyAnalysis) -> tuple[Verdict, ...]:
    """Return the study's own conclusions; without any, the number of hits in each family.

    Those that hold no primary claim are secondary, and stand last.
    """
    primary = set(analysis.primary)
    if analysis.study.analysis.conclude_of is not None:
        # Where a study names no question, its conclusions cannot be ranked.
        ranks = not primary.isdisjoint(analysis.study.analysis.questions)
        answers = [
            Verdict(c.status, c.headline, " ".join(c.evidence), ranks and c.name not in primary)
            for c in analysis.conclusions
        ]
        return tuple(sorted(answers, key=lambda verdict: verdict.is_secondary))
    verdicts: list[Verdict] = []
    for family in dict.fromkeys(r.of.family for r in analysis.results if not r.of.exploratory):
        tests = analysis.tests_of(family)
        with_outcome = [t for t in tests if t.outcome is not None]
        hits = [t for t in with_outcome if t.is_significant]
        found_of = f"{len(hits)} of {count_of(len(with_outcome), 'test')} significant"
        headline = f"{family.capitalize()}: {found_of if with_outcome else 'not tested'}"
        headline += f" ({'; '.join(t.which_way() for t in hits)})" if hits else ""
        evidence = " ".join(t.sentence() for t in hits or tests[:1])
        verdicts.append(
            Verdict(
                "found" if hits else "not_found" if with_outcome else "undecided",
                headline,
                evidence,
                primary.isdisjoint(name_of_test(t) for t in tests),
            )
        )
    return tuple(sorted(verdicts, key=lambda verdict: verdict.is_secondary))


NEITHER: Final = "○ neither"
NEITHER_NOTE: Final = f"{NEITHER}: not significant there nor here, which shows no agreement."
FITTED_NOTE: Final = (
    " The people are simulated and fitted to the published study: agreement shows that recording "
    "and analysis work, and is no evidence about people."
)


def agreement_table(analysis: StudyAnalysis) -> Table | None:
    """Return how many published verdicts are replicated, by family; None where none is printed."""
    rows = []
    for family in analysis.families():
        tests = analysis.tests_of(family)
        count = count_agreement(tests)
        if count.published_count:
            where = dict.fromkeys(
                t.published_result.where for t in tests if t.published_result is not None
            )
            words = next(r.of.words for r in analysis.results if r.of.family == family)
            rows.append((words or family, str(count), ", ".join(filter(None, where))))
    if not rows:
        return None
    return Table(
        (Column("Family of tests"), Column("Verdicts that agree", "right"), Column("Published in")),
        tuple(rows),
        "Agreement with the published study",
        "Verdicts agree when both are not significant (which by itself shows no agreement of "
        "effects), or both are, in the same direction. "
        "Undecided: not tested, or so few participants that the test cannot reach its threshold."
        + fitted_note(analysis),
    )


def fitted_note(analysis: StudyAnalysis) -> str:
    """Return what agreement with a source means where people are simulated; else an empty text."""
    return FITTED_NOTE if analysis.is_simulated else ""


def family_sections(
    analysis: StudyAnalysis, pictures: Mapping[str, Picture]
) -> tuple[Section, ...]:
    """Return a section for each family, and one on the robustness of verdicts."""
    sections = []
    for family in analysis.families():
        pairs, correlations = analysis.pairs_of(family), analysis.correlations_of(family)
        blocks: list[Block] = [pictures[n] for n in figure_names(family) if n in pictures]
        blocks += [
            _pair_table([t for t in pairs if (t.first, t.second) == pair])
            for pair in dict.fromkeys((t.first, t.second) for t in pairs)
        ]
        if correlations:
            blocks.append(_correlation_table(correlations))
        sentences = tuple(t.sentence() for t in analysis.tests_of(family))
        blocks.append(Fold(f"All {len(sentences)} conclusions in words", (Bullets(sentences),)))
        words = next(r.of.words for r in analysis.results if r.of.family == family)
        if words:
            blocks.insert(0, Paragraph(f"{words[:1].upper()}{words[1:]}."))
        sections.append(Section(figure_names(family)[0], family.capitalize(), tuple(blocks)))
    return (*sections, *_robustness(analysis))


def _robustness(analysis: StudyAnalysis) -> tuple[Section, ...]:
    again = analysis.without_rules
    if not again:
        return ()
    family = again[0].of.family
    main = analysis.pairs_of(family)
    trials = analysis.selection.finished
    text = (
        f"Without any exclusion ({count_of(len(trials), 'trial')} of "
        f"{count_of(trials['participant'].nunique(), 'participant')}), "
        f"{same_verdicts(again, main)} of {len(main)} verdicts ({family}) are the same as in the "
        "main analysis."
    )
    blocks: list[Block] = [Paragraph(text)]
    if analysis.sensitivity:
        blocks.append(_sensitivity_table(analysis))
    return (Section("robustness", "Robustness", tuple(blocks)),)


def _pair_table(tests: Sequence[PairTest]) -> Table:
    """Return the tests of two levels, one row per measure (and place)."""
    of, first, second = tests[0].of, tests[0].first, tests[0].second
    beside = any(t.published_result is not None for t in tests)
    columns = [
        Column("Measure"),
        Column(first, "right", HERE),
        Column("", "centre", HERE),
        Column(second, "right", HERE),
        Column("n", "right", HERE),
        Column(f"Statistic, {first} − {second}", "right", HERE),
        Column("p", "right", HERE),
        Column("", "tight", HERE),
        Column(f"Effect, {first} − {second} [CI]", "right", HERE),
        Column("η²p", "right", HERE),
    ]
    if beside:
        columns += [
            Column(f"t, {first} − {second}", "right", SOURCE),
            Column("p", "right", SOURCE),
            Column("", "tight", SOURCE),
            Column("η²p", "right", SOURCE),
            Column("Verdict", "centre"),
        ]
    rows = tuple((*_pair_cells(t), *(_printed_cells(t) if beside else ())) for t in tests)
    stars = [threshold(tests[0].threshold / divisor) for divisor in (1, 5, 50)]
    where = ", ".join(
        dict.fromkeys(t.published_result.where for t in tests if t.published_result is not None)
    )
    return Table(
        tuple(columns),
        rows,
        f"{first} against {second}: {of.level_words(first)} and {of.level_words(second)}",
        "Mean (SD) over participants who have both values. "
        f"* p < {stars[0]}, ** p < {stars[1]}, *** p < {stars[2]} (alpha shared by "
        f"{count_of(tests[0].n_tests, 'test')}). t: paired t test with dz; V: Wilcoxon signed-rank "
        "test of the pairs that differ, with rank-biserial correlation (rank r)"
        + (f"; “wilc.”: the source prints no statistic. Published: {where}." if where else "."),
    )


def _name(test: PairTest) -> str:
    where = f", {test.where.replace('_', ' ')}" if test.where else ""
    unit = f" ({test.measure.unit})" if test.measure.unit not in ("", "1") else ""
    return f"{test.measure.words}{unit}{where}"


def _pair_cells(test: PairTest) -> tuple[Cell | str, ...]:
    digits = test.measure.digits
    first = mean_sd(test.first_mean, test.first_sd, digits)
    second = mean_sd(test.second_mean, test.second_sd, digits)
    if test.outcome is None:
        problem_cell = Cell("not tested", "weak", test.problem)
        return (
            _name(test),
            first,
            "",
            second,
            str(test.n_pairs),
            problem_cell,
            MISSING,
            "",
            MISSING,
            MISSING,
        )
    eta, effect = test.outcome.eta, test.outcome.effect
    bounds = (
        "" if effect.interval is None else f" {interval(effect.interval.low, effect.interval.high)}"
    )
    return (
        _name(test),
        first,
        Cell(ARROWS.get(test.direction, "") if test.is_significant else "", "strong"),
        second,
        str(test.n_pairs),
        Cell(test.statistic(), hint=test.sentence()),
        Cell(probability(test.outcome.p), "strong" if test.is_significant else ""),
        test.stars,
        f"{EFFECT_NAMES.get(effect.name, effect.name)} {decimal(effect.value)}{bounds}",
        MISSING if eta is None else fraction(eta.value),
    )


def _printed_cells(test: PairTest) -> tuple[Cell, ...]:
    printed_result = test.published_result or Printed(False)
    wilcoxon = printed_result.is_wilcoxon
    return (
        Cell("wilc." if wilcoxon else decimal(printed_result.statistic), "weak"),
        Cell(probability(printed_result.p), "weak"),
        Cell("*" * printed_result.stars, "weak"),
        Cell("wilc." if wilcoxon else fraction(printed_result.eta_p2), "weak"),
        verdict_cell(agreement(test)),
    )


def verdict_cell(verdicts: Agreement | None) -> Cell:
    """Return a cell that compares our verdict with the published one."""
    if verdicts is None:
        return Cell(MISSING, "weak")
    if verdicts.ours is not None and not verdicts.is_decidable:
        return Cell(
            "? undecided", "weak", "with so few participants the test cannot reach its threshold"
        )
    if verdicts.agrees is None:
        return Cell("not tested", "weak")
    if verdicts.agrees and not verdicts.ours:
        return Cell(NEITHER, "weak", "neither is significant, which shows no agreement")
    if verdicts.agrees:
        return Cell("✓ same", "agree")
    if verdicts.published_significant and verdicts.ours:
        return Cell("✗ opposite", "differ")
    return Cell("✗ only publ." if verdicts.published_significant else "✗ only here", "differ")


def _correlation_table(tests: Sequence[CorrelationTest]) -> Table:
    """Return the coefficients, one row per measure and a group of columns per level."""
    levels = list(dict.fromkeys(t.level for t in tests))
    beside = any(t.published_result is not None for t in tests)
    columns = [Column("Measure")]
    for level in levels:
        columns += [Column("rs", "right", level), Column("p", "right", level)]
        if beside:
            columns += [Column("publ. rs", "right", level), Column("", "left", level)]
    by_key = {(t.measure, t.level): t for t in tests}
    rows = []
    for measure in dict.fromkeys(t.measure for t in tests):
        row: list[Cell | str] = [measure.words]
        for level in levels:
            test = by_key[measure, level]
            if test.outcome is None:
                row += [Cell(MISSING, "weak", test.problem), Cell(MISSING, "weak")]
            else:
                p = Cell(probability(test.outcome.p), "strong" if test.is_significant else "")
                row += [Cell(fraction(test.outcome.r), hint=test.sentence()), p]
            if beside:
                printed_result, verdict = test.published_result, verdict_cell(agreement(test))
                unknown = printed_result is None or printed_result.r is None
                text = "n.s." if unknown else fraction(getattr(printed_result, "r", None))
                row += [Cell(text, "weak"), Cell(verdict.text[:1], verdict.mark, verdict.text)]
        rows.append(tuple(row))
    sizes = sorted({t.n for t in tests})
    n = f"n = {sizes[0]}" if len(sizes) == 1 else f"n = {sizes[0]} to {sizes[-1]}, by measure"
    return Table(
        tuple(columns),
        tuple(rows),
        f"Spearman correlations with {tests[0].of.score_name}",
        f"{n}. p before correction; bold is significant after Holm's over {tests[0].n_tests} tests "
        f"(threshold {threshold(tests[0].alpha)}); adjusted values are in statistics.csv."
        + (
            " n.s.: the source states no correlation. Its verdicts and ours before correction: "
            "✓ same, ○ neither significant, ✗ different, ? undecided, n not tested."
            if beside
            else ""
        ),
    )


def _sensitivity_table(analysis: StudyAnalysis) -> Table:
    """Return the first tests of the family for other paddings and minimum durations."""
    rows: list[tuple[Any, ...]] = []
    columns = [Column("Padding (°)", "right"), Column("Minimum fixation (ms)", "right")]
    for test in analysis.sensitivity[0].first_tests:
        group = test.measure.axis
        columns += [Column(n, "right", group) for n in (test.first, test.second, "p")]
    columns += [Column("Significant", "right"), Column("Verdict as in the main analysis", "right")]
    for r in analysis.sensitivity:
        cells: list[str] = []
        for test in r.first_tests:
            means = (test.first_mean, test.second_mean)
            cells += [decimal(mean, test.measure.digits) for mean in means]
            cells.append(probability(test.outcome.p if test.outcome else None))
        same = Cell(
            f"{r.same_verdicts} of {r.n_tests}", "" if r.same_verdicts == r.n_tests else "differ"
        )
        pad, minimum = decimal(r.pad_deg, 1), decimal(r.minimum_fixation_ms, 0)
        rows.append((pad, minimum, *cells, str(r.significant), same))
    return Table(
        tuple(columns),
        tuple(rows),
        "Sensitivity to the angular padding of heads and to the minimum fixation",
        "p before correction; the same trials as in the main analysis.",
    )

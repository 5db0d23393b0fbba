"""The report's tables: this study beside the published one, agreement marked."""

from collections.abc import Sequence

from analysis.report import Cell, Column, Table
from analysis.report.notation import (
    MISSING,
    counted,
    decimal,
    fraction,
    interval,
    mean_sd,
    percentage,
    probability,
    threshold,
)
from analysis.statistics import Effect
from experiments.stare import published
from experiments.stare.analysis import StareAnalysis
from experiments.stare.comparisons import mean_deviation_01
from experiments.stare.design import CONDITIONS, ZONES
from experiments.stare.terms import (
    CONDITION_NAMES,
    DWELL,
    FIRST_TIME,
    FIXATION_COUNT,
    MEASURES,
    short,
)
from stimuli.scenes.audience import ACTIVE_PLACES
from visavis.pairs import Agreement, PairTest, Printed, agreement, find_test

HERE, PRINTED = "This study", "Published"


def means_table(analysis: StareAnalysis) -> Table:
    """Return mean (SD) by measure and condition beside the published ones."""
    columns = [Column("Measure")]
    for condition in CONDITIONS:
        group = f"{condition}, {CONDITION_NAMES[condition]}"
        columns += [
            Column("here", "right", group),
            Column("publ.", "right", group),
            Column("Δ", "right", group),
        ]
    by_key = {(d.measure, d.condition): d for d in analysis.descriptives}
    rows = []
    for measure in MEASURES:
        row: list[Cell | str] = [short(measure)]
        for condition in CONDITIONS:
            here = by_key[measure, condition]
            printed = published.MEANS[condition][measure.column]
            row += [
                Cell(
                    mean_sd(here.mean, here.sd, measure.digits),
                    hint=counted(here.n, "participant"),
                ),
                Cell(mean_sd(printed.mean, printed.sd, measure.digits), "weak"),
                _signed_percentage(mean_deviation_01(here)),
            ]
        rows.append(tuple(row))
    n = sorted({d.n for d in analysis.descriptives})
    span = f"{n[0]}" if len(n) == 1 else f"{n[0]} to {n[-1]}"
    return Table(
        tuple(columns),
        tuple(rows),
        "Measures by condition, mean (SD) over participants",
        f"n = {span} here, {published.PARTICIPANTS} published; times and durations in ms. "
        "Δ: how far the mean lies from the published one.",
    )


def comparison_table(analysis: StareAnalysis, pair: tuple[str, str]) -> Table:
    """Return the six tests of one comparison beside the published table."""
    first, second = pair
    source = published.published_test(first, second, MEASURES[0].column).table
    columns = (
        Column("Measure"),
        Column(first, "right", HERE),
        Column("", "centre", HERE),
        Column(second, "right", HERE),
        Column("n", "right", HERE),
        Column(f"Statistic, {first} − {second}", "right", HERE),
        Column("p", "right", HERE),
        Column("", "tight", HERE),
        Column(f"Effect, {first} − {second} [95 % CI]", "right", HERE),
        Column("η²p", "right", HERE),
        Column(f"t, {first} − {second}", "right", PRINTED),
        Column("p", "right", PRINTED),
        Column("", "tight", PRINTED),
        Column("η²p", "right", PRINTED),
        Column("Verdict", "centre"),
    )
    rows = tuple(
        _comparison_row(find_test(analysis.comparisons, measure.column, pair))
        for measure in MEASURES
    )
    limit = analysis.parameters.alpha / 30
    one, two, three = (threshold(limit / divisor) for divisor in (1, 5, 50))
    return Table(
        columns,
        rows,
        f"{first} against {second}: {CONDITION_NAMES[first]} and {CONDITION_NAMES[second]}",
        "Mean (SD) over participants who have both values, times and durations in ms. "
        f"* p < {one}, ** p < {two}, *** p < {three}. t: paired t test with dz; "
        "V: Wilcoxon signed-rank test with "
        f"rank-biserial correlation; “wilc.”: the source prints no statistic. Published: {source}.",
    )


def _comparison_row(test: PairTest) -> tuple[Cell | str, ...]:
    printed = published.published_test(test.first, test.second, test.measure.column)
    digits = test.measure.digits
    wilcoxon = printed.t is None
    published_cells = (
        Cell("wilc." if wilcoxon else decimal(printed.t), "weak"),
        Cell(probability(printed.p), "weak"),
        Cell("*" * printed.stars, "weak"),
        Cell("wilc." if wilcoxon else fraction(printed.eta_p2), "weak"),
    )
    if test.outcome is None:
        return (
            short(test.measure),
            decimal(test.first_mean, digits),
            "",
            decimal(test.second_mean, digits),
            str(test.n_pairs),
            Cell("not tested", "weak", test.problem),
            *[MISSING, "", MISSING, MISSING],
            *published_cells,
            verdict_cell(agreement(test)),
        )
    eta = test.outcome.eta
    arrow = {1: "↗", -1: "↘"}.get(test.direction, "") if test.is_significant else ""
    return (
        short(test.measure),
        mean_sd(test.first_mean, test.first_sd, digits),
        Cell(arrow, "strong"),
        mean_sd(test.second_mean, test.second_sd, digits),
        str(test.n_pairs),
        Cell(_short_statistic(test), hint=test.sentence()),
        Cell(probability(test.outcome.p), "strong" if test.is_significant else ""),
        test.stars,
        _effect(test.outcome.effect),
        MISSING if eta is None else fraction(eta.value),
        *published_cells,
        verdict_cell(agreement(test)),
    )


def _short_statistic(test: PairTest) -> str:
    row = test.row()
    if test.outcome is not None and test.outcome.is_parametric:
        return f"t({row['df']:.0f}) = {decimal(_number(row['t']))}"
    return f"V = {decimal(_number(row['V']), 1)}"


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _effect(effect: Effect) -> str:
    text = decimal(effect.value)
    bounds = effect.interval
    return text if bounds is None else f"{text} {interval(bounds.low, bounds.high)}"


def verdict_cell(found: Agreement | None) -> Cell:
    """Return how our verdict stands to the published one."""
    if found is None:
        return Cell(MISSING, "weak")
    if found.ours is not None and not found.is_decidable:
        return Cell(
            "? undecided", "weak", "with so few participants the test cannot reach its threshold"
        )
    if found.agrees is None:
        return Cell("not tested", "weak")
    if found.agrees:
        return Cell("✓ same", "agree")
    if found.published and found.ours:
        return Cell("✗ opposite", "differ")
    return Cell("✗ only publ." if found.published else "✗ only here", "differ")


def places_table(analysis: StareAnalysis) -> Table:
    """Return A against D at the nine places."""
    columns = [Column("Place")]
    for measure in (DWELL, FIXATION_COUNT):
        columns += [
            Column("A", "right", measure.axis),
            Column("D", "right", measure.axis),
            Column("p", "right", measure.axis),
            Column("p publ.", "right", measure.axis),
            Column("Verdict", "centre", measure.axis),
        ]
    rows = []
    for place in ACTIVE_PLACES:
        row: list[Cell | str] = [place.replace("_", " ").capitalize()]
        for measure in (DWELL, FIXATION_COUNT):
            test = find_test(analysis.places, measure.column, ("A", "D"), place)
            row += [
                decimal(test.first_mean, measure.digits),
                decimal(test.second_mean, measure.digits),
                *_p_pair(test),
                verdict_cell(agreement(test)),
            ]
        rows.append(tuple(row))
    limit = threshold(analysis.parameters.alpha / len(ACTIVE_PLACES))
    return Table(
        tuple(columns),
        tuple(rows),
        "Averted against directed gaze at each place of the active agent",
        f"Mean over participants of their trials in the cell; threshold {limit} (alpha over nine "
        "places). Published: table A.4. Statistics and effect sizes are in statistics.csv.",
    )


def zones_table(analysis: StareAnalysis) -> Table:
    """Return the first fixation time by zone for the five comparisons."""
    columns = [Column("Zone")]
    for pair in published.COMPARISONS:
        group = f"{pair[0]} – {pair[1]}"
        columns += [
            Column("p", "right", group),
            Column("p publ.", "right", group),
            Column("", "tight", group),
        ]
    rows = []
    for zone in ZONES:
        row: list[Cell | str] = [zone.capitalize()]
        for pair in published.COMPARISONS:
            test = find_test(analysis.zones, FIRST_TIME.column, pair, zone)
            verdict = verdict_cell(agreement(test))
            row += [*_p_pair(test), Cell(verdict.text[:1], verdict.mark, verdict.text)]
        rows.append(tuple(row))
    limit = threshold(analysis.parameters.alpha / len(ZONES))
    return Table(
        tuple(columns),
        tuple(rows),
        "First fixation time by zone of the active agent",
        f"Threshold {limit} (alpha over three zones). Published: table A.5. ✓ same verdict, "
        "✗ different, ? undecided, n not tested.",
    )


def _p_pair(test: PairTest) -> tuple[Cell, Cell]:
    printed = test.printed or Printed(False)
    here = Cell(MISSING, "weak", test.problem)
    if test.outcome is not None:
        text = f"{probability(test.outcome.p)} {test.stars}".strip()
        here = Cell(text, "strong" if test.is_significant else "", test.sentence())
    return here, Cell(f"{probability(printed.p)} {'*' * printed.stars}".strip(), "weak")


def anxiety_table(analysis: StareAnalysis) -> Table:
    """Return Spearman's coefficients for every measure and condition."""
    columns = [Column("Measure")]
    for condition in CONDITIONS:
        columns += [
            Column("rs", "right", condition),
            Column("p", "right", condition),
            Column("publ. rs", "right", condition),
            Column("", "left", condition),
        ]
    by_key = {(c.measure, c.level): c for c in analysis.anxiety}
    rows = []
    for measure in MEASURES:
        row: list[Cell | str] = [short(measure)]
        for condition in CONDITIONS:
            found = by_key[measure, condition]
            printed = found.printed
            verdict = verdict_cell(agreement(found))
            here = (
                [Cell(MISSING, "weak", found.problem), Cell(MISSING, "weak")]
                if found.outcome is None
                else [
                    Cell(fraction(found.outcome.r), hint=found.sentence()),
                    Cell(probability(found.outcome.p), "strong" if found.is_significant else ""),
                ]
            )
            row += [
                *here,
                Cell(
                    "n.s." if printed is None or printed.r is None else fraction(printed.r), "weak"
                ),
                Cell(verdict.text[:1], verdict.mark, verdict.text),
            ]
        rows.append(tuple(row))
    sizes = sorted({c.n for c in analysis.anxiety})
    n = f"n = {sizes[0]}" if len(sizes) == 1 else f"n = {sizes[0]} to {sizes[-1]}, by measure"
    return Table(
        tuple(columns),
        tuple(rows),
        "Spearman correlations with the social anxiety score",
        f"{n}. p uncorrected with threshold {threshold(analysis.parameters.alpha)}, as in the "
        "source; Holm-adjusted values are in statistics.csv. n.s.: the source states no "
        "correlation. ✓ same verdict, ✗ different, ? undecided, n not tested.",
    )


def sensitivity_table(analysis: StareAnalysis) -> Table:
    """Return the main results for other paddings and minimum durations."""
    columns = (
        Column("Padding (°)", "right"),
        Column("Minimum fixation (ms)", "right"),
        Column("A", "right", "Dwell time (ms)"),
        Column("D", "right", "Dwell time (ms)"),
        Column("p", "right", "Dwell time (ms)"),
        Column("A", "right", "Fixation count"),
        Column("D", "right", "Fixation count"),
        Column("p", "right", "Fixation count"),
        Column("Significant", "right", "Thirty tests"),
        Column("Verdict as in the main analysis", "right", "Thirty tests"),
    )
    rows: tuple[tuple[Cell | str, ...], ...] = tuple(
        (
            decimal(r.pad_deg, 1),
            decimal(r.minimum_fixation_ms, 0),
            *(
                text
                for test in r.shown
                for text in (
                    decimal(test.first_mean, test.measure.digits),
                    decimal(test.second_mean, test.measure.digits),
                    probability(test.outcome.p if test.outcome else None),
                )
            ),
            str(r.significant),
            Cell(
                f"{r.same_verdicts} of {r.n_tests}",
                "" if r.same_verdicts == r.n_tests else "differ",
            ),
        )
        for r in analysis.sensitivity
    )
    return Table(
        columns,
        rows,
        "Sensitivity to the angular padding of heads and to the minimum fixation",
        "A averted, D directed; p of A against D, before correction; the same trials as in the "
        "main analysis.",
    )


def second_view_table(tests: Sequence[PairTest]) -> Table:
    """Return the comparisons on fixations found without areas of interest."""
    columns = (
        Column("Measure"),
        Column("Comparison"),
        Column("First", "right"),
        Column("Second", "right"),
        Column("n", "right"),
        Column("p", "right"),
        Column("", "left"),
    )
    rows = tuple(
        (
            t.measure.words,
            t.name,
            decimal(t.first_mean, 2),
            decimal(t.second_mean, 2),
            str(t.n_pairs),
            Cell(
                probability(t.outcome.p if t.outcome else None),
                "strong" if t.is_significant else "",
                t.sentence(),
            ),
            t.stars,
        )
        for t in tests
    )
    return Table(
        columns,
        rows,
        "Second view: fixations detected by velocity and by dispersion",
        "Number of fixations per trial with most of their samples on the active agent; alpha is "
        "shared by the five comparisons of a measure.",
    )


def _signed_percentage(share_01: float) -> str:
    text = percentage(share_01, 0)
    return f"+{text}" if share_01 > 0 and text != "0 %" else text

"""The report's tables: this study beside the published one, agreement marked."""

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
)
from analysis.statistics.anova import AnovaEffect
from experiments.crowd import published
from experiments.crowd.analysis import CrowdAnalysis, GroupAnalysis
from experiments.crowd.comparisons import MeasureComparison
from experiments.crowd.design import CONDITIONS
from experiments.crowd.paths import VARIANT_NAMES, VARIANTS
from experiments.crowd.terms import FURTHER, PAIRS, PRIMARY, RATINGS, Measure

HERE, PRINTED = "This study", "Published"
BLOCK_SIGNS = dict(zip(CONDITIONS, ("1", "H", "2"), strict=True))
SIGNS_NOTE = "1: NoHaptic1, H: Haptic, 2: NoHaptic2."
PAIR_SIGNS = {pair: f"{BLOCK_SIGNS[pair[0]]} – {BLOCK_SIGNS[pair[1]]}" for pair in PAIRS}
PAIR_NAMES = {pair: f"{pair[0]} – {pair[1]}" for pair in PAIRS}


def rule_note(analysis: CrowdAnalysis) -> str:
    """Say by which rule volumes were measured: it stands under every table that holds one."""
    return f"Volumes by rule and surface: {', '.join(analysis.rules)}."


def means_table(analysis: CrowdAnalysis) -> Table:
    """Return mean (SD) by measure and block beside the published ones."""
    columns = [Column("Measure")]
    for condition in CONDITIONS:
        columns += [
            Column("here", "right", condition),
            Column("publ.", "right", condition),
            Column("Δ", "right", condition),
        ]
    rows = []
    sizes = set()
    for measure in (*PRIMARY, *RATINGS):
        found = analysis.main.comparison(measure)
        sizes.add(len(found.people))
        row: list[Cell | str] = [measure.axis]
        for k, condition in enumerate(CONDITIONS):
            printed = published.MEANS.get(measure.column, {}).get(condition)
            here = float(found.means[k])
            digits = measure.digits
            row += [
                Cell(
                    mean_sd(here, float(found.sds[k]), digits),
                    hint=counted(len(found.people), "participant"),
                ),
                Cell(
                    MISSING if printed is None else mean_sd(printed.mean, printed.sd, digits),
                    "weak",
                ),
                MISSING if printed is None else _deviation(here, printed.mean),
            ]
        rows.append(tuple(row))
    span = " to ".join(str(n) for n in sorted({min(sizes), max(sizes)}))
    return Table(
        tuple(columns),
        tuple(rows),
        "Measures by block, mean (SD) over participants",
        f"n = {span} here, {published.PARTICIPANTS} published. Δ: how far the mean lies from the "
        f"published one. {rule_note(analysis)}",
    )


def _deviation(here: float, printed: float) -> str:
    text = percentage((here - printed) / printed, 0)
    return text if text == MISSING or text.startswith("\N{MINUS SIGN}") else f"+{text}"


def tests_table(analysis: CrowdAnalysis, *, primary: bool) -> Table:
    """Return the tests over blocks with post-hocs; the published ones beside the primary ones."""
    measures = (*PRIMARY, *RATINGS) if primary else FURTHER
    columns = [
        Column("Measure"),
        Column("n", "right", HERE),
        Column("Test over blocks", "right", HERE),
        Column("p", "right", HERE),
        Column("Effect", "right", HERE),
        *(Column(PAIR_SIGNS[pair], "right", HERE) for pair in PAIRS),
    ]
    if primary:
        columns += [
            Column("F", "right", PRINTED),
            Column("p", "right", PRINTED),
            Column("differ", "left", PRINTED),
            Column("Verdicts", "centre"),
        ]
    rows = [
        (
            *_test_cells(analysis.main.comparison(m)),
            *(_published_cells(analysis, m) if primary else ()),
        )
        for m in measures
    ]
    note = (
        "Decision path: Shapiro-Wilk per block, then repeated-measures ANOVA (Greenhouse-Geisser "
        "where Mauchly's p < .05; partial η²) or Friedman (Kendall's W). Pairs: adjusted p "
        "(Bonferroni over three) of paired t or signed-rank tests, strong where significant after "
        f"a significant test over blocks. {SIGNS_NOTE} {rule_note(analysis)}"
    )
    caption = "Tests of the published measures" if primary else "Tests of further measures"
    return Table(tuple(columns), tuple(rows), caption, note)


def _test_cells(found: MeasureComparison) -> tuple[Cell | str, ...]:
    label, n = found.measure.label, str(len(found.people))
    if found.test is None:
        return (label, n, Cell("not tested", "weak", found.problem), *[MISSING] * 5)
    test = found.test.test
    mark = "strong" if found.test.significant else ""
    if isinstance(test, AnovaEffect):
        df2 = decimal(test.df2_used, 0 if test.correction == "none" else 1)
        df1 = decimal(test.df1_used, 0 if test.correction == "none" else 2)
        statistic, effect = f"F({df1}, {df2}) = {decimal(test.F)}", fraction(test.eta.value)
    else:
        statistic, effect = f"χ²({test.df}) = {decimal(test.chi2)}", fraction(test.kendall_w)
    pairs = [Cell(probability(t.p), "strong" if t.differs else "", t.sentence) for t in found.pairs]
    return (
        label,
        n,
        Cell(statistic, hint=found.test.path()),
        Cell(probability(found.test.p), "strong" if mark else ""),
        effect,
        *pairs,
    )


def _published_cells(analysis: CrowdAnalysis, measure: Measure) -> tuple[Cell | str, ...]:
    source = published.TESTS.get(measure.column)
    if source is None:
        return (MISSING, MISSING, MISSING, MISSING)
    found = analysis.main.comparison(measure)
    verdicts = [found.agrees(pair) for pair in PAIRS]
    known = [v for v in verdicts if v is not None]
    if not known:
        verdict = Cell("not tested", "weak")
    else:
        verdict = Cell(
            f"{sum(known)} of {len(known)}", "agree" if all(known) else "differ",
            "; ".join(
                f"{PAIR_NAMES[p]}: {'same' if v else 'different'}"
                for p, v in zip(PAIRS, verdicts, strict=True)
            ),
        )  # fmt: skip
    df = source.df
    f_text = MISSING if source.F is None or df is None else (
        f"F({df[0]:g}, {df[1]:g}) = {source.F:g}"
    )  # fmt: skip
    pairs = ", ".join(PAIR_SIGNS[p].replace(" ", "") for p in source.pairs) or "none"
    return (
        Cell(f_text, "weak"),
        Cell("< .001" if source.p_is_bound else probability(source.p), "weak"),
        Cell(pairs, "weak"),
        verdict,
    )


def similarity_table(group: GroupAnalysis) -> Table:
    """Return Dice by configuration and pair of blocks beside the published table."""
    columns = [Column("Configuration")]
    for pair in PAIRS:
        columns += [
            Column("here", "right", PAIR_NAMES[pair]),
            Column("publ.", "right", PAIR_NAMES[pair]),
        ]
    rows: list[tuple[Cell | str, ...]] = []
    for k, configuration in enumerate(group.paths.configurations):
        row: list[Cell | str] = [str(configuration)]
        for pair in PAIRS:
            value = float(group.paths.pair(pair).by_configuration[k])
            printed = published.DICE_BETWEEN[pair][configuration - 1]
            row += [fraction(value, 3), Cell(fraction(printed, 3), "weak")]
        rows.append(tuple(row))
    last: list[Cell | str] = ["Mean (SD)"]
    for pair in PAIRS:
        found, source = group.paths.pair(pair), published.DICE_BETWEEN_ALL[pair]
        last += [
            Cell(mean_sd(found.mean, found.sd, 3), "strong"),
            Cell(mean_sd(source.mean, source.sd, 3), "weak"),
        ]
    rows.append(tuple(last))
    within = group.paths.within["union"].ravel()
    here = mean_sd(float(within.mean()), float(within.std(ddof=1)), 3) if within.size > 1 else "–"
    return Table(
        tuple(columns),
        tuple(rows),
        "Similarity of paths between blocks, as published (Dice, union of cells)",
        f"n = {group.paths.n_people} here, {published.PARTICIPANTS} published. Within a block, "
        f"random halves as published: {here} here, "
        f"{mean_sd(published.DICE_WITHIN.mean, published.DICE_WITHIN.sd, 3)} published. The "
        "crowds are ours, so a configuration's number is no pairing. See below before comparing "
        "between with within.",
    )


def fair_table(group: GroupAnalysis) -> Table:
    """Return all variants of Dice: whole blocks, halves, and matched groups of other people."""
    columns = (
        Column("Variant"),
        Column("Blocks"),
        Column("between, whole blocks", "right", "As published"),
        Column("within, halves", "right", "As published"),
        Column("between", "right", "Equal sizes, other people"),
        Column("within", "right", "Equal sizes, other people"),
        Column("within − between", "right", "Equal sizes, other people"),
        Column("p", "right", "Equal sizes, other people"),
    )
    rows = []
    for variant in VARIANTS:
        within = group.paths.within[variant]
        for pair in PAIRS:
            found = group.paths.pair(pair, variant)
            fair = found.fair
            halves = float(within.mean()) if within.size else None
            cells: tuple[Cell | str, ...] = (
                VARIANT_NAMES[variant],
                PAIR_NAMES[pair],
                fraction(found.mean, 3),
                fraction(halves, 3),
            )
            if fair is None:
                rows.append((*cells, Cell("too few", "weak", found.problem), *[MISSING] * 3))
                continue
            rows.append(
                (
                    *cells,
                    fraction(fair.between, 3),
                    fraction(fair.within, 3),
                    fraction(fair.difference, 3),
                    probability(fair.p),
                )
            )
    some = next((p.fair for p in group.paths.pairs if p.fair is not None), None)
    how = (
        ""
        if some is None
        else f"{some.n_splits} seeded splits, {some.n_permutations} permutations that exchange "
        "all walks of a person between the two blocks. "
    )
    return Table(
        columns,
        tuple(rows),
        "The same compared fairly",
        f"{how}Whole blocks hold more people than halves, and the same people on both sides: both "
        "raise Dice without any effect of the block.",
    )


def equivalence_table(group: GroupAnalysis) -> Table:
    """Return the equivalence tests of paths."""
    columns = (
        Column("Blocks"),
        Column("What"),
        Column("n", "right"),
        Column("Difference [90 % CI]", "right"),
        Column("Bounds", "right"),
        Column("p", "right"),
        Column("Equivalent", "centre"),
    )
    rows: list[tuple[Cell | str, ...]] = []
    tests = [
        (f.pair, "excess similarity within a block (Dice)", f.test or f.problem, 3)
        for f in group.paths.equivalence
    ]
    tests += [(p, "path length (m)", t, 2) for p, t in group.path_lengths.items()]
    for pair, what, test, digits in tests:
        if isinstance(test, str):
            rows.append(
                (PAIR_NAMES[pair], what, MISSING, Cell("not tested", "weak", test), *[MISSING] * 3)
            )
            continue
        value = decimal(test.estimate, digits)
        bounds = interval(test.interval.low, test.interval.high, digits)
        rows.append(
            (
                PAIR_NAMES[pair],
                what,
                str(test.provenance.n),
                f"{value} {bounds}",
                interval(test.low, test.high, digits),
                probability(test.p),
                Cell("yes", "agree") if test.is_equivalent else Cell("not shown", "differ"),
            )
        )
    return Table(
        columns,
        tuple(rows),
        "Are paths the same? Two one-sided tests",
        "Excess: mean Dice of a person's path with the others' paths of the same block, less that "
        "with their paths of the other block; people are the units, and the interval comes from "
        "leaving out one person at a time, as everybody is compared with everybody.",
    )


def collision_table(analysis: CrowdAnalysis, rows_of: dict[str, dict[str, float]]) -> Table:
    """Return facts about single collisions by block."""
    names = list(next(iter(rows_of.values()))) if rows_of else []
    columns = (Column("Collisions"), *(Column(c, "right") for c in rows_of))
    rows = tuple((name, *(decimal(rows_of[c][name], 2) for c in rows_of)) for name in names)
    return Table(columns, rows, "Counted collisions, mean per walk", rule_note(analysis))

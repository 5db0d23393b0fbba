"""What a study's source says beside what the study does: the table of `visavis fidelity`.

Values that the study's design has are read from it, so that a row cannot go stale: number of trials
and blocks, factors, parameters, scales of questions. Printed results come from what the study
declares of them; they are shown beside the study's own and not compared.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from string import Formatter
from typing import Any, Final, Literal, TypeAlias, get_args

from visavis.analysis.report import Block, Column, Fold, Paragraph, Section, Table
from visavis.analysis.report.blocks import Cell
from visavis.lab.errors import DesignError
from visavis.results.analysis import StudyAnalysis
from visavis.results.family_tests import CorrelationTest, printed_pair_tests
from visavis.results.printed_orders import order_holds, printed_orders_of, rows_for
from visavis.stimuli.area_paths import FilesGone
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.experiment import StudyExperiment
from visavis.study.measures import Measure
from visavis.study.pairs import Correlate, Pairs, Printed
from visavis.study.responses import Choice, Rating
from visavis.study.source import Fact, FactKind, PrintedOrder, Source
from visavis.study.texts import format_value

Verdict: TypeAlias = Literal["same", "stronger", "different", "not compared"]
KINDS: Final[Mapping[FactKind, str]] = {
    "design": "Design",
    "procedure": "Procedure",
    "measure": "Measures",
    "test": "Tests",
    "result": "Printed results",
}
"""Kinds of facts in the order of the table, with their headings."""
AGREE: Final[tuple[Verdict, ...]] = ("same", "not compared")
"""Verdicts that need no reason."""
HEADINGS: Final = ("What", "The source", "Where", "This study", "Verdict")
AS_THERE: Final = "the same"
SHOWN: Final = "this study's own, beside it in the report"
EXPECTED: Final = (
    "expected of simulated people (not checked here; `python -m benchmarks.printed_orders`)"
)
ORDER: Final = "order"
FEWER_OR_MORE: Final = "a lab decides how many take part, and the report says where they are fewer"
TEST_WORDS: Final[Mapping[str, str]] = {
    "art": "analysis of variance on aligned ranks",
    "conditions": "repeated-measures analysis of variance, or Friedman's test",
    "paired": "paired t test, or Wilcoxon's signed-rank test",
    "anova": "analysis of variance",
    "t": "t test",
}
"""How tests are called; others by their own names."""


@dataclass(frozen=True)
class FidelityRow:
    """One fact of the source and what the study does; `because` says why that is different."""

    kind: FactKind
    what: str
    printed: str
    where: str
    here: str
    verdict: Verdict = "same"
    because: str = ""

    @property
    def verdict_text(self) -> str:
        """The verdict with its reason."""
        if self.verdict in AGREE:
            return self.verdict
        return f"{self.verdict}, because {self.because or '(no reason is declared)'}"

    @property
    def lacks_reason(self) -> bool:
        """Tell whether it is different and does not say why."""
        return self.verdict not in AGREE and not self.because


def design_values(experiment: StudyExperiment) -> dict[str, Any]:
    """Return the values of a design that a fact may name: by `Fact.of`.

    They are all parameters and factors, the scale ("1 to 9") or number of options of each question,
    the numbers of `trials` that count, `practice` trials, `blocks` and `trials_in_block`, and
    `order`, `block_order`, `posture`, `place` (lab or browser) and `questionnaires`.
    """
    study, plan = experiment.study, experiment.plan(0, 0)
    main_blocks = [b for b in plan.blocks if any(not t.is_practice for t in b.trials)]
    design = study.design_with(experiment.parameters)
    scales = {
        r.name: f"{r.low} to {r.high}" if isinstance(r, Rating) else len(r.options)
        for r in experiment.responses.values()
        if isinstance(r, Rating | Choice)
    }
    return {
        **experiment.parameters,
        **{f.name: tuple(f.levels) for f in design.factors},
        **scales,
        **{k: v for k, v in experiment.values_of(plan).items() if k in COUNTS},
        "trials_in_block": len(main_blocks[0].trials),
        "order": design.order,
        "block_order": design.block_order,
        "posture": study.procedure.posture or "",
        "place": study.procedure.on,
        "questionnaires": (*study.asks.after_block, *study.asks.questionnaires),
    }


COUNTS: Final = ("trials", "practice", "blocks")
_OF_ORDER: Final = ("trials_in_block", "order", "block_order", "posture", "place", "questionnaires")


def design_names(experiment: StudyExperiment) -> tuple[str, ...]:
    """Return the names of `design_values`, without a plan: planning takes longest."""
    responses = experiment.responses.values()
    return (
        *experiment.parameters,
        *(f.name for f in experiment.study.design_with(experiment.parameters).factors),
        *(r.name for r in responses if isinstance(r, Rating | Choice)),
        *COUNTS,
        *_OF_ORDER,
    )


def fidelity_rows(experiment: StudyExperiment) -> tuple[FidelityRow, ...]:
    """Return every fact of the study's source beside what the study does, by kind.

    Raises:
        DesignError: a fact names a value that neither the design nor that of a base has, or an
            order is explained that the source does not state.
    """
    study = experiment.study
    source = study.report.source
    if source is None:
        return ()
    values = design_values(experiment)
    own = design_values(StudyExperiment(study, files_gone=FilesGone()))
    rows = [
        *([] if source.participants is None else [_participants(source)]),
        *(_row_of(fact, values, own, study) for fact in source.facts),
        *_printed_tests(experiment),
        *_printed_means(study, source),
        *_printed_orders(experiment),
    ]
    return tuple(row for kind in KINDS for row in rows if row.kind == kind)


def _participants(source: Source) -> FidelityRow:
    return FidelityRow(
        "design",
        "participants",
        str(source.participants),
        source.where,
        "as many as are invited; `visavis power` says how many are needed",
        "different",
        FEWER_OR_MORE,
    )


def _row_of(
    fact: Fact, values: Mapping[str, Any], own: Mapping[str, Any], study: Study
) -> FidelityRow:
    """Return the row of a declared fact; all is compared but a printed result without `here`."""
    absent = [name for name in names_of(fact) if name not in values]
    if absent:
        if not all(_was_left_out(name, study) for name in absent):
            refuse_unknown_values(fact, values)
        return FidelityRow(
            fact.kind,
            fact.what,
            _text(fact.printed),
            fact.where,
            "none",
            "different",
            f"this study was derived without {', '.join(absent)}",
        )
    value = _value_of(fact, values)
    if value == "" and not fact.of and fact.kind == "result":
        return _not_compared(fact.kind, fact.what, _text(fact.printed), fact.where, SHOWN)
    is_as_there = value == "" and not fact.of
    here = AS_THERE if is_as_there else _in_words(fact.printed, value)
    if is_as_there or _agrees(fact.printed, value):
        return FidelityRow(fact.kind, fact.what, _text(fact.printed), fact.where, here)
    return FidelityRow(
        fact.kind,
        fact.what,
        _text(fact.printed),
        fact.where,
        here,
        "stronger" if fact.is_stronger else "different",
        _set_or_derived(fact, value, own, study) or fact.because,
    )


def _set_or_derived(fact: Fact, value: Any, own: Mapping[str, Any], study: Study) -> str:
    """Return that a value is not that of the study itself, or of its base, which the reason of a
    fact is about; counts that follow from what was set are such values, too.
    """
    usual = _value_of(fact, own) if set(names_of(fact)) <= set(own) else value
    if usual != value:
        return f"this study was set so (its own: {_text(usual)})"
    base = study.base
    if base is None:
        return ""
    of_base = design_values(StudyExperiment(base, files_gone=FilesGone()))
    if not set(names_of(fact)) <= set(of_base) or _value_of(fact, of_base) == value:
        return ""
    return f"this study was derived so (its base: {_text(_value_of(fact, of_base))})"


def names_of(fact: Fact) -> tuple[str, ...]:
    """Return the names of values of the design that a fact reads: by `of`, or in braces.

    What stands in braces with a format, or in braces that do not close, is the name of no value.
    """
    if fact.of:
        return (fact.of,)
    if not isinstance(fact.here, str):
        return ()
    try:
        parts = [part for part in Formatter().parse(fact.here) if part[1] is not None]
    except ValueError:
        return (fact.here,)
    return tuple(
        f"{name}" + (f"!{conversion}" if conversion else "") + (f":{form}" if form else "")
        for _, name, form, conversion in parts
    )


def refuse_unknown_values(fact: Fact, values: Collection[str]) -> None:
    """Refuse a fact that names a value which the design does not have.

    Raises:
        DesignError: with the fact and the names that there are.
    """
    for name in names_of(fact):
        if name not in values:
            raise DesignError(
                f"the fact {fact.what!r} of the source names {name!r}, which is no value of the "
                f'design; write of="trials", or a name in braces: here="{{trials}} trials"; there '
                f"are {', '.join(values)}"
            )


def _was_left_out(name: str, study: Study) -> bool:
    """Tell whether a study from which this one was derived has a value of the design."""
    base = study.base
    while base is not None:
        if name in design_values(StudyExperiment(base, files_gone=FilesGone())):
            return True
        base = base.base
    return False


def _value_of(fact: Fact, values: Mapping[str, Any]) -> Any:
    """Return what the study does: a value of its design, a number, or words with values in them."""
    if fact.of:
        return values[fact.of]
    if not isinstance(fact.here, str):
        return fact.here
    return fact.here.format_map({k: format_value(v) for k, v in values.items()})


def stale_facts(experiment: StudyExperiment) -> tuple[str, ...]:
    """Return the facts that give a reason for a difference which the design no longer has."""
    source = experiment.study.report.source
    values = design_values(experiment)
    return tuple(
        fact.what
        for fact in (() if source is None else source.facts)
        if fact.because
        and all(name in values for name in names_of(fact))
        and _agrees(fact.printed, _value_of(fact, values))
    )


def _agrees(printed: Any, value: Any) -> bool:
    """Tell whether a value of the design is the printed one; of levels, if there are as many."""
    is_number = isinstance(printed, int | float) and not isinstance(printed, bool)
    if is_number and isinstance(value, list | tuple):
        return bool(len(value) == printed)
    if is_number and isinstance(value, int | float):
        return float(value) == float(printed)
    return _text(printed) == _text(value)


def _in_words(printed: Any, value: Any) -> str:
    if isinstance(printed, int) and isinstance(value, list | tuple):
        return f"{len(value)}: {_text(value)}"
    return _text(value)


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    return format_value(value)


def _not_compared(kind: FactKind, what: str, printed: str, where: str, here: str) -> FidelityRow:
    """Return the row of a printed result, whose own stands beside it in the report."""
    return FidelityRow(kind, what, printed, where, here, "not compared")


def _printed_tests(experiment: StudyExperiment) -> Iterator[FidelityRow]:
    """Yield the printed tests of comparisons and families, those of a family by measure."""
    study = experiment.study
    words = _measure_words(study)
    for compare in experiment.compare:
        about = words.get(compare.dv, compare.dv)
        test = _test_words(compare, experiment)
        whom = f" ({', '.join(compare.restrictions)})" if compare.restrictions else ""
        for term, printed in compare.published_terms.items():
            what = f"{about} by {term.replace(':', ' × ')}{whom}"
            yield _not_compared("test", what, result_text(printed), printed.where, test)
        if compare.pairs:
            results = "; ".join(f"{a} – {b}: {p}" for (a, b), p in compare.pairs.items())
            where = next(iter(compare.pairs.values())).where
            what = f"{about}, pairs of levels{whom}"
            yield _not_compared("test", what, results, where, "contrasts after that test")
    for family in study.analysis.families:
        if isinstance(family, Pairs) and family.printed is not None:
            by_measure: dict[str, list[tuple[str, str, str]]] = {}
            for test_of in printed_pair_tests(study, family):
                of_level = f"{test_of.where.replace('_', ' ')} " if test_of.where else ""
                printed = test_of.published_result or Printed(False)
                by_measure.setdefault(test_of.measure.words, []).append(
                    (f"{of_level}{test_of.name}", result_text(printed), printed.where)
                )
            for about, tests in by_measure.items():
                each = f" by {family.each}" if family.each else ""
                yield _not_compared(
                    "test",
                    f"{about}{each}",
                    "; ".join(f"{name}: {result}" for name, result, _ in tests),
                    ", ".join(dict.fromkeys(where for *_, where in tests)),
                    f"{TEST_WORDS['paired']}, alpha shared",
                )
        if isinstance(family, Correlate) and family.printed is not None:
            yield from _printed_correlations(study, family)


def _printed_correlations(study: Study, family: Correlate) -> Iterator[FidelityRow]:
    """Yield the printed correlations of every measure with a score."""
    measures = {m.column: m for m in study.analysis.measures}
    for column in family.measures:
        result_by_level = {
            level: family.printed(CorrelationTest(family, measures[column], level, 0, 0.05, None))
            for level in map(str, study.factor(family.factor).levels)
            if family.printed is not None
        }
        results = "; ".join(
            f"{level}: {result_text(p)}" for level, p in result_by_level.items() if p
        )
        where = ", ".join(dict.fromkeys(p.where for p in result_by_level.values() if p))
        about = f"{measures[column].words} with {family.score_words}"
        yield _not_compared("test", about, results, where, "Spearman's rank correlation")


def result_text(printed: Printed) -> str:
    """Return a printed result with everything that is printed of it."""
    if printed.text:
        return printed.text
    p = "" if printed.p is None else f"p {'<' if printed.p_is_bound else '='} {_decimal(printed.p)}"
    parts = [
        "Wilcoxon" if printed.is_wilcoxon else "",
        "" if printed.statistic is None else f"t = {printed.statistic:g}",
        "" if printed.r is None else f"r = {printed.r:g}",
        p,
        "" if printed.eta_p2 is None else f"η²p = {printed.eta_p2:g}",
    ]
    text = ", ".join(filter(None, parts)) or "not significant"
    return f"{text} {'*' * printed.stars}".strip()


def _decimal(value: float) -> str:
    return f"{value:.6f}".rstrip("0")


def _test_words(compare: Compare, experiment: StudyExperiment) -> str:
    levels = {
        f.name: tuple(map(str, f.levels))
        for f in experiment.study.design_with(experiment.parameters).factors
    }
    levels |= {name: tuple(of) for name, of in experiment.study.analysis.groups.items()}
    test = compare.question(levels).test
    return TEST_WORDS.get(test, test)


def _printed_means(study: Study, source: Source) -> Iterator[FidelityRow]:
    """Yield the printed means (SD) of every measure."""
    measures = {m.column: m for m in study.analysis.measures}
    for column, cells in source.cells.items():
        measure = measures.get(column, Measure(column, "1", column.replace("_", " ")))
        values = "; ".join(
            f"{level.replace('_', ' ')} {mean:g}" + ("" if sd is None else f" ({sd:g})")
            for level, (mean, sd) in cells.items()
        )
        unit = "" if measure.unit in ("", "1") else f" in {measure.unit}"
        yield _not_compared("result", f"{measure.words}{unit}", values, source.where, SHOWN)


def _printed_orders(experiment: StudyExperiment) -> Iterator[FidelityRow]:
    words = _measure_words(experiment.study)
    for order in printed_orders_of(experiment):
        what = _order_words(order, words)
        is_held = not order.not_reproduced
        yield FidelityRow(
            "result",
            ORDER,
            what,
            order.where,
            EXPECTED if is_held else "not reproduced by simulated people",
            "not compared" if is_held else "different",
            order.not_reproduced,
        )


def _order_words(order: PrintedOrder, measure_words: Mapping[str, str]) -> str:
    """Return what an order says; a measure without words goes by its name."""
    words = measure_words.get(order.measure) or order.measure
    return order.words or order.name.replace(order.measure, words, 1)


def _measure_words(study: Study) -> dict[str, str]:
    return {m.column: m.words for m in study.analysis.measures}


def fidelity_table(rows: Sequence[FidelityRow], caption: str) -> Table:
    """Return rows of one kind as a table of a report."""
    return Table(
        tuple(map(Column, HEADINGS)),
        tuple(
            (
                row.what,
                row.printed,
                row.where,
                row.here,
                Cell(row.verdict_text, "" if row.verdict in AGREE else "differ"),
            )
            for row in rows
        ),
        caption,
    )


def fidelity_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> tuple[Section, ...]:
    """Return the section of a report: all facts, and which printed orders these data show."""
    rows = fidelity_rows(experiment)
    if not rows:
        return ()
    blocks: list[Block] = [Paragraph(counts_of(rows))]
    for kind, heading in KINDS.items():
        of_kind = [row for row in rows if row.kind == kind and row.what != ORDER]
        if of_kind:
            fold = f"{heading}: {len(of_kind)}"
            blocks.append(Fold(fold, (fidelity_table(of_kind, heading),)))
    orders = _orders_table(analysis, experiment)
    blocks += [] if orders is None else [orders]
    return (Section("source", "Beside the source", tuple(blocks)),)


def _orders_table(analysis: StudyAnalysis, experiment: StudyExperiment) -> Table | None:
    """Return every order that the source states, with whether it holds in these data."""
    table_rows = []
    columns = {m.column: m for m in analysis.measures}
    words = {m.column: m.words for m in analysis.measures}
    orders = printed_orders_of(experiment)
    groups = analysis.study.analysis.groups
    rows = rows_for(orders, analysis.selection.counted, analysis.people, groups)
    for order in orders:
        measure = columns.get(order.measure)
        is_held = None if measure is None else order_holds(order, rows, measure.aggregate)
        cell = Cell("holds", "agree") if is_held else Cell("does not hold", "differ")
        if is_held is None:
            cell = Cell("not measured", "weak")
        why = order.not_reproduced and f"not reproduced by simulated people: {order.not_reproduced}"
        table_rows.append((_order_words(order, words), order.where, cell, why))
    if not table_rows:
        return None
    return Table(
        (Column("Order"), Column("Where"), Column("In these data"), Column("Note")),
        tuple(table_rows),
        "Orders that the source states",
        "Whether the means of those who count stand in the printed order; no test. Equal means are "
        "in no order.",
    )


def fidelity_markdown(rows: Sequence[FidelityRow]) -> str:
    """Return the rows as Markdown, one table for each kind, for a README or a supplement."""
    parts = [counts_of(rows)]
    for kind, heading in KINDS.items():
        of_kind = [row for row in rows if row.kind == kind]
        if not of_kind:
            continue
        lines = [f"| {' | '.join((heading, *HEADINGS[1:]))} |", f"|{' --- |' * len(HEADINGS)}"]
        for row in of_kind:
            cells = (row.what, row.printed, row.where, row.here, row.verdict_text)
            lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def counts_of(rows: Sequence[FidelityRow]) -> str:
    """Return how many rows there are of each verdict, as a sentence."""
    counts = {v: sum(row.verdict == v for row in rows) for v in get_args(Verdict)}
    of_each = ", ".join(f"{n} {verdict}" for verdict, n in counts.items() if n)
    return f"{len(rows)} facts of the source: {of_each}."

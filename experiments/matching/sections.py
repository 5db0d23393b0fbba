"""Further sections of the report: guesses and times as the source has them, and survival."""

from typing import Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from visavis.analysis.plots import BLUE, GREEN, VERMILION, ReportFigure, draw, new_figure
from visavis.analysis.report import Block, Paragraph, Section
from visavis.analysis.report.blocks import Column, Table
from visavis.analysis.report.notation import decimal, percentage
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.results import p_text
from visavis.analysis.statistics.survival import SurvivalTimes, cox, kaplan_meier, log_rank
from visavis.experiments.matching.interfaces import TARGETS
from visavis.experiments.matching.outcomes import Outcomes, PairTest, outcomes_of
from visavis.experiments.matching.published import ALL, GUESS, TIME
from visavis.protocol.plan.columns import Column as TableColumn
from visavis.results.analysis import StudyAnalysis
from visavis.results.report.study_report import picture_of
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

COLOURS: Final = {"weights": VERMILION, "adjectives": BLUE, "features": GREEN}
PRINTED: Final = {"guess_m": GUESS, "time_s": TIME}
WORDS: Final = {"guess_m": "distance after the guess", "time_s": "time of adjusting"}
TITLE: Final = "Targets, one by one, beside the source"
REFERENCE: Final = "weights"
MIN_PEOPLE: Final = 2
TABLE_COLUMNS: Final = (
    TableColumn("measure", "", "what is compared: guess_m or time_s"),
    TableColumn("first", "", "one interface"),
    TableColumn("second", "", "the other"),
    TableColumn("n", "1", "pairs of a person and a target"),
    TableColumn("p_normal", "1", "Wilcoxon's p by the normal approximation, not corrected"),
    TableColumn("p_exact", "1", "Wilcoxon's exact p"),
    TableColumn("better", "", "the interface that was nearer or sooner in most pairs"),
    TableColumn("p_printed", "1", "the source's p for its own target of that number, or all"),
)


def as_printed(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return outcomes by target, Wilcoxon's tests beside the printed p, and survival."""
    rows = analysis.selection.counted
    people = rows["participant"].nunique() if len(rows) else 0
    if people < MIN_PEOPLE:
        words = f"{people} people's trials count; at least {MIN_PEOPLE} must."
        return Extra(Section("matching", TITLE, (Paragraph(words),)))
    outcomes = outcomes_of(rows, experiment.levels)
    tests = [test for measure in PRINTED for test in outcomes.tests(measure)]
    data = None
    why = ""
    try:
        data = outcomes.survival()
    except StatisticsError as problem:
        why = f"Times cannot be compared as censored ones: {problem}."
    blocks: list[Block] = [_by_target(outcomes), _saved(outcomes), *_wilcoxon(tests)]
    figures: tuple[ReportFigure, ...] = ()
    if data is None:
        blocks.append(Paragraph(why))
    else:
        figure = draw(
            "survival",
            lambda: _curves(data, outcomes.interfaces, float(experiment.parameters["limit_s"])),
            title="Targets that were not matched yet",
            caption="Kaplan–Meier estimates of the share of adjustments without a match, over the "
            "time of adjusting; whoever had none at the limit is censored there. Guesses that "
            "matched count as matched at once.",
            alternative="Falling step curves of the interfaces, one below the other.",
            is_simulated=analysis.is_simulated,
        )
        figures = (figure,)
        blocks += [picture_of(figure), *_survival(data, outcomes.interfaces)]
    return Extra(
        Section("matching", TITLE, tuple(blocks)),
        figures,
        {"as_printed": _table(tests)},
        TABLE_COLUMNS,
    )


def printed_p(test: PairTest) -> float | None:
    """Return the p that the source prints for a test; None where it has none."""
    values = PRINTED[test.measure].get((test.first, test.second))
    places = (*TARGETS, ALL)
    return (
        None if values is None or test.target not in places else values[places.index(test.target)]
    )


def _name(target: str) -> str:
    return "all" if target == ALL else f"target {target}"


def _by_target(outcomes: Outcomes) -> Table:
    rows = []
    for target in (*outcomes.targets, ALL):
        for interface in outcomes.interfaces:
            guess = outcomes.values("guess_m", interface, target)
            time = outcomes.values("time_s", interface, target)
            if not len(guess) or not len(time):
                continue
            is_matched = outcomes.values("is_matched", interface, target)
            rows.append(
                (
                    _name(target),
                    interface,
                    f"{_number(guess.mean(), 3)} ({_number(_sd(guess), 3)})",
                    percentage(float(outcomes.values("is_guessed", interface, target).mean())),
                    f"{_number(time.mean(), 0)} ({_number(_sd(time), 0)})",
                    percentage(1.0 - float(is_matched.mean())),
                )
            )
    return Table(
        (
            Column("target"),
            Column("interface"),
            Column("D of the guess, m", "right"),
            Column("matched by it", "right"),
            Column("time, s", "right"),
            Column("failures", "right"),
        ),
        tuple(rows),
        "Guesses and adjustments",
        "Means (SD) over people; over all targets, over people and targets. Failures had no match "
        "at the limit, which is their time here. The source shows these in figures 7, 8, 9 and 11.",
    )


def _saved(outcomes: Outcomes) -> Table:
    others = [i for i in outcomes.interfaces if i != REFERENCE]
    rows = []
    for target in (*outcomes.targets, ALL) if REFERENCE in outcomes.interfaces else ():
        for interface in others:
            mean, low, high = outcomes.saved(interface, target)
            if np.isfinite(mean):
                interval = f"[{_number(low, 0)}, {_number(high, 0)}]"
                rows.append((_name(target), interface, _number(mean, 0), interval))
    return Table(
        (
            Column("target"),
            Column("interface"),
            Column("time saved, s", "right"),
            Column("90 % CI", "right"),
        ),
        tuple(rows),
        "Time saved against adjusting weights",
        "Mean difference of a person and target, with the interval of the source's figure 10.",
    )


def _wilcoxon(tests: list[PairTest]) -> list[Block]:
    blocks: list[Block] = []
    for measure, words in WORDS.items():
        rows = []
        for test in (t for t in tests if t.measure == measure):
            printed = printed_p(test)
            rows.append(
                (
                    _name(test.target),
                    f"{test.first} – {test.second}",
                    str(test.n),
                    test.better or "–",
                    *(
                        p_text(p).removeprefix("p ") if np.isfinite(p) else "–"
                        for p in (test.p_normal, test.p_exact)
                    ),
                    "–" if printed is None else f"= {decimal(printed, 3)}",
                )
            )
        blocks.append(
            Table(
                (
                    Column("target"),
                    Column("interfaces"),
                    Column("pairs", "right"),
                    Column("better in most"),
                    Column("normal", "right", "p"),
                    Column("exact", "right", "p"),
                    Column("printed", "right", "p"),
                ),
                tuple(rows),
                f"Wilcoxon's tests of the {words}",
                "Normal: without continuity correction, as the printed p are; exact: conditional "
                "on ties. Over all targets pairs of a person and a target count as independent, as "
                "in the source, which they are not. Printed: for the source's own five targets.",
            )
        )
    return blocks


def _survival(data: SurvivalTimes, interfaces: tuple[str, ...]) -> list[Block]:
    rows = []
    for interface in interfaces:
        if not (data.group == interface).any():
            continue
        curve = kaplan_meier(data, interface)
        median = _number(curve.median, 0) if np.isfinite(curve.median) else "beyond the limit"
        rows.append((interface, str(curve.n), str(curve.events), median))
    table = Table(
        (
            Column("interface"),
            Column("adjustments", "right"),
            Column("matches", "right"),
            Column("median time, s", "right"),
        ),
        tuple(rows),
        "Times as censored ones",
    )
    try:
        test = log_rank(data)
        words = f"Log-rank test within targets (all adjustments independent): {test.sentence()}."
        ratios = cox(data, REFERENCE if REFERENCE in data.group else str(data.group[0]))
    except StatisticsError as problem:
        return [table, Paragraph(f"There is no ratio of hazards: {problem}.")]
    lines = "; ".join(
        f"{r.group} {decimal(r.ratio, 2)} times as soon as {r.reference} (95 % CI "
        f"[{decimal(r.low, 2)}, {decimal(r.high, 2)}], z = {decimal(r.z, 2)}, {p_text(r.p)})"
        for r in ratios
    )
    return [
        table,
        Paragraph(words),
        Paragraph(
            "Cox regression within targets, with errors that hold each person's adjustments "
            f"together (ratio of hazards of a match): {lines}."
        ),
    ]


def _curves(data: SurvivalTimes, interfaces: tuple[str, ...], limit_s: float) -> Figure:
    """Return the Kaplan–Meier curves of the interfaces."""
    figure = new_figure(5.6, 3.6)
    axes = figure.add_subplot()
    for interface in (i for i in interfaces if (data.group == i).any()):
        curve = kaplan_meier(data, interface)
        at_limit = curve.share[-1] if len(curve.share) else 1.0
        times = np.concatenate([[0.0], curve.times, [limit_s]])
        share = np.concatenate([[1.0], curve.share, [at_limit]])
        axes.step(times, share, where="post", color=COLOURS.get(interface), label=interface)
        axes.plot([limit_s], [at_limit], "|", color=COLOURS.get(interface), markersize=10)
    axes.set(
        xlabel="time of adjusting, s",
        ylabel="share not matched yet",
        ylim=(0, 1.03),
        xlim=(0, limit_s * 1.02),
    )
    axes.legend(frameon=False)
    return figure


def _table(tests: list[PairTest]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "measure": t.measure,
                "target": t.target,
                "first": t.first,
                "second": t.second,
                "n": t.n,
                "p_normal": t.p_normal,
                "p_exact": t.p_exact,
                "better": t.better,
                "p_printed": printed_p(t),
            }
            for t in tests
        ]
    )


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−")


def _sd(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else 0.0

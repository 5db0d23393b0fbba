"""How often each option of every `Choice` was chosen, by condition: a section and a table."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import pandas as pd

from visavis.analysis.report import Block, Column, Fold, Paragraph, Section, Table
from visavis.analysis.report.notation import count_of, percentage
from visavis.analysis.statistics.binomial import clustered_share
from visavis.protocol.plan.columns import Column as Described
from visavis.results.analysis import StudyAnalysis
from visavis.study.experiment import StudyExperiment
from visavis.study.responses import Choice
from visavis.study.sections import Extra
from visavis.study.texts import label_in_unit, label_of

NAME: Final = "choices"
NOT_KEPT: Final = (
    "These sessions were recorded by a version that did not keep what an option meant in a trial: "
    "options are counted as they stood, whatever they meant."
)
MAX_OPEN_ROWS: Final = 24
"""The report folds tables with more rows."""
COLUMNS: Final = (
    Described("asked", "", "the choice, as the study names it"),
    Described("option", "", "one of its options, or what it meant where trials swap them"),
    Described("times_chosen", "1", "answers that named the option in this condition"),
    Described("answers", "1", "answers given in this condition; trials without one do not count"),
    Described("people", "1", "participants who answered in this condition"),
    Described("share_01", "1", "times_chosen of answers"),
    Described("share_low_01", "1", "lower end of the share's interval, over participants"),
    Described("share_high_01", "1", "upper end of the share's interval, over participants"),
)


def choice_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return how often each option of every choice was chosen; empty where no choice was asked."""
    rows: list[dict[str, Any]] = []
    blocks: list[Block] = []
    for response in experiment.responses.values():
        if isinstance(response, Choice) and response.name in analysis.selection.counted:
            meanings = meanings_of(experiment, response.name)
            has_meanings = meanings != tuple(map(str, response.options))
            is_kept = f"{response.name}_means" in analysis.selection.counted
            column = f"{response.name}_means" if has_meanings and is_kept else response.name
            options = meanings if column != response.name else tuple(map(str, response.options))
            count_rows = list(_counts(analysis, response.name, column, options))
            rows += count_rows
            if not count_rows:
                continue
            blocks += _choice_blocks(count_rows, response, options, analysis, experiment)
            if has_meanings and not is_kept:
                blocks.append(Paragraph(NOT_KEPT))
    if not rows:
        return Extra()
    section = Section(NAME, "What was chosen", tuple(blocks))
    return Extra(section, (), {NAME: pd.DataFrame(rows)}, COLUMNS)


def meanings_of(experiment: StudyExperiment, name: str) -> tuple[str, ...]:
    """Return everything that options of a choice mean in some condition, in order."""
    responses = (r for read in experiment.read.values() for r in read.responses if r.name == name)
    return tuple(dict.fromkeys(m for r in responses if isinstance(r, Choice) for m in r.meanings))


def _counts(
    analysis: StudyAnalysis, name: str, counted: str, meanings: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Yield a row for each condition and meaning of the column `counted`, in their order."""
    factors = list(analysis.cells)
    trials = analysis.selection.counted
    answered_trials = trials[trials[counted].notna()]
    choices = answered_trials[counted].astype(str)
    options = dict.fromkeys([*meanings, *sorted(choices.unique())])
    cells = (
        answered_trials.groupby(factors, sort=False, observed=True)
        if factors
        else [((), answered_trials)]
    )
    for key, cell in cells:
        levels = key if isinstance(key, tuple) else (key,)
        who = cell["participant"].astype(str)
        answers = who.value_counts(sort=False)
        for option in options:
            hits = (
                who[choices[cell.index] == option].value_counts().reindex(answers.index).fillna(0)
            )
            share, interval = clustered_share(
                hits.to_numpy(), answers.to_numpy(), level=analysis.rules.interval_level
            )
            yield {
                "asked": name,
                **dict(zip(factors, levels, strict=True)),
                "option": option,
                "times_chosen": int(hits.sum()),
                "answers": len(cell),
                "people": len(answers),
                "share_01": share,
                "share_low_01": interval.low,
                "share_high_01": interval.high,
            }


def _choice_blocks(
    rows: list[dict[str, Any]],
    response: Choice,
    options: Sequence[str],
    analysis: StudyAnalysis,
    experiment: StudyExperiment,
) -> Iterator[Block]:
    texts, factors = experiment.texts, list(analysis.cells)
    names = {o: texts.find(f"choices.{response.name}.{o}") or label_of(texts, o) for o in options}
    level = f"{100 * analysis.rules.interval_level:.0f} %"
    heads = ", ".join(label_in_unit(texts, f) for f in factors) or "Condition"
    table_rows = tuple(
        (
            ", ".join(label_of(texts, str(row[f])) for f in factors) or "all",
            names.get(row["option"], row["option"]),
            f"{row['times_chosen']} of {row['answers']}",
            percentage(row["share_01"], 0),
            f"{percentage(row['share_low_01'], 0)} to {percentage(row['share_high_01'], 0)}",
        )
        for row in rows
    )
    question = response.name.replace("_", " ")
    prompt = texts.find(f"questions.{response.name}", values=dict(experiment.settings.values))
    table = Table(
        (
            Column(heads[:1].upper() + heads[1:]),
            Column("Option"),
            Column("Chosen", "right"),
            Column("Share", "right"),
            Column(f"{level} interval", "right"),
        ),
        table_rows,
        f"{question[:1].upper()}{question[1:]}: how often each option was chosen",
        "Intervals are over participants: answers of one person count as alike as they were "
        "(Korn and Graubard, 1998).",
    )
    if prompt:
        yield Paragraph(f"Asked: {prompt}")
    long = len(table_rows) > MAX_OPEN_ROWS
    yield Fold(f"{question}: {count_of(len(table_rows), 'row')}", (table,)) if long else table
    missing = int(analysis.selection.counted[response.name].isna().sum())
    if missing:
        yield Paragraph(f"{count_of(missing, 'trial')} without an answer are left out.")

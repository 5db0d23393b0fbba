"""Every name in a study, resolved before anything runs: what could not be analysed is not planned.

`StudyDesign.problems` refuses what no trial's row can hold when a study file is read. Here are the
names that need more than the file: columns of all tables, of what trials show, ask and write, and
files of questionnaires. Sessions that were recorded before a name was refused are analysed as they
were.
"""

import importlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from visavis.lab.config import ROLES
from visavis.lab.errors import DesignError, LabError
from visavis.lab.yaml_lines import did_you_mean
from visavis.protocol.plan.columns import Column
from visavis.results.family_tests import columns_of_tests
from visavis.results.intake import questionnaire
from visavis.results.picture_delay import LATE
from visavis.results.quality import QUALITY_TABLE
from visavis.results.tables.dictionary import (
    HAND_COLUMNS,
    PEOPLE,
    STATISTICS,
    WALK_COLUMNS,
    people_columns,
)
from visavis.study.declaration import Study
from visavis.study.experiment import StudyExperiment
from visavis.study.films import film_columns
from visavis.study.live import live_columns
from visavis.study.look_measures import LOOK_COLUMNS
from visavis.study.measures import CLOCK_JUMP, HEAD_LOST_COLUMN, LOST_COLUMN, Measure
from visavis.study.names import GROUP_COLUMN, TRIAL_COLUMNS, UNUSED_COLUMN, changed_levels
from visavis.study.showing import PAGE_COLUMNS
from visavis.study.study_errors import line_saying

TABLES: Final[Mapping[str, str]] = {
    **dict.fromkeys(("pad_deg", "minimum_fixation_ms"), "sensitivity"),
    **{c.name: "statistics" for c in STATISTICS},
    **dict.fromkeys(columns_of_tests(()), "statistics"),
    **{c.name: "participants" for c in (*PEOPLE, *QUALITY_TABLE)},
    **{c.name: "trials" for c in (*LOOK_COLUMNS, LATE, CLOCK_JUMP, *WALK_COLUMNS, *HAND_COLUMNS)},
    **dict.fromkeys(
        (*film_columns(1, heard=True), *live_columns(("mould", "live"))),
        "trials",
    ),
    **{c.name: "trials" for c in PAGE_COLUMNS},
    **dict.fromkeys((LOST_COLUMN, HEAD_LOST_COLUMN), "trials"),
}
"""Columns of the tables of any study, beside those of every trial, and the table of each."""


def refuse_unusable_names(experiment: StudyExperiment, measures: Sequence[Measure]) -> None:
    """Refuse a study with names that it could not perform or not analyse.

    Raises:
        DesignError: all of them, with the line of the study file where it is known.
    """
    study = experiment.study
    problems = [
        f"{line_saying(study.files.path, name) or f'study {study.name}'}: {words}"
        for name, words in _problems(experiment, measures)
    ]
    if problems:
        raise DesignError("\n".join(dict.fromkeys(problems)))


def _problems(
    experiment: StudyExperiment, measures: Sequence[Measure]
) -> Iterator[tuple[str, str]]:
    """Yield a name of a study file and what is wrong with it."""
    study = experiment.study
    yield from _questionnaires(study)
    yield from _columns_twice(experiment, measures)
    for factor in study.design.factors:
        levels = (*experiment.parameters.get(factor.name, factor.levels), *factor.practice_only)
        for words in changed_levels(factor.name, levels):
            yield factor.name, words
    for name in study.design.derived:
        for words in changed_levels(name, experiment.levels[name]):
            yield name, words
    yield from _factors_named(study)
    yield from _roles(experiment)
    yield from _modules(experiment)


def _columns_twice(
    experiment: StudyExperiment, measures: Sequence[Measure]
) -> Iterator[tuple[str, str]]:
    """Yield factors and columns that would have the name of another column."""
    study, read = experiment.study, experiment.read.values()
    answers = people_columns(
        [questionnaire(n, study.folders) for n in _there(study)],
    )
    owners: dict[str, str] = {**dict.fromkeys(answers, "participants"), **TABLES}
    owner_words = {name: f"a column of the table {table}" for name, table in owners.items()}
    owner_words |= {m.column: "a measure" for m in measures}
    owner_words |= {n: "a column of a shown scene" for t in read for n in t.scene_columns}
    owner_words |= {n: "a column that the trial writes" for t in read for n in t.row_columns}
    for response in experiment.responses.values():
        words = f"a column of the answer {response.name}"
        owner_words |= {c.name: words for c in _columns(response)}
    for name in (*(f.name for f in study.design.factors), *study.design.derived):
        if name in owner_words:
            yield name, f"{name!r} is {owner_words[name]}; name the factor otherwise"
    kit_columns = TRIAL_COLUMNS - {"t_start_ns", "t_end_ns"} | {UNUSED_COLUMN, GROUP_COLUMN}
    for name in sorted({n for t in read for n in t.row_columns} & kit_columns):
        yield name, f"the trial writes {name!r}, a column of every trial; name it otherwise"
    measured = {m.column for m in study.analysis.measures if m.of is not None}
    for response in experiment.responses.values():
        for column in _columns(response):
            if column.name in measured:
                yield (
                    response.name,
                    f"the answer {response.name} has the column {column.name!r}, which is a "
                    "measure; name one of them otherwise",
                )
            if column.name in kit_columns:
                yield (
                    response.name,
                    f"the answer {response.name} has the column {column.name!r}, which is one of "
                    "every trial; name it otherwise",
                )
    for measure in study.analysis.measures:
        if measure.column in kit_columns and measure.of is not None:
            yield (
                measure.column,
                f"the measure {measure.column!r} is a column of every trial; name it otherwise",
            )


def _columns(response: object) -> tuple[Column, ...]:
    of: tuple[Column, ...] = response.columns()  # type: ignore[attr-defined]  # every response has
    return of


def _names_of_questionnaires(study: Study) -> tuple[str, ...]:
    return (*study.asks.after_block, *study.asks.questionnaires)


def _there(study: Study) -> list[str]:
    """Return the questionnaires that can be read."""
    missing = {name for name, _ in _questionnaires(study)}
    return [name for name in _names_of_questionnaires(study) if name not in missing]


def _questionnaires(study: Study) -> Iterator[tuple[str, str]]:
    for name in _names_of_questionnaires(study):
        try:
            questionnaire(name, study.folders)
        except LabError as error:
            yield name, str(error)


def _factors_named(study: Study) -> Iterator[tuple[str, str]]:
    """Yield what cells and families of tests call a factor, a level or a measure that is none."""
    within = [f.name for f in study.design.factors if not f.between]
    for name in study.analysis.cells:
        if name not in within:
            near = did_you_mean(name, within)
            yield name, f"cells: there is no factor within people {name!r}{near}"
    levels = {f.name: tuple(map(str, f.levels)) for f in study.design.factors}
    factors = (*levels, *study.design.derived)
    for family in study.analysis.families:
        for name in (family.factor, *((each,) if (each := getattr(family, "each", "")) else ())):
            if name not in factors:
                yield (
                    name,
                    f"family {family.family}: there is no factor {name!r}"
                    f"{did_you_mean(name, factors)}",
                )


def _roles(experiment: StudyExperiment) -> Iterator[tuple[str, str]]:
    """Yield devices that are nearly called like one of Visavis, or that nothing would open."""
    roles = (*experiment.study.devices.needs, *experiment.useful_roles)
    roles = (*roles, *(experiment.study.devices.spares or ()))
    for role in dict.fromkeys(roles):
        near = did_you_mean(role, ROLES)
        if role not in ROLES and "did you mean" in near:
            yield role, f"there is no device {role!r}{near}"
    armbands = [role for role in roles if role not in ROLES]
    for role in dict.fromkeys(r for t in experiment.read.values() for r in t.vibrating_roles):
        if role not in armbands:
            yield (
                role,
                f"the trial lets {role!r} vibrate, which the study neither needs nor uses; name it "
                f"in needs= or uses={did_you_mean(role, armbands)}",
            )


def _modules(experiment: StudyExperiment) -> Iterator[tuple[str, str]]:
    """Yield functions of a lab's own modules that cannot be imported."""
    study = experiment.study
    sections = [s for s in study.report.sections if isinstance(s, str)]
    pieces = [study.analysis.pieces] if isinstance(study.analysis.pieces, str) else []
    dressing = [study.procedure.dressed_by] if study.procedure.dressed_by else []
    dressing += sorted(frozenset().union(*(t.dressings for t in experiment.read.values())))
    for address in dict.fromkeys((*dressing, *sections, *pieces)):
        module, _, name = address.partition(":")
        if module.partition(".")[0] == "visavis":  # ours; some take a second to import
            continue
        try:
            getattr(importlib.import_module(module), name)
        except Exception as error:  # whatever a lab's module may raise
            yield (
                address,
                f"{address!r} cannot be imported ({type(error).__name__}: {error}); write it as "
                "module:function",
            )

"""Names, levels and orders that comparisons, measures, exclusions and claims use: whatever their
study does not have is refused when its file is opened.
"""

from collections.abc import Sequence
from typing import Any

from visavis.analysis.statistics_report.choices import PAIR_SIGN
from visavis.lab.errors import DesignError, UsageError
from visavis.lab.yaml_lines import did_you_mean, names_or_none
from visavis.protocol.plan.design import SESSION
from visavis.results.claims import printed_orders
from visavis.results.fidelity import design_names, names_of, refuse_unknown_values
from visavis.results.intake import questionnaire
from visavis.results.planned_tests import primary_tests
from visavis.results.tables.dictionary import PEOPLE, of_shown, people_columns, trial_columns
from visavis.stimuli.area_paths import FilesGone
from visavis.study.conditions import columns_asked
from visavis.study.declaration import Study
from visavis.study.exclusions import STANDARD_COLUMNS, Exclusion
from visavis.study.expectations import Order
from visavis.study.experiment import StudyExperiment
from visavis.study.measures import Measure
from visavis.study.responses import Choice
from visavis.study.sections import Confusion
from visavis.study.signal_detection import DetectionValue
from visavis.study.study_errors import line_saying


def refuse_unknown_names(experiment: StudyExperiment, measures: Sequence[Measure]) -> None:
    """Refuse comparisons, measures, exclusions and sections with names the study does not have.

    Raises:
        DesignError: with the line of the study file and the most similar valid name.
    """
    study = experiment.study
    measure_columns = tuple(m.column for m in measures)
    groups = study.analysis.groups
    factors = (
        *(f.name for f in study.design.factors),
        *study.design.derived,
        *groups,
        *((SESSION,) if study.design.sessions else ()),
    )
    uses = [
        *((c.dv, "measure", measure_columns) for c in study.analysis.compare),
        *(
            (name, "factor", factors)
            for c in study.analysis.compare
            for name in (*c.within, *c.between, *c.only, *((c.by,) if c.by else ()))
        ),
        *_asked_columns(experiment, measures),
    ]
    choices = tuple(n for n, r in experiment.responses.items() if isinstance(r, Choice))
    columns = (*factors, *(c.name for c in study.analysis.columns))
    for section in study.report.sections:
        if isinstance(section, Confusion):
            uses.append((section.answered, "choice", choices))
            uses.append((section.shown, "factor or column", columns))
            uses += [(section.by, "factor", factors)] if section.by else []
    roles = frozenset().union(*(t.roles for t in experiment.read.values()))
    losses = experiment.files_gone or FilesGone()
    areas = frozenset(losses.area_names).union(*(t.areas for t in experiment.read.values()))
    visible = tuple(sorted(roles | areas))
    if not losses.hides_areas:
        uses += [(n, "area or role", visible) for m in study.analysis.measures for n in m.areas]
    for name in (m.role for m in study.analysis.measures if m.role in areas - roles):
        raise DesignError(
            f"{line_saying(study.files.path, name) or study.name}: {name!r} is an area of "
            f"interest, and nobody's role; measure gaze on it by looks_at({name!r})"
        )
    if roles:
        who = tuple(sorted(roles))
        uses += [(m.role, "role", who) for m in study.analysis.measures if m.role]
    # A derived study inherits what was said of its base, also about what it left out.
    if study.report.source is not None and study.base is None:
        facts = [f for f in study.report.source.facts if names_of(f)]
        names = design_names(experiment) if facts else ()
        uses += [(f.of, "value of the design", names) for f in facts if f.of]
        for fact in (f for f in facts if not f.of):
            refuse_unknown_values(fact, names)
        for order in study.report.source.orders:
            gain = () if order.gain is None else (order.gain[0],)
            uses.append((order.measure, "measure", measure_columns))
            uses += [(n, "factor", factors) for n in (order.factor, *order.only, *gain) if n]
    detections = _detections(study)
    if detections:
        names_there = trial_columns(experiment, measures)
        responses = [r for t in experiment.read.values() for r in t.responses]
        for value in detections.values():
            uses += value.uses(names_there, responses, experiment.levels)
    own = [r for r in study.analysis.exclusions if r.column not in STANDARD_COLUMNS]
    for rule in own:
        uses += _unknown_column(rule, experiment, measures)
    for name, kind, valid_names in uses:
        if name not in valid_names:
            place = line_saying(study.files.path, name) or f"study {study.name}"
            near = did_you_mean(name, valid_names) or f"; there are {names_or_none(())}"
            is_short = near.endswith("?") and not kind.startswith("column")
            there = f" there are {names_or_none(valid_names)}" if is_short else ""
            raise DesignError(f"{place}: there is no {kind} {name!r}{near}{there}")
    primary_tests(study, experiment.compare)


def _asked_columns(
    experiment: StudyExperiment, measures: Sequence[Measure]
) -> list[tuple[str, str, tuple[str, ...]]]:
    """Return every column that conditions of comparisons and groups read, and all there are.

    Raises:
        DesignError: a group of people has the name of a column.
    """
    study = experiment.study
    groups, comparisons = study.analysis.groups, study.analysis.compare
    conditions = [text for c in comparisons for text in c.where]
    covariates = [name for c in comparisons for name in c.covariates]
    columns = columns_asked(conditions, (*groups, *covariates), groups)
    if not columns:
        return []
    questionnaires = [questionnaire(n, study.folders) for n in study.asks.questionnaires]
    there = {
        **trial_columns(experiment, measures),
        **people_columns(questionnaires),
    }
    for name in groups:
        if name in there:
            place = line_saying(study.files.path, name) or f"study {study.name}"
            raise DesignError(
                f"{place}: {name!r} is a column already; give the group of people another name"
            )
    return [(name, "column", (*there, *groups)) for name in columns]


def _detections(study: Study) -> dict[str, DetectionValue]:
    """Return the measures of signal detection by column.

    Raises:
        DesignError: a comparison takes one over what tells signals from others.
    """
    measures = {
        m.column: m.of_cell
        for m in study.analysis.measures
        if isinstance(m.of_cell, DetectionValue)
    }
    for compare in (c for c in study.analysis.compare if c.dv in measures):
        signal = measures[compare.dv].signal
        if signal in (*compare.within, *compare.between, *compare.only, compare.by):
            place = line_saying(study.files.path, compare.dv) or f"study {study.name}"
            raise DesignError(
                f"{place}: {compare.dv} is taken from trials with a signal and without, and "
                f"{signal!r} tells one from the other: no cell of it has both; compare "
                f"{compare.dv} over another factor"
            )
    return measures


def refuse_unknown_levels(experiment: StudyExperiment) -> None:
    """Refuse comparisons, directions of claims and published results of levels not there.

    Raises:
        DesignError: with the line of the study file and the most similar valid name.
    """
    study = experiment.study
    levels = {f.name: tuple(map(str, f.levels)) for f in study.design.factors}
    levels |= {name: tuple(of) for name, of in study.analysis.groups.items()}
    levels |= {SESSION: tuple(study.design.sessions)} if study.design.sessions else {}
    # Groups of people may be left to whoever derives the study, and derived columns follow
    # from trials.
    between = {f.name for f in study.design.factors if f.between}
    for compare in study.analysis.compare:
        for factor, level in compare.only.items():
            if factor in levels.keys() - between and str(level) not in levels[factor]:
                place = line_saying(study.files.path, str(level)) or study.name
                raise DesignError(
                    f"{place}: only={{{factor!r}: {level!r}}} names {level!r}, which is no "
                    f"level of {factor}{did_you_mean(level, levels[factor])}"
                )
    for compare in (c for c in study.analysis.compare if c.within or c.between):
        texts = [(compare.expects, compare.orders)]
        texts += [
            (result.order, printed_orders(compare, term))
            for term, result in compare.published_terms.items()
        ]
        for text, orders in texts:
            for order in orders:
                factors = (order.factor,) if order.factor else compare.within
                names = [level for f in factors for level in levels.get(f, ())]
                if compare.model == "bradleyterry":
                    names = [item for level in names for item in level.split(PAIR_SIGN)]
                # An interaction, like a one-sided test, has one direction between two levels.
                two_only = len(orders) == 2 or (compare.one_sided and text == compare.expects)
                _refuse_order(study, text, order, tuple(dict.fromkeys(names)))
                count = len(names or experiment.levels.get(order.factor, ()))
                if two_only and count > 2:
                    place = line_saying(study.files.path, text) or f"study {study.name}"
                    raise DesignError(
                        f"{place}: {text!r} is of an interaction or one-sided, and {order.factor} "
                        f"has {count} levels; only between two levels is there one direction. "
                        "Expect an order of one factor, tested on both sides, instead"
                    )


def refuse_impossible_tests(experiment: StudyExperiment) -> None:
    """Refuse choices that a comparison's test does not have, before anybody takes part.

    Raises:
        DesignError: with the line of the study file and what the test has.
    """
    study = experiment.study
    groups = {name: tuple(of) for name, of in study.analysis.groups.items()}
    levels: dict[str, tuple[Any, ...]] = {**experiment.levels, **groups}
    for compare in experiment.compare:
        factors = (*compare.within, *compare.between)
        if not set(factors) <= set(levels):
            continue  # refused by name elsewhere, or a column that trials write
        try:
            compare.question({f: tuple(map(str, levels[f])) for f in factors})
        except UsageError as problem:
            place = line_saying(study.files.path, compare.dv) or f"study {study.name}"
            raise DesignError(f"{place}: the comparison {compare.name}: {problem}") from problem


def _refuse_order(study: Study, text: str, order: Order, levels: Sequence[str]) -> None:
    """Refuse an order of other levels than these; those of derived columns follow from trials."""
    for name in order.names if levels else ():
        if name not in levels:
            place = line_saying(study.files.path, text) or f"study {study.name}"
            near = did_you_mean(name, levels)
            raise DesignError(f"{place}: {text!r} names {name!r}, which is no level{near}")


def _unknown_column(
    rule: Exclusion, experiment: StudyExperiment, measures: Sequence[Measure]
) -> list[tuple[str, str, tuple[str, ...]]]:
    """Return the error of a rule whose column no trial and no person can have; else nothing."""
    study = experiment.study
    if rule.level == "participant":
        valid_names = tuple(c.name for c in PEOPLE)
        # The names of a study's own facts are known only once there are data.
        is_known = rule.column in valid_names or study.analysis.facts_of is not None
    else:
        valid_names = tuple(trial_columns(experiment, measures))
        roles = frozenset().union(*(t.roles for t in experiment.read.values()))
        is_known = rule.column in valid_names or of_shown(rule.column, roles)
    return [] if is_known else [(rule.column, f"column of {rule.level}s", valid_names)]

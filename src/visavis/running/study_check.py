"""Check a study before anybody is invited: what the test beside a study's file calls.

A study is checked without sessions: plans are made, every text is filled in every language, and
every condition is performed by a simulated person on the short path that power uses. Trials are
performed a second time with the levels of all factors renamed; people must not notice.
"""

import dataclasses
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.report import ReportProvenance
from visavis.analysis.report.notation import count_of
from visavis.lab.errors import DesignError, LabError
from visavis.lab.geometry import Vector, unit
from visavis.protocol.plan.columns import ENGINE_COLUMNS
from visavis.protocol.plan.design import combinations_of
from visavis.protocol.plan.orders import Cell, Constraint
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.protocol.plan.steps import Scalar
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.tables.dictionary import trial_columns, undescribed_columns
from visavis.running.quick import quick_rows
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.study.declaration import Study
from visavis.study.dry_run import still_view
from visavis.study.experiment import StudyExperiment
from visavis.study.measures import Measure
from visavis.study.scenes import Scene, Staging, stage
from visavis.study.study_errors import users_mistake, users_mistakes
from visavis.study.texts import languages_in, own_texts, placeholders_of
from visavis.study.trial import TrialScript

SEED: Final = 1
PEOPLE: Final = 4
"""How many people's plans are looked at."""
OWN_NUMBERS: Final = ("choices.", "labels.")
"""Texts below these may name numbers: each stands for one option or level."""
LEVEL_PREFIX: Final = "level_"
Derivation: TypeAlias = Callable[[Mapping[str, Any]], Scalar]


def check_study(study: str | Path | Study, parameters: Mapping[str, Any] | None = None) -> None:
    """Check a study, given as object, file or name; `parameters` replace some of its own.

    Raises:
        UsageError: there is no such study.
        DesignError: listing everything that is wrong with it.
    """
    opened_study = OpenedStudy(study) if isinstance(study, Study) else find_study(str(study))
    set_to = dict(parameters or {})
    problems: list[str] = []
    try:
        problems += text_problems(opened_study.study)
        experiment = opened_study.experiment_to_run(set_to)
        _ = experiment.sounds  # raises if a file cannot be played
        problems += plan_problems(experiment)
        for language in languages_of(opened_study.study):
            opened_study.experiment({**set_to, "language": language}).plan(0, SEED)
        problems += picture_problems(experiment)
        problems += performing_problems(opened_study, experiment)
    except Exception as error:
        mistake = error if isinstance(error, LabError) else users_mistake(error)
        if mistake is None:
            raise
        problems.append(str(mistake))
    if problems:
        lines = "\n  ".join(problems)
        raise DesignError(
            f"study {opened_study.name} has {count_of(len(problems), 'problem')}:\n  {lines}"
        )


def plan_problems(experiment: StudyExperiment) -> list[str]:
    """Name plans that differ when made again, or hold some conditions more often than others."""
    problems = []
    design = experiment.study.design_with(experiment.parameters)
    groups = max(1, len(combinations_of(design.between)))
    for index in range(PEOPLE * groups):
        plan = experiment.plan(index, SEED)
        if plan != experiment.plan(index, SEED):
            problems.append(f"the plan of participant {index + 1} differs when it is made again")
        names = [f.name for f in design.within]
        main_trials = [t for t in plan.trials if not t.is_practice]
        times = Counter(tuple(t.factors[n] for n in names) for t in main_trials)
        expected = len(combinations_of(design.within))
        if len(times) != expected or len(set(times.values())) > 1:
            problems.append(
                f"participant {index + 1} does not meet every condition equally often: "
                + ", ".join(f"{' '.join(map(str, k))} {v} times" for k, v in sorted(times.items()))
            )
    return problems


def languages_of(study: Study) -> tuple[str, ...]:
    """Return the languages in which a study has all of its texts."""
    each = [set(languages_in(folder)) for folder in study.text_folders]
    return tuple(sorted(set.intersection(*each))) if each else ()


def text_problems(study: Study) -> list[str]:
    """Say where languages differ in names or placeholders, and where a text names a number."""
    problems = []
    for folder in study.text_folders:
        texts = {
            language: own_texts(folder / f"{language}.yaml") for language in languages_in(folder)
        }
        everything = {name for entries in texts.values() for name in entries}
        for language, entries in texts.items():
            at = folder / f"{language}.yaml"
            problems += [
                f"{at} has no {n}, which another language has"
                for n in sorted(everything - set(entries))
            ]
            problems += [
                f"{at}, {name}: the text is empty" for name, text in entries.items() if not text
            ]
            for name, text in entries.items():
                bare = re.sub(r"\{[^{}]*\}", "", text)
                if re.search(r"\d", bare) and not name.startswith(OWN_NUMBERS):
                    problems.append(
                        f"{at}, {name}: it names a number itself, which a parameter may "
                        f"contradict; use a placeholder, such as {{trials}}: {text!r}"
                    )
        for name in sorted(everything):
            placeholders = {
                language: sorted({_bare(p) for p in placeholders_of(entries[name])})
                for language, entries in texts.items()
                if name in entries
            }
            if len({tuple(p) for p in placeholders.values()}) > 1:
                summary = "; ".join(
                    f"{k}: {', '.join(v) or 'none'}" for k, v in placeholders.items()
                )
                problems.append(f"{folder}, {name}: placeholders differ ({summary})")
    return problems


def _bare(placeholder: str) -> str:
    """Return a placeholder without its form: languages choose between digits and words."""
    return placeholder.removesuffix("_in_words").removesuffix("_ordinal")


def picture_problems(experiment: StudyExperiment) -> list[str]:
    """Say which scenes cannot be made into pictures."""
    problems = []
    for key, read in experiment.read.items():
        for scene in read.scenes:
            try:
                frame = first_view(experiment, scene)
                if frame is not None:
                    picture_of(frame)
            except LabError as error:
                problems.append(f"trial {dict(key)}, scene {scene.name}: {error}")
    return problems


def first_view(experiment: StudyExperiment, scene: Scene) -> Any:
    """Return what the first frame of a scene shows."""
    staging = Staging(np.random.default_rng(0), 1.0, 0, experiment.settings.folder)
    return stage(scene, staging, experiment.study.procedure.makers).frame(still_view(), 0)


def performing_problems(opened_study: OpenedStudy, experiment: StudyExperiment) -> list[str]:
    """Say what went wrong when a simulated person performed every condition once."""
    measures = opened_study.measures(experiment)
    rows = _perform_conditions(opened_study, experiment, measures)
    described_columns = trial_columns(experiment, measures)
    problems = [
        f"column {name!r} of the trials is not described; name it in columns or measures"
        for name in undescribed_columns(rows.columns, described_columns)
    ]
    problems += analysis_problems(opened_study, experiment, rows)
    other = OpenedStudy(rename_levels(opened_study.study))
    same = renamed_parameters(opened_study.study, experiment.overrides)
    again = _perform_conditions(other, other.experiment(same), measures)
    names = {f.name for f in opened_study.study.design.factors}
    problems += [
        f"{column!r} changes when the levels are renamed: a person or measure sees their names"
        for column in rows.columns
        if column not in names and not (column in again and rows[column].equals(again[column]))
    ]
    return problems


def try_analysis(opened_study: OpenedStudy, experiment: StudyExperiment) -> None:
    """Perform every condition once by a simulated person, and analyse that to the report.

    Raises:
        DesignError: a trial cannot be performed, or its data could not be analysed.
    """
    with users_mistakes():
        measures = opened_study.measures(experiment)
        rows = _perform_conditions(opened_study, experiment, measures)
    problems = analysis_problems(opened_study, experiment, rows)
    if problems:
        raise DesignError(f"study {opened_study.name}: {'; '.join(problems)}")


def analysis_problems(
    opened_study: OpenedStudy, experiment: StudyExperiment, rows: pd.DataFrame
) -> list[str]:
    """Say why simulated trials could not be analysed, from their selection to the report.

    Nothing is said of a study that measures its recordings piece by piece: its analysis needs
    tables that only recordings give.
    """
    if opened_study.pieces is not None:
        return []
    # Imported here: figures take a second to import, which plans and sessions need not.
    from visavis.results.outputs import write_study

    nothing = pd.Series([None] * len(rows), index=rows.index, dtype=object)
    rows = rows.assign(**{str(c.name): nothing for c in ENGINE_COLUMNS if c.name not in rows})
    forms = opened_study.original_questionnaires(opened_study.study.asks.questionnaires)
    people = pd.DataFrame({"participant": rows["participant"].unique()})
    question_ids = [q.question_id for form in forms for q in form.questions()]
    scores = [f"{form.name}_{name}" for form in forms for name in form.scores]
    people = people.reindex(columns=["participant", *question_ids, *scores])
    counts = {str(name): int(n) for name, n in rows.groupby("participant").size().items()}
    try:
        analysis = opened_study.analysis_of_rows(experiment, rows, people, planned_counts=counts)
        with TemporaryDirectory() as folder:
            provenance = ReportProvenance(opened_study.name, opened_study.study.version, "")
            write_study(analysis, experiment, forms, provenance, Path(folder))
    except Exception as error:
        mistake = error if isinstance(error, LabError) else users_mistake(error)
        words = f"{type(error).__name__}: {error}" if mistake is None else str(mistake)
        return [f"its data could not be analysed: {words}"]
    return []


def rename_levels(study: Study) -> Study:
    """Return the same study with the levels of its factors renamed: level_1, level_2."""
    new = {
        f.name: {level: f"{LEVEL_PREFIX}{i}" for i, level in enumerate(f.levels, start=1)}
        for f in study.design.factors
    }
    old = {name: {v: k for k, v in levels.items()} for name, levels in new.items()}

    def with_old_names(
        plan: Callable[[TrialScript], Iterator[Any]],
    ) -> Callable[[TrialScript], Any]:
        def plan_of(script: TrialScript) -> Iterator[Any]:
            factors = _translate(script.trial.factors, old)
            script.trial = dataclasses.replace(script.trial, factors=factors)
            return (yield from plan(script))

        return plan_of

    def check_of(parameters: Mapping[str, Any]) -> None:
        if study.design.check_of is not None:
            study.design.check_of(_translate_levels(parameters, old))

    practice, intertrial = study.design.practice, study.procedure.intertrial_of
    items = study.design.items
    return study.with_changes(
        factors=tuple(
            dataclasses.replace(f, levels=tuple(new[f.name].values())) for f in study.design.factors
        ),
        practice=practice if isinstance(practice, int) else [_translate(c, new) for c in practice],
        items=None if items is None else dataclasses.replace(items, levels=old),
        derived={name: _of_old(of, old) for name, of in study.design.derived.items()},
        constraints=[_rule_for_old_names(rule, old) for rule in study.design.constraints],
        plan_of=with_old_names(study.trial_plan),
        intertrial_of=None if intertrial is None else with_old_names(intertrial),
        check_of=check_of,
        ranges={k: v for k, v in study.design.ranges.items() if k not in new},
        prepare_of=None,  # it would only save time
        compare=(),
        primary=(),
        sections=[],
    )


def _translate(cell: Mapping[str, Any], names: Mapping[str, Mapping[Any, Any]]) -> dict[str, Any]:
    return {k: names[k].get(v, v) if k in names else v for k, v in cell.items()}


def _rule_for_old_names(rule: Constraint, old: Mapping[str, Mapping[Any, Any]]) -> Constraint:
    """Return a rule of order that sees the conditions under their old names."""

    def allows(previous: Sequence[Cell], candidate: Cell) -> bool:
        return rule.allows([_translate(cell, old) for cell in previous], _translate(candidate, old))

    return dataclasses.replace(rule, allows=allows)


def _of_old(of: Derivation, old: Mapping[str, Mapping[Any, Any]]) -> Derivation:
    return lambda factors: of(_translate(factors, old))


def renamed_parameters(study: Study, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters for a renamed study, levels of its factors by their new names."""
    new = {
        f.name: {level: f"{LEVEL_PREFIX}{i}" for i, level in enumerate(f.levels, start=1)}
        for f in study.design.factors
    }
    return _translate_levels(parameters, new)


def _translate_levels(
    parameters: Mapping[str, Any], names: Mapping[str, Mapping[Any, Any]]
) -> dict[str, Any]:
    """Return parameters in which the levels of factors are called as `names` says."""
    return {
        name: [names[name][level] for level in value] if name in names else value
        for name, value in parameters.items()
    }


class _EachOnce(StudyExperiment):
    """An experiment whose plan holds the first trial of every condition."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the plan with those trials alone."""
        whole_plan = super().plan(participant_index, seed, group)
        cells: set[tuple[Scalar, ...]] = set()

        def is_new(trial: Trial) -> bool:
            key = tuple(trial.factors.values())
            fresh = not trial.is_practice and key not in cells
            cells.update([key] if fresh else [])
            return fresh

        blocks = [
            dataclasses.replace(b, trials=tuple(t for t in b.trials if is_new(t)))
            for b in whole_plan.blocks
        ]
        return dataclasses.replace(whole_plan, blocks=tuple(b for b in blocks if b.trials))


class _Exact:
    """A tracker without errors that sees every eye that is open."""

    delay_ns = 8_000_000

    def measure(
        self, eyes: npt.NDArray[np.void], *, first_sample: int, stretch: int, fit: int
    ) -> tuple[Vector, npt.NDArray[np.bool_]]:
        """Return combined directions in the head frame (n, 3) and validity (n,)."""
        both = eyes["left_direction_head"] + eyes["right_direction_head"]
        return unit(both), np.asarray(eyes["openness_01"] > 0.5, np.bool_)


def _perform_conditions(
    opened_study: OpenedStudy, experiment: StudyExperiment, measures: Sequence[Measure]
) -> pd.DataFrame:
    each = _EachOnce(experiment.study, experiment.overrides)
    quick_measures = [m for m in measures if m.of is None or m.needs_gaze]
    rows = []
    groups = len(combinations_of(experiment.study.design_with(experiment.parameters).between)) or 1
    for index in range(groups):
        person = opened_study.participant(index, SEED, effect=True, experiment=each)
        rows.append(quick_rows(each, person, _Exact(), quick_measures, index=index, seed=SEED))
    return pd.concat(rows, ignore_index=True)

"""The design that a study's sessions were made with, and its changes since then.

Every session carries its design: what is varied, how often, what is shown and asked. Texts and the
analysis may change while a study runs; the design may not.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import DataError, RecordingError, UsageError
from visavis.protocol.plan.design import SESSION
from visavis.recording.journal import as_json
from visavis.recording.manifest import (
    DESIGN_KEY,
    PRACTICE_UNTIL_KEY,
    Manifest,
    read_manifest,
)
from visavis.results.locked_plan.deviations import NOTHING, Deviation, differing
from visavis.results.opened_study import OpenedStudy
from visavis.running.sessions.study_folder import holds_trial, session_folders
from visavis.stimuli.own_room import Room
from visavis.study.experiment import StudyExperiment
from visavis.study.files_read import differing_files, stimulus_files
from visavis.study.responses import kind_of

MAX_VALUES: Final = 12
"""For an option with more values than this, only their number is kept."""


def design_of(experiment: StudyExperiment) -> dict[str, Any]:
    """Return what a study's sessions show and ask, and in which order, as plain data."""
    study = experiment.study
    factors = study.design_with(experiment.parameters).all_factors
    factor_names = {f.name for f in study.design.factors}  # whose levels may be set like parameters
    until = study.design.practice_until
    content: dict[str, Any] = {
        "parameters": {k: v for k, v in experiment.parameters.items() if k not in factor_names},
        "factors": {
            f.name: {"levels": list(f.levels), "between": bool(f.between)} for f in factors
        },
        "order": {
            "blocked_by": study.design.blocked_by or "",
            "block_order": study.design.block_order,
            "balanced": list(study.design.balanced),
        },
        "questionnaires": [*study.asks.after_block, *study.asks.questionnaires],
        "questions": {
            name: {"kind": kind_of(response), "options": list(map(str, response.options))}
            for name, response in experiment.responses.items()
        },
        "scenes": _scenes(experiment),
        **_lengths(experiment),
        PRACTICE_UNTIL_KEY: {} if until is None else asdict(until),
    }
    design: dict[str, Any] = as_json(content)
    return design


def _lengths(experiment: StudyExperiment) -> dict[str, Any]:
    """Return the entry with how long trials last: nothing in it where sounds play, whose files may
    lie elsewhere; no entry where a film is gone that would tell.
    """
    read, losses = experiment.read.values(), experiment.files_gone
    if losses is not None and losses.hides_lengths:
        return {}
    seconds = sorted({round(t.seconds, 3) for t in read})
    return {"trials": {} if any(t.sounds for t in read) else {"seconds": seconds}}


def _scenes(experiment: StudyExperiment) -> dict[str, dict[str, Any]]:
    """Return every scene that trials show, with the values that each of its options takes."""
    options_by_scene: dict[str, dict[str, set[str]]] = {}
    for scene in (scene for trial in experiment.read.values() for scene in trial.scenes):
        options = options_by_scene.setdefault(scene.name, {})
        for name, value in scene.options.items():
            options.setdefault(name, set()).add(_value_text(value))
    return {
        scene: {
            name: sorted(values) if len(values) <= MAX_VALUES else f"{len(values)} values"
            for name, values in options.items()
        }
        for scene, options in options_by_scene.items()
    }


def _value_text(value: Any) -> str:
    """Return an option's value in words that are the same on every machine."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Path):
        return value.name
    if isinstance(value, str | int | bool | None):
        return str(value)
    if isinstance(value, Room):
        return _value_text((value.file, *value.stand_m, value.yaw_deg))
    if isinstance(value, list | tuple):
        return ", ".join(map(_value_text, value))
    return type(value).__name__


def design_of_session(manifest: Manifest) -> dict[str, Any]:
    """Return the design of a session; if it kept none, the parameters of its plan."""
    design = manifest.configuration.get(DESIGN_KEY)
    if design is not None:
        return dict(design)
    parameters = manifest.plan.get("parameters", {})
    return {"parameters": {k: v for k, v in parameters.items() if k != "language"}}


def changes_since(first: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[Deviation, ...]:
    """Return the differences between a design and the first one, in the parts that both have."""
    if "factors" not in first:  # only a plan's parameters, and factors that were set
        now = {"parameters": _as_planned(now["parameters"])}
        first = {
            "parameters": {k: v for k, v in first["parameters"].items() if k in now["parameters"]}
        }
    return tuple(
        d
        for part, before in first.items()
        if part in now
        for d in differing(part, before, now[part])
    )


def _as_planned(parameters: Mapping[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in parameters.items() if isinstance(v, str | int | float | bool)}


def in_words(changes: Sequence[Deviation]) -> str:
    """Describe changes of a design: what changed, its value at first and its value now."""

    def describe(c: Deviation) -> str:
        if c.planned == NOTHING:
            return f"{c.what} is new"
        return f"{c.what} is gone" if c.done == NOTHING else f"{c.what} {c.planned}, now {c.done}"

    return "; ".join(map(describe, changes))


def manifests_of(folder: Path) -> Iterator[Manifest]:
    """Yield the manifests of a study's sessions that can be read and hold a trial, by participant.

    A session that ended before its first trial binds nothing: the design is as it is by then.
    """
    for session in session_folders(folder):
        try:
            if holds_trial(session):
                yield read_manifest(session)
        except (RecordingError, OSError):
            continue


def changes_of_design(folder: Path, experiment: StudyExperiment) -> tuple[Deviation, ...]:
    """Return the differences between a study and the design of its first session."""
    first = next(manifests_of(folder), None)
    return () if first is None else changes_since(design_of_session(first), design_of(experiment))


def require_same_design(folder: Path, experiment: StudyExperiment, way_out: str) -> None:
    """Refuse a further session whose design differs from that of the first one.

    Raises:
        UsageError: naming what differs, and `way_out`.
    """
    changes = changes_of_design(folder, experiment)
    if changes:
        raise UsageError(
            f"the sessions in {folder} were made with another design, and a folder holds sessions "
            f"of one: {in_words(changes)}. {way_out}"
        )


def note_on_files(folder: Path, experiment: StudyExperiment) -> str:
    """Return a note where what a study shows is another file than in the first session, or ""."""
    first = next(manifests_of(folder), None)
    if first is None:
        return ""
    names = differing_files([first.configuration, stimulus_files(experiment)])
    if not names:
        return ""
    return (
        f"other files than in the first session of {folder}: {', '.join(names)}. Who comes now "
        "sees or hears something else; put the first ones back, or give the new study another name"
    )


def as_recorded(study: OpenedStudy, manifests: Sequence[Manifest]) -> OpenedStudy:
    """Return a study whose factors have the levels that sessions were made with."""
    recorded_levels: dict[str, list[Any]] = {}
    for manifest in manifests:
        for name, factor in design_of_session(manifest).get("factors", {}).items():
            levels = recorded_levels.setdefault(name, [])
            levels += [level for level in factor["levels"] if level not in levels]
    factors = [
        replace(f, levels=tuple(recorded_levels[f.name]))
        if f.name in recorded_levels and set(recorded_levels[f.name]) != set(f.levels)
        else f
        for f in study.study.design.factors
    ]
    now = study.study.design
    sessions = recorded_sessions(manifests) or tuple(now.sessions)
    if factors == list(now.factors) and sessions == tuple(now.sessions):
        return study
    return replace(study, study=study.study.with_changes(factors=factors, sessions=sessions))


def recorded_sessions(manifests: Sequence[Manifest]) -> tuple[str, ...]:
    """Return what the design of these recordings calls sessions; () where it names none."""
    designs = (design_of_session(m).get("factors", {}) for m in manifests)
    return next((tuple(d[SESSION]["levels"]) for d in designs if SESSION in d), ())


def require_recorded_factors(
    folder: Path, manifests: Sequence[Manifest], experiment: StudyExperiment
) -> None:
    """Refuse to analyse sessions by a factor that none of them had.

    Raises:
        DataError: naming it, and what to do.
    """
    old = {
        name
        for manifest in manifests
        for block in manifest.plan.get("blocks", ())
        for trial in block["trials"]
        for name in trial["factors"]
    }
    new = [name for name in experiment.levels if name not in old and name != SESSION]
    if old and new:
        raise DataError(
            f"no session in {folder} had the factor {', '.join(new)}, which the study has now; "
            f"they had {', '.join(sorted(old))}. Put the study file back as it was to analyse them"
        )


def compare_designs(
    manifests: Sequence[Manifest], experiment: StudyExperiment
) -> tuple[tuple[Deviation, ...], str]:
    """Return how the sessions' design differs from the study's now, and a warning of sessions that
    differ among each other ("" if none do).
    """
    designs = [design_of_session(m) for m in manifests]
    first = designs[0]
    pairs = zip(manifests, designs, strict=True)
    comparable = ((m, d) for m, d in pairs if d.keys() ^ first.keys() <= {PRACTICE_UNTIL_KEY})
    others = {m.participant: changes_since(first, d) for m, d in comparable}
    apart = {who: changes for who, changes in others.items() if changes}
    summary = "; ".join(f"{who}: {in_words(changes)}" for who, changes in apart.items())
    mixture_warning = (
        f"{len(apart)} of {len(manifests)} sessions were made with another design than "
        f"{manifests[0].participant}'s, and means are taken over all: {summary}"
        if apart
        else ""
    )
    return changes_since(first, design_of(experiment)), mixture_warning

"""What a locked plan holds: everything of a study that decides its results, as plain data."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any, Final

from visavis.protocol.plan.design import SESSION
from visavis.recording.journal import as_json
from visavis.recording.provenance import Provenance
from visavis.results.family_tests import DEFAULT_TEST_RULES
from visavis.results.picture_delay import SETTING, delay_of
from visavis.results.planned_tests import planned_tests, primary_tests
from visavis.study.comparisons import Compare
from visavis.study.exclusions import limits_in_force
from visavis.study.experiment import StudyExperiment
from visavis.study.files_read import digests_of_files
from visavis.study.measures import Measure

LOCK_VERSION: Final = 1
VERSIONS: Final = "versions"
GROUPS: Final = "groups"
PRIMARY_CLAIMS: Final = "primary"
FILE_SHA256: Final = "study_file_sha256"
CODE_SHA256: Final = "code_sha256"
"""The study file alone, without its texts and questionnaires, which are among the files."""
FILES: Final = "files"
COMPARED_PARTS: Final = (
    "parameters",
    "factors",
    "measures",
    "comparisons",
    GROUPS,
    PRIMARY_CLAIMS,
    "families",
    "tests",
    "exclusions",
    "questionnaires",
    "seed",
    VERSIONS,
)
"""The parts of a plan that are compared with what was done."""
_WORDING: Final = ("family", "names", "noun", "words")


def plan_content(
    experiment: StudyExperiment,
    measures: Sequence[Measure],
    *,
    seed: int,
    provenance: Provenance,
    file_sha256: str = "",
    code_sha256: str = "",
    settings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the plan of a study as plain data; `settings` replace limits of exclusion rules.

    Values are texts, numbers, booleans, lists or mappings. Comparisons, measures and rules have
    their names as keys, so that two plans can be compared.
    """
    study = experiment.study
    design = study.design_with(experiment.parameters)
    groups = study.analysis.groups
    levels = {f.name: tuple(map(str, f.levels)) for f in design.factors}
    levels |= {name: tuple(of) for name, of in groups.items()}
    levels |= {SESSION: design.sessions} if design.sessions else {}
    limits = limits_in_force(study.analysis.exclusions, settings or {})
    rules = DEFAULT_TEST_RULES.with_settings(settings or {})
    thresholds, pieces = study.thresholds_with(settings or {}), study.analysis.measured_in_pieces
    compare = [c.with_alphas(settings or {}) for c in study.analysis.compare]
    claims = planned_tests(study, study.analysis.compare)
    content = {
        "study": study.name,
        "title": study.title,
        "question": study.question,
        "study_version": study.version,
        "source": "" if study.report.source is None else study.report.source.citation,
        "seed": seed,
        "parameters": dict(experiment.parameters),
        "factors": {
            f.name: {"levels": list(f.levels), "between": bool(f.between)}
            for f in design.all_factors
        },
        "questionnaires": list(study.asks.questionnaires),
        "measures": {
            m.column: {
                "words": m.words,
                "unit": m.unit,
                "aggregate": m.aggregate,
                "needs_gaze": m.needs_gaze,
                **({} if m.of_cell is None else {"fitted": str(m.of_cell)}),
            }
            for m in measures
        },
        "comparisons": dict(_comparisons(compare, levels)),
        # Plans of earlier versions lack groups of people that follow from answers.
        **({GROUPS: {name: dict(of) for name, of in groups.items()}} if groups else {}),
        # By name with what is claimed; plans of earlier versions lack them.
        PRIMARY_CLAIMS: {
            name: claims[name] for name in primary_tests(study, study.analysis.compare)
        },
        # Functions cannot be written as data, and wording changes no result.
        "families": {
            f"{i}. {family.family}": {
                f.name: value
                for f in fields(family)
                if not callable(value := getattr(family, f.name)) and f.name not in _WORDING
            }
            for i, family in enumerate(study.analysis.families, start=1)
        },
        # Only the thresholds that this study uses: a change of any other is no deviation.
        "tests": {
            **(asdict(rules) if study.analysis.families else {}),
            **({} if thresholds is None else asdict(thresholds)),
            **({} if pieces is None else asdict(pieces.how_with(settings or {}))),
            **({} if (late := delay_of(settings or {})) is None else {SETTING: late}),
        },
        "exclusions": {
            r.name: {
                "level": r.level,
                "column": r.column,
                "limit": limits[r.name],
                "leaves_out": "missing" if r.if_missing else "above" if r.above else "below",
            }
            for r in study.analysis.exclusions
        },
        VERSIONS: {
            "python": provenance.python,
            **provenance.packages,
            "code revision": provenance.code_revision,
        },
        FILE_SHA256: file_sha256,
        CODE_SHA256: code_sha256,
        FILES: digests_of_files(experiment),
    }
    plan: dict[str, Any] = as_json(content)
    return plan


def _comparisons(
    compare: Sequence[Compare], levels: dict[str, tuple[str, ...]]
) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, one in comparisons_by_name(compare).items():
        is_in_design = {*one.within, *one.between} <= set(levels)
        about = {f.name: getattr(one, f.name) for f in fields(one)}
        del about["published"], about["pairs"]
        about["only"] = dict(one.only)
        if not one.only:  # plans of earlier versions lack this key
            del about["only"]
        if one.raters == "participant":  # and this one
            del about["raters"]
        if not one.expects:  # and these
            del about["expects"]
        for key in ("one_sided", "by", "where", "simple"):
            if not about[key]:
                del about[key]
        about["test"] = one.question(levels).test if is_in_design else one.test
        about["options"] = {key: str(value) for key, value in one.options}
        yield name, about


def comparisons_by_name(compare: Sequence[Compare]) -> dict[str, Compare]:
    """Return comparisons by name; a number is added where several have the same name."""
    by_name: dict[str, Compare] = {}
    for one in compare:
        name, n = one.name, 1
        while name in by_name:
            n += 1
            name = f"{one.name} ({n})"
        by_name[name] = one
    return by_name

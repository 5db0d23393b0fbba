"""Say what every column of the tables beside the trial table is, as JSON sidecars."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from experiments.stare.comparisons import SCORE_COLUMN
from experiments.stare.design import CONDITIONS
from experiments.stare.published import COMPARISONS
from experiments.stare.study import QUESTIONNAIRES
from experiments.stare.terms import CONDITION_NAMES
from protocol.questionnaires import Question, load_questionnaire, score_range
from visavis.looks import LOOK_COLUMNS, MAIN_MEASURES
from visavis.quality import DRIFT, END_ACCURACY, REJECTED

Entry = Mapping[str, Any]
FAMILIES = {
    "conditions": "the thirty tests: five comparisons of six measures",
    "places": "averted against directed gaze at each of nine places",
    "zones": "first fixation time by zone",
    "anxiety": "Spearman correlations with the social anxiety score",
    "second view": "comparisons on fixations found by velocity and by dispersion",
    "without exclusions": "the thirty tests on every finished trial",
}


def _entry(description: str, units: str = "", levels: Mapping[str, str] | None = None) -> Entry:
    entry: dict[str, Any] = {"Description": description}
    if units:
        entry["Units"] = units
    if levels:
        entry["Levels"] = dict(levels)
    return entry


YES_NO = {"True": "yes", "False": "no"}
_SIMULATED = _entry("nobody took part: simulated participant or devices", levels=YES_NO)
_MEASURES = {c.name: c for c in LOOK_COLUMNS if c.name in MAIN_MEASURES}
_CONDITION = _entry("gaze of the active agent", levels=CONDITION_NAMES)


def participants_dictionary() -> dict[str, Entry]:
    """Describe participants.csv: quality, answers, scores, exclusion."""
    entries: dict[str, Entry] = {
        "participant": _entry("label from the ledger"),
        "accuracy_deg": _entry("mean error of the validations in force", "deg"),
        "precision_deg": _entry("mean RMS sample to sample of those validations", "deg"),
        "worst_point_deg": _entry("largest error at a point of those validations", "deg"),
        "lost_01": _entry("mean share of a finished trial without usable gaze", "1"),
        "calibrations": _entry("validations in force during finished trials", "1"),
        "trials": _entry("trials finished, training left out", "1"),
        "trials_out": _entry("of these, trials that lost more gaze than the limit", "1"),
        END_ACCURACY: _entry("mean error of the validation after the last trial", "deg"),
        DRIFT: _entry(
            "error after the last trial minus that of the validation before; positive: worse", "deg"
        ),
        REJECTED: _entry("validations that did not meet the thresholds", "1"),
        "excluded": _entry("why the participant is not in the statistics; empty: is"),
        "is_simulated": _SIMULATED,
    }
    for name in QUESTIONNAIRES:
        questionnaire = load_questionnaire(name)
        entries |= {q.question_id: _question(q) for q in questionnaire.questions()}
        for score, rule in questionnaire.scores.items():
            low, high = score_range(questionnaire, score)
            column = f"{name}_{score}"
            entries[column] = _entry(
                f"{questionnaire.title}: {rule.method} of {score.replace('_', ', ')}, "
                f"{low:g} to {high:g}",
                "1",
            )
    return entries


def _question(question: Question) -> Entry:
    levels = {str(k): v for k, v in question.scale.options.items()}
    units = "years" if question.scale_name == "years" else ""
    return _entry(f"answer to: {question.prompt}", units, levels)


def condition_means_dictionary() -> dict[str, Entry]:
    """Describe condition_means.csv: one row per participant and condition."""
    return {
        "participant": _entry("label from the ledger"),
        "condition": _CONDITION,
        "n_trials": _entry("trials averaged; a measure leaves out trials without a value", "1"),
        **{
            name: _entry(f"mean over trials: {c.description}", c.unit)
            for name, c in _MEASURES.items()
        },
        "is_simulated": _SIMULATED,
    }


def statistics_dictionary() -> dict[str, Entry]:
    """Describe statistics.csv: one row per test of every family."""
    measures = {name: c.description for name, c in _MEASURES.items()}
    pair = " and ".join(("A, D, AD or DA in comparisons", "the condition in correlations"))
    of_measure = "unit of the measure"
    return {
        "family": _entry("tests made together", levels=FAMILIES),
        "where": _entry("place or zone of the active agent; empty: all"),
        "measure": _entry("column tested", levels=measures),
        "first": _entry(f"first condition: {pair}", levels=CONDITION_NAMES),
        "second": _entry(
            "second condition, or the score in correlations",
            levels={**CONDITION_NAMES, SCORE_COLUMN: "social anxiety score"},
        ),
        "n_pairs": _entry("participants with both values", "1"),
        "n_incomplete": _entry("participants with one value only", "1"),
        "first_mean": _entry("mean of the first condition over the pairs", of_measure),
        "first_sd": _entry("standard deviation of the first condition", of_measure),
        "second_mean": _entry("mean of the second condition over the pairs", of_measure),
        "second_sd": _entry("standard deviation of the second condition", of_measure),
        "n_tests": _entry("tests that share alpha (Bonferroni)", "1"),
        "threshold": _entry("what p must stay below"),
        "problem": _entry("why there was no test; empty: there was"),
        "sentence": _entry("the conclusion in words"),
        "shapiro_W": _entry("Shapiro-Wilk statistic of the differences"),
        "shapiro_p": _entry("its p; decides between t test and Wilcoxon test"),
        "t": _entry("paired t of first minus second"),
        "df": _entry("degrees of freedom of t", "1"),
        "p": _entry("two-sided p, uncorrected"),
        "estimate": _entry("mean (t) or median (Wilcoxon) of first minus second", of_measure),
        "ci_low": _entry("lower bound of the interval of the estimate, or of r"),
        "ci_high": _entry("upper bound of the interval of the estimate, or of r"),
        "effect": _entry(
            "name of the effect size, first minus second",
            levels={"dz": "standardised mean difference", "r_rb": "rank-biserial correlation"},
        ),
        "effect_size": _entry("its value"),
        "effect_ci_low": _entry("lower bound of its interval"),
        "effect_ci_high": _entry("upper bound of its interval"),
        "eta_p2": _entry("partial eta squared (t test)"),
        "eta_p2_ci_low": _entry("lower bound of its interval"),
        "eta_p2_ci_high": _entry("upper bound of its interval"),
        "p_adjusted": _entry("p after correction: Bonferroni; correlations: Holm"),
        "significant": _entry("below the threshold; correlations: uncorrected", levels=YES_NO),
        "stars": _entry(
            "level reached after correction",
            levels={"*": "alpha", "**": "a fifth of it", "***": "a fiftieth of it"},
        ),
        "test": _entry("the test that ran"),
        "error_term": _entry("what the statistic was divided by, or the kind of p"),
        "correction": _entry("correction for the number of tests"),
        "dropped": _entry("values left out before the test"),
        "notes": _entry("conventions and warnings; how the test was chosen"),
        "V": _entry("Wilcoxon: rank sum of the positive differences, first minus second"),
        "T": _entry("Wilcoxon: the smaller of the two rank sums"),
        "z": _entry("Wilcoxon: standardised V"),
        "n_nonzero": _entry("Wilcoxon: differences that are not zero", "1"),
        "r": _entry("Spearman's coefficient"),
        "published_significant": _entry("significant in the source", levels=YES_NO),
        "agrees_with_published": _entry(
            "same verdict as the source; empty: undecided here", levels=YES_NO
        ),
        "is_simulated": _SIMULATED,
    }


def sensitivity_dictionary() -> dict[str, Entry]:
    """Describe sensitivity.csv: the thirty tests by padding and minimum fixation."""
    n_tests = len(COMPARISONS) * len(MAIN_MEASURES)
    entries: dict[str, Entry] = {
        "pad_deg": _entry("angular padding of heads", "deg"),
        "minimum_fixation_ms": _entry("shortest look that counts as a fixation", "ms"),
    }
    for name in ("dwell_ms", "fixation_count"):
        unit = _MEASURES[name].unit
        for condition in CONDITIONS[:2]:
            entries[f"{name}_{condition}"] = _entry(
                f"mean under {CONDITION_NAMES[condition]} gaze: {_MEASURES[name].description}", unit
            )
    return {
        **entries,
        "dwell_ms_p": _entry("p of dwell time, A against D, uncorrected"),
        "fixation_count_p": _entry("p of fixation count, A against D, uncorrected"),
        "significant_tests": _entry(f"significant tests of {n_tests}", "1"),
        "same_verdicts": _entry("tests with the verdict of the main analysis", "1"),
        "n_tests": _entry("tests made", "1"),
        "is_simulated": _SIMULATED,
    }


DICTIONARIES = {
    "participants": participants_dictionary,
    "condition_means": condition_means_dictionary,
    "statistics": statistics_dictionary,
    "sensitivity": sensitivity_dictionary,
}


def write_table_dictionary(table: str, columns: Iterable[str], path: Path) -> Path:
    """Write the sidecar of one table for the columns it has; unknown columns are left out."""
    entries = DICTIONARIES[table]()
    content = {name: entries[name] for name in columns if name in entries}
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path

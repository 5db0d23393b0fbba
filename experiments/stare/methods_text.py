"""The method section, written from the parameters in force."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Final

from analysis.gaze.looks import LookParameters
from analysis.report.notation import counted, decimal, percentage, threshold
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.conclusions import RULE
from experiments.stare.design import CONDITIONS, DEFAULT_PARAMETERS, StareParameters
from experiments.stare.gaze_changes import GazeChanges
from experiments.stare.published import COMPARISONS
from experiments.stare.terms import MEASURES
from stimuli.scenes.audience import ACTIVE_PLACES
from visavis.looks import DEFAULT_MEASURE_PARAMETERS, MeasureParameters
from visavis.reporting_list import confidence_rule, stamp_rule

REFERENCES = (
    "Raimbaud, P., Jovane, A., Zibrek, K., Pacchierotti, C., Christie, M., Hoyet, L., Pettré, J., "
    "& Olivier, A.-H. (2022). The stare-in-the-crowd effect in virtual reality. IEEE Conference "
    "on Virtual Reality and 3D User Interfaces.",
    "Jovane, A. (2023). Thesis, Université de Rennes, chapter 3 and appendix A (the published "
    "values shown here).",
    "Dunn, M. J., et al. (2024). Minimal reporting guideline for research involving eye tracking "
    "(2023 edition). Behavior Research Methods, 56, 4351–4357.",
    "Olsen, A. (2012). The Tobii I-VT fixation filter. Tobii Technology.",
    "Liebowitz, M. R. (1987). Social phobia. Modern Problems of Pharmacopsychiatry, 22, 141–173.",
    "Steiger, J. H. (2004). Beyond the F test. Psychological Methods, 9, 164–182.",
)


_DIFFERENCES: Final[Mapping[str, tuple[str, str]]] = {
    "trial_s": ("trials lasted", "s"),
    "intertrial_s": ("the dark between trials lasted", "s"),
    "practice_s": ("the training lasted at least", "s"),
    "practice_limit_s": ("the training lasted at most", "s"),
    "repetitions": ("repetitions of every condition at every place:", ""),
    "look_trigger_ms": ("a look had to last this long before the gaze changed:", "ms"),
    "switch_at_01": ("share of the trial after which the gaze changed without a look:", ""),
}


def study_of(parameters: Mapping[str, Any] | None) -> StareParameters:
    """Return the study's parameters of a plan; what the plan does not name is the source's."""
    known = {f.name for f in fields(StareParameters)}
    return StareParameters(**{k: v for k, v in (parameters or {}).items() if k in known})


def _plain(value: float) -> str:
    return f"{value:g}"


def differences_from_source(
    study: StareParameters,
    measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
    changes: GazeChanges | None = None,
) -> tuple[str, ...]:
    """Return, one sentence each, what was done otherwise than in the published study."""
    found = []
    for name, (what, unit) in _DIFFERENCES.items():
        here, there = getattr(study, name), getattr(DEFAULT_PARAMETERS, name)
        if here == there:
            continue
        given, usual = (f"{_plain(value)} {unit}".strip() for value in (here, there))
        found.append(f"Set for this study: {what} {given} (source: {usual}).")
    if study.pad_deg != measures.pad_deg:
        found.append(
            f"Looks that changed the agent's gaze were decided with a padding of "
            f"{_plain(study.pad_deg)}°, the measures with {_plain(measures.pad_deg)}°."
        )
    if study.look_trigger_ms == 0:
        trigger = (
            "One gaze sample on the active agent's head changes its gaze at once, so a saccade "
            "that passes over the head is enough: this platform's reading of “first looked at”."
        )
    else:
        trigger = (
            f"A look of {_plain(study.look_trigger_ms)} ms changes the agent's gaze: this "
            "platform's reading of “first looked at”."
        )
    found.append(trigger if changes is None else f"{trigger} {changes.sentence()}")
    return tuple(found)


def method_paragraphs(
    parameters: AnalysisParameters,
    measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
    study: StareParameters = DEFAULT_PARAMETERS,
    changes: GazeChanges | None = None,
) -> tuple[str, ...]:
    """Return the paragraphs: design, measures, exclusions, statistics."""
    looks: LookParameters = measures.looks
    places, conditions = len(ACTIVE_PLACES), len(CONDITIONS)
    n_trials = conditions * places * study.repetitions
    per_condition = places * study.repetitions
    if study.switch_at_01 == 0.5:
        change = "half the trial"
    else:
        change = f"{percentage(study.switch_at_01, 0)} of the trial"
    looked = "first looked at"
    if study.look_trigger_ms:
        looked = f"first looked at for {_plain(study.look_trigger_ms)} ms"
    changed = "" if changes is None else f" {changes.sentence()}"
    m = len(COMPARISONS) * len(MEASURES)
    percent = f"{100 * parameters.interval_level:.0f} %"
    return (
        "Participants faced eleven seated agents while one of nine of them was the active agent. "
        f"Its gaze was averted (A), directed at the participant (D), averted until {looked} "
        f"and then directed (AD), or directed until {looked} and then averted (DA); without "
        f"a look the change came after {change} "
        f"({_plain(study.trial_s * study.switch_at_01)} s). Each participant performed "
        f"{conditions} conditions × {places} places × "
        f"{counted(study.repetitions, 'repetition')} = {counted(n_trials, 'trial')} of "
        f"{_plain(study.trial_s)} s in three blocks (after Raimbaud et al., 2022). "
        f"The head's padding in the session was {_plain(study.pad_deg)}°.{changed}",
        "Gaze was on the active agent's head when its ray met the head before any occluder, or "
        f"passed it within an angular padding of {decimal(measures.pad_deg, 1)}°, limited by half "
        "the gap to the nearest head. Uninterrupted gaze on the head is a look; lost gaze of at "
        f"most {decimal(looks.bridge_ms, 0)} ms within one look was bridged (Olsen, 2012), gaze "
        f"elsewhere never. Looks of at least {decimal(looks.minimum_fixation_ms, 0)} ms are "
        "fixations, shorter ones glances. Dwell time is the time of valid samples on the head, "
        "glances included; fixation count, and time and duration of the first and second fixation, "
        "follow from the fixations. A trial without the fixation in question has no value for it.",
        f"Validity of samples – {confidence_rule()}. Time stamps – {stamp_rule(looks)}.",
        f"A trial was excluded when more than {100 * parameters.max_trial_lost_01:.0f} % of its "
        "time had no usable gaze (missing samples included), a participant when that held for "
        f"more than {100 * parameters.max_bad_trials_01:.0f} % of the trials or the mean "
        f"calibration error exceeded {decimal(parameters.max_error_deg, 1)}°.",
        f"Each participant's trials of a condition (up to {per_condition}) were "
        "averaged. Differences between two conditions were tested with paired t tests when "
        "Shapiro–Wilk did not reject their normality "
        f"(α = {threshold(parameters.normality_alpha)}), otherwise with Wilcoxon's signed-rank "
        "test (exact). Statistics and effect sizes of a comparison A – D are of A minus D, as in "
        "the source; figures show the second minus the first (D − A) and say so. "
        "Five comparisons of six measures share a Bonferroni threshold of "
        f"{threshold(parameters.alpha)}/{m} = {threshold(parameters.alpha / m)}; places were "
        f"tested at {threshold(parameters.alpha)}/9 and zones at {threshold(parameters.alpha)}/3. "
        f"Effect sizes are dz and partial η² (t tests, with noncentral {percent} intervals; "
        "Steiger, 2004) or the rank-biserial correlation. Social anxiety was correlated with the "
        "measures by Spearman's coefficient.",
        RULE,
    )

"""The method section, written from the parameters in force."""

from analysis.gaze.looks import LookParameters
from analysis.report.notation import decimal, threshold
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.conclusions import RULE
from experiments.stare.measures import DEFAULT_MEASURE_PARAMETERS, MeasureParameters
from experiments.stare.published import COMPARISONS
from experiments.stare.terms import MEASURES

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


def method_paragraphs(
    parameters: AnalysisParameters, measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> tuple[str, ...]:
    """Return the paragraphs: design, measures, exclusions, statistics."""
    looks: LookParameters = measures.looks
    m = len(COMPARISONS) * len(MEASURES)
    percent = f"{100 * parameters.interval_level:.0f} %"
    return (
        "Participants faced eleven seated agents while one of nine of them was the active agent. "
        "Its gaze was averted (A), directed at the participant (D), averted until first looked at "
        "and then directed (AD), or directed until first looked at and then averted (DA); without "
        "a look the change came after half the trial. Each participant performed 4 conditions × 9 "
        "places × 2 repetitions = 72 trials of 16 s in three blocks (after Raimbaud et al., 2022).",
        "Gaze was on the active agent's head when its ray met the head before any occluder, or "
        f"passed it within an angular padding of {decimal(measures.pad_deg, 1)}°, limited by half "
        "the gap to the nearest head. Uninterrupted gaze on the head is a look; lost gaze of at "
        f"most {decimal(looks.bridge_ms, 0)} ms within one look was bridged (Olsen, 2012), gaze "
        f"elsewhere never. Looks of at least {decimal(looks.minimum_fixation_ms, 0)} ms are "
        "fixations, shorter ones glances. Dwell time is the time of valid samples on the head, "
        "glances included; fixation count, and time and duration of the first and second fixation, "
        "follow from the fixations. A trial without the fixation in question has no value for it.",
        f"A trial was excluded when more than {100 * parameters.max_trial_lost_01:.0f} % of its "
        "time had no usable gaze (missing samples included), a participant when that held for "
        f"more than {100 * parameters.max_bad_trials_01:.0f} % of the trials or the mean "
        f"calibration error exceeded {decimal(parameters.max_error_deg, 1)}°.",
        f"Each participant's trials of a condition (up to {parameters.trials_per_condition}) were "
        "averaged. Differences between two conditions were tested with paired t tests when "
        "Shapiro–Wilk did not reject their normality "
        f"(α = {threshold(parameters.normality_alpha)}), otherwise with Wilcoxon's signed-rank "
        "test (exact). Five comparisons of six measures share a Bonferroni threshold of "
        f"{threshold(parameters.alpha)}/{m} = {threshold(parameters.alpha / m)}; places were "
        f"tested at {threshold(parameters.alpha)}/9 and zones at {threshold(parameters.alpha)}/3. "
        f"Effect sizes are dz and partial η² (t tests, with noncentral {percent} intervals; "
        "Steiger, 2004) or the rank-biserial correlation. Social anxiety was correlated with the "
        "measures by Spearman's coefficient.",
        RULE,
    )

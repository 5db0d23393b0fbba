"""The method section, written from what the study declares and the parameters in force."""

from collections.abc import Iterator
from typing import Final

from visavis.analysis.report.notation import decimal, threshold
from visavis.analysis.statistics.adjust import ADJUSTMENT_NAME
from visavis.protocol.plan.session_plan import Trial
from visavis.results.analysis import StudyAnalysis
from visavis.results.findings import Finding
from visavis.results.report.reporting_list import STAMPS_COUNTED, confidence_rule, stamp_rule
from visavis.study.experiment import StudyExperiment
from visavis.study.look_measures import MeasureParameters
from visavis.study.pairs import Correlate, Pairs
from visavis.study.responses import Rating, Response
from visavis.study.texts import Texts, format_value, label_in_unit, label_of
from visavis.study.trial import TrialScript

ORDERS: Final = {
    "fixed": "a fixed order, the same for everybody",
    "random": "random order",
    "balanced_blocks": "random order, with equally many of every level in each block",
    "latin_square": "the order of a row of a Latin square, by participant",
    "williams": "the order of a row of a Williams square, by participant",
}
"""Orders of trials and blocks (`Design`), as a method section calls them."""


def method_paragraphs(analysis: StudyAnalysis, experiment: StudyExperiment) -> tuple[str, ...]:
    """Return the paragraphs: the study's own words, design, procedure, measures, statistics."""
    study = experiment.study
    looks = [
        _looks(on.rules({"parameters": experiment.parameters})) for on in study.analysis.looks[:1]
    ]
    every = (
        *own_methods(experiment),
        _procedure(experiment),
        _measures_paragraph(analysis),
        *looks,
        _exclusions_paragraph(analysis),
        _comparisons_paragraph(analysis, experiment.texts),
        *_families(analysis),
    )
    return tuple(filter(None, every))


def own_methods(experiment: StudyExperiment) -> tuple[str, ...]:
    """Return the paragraphs that need no analysis: the study's own words, its design."""
    values = {k: format_value(v) for k, v in experiment.parameters.items()}
    own = experiment.study.report.methods.format_map(values)
    parts = (p.strip() for p in own.split("\n\n") if p.strip())
    return (*parts, _design(experiment))


def _design(experiment: StudyExperiment) -> str:
    plan = experiment.plan(0, 1)
    trials = [t for t in plan.trials if not t.is_practice]
    blocks = len({t.block for t in trials})
    practice = len(plan.trials) - len(trials)
    factors = []
    for factor in experiment.study.design_with(experiment.parameters).all_factors:
        kind = "between" if factor.between else "within"
        levels = ", ".join(label_of(experiment.texts, str(v)) for v in factor.levels)
        name = label_in_unit(experiment.texts, factor.name)
        factors.append(f"{name} ({levels}; {kind} participants)")
    repetitions = int(experiment.parameters["repetitions"])
    times = "once" if repetitions == 1 else f"{repetitions} times"
    every = "In each session every" if experiment.session_name else "Every"
    practice_note = f" after {practice} for practice" if practice else ""
    criterion = experiment.study.design.practice_until
    until = "" if criterion is None else f" {criterion.words}"
    return (
        f"Factors were {'; '.join(factors)}. {every} combination came {times}: {len(trials)} trials"
        f"{practice_note}, in {_blocks(blocks)}. {_order(experiment, blocks)}{until}"
    )


def _order(experiment: StudyExperiment, blocks: int) -> str:
    """Return in which order blocks and the trials within them came, as a sentence."""
    design = experiment.study.design_with(experiment.parameters)
    of_trials = ORDERS[design.order]
    if design.blocked_by is None:
        return f"Trials came in {of_trials}." if len(design.within) else ""
    factor = label_in_unit(experiment.texts, design.blocked_by)
    held = "" if factor == "block" else f"Each block held one {factor}. "
    within = ""
    if design.phased_by is not None:
        phase = next(f for f in design.within if f.name == design.phased_by)
        names = ", then ".join(label_of(experiment.texts, str(v)) for v in phase.levels)
        within = f", one {label_in_unit(experiment.texts, phase.name)} after the other ({names})"
    return (
        f"{held}Blocks came in {ORDERS[design.block_order]}, and the trials of a block in "
        f"{of_trials}{within}."
    )


def _procedure(experiment: StudyExperiment) -> str:
    """Return what trials showed and asked; empty where the study's own words say it."""
    if experiment.study.report.methods.strip():
        return ""
    scene_texts = []
    shown_in: dict[str, dict[str, list[str]]] = {}
    for read in experiment.read.values():
        for scene in read.scenes:
            options = shown_in.setdefault(scene.name, {})
            for name, value in scene.options.items():
                values = options.setdefault(name, [])
                values += [] if str(value) in values else [str(value)]
    for scene_name, of in shown_in.items():
        options_text = "; ".join(
            f"{label_in_unit(experiment.texts, name)}: {' or '.join(v)}" for name, v in of.items()
        )
        scene_texts.append(
            f"the scene {scene_name.replace('_', ' ')}"
            + (f" ({options_text})" if options_text else "")
        )
    questions = [_question_text(experiment, response) for response in experiment.responses.values()]
    parts = [f"Trials showed {' and '.join(scene_texts)}." if scene_texts else ""]
    parts.append(f"Participants were asked: {'; '.join(questions)}." if questions else "")
    return " ".join(filter(None, parts))


def _question_text(experiment: StudyExperiment, response: Response) -> str:
    """Return a question in the participants' words, with its scale or options."""
    cell = dict(next(iter(experiment.read)))
    script = TrialScript(Trial("T1", 1, 0, False, cell, 1), experiment.settings)
    prompt, labels = script.words_of(response)
    how = ", ".join(map(str, labels))
    if isinstance(response, Rating):
        how = f"a rating from {response.low} to {response.high}"
    return f"“{prompt}” ({response.name.replace('_', ' ')}{': ' if how else ''}{how})"


def _blocks(count: int) -> str:
    return "one block" if count == 1 else f"{count} blocks"


def _measures_paragraph(analysis: StudyAnalysis) -> str:
    measures = dict.fromkeys(
        (
            *(f.measure for f in analysis.findings),
            *(t.measure for r in analysis.results for t in r.tests),
        )
    )
    words = [
        f"{m.words[:1].lower()}{m.words[1:]} ({m.column}, {m.aggregate} over the trials of a cell)"
        for m in measures
    ]
    return f"Measures were {'; '.join(words)}." if words else "No measure was compared."


def _looks(rules: MeasureParameters) -> str:
    looks = rules.looks
    return (
        "Gaze was on an agent's head when its ray met the head before any occluder, or passed it "
        f"within an angular padding of {decimal(rules.pad_deg, 1)}°, limited by half the gap to "
        "the nearest head. Uninterrupted gaze on the head is a look; lost gaze of at most "
        f"{decimal(looks.bridge_ms, 0)} ms within one look was bridged (Olsen, 2012), gaze "
        f"elsewhere never. Looks of at least {decimal(looks.minimum_fixation_ms, 0)} ms are "
        "fixations, shorter ones glances. Dwell time is the time of valid samples on the head, "
        "glances included; fixation count, and time and duration of the first and second fixation, "
        "follow from the fixations. A trial without the fixation in question has no value for it. "
        f"Validity of samples – {confidence_rule()}. Time stamps – {stamp_rule(looks)}"
        f"{STAMPS_COUNTED}."
    )


def _exclusions_paragraph(analysis: StudyAnalysis) -> str:
    selection = analysis.selection
    exclusions = selection.applied(analysis.study.analysis.exclusions)
    rules = [
        rule.rule(selection.limits[rule.name])
        + ("" if rule.if_missing or "{" in rule.words else f", {rule.words}")
        for rule in exclusions
    ]
    return (
        "Trials that were not finished were left out; of trials performed again the last counts. "
        + (f"Left out further: {'; '.join(rules)}." if rules else "")
    )


def _comparisons_paragraph(analysis: StudyAnalysis, texts: Texts) -> str:
    parts = []
    for finding in analysis.findings:
        title = "not tested" if finding.outcome is None else finding.outcome.title
        how = finding.compare.correction
        of = f"the family “{finding.compare.family}”"
        family = f", {ADJUSTMENT_NAME.get(how, how)} over {of}" if how != "none" else ""
        parts.append(
            f"{comparison_words(finding, texts)}: {title} (α = {finding.compare.alpha:g}{family})"
        )
    with_outcome = [f for f in analysis.findings if f.outcome is not None]
    is_art = any(
        f.compare.test == f.compare.model == "" and _factor_count(f) > 1 for f in with_outcome
    )
    why = (
        (
            " The aligned rank transform was taken as the test over several factors where the "
            "study names none: it tests their interactions, too, and asks neither for normal "
            "residuals nor for equal steps of a scale; its contrasts are in ranks."
        )
        if is_art
        else ""
    )
    if not parts:
        return "" if analysis.results else "No comparison was planned."
    return f"Comparisons: {'; '.join(parts)}.{why}"


def _factor_count(finding: Finding) -> int:
    return len(finding.compare.within) + len(finding.compare.between)


def _families(analysis: StudyAnalysis) -> Iterator[str]:
    rules = analysis.rules
    percent = f"{100 * rules.interval_level:.0f} %"
    if any(isinstance(r.of, Pairs) for r in analysis.results):
        yield (
            "Two levels were compared with paired t tests where Shapiro–Wilk did not reject the "
            f"normality of the differences (α = {threshold(rules.normality_alpha)}), with "
            "Wilcoxon's signed-rank test (exact) otherwise. Statistics and effect sizes of a "
            "comparison A – B, and figures, are of A minus B. Effect sizes are "
            f"dz and partial η² (t tests, with noncentral {percent} intervals; Steiger, "
            "2004) or the rank-biserial correlation."
        )
    parts = []
    for r in analysis.results:
        words = f"{r.of.family} ({r.of.words})" if r.of.words else r.of.family
        alpha = threshold(rules.alpha)
        if isinstance(r.of, Correlate):
            parts.append(f"{words}: Spearman's coefficient, Holm, {alpha}")
        elif analysis.pairs_of(r.of.family):
            n = analysis.pairs_of(r.of.family)[0].n_tests
            parts.append(f"{words}: Bonferroni, {alpha}/{n} = {threshold(rules.alpha / n)}")
    if parts:
        yield f"Families of tests: {'; '.join(dict.fromkeys(parts))}."


def comparison_words(finding: Finding, texts: Texts) -> str:
    """Return the name of a comparison in sentences: measure, factors and selected levels."""
    words = finding.measure.words
    factors = " × ".join(
        label_of(texts, name)
        for name in (*finding.compare.within, *finding.compare.between) or ("itself",)
    )
    levels = ", ".join(label_of(texts, v) for v in finding.compare.restrictions)
    return f"{words[:1].lower()}{words[1:]} by {factors}" + (f" ({levels})" if levels else "")

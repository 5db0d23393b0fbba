"""The method section, written from what the study declares and the parameters in force."""

from visavis.analysis import StudyAnalysis
from visavis.exclusions import Exclusion
from visavis.experiment import StudyExperiment
from visavis.texts import shown


def method_paragraphs(analysis: StudyAnalysis, experiment: StudyExperiment) -> tuple[str, ...]:
    """Return the paragraphs: the study's own words, design, procedure, measures, statistics."""
    study = experiment.study
    own = study.methods.format_map(
        {k: shown(v) for k, v in experiment.parameters.items()}
    ).strip()  # fmt: skip
    parts = [p.strip() for p in own.split("\n\n") if p.strip()]
    return (*parts, _design(experiment), _measured(analysis), _excluded(analysis),
            _compared(analysis))  # fmt: skip


def _design(experiment: StudyExperiment) -> str:
    plan = experiment.plan(0, 1)
    counted = [t for t in plan.trials if not t.is_practice]
    blocks = len({t.block for t in counted})
    practice = len(plan.trials) - len(counted)
    factors = []
    for factor in experiment.study.design(experiment.parameters).factors:
        kind = "between" if factor.between else "within"
        levels = ", ".join(map(str, factor.levels))
        factors.append(f"{factor.name} ({levels}; {kind} participants)")
    repeated = int(experiment.parameters["repetitions"])
    times = "once" if repeated == 1 else f"{repeated} times"
    order = str(experiment.parameters["order"]).replace("_", " ")
    tried = f" after {practice} for practice" if practice else ""
    return (
        f"Factors were {'; '.join(factors)}. Every combination came {times}: {len(counted)} trials"
        f"{tried}, in {order} order, in {_blocks(blocks)}."
    )


def _blocks(count: int) -> str:
    return "one block" if count == 1 else f"{count} blocks"


def _measured(analysis: StudyAnalysis) -> str:
    used = dict.fromkeys(f.measure for f in analysis.findings)
    words = [
        f"{m.words[:1].lower()}{m.words[1:]} ({m.column}, {m.aggregate} over the trials of a cell)"
        for m in used
    ]
    return f"Measures were {'; '.join(words)}." if words else "No measure was compared."


def _excluded(analysis: StudyAnalysis) -> str:
    rules = []
    for rule in analysis.study.exclusions:
        limit = analysis.selection.limits[rule.name]
        if limit is None:
            continue
        rules.append(f"{_about(rule)} {'above' if rule.above else 'below'} {shown(limit)}")
    return (
        "Trials that were not finished were left out; of trials performed again the last counts. "
        + (f"Left out further: {'; '.join(rules)}." if rules else "")
    )


def _about(rule: Exclusion) -> str:
    whom = "trials" if rule.level == "trial" else "participants"
    return f"{whom} with {rule.column} ({rule.name})"


def _compared(analysis: StudyAnalysis) -> str:
    said = []
    for finding in analysis.findings:
        title = "not tested" if finding.outcome is None else finding.outcome.title
        how = finding.compare.correction
        family = f", {how} over the family {finding.compare.family}" if how != "none" else ""
        said.append(f"{finding.compare.name}: {title} (α = {finding.compare.alpha:g}{family})")
    return f"Comparisons: {'; '.join(said)}." if said else "No comparison was planned."

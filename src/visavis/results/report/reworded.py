"""Say of reworded scales that they are, wherever a report names one of their scores."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from visavis.analysis.report import Paragraph, Section
from visavis.protocol.plan.questionnaires import Questionnaire
from visavis.results.analysis import StudyAnalysis
from visavis.study.pairs import Correlate

METHODS = "methods"
"""The section that names every reworded scale, whether it has results or not."""


def with_caveats(
    sections: Iterable[Section], analysis: StudyAnalysis, questionnaires: Sequence[Questionnaire]
) -> tuple[Section, ...]:
    """Return the sections; those that name a score of a reworded scale say so at their end."""
    reworded = [(q, _names(q, analysis)) for q in questionnaires if q.caveat]
    result = []
    for section in sections:
        text = repr(section.blocks).casefold()
        caveats = tuple(
            Paragraph(q.caveat)
            for q, names in reworded
            if section.anchor == METHODS or any(name.casefold() in text for name in names)
        )
        result.append(replace(section, blocks=(*section.blocks, *caveats)))
    return tuple(result)


def _names(questionnaire: Questionnaire, analysis: StudyAnalysis) -> set[str]:
    """Return what a report calls the scale and its scores."""
    columns = {*questionnaire.scores, *(f"{questionnaire.name}_{s}" for s in questionnaire.scores)}
    measures = {f.measure.words for f in analysis.findings if f.measure.column in columns}
    families = analysis.study.analysis.families
    scores = {f.score_words for f in families if isinstance(f, Correlate) and f.score in columns}
    return {questionnaire.title, *measures, *scores}

"""Headlines of a report: what became of each planned comparison, which way, and by how much."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from visavis.analysis.report import Verdict
from visavis.analysis.report.blocks import Status
from visavis.analysis.report.notation import count_of, probability
from visavis.analysis.statistics.results import quantities
from visavis.results.analysis import StudyAnalysis
from visavis.results.claims import (
    ClaimAnswer,
    answer_claim,
    claimed_finding_term,
    published_agreement,
    published_effect_in_interval,
)
from visavis.results.differences import (
    Difference,
    difference_of_means,
    difference_words,
    means_of_levels,
)
from visavis.results.findings import Finding, Term
from visavis.results.planned_tests import effect_name, names_of_finding
from visavis.study.comparisons import Compare
from visavis.study.experiment import StudyExperiment
from visavis.study.texts import Texts, label_in_unit, label_of


def verdicts_of(analysis: StudyAnalysis, experiment: StudyExperiment) -> list[Verdict]:
    """Return a verdict on every effect of the planned comparisons; a claim has one.

    Those of primary claims come first; the others are marked as secondary.
    """
    planned = [f for f in analysis.findings if not f.compare.exploratory]
    uncorrected = sum(len(f.terms) for f in planned if f.compare.correction == "none")
    every, primary = [f.compare for f in analysis.findings], set(analysis.primary)
    verdicts = []
    for finding in planned:
        if not finding.terms:
            is_secondary = primary.isdisjoint(names_of_finding(finding, every))
            verdict = _not_tested(finding, experiment.texts)
            verdicts.append(replace(verdict, is_secondary=is_secondary))
        claimed = claimed_finding_term(finding)
        for term in finding.terms:
            if claimed is not None and term is not claimed and term.name == claimed.name:
                continue  # further pairs of levels, on which the claim's one verdict rests, too
            is_secondary = effect_name(finding.compare, term.name, every) not in primary
            verdict = _verdict(finding, term, experiment, uncorrected)
            verdicts.append(replace(verdict, is_secondary=is_secondary))
    return sorted(verdicts, key=lambda verdict: verdict.is_secondary)


def _claim_of(finding: Finding, texts: Texts) -> str:
    """Return the claim with the people or trials it is about.

    Without words for it, that is the measure with the direction expected.
    """
    compare = finding.compare
    direction = f"{finding.measure.words}: {_expected(compare, texts)}" if compare.expects else ""
    claim = compare.claim or direction
    return claim and f"{claim}{_whom(finding, texts)}"


def _expected(compare: Compare, texts: Texts) -> str:
    """Return the direction expected, with the words for levels that differences have, too."""
    orders = (
        " > ".join(", ".join(label_of(texts, name) for name in step) for step in order.levels)
        for order in compare.orders
    )
    if len(compare.orders) == 1 and len((*compare.within, *compare.between)) < 2:
        return next(orders)
    labels = (label_of(texts, order.factor) for order in compare.orders)
    return "; ".join(f"{name}: {order}" for name, order in zip(labels, orders, strict=True))


def _whom(finding: Finding, texts: Texts) -> str:
    """Return which people or trials a comparison is about: " (novice)"; of all nothing."""
    names = ", ".join(label_of(texts, name) for name in finding.compare.restrictions)
    return f" ({names})" if names else ""


def _not_tested(finding: Finding, texts: Texts) -> Verdict:
    claim = _claim_of(finding, texts)
    heading = f"{finding.measure.words}: not tested" + (f" – {lower(claim)}" if claim else "")
    return Verdict("undecided", heading, f"{finding.why_not}.")


def _verdict(
    finding: Finding, term: Term, experiment: StudyExperiment, uncorrected: int
) -> Verdict:
    compare, outcome = finding.compare, finding.outcome
    doubts = () if outcome is None else outcome.doubts(term.name)
    if term is claimed_finding_term(finding):
        answer = answer_claim(finding)
        status, headline = answer.status, _claim_headline(finding, answer, experiment.texts)
        why_not = f" {answer.why_not[:1].upper()}{answer.why_not[1:]}." if answer.why_not else ""
    else:
        status = "undecided" if doubts else "found" if term.is_significant else "not_found"
        headline, why_not = _effect_headline(finding, term, status, experiment.texts), ""
    correction = ""
    if compare.correction != "none" and term.p_corrected != term.p:
        not_any_more = "" if term.is_significant or term.p >= term.alpha else ", not significant"
        correction = (
            f" Corrected over the family of {compare.family} comparisons ({compare.correction}): "
            f"p {p_words(term.p_corrected)}{not_any_more}."
        )
    elif compare.correction == "none" and uncorrected > 1:
        correction = f" Not corrected; the study makes {count_of(uncorrected, 'such test')}."
    sided = f" One-sided, as planned: p {p_words(term.p)}." if term.is_one_sided else ""
    return Verdict(
        status,
        headline,
        f"{_sentence(finding, term)}{why_not}{sided}{correction}{_published_note(finding, term)}"
        + "".join(f" Note: {note}." for note in doubts),
    )


def lost_by_correction(finding: Finding) -> tuple[str, ...]:
    """Return a sentence for each effect that is significant before correction only."""
    compare = finding.compare
    return tuple(
        f"{t.name.replace(':', ' × ')}: not significant after correction over the family of "
        f"{compare.family} comparisons ({compare.correction}), p {p_words(t.p_corrected)}."
        for t in finding.terms
        if t.p < t.alpha and not t.is_significant
    )


def _claim_headline(finding: Finding, answer: ClaimAnswer, texts: Texts) -> str:
    claim = _claim_of(finding, texts)
    words = _words_of(answer.differences, texts)
    several = len(answer.differences) > 1 and answer.status in ("partly", "reversed")
    by_how_much = "; ".join(
        difference_words(d, words, finding.measure.unit)
        + (" (not significant)" if several and not d.is_significant else "")
        for d in answer.differences
    )
    if answer.status == "found":
        return f"{claim} ({by_how_much})"
    if answer.status == "reversed":
        return f"Significant, but the other way round: {by_how_much} – claimed: {lower(claim)}"
    beginnings: Mapping[Status, str] = {
        "partly": "Shown in part",
        "not_found": "Not shown",
        "undecided": "Inconclusive",
    }
    heading = f"{beginnings[answer.status]}: {lower(claim)}"
    return f"{heading} ({by_how_much})" if by_how_much else heading


def _effect_headline(finding: Finding, term: Term, status: Status, texts: Texts) -> str:
    """Return what became of an effect of which nothing is claimed, with the means it is about."""
    words = finding.measure.words
    names = " × ".join(label_of(texts, n) for n in term.name.split(":")) + _whom(finding, texts)
    which_way = _which_way(finding, term, texts)
    if status != "found":
        return f"Inconclusive: {lower(words)} by {names}" + (f" ({which_way})" if which_way else "")
    return _more_with(finding, term, texts) or (
        f"{words} depends on {names}" + (f" ({which_way})" if which_way else "")
    )


def _which_way(finding: Finding, term: Term, texts: Texts) -> str:
    """Return the difference of two levels with its interval, of more the two extreme means."""
    means = means_of_levels(finding, term)
    if len(means) < 2:
        return ""
    factors, levels = term.name.split(":"), list(means)
    unit = finding.measure.unit
    if len(factors) == 1 and len(levels) == 2 and finding.compare.model != "bradleyterry":
        pair = (levels[0][0], levels[1][0])
        value, interval = difference_of_means(finding, {factors[0]: pair})
        difference = Difference((pair[0],), (pair[1],), "difference", value, interval, 0, False)
        return difference_words(difference, _words_of([difference], texts), unit)
    unit = "" if unit in ("", "1") else f" {unit}"
    least, greatest = min(means, key=means.__getitem__), max(means, key=means.__getitem__)
    low, high = quantities(means[least], means[greatest])
    named = [" ".join(label_of(texts, n) for n in cell) for cell in (least, greatest)]
    return f"means from {low}{unit}, {named[0]}, to {high}{unit}, {named[1]}"


def _more_with(finding: Finding, term: Term, texts: Texts) -> str:
    """Return which of two levels has the larger mean; nothing unless there are two."""
    means, factor = means_of_levels(finding, term), term.name
    if finding.compare.model == "bradleyterry" or ":" in factor or len(means) != 2:
        return ""
    (one,), (other,) = means
    if means[one,] == means[other,]:
        return ""
    more, less = (one, other) if means[one,] > means[other,] else (other, one)
    value, interval = difference_of_means(finding, {factor: (more, less)})
    unit = "" if finding.measure.unit in ("", "1") else f" {finding.measure.unit}"
    high, low = quantities(means[more,], means[less,])
    difference = Difference((more,), (less,), "difference", value, interval, 0, True)
    by_how_much = difference_words(difference, {more: "", less: ""}, finding.measure.unit)
    return (
        f"{finding.measure.words}{_whom(finding, texts)}: more with {label_in_unit(texts, factor)} "
        f"{label_of(texts, more)} than {label_of(texts, less)} "
        f"({high}{unit} and {low}{unit}, difference {by_how_much.partition(': ')[2]})"
    )


def _words_of(differences: Sequence[Difference], texts: Texts) -> dict[str, str]:
    names = {name for d in differences for name in (*d.greater, *d.less) if name}
    return {name: label_of(texts, name) for name in names}


def _published_note(finding: Finding, term: Term) -> str:
    agreement, printed_result = published_agreement(finding, term), None
    printed_result = finding.compare.published_of(term.name)
    if agreement is None or printed_result is None:
        return ""
    if agreement.agrees:
        same = "neither is significant, which shows no agreement"
        if printed_result.is_significant:
            same = "the same verdict" + (
                ", in the same direction" if printed_result.order else "; which way is not printed"
            )
    elif printed_result.is_significant and term.is_significant:
        same = "significant in both, but the other way round"
    else:
        same = f"significant {'there' if printed_result.is_significant else 'here'} alone"
    # An effect size of variance has no direction: beside the opposite it would look like agreement.
    is_opposite = printed_result.is_significant and term.is_significant and not agreement.agrees
    is_inside = None if is_opposite else published_effect_in_interval(finding, term)
    if is_inside is not None:
        same += f"; the printed η²p lies {'in' if is_inside else 'outside'} our interval"
    return f" Published: {printed_result} ({same})."


def _sentence(finding: Finding, term: Term) -> str:
    outcome = finding.outcome
    if outcome is None:
        return ""
    before = "" if term.is_significant or term.p >= term.alpha else "Before correction: "
    for sentence in outcome.sentences:
        if sentence.startswith(f"{term.name.replace(':', ' × ')}:"):
            return f"{before}{outcome.title}, {sentence}"
    return before + " ".join(outcome.sentences)


def p_words(p: float) -> str:
    """Return p with its sign: "= .023", "< .001"."""
    text = probability(p)
    return text if text.startswith(("<", ">")) else f"= {text}"


def lower(text: str) -> str:
    """Return a text with a small first letter, to follow other words."""
    return text[:1].lower() + text[1:]

"""The planned tests of a study by name, and which of them are its primary claims.

A study is performed for its primary claims, and holds its error rate for these alone: what else it
finds is exploratory, however it was planned.
"""

from collections.abc import Sequence

from visavis.lab.errors import DesignError
from visavis.lab.yaml_lines import did_you_mean
from visavis.results.family_tests import PairTest, Test
from visavis.results.findings import Finding
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.pairs import Family, Pairs
from visavis.study.study_errors import line_saying


def planned_tests(study: Study, comparisons: Sequence[Compare]) -> dict[str, str]:
    """Return every planned test by name, with what it claims: effects, pairs, correlations,
    questions. Among the effects of a comparison, the one that its claim is about comes first.

    `comparisons` are those that the design in force can make.
    """
    claims = {}
    for compare in (c for c in comparisons if not c.exploratory):
        claimed_first = sorted(compare.terms, key=lambda term: term != compare.claimed_term)
        for term in claimed_first:
            claims[effect_name(compare, term, comparisons)] = _claim_of(compare, term)
    for of in families_of(study):
        claims |= claims_of(study, of)
    return claims | dict(study.analysis.questions)


def primary_tests(study: Study, comparisons: Sequence[Compare]) -> tuple[str, ...]:
    """Return the names of the study's primary claims, among those that its design can make.

    Where it names none (`Study.primary`), they are the questions that it answers in words; without
    questions the claims of its planned comparisons; without claims everything planned.

    Raises:
        DesignError: it names a test that it does not plan; with the most similar valid name.
    """
    every, primary = planned_tests(study, comparisons), study.analysis.primary
    whole = planned_tests(study, study.analysis.compare)
    # What a derived study inherits may be about comparisons that it replaced.
    is_inherited = study.base is not None and primary == study.base.analysis.primary
    for name in primary if not is_inherited else ():
        if name not in every and name not in whole:
            place = line_saying(study.files.path, name) or f"study {study.name}"
            near = did_you_mean(name, tuple(every))
            raise DesignError(
                f"{place}: primary names {name!r}, which is no planned test{near}; visavis power "
                f"{study.name} --test list"
            )
    if named := tuple(name for name in every if name in primary):
        return named
    if study.analysis.questions:
        return tuple(study.analysis.questions)
    claimed = [
        effect_name(c, c.claimed_term, comparisons)
        for c in comparisons
        if c.has_claim and not c.exploratory
    ]
    return tuple(dict.fromkeys(claimed)) or tuple(every)


def names_of_finding(finding: Finding, every: Sequence[Compare]) -> tuple[str, ...]:
    """Return the names of a finding's effects; of one that was not tested, those it would have."""
    terms = [term.name for term in finding.terms] or list(finding.compare.terms)
    return tuple(effect_name(finding.compare, term, every) for term in terms)


def effect_name(compare: Compare, term: str, every: Sequence[Compare]) -> str:
    """Return the name of an effect: measure and term.

    Where several comparisons have it, their levels, model or test, and factors are added.
    """
    # Tests name the factors of an interaction in an order of their own.
    term = next((own for own in compare.terms if set(own.split(":")) == set(term.split(":"))), term)
    name = f"{compare.dv}:{term}"
    same = [c for c in every if not c.exploratory and c.dv == compare.dv and term in c.terms]
    # Those of some people or trials are named by these; the others keep their short name.
    alike = [c for c in same if bool(c.restrictions) == bool(compare.restrictions)]
    is_whole = len(alike) == 1 and not compare.restrictions
    if len(same) < 2 or (is_whole and any(c.restrictions for c in same)):
        return name
    over = "by " + " × ".join((*compare.within, *compare.between))
    of = (*compare.restrictions, compare.model or compare.test, over)
    return f"{name} ({', '.join(filter(None, of))})"


def _claim_of(compare: Compare, term: str) -> str:
    """Return the claim of one effect; among several, only the claimed one has the full claim."""
    expects = f" ({compare.expects})" if compare.claim and compare.expects else ""
    if len(compare.terms) == 1 and compare.has_claim:
        return f"{compare.claim_words}{expects}"
    statement = f"{compare.dv} depends on {term.replace(':', ' × ')}"
    is_claimed = term == compare.claimed_term
    return f"{statement}: {compare.claim_words}{expects}" if is_claimed else statement


def families_of(study: Study) -> tuple[Family, ...]:
    """Return the families whose power is computed: planned ones without `each`."""
    return tuple(
        of
        for of in study.analysis.families
        if not of.exploratory and not (isinstance(of, Pairs) and of.each)
    )


def pair_name(pair: tuple[str, str], measure: str) -> str:
    """Return the name of a test of two levels on the command line: "A-D:dwell_ms"."""
    return f"{pair[0]}-{pair[1]}:{measure}"


def name_of_test(test: Test) -> str:
    """Return the name of one test of a family; those `each` place or zone have one of their own."""
    column = test.measure.column
    if not isinstance(test, PairTest):
        return f"{test.of.family}-{test.level}:{column}"
    name = pair_name((test.first, test.second), column)
    return f"{name} ({test.where})" if test.where else name


def claims_of(study: Study, of: Family, measures: Sequence[str] | None = None) -> dict[str, str]:
    """Return the tests of a family by name, with what they claim."""
    words = {m.column: m.words.lower() for m in study.analysis.measures}
    names = [(m, words.get(m, m)) for m in (of.measures if measures is None else measures)]
    if isinstance(of, Pairs):
        return {
            pair_name(pair, m): f"{pair[0]} – {pair[1]}, {measure_words}"
            for pair in of.levels
            for m, measure_words in names
        }
    levels = study.factor(of.factor).levels
    return {
        f"{of.family}-{level}:{m}": f"{of.score_words} and {measure_words} under {level}"
        for level in levels
        for m, measure_words in names
    }

"""What became of the claim of a comparison: shown, shown in part, the other way round, or not."""

from dataclasses import dataclass

from visavis.analysis.report.blocks import Status
from visavis.results.differences import (
    Difference,
    difference_of_directed,
    differences_of,
    levels_there,
)
from visavis.results.family_tests import Agreement
from visavis.results.findings import Finding, Term
from visavis.study.comparisons import DIRECTED, Compare
from visavis.study.expectations import Order, orders_of


@dataclass(frozen=True)
class ClaimAnswer:
    """The verdict on a claim, and the differences it rests on; `why_not` where it is undecided."""

    status: Status
    differences: tuple[Difference, ...] = ()
    why_not: str = ""


def claimed_finding_term(finding: Finding) -> Term | None:
    """Return the effect that the claim of a comparison is about, the first of several alike."""
    if not finding.compare.has_claim:
        return None
    return next((t for t in finding.terms if finding.compare.is_claimed(t.name)), None)


def answer_claim(finding: Finding) -> ClaimAnswer:
    """Return what became of a comparison's claim; it counts as shown only in its own direction.

    Found: every difference it expects is significant as expected. Partly: some are, and none is
    significant the other way round. Reversed: one is.
    """
    compare, outcome, term = finding.compare, finding.outcome, claimed_finding_term(finding)
    if outcome is None or term is None:
        return ClaimAnswer("undecided", why_not=finding.why_not or "the effect was not tested")
    if compare.test in DIRECTED:
        difference = difference_of_directed(finding, term)
        found: Status = "found" if term.is_significant else "not_found"
        status: Status = "undecided" if outcome.doubts(term.name) else found
        return ClaimAnswer(status, (difference,))
    differences = tuple(differences_of(finding, term, compare.orders))
    absent = sorted(
        {level for d in differences for level in (*d.greater, *d.less)} - levels_there(finding)
    )
    if absent and (compare.within or compare.between):
        return ClaimAnswer(
            "undecided", why_not=f"the study was performed without {' and '.join(absent)}"
        )
    if outcome.doubts(term.name):
        return ClaimAnswer("undecided", differences)
    if pairs := [f"{d.greater[0]} with {d.less[0]}" for d in differences if not d.is_tested]:
        why_not = f"no test compared {' and '.join(pairs)}, see the notes"
        return ClaimAnswer("undecided", differences, why_not)
    significant = [d for d in differences if d.is_significant]
    if any(d.is_contradictory for d in significant):
        return ClaimAnswer(
            "undecided", differences, "the test of ranks and the means point in opposite directions"
        )
    # A one-sided test cannot find the other direction; that its p would have been significant on
    # both sides must be seen all the same.
    is_beyond = term.is_one_sided and 2 * (1 - term.p) < term.alpha
    if any(d.sign < 0 for d in significant) or is_beyond:
        return ClaimAnswer("reversed", differences)
    as_expected = sum(d.sign > 0 for d in significant)
    if as_expected == len(differences):
        return ClaimAnswer("found", differences)
    return ClaimAnswer("partly" if as_expected else "not_found", differences)


def published_agreement(finding: Finding, term: Term) -> Agreement | None:
    """Compare the verdict on an effect with the source's; None where it prints none.

    Significant verdicts agree only where the levels stand in the order that is printed.
    """
    printed_result = finding.compare.published_of(term.name)
    if printed_result is None:
        return None
    same = True
    if printed_result.order and printed_result.is_significant:
        orders = printed_orders(finding.compare, term.name)
        same = all(d.sign > 0 for d in differences_of(finding, term, orders))
    return Agreement(printed_result.is_significant, term.is_significant, same)


def printed_orders(compare: Compare, term: str) -> tuple[Order, ...]:
    """Return the order of levels that a source prints of an effect; none where it prints none."""
    printed_result = compare.published_of(term)
    if printed_result is None or not printed_result.order:
        return ()
    orders = orders_of(printed_result.order, f"the published result of {compare.name}")
    if len(orders) == 1 and not orders[0].factor:
        return (Order(orders[0].levels, term),)
    return orders


def published_effect_in_interval(finding: Finding, term: Term) -> bool | None:
    """Tell whether the printed partial η² lies in our interval; None where one is missing."""
    printed_result, row = finding.compare.published_of(term.name), term.row
    low, high = row.get("effect_ci_low"), row.get("effect_ci_high")
    if printed_result is None or printed_result.eta_p2 is None or row.get("effect") != "η²p":
        return None
    if low is None or high is None:
        return None
    # What is printed with two digits may lie half a digit away.
    return float(low) - 0.005 <= printed_result.eta_p2 <= float(high) + 0.005

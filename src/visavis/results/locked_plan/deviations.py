"""Deviations from a locked plan, and since when each exists."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from visavis.results.locked_plan.content import (
    CODE_SHA256,
    COMPARED_PARTS,
    FILE_SHA256,
    FILES,
    PRIMARY_CLAIMS,
    VERSIONS,
    comparisons_by_name,
)
from visavis.study.comparisons import Compare

NOTHING: Final = "–"
UNPLANNED_FAMILY: Final = "not planned"
"""The family of comparisons that a locked plan does not name. They do not change the correction of
planned ones."""
_PART: Final[Mapping[str, str]] = {
    "parameters": "parameter", "factors": "factor", "measures": "measure",
    "comparisons": "comparison", "groups": "group of people", PRIMARY_CLAIMS: "primary claim",
    "families": "family",
    "tests": "test rule",
    "exclusions": "exclusion", VERSIONS: "version", "questions": "question", "scenes": "scene",
    FILES: "file",
}  # fmt: skip


@dataclass(frozen=True)
class Deviation:
    """One deviation: what it concerns, as planned, as done, and `since` when.

    `part` is one of COMPARED_PARTS, "sample" or "study file"; `name` what it concerns.
    """

    part: str
    name: str
    planned: str
    done: str
    since: str = ""

    @property
    def what(self) -> str:
        """What deviates, in words."""
        return f"{_PART.get(self.part, self.part)} {self.name}".strip()

    @property
    def is_exploratory(self) -> bool:
        """Tell whether it is an added comparison, which changes nothing that was planned."""
        return self.part in ("comparisons", "families") and self.planned == NOTHING


def deviations_between(plan: Mapping[str, Any], actual: Mapping[str, Any]) -> tuple[Deviation, ...]:
    """Return every difference between two contents of `plan_content`.

    A changed study file is reported only where nothing else differs, versions aside.
    """
    deviations = tuple(
        d
        for part in COMPARED_PARTS
        if part != PRIMARY_CLAIMS or part in plan  # plans of earlier versions have none
        for d in differing(part, plan.get(part, {}), actual.get(part, {}))
    )
    if FILES in plan:  # plans of earlier versions have none; what is not there shows nothing
        now = {name: digest[:12] for name, digest in actual[FILES].items()}
        then = {name: digest[:12] for name, digest in plan[FILES].items() if name in now}
        of_files = tuple(differing(FILES, then, now))
    else:
        of_files = ()
    key = CODE_SHA256 if CODE_SHA256 in plan else FILE_SHA256
    before, after = str(plan[key]), str(actual[key])
    in_file = any(d.part != VERSIONS for d in deviations)
    if before != after and before and after and not in_file:
        about = "(what is shown or said)"
        deviations = (*deviations, Deviation("study file", about, before[:12], after[:12]))
    return (*deviations, *of_files)


def differing(part: str, plan: Any, actual: Any) -> Iterator[Deviation]:
    """Yield the differences within one part of a content, name by name."""
    if not isinstance(plan, Mapping):
        if plan != actual:
            yield Deviation(part, "", _as_text(plan), _as_text(actual))
        return
    for name in dict.fromkeys((*plan, *actual)):
        if name not in plan or name not in actual:
            before, after = plan.get(name), actual.get(name)
            yield Deviation(part, str(name), _in_short(before), _in_short(after))
        elif not isinstance(plan[name], Mapping):
            if plan[name] != actual[name]:
                yield Deviation(part, str(name), _as_text(plan[name]), _as_text(actual[name]))
        else:
            for key in dict.fromkeys((*plan[name], *actual[name])):
                before, after = plan[name].get(key), actual[name].get(key)
                if before != after:
                    yield Deviation(part, f"{name}: {key}", _as_text(before), _as_text(after))


def _in_short(value: Any) -> str:
    if value is None:
        return NOTHING
    if isinstance(value, Mapping):
        summary = value.get("test") or value.get("words") or value.get("limit")
        return "there" if summary is None else _as_text(summary)
    return _as_text(value)


def _as_text(value: Any) -> str:
    if value is None or value == "":
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(_as_text, value)) or NOTHING
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_as_text(v)}" for k, v in value.items()) or NOTHING
    return str(value)


def as_locked(compare: Sequence[Compare], plan: Mapping[str, Any]) -> tuple[Compare, ...]:
    """Return comparisons with the claims and directions of a locked plan.

    Those that it does not name are marked as exploratory. They form a family of their own, so that
    planned comparisons are corrected as planned. What a claim expects is that of the plan, whatever
    the study file says now, which the deviations tell. Plans of earlier versions have no direction.
    """
    return tuple(
        _with_locked_claim(one, plan["comparisons"][name])
        if name in plan["comparisons"]
        else replace(one, exploratory=True, family=UNPLANNED_FAMILY)
        for name, one in comparisons_by_name(compare).items()
    )


def _with_locked_claim(compare: Compare, planned: Mapping[str, Any]) -> Compare:
    expects = planned.get("expects", "")
    if not expects:
        return compare
    one_sided = bool(planned.get("one_sided", False))
    return replace(compare, claim=planned["claim"], expects=expects, one_sided=one_sided)

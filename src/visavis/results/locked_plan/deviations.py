"""Deviations from a locked plan, and since when each exists."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from visavis.results.locked_plan.content import COMPARED, FILE_SHA256, VERSIONS, named
from visavis.study.comparisons import Compare

NOTHING: Final = "–"
UNPLANNED: Final = "not planned"
"""The family of comparisons that a locked plan does not name; planned ones do not pay for them."""
_PART: Final[Mapping[str, str]] = {
    "parameters": "parameter", "factors": "factor", "measures": "measure",
    "comparisons": "comparison", "families": "family", "tests": "test rule",
    "exclusions": "exclusion", VERSIONS: "version", "questions": "question", "scenes": "scene",
}  # fmt: skip


@dataclass(frozen=True)
class Deviation:
    """One deviation: what it concerns, as planned, as done, and `since` when.

    `part` is one of COMPARED, "sample" or "study file"; `name` what it concerns.
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


def deviations_between(
    planned: Mapping[str, Any], done: Mapping[str, Any]
) -> tuple[Deviation, ...]:
    """Return every difference between two contents of `plan_content`.

    A changed study file is reported only where nothing else differs, versions aside.
    """
    deviations = tuple(d for part in COMPARED for d in differing(part, planned[part], done[part]))
    before, after = str(planned[FILE_SHA256]), str(done[FILE_SHA256])
    in_file = any(d.part != VERSIONS for d in deviations)
    if before != after and before and after and not in_file:
        about = "(what is shown or said)"
        deviations = (*deviations, Deviation("study file", about, before[:12], after[:12]))
    return deviations


def differing(part: str, planned: Any, done: Any) -> Iterator[Deviation]:
    """Yield the differences within one part of a content, name by name."""
    if not isinstance(planned, Mapping):
        if planned != done:
            yield Deviation(part, "", _said(planned), _said(done))
        return
    for name in dict.fromkeys((*planned, *done)):
        if name not in planned or name not in done:
            before, after = planned.get(name), done.get(name)
            yield Deviation(part, str(name), _in_short(before), _in_short(after))
        elif not isinstance(planned[name], Mapping):
            if planned[name] != done[name]:
                yield Deviation(part, str(name), _said(planned[name]), _said(done[name]))
        else:
            for key in dict.fromkeys((*planned[name], *done[name])):
                before, after = planned[name].get(key), done[name].get(key)
                if before != after:
                    yield Deviation(part, f"{name}: {key}", _said(before), _said(after))


def _in_short(value: Any) -> str:
    if value is None:
        return NOTHING
    if isinstance(value, Mapping):
        summary = value.get("test") or value.get("words") or value.get("limit")
        return "there" if summary is None else _said(summary)
    return _said(value)


def _said(value: Any) -> str:
    if value is None or value == "":
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(_said, value)) or NOTHING
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_said(v)}" for k, v in value.items()) or NOTHING
    return str(value)


def marked(compare: Sequence[Compare], planned: Mapping[str, Any]) -> tuple[Compare, ...]:
    """Return comparisons; those that a locked plan does not name are marked as exploratory.

    These form a family of their own, so that planned comparisons are corrected as planned.
    """
    return tuple(
        one if name in planned["comparisons"] else replace(one, exploratory=True, family=UNPLANNED)
        for name, one in named(compare).items()
    )

"""How a study followed its locked plan: for the report, the tables and the analyst."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import pandas as pd

from visavis.analysis.report import Block, Bullets, Cell, Column, Paragraph, Section, Table
from visavis.analysis.report.notation import count_of
from visavis.recording.manifest import Manifest
from visavis.results.locked_plan.deviations import Deviation, deviations_between

IN_ANALYSIS: Final = "this analysis"
CONFIGURATION_KEY: Final = "plan_lock"
"""Key in a session's configuration for the hash of the locked plan and the deviations then."""


@dataclass(frozen=True)
class LockedPlan:
    """A plan as it was locked: the content of `plan_content`, the sample, when, and its hash."""

    plan: Mapping[str, Any]
    participants: int
    rule: str
    is_blinded: bool
    sessions_before: int
    locked_at: str
    sha256: str


@dataclass(frozen=True)
class Peek:
    """One look at results before a blinded study was complete."""

    at: str
    sessions: int
    reason: str


@dataclass(frozen=True)
class PlanReview:
    """The locked plan of a study, the deviations from it and the exploratory comparisons.

    `sessions_with_hash` of the `session_count` sessions have the plan's hash in their manifest.
    """

    locked: LockedPlan
    deviations: tuple[Deviation, ...]
    exploratory: tuple[str, ...]
    sessions_with_hash: int
    session_count: int
    peeks: tuple[Peek, ...] = ()

    def lines(self) -> tuple[str, ...]:
        """Return the lines to show whoever runs the analysis."""
        locked_plan = self.locked
        head = f"plan locked {locked_plan.locked_at[:10]} ({locked_plan.sha256[:12]})"
        if not self.deviations:
            return (f"{head}: kept in everything",)
        return (
            f"{head}: {count_of(len(self.deviations), 'deviation')}",
            *(
                f"  {d.what}: planned {d.planned}, done {d.done} (since {d.since})"
                for d in self.deviations
            ),
        )

    def table(self) -> pd.DataFrame:
        """Return a row per deviation: what, planned, done, since."""
        rows = [{"what": d.what, **asdict(d)} for d in self.deviations]
        return pd.DataFrame(rows, columns=["what", "part", "name", "planned", "done", "since"])


def review_of(
    locked: LockedPlan,
    actual: Mapping[str, Any],
    manifests: Sequence[Manifest],
    peeks: Sequence[Peek] = (),
) -> PlanReview:
    """Compare an analysis and its sessions with a locked plan.

    `actual` is the content of `plan_content` as analysed now. A deviation dates from the first
    session that recorded it. One that no session recorded belongs to this analysis.
    """
    by_time = sorted(manifests, key=lambda m: m.created_wall_iso)
    first: dict[Deviation, str] = {}
    for manifest in by_time:
        for deviation in recorded_deviations(manifest):
            first.setdefault(deviation, _whose(manifest))
    differences = deviations_between(locked.plan, actual)
    besides = tuple(d.name for d in differences if d.is_exploratory)
    deviations = [d for d in differences if not d.is_exploratory]
    now = [replace(d, since=first.pop(d, IN_ANALYSIS)) for d in deviations]
    past = [
        replace(d, since=f"{since}, no longer")
        for d, since in first.items()
        if not d.is_exploratory
    ]
    with_hash = [m for m in by_time if hash_of_plan(m) == locked.sha256]
    without = [m for m in by_time if m not in with_hash]
    more = list(_about_sample(locked, len({m.participant for m in manifests})))
    if without:
        more.append(
            Deviation(
                "sessions", "without the plan's hash", "0", str(len(without)), _whose(without[0])
            )
        )
    return PlanReview(
        locked, (*now, *past, *more), besides, len(with_hash), len(by_time), tuple(peeks)
    )


def hash_of_plan(manifest: Manifest) -> str:
    """Return the hash of the locked plan in a session's manifest; empty without one."""
    return str(_plan_entry(manifest).get("sha256", ""))


def recorded_deviations(manifest: Manifest) -> tuple[Deviation, ...]:
    """Return the deviations from the locked plan at the beginning of a session."""
    entries = _plan_entry(manifest).get("deviations", [])
    return tuple(
        Deviation(str(d["part"]), str(d["name"]), str(d["planned"]), str(d["done"]))
        for d in entries
    )


def _plan_entry(manifest: Manifest) -> Mapping[str, Any]:
    entry = manifest.configuration.get(CONFIGURATION_KEY)
    return entry if isinstance(entry, Mapping) else {}


def _whose(manifest: Manifest) -> str:
    return f"{manifest.participant}, {manifest.created_wall_iso[:10]}"


def _about_sample(locked: LockedPlan, people: int) -> list[Deviation]:
    if people == locked.participants:
        return []
    prefix = "so far " if people < locked.participants else ""
    return [Deviation("sample", "size", str(locked.participants), f"{prefix}{people}", IN_ANALYSIS)]


def review_section(review: PlanReview) -> Section:
    """Return the section of a report on how the locked plan was followed."""
    locked_plan = review.locked
    plan = locked_plan.plan["comparisons"]
    deviating = {d.name.partition(": ")[0] for d in review.deviations if d.part == "comparisons"}
    before = (
        "before any session was recorded"
        if not locked_plan.sessions_before
        else f"after {count_of(locked_plan.sessions_before, 'session')} had been recorded"
    )
    blocks: list[Block] = [
        Paragraph(
            f"The plan was locked on {locked_plan.locked_at[:10]}, {before} "
            f"(SHA-256 {locked_plan.sha256}). "
            f"{review.sessions_with_hash} of {count_of(review.session_count, 'session')} bear its "
            f"hash. Planned were {locked_plan.participants} participants. "
            f"{locked_plan.rule}".strip()
        ),
        Table(
            (
                Column("Planned comparison"),
                Column("Expected"),
                Column("Test"),
                Column("Done"),
            ),
            tuple(
                (
                    f"{name}: {c['claim']}" if c["claim"] else name,
                    str(c.get("expects", "")) or "–",
                    str(c["test"]),
                    Cell("deviates", "differ") if name in deviating else Cell("as planned"),
                )
                for name, c in plan.items()
            ),
            "What was planned",
        ),
    ]
    if review.deviations:
        heads = tuple(Column(h) for h in ("What", "Planned", "Done", "Since"))
        rows = tuple((d.what, d.planned, d.done, d.since) for d in review.deviations)
        blocks.append(Table(heads, rows, "Deviations from the plan"))
    else:
        blocks.append(Paragraph("Nothing deviates from the plan."))
    if review.exploratory:
        blocks.append(Paragraph("Exploratory, as the plan does not name them:"))
        blocks.append(Bullets(review.exploratory))
    if review.peeks:
        looks = tuple(
            f"{p.at[:10]}, with {count_of(p.sessions, 'session')}"
            + (f": {p.reason}" if p.reason else "")
            for p in review.peeks
        )
        blocks.append(Paragraph("Results were looked at before the study was complete:"))
        blocks.append(Bullets(looks))
    return Section("plan", "Planned and done", tuple(blocks))

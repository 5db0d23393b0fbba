"""Where the numbers of a report come from."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from visavis.analysis.session_incidents import Incident


@dataclass(frozen=True)
class SessionSource:
    """One recording that went in: whose, when it began, how it ended, its SHA-256, and what
    happened between its trials.
    """

    participant: str
    session: str
    started_at: str
    status: str
    sha256: str
    code_revision: str = ""
    incidents: tuple[Incident, ...] = ()


@dataclass(frozen=True)
class ReportProvenance:
    """Everything needed to make the same report again.

    `data_date` comes from the recordings ("2026-03-02 to 2026-03-19"), never from a clock.
    `commands` are complete lines, `folder` the study's, named from its data root on. `setup`
    answers what data cannot: manufacturer, model, display, room; its keys are those of the
    report's checklist.
    """

    study: str
    study_version: str
    data_date: str
    versions: Mapping[str, str] = field(default_factory=dict)
    sessions: tuple[SessionSource, ...] = ()
    configuration_sha256: str = ""
    plan_sha256: str = ""
    seed: int | None = None
    commands: tuple[str, ...] = ()
    folder: str = ""
    setup: Mapping[str, str] = field(default_factory=dict)

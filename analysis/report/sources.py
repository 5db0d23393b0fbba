"""Say where a study's numbers come from: recordings with their hashes, versions, seeds."""

import hashlib
import json
from collections.abc import Sequence

from analysis.report.provenance import ReportProvenance, SessionSource
from recording.integrity import damage_of
from recording.manifest import Manifest
from recording.reader import Recording


def source_of(recording: Recording) -> SessionSource:
    """Return what identifies one recording: whose, when, how it ended, one hash over its files.

    The status of a damaged one says what cannot be read.
    """
    manifest, damage = recording.manifest, damage_of(recording)
    hashes = [
        digest
        for part in manifest.parts
        for digest in (
            *(s.sha256 for s in part.streams),
            part.journal.sha256 if part.journal else "",
        )
    ]
    return SessionSource(
        participant=manifest.participant,
        session=f"ses-{manifest.session:03d}",
        started_at=manifest.created_wall_iso,
        status="; ".join(("damaged", *damage.summary())) if damage.is_damaged else recording.status,
        sha256=hashlib.sha256("".join(hashes).encode()).hexdigest(),
        code_revision=manifest.provenance.code_revision,
    )


def provenance_of_sessions(
    study: str,
    manifests: Sequence[Manifest],
    sources: Sequence[SessionSource],
    commands: tuple[str, ...],
) -> ReportProvenance:
    """Return the provenance of a report about several sessions of one study."""
    first = manifests[0]
    dates = sorted({m.created_wall_iso[:10] for m in manifests})
    span = dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}"
    plans = json.dumps([m.plan for m in manifests], sort_keys=True)
    return ReportProvenance(
        study=study,
        study_version=str(first.plan["study_version"]),
        data_date="virtual time" if first.is_simulated and dates == ["2000-01-01"] else span,
        versions={"python": first.provenance.python, **first.provenance.packages},
        sessions=tuple(sources),
        configuration_sha256=first.configuration_sha256,
        plan_sha256=hashlib.sha256(plans.encode()).hexdigest(),
        seed=first.seed,
        commands=commands,
    )

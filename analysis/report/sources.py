"""Say where a study's numbers come from: recordings with their hashes, versions, seeds."""

import hashlib
import json
from collections.abc import Sequence

from visavis.analysis.report.provenance import ReportProvenance, SessionSource
from visavis.analysis.session_incidents import incidents_of
from visavis.lab.clock import SIMULATED_EPOCH_ISO
from visavis.recording.integrity import damage_of
from visavis.recording.manifest import Manifest
from visavis.recording.reader import Recording

VIRTUAL_TIME = "virtual time"


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
        started_at=VIRTUAL_TIME if on_virtual_clock(manifest) else manifest.created_wall_iso,
        status="; ".join(("damaged", *damage.summary())) if damage.is_damaged else recording.status,
        sha256=hashlib.sha256("".join(hashes).encode()).hexdigest(),
        code_revision=manifest.provenance.code_revision,
        incidents=incidents_of(recording),
    )


def on_virtual_clock(manifest: Manifest) -> bool:
    """Tell whether a session began on the virtual clock, whose dates mean nothing."""
    return manifest.is_simulated and manifest.created_wall_iso[:10] == SIMULATED_EPOCH_ISO[:10]


def provenance_of_sessions(
    study: str,
    manifests: Sequence[Manifest],
    sources: Sequence[SessionSource],
    commands: tuple[str, ...],
    folder: str = "",
) -> ReportProvenance:
    """Return the provenance of a report about several sessions of one study."""
    first = manifests[0]
    dates = sorted({m.created_wall_iso[:10] for m in manifests if not on_virtual_clock(m)})
    spans = [" to ".join(dict.fromkeys((dates[0], dates[-1])))] if dates else []
    spans += [VIRTUAL_TIME] if any(map(on_virtual_clock, manifests)) else []
    plans = json.dumps([m.plan for m in manifests], sort_keys=True)
    return ReportProvenance(
        study=study,
        study_version=str(first.plan["study_version"]),
        data_date=", ".join(spans),
        versions={"python": first.provenance.python, **first.provenance.packages},
        sessions=tuple(sources),
        configuration_sha256=first.configuration_sha256,
        plan_sha256=hashlib.sha256(plans.encode()).hexdigest(),
        seed=first.seed,
        commands=commands,
        folder=folder,
    )

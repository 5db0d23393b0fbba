"""The locked plan in a study's folder: written once, carried by every session, never changed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from visavis.lab.clock import Clock
from visavis.lab.errors import DataError, RecordingError, UsageError
from visavis.recording.chained import append_lines, read_lines
from visavis.recording.csv_file import write_csv
from visavis.recording.durable import replace_file
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import provenance
from visavis.recording.sealed import copy_path, read_sealed, seal, seal_of, write_sealed
from visavis.results.locked_plan.content import LOCK_VERSION, plan_content
from visavis.results.locked_plan.deviations import Deviation, deviations_between
from visavis.results.locked_plan.preregistration import markdown
from visavis.results.locked_plan.review import CONFIGURATION_KEY, LockedPlan, Peek, PlanReview
from visavis.results.opened_study import OpenedStudy
from visavis.study.catalogue import digest_of
from visavis.study.experiment import StudyExperiment

LOCK_NAME: Final = "plan_lock.json"
PAGE_NAME: Final = "plan_lock.md"
DEVIATIONS_NAME: Final = "deviations.csv"
PEEKS_NAME: Final = "peeks.jsonl"


def lock_plan(
    folder: Path,
    study: OpenedStudy,
    experiment: StudyExperiment,
    seed: int,
    clock: Clock,
    *,
    participants: int,
    rule: str = "",
    is_blinded: bool = False,
    sessions_before: int = 0,
) -> LockedPlan:
    """Write a study's plan into its folder, as JSON with a checksum and as Markdown.

    Raises:
        UsageError: the study's plan is locked already.
    """
    there = read_lock(folder)
    if there is not None:
        raise UsageError(
            f"{folder} has had a locked plan since {there.locked_at[:10]} ({folder / LOCK_NAME}), "
            "and a locked plan is never changed: reports name what deviates from it. Begin a study "
            "anew in another data root to lock another plan"
        )
    content = {
        "format_version": LOCK_VERSION,
        "locked_at": clock.wall_iso(),
        "is_blinded": is_blinded,
        "sample": {
            "participants": participants,
            "rule": rule,
            "sessions_before": sessions_before,
        },
        "plan": content_now(study, experiment, seed),
    }
    write_sealed(folder / LOCK_NAME, content)
    locked_plan = _locked(content, seal_of(seal(content)))
    replace_file(folder / PAGE_NAME, markdown(content, locked_plan.sha256).encode())
    return locked_plan


def content_now(
    study: OpenedStudy,
    experiment: StudyExperiment,
    seed: int,
    settings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return what a study plans as it is declared now."""
    file = study.study.files.path
    return plan_content(
        experiment,
        study.measures(experiment),
        seed=seed,
        provenance=provenance(),
        file_sha256="" if file is None else digest_of(file),
        code_sha256="" if file is None else digest_of(file, with_words=False),
        settings=settings,
    )


def read_lock(folder: Path) -> LockedPlan | None:
    """Return a study folder's locked plan; None where none was locked.

    Raises:
        DataError: the file is damaged, or was written by a newer Visavis.
    """
    path = folder / LOCK_NAME
    if not path.exists() and not copy_path(path).exists():
        return None
    try:
        sealed_file = read_sealed(path)
        if not sealed_file.is_sealed:
            raise ValueError("it lost its checksum")
        version = sealed_file.content.get("format_version")
        if not isinstance(version, int) or version > LOCK_VERSION:
            raise ValueError(f"format version {version} is newer than this Visavis")
        return _locked(sealed_file.content, seal_of(seal(sealed_file.content)))
    except (OSError, ValueError, KeyError, TypeError, RecordingError) as error:
        raise DataError(
            f"{path} cannot be read ({error}); `visavis recover {folder}` puts its copy in its "
            "place"
        ) from error


def _locked(content: Mapping[str, Any], sha256: str) -> LockedPlan:
    sample = content["sample"]
    return LockedPlan(
        plan=content["plan"],
        participants=int(sample["participants"]),
        rule=str(sample["rule"]),
        is_blinded=bool(content["is_blinded"]),
        sessions_before=int(sample["sessions_before"]),
        locked_at=str(content["locked_at"]),
        sha256=sha256,
    )


def carried_by_session(
    folder: Path, study: OpenedStudy, experiment: StudyExperiment, seed: int
) -> dict[str, Any]:
    """Return what a session's configuration keeps of a locked plan: empty without one.

    It keeps the hash of the plan, and all deviations of the study when the session begins.
    """
    locked_plan = read_lock(folder)
    if locked_plan is None:
        return {}
    deviations = deviations_between(locked_plan.plan, content_now(study, experiment, seed))
    return {
        CONFIGURATION_KEY: {
            "sha256": locked_plan.sha256,
            "deviations": [_as_fields(d) for d in deviations],
        }
    }


def _as_fields(deviation: Deviation) -> dict[str, str]:
    fields = asdict(deviation)
    del fields["since"]
    return fields


def write_deviations(review: PlanReview | None, out_dir: Path) -> None:
    """Write the deviations from a locked plan beside the tables; no file without a plan."""
    path = out_dir / DEVIATIONS_NAME
    path.unlink(missing_ok=True)
    if review is not None:
        write_csv(review.table(), path)


# ---- looking at results before the end -------------------------------------------------------


def check_interim_analysis(
    folder: Path,
    locked: LockedPlan | None,
    manifests: Sequence[Manifest],
    clock: Clock,
    *,
    is_requested: bool,
    reason: str = "",
) -> tuple[Peek, ...]:
    """Return the looks at results so far; refuse a further one while a blinded study runs.

    A further look that is `is_requested` for is recorded before anything is computed.

    Raises:
        UsageError: the study is blinded and not complete, and nobody asked to look.
    """
    if locked is None or not locked.is_blinded:
        return ()
    whole = [m for m in manifests if m.parts and m.parts[-1].status == "complete"]
    people = len({m.participant for m in whole})
    if people < locked.participants:
        if not is_requested:
            raise UsageError(
                f"the plan of {folder} keeps results hidden until {locked.participants} "
                f"participants are complete; {people} are. Wait for the others, or look all the "
                "same with --peek REASON: it is recorded, and every report says so"
            )
        line = {"at": clock.wall_iso(), "sessions": people, "reason": reason}
        append_lines(folder / PEEKS_NAME, [line])
    return read_peeks(folder)


def read_peeks(folder: Path) -> tuple[Peek, ...]:
    """Return every recorded look at results before the end, oldest first.

    Raises:
        DataError: the record is damaged.
    """
    path = folder / PEEKS_NAME
    lines = read_lines(path)
    if lines.damaged_line is not None:
        raise DataError(
            f"{path}:{lines.damaged_line[0]} is damaged; `visavis recover {folder}` puts its copy "
            "in its place"
        )
    try:
        return tuple(
            Peek(str(r["at"]), int(r["sessions"]), str(r["reason"])) for r in lines.records
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise DataError(
            f"{path} holds a line that no analysis of this Visavis writes ({error!r}); another "
            "program made or changed it: restore it from a copy"
        ) from error

"""The folder of a study: its settings, its sessions, and what analysis derives from it."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Final

import yaml

from visavis.lab.errors import DataError, RecordingError, UsageError
from visavis.recording.durable import make_folder
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.recording.sealed import copy_path, read_sealed, write_sealed
from visavis.recording.typed_names import typed_study
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.study.catalogue import digest_of
from visavis.study.files_read import changed_files, files_gone
from visavis.study.texts import DEFAULT_LANGUAGE

SETTINGS_NAME = "study.json"
SETTINGS_VERSION = 2
SEALED_SINCE = 2
"""Settings of this version and later end in their own checksum."""

DEFAULT_SEED = 1
MAX_NAMES = 8
"""Of files that a warning lists."""
SIMULATED_PREFIX = "S"
"""Labels of simulated participants begin with it."""
DERIVED_FOLDER = "derived"
MEASURED_FOLDER = "measured"
"""In `derived`: walks measured one by one, kept so that a stop loses at most one."""


@dataclass(frozen=True)
class StudySettings:
    """What every session of a study shares; written before the first one."""

    study: str
    seed: int
    is_simulated: bool
    effect: bool = True
    parameters: dict[str, Any] = field(default_factory=dict)
    format_version: int = SETTINGS_VERSION
    source: str = ""
    """The study's file; empty for a study of an installed package."""
    source_sha256: str = ""

    __pydantic_config__: ClassVar[Mapping[str, str]] = {"extra": "forbid"}


def read_parameters(assignments: list[str]) -> dict[str, Any]:
    """Read NAME=VALUE texts; values are numbers, true, false or text as YAML reads them.

    Raises:
        UsageError: a text is not an assignment, or a name comes twice.
    """
    read: dict[str, Any] = {}
    for text in assignments:
        name, sign, value = text.partition("=")
        if not sign or not name.strip():
            raise UsageError(f"--set takes NAME=VALUE, such as trial_s=8, not {text!r}")
        if name.strip() in read:
            raise UsageError(f"{name.strip()} is set twice; give --set {name.strip()}=… once")
        try:
            read[name.strip()] = yaml.safe_load(value)
        except (yaml.YAMLError, RecursionError) as error:
            raise UsageError(
                f"--set takes NAME=VALUE, such as trial_s=8; the value in {text!r} cannot be read"
            ) from error
    return read


def read_settings(folder: Path) -> StudySettings | None:
    """Return a study folder's settings; None when it has none yet.

    Raises:
        DataError: the file is damaged.
    """
    path = folder / SETTINGS_NAME
    if not path.exists() and not copy_path(path).exists():
        return None
    try:
        sealed_file = read_sealed(path)
        text = json.dumps(sealed_file.content)
        settings: StudySettings = _adapter().validate_json(text, strict=True)
        if not sealed_file.is_sealed and settings.format_version >= SEALED_SINCE:
            raise ValueError("it lost its checksum")
    except (OSError, ValueError) as error:
        way_out = (
            f"`visavis recover {folder}` puts its copy in its place"
            if copy_path(path).exists()
            else "restore it from a copy: it holds the study's seed"
        )
        raise DataError(f"{path} is damaged ({_in_one_line(error)}); {way_out}") from error
    if settings.format_version > SETTINGS_VERSION:
        raise DataError(
            f"{path} has format version {settings.format_version}, this Visavis reads up to "
            f"{SETTINGS_VERSION}; install a newer Visavis"
        )
    return settings


@cache
def _adapter() -> Any:
    from pydantic import TypeAdapter  # slow to import, and not needed for most commands

    return TypeAdapter(StudySettings)


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def wanted_settings(
    folder: Path,
    study: OpenedStudy,
    *,
    is_simulated: bool,
    seed: int | None = None,
    assignments: list[str] | None = None,
    language: str | None = None,
    usual_language: str = DEFAULT_LANGUAGE,
    effect: bool | None = None,
) -> StudySettings:
    """Return what a command asks for: as typed, else as the study was begun, else the defaults.

    A typed `language` holds for this command; the lab's usual one is for a new study.

    Raises:
        UsageError: an assignment cannot be read.
        DataError: the study's settings are damaged.
    """
    present = read_settings(folder)
    parameters = read_parameters(assignments or [])
    if (language or usual_language) != DEFAULT_LANGUAGE:
        parameters.setdefault("language", language or usual_language)
    if present is not None and not assignments:
        parameters = dict(present.parameters)
        if language and language != parameters.get("language", DEFAULT_LANGUAGE):
            parameters["language"] = language
    if effect is None:
        effect = True if present is None else present.effect
    file = study.study.files.path
    return StudySettings(
        study.name,
        DEFAULT_SEED if seed is None else seed,
        is_simulated,
        effect=effect,
        parameters=parameters,
        source="" if file is None else str(file),
        source_sha256="" if file is None else digest_of(file),
    )


def settle(
    folder: Path,
    requested_settings: StudySettings,
    *,
    seed_given: bool,
    fits: Callable[[StudySettings], bool] | None = None,
    way_out: str = "",
) -> StudySettings:
    """Return the settings in force, writing them when the study is new.

    Before its first session a study may get further parameters, if `fits` tells that everybody
    registered keeps their group.

    Raises:
        UsageError: another seed or other parameters were asked for than the study was begun with.
    """
    present = read_settings(folder)
    if present is None:
        make_folder(folder, exist_ok=True)
        write_sealed(folder / SETTINGS_NAME, asdict(requested_settings))
        return requested_settings
    if seed_given and requested_settings.seed != present.seed:
        raise UsageError(
            f"{folder} was begun with seed {present.seed}; another seed would change every "
            f"order. Leave --seed out, or use another data root"
        )
    new_settings = replace(present, parameters=requested_settings.parameters)
    if (
        new_settings != present
        and may_become(folder, present, requested_settings)
        and fits
        and fits(new_settings)
    ):
        write_sealed(folder / SETTINGS_NAME, asdict(new_settings))
        return new_settings
    refuse_other(folder, present, requested_settings, way_out)
    # Participants who read another language take part in the same study.
    return replace(present, parameters={**present.parameters, **requested_settings.parameters})


def may_become(folder: Path, present: StudySettings, requested_settings: StudySettings) -> bool:
    """Tell whether no trial was recorded yet, and all that was chosen before stays as it was."""
    keeps_parameters = present.parameters.items() <= requested_settings.parameters.items()
    return (
        keeps_parameters
        and present.effect == requested_settings.effect
        and not any(map(holds_trial, session_folders(folder)))
    )


def session_folders(folder: Path) -> tuple[Path, ...]:
    """Return the sessions of a study by participant and number, those without manifest, too."""
    return tuple(sorted(p for p in folder.glob("sub-*/ses-*") if p.is_dir() and any(p.iterdir())))


def holds_trial(session: Path) -> bool:
    """Tell whether a session holds a trial, or may hold one: a damaged one is taken to.

    Who came and left before their first trial binds no study to its design.
    """
    try:
        recording = Recording(session)
        return any(recording.trial_entries(part.number) for part in recording.manifest.parts)
    except (RecordingError, OSError):
        return True


def refuse_other(
    folder: Path, present: StudySettings, requested_settings: StudySettings, way_out: str = ""
) -> None:
    """Refuse parameters that a study was not begun with; `way_out` is what else can be done.

    Raises:
        UsageError: naming those it was begun with.
    """
    before, after = (
        {k: v for k, v in of.parameters.items() if k != "language"}
        for of in (present, requested_settings)
    )
    if present.effect != requested_settings.effect or before != after:
        assignments = ", ".join(f"{name}={value}" for name, value in present.parameters.items())
        raise UsageError(
            f"{folder} was begun with {assignments or 'no --set'}"
            f"{'' if present.effect else ' and --no-effect'}, which holds for all of its sessions; "
            f"leave --set out, or {way_out or 'choose another data_root in lab_config.yaml'}"
        )


def _was_completed(session: Path) -> bool:
    parts = read_manifest(session).parts
    return bool(parts) and parts[-1].status == "complete"


def output_files(out_dir: Path) -> tuple[Path, ...]:
    """Return the files that an analysis made, without measured walks, which are kept for later."""
    measured_dir = out_dir / MEASURED_FOLDER
    return tuple(
        p for p in sorted(out_dir.rglob("*")) if p.is_file() and not p.is_relative_to(measured_dir)
    )


def one_per_participant(
    sessions: tuple[Path, ...],
) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Return each person's first complete session (their first when none is), and the others.

    A session is complete if it was closed as such, even if its files were damaged later. A damaged
    session is not replaced by another.
    """
    by_person: dict[str, list[Path]] = {}
    for path in sessions:
        by_person.setdefault(path.parent.name, []).append(path)
    first_sessions = []
    for paths in by_person.values():
        complete = [p for p in paths if len(paths) > 1 and _was_completed(p)]
        first_sessions.append((complete or paths)[0])
    return tuple(first_sessions), tuple(p for p in sessions if p not in first_sessions)


def sessions_of(folder: Path) -> tuple[Path, ...]:
    """Return the session folders of a study, at least one; see `session_folders`.

    Raises:
        UsageError: there is none.
    """
    if not folder.is_dir():
        raise UsageError(f"{folder} does not exist; give the folder of a study")
    sessions = session_folders(folder)
    if not sessions:
        studies_above = [p for p in folder.resolve().parents[:2] if (p / SETTINGS_NAME).is_file()]
        if studies_above:
            raise UsageError(
                f"{folder} holds no sessions (sub-…/ses-…); did you mean {studies_above[0]}, the "
                "study that it lies in?"
            )
        inner = sorted(p.parent for p in folder.glob(f"*/{SETTINGS_NAME}"))
        inner += sorted(p.parent for p in folder.glob(f"*/*/{SETTINGS_NAME}"))
        command = f"visavis run {typed_study(folder)} --participant 1"
        begin = f"perform one: {command}, or give another folder"
        hint = f"; did you mean {inner[0]}?" if inner else f"; {begin}"
        raise UsageError(f"{folder} holds no sessions (sub-…/ses-…){hint}")
    return sessions


def study_of_folder(folder: Path, name: str) -> tuple[OpenedStudy, str]:
    """Return the study whose data a folder holds, and a warning where its file has changed.

    Raises:
        UsageError: its file is not where it was, with what to do.
    """
    settings = read_settings(folder)
    source = "" if settings is None else settings.source
    if not source:
        return find_study(name), ""
    path = Path(source)
    if not path.is_file():
        raise UsageError(
            f"{folder} was made with the study file {source}, which is no longer there; put it "
            "back, or name it: visavis analyse PATH/OF/STUDY.py"
        )
    has_changed = settings is not None and digest_of(path) != settings.source_sha256
    warning = f"{source}, or a text beside it, has changed since {folder} was begun"
    return find_study(source), warning if has_changed else ""


def study_of_session(*recordings: Recording) -> tuple[OpenedStudy, str]:
    """Return the study whose session a recording is, or several are, and a warning where its file
    has changed, or what a session showed is another file now.

    Raises:
        UsageError: its file is not where it was, with what to do.
    """
    first = recordings[0]
    study, warning = study_of_folder(first.path.resolve().parent.parent, first.manifest.study)
    return study, "\n".join(filter(None, (warning, words_on_files(study, recordings))))


RECORDED_AREAS: Final = "Areas of interest are those of the recording"


def words_on_files(study: OpenedStudy, recordings: Sequence[Recording]) -> str:
    """Return which files of stimuli are other ones now than when sessions of a study were recorded,
    or gone; "" where none is.
    """
    folder = study.study.files.trial_folder

    def words(of: Callable[[Mapping[str, Any], Path], frozenset[str]], one: str, many: str) -> str:
        names_by_session = {r.path: of(r.manifest.configuration, folder) for r in recordings}
        names = sorted(frozenset().union(*names_by_session.values()))
        paths = [str(path) for path, own in names_by_session.items() if own]
        what = one if len(names) == 1 else many
        were = "was" if len(paths) == 1 else "were"
        return f"{_first_of(names)} {what} {_first_of(paths)} {were} recorded" if names else ""

    others = words(changed_files, "is another file now than when", "are other files now than when")
    losses = words(files_gone, "is gone since", "are gone since")
    return "\n".join(
        (
            *([f"{others}; put them back to see what was shown"] if others else []),
            *(
                [f"{losses}; put them back to see what was shown. {RECORDED_AREAS}"]
                if losses
                else []
            ),
        )
    )


def _first_of(names: Sequence[str]) -> str:
    """Return names in a sentence, the first ones of many."""
    others = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return f"{', '.join(names[:MAX_NAMES])}{others}"

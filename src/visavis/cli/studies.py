"""The studies that the command line works with, and the study that a data folder belongs to."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from visavis.cli.app import load_lab
from visavis.cli.notifier import say_when_compiling
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig
from visavis.lab.errors import ConfigError, UsageError
from visavis.lab.yaml_lines import did_you_mean, names_or_none
from visavis.protocol.people.identifiers import means_label
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.people.ledger import Ledger, Participant, UnknownParticipant
from visavis.protocol.plan.questionnaires import available
from visavis.recording.folder import SIMULATED_ROOT, study_dir
from visavis.recording.manifest import read_manifest
from visavis.recording.sealed import copy_path
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.sessions.data_root import prepare_data_root
from visavis.running.sessions.device_setup import is_simulated
from visavis.running.sessions.folder_check import is_study
from visavis.running.sessions.recorded_design import note_on_files, require_same_design
from visavis.running.sessions.study_folder import (
    SIMULATED_PREFIX,
    StudySettings,
    sessions_of,
    settle,
    wanted_settings,
)
from visavis.study.catalogue import SHIPPED_STUDIES, is_file, typed_reference

DRY_RUNS = "dry_runs"
"""Folder below the data root with a data root for each study that `simulate` made."""


def study_of_lab(reference: str, lab: LabConfig) -> OpenedStudy:
    """Return a study by its file, or by a name that this lab knows.

    Raises:
        UsageError: there is none, with the nearest name.
        ConfigError: the lab's wording names a questionnaire that none of its studies asks.
    """
    check_wording(lab)
    say_when_compiling()
    return find_study(reference, lab.studies)


@dataclass(frozen=True)
class StudyHere:
    """A study in a lab: where its data lie, with which settings, and who takes part."""

    lab: LabConfig
    study: OpenedStudy

    @property
    def is_simulated(self) -> bool:
        """Whether this lab's devices make its sessions simulated ones."""
        return is_simulated(self.lab)

    @property
    def folder(self) -> Path:
        """Folder of its sessions."""
        return study_dir(self.lab.data_root, self.study.name, is_simulated=self.is_simulated)

    @property
    def ledger(self) -> Ledger:
        """Who takes part; simulated people have a ledger of their own."""
        prefix = SIMULATED_PREFIX if self.is_simulated else ""
        typed = typed_reference(self.study.study)
        return Ledger(self.folder, SystemClock(), prefix=prefix, typed=typed)

    @property
    def key_file(self) -> KeyFile:
        """The key file: who is who, stored apart from the data."""
        return KeyFile(self.lab.key_root, self.study.name, [self.lab.data_root])

    def requested_settings(
        self,
        *,
        seed: int | None = None,
        assignments: list[str] | None = None,
        language: str | None = None,
    ) -> StudySettings:
        """Return the settings that a command asks for; see `wanted_settings`."""
        return wanted_settings(
            self.folder,
            self.study,
            is_simulated=self.is_simulated,
            seed=seed,
            assignments=assignments,
            language=language,
            usual_language=self.lab.language,
        )

    def settle(self, requested_settings: StudySettings, *, seed_given: bool) -> StudySettings:
        """Return the settings in force, written where the study is new; see `settle`."""
        prepare_data_root(self.lab)
        return settle(
            self.folder, requested_settings, seed_given=seed_given, fits=self._groups_hold
        )

    def require_same_design(
        self, settings: StudySettings, requested_settings: StudySettings
    ) -> str:
        """Return a note where the study's file has changed and its design has not, or where what it
        shows is another file than before, or "".

        Raises:
            UsageError: sessions here were made with another design.
        """
        whose = (
            f"{self.folder} holds rehearsals alone: move it away, or throw it away"
            if self.is_simulated
            else 'Give the new study a name of its own, Study("NAME", …)'
        )
        experiment = self.study.experiment(settings.parameters)
        require_same_design(
            self.folder,
            experiment,
            f"{whose}; or another data_root in lab_config.yaml; or put the study file back",
        )
        if note := note_on_files(self.folder, experiment):
            return note
        if not settings.source_sha256 or settings.source_sha256 == requested_settings.source_sha256:
            return ""
        return (
            f"{requested_settings.source}, or a text beside it, has changed since {self.folder} "
            "was begun; what sessions show and ask is the same"
        )

    def group_of(self, settings: StudySettings) -> Callable[[int], str]:
        """Return which group each place has."""
        experiment = self.study.experiment(settings.parameters)
        return lambda index: experiment.plan(index, settings.seed).group

    def participant(self, settings: StudySettings, label_or_number: str) -> Participant:
        """Return a participant of the ledger; simulated ones are added when they first come.

        Raises:
            LedgerError: no participant is named, or a real one who is not registered.
        """
        try:
            return self.ledger.resolve(label_or_number)
        except UnknownParticipant as unknown:
            if not self.is_simulated:
                raise
            return self.ledger.add(
                unknown.number,
                group=self.group_of(settings),
                consent_version=self.lab.privacy.consent_version,
            )

    def _groups_hold(self, settings: StudySettings) -> bool:
        group_of = self.group_of(settings)
        return all(entry.group == group_of(entry.index) for entry in self.ledger.list())


def study_here(reference: str, lab: LabConfig) -> StudyHere:
    """Return a study in a lab; raises as `study_of_lab`."""
    return StudyHere(lab, study_of_lab(reference, lab))


def people_here(reference: str, lab: LabConfig, devices: str | None) -> StudyHere:
    """Return a study in a lab where its people are: real, or simulated.

    Whoever opens a page is real whatever this lab's devices are. Without `devices` it is the one
    of the two folders that has a ledger; where both have, that of the study's own place.

    Raises:
        UsageError, ConfigError: as `study_of_lab`.
    """
    here = study_here(reference, lab)
    if devices is not None or not here.is_simulated:
        return here
    real = StudyHere(lab.model_copy(update={"devices": {}}), here.study)
    is_on_page = here.study.study.procedure.on == "browser"
    if real.ledger.path.exists() == here.ledger.path.exists():
        return real if is_on_page else here
    return real if real.ledger.path.exists() else here


def check_wording(lab: LabConfig) -> None:
    """Refuse a wording of a questionnaire that does not exist.

    Questionnaires are those of Visavis, of the studies it comes with, and of the lab's studies.

    Raises:
        ConfigError: names the nearest questionnaire.
    """
    if not set(lab.wording) - set(available()):
        return
    plain = lab.model_copy(update={"wording": {}})
    names_in_studies = {
        questionnaire.name
        for name in (*SHIPPED_STUDIES, *lab.studies)
        for questionnaire in find_study(name, lab.studies).questionnaires(plain)
    }
    names = {*available(), *names_in_studies}
    problems = [
        f"no questionnaire {name!r}{did_you_mean(name, names)}"
        for name in lab.wording
        if name not in names
    ]
    if problems:
        raise ConfigError(f"{lab.path}, wording: {'; '.join(problems)}")


def folder_of(path: Path, config: Path | None, verb: str = "check") -> Path:
    """Return a study's data folder, given the folder itself, the study's file, or its name.

    `verb` is what is named with the folders that may be meant.

    Raises:
        UsageError: there are no data of it, or both real and simulated ones.
    """
    if path.is_dir():
        return path
    lab = load_lab(config, only_simulates=True)
    there = [] if is_file(str(path)) else _data_of(str(path), lab)
    name = str(path) if there else study_of_lab(str(path), lab).name
    there = there or _data_of(name, lab)
    if not there:
        raise UsageError(_no_data(name, path, lab, verb))
    if len(there) > 1:
        raise UsageError(
            f"there are real and simulated data of {name}; name the folder: "
            f"{' or '.join(map(str, there))}"
        )
    return there[0]


def _data_of(name: str, lab: LabConfig) -> list[Path]:
    """Return the folders, real and simulated, that hold data of a study of this name."""
    folders = [study_dir(lab.data_root, name, is_simulated=made_up) for made_up in (False, True)]
    return [folder for folder in folders if folder.is_dir()]


def _no_data(name: str, path: Path, lab: LabConfig, verb: str) -> str:
    """Return a message that no data were found, with the simulated studies that may be meant."""
    folders = sorted(
        (lab.data_root / DRY_RUNS).glob(f"*/{SIMULATED_ROOT}/{name}"),
        key=lambda folder: folder.stat().st_mtime_ns,
        reverse=True,
    )
    nothing = f"there are no sessions of {name} under {lab.data_root}"
    if folders:
        lines = "\n  ".join(f"visavis {verb} {shlex.quote(str(f))}" for f in folders[:6])
        return f"{nothing}; of a simulated study, type\n  {lines}"
    study = shlex.quote(str(path))
    return (
        f"{nothing}; begin with one: visavis run {study} --participant 1, or simulate the whole "
        f"study: visavis simulate {study}; or give the folder of sessions that lie elsewhere"
    )


def session_of(path: Path, config: Path | None, participant: str = "") -> Path:
    """Return a session's folder, given it, or a study (folder, file, name) and a participant.

    Without a participant it is the session begun last.

    Raises:
        UsageError: there is no such study, nobody of that label or number has a session, or the
            folder is not a session's.
    """
    if path.is_dir() and not is_study(path):
        require_session(path)
        return path
    sessions = sessions_of(folder_of(path, config))
    if participant:
        mine = [s for s in sessions if means_label(participant, label_of_session(s))]
        if not mine:
            labels = names_or_none(dict.fromkeys(map(label_of_session, sessions)))
            raise UsageError(f"{participant} has no session there; there are {labels}")
        return mine[-1]
    return max(sessions, key=lambda s: read_manifest(s).created_wall_iso)


def require_session(path: Path) -> None:
    """Refuse a path that is not a session's folder, naming the sessions nearby.

    Raises:
        UsageError: it has no manifest.
    """
    manifest = path / "manifest.json"
    if manifest.exists() or copy_path(manifest).exists():
        return
    near = sorted(p.parent for p in path.parent.glob("*/manifest.json"))
    near += sorted(p.parent for p in path.glob("*/manifest.json"))
    hint = "\n  ".join(str(p) for p in near[:6])
    raise UsageError(
        f"{path} is not a session" + (f"; there are\n  {hint}" if near else "; give a folder ses-…")
    )


def label_of_session(session: Path) -> str:
    """Return whose session a folder holds, by its place."""
    return session.parent.name.removeprefix("sub-")

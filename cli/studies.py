"""The studies the command line works with, and whose data a folder holds."""

from pathlib import Path

from lab.config import LabConfig
from lab.errors import ConfigError, UsageError
from lab.yaml_lines import did_you_mean
from protocol.questionnaires import available
from recording.folder import study_dir
from recording.manifest import read_manifest
from visavis.catalogue import SHIPPED, AnyStudy, find_study
from visavis.sessions.study_check import is_study
from visavis.sessions.study_folder import sessions_of


def study_of_lab(wanted: str, lab: LabConfig) -> AnyStudy:
    """Return a study by its file, or by a name that this lab knows.

    Raises:
        UsageError: there is none, with the nearest name.
        ConfigError: the lab words a questionnaire that no study it knows asks.
    """
    check_wording(lab)
    return find_study(wanted, lab.studies)


def check_wording(lab: LabConfig) -> None:
    """Refuse a wording of a questionnaire that there is not.

    Known are those that come with Visavis, and those of the studies it comes with and of the lab.

    Raises:
        ConfigError: naming the nearest.
    """
    if not set(lab.wording) - set(available()):
        return
    plain = lab.model_copy(update={"wording": {}})
    asked = {
        questionnaire.name
        for name in (*SHIPPED, *lab.studies)
        for questionnaire in find_study(name, lab.studies).questionnaires(plain)
    }
    known = {*available(), *asked}
    problems = [
        f"no questionnaire {name!r}{did_you_mean(name, known)}"
        for name in lab.wording
        if name not in known
    ]
    if problems:
        raise ConfigError(f"{lab.path}, wording: {'; '.join(problems)}")


def folder_of(wanted: Path, config: Path | None) -> Path:
    """Return a study's data folder, given the folder itself, the study's file, or its name.

    Raises:
        UsageError: there are no data of it, or both real and simulated ones.
    """
    if wanted.is_dir():
        return wanted
    from cli.app import load_lab  # late: it loads the models of all devices' options

    lab = load_lab(config, only_simulates=True)
    name = study_of_lab(str(wanted), lab).name
    there = [
        folder
        for simulated in (False, True)
        if (folder := study_dir(lab.data_root, name, is_simulated=simulated)).is_dir()
    ]
    if not there:
        raise UsageError(
            f"there are no data of {name} under {lab.data_root}; give the study's folder, or "
            f"simulate it: visavis simulate {wanted} --output {lab.data_root}"
        )
    if len(there) > 1:
        raise UsageError(
            f"there are real and simulated data of {name}; name the folder: "
            f"{' or '.join(map(str, there))}"
        )
    return there[0]


def session_of(wanted: Path, config: Path | None, participant: str = "") -> Path:
    """Return a session's folder, given it, or a study (folder, file, name) and a participant.

    Without a participant it is the session begun last.

    Raises:
        UsageError: there is no such study, or nobody of that label or number has a session.
    """
    if wanted.is_dir() and not is_study(wanted):
        return wanted
    sessions = sessions_of(folder_of(wanted, config))
    if participant:
        mine = [s for s in sessions if participant.upper() in _names(s)]
        if not mine:
            known = ", ".join(dict.fromkeys(s.parent.name.removeprefix("sub-") for s in sessions))
            raise UsageError(f"{participant} has no session there; there are {known}")
        return mine[-1]
    return max(sessions, key=lambda s: read_manifest(s).created_wall_iso)


def _names(session: Path) -> tuple[str, ...]:
    """Return what a session's participant may be called: the label, its number."""
    label = session.parent.name.removeprefix("sub-")
    number = "".join(c for c in label if c.isdigit())
    return (label, number, number.lstrip("0"))

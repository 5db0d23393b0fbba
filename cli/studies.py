"""The studies the command line works with, and whose data a folder holds."""

from pathlib import Path

from cli.study_folder import read_settings
from lab.config import LabConfig
from lab.errors import UsageError
from recording.folder import study_dir
from visavis.catalogue import AnyStudy, digest_of, find_study


def study_of_lab(wanted: str, lab: LabConfig) -> AnyStudy:
    """Return a study by its file, or by a name that this lab knows.

    Raises:
        UsageError: there is none, with the nearest name.
    """
    return find_study(wanted, lab.studies)


def study_of_folder(folder: Path, name: str) -> tuple[AnyStudy, str]:
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
    changed = settings is not None and digest_of(path) != settings.source_sha256
    warning = (
        f"{source} has changed since {folder} was begun: what is read from the recordings may not "
        "be what was planned"
    )
    return find_study(source), warning if changed else ""


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

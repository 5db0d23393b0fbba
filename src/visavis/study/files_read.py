"""The files beside a study's own that it shows or asks from: items, pictures, sounds, words."""

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from visavis.stimuli.area_paths import names_of_areas
from visavis.stimuli.own_room import Room
from visavis.study.experiment import StudyExperiment

FILES_KEY: Final = "files"
"""The key of a session's configuration under which it keeps the digests of stimuli."""


def stimulus_files(experiment: StudyExperiment) -> dict[str, dict[str, str]]:
    """Return the entry of a session's configuration with the SHA-256 of every picture, film,
    sound and voice that a study shows or plays, and of their areas, by its name in the study;
    nothing without any.
    """
    folder, names = experiment.settings.folder, set[str]()
    stimuli = (*experiment.flats, *experiment.panoramas, *experiment.audibles)
    for one in (*stimuli, *experiment.voices):
        names.add(getattr(one, "file", ""))
        if areas := getattr(one, "areas", ""):
            names.update(names_of_areas(folder, areas))
    for path in (s for t in experiment.read.values() for s in t.sounds if isinstance(s, Path)):
        is_beside = path.is_relative_to(folder)
        names.add((path.relative_to(folder) if is_beside else path).as_posix())
    paths = {name: folder / name for name in sorted(names)}
    digests = {name: _sha256(path) for name, path in paths.items() if path.is_file()}
    return {FILES_KEY: digests} if digests else {}


def changed_files(configuration: Mapping[str, Any], folder: Path) -> frozenset[str]:
    """Return which files of a study in a folder are other ones than when a session with this
    configuration began.
    """
    digests = configuration.get(FILES_KEY, {})
    return frozenset(
        name
        for name, digest in digests.items()
        if (folder / name).is_file() and _sha256(folder / name) != digest
    )


def files_gone(configuration: Mapping[str, Any], folder: Path) -> frozenset[str]:
    """Return which files of a session with this configuration are no longer in a folder."""
    names = configuration.get(FILES_KEY, {})
    return frozenset(name for name in names if not (folder / name).is_file())


def differing_files(configurations: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the names of files that were not the same in all sessions with these
    configurations.
    """
    digests = defaultdict[str, set[str]](set)
    for configuration in configurations:
        for name, digest in configuration.get(FILES_KEY, {}).items():
            digests[name].add(digest)
    return sorted(name for name, of_sessions in digests.items() if len(of_sessions) > 1)


def _sha256(path: Path) -> str:
    about = path.stat()
    return _sha256_since(path, about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=4096)
def _sha256_since(path: Path, modified_ns: int, size: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digests_of_files(experiment: StudyExperiment) -> dict[str, str]:
    """Return the SHA-256 of every file that a study shows or asks from, by its name seen from the
    study's folder. Files that are not there are left out.
    """
    folder = experiment.study.files.folder.resolve()
    paths = {path.resolve() for path in _files(experiment) if path.is_file()}
    return {
        (path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name): (
            _sha256(path)
        )
        for path in sorted(paths)
    }


def _files(experiment: StudyExperiment) -> Iterator[Path]:
    study, folder = experiment.study, experiment.settings.folder
    asks, reads = study.asks, experiment.read.values()
    for texts in study.text_folders:
        yield from texts.glob("*.yaml")
    for name in (*asks.questionnaires, *asks.after_block):
        yield from (at / f"{name}.yaml" for at in study.folders)
    if experiment.item_table is not None:
        yield folder / experiment.item_table.file
        for row in experiment.item_table.rows:
            yield from _paths_in(folder, row.values())
    yield from _paths_in(folder, experiment.parameters.values())
    scenes = [scene for trial in reads for scene in trial.scenes]
    for picture in (*experiment.flats, *experiment.panoramas):
        yield from _paths_in(folder, vars(picture).values())
        if areas := getattr(picture, "areas", ""):
            yield from (folder / name for name in names_of_areas(folder, areas))
    for sound in (sound for trial in reads for sound in trial.sounds):
        yield from _paths_in(folder, [sound, getattr(sound, "file", None)])
    yield from (folder / voice.file for voice in experiment.voices)
    for scene in scenes:
        options = scene.options.values()
        yield from _paths_in(folder, [o.file if isinstance(o, Room) else o for o in options])


def _paths_in(folder: Path, values: Any) -> Iterator[Path]:
    """Yield the files below a folder, or anywhere, that some values name."""
    for value in values:
        if isinstance(value, Path) or (isinstance(value, str) and "." in value):
            yield folder / value

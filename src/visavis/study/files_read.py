"""The files beside a study's own that it shows or asks from: items, pictures, sounds, words."""

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from visavis.lab.yaml_lines import read_document
from visavis.stimuli.own_room import Room
from visavis.study.experiment import StudyExperiment


def digests_of_files(experiment: StudyExperiment) -> dict[str, str]:
    """Return the SHA-256 of every file that a study shows or asks from, by its name seen from the
    study's folder. Files that are not there are left out.
    """
    folder = experiment.study.files.folder.resolve()
    paths = {path.resolve() for path in _files(experiment) if path.is_file()}
    return {
        (path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name): (
            hashlib.sha256(path.read_bytes()).hexdigest()
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
            yield from _of_areas(folder / areas)
    for sound in (sound for trial in reads for sound in trial.sounds):
        yield from _paths_in(folder, [sound, getattr(sound, "file", None)])
    yield from (folder / voice.file for voice in experiment.voices)
    for scene in scenes:
        options = scene.options.values()
        yield from _paths_in(folder, [o.file if isinstance(o, Room) else o for o in options])


def _of_areas(path: Path) -> Iterator[Path]:
    """Yield a file of areas, and the painted masks that it names."""
    yield path
    if path.suffix == ".yaml" and path.is_file():
        for area in dict(read_document(path).data or {}).values():
            if isinstance(area, Mapping) and "mask" in area:
                yield path.parent / str(area["mask"])


def _paths_in(folder: Path, values: Any) -> Iterator[Path]:
    """Yield the files below a folder, or anywhere, that some values name."""
    for value in values:
        if isinstance(value, Path) or (isinstance(value, str) and "." in value):
            yield folder / value

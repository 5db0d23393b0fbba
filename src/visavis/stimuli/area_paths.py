"""The files that areas of interest are read from: their names, and whether they are there."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from visavis.lab.yaml_lines import read_document
from visavis.stimuli.flat import Flat, Image, Panorama, Video, picture_path

Stimulus = TypeVar("Stimulus", bound=Flat | Panorama)


def names_of_areas(folder: Path, name: str) -> Iterator[str]:
    """Yield the name of a file of areas, and those of the painted masks that it names."""
    yield name
    path = folder / name
    if path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        for area in dict(read_document(path).data or {}).values():
            if isinstance(area, Mapping) and "mask" in area:
                yield (Path(name).parent / str(area["mask"])).as_posix()


def is_gone(stimulus: Flat | Panorama, folder: Path) -> bool:
    """Tell whether a stimulus is of a file that is not in the folder."""
    return (
        isinstance(stimulus, Image | Video | Panorama)
        and not picture_path(stimulus, folder).is_file()
    )


def with_areas_there(stimulus: Stimulus, folder: Path, names_gone: set[str]) -> Stimulus:
    """Return a stimulus, without areas of interest where its file or one of theirs is not in the
    folder: its name is then added to those in `names_gone`.
    """
    if not isinstance(stimulus, Image | Video | Panorama):
        return stimulus
    names = [stimulus.file, *(names_of_areas(folder, stimulus.areas) if stimulus.areas else ())]
    absences = [name for name in names if not (folder / name).is_file()]
    names_gone.update(absences)
    return replace(stimulus, areas="") if absences and stimulus.areas else stimulus

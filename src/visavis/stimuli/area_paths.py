"""The files of pictures, films and their areas of interest: which are there, and which are gone."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, TypeVar

from visavis.lab.errors import DesignError
from visavis.lab.yaml_lines import read_document
from visavis.stimuli.dressing.picture_of import named_function
from visavis.stimuli.flat import Flat, Image, Panorama, Video, picture_path

AREA_NAMES: Final = "visavis.stimuli.area_files:area_names"

Stimulus = TypeVar("Stimulus", bound=Flat | Panorama)


@dataclass
class FilesGone:
    """What a recorded study no longer has beside it, noted while its trials are read."""

    names: set[str] = field(default_factory=set)
    """The files of pictures, films and areas that are gone."""
    area_names: set[str] = field(default_factory=set)
    """The areas of stimuli that are gone, by files of areas that are there."""
    hides_areas: bool = False
    """Whether a file of areas is gone, so that only recordings have their names."""
    hides_lengths: bool = False
    """Whether a film is gone that would say how long it is shown."""


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


def with_areas_there(stimulus: Stimulus, folder: Path, losses: FilesGone) -> Stimulus:
    """Return a stimulus, without areas of interest where its file or one of theirs is not in the
    folder, which is then noted in `losses`.
    """
    if not isinstance(stimulus, Image | Video | Panorama):
        return stimulus
    files_of_areas = [*names_of_areas(folder, stimulus.areas)] if stimulus.areas else []
    names = [stimulus.file, *files_of_areas]
    absences = [name for name in names if not (folder / name).is_file()]
    losses.names.update(absences)
    if not absences or not stimulus.areas:
        return stimulus
    try:
        names_in = named_function(AREA_NAMES, "reads the names of areas")
        losses.area_names |= names_in(folder / stimulus.areas)
    except DesignError:  # the file is gone, or not to be read
        losses.hides_areas = True
    return replace(stimulus, areas="")

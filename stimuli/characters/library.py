"""A lab's own characters: a folder of imported ones."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from stimuli.characters.character import Character
from stimuli.characters.errors import CharacterError
from stimuli.characters.gltf import Gender, import_gltf
from stimuli.characters.storage import write_character


@dataclass(frozen=True)
class Imported:
    """What became of one file: the character and where it lies, or what is wrong with it."""

    source: Path
    character: Character | None
    path: Path | None
    problem: str = ""


def library_names(library: Path) -> tuple[str, ...]:
    """Return the names of the imported characters."""
    return tuple(sorted(path.stem for path in library.glob("*.npz")))


def import_characters(
    source: Path, library: Path, *, gender: Gender | None = None
) -> Iterator[Imported]:
    """Import a .glb file, or every one in a folder, into the library, one after the other.

    A file that cannot be used is reported and does not stop the others.

    Raises:
        CharacterError: there is nothing to import.
    """
    files = sorted(source.glob("*.glb")) if source.is_dir() else [source]
    if not files:
        raise CharacterError(f"{source}: no .glb files in it; give the folder that holds them")
    for file in files:
        try:
            character = import_gltf(file, gender=gender)
        except CharacterError as error:
            yield Imported(file, None, None, str(error))
            continue
        library.mkdir(parents=True, exist_ok=True)
        path = library / f"{character.name}.npz"
        write_character(character, path)
        yield Imported(file, character, path)

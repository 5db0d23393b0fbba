"""A lab's own characters: a folder of imported ones."""

import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import partial
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Final

from visavis.lab.plain_files import unpacked
from visavis.stimuli.characters.cast import cast_names
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.fbx import as_glb
from visavis.stimuli.characters.gltf import Gender, import_gltf
from visavis.stimuli.characters.sizing import scale_to_stature
from visavis.stimuli.characters.storage import FIGURE_FILES, write_character

PART_NAME: Final = re.compile(r"(female|male)_0*[1-9]\d*")
"""Names of parts that a cast's women and men play by turns."""


@dataclass(frozen=True)
class Imported:
    """The result of importing one file: the character and its path, or the error.

    `odd` says what is strange about the file of somebody who can be used.
    """

    source: Path
    character: Character | None
    path: Path | None
    problem: str = ""
    odd: tuple[str, ...] = ()


@contextmanager
def people_in(download: Path, only: str = "*") -> Iterator[Path]:
    """Collect the .glb files of a download (a .zip or a folder of folders) in a temporary folder.

    `only` is a pattern that their names, without the ending, must fit.

    Raises:
        CharacterError: it is neither, or holds none.
    """
    with TemporaryDirectory() as temporary:
        people_folder = Path(temporary)
        n_files = 0
        if download.is_dir():
            for path in sorted(download.rglob("*.glb")):
                if fnmatch(path.stem, only):
                    shutil.copyfile(path, people_folder / path.name)
                    n_files += 1
        else:
            try:
                for name, content in unpacked(download, partial(_is_figure, only=only)):
                    (people_folder / PurePosixPath(name).name).write_bytes(content)
                    n_files += 1
            except (OSError, ValueError) as e:
                raise CharacterError(
                    f"{download}: neither a folder nor a whole .zip ({e}); download it again"
                ) from e
        if not n_files:
            raise CharacterError(f"{download}: holds no .glb file called {only!r}; see its content")
        yield people_folder


def _is_figure(name: str, *, only: str) -> bool:
    path = PurePosixPath(name)
    return path.suffix == ".glb" and fnmatch(path.stem, only)


def library_names(library: Path) -> tuple[str, ...]:
    """Return the names of the imported characters."""
    return tuple(sorted(path.stem for path in library.glob("*.npz")))


def import_characters(
    source: Path,
    library: Path,
    *,
    gender: Gender | None = None,
    joint_map: Mapping[str, str] | None = None,
    gaze: bool = True,
    stature_m: float | None = None,
) -> Iterator[Imported]:
    """Import a .glb, .vrm or .fbx file, or every one in a folder, into the library, one by one.

    FBX files are converted by Blender (`visavis.stimuli.characters.fbx`). Without `gaze` figures
    need no eyes, and look nowhere. With `stature_m` everybody is scaled to be so tall. A file that
    cannot be used is reported and does not stop the others.

    Raises:
        CharacterError: there is nothing to import.
    """
    files = [source]
    if source.is_dir():
        files = sorted(path for path in source.iterdir() if path.suffix.lower() in FIGURE_FILES)
    if not files:
        raise CharacterError(
            f"{source}: no .glb, .vrm or .fbx files in it; give the folder that holds them"
        )
    for file in files:
        try:
            character, odd = _import_file(file, gender, joint_map, gaze=gaze)
            if stature_m is not None:
                character = scale_to_stature(character, stature_m)
            character = replace(character, name=_own_name(character.name, file))
        except CharacterError as error:
            yield Imported(file, None, None, str(error))
            continue
        library.mkdir(parents=True, exist_ok=True)
        path = library / f"{character.name}.npz"
        write_character(character, path)
        yield Imported(file, character, path, odd=odd)


def _own_name(name: str, file: Path) -> str:
    """Return the name in a file, or of it, by which scenes take nobody else.

    Raises:
        CharacterError: others are called both.
    """
    for own in (name, file.stem):
        if own not in cast_names() and not PART_NAME.fullmatch(own):
            return own
    raise CharacterError(
        f"{file}: scenes would take {name!r} for somebody of the cast; give the file another name, "
        f"such as own_{file.name}"
    )


def _import_file(
    file: Path, gender: Gender | None, joint_map: Mapping[str, str] | None, *, gaze: bool
) -> tuple[Character, tuple[str, ...]]:
    if file.suffix.lower() != ".fbx":
        return import_gltf(file, gender=gender, joint_map=joint_map, gaze=gaze), ()
    with as_glb(file) as (glb_path, missing_pictures):
        try:
            character = import_gltf(glb_path, gender=gender, joint_map=joint_map, gaze=gaze)
        except CharacterError as e:
            raise CharacterError(str(e).replace(str(glb_path), str(file))) from e
    odd: tuple[str, ...] = ()
    if missing_pictures:
        odd = (
            f"lacks the pictures {', '.join(missing_pictures)}, so their surfaces are plain: "
            "put them into the file's folder or one next to it, and import it again",
        )
    return replace(character, source=f"imported from {file.name} by way of Blender"), odd

"""The people that come with Visavis, and those a lab has imported."""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.storage import read_character

DATA = Path(__file__).resolve().parent / "data"


def cast_names() -> tuple[str, ...]:
    """Return the names of the default cast, in order."""
    return tuple(sorted(path.stem for path in DATA.glob("*.npz")))


@cache
def _read_shipped(name: str) -> Character:
    return read_character(DATA / f"{name}.npz")


@cache
def load_cast() -> tuple[Character, ...]:
    """Return the default cast: six women, then six men, all different adults.

    Every call returns the same objects, so a renderer keeps what it has built.
    """
    with ThreadPoolExecutor(2) as pool:  # unpacking releases the GIL
        return tuple(pool.map(_read_shipped, cast_names()))


def load_character(name_or_path: str | Path, library: Path | None = None) -> Character:
    """Return a character of the default cast, of the lab's library, or of a file.

    Raises:
        CharacterError: there is none of that name, or its file cannot be read.
    """
    text = str(name_or_path)
    if text.endswith(".npz"):
        return read_character(Path(name_or_path))
    if text in cast_names():
        return _read_shipped(text)
    if library is not None and (library / f"{text}.npz").exists():
        return read_character(library / f"{text}.npz")
    raise CharacterError(
        f"no character {text!r}; the cast has {', '.join(cast_names())}; "
        "`visavis character list` also names those imported"
    )

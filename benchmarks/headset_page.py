"""Print how large a page in a headset is, how many draws a person takes for each eye, and what the
page of waving loads before its first trial, as bare waves, which need no plan.

python -m benchmarks.headset_page
"""

import argparse
import gzip
import json
import math
import struct
from typing import Final

from visavis.experiments.waving.on_page import study
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import film_store
from visavis.running.live_film import live_film_files
from visavis.running.page.server import (
    DRAWN_FILM_FILES,
    FILES,
    HEADSET_FILES,
    LIVE_FILES,
    SITE,
)
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.gltf.exporting import glb_of_character
from visavis.study.films import LiveFilm

PICTURES_A_DRAW: Final = 5
"""As `site/live.js` joins a person's parts."""


def page_bytes() -> int:
    """Return how many bytes of files a page in a headset loads, compressed."""
    names = {**FILES, **LIVE_FILES, **DRAWN_FILM_FILES, **HEADSET_FILES}.values()
    return sum(len(gzip.compress((SITE / name).read_bytes(), 9)) for name in set(names))


def draws_of(data: bytes) -> int:
    """Return how many draws a person's file takes for one eye: one for every five pictures."""
    (length,) = struct.unpack_from("<I", data, 12)
    content = json.loads(data[20 : 20 + length])
    return max(1, math.ceil(len(content.get("images", ())) / PICTURES_A_DRAW))


def film_bytes() -> dict[str, int]:
    """Return how many bytes of each kind a page of waving loads before its first trial."""
    experiment = OpenedStudy(study).experiment({"increment": 0.0})
    films = [live.film for live in experiment.lives if isinstance(live, LiveFilm)]
    store = film_store(experiment)
    kinds: dict[str, set[bytes]] = {"rooms": set(), "people": set(), "poses": set()}
    for film in films:
        files = live_film_files(film, store)
        kinds["rooms"].add(files.room_file)
        kinds["people"] |= {*files.people}
        kinds["poses"] |= {*files.poses}
    return {kind: sum(map(len, files)) for kind, files in kinds.items()}


def main() -> None:
    """Print all of it."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"page in a headset: {page_bytes() / 1000:.0f} kB compressed (gzip)")
    for name in cast_names():
        data = glb_of_character(load_character(name))
        print(f"{name}: {draws_of(data)} draws for each eye")
    for kind, count in film_bytes().items():
        print(f"waving_page, {kind}: {count / 1e6:.1f} MB")


if __name__ == "__main__":
    main()

"""Print how large a page in a headset is, and how many draws a person takes for each eye.

python -m benchmarks.headset_page
"""

import argparse
import gzip
import json
import math
import struct
from typing import Final

from visavis.running.page.server import FILES, HEADSET_FILES, LIVE_FILES, SITE
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.gltf.exporting import glb_of_character

PICTURES_A_DRAW: Final = 5
"""As `site/live.js` joins a person's parts."""


def page_bytes() -> int:
    """Return how many bytes of files a page in a headset loads, compressed."""
    names = {**FILES, **LIVE_FILES, **HEADSET_FILES}.values()
    return sum(len(gzip.compress((SITE / name).read_bytes(), 9)) for name in set(names))


def draws_of(data: bytes) -> int:
    """Return how many draws a person's file takes for one eye: one for every five pictures."""
    (length,) = struct.unpack_from("<I", data, 12)
    content = json.loads(data[20 : 20 + length])
    return max(1, math.ceil(len(content.get("images", ())) / PICTURES_A_DRAW))


def main() -> None:
    """Print both."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"page in a headset: {page_bytes() / 1000:.0f} kB compressed (gzip)")
    for name in cast_names():
        data = glb_of_character(load_character(name))
        print(f"{name}: {draws_of(data)} draws for each eye")


if __name__ == "__main__":
    main()

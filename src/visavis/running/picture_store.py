"""Pictures and films of a study's files as pages get them."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

from visavis.stimuli.film_file import film_facts, kind_for_browsers
from visavis.stimuli.flat import Image, Video, picture_path
from visavis.stimuli.flat_pixels import read_picture


@dataclass(frozen=True, eq=False)
class PictureStore:
    """The pictures and films of a study; `assets` maps names, the SHA-256 of files, to the content
    of pictures, `films` to where films lie.
    """

    pictures: Sequence[Image]
    folder: Path
    assets: dict[str, bytes] = field(default_factory=dict)
    described: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What a page must know about each file, by its name."""

    films: dict[str, Path] = field(default_factory=dict)

    def describe(self, image: Image | Video, *, is_simulated: bool = False) -> dict[str, Any]:
        """Return what a page must know about a picture or film; simulated people need no file.

        Raises:
            DesignError: it cannot be read, or few browsers play it.
        """
        if isinstance(image, Video):
            return self._describe_film(picture_path(image, self.folder), is_simulated)
        if image.file not in self.described:
            picture = read_picture(picture_path(image, self.folder))
            description = {"width_px": picture.width, "height_px": picture.height}
            data = b"" if is_simulated else _lossless(picture)
            name = hashlib.sha256(data).hexdigest() if data else image.file
            if data:
                self.assets[name] = data
            self.described[image.file] = {"picture": name, "bytes": len(data), **description}
        return self.described[image.file]

    def _describe_film(self, path: Path, is_simulated: bool) -> dict[str, Any]:
        facts = film_facts(path)
        description = {
            "mime": kind_for_browsers(path),
            "width_px": facts.size_px[0],
            "height_px": facts.size_px[1],
            "pictures": len(facts.stamps_s),
            "lasts_s": facts.seconds,
        }
        if is_simulated:
            return description | {"film": path.name, "sha256": "", "bytes": 0}
        name = _hash_of(path, path.stat().st_mtime_ns)
        self.films[name] = path
        return description | {"film": name, "sha256": name, "bytes": path.stat().st_size}


@lru_cache(maxsize=512)
def _hash_of(path: Path, modified_ns: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _lossless(picture: Any) -> bytes:
    """Return a picture as PNG: upright, as it is on a monitor here, without colour profile and
    whatever else its camera wrote.
    """
    file = BytesIO()
    is_opaque = picture.getchannel("A").getextrema()[0] == 255
    plain = picture.convert("RGB" if is_opaque else "RGBA")
    plain.info.clear()  # Pillow would write the profile again
    plain.save(file, "PNG")
    return file.getvalue()

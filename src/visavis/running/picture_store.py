"""Pictures and films of a study's files as pages get them."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from PIL import Image as Files

from visavis.stimuli.film_file import film_facts, kind_for_browsers
from visavis.stimuli.flat import Image, Panorama, Video, picture_path
from visavis.stimuli.flat_pixels import read_picture
from visavis.stimuli.panorama_pixels import panorama_pixels

MAX_SENT_PX: Final = 4096
"""How wide a panorama is at most that a page gets: more would be too large for many graphics cards,
and for a wait before the first trial.
"""
JPEG: Final = (".jpg", ".jpeg")
JPEG_QUALITY: Final = 95
"""As photographs are saved; without loss a panorama would be several times as large."""


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

    def describe(
        self, image: Image | Video | Panorama, *, is_simulated: bool = False
    ) -> dict[str, Any]:
        """Return what a page must know about a picture, film or panorama, of one for two eyes about
        the left one's; simulated people need no file.

        Raises:
            DesignError: it cannot be read, or few browsers play it.
        """
        if isinstance(image, Video):
            return self._describe_film(picture_path(image, self.folder), is_simulated)
        path = picture_path(image, self.folder)
        if isinstance(image, Panorama):
            key, is_photograph = f"{image.file} around, {image.stereo}", path.suffix.lower() in JPEG
            read = partial(_left_eye, image, self.folder)
            return self._describe_picture(key, read, is_photograph, is_simulated)
        read = partial(read_picture, path)
        return self._describe_picture(image.file, read, False, is_simulated)

    def _describe_picture(
        self, key: str, read: Callable[[], Any], is_photograph: bool, is_simulated: bool
    ) -> dict[str, Any]:
        if key not in self.described:
            picture = read()
            description = {"width_px": picture.width, "height_px": picture.height}
            description |= {"mime": "image/jpeg"} if is_photograph else {}
            encode = _as_jpeg if is_photograph else _lossless
            data = b"" if is_simulated else encode(picture)
            name = hashlib.sha256(data).hexdigest() if data else key
            if data:
                self.assets[name] = data
            self.described[key] = {"picture": name, "bytes": len(data), **description}
        return self.described[key]

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


def _left_eye(panorama: Panorama, folder: Path) -> Any:
    """Return what the left eye sees of a panorama."""
    picture = Files.fromarray(panorama_pixels(panorama, folder).eyes[0])
    if picture.width <= MAX_SENT_PX:
        return picture
    return picture.resize((MAX_SENT_PX, MAX_SENT_PX // 2), Files.Resampling.LANCZOS)


def _as_jpeg(picture: Any) -> bytes:
    """Return a photograph as JPEG, its colours as finely as its brightness."""
    file = BytesIO()
    picture.save(file, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return file.getvalue()


def _lossless(picture: Any) -> bytes:
    """Return a picture as PNG: upright, as it is on a monitor here, without colour profile and
    whatever else its camera wrote.
    """
    file = BytesIO()
    is_opaque = picture.mode == "RGB" or picture.getchannel("A").getextrema()[0] == 255
    plain = picture.convert("RGB" if is_opaque else "RGBA")
    plain.info.clear()  # Pillow would write the profile again
    plain.save(file, "PNG")
    return file.getvalue()

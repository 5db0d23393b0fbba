"""Pictures of a study's files as pages get them: the pixels that a monitor would show."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

from visavis.stimuli.flat import Image, picture_path
from visavis.stimuli.flat_pixels import read_picture


@dataclass(frozen=True, eq=False)
class PictureStore:
    """The pictures of a study; `assets` maps names, the SHA-256 of files, to their content."""

    pictures: Sequence[Image]
    folder: Path
    assets: dict[str, bytes] = field(default_factory=dict)
    described: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What a page must know about each file, by its name."""

    def describe(self, image: Image, *, is_simulated: bool = False) -> dict[str, Any]:
        """Return what a page must know about a picture; simulated people need no file.

        Raises:
            DesignError: it cannot be read.
        """
        if image.file not in self.described:
            picture = read_picture(picture_path(image, self.folder))
            description = {"width_px": picture.width, "height_px": picture.height}
            data = b"" if is_simulated else _lossless(picture)
            name = hashlib.sha256(data).hexdigest() if data else image.file
            if data:
                self.assets[name] = data
            self.described[image.file] = {"picture": name, "bytes": len(data), **description}
        return self.described[image.file]


def _lossless(picture: Any) -> bytes:
    """Return a picture as PNG: upright, without a colour profile, as it is on a monitor here."""
    file = BytesIO()
    is_opaque = picture.getchannel("A").getextrema()[0] == 255
    (picture.convert("RGB") if is_opaque else picture).save(file, "PNG")
    return file.getvalue()

"""Write glTF 2.0 binary files: arrays, pictures and the JSON that refers to them."""

import io
import json
import struct
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image

Pixels = npt.NDArray[np.uint8]
_CODES: Final = {"u1": 5121, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES: Final = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
VERTICES: Final = 34962
INDICES: Final = 34963


@dataclass(eq=False)
class GlbContent:
    """A file as it is put together: `tree` is its JSON, arrays and pictures lie one after another.

    Pictures that several materials share are written once.
    """

    tree: dict[str, Any] = field(default_factory=dict)
    _binary: bytearray = field(default_factory=bytearray)
    _pictures: list[tuple[Pixels, int]] = field(default_factory=list)

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Append an entry to a list of the tree and return its number."""
        entries = self.tree.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, data: bytes, target: int | None = None) -> int:
        """Append bytes, from a multiple of four on, and return their number."""
        self._binary += b"\0" * (-len(self._binary) % 4)
        entry = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        self._binary += data
        return self.add("bufferViews", entry if target is None else {**entry, "target": target})

    def array(
        self,
        values: npt.ArrayLike,
        dtype: str,
        *,
        target: int | None = None,
        normalized: bool = False,
        with_bounds: bool = False,
    ) -> int:
        """Append an array (count,) or (count, width) as u1, u2, u4 or f4; return its number."""
        rows = np.ascontiguousarray(values, dtype=f"<{dtype}")
        rows = rows.reshape(len(rows), -1)
        entry: dict[str, Any] = {
            "bufferView": self.view(rows.tobytes(), target),
            "componentType": _CODES[dtype],
            "count": len(rows),
            "type": _TYPES[rows.shape[1]],
        }
        if normalized:
            entry["normalized"] = True
        return self.add("accessors", entry | (_bounds(rows) if with_bounds else {}))

    def displacements(self, rows: npt.NDArray[Any], delta: npt.NDArray[Any], count: int) -> int:
        """Append displacements (k, 3) of the vertices `rows` (k,), the others at rest."""
        order = np.argsort(rows, kind="stable")
        offsets = np.ascontiguousarray(delta[order], dtype="<f4")
        ends = np.concatenate([offsets, np.zeros((1 if len(rows) < count else 0, 3), "<f4")])
        entry = {
            "componentType": _CODES["f4"],
            "count": count,
            "type": "VEC3",
            "sparse": {
                "count": len(rows),
                "indices": {
                    "bufferView": self.view(rows[order].astype("<u4").tobytes()),
                    "componentType": _CODES["u4"],
                },
                "values": {"bufferView": self.view(offsets.tobytes())},
            },
        }
        return self.add("accessors", entry | _bounds(ends))

    def texture(self, pixels: Pixels) -> dict[str, Any]:
        """Append a picture (h, w, 3 or 4) and return what a material refers to it by."""
        for known_pixels, number in self._pictures:
            if known_pixels is pixels:
                return {"index": number}
        data, mime = _packed(pixels)
        image = self.add("images", {"bufferView": self.view(data), "mimeType": mime})
        if "samplers" not in self.tree:  # repeated, smooth both ways, with mipmaps
            self.add("samplers", {"magFilter": 9729, "minFilter": 9987})
        number = self.add("textures", {"source": image, "sampler": 0})
        self._pictures.append((pixels, number))
        return {"index": number}

    def packed(self) -> bytes:
        """Return the whole file."""
        self._binary += b"\0" * (-len(self._binary) % 4)
        tree = {**self.tree, "buffers": [{"byteLength": len(self._binary)}]}
        text = json.dumps(tree, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(self._binary)
        head = struct.pack("<4sII", b"glTF", 2, total)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        return head + chunks + struct.pack("<I4s", len(self._binary), b"BIN\0") + self._binary


def _bounds(rows: npt.NDArray[Any]) -> dict[str, list[float]]:
    return {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}


def _packed(pixels: Pixels) -> tuple[bytes, str]:
    """Return a picture as a JPEG file, or as PNG where it has an alpha channel or few colours."""
    buffer = io.BytesIO()
    image = Image.fromarray(pixels)
    if pixels.shape[2] == 3 and min(pixels.shape[:2]) >= 16:
        image.save(buffer, format="JPEG", quality=90, subsampling=0, optimize=True)
        return buffer.getvalue(), "image/jpeg"
    image.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue(), "image/png"

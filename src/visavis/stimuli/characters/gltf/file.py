"""Read glTF binary files into arrays: quantised, meshopt-packed and WebP-textured ones too."""

import io
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.lab.plain_files import parse_json, read_plain
from visavis.stimuli.characters.errors import CharacterError

_TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32,
          5126: np.float32}  # fmt: skip
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_KNOWN = {
    "EXT_texture_webp",
    "KHR_mesh_quantization",
    "EXT_meshopt_compression",
    "KHR_materials_unlit",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_texture_transform",
    "KHR_materials_sheen",
    "KHR_materials_emissive_strength",
}
TEXTURES = ("PNG", "JPEG", "WEBP")
Array = npt.NDArray[Any]


@dataclass(eq=False)
class GltfFile:
    """A parsed file; `tree` is its JSON."""

    path: Path
    tree: dict[str, Any]
    binary: bytes
    _views: dict[int, bytes] = field(default_factory=dict)

    def items(self, kind: str) -> list[dict[str, Any]]:
        """Return a list of the tree, empty when absent."""
        return list(self.tree.get(kind, []))

    def _view(self, index: int) -> bytes:
        if index not in self._views:
            view = self.tree["bufferViews"][index]
            compression = view.get("extensions", {}).get("EXT_meshopt_compression")
            source = compression or view
            start, length = source.get("byteOffset", 0), source["byteLength"]
            data = self.binary[start : start + length]
            if len(data) != length:
                raise CharacterError(
                    f"{self.path}: cut short, {length - len(data)} bytes are missing; copy it again"
                )
            self._views[index] = self._unpack(data, compression) if compression else data
        return self._views[index]

    def _unpack(self, data: bytes, compression: dict[str, Any]) -> bytes:
        try:
            import meshoptimizer
        except ImportError as e:
            raise CharacterError(
                f"{self.path} is packed with meshopt; run `pip install meshoptimizer` to read it"
            ) from e
        count, stride = compression["count"], compression["byteStride"]
        mode, filter_name = compression["mode"], compression.get("filter", "NONE")
        try:
            if mode != "ATTRIBUTES":
                # The decoder overruns narrower indices: always ask for four bytes.
                decode = (
                    meshoptimizer.decode_index_buffer
                    if mode == "TRIANGLES"
                    else meshoptimizer.decode_index_sequence
                )
                wide = np.asarray(decode(count, 4, data)).view(np.uint32)[:count]
                return bytes(wide.astype(np.uint16 if stride == 2 else np.uint32).tobytes())
            # A plain byte type makes the decoder overrun: one element must be a whole vertex.
            whole = meshoptimizer.decode_vertex_buffer(count, stride, data, np.dtype(f"V{stride}"))
        except (RuntimeError, ValueError) as e:
            raise CharacterError(
                f"{self.path}: its packed arrays are broken ({e}); export it again"
            ) from e
        if filter_name == "OCTAHEDRAL":
            return _octahedral(whole.tobytes(), stride)
        if filter_name != "NONE":
            raise CharacterError(
                f"{self.path}: meshopt filter {filter_name} is not read; export without"
            )
        return bytes(whole.tobytes())

    def accessor(self, index: int) -> Array:
        """Return the values (count, width) of an accessor, normalised ones as floats.

        Raises:
            CharacterError: a value is not a finite number, which glTF forbids.
        """
        entry = self.tree["accessors"][index]
        width, dtype = _WIDTH[entry["type"]], np.dtype(_TYPES[entry["componentType"]])
        count = entry["count"]
        values: Array = np.zeros((count, width), dtype=dtype)
        if "bufferView" in entry:
            view = self.tree["bufferViews"][entry["bufferView"]]
            values = self._strided_view(
                entry["bufferView"],
                entry.get("byteOffset", 0),
                count,
                width,
                dtype,
                view.get("byteStride"),
            )
        if "sparse" in entry:
            values = values.copy()
            sparse = entry["sparse"]
            where, new = sparse["indices"], sparse["values"]
            rows = self._strided_view(
                where["bufferView"],
                where.get("byteOffset", 0),
                sparse["count"],
                1,
                np.dtype(_TYPES[where["componentType"]]),
                None,
            )
            values[rows[:, 0]] = self._strided_view(
                new["bufferView"], new.get("byteOffset", 0), sparse["count"], width, dtype, None
            )
        if entry.get("normalized") and dtype.kind in "iu":
            top = 2 ** (8 * dtype.itemsize - (dtype.kind == "i")) - 1
            values = np.maximum(values.astype(np.float32) / top, -1.0)
        if not np.isfinite(values).all():
            raise CharacterError(
                f"{self.path}: accessor {index} holds numbers that are not finite; export it again"
            )
        return values

    def _strided_view(
        self,
        view: int,
        offset: int,
        count: int,
        width: int,
        dtype: np.dtype[Any],
        stride: int | None,
    ) -> Array:
        data = self._view(view)
        step = stride or width * dtype.itemsize
        if offset + (count - 1) * step + width * dtype.itemsize > len(data):
            raise CharacterError(
                f"{self.path}: an array reaches past the end of its data; export it again"
            )
        rows = np.ndarray((count, width), dtype, data, offset, (step, dtype.itemsize))
        return np.array(rows)

    def image(self, texture: int) -> npt.NDArray[np.uint8]:
        """Return the pixels (h, w, 3 or 4) of a texture."""
        entry = self.tree["textures"][texture]
        webp = entry.get("extensions", {}).get("EXT_texture_webp")
        image = self.tree["images"][webp["source"] if webp else entry["source"]]
        if "bufferView" not in image:
            raise CharacterError(
                f"{self.path}: its textures lie in other files; export it as one .glb"
            )
        try:
            data = io.BytesIO(self._view(image["bufferView"]))
            with Image.open(data, formats=TEXTURES) as picture:
                kind = "RGBA" if "A" in picture.getbands() else "RGB"
                return np.asarray(picture.convert(kind))
        except (OSError, Image.DecompressionBombError) as e:  # no image, cut short, too large
            raise CharacterError(
                f"{self.path}: a texture cannot be read ({e}); export again"
            ) from e


def _octahedral(data: bytes, stride: int) -> bytes:
    """Undo the octahedral filter of normals with 8 or 16 bits."""
    dtype, top = (np.dtype(np.int8), 127) if stride == 4 else (np.dtype(np.int16), 32767)
    values = np.frombuffer(data, dtype=dtype).reshape(-1, 4)
    x, y = values[:, 0].astype(np.float64), values[:, 1].astype(np.float64)
    one = values[:, 2].astype(np.float64)
    z = one - np.abs(x) - np.abs(y)
    fold = np.minimum(z, 0)
    x, y = x + np.where(x >= 0, fold, -fold), y + np.where(y >= 0, fold, -fold)
    length = np.sqrt(x * x + y * y + z * z)
    scale = top / np.where(length == 0, 1, length)
    out = values.copy()
    for k, part in enumerate((x, y, z)):
        out[:, k] = np.round(part * scale).astype(dtype)
    return out.tobytes()


MAX_BYTES = 2 * 1024**3


def read_glb(path: Path) -> GltfFile:
    """Read a .glb file.

    Raises:
        CharacterError: it is not a complete glTF binary, or needs an extension that is not read.
    """
    try:
        data = read_plain(path, max_bytes=MAX_BYTES)
    except OSError as e:
        raise CharacterError(f"{path}: cannot be read ({e.strerror}); check the path") from e
    if len(data) < 20 or data[:4] != b"glTF":
        raise CharacterError(f"{path}: not a glTF binary; export it as .glb")
    version, total = struct.unpack("<II", data[4:12])
    if version != 2 or total > len(data):
        raise CharacterError(
            f"{path}: glTF version {version}, {len(data)} of {total} bytes; "
            "copy it again, or export it as glTF 2.0"
        )
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= total:
        length, kind = struct.unpack("<I4s", data[at : at + 8])
        chunks.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    try:
        tree = parse_json(chunks[b"JSON"])
    except (KeyError, ValueError) as e:
        raise CharacterError(f"{path}: its description is broken ({e}); export it again") from e
    if not isinstance(tree, dict):
        raise CharacterError(f"{path}: its description is not glTF; export it again")
    unknown_extensions = sorted(set(tree.get("extensionsRequired", [])) - _KNOWN)
    if unknown_extensions:
        raise CharacterError(
            f"{path}: needs {', '.join(unknown_extensions)}, which is not read; export without it"
        )
    return GltfFile(path, tree, chunks.get(b"BIN\0", b""))

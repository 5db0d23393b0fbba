"""A small room as glTF binary that tests write themselves: boxes with names and colours."""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) / 2
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
TRIANGLES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))], np.uint16)


@dataclass(frozen=True)
class Box:
    """A box: its name ("" for none), middle and size in metres, and linear colour."""

    name: str
    at_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    colour: tuple[float, float, float] = (0.5, 0.5, 0.5)


ROOM = (
    Box("floor", (0, -0.05, 0), (6, 0.1, 8), (0.3, 0.25, 0.2)),
    Box("", (0, 1.5, -4), (6, 3, 0.1), (0.6, 0.6, 0.6)),
    Box("Red lamp.001", (-0.4, 1.25, -2), (0.5, 0.5, 0.5), (0.8, 0.02, 0.02)),
    Box("cupboard", (0.45, 1.2, -2.2), (0.6, 0.8, 0.4), (0.02, 0.05, 0.8)),
    Box("behind", (0.45, 1.2, -3), (0.3, 0.3, 0.3), (0.1, 0.8, 0.1)),
)
"""The lamp is on the left, the cupboard on the right hides `behind`, the back wall has no name."""


def write_room(path: Path, boxes: Sequence[Box] = ROOM, *, nodes: bool = True) -> Path:
    """Write boxes as a room; without `nodes` none of its meshes is placed anywhere."""
    data = CORNERS.tobytes() + TRIANGLES.tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": CORNERS.nbytes},
            {"buffer": 0, "byteOffset": CORNERS.nbytes, "byteLength": TRIANGLES.nbytes},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": TRIANGLES.size, "type": "SCALAR"},
        ],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorFactor": [*b.colour, 1], "metallicFactor": 0},
                "doubleSided": True,
            }
            for b in boxes
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": i}]}
            for i in range(len(boxes))
        ],
        "nodes": [
            {"mesh": i, "translation": b.at_m, "scale": b.size_m}
            | ({"name": b.name} if b.name else {})
            for i, b in enumerate(boxes)
        ]
        if nodes
        else [{"name": "camera"}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    total = 12 + 8 + len(text) + 8 + len(data)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, total)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(data), b"BIN\0")
        + data
    )
    return path

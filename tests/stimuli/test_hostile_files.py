"""What a stranger may send as picture, areas, motion or annotation is refused soon and plainly.

Tests of files that took minutes have no clock: whoever takes them up again fails by its cost.
"""

import json
import os
import struct
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.stimuli.glb_figure import write_glb
from visavis.lab.errors import DesignError
from visavis.stimuli.area_files import MAX_CORNERS, read_areas
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.flat_pixels import read_picture
from visavis.stimuli.motion.bvh import parse_bvh, read_bvh
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.annotations import _parsed

SIDE_PX = 20_000


def png_that_claims(side_px: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", side_px, side_px, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


def test_a_picture_that_claims_more_pixels_than_memory_is_refused(tmp_path: Path) -> None:
    (tmp_path / "b.png").write_bytes(png_that_claims(SIDE_PX))
    with pytest.raises(DesignError, match="too many pixels"):
        read_picture(tmp_path / "b.png")


def test_a_picture_begins_no_program(tmp_path: Path) -> None:
    (tmp_path / "e.png").write_bytes(
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\nshowpage\n%%EOF\n"
    )
    with pytest.raises(DesignError, match="no picture that can be read"):
        read_picture(tmp_path / "e.png")


def test_a_texture_that_claims_more_pixels_than_memory_is_refused(tmp_path: Path) -> None:
    path, png = tmp_path / "g.glb", png_that_claims(SIDE_PX)
    png += b"\0" * (-len(png) % 4)
    write_glb(path)
    data = path.read_bytes()
    (length,) = struct.unpack("<I", data[12:16])
    tree, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(png)})
    tree["images"] = [{"bufferView": len(tree["bufferViews"]) - 1, "mimeType": "image/png"}]
    tree["textures"] = [{"source": 0}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    for mesh in tree["meshes"]:
        for part in mesh["primitives"]:
            part["material"] = 0
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary) + len(png), b"BIN\0") + binary + png
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    with pytest.raises(CharacterError, match="texture cannot be read"):
        import_gltf(path, gender="male")


def test_a_photograph_in_place_of_painted_areas_is_refused_within_its_own_memory(
    tmp_path: Path,
) -> None:
    colours = np.arange(1, 10_001, dtype=np.uint32) * 97
    rgb = np.stack([colours >> 16, colours >> 8 & 255, colours & 255], axis=-1).astype(np.uint8)
    Image.fromarray(rgb.reshape(100, 100, 3)).save(tmp_path / "a.png")
    tracemalloc.start()
    try:
        with pytest.raises(DesignError, match="names no area"):
            read_areas(tmp_path / "a.png", (100, 100))
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()


def test_groups_that_move_nothing_cost_no_more_than_reading_them(tmp_path: Path) -> None:
    groups = '<g transform="scale(2)"/>' * 20_000
    areas = "".join(f'<rect id="a{i}" width="5" height="5"/>' for i in range(1_000))
    path = tmp_path / "a.svg"
    path.write_text(f'<svg viewBox="0 0 100 100">{groups}{areas}</svg>')
    assert 1_000 == len(read_areas(path, (100, 100)))


def test_areas_within_anything_that_is_moved_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    rect = '<rect id="a" width="5" height="5"/>'
    path.write_text(f'<svg viewBox="0 0 9 9"><g transform="scale(2)"><a>{rect}</a></g></svg>')
    with pytest.raises(DesignError, match="moved by a transform"):
        read_areas(path, (9, 9))


def test_an_outline_with_more_corners_than_anybody_draws_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"a,{i % 100},{i // 100 % 100}\n" for i in range(MAX_CORNERS + 1))
    (tmp_path / "a.csv").write_text(f"area,x,y\n{rows}")
    with pytest.raises(DesignError, match="corners"):
        read_areas(tmp_path / "a.csv", (100, 100))


def test_a_motion_whose_joints_stand_in_one_line_costs_no_more_than_in_many() -> None:
    n = 20_000
    joints = " ".join(f"JOINT j{i} {{ OFFSET 0 0 0 CHANNELS 0" for i in range(n))
    head = "HIERARCHY ROOT r { OFFSET 0 0 0 CHANNELS 1 Xposition"
    text = f"{head} {joints} {'}' * (n + 1)}\nMOTION\nFrames: 1\nFrame Time: 0.1\n0\n"
    assert n + 1 == len(parse_bvh(text).joints)


def test_a_pipe_in_place_of_a_motion_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "walk.bvh")
    with pytest.raises(MotionError, match="not a regular file"):
        read_bvh(tmp_path / "walk.bvh")


def test_attributes_that_a_document_type_repeats_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.eaf"
    path.write_text(f'<!DOCTYPE r [<!ATTLIST a b CDATA "{"x" * 100}">]><r><a/><a/></r>')
    with pytest.raises(MotionError, match="remove its DOCTYPE"):
        _parsed(path)


def test_a_long_text_costs_no_more_than_reading_it(tmp_path: Path) -> None:
    path, text = tmp_path / "a.eaf", "x" * 60 + "\n"
    path.write_text(f"<r>{text * 600_000}</r>")
    assert 600_000 * len(text) == len(_parsed(path).text)


def test_a_corner_beyond_every_number_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"a: {{ellipse: [{'9' * 400}, 3, 2, 2]}}\n")
    with pytest.raises(DesignError, match="ellipse"):
        read_areas(tmp_path / "a.yaml", (8, 6))


def test_an_annotation_in_an_encoding_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.eaf").write_text('<?xml version="1.0" encoding="UDF-8"?><r/>')
    with pytest.raises(MotionError, match="UDF-8"):
        _parsed(tmp_path / "a.eaf")

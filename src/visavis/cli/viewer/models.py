"""People and rooms as a page draws them: light meshes, small pictures, light of the lamps."""

import hashlib
import io
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.cli.viewer.bundle import Bundle
from visavis.stage.card.lamps import lamp_axis, lamp_place
from visavis.stage.card.vertices import PersonVertices, Run, person_vertices, room_vertices
from visavis.stage.levels import BODY_RADIUS_M
from visavis.stage.processor.baked_room import baked_room
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.picture import Light, Prop, Room

LEVEL_OF_FEW, LEVEL_OF_MANY = 1, 2
CELL_OF_FEW_M, CELL_OF_MANY_M = 0.0, 0.05
"""Vertices of a light mesh within so much are one."""
MAX_FEW: Final = 24
"""More people than these are drawn at their lightest."""
SIDE_PX: Final = {"skin": 512, "hair": 256, "thing": 512, "flat": 512, "around": 1024}
OTHER_SIDE_PX: Final = 128
WEBP_QUALITY: Final = 80
FILM_BYTES: Final = 30_000_000
"""Of a page's arrays, before which pictures of films are in it; later ones are files beside it."""
PIECE_BYTES: Final = 4_000_000
"""Of the pictures of films in one such file; a browser holds the last few that it asked for."""


class Models:
    """Everything that is drawn, each thing once; numbers are places in the page's lists."""

    def __init__(
        self, bundle: Bundle, *, level: int, beside: Callable[[str, str], str] | None = None
    ) -> None:
        """With `beside`, which `page_content` describes, long films are beside the page."""
        self._bundle, self.level = bundle, level
        self._beside, self._piece = beside, Bundle()
        self.pieces: list[str] = []
        """Where the page loads files of films from."""
        self._cell_m = CELL_OF_FEW_M if level == LEVEL_OF_FEW else CELL_OF_MANY_M
        self.people: list[dict[str, Any]] = []
        self.rooms: list[dict[str, Any]] = []
        self.textures: list[dict[str, Any]] = []
        self._numbers: dict[int | bytes, int] = {}
        self._files: dict[bytes, dict[str, Any]] = {}
        self._kept_alive: list[object] = []

    def person(self, character: Character) -> int:
        """Return the number of a character."""
        return self._number(character, self.people, lambda: self._person(character))

    def room(self, room: Room) -> int:
        """Return the number of a room."""
        return self._number(room, self.rooms, lambda: self._room(room))

    def thing(self, prop: Prop) -> dict[str, Any]:
        """Return a thing that moves, lit by the page."""
        mesh = prop.mesh
        texture = prop.material.texture_srgb if mesh.uv is not None else None
        uv = np.zeros((len(mesh.vertices_m), 2)) if mesh.uv is None else mesh.uv
        return {
            "uv": self._bundle.add_quantised(uv),
            "picture": -1 if texture is None else self._texture(texture, "thing"),
            "place": self._bundle.add_quantised(mesh.vertices_m),
            "normal": self._bundle.add(_bytes_of(mesh.normals)),
            "colour": self._bundle.add(mesh.colour_srgb),
            "index": self._bundle.add(mesh.triangles.ravel().astype(np.uint32)),
        }

    def flat(self, pixels: npt.NDArray[np.uint8], kind: str = "flat") -> int:
        """Return the number of the small picture of a flat stimulus, or of one all "around"; what
        looks alike has one.
        """
        content = hashlib.sha256(repr(pixels.shape).encode() + pixels.tobytes()).digest()
        if content not in self._numbers:
            self.textures.append({**self._pack_texture(pixels, kind), "flat": True})
            self._numbers[content] = len(self.textures) - 1
        return self._numbers[content]

    def picture_file(self, content: bytes) -> dict[str, Any]:
        """Take in the file of a picture of a film, the same once; return where it lies."""
        key = hashlib.sha256(content).digest()
        if key not in self._files:
            if self._beside is None or self._bundle.size < FILM_BYTES:
                self._files[key] = self._bundle.add_bytes(content)
            else:
                self._files[key] = {**self._piece.add_bytes(content), "in": len(self.pieces)}
                if self._piece.size >= PIECE_BYTES:
                    self.write_piece()
        return self._files[key]

    def write_piece(self) -> None:
        """Write what was taken in of films and is in no file yet."""
        if self._beside is not None and self._piece.size:
            self.pieces.append(self._beside("film", self._piece.text({})))
            self._piece = Bundle()

    def _number(self, thing: object, into: list[dict[str, Any]], make: Any) -> int:
        if id(thing) not in self._numbers:
            self._kept_alive.append(thing)  # keeps its id from being reused
            into.append(make())
            self._numbers[id(thing)] = len(into) - 1
        return self._numbers[id(thing)]

    def _person(self, character: Character) -> dict[str, Any]:
        level = min(self.level, len(character.levels) - 1)
        mesh = person_vertices(character, character.levels[level])
        vertices, add = mesh.vertices, self._bundle.add
        skeleton = character.skeleton
        model = {
            "name": character.name,
            "place": self._bundle.add_quantised(vertices["rest_m"]),
            "detail": self._bundle.add_quantised(vertices["detail"]),
            "normal": add(_bytes_of(vertices["normal"][:, :3])),
            "colour": add(vertices["colour"][:, :3]),
            "surface": add(vertices["surface"]),
            "joints": add(vertices["joints"]),
            "weights": add(np.rint(255 * vertices["weights"].astype(np.float32)).astype(np.uint8)),
            "morph": add(vertices["morph"].astype(np.int16)),
            "deltas": self._bundle.add_quantised(_deltas_of(mesh)),
            "index": add(mesh.indices.astype(np.uint16 if len(vertices) < 65536 else np.uint32)),
            "runs": [self._run(run) for run in mesh.runs],
            "parents": [int(p) for p in skeleton.parents],
            "offsets": self._bundle.add(skeleton.offsets_m.astype(np.float32)),
            "rest": self._bundle.add(skeleton.rest_m.astype(np.float32)),
            "reach": BODY_RADIUS_M,
            "light": self._light(character),
        }
        return model

    def _light(self, character: Character) -> dict[str, Any]:
        """Return the mesh drawn while time moves where a processor draws: coloured vertices of few
        triangles, those with two sides after the others, eyes last.
        """
        add, add_quantised = self._bundle.add, self._bundle.add_quantised
        mesh = person_vertices(character, character.levels[-1])
        vertices, colour = mesh.vertices, mesh.vertices["colour"][:, :3].copy()
        for run in mesh.runs:
            if run.texture is not None:
                rows = np.unique(mesh.indices[run.first : run.first + run.count])
                texels = _at_uv(run.texture, vertices["detail"][rows, :2].astype(np.float64))
                colour[rows] = np.rint(colour[rows] * (texels / 255.0))

        def corners(of: Callable[[Run], bool]) -> npt.NDArray[Any]:
            own = [mesh.indices[r.first : r.first + r.count] for r in mesh.runs if of(r)]
            return np.concatenate([*own, np.zeros(0, mesh.indices.dtype)])

        closed_index, kept_closed = _cluster(
            vertices, corners(lambda r: r.kind != "eye" and not r.double_sided), self._cell_m
        )
        open_, kept_open = _cluster(
            vertices, corners(lambda r: r.kind != "eye" and r.double_sided), self._cell_m
        )
        index, eyes = np.concatenate([closed_index, open_]), corners(lambda r: r.kind == "eye")
        kept_vertices = np.unique(np.concatenate([kept_closed, kept_open, eyes]))
        number = np.zeros(len(vertices), np.int64)
        number[kept_vertices] = np.arange(len(kept_vertices))
        vertices, colour = vertices[kept_vertices], colour[kept_vertices]
        return {
            "place": add_quantised(vertices["rest_m"]),
            "detail": add_quantised(vertices["detail"]),
            "normal": add(_bytes_of(vertices["normal"][:, :3])),
            "colour": add(colour),
            "surface": add(vertices["surface"]),
            "joints": add(vertices["joints"]),
            "weights": add(np.rint(255 * vertices["weights"].astype(np.float32)).astype(np.uint8)),
            "morph": add(vertices["morph"].astype(np.int16)),
            "deltas": add_quantised(_deltas_of(mesh)),
            "index": add(number[np.concatenate([index, eyes])].astype(np.uint16)),
            "openFrom": len(closed_index),
            "eyeFrom": len(index),
        }

    def _run(self, run: Run) -> list[Any]:
        texture = -1 if run.texture is None else self._texture(run.texture, run.kind)
        return [run.first, run.count, texture, int(run.double_sided), run.kind]

    def _texture(self, texture: npt.NDArray[np.uint8], kind: str) -> int:
        return self._number(texture, self.textures, lambda: self._pack_texture(texture, kind))

    def _pack_texture(self, texture: npt.NDArray[np.uint8], kind: str) -> dict[str, Any]:
        side = SIDE_PX.get(kind, OTHER_SIDE_PX)
        image = Image.fromarray(texture)
        if max(image.size) > side:
            share = side / max(image.size)
            image = image.resize(tuple(max(1, round(s * share)) for s in image.size))  # type: ignore[arg-type]
        content = webp(image, quality=WEBP_QUALITY)
        if kind in ("flat", "around"):  # letters and shapes are smaller without a loss
            content = min(webp(image, lossless=True), content, key=len)
        holes = texture.shape[2] == 4 and bool((texture[..., 3] < 128).any())
        return {"file": self._bundle.add_bytes(content), "holes": holes}

    def _room(self, room: Room) -> dict[str, Any]:
        lit_room = baked_room(room_vertices(room.props), room)
        vertices, add = lit_room.vertices.vertices, self._bundle.add
        return {
            "name": room.name,
            "place": self._bundle.add_quantised(vertices["place_m"]),
            "uv": self._bundle.add_quantised(vertices["uv"]),
            "light": add(np.rint(127 * np.clip(lit_room.light, 0, 2)).astype(np.uint8)),
            "index": add(lit_room.vertices.indices.astype(np.uint32)),
            "runs": [self._run(run) for run in lit_room.vertices.runs],
            "things": [_box(prop) for prop in room.props],
            "lamps": [_lamp(light) for light in room.lights],
            "sky": room.sky.tolist(),
            "ground": room.ground.tolist(),
            "background": list(room.background_srgb),
        }


def webp(image: Image.Image, method: int = 4, **how: Any) -> bytes:
    """Return a picture as a file of the kind that pages hold."""
    content = io.BytesIO()
    image.save(content, "WEBP", method=method, **how)
    return content.getvalue()


def _box(prop: Prop) -> list[Any]:
    """Return a thing's name, and lowest and highest x, y, z in metres of the box round it."""
    low, high = prop.mesh.vertices_m.min(axis=0), prop.mesh.vertices_m.max(axis=0)
    return [prop.name, *([round(float(v), 3) for v in corner] for corner in (low, high))]


def _lamp(light: Light) -> dict[str, Any]:
    return {
        "kind": ("sun", "spot", "point").index(light.kind),
        "place": [float(x) for x in lamp_place(light)],
        "axis": [float(x) for x in lamp_axis(light)],
        "cos": float(np.cos(np.radians(light.half_angle_deg))),
        "colour": [float(x) for x in light.intensity],
    }


def _bytes_of(normals: npt.NDArray[Any]) -> npt.NDArray[np.int8]:
    signed_bytes: npt.NDArray[np.int8] = np.rint(127 * normals.astype(np.float32)).astype(np.int8)
    return signed_bytes


def _at_uv(texture: npt.NDArray[np.uint8], uv: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """Return a picture's colours (n, 3) at places (n, 2), whose v begins at the picture's top."""
    height, width = texture.shape[:2]
    x = np.clip(np.floor(uv[:, 0] % 1.0 * width), 0, width - 1).astype(np.int64)
    y = np.clip(np.floor(uv[:, 1] % 1.0 * height), 0, height - 1).astype(np.int64)
    colours: npt.NDArray[np.uint8] = texture[y, x, :3]
    return colours


def _cluster(
    vertices: npt.NDArray[Any], index: npt.NDArray[Any], cell_m: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return corners (3 m,) of the triangles that stay when near vertices are one, and vertices
    that they use.
    """
    corners = index.astype(np.int64)
    if cell_m > 0:
        cells = np.floor(vertices["rest_m"].astype(np.float64) / cell_m).astype(np.int64)
        keys = np.column_stack([cells, vertices["joints"][:, 0], vertices["surface"][:, 0]])
        _, first, of = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        corners = first[of.ravel()][corners]
        triangles = corners.reshape(-1, 3)
        a, b, c = triangles.T
        whole = (a != b) & (b != c) & (a != c)
        corners = np.unique(triangles[whole], axis=0).ravel()
    return corners, np.unique(corners)


def _deltas_of(mesh: PersonVertices) -> npt.NDArray[np.float32]:
    """Return displacements by the shapes of the face, three numbers a shape in a row."""
    deltas: npt.NDArray[np.float32] = mesh.deltas[:, : len(MORPHS), :3]
    return deltas.reshape(len(deltas), -1)

"""Draw the room of `examples/around.py` as a panorama: `python -m tools.panorama_room [FOLDER]`.

A box of 7 by 5 by 3 metres, seen from a point in it; what hangs on its walls is painted in metres
of the wall. The areas of interest come with it, in degrees.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

FOLDER: Final = Path(__file__).parents[1] / "src" / "visavis" / "running" / "ready" / "room"
SIZE_PX: Final = (4096, 2048)
HALF_M: Final = np.array([3.5, 1.5, 2.5])
"""Half of the room's width (x), height (y) and depth (z); the eyes are in its middle."""
PX_PER_M: Final = 400
COLOURS: Final = 48
WALLS: Final[Mapping[str, tuple[int, int, str]]] = {
    "north": (2, -1, "#d9d2c3"),
    "south": (2, 1, "#d9d2c3"),
    "east": (0, 1, "#cfc8b8"),
    "west": (0, -1, "#cfc8b8"),
    "floor": (1, -1, "#8a6a48"),
    "ceiling": (1, 1, "#eeebe4"),
}
"""The axis each wall is across, on which side, and its colour."""


@dataclass(frozen=True)
class Thing:
    """What hangs on a wall: its middle along the wall to the right and above eye level, its width
    and height, all in metres, and its colours from the outside to the inside.
    """

    wall: str
    right_m: float
    up_m: float
    wide_m: float
    high_m: float
    colours: tuple[str, ...]


THINGS: Final[Mapping[str, Thing]] = {
    "painting": Thing("north", 0.0, 0.1, 1.2, 0.9, ("#5b3a1e", "#b3282d", "#f0c419", "#1d4f91")),
    "window": Thing("east", 0.2, 0.2, 1.4, 1.2, ("#ffffff", "#9fd0ee")),
    "door": Thing("south", -1.6, -0.45, 0.9, 2.1, ("#6b4a2b", "#7d5935")),
    "shelf": Thing("west", -0.3, -0.3, 1.6, 1.6, ("#4a3520", "#37618e", "#8e3b46", "#5f8a4c")),
}


def wall_image(name: str) -> npt.NDArray[np.uint8]:
    """Return a wall as it is painted, top row first, seen from within."""
    axis, _, colour = WALLS[name]
    wide_m = 2 * HALF_M[0 if axis == 2 else 2] if axis != 1 else 2 * HALF_M[0]
    high_m = 2 * HALF_M[1] if axis != 1 else 2 * HALF_M[2]
    image = Image.new("RGB", (round(wide_m * PX_PER_M), round(high_m * PX_PER_M)), colour)
    draw = ImageDraw.Draw(image)
    if name == "floor":
        for board in range(0, image.width, PX_PER_M // 4):
            draw.line((board, 0, board, image.height), "#6f5438", 6)
    elif axis != 1:
        draw.rectangle((0, image.height - 40, image.width, image.height), "#a89e8a")
    for thing in THINGS.values():
        if thing.wall != name:
            continue
        x = image.width / 2 + thing.right_m * PX_PER_M
        y = image.height / 2 - thing.up_m * PX_PER_M
        half = np.array([thing.wide_m, thing.high_m]) * PX_PER_M / 2
        for layer, fill in enumerate(thing.colours):
            w, h = (half - 0.12 * layer * half.min()).tolist()
            draw.rectangle((x - w, y - h, x + w, y + h), fill)
    return np.asarray(image)


def to_right_of(wall: str, right_m: float, up_m: float) -> tuple[float, float]:
    """Return the direction of a point of a wall: degrees to the right of north, and upwards."""
    far_m = HALF_M[WALLS[wall][0]]
    straight_deg = {"north": 0.0, "east": 90.0, "south": 180.0, "west": 270.0}[wall]
    yaw_deg = straight_deg + np.degrees(np.arctan2(right_m, far_m))
    return float(yaw_deg), float(np.degrees(np.arctan2(up_m, np.hypot(right_m, far_m))))


def panorama(size_px: tuple[int, int] = SIZE_PX) -> Image.Image:
    """Return the room all around, with north in the middle."""
    wide, high = size_px
    yaw = ((np.arange(wide) + 0.5) / wide - 0.5) * 2 * np.pi
    pitch = (0.5 - (np.arange(high) + 0.5) / high)[:, None] * np.pi
    x, y, z = np.sin(yaw) * np.cos(pitch), np.sin(pitch), -np.cos(yaw) * np.cos(pitch)
    ray = np.stack([x, np.broadcast_to(y, x.shape), z], axis=-1)
    reach = HALF_M / np.maximum(np.abs(ray), 1e-9)
    across, hit_m = reach.argmin(axis=-1), ray * reach.min(axis=-1)[..., None]
    out = np.zeros((high, wide, 3), np.uint8)
    for name, (axis, side, _) in WALLS.items():
        here = (across == axis) & (np.sign(ray[..., axis]) == side)
        right_m, up_m = _on_wall(name, hit_m[here])
        wall = wall_image(name)
        column = np.clip(wall.shape[1] / 2 + right_m * PX_PER_M, 0, wall.shape[1] - 1)
        row = np.clip(wall.shape[0] / 2 - up_m * PX_PER_M, 0, wall.shape[0] - 1)
        out[here] = wall[row.astype(int), column.astype(int)]
    return Image.fromarray(out)


def _on_wall(name: str, hit_m: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], ...]:
    """Return places (n,) of a wall, to the right and upwards as seen from within."""
    x, y, z = hit_m.T
    return {
        "north": (x, y),
        "south": (-x, y),
        "east": (z, y),
        "west": (-z, y),
        "floor": (x, z),
        "ceiling": (x, -z),
    }[name]


def areas_text() -> str:
    """Return the outlines of all things in degrees, as YAML."""
    lines = ["# degrees to the right of the picture's middle, and upwards"]
    for name, thing in THINGS.items():
        steps = np.linspace(-1, 1, 5)
        edge = [(s, 1.0) for s in steps] + [(-s, -1.0) for s in steps]
        corners = [
            to_right_of(
                thing.wall,
                thing.right_m + a * thing.wide_m / 2,
                thing.up_m + b * thing.high_m / 2,
            )
            for a, b in edge
        ]
        text = ", ".join(f"[{yaw:.1f}, {pitch:.1f}]" for yaw, pitch in corners)
        lines.append(f"{name}: {{polygon: [{text}]}}")
    return "\n".join(lines) + "\n"


def main(folder: Path) -> None:
    """Write the picture and its areas."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = panorama((2 * SIZE_PX[0], 2 * SIZE_PX[1])).resize(SIZE_PX, Image.Resampling.BOX)
    drawn.quantize(COLOURS, dither=Image.Dither.NONE).save(folder / "room.png", optimize=True)
    (folder / "room.yaml").write_text(areas_text(), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)

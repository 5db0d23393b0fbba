"""Pictures of a preview: from where they look, what is written on them, sheets of them."""

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.lab.config import Screen
from visavis.lab.errors import UsageError
from visavis.lab.geometry import (
    Pose,
    Vector,
    quat_from_yaw_pitch_deg,
    rotate,
    unit,
    yaw_pitch_deg_of,
)
from visavis.stimuli.picture import Camera, Panel, Picture
from visavis.stimuli.text_font import font_for

EYES_TANGENT = 0.84
"""Half of 80° from top to bottom, for a picture seen on a screen."""
AROUND_TANGENT = 0.45
FACE_TANGENT = 0.17
FACE_AWAY_M = 1.1
"""Conversation distance, from which close-ups are taken."""
ORBIT_START_DEG = 40.0
ORBIT_DEG_PER_S = 12.0
SIMULATED = "simulated"
"""The word on every picture."""
TITLE_PX = 40
TITLE_LEFT_PX = 10
CUT_AT_M = 2.75
"""Height above which a view from above shows nothing."""


class Viewpoint(StrEnum):
    """From where a preview looks."""

    EYES = "eyes"
    ABOVE = "above"
    ORBIT = "orbit"


def camera_of(
    view: Viewpoint, picture: Picture, head: Pose, aspect: float, *, passed_s: float
) -> Camera:
    """Return the camera of a viewpoint; those from outside hold the people and the head, and cut
    away the ceiling or the walls that stand before them.
    """
    if view is Viewpoint.EYES:
        return symmetric_camera(head, EYES_TANGENT, aspect)
    points = np.concatenate([picture.people.root_m, head.position_m[None]])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    middle[1] = 1.0
    radius = max(1.6, float(np.linalg.norm((points - middle)[:, [0, 2]], axis=1).max()) + 0.5)
    if view is Viewpoint.ABOVE:
        height = radius / AROUND_TANGENT
        towards = np.array([0.0, -height, -0.02])
        camera = symmetric_camera(looking(middle - towards, towards), AROUND_TANGENT, aspect)
        return replace(camera, near_m=max(camera.near_m, height + middle[1] - CUT_AT_M))
    back = min(radius / AROUND_TANGENT, 3.4 + radius)
    angle = np.radians(ORBIT_START_DEG + ORBIT_DEG_PER_S * passed_s)
    place = middle + np.array([np.sin(angle) * back, 1.4 + 0.12 * back, np.cos(angle) * back])
    camera = symmetric_camera(looking(place, middle - place), AROUND_TANGENT, aspect)
    return replace(camera, near_m=max(camera.near_m, back - radius - 0.7))


def face_camera(
    eyes_m: Vector, yaw_deg: float, aspect: float, away_m: float = FACE_AWAY_M
) -> Camera:
    """Return a camera, at conversation distance, before a face whose eyes' middle is given."""
    angle = np.radians(yaw_deg)
    place = eyes_m + away_m * np.array([np.sin(angle), 0.04, np.cos(angle)])
    aim = eyes_m + np.array([0.0, 0.01, 0.0])  # with all of a tall head of hair
    return symmetric_camera(looking(place, aim - place), FACE_TANGENT, aspect)


def simulated_panel(camera: Camera) -> Panel:
    """Return the word that marks a moving picture as simulated, before its lower left corner."""
    away = 1.0
    size = (0.16 * (camera.top - camera.bottom), 0.04 * (camera.top - camera.bottom))
    corner = (camera.left + 0.6 * size[0], camera.bottom + size[1], -away)
    place = camera.pose.position_m + rotate(camera.pose.orientation_wxyz, np.array(corner))
    return Panel(SIMULATED, (), Pose(place, camera.pose.orientation_wxyz), size)


def add_label(image: npt.NDArray[np.uint8], text: str) -> Image.Image:
    """Return a picture with a line of text along its lower edge."""
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture, "RGBA")
    size_px = max(11, picture.height // 44)
    while True:
        font = font_for(text, size_px)
        _, top, right, bottom = draw.textbbox((0, 0), text, font=font)
        if right + 16 <= picture.width or size_px <= 7:
            break
        size_px -= 1
    y = picture.height - (bottom - top) - 12
    draw.rectangle((0, y - 4, right + 16, picture.height), fill=(0, 0, 0, 140))
    draw.text((8, y - top + 2), text, fill=(255, 255, 255), font=font)
    return picture


def write_below(image: npt.NDArray[np.uint8], text: str) -> Image.Image:
    """Return a picture with a line of text below it; none of its pixels is changed."""
    height, width = image.shape[:2]
    picture = Image.new("RGB", (width, height + TITLE_PX), (250, 250, 250))
    picture.paste(Image.fromarray(image), (0, 0))
    ImageDraw.Draw(picture).text((10, height + 9), text, (20, 20, 20), font_for(text, 20))
    return picture


def contact_sheet(tiles: Sequence[Image.Image], title: str, columns: int) -> Image.Image:
    """Return pictures of one size in rows below a title, all of which can be read."""
    width, height = tiles[0].size
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    font = font_for(title, 20)
    sheet_px = max(columns * width, round(font.getlength(title)) + 2 * TITLE_LEFT_PX)
    sheet = Image.new("RGB", (sheet_px, rows * height + TITLE_PX), (250, 250, 250))
    ImageDraw.Draw(sheet).text((TITLE_LEFT_PX, 9), title, (20, 20, 20), font)
    for k, tile in enumerate(tiles):
        sheet.paste(tile, ((k % columns) * width, TITLE_PX + (k // columns) * height))
    return sheet


def looking(place: Vector, towards: Vector) -> Pose:
    """Return a level pose at a place that looks along a direction."""
    yaw_deg, pitch_deg = yaw_pitch_deg_of(unit(towards))
    return Pose(place, quat_from_yaw_pitch_deg(float(yaw_deg), float(pitch_deg)))


def camera_through(screen: Screen, head: Pose, aspect: float) -> Camera:
    """Return the camera that sees what a monitor shows to eyes at `head`, facing it: all of its lit
    area, and beyond it where the picture has other proportions.
    """
    half_height_m = max(screen.height_m / 2, screen.width_m / 2 / aspect)
    half_width_m = half_height_m * aspect
    right_m, up_m = screen.center_right_m, screen.center_up_m
    return Camera(
        head,
        left=(right_m - half_width_m) / screen.distance_m,
        right=(right_m + half_width_m) / screen.distance_m,
        bottom=(up_m - half_height_m) / screen.distance_m,
        top=(up_m + half_height_m) / screen.distance_m,
    )


def symmetric_camera(pose: Pose, top: float, aspect: float) -> Camera:
    """Return a camera whose picture reaches from `−top` to `top`, as tangents."""
    return Camera(pose, -top * aspect, top * aspect, -top, top)


def check_picture_name(path: Path) -> None:
    """Refuse a picture whose kind cannot be written, before anything is drawn.

    Raises:
        UsageError: the name ends neither in .png nor in .jpg.
    """
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise UsageError(f"{path}: pictures are written as .png or .jpg; give it such a name")

"""Flat stimuli as a picture: where each stands in the world, and its pixels.

On a screen a stimulus lies in the screen's plane and on whole pixels, so that its pixels are the
screen's own. In a headset it stands upright at a distance, facing the head as it was at the onset.
A panorama is all around: behind the screen as through a window, in a headset around the head.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, quat_multiply, rotate
from visavis.lab.luminance import LuminanceTable
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stimuli.area_files import read_areas
from visavis.stimuli.areas import Area, PictureAreas, PlacedAreas, SurroundingAreas
from visavis.stimuli.dots import step_at
from visavis.stimuli.dressing.picture_of import NOBODY
from visavis.stimuli.film_file import FilmFacts, FilmReader, facts_of
from visavis.stimuli.flat import Dots, Flat, Image, Text, Video, is_round, picture_path
from visavis.stimuli.flat_pixels import (
    moving_pixels,
    picture_size,
    pixels_of,
    shown_rgb,
    text_size_em,
)
from visavis.stimuli.gaze_window import NO_WINDOW, Veil
from visavis.stimuli.panels import board_pose
from visavis.stimuli.panorama_pixels import eye_size_px, panorama_pixels
from visavis.stimuli.picture import Picture, Room, Sheet, Surround
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import FlatScene

DISTANCE_M: Final = 2.0
"""Distance of stimuli from the head in a headset."""
PX_PER_DEG: Final = 40.0
"""Pixels of a sheet in a headset; more than any headset has."""
FAR_M: Final = 1000.0
"""Distance at which both eyes look at one place of a panorama."""
MAX_PX: Final = 4096
AT_REST: Final = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


def picture_of_flat(frame: SceneFrame) -> Picture:
    """Return the picture of a frame of flat stimuli."""
    scene = frame.scene
    assert isinstance(scene, FlatScene)  # noqa: S101 - the scene names this function
    room, sheets = first_sheets(scene)
    elapsed_s = (frame.t_ns - scene.moves_since_ns) / NS_PER_S
    if any(sheet.course is not None for sheet in sheets):
        sheets = tuple(
            _sheet_at(sheet, item, elapsed_s, _luminance(scene))
            for sheet, item in zip(sheets, scene.items, strict=True)
        )
    surround = _surround(scene, elapsed_s, frame.turned_deg)
    veil = _veil(scene, frame, room)
    return Picture(frame.t_ns, room, (), NOBODY, sheets=sheets, surround=surround, veil=veil)


def _veil(scene: FlatScene, frame: SceneFrame, room: Room) -> Veil | None:
    """Return what covers a scene of which a window is seen; None of others."""
    if scene.gaze_window is None:
        return None
    screen = scene.surface.screen
    distance_m = FAR_M if scene.panorama is not None else DISTANCE_M
    if screen is not None:
        distance_m = screen.flat.distance_m
    place = frame.window_at or NO_WINDOW
    return Veil(scene.gaze_window, place, distance_m, room.background_srgb)


def _surround(
    scene: FlatScene, elapsed_s: float, turned_deg: tuple[float, float]
) -> Surround | None:
    """Return a scene's panorama some time after its onset, as the view is turned; None without."""
    if scene.panorama is None:
        return None
    pixels = panorama_pixels(scene.panorama, scene.folder, elapsed_s)
    orientation = _around(scene).orientation_at(turned_deg)
    return Surround(pixels.eyes, orientation, pixels.crc32, pixels.course)


@lru_cache(maxsize=16)
def _around(scene: FlatScene) -> SurroundingAreas:
    """Return where the areas of a scene's panorama are."""
    panorama, screen = scene.panorama, scene.surface.screen
    assert panorama is not None  # noqa: S101 - whoever calls this has looked
    head = (scene.head or AT_REST) if screen is None else screen.place
    pose = Pose(head.position_m, board_pose(head).orientation_wxyz)
    size_px = eye_size_px(panorama, scene.folder)
    film = facts_of(panorama, scene.folder) if panorama.is_film else None
    areas: tuple[Area, ...] = ()
    if panorama.areas:
        areas = read_areas(scene.folder / panorama.areas, size_px, is_around=True, film=film)
    end_s = 0.0 if film is None else float(film.stamps_s[-1])
    yaw_deg, since_ns = panorama.yaw_deg, scene.moves_since_ns
    return SurroundingAreas(
        pose, yaw_deg, size_px, areas, scene.turns, since_ns, end_s, scene.surface.screen
    )


@lru_cache(maxsize=16)
def first_sheets(scene: FlatScene) -> tuple[Room, tuple[Sheet, ...]]:
    """Return the place of a scene's stimuli, and these as they are at their onset."""
    background = shown_rgb(scene.background_srgb, _luminance(scene))
    return _room(background), tuple(_sheet(item, scene) for item in scene.items)


@lru_cache(maxsize=16)
def _room(background_srgb: tuple[int, int, int]) -> Room:
    return Room("flat", (), (), np.zeros(3), np.zeros(3), background_srgb)


@lru_cache(maxsize=16)
def monitor_of(scene: FlatScene) -> Sheet | None:
    """Return the lit area of the monitor before which a scene is shown, in its background's colour;
    None in a headset.
    """
    screen = scene.surface.screen
    if screen is None:
        return None
    flat, (room, _) = screen.flat, first_sheets(scene)
    pixels = np.array([[[*room.background_srgb, 255]]], np.uint8)
    pose = screen.pose_at(flat.center_right_m, flat.center_up_m)
    return Sheet(pixels, pose, (flat.width_m, flat.height_m))


def _luminance(scene: FlatScene) -> LuminanceTable | None:
    """Return what was measured of the screen before which a scene is shown."""
    screen = scene.surface.screen
    return None if screen is None else screen.flat.luminance


def _sheet(item: Flat, scene: FlatScene) -> Sheet:
    pose, size_m, size_px = place_of(item, scene)
    is_exact = scene.surface.screen is not None
    if isinstance(item, Video):
        film = reader_of(picture_path(item, scene.folder), size_px)
        return Sheet(film.picture_at(0.0), pose, size_m, is_exact, film)
    course = object() if isinstance(item, Dots) else None
    pixels = pixels_of(item, size_px, scene.folder, _luminance(scene))
    return Sheet(pixels, pose, size_m, is_exact, course)


@lru_cache(maxsize=4)
def reader_of(path: Path, size_px: tuple[int, int]) -> FilmReader:
    """Return one reader of a film of one size: it stays open from one showing to the next."""
    return FilmReader(path, size_px)


def open_films(scene: FlatScene) -> None:
    """Decode the first pictures of a scene's films before it is shown.

    Raises:
        DesignError: a film cannot be decoded.
    """
    for film in scene.films:
        if isinstance(film, Video):
            reader_of(picture_path(film, scene.folder), place_of(film, scene)[2]).picture_at(0.0)
        else:
            panorama_pixels(film, scene.folder)


def _sheet_at(
    sheet: Sheet, item: Flat, elapsed_s: float, luminance: LuminanceTable | None
) -> Sheet:
    """Return a sheet as it is some time after its onset."""
    if isinstance(sheet.course, FilmReader):
        return replace(sheet, pixels=sheet.course.picture_at(elapsed_s))
    if not isinstance(item, Dots):
        return sheet
    high, wide = sheet.pixels.shape[:2]
    step = step_at(item, elapsed_s)
    return replace(sheet, pixels=moving_pixels(item, (wide, high), step, luminance))


def place_of(item: Flat, scene: FlatScene) -> tuple[Pose, tuple[float, float], tuple[int, int]]:
    """Return the pose of a stimulus in the world, and its size in metres and in pixels drawn.

    Raises:
        DesignError: its picture cannot be read.
    """
    screen = scene.surface.screen
    return _around_head(item, scene) if screen is None else _on_screen(item, scene, screen)


def areas_of(scene: FlatScene) -> tuple[PictureAreas, ...]:
    """Return the areas of interest of a scene's stimuli, from the back to the front.

    Raises:
        DesignError: a file of areas cannot be read, or two areas have one name.
    """
    around = () if scene.panorama is None else (_around(scene),)
    sheets = (*around, *_placed_areas(scene))
    names: set[str] = set()
    for area in (area for one in sheets for area in one.areas):
        if not area.name.isidentifier():
            raise DesignError(
                f"t.show: a stimulus is called {area.name!r}; columns bear its name: give letters, "
                "digits and _"
            )
        if area.name in names:
            raise DesignError(
                f"t.show: two areas that are shown together are called {area.name!r}; name one "
                "otherwise"
            )
        names.add(area.name)
    return sheets


def _placed_areas(scene: FlatScene) -> Iterator[PlacedAreas]:
    for item, name in zip(scene.items, scene.names or ("",) * len(scene.items), strict=True):
        file = getattr(item, "areas", "")
        if not name and not file:
            continue
        pose, size_m, size_px = place_of(item, scene)
        film: FilmFacts | None = None
        if isinstance(item, Image | Video):
            size_px = own_size_px(item, scene.folder)
        if isinstance(item, Video):
            film = facts_of(item, scene.folder)
        wide, high = map(float, size_px)
        whole = Area(name, ((0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high)))
        if is_round(item):
            whole = Area(name, ellipse=(wide / 2, high / 2, wide, high, 0.0))
        own: tuple[Area, ...] = ()
        if file:
            own = read_areas(scene.folder / file, size_px, film=film)
        end_s = 0.0 if film is None else float(film.stamps_s[-1])
        areas = (*((whole,) if name else ()), *own)
        yield PlacedAreas(pose, size_m, size_px, areas, scene.moves_since_ns, end_s)


def own_size_px(item: Image | Video, folder: Path) -> tuple[int, int]:
    """Return width and height of a picture or film in its own pixels.

    Raises:
        DesignError: its file cannot be read.
    """
    if isinstance(item, Video):
        return facts_of(item, folder).size_px
    path = picture_path(item, folder)
    return picture_size(path, path.stat().st_mtime_ns if path.is_file() else 0)


def size_deg(flat: Flat, scene: FlatScene) -> tuple[float, float]:
    """Return width and height of a stimulus in degrees.

    Raises:
        DesignError: its picture cannot be read.
    """
    if isinstance(flat, Text):
        wide_em, high_em = text_size_em(flat)
        return wide_em * flat.height_deg, high_em * flat.height_deg
    if isinstance(flat, Image | Video):
        wide, high = own_size_px(flat, scene.folder)
        if flat.width_deg is None:
            assert flat.height_deg is not None  # noqa: S101 - one of them is given
            return flat.height_deg * wide / high, flat.height_deg
        return flat.width_deg, flat.height_deg or flat.width_deg * high / wide
    return flat.width_deg, float(getattr(flat, "height_deg", flat.width_deg))


def box_px(
    at_deg: tuple[float, float], size: tuple[float, float], flat: FlatScreen
) -> tuple[int, int, int, int]:
    """Return left, top, right, bottom of a box on a screen, in whole pixels, at least one each way.

    Angles count from the viewing place, from what is straight ahead of it, along each axis.
    """
    left_m, _, _, top_m = flat.edges_m()
    edges = []
    for axis, px_per_m in enumerate((flat.width_px / flat.width_m, flat.height_px / flat.height_m)):
        low, high = (
            flat.distance_m * np.tan(np.radians(at_deg[axis] + sign * size[axis] / 2))
            for sign in (-1, 1)
        )
        first, last = (low - left_m, high - left_m) if axis == 0 else (top_m - high, top_m - low)
        begin = round(first * px_per_m)
        edges.append((begin, max(begin + 1, round(last * px_per_m))))
    (left, right), (top, bottom) = edges
    return left, top, right, bottom


def _on_screen(
    item: Flat, scene: FlatScene, screen: PlacedScreen
) -> tuple[Pose, tuple[float, float], tuple[int, int]]:
    flat = screen.flat
    left, top, right, bottom = box_px(item.at_deg, size_deg(item, scene), flat)
    left_m, _, _, top_m = flat.edges_m()
    px_wide_m, px_high_m = flat.width_m / flat.width_px, flat.height_m / flat.height_px
    pose = screen.pose_at(
        left_m + (left + right) / 2 * px_wide_m, top_m - (top + bottom) / 2 * px_high_m
    )
    size_px = (right - left, bottom - top)
    return pose, (size_px[0] * px_wide_m, size_px[1] * px_high_m), size_px


def _around_head(item: Flat, scene: FlatScene) -> tuple[Pose, tuple[float, float], tuple[int, int]]:
    wide_deg, high_deg = size_deg(item, scene)
    head = scene.head or AT_REST
    upright = board_pose(head).orientation_wxyz
    right_deg, up_deg = item.at_deg
    turn = quat_multiply(upright, quat_from_yaw_pitch_deg(-right_deg, up_deg))
    at_m = head.position_m + rotate(turn, np.array([0.0, 0.0, -DISTANCE_M]))
    width_m, height_m = (2 * DISTANCE_M * np.tan(np.radians(d) / 2) for d in (wide_deg, high_deg))
    wide, high = (max(1, min(MAX_PX, round(d * PX_PER_DEG))) for d in (wide_deg, high_deg))
    return Pose(at_m, turn), (float(width_m), float(height_m)), (wide, high)

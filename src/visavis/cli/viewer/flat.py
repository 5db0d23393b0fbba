"""Flat stimuli as a page holds them: where they stood and what they looked like, areas of interest
on them, and the window after gaze.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.cli.recorded_trial import RecordedTrial
from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.models import SIDE_PX, Models
from visavis.cli.viewer.moving import WHOLE, Box, MovingFiles, moving_content, pixels_of
from visavis.lab.geometry import Pose, Vector, quat_conjugate, rotate, unit
from visavis.protocol.plan.shown_scene import RecordedScene, of_part
from visavis.stimuli.areas import (
    FAR_M,
    Area,
    PictureAreas,
    PlacedAreas,
    SurroundingAreas,
    areas_under,
    read_areas_text,
)
from visavis.stimuli.dressing.flat import first_sheets, monitor_of
from visavis.stimuli.film_file import FilmReader
from visavis.stimuli.painted_outlines import painted_outlines
from visavis.stimuli.picture import Picture, Sheet
from visavis.stimuli.room_areas import RoomAreas
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import FlatScene
from visavis.stimuli.surfaces import RayEnds, Surfaces
from visavis.study.scenes import FLAT

ELLIPSE_EVERY: Final = 8
"""Of the many corners of an ellipse a page has every eighth."""
CORNER_INSET_01: Final = 1e-6
STEP_DEG: Final = 5.0
"""Between two corners around the eye: a line between them is within a tenth of a degree."""


@dataclass(frozen=True, eq=False)
class Showing:
    """Flat stimuli that were shown, and their areas of interest; whether one knows the edges of the
    monitor's lit area, if there is one.
    """

    scene: FlatScene
    areas: tuple[PictureAreas, ...]
    has_edges: bool = True

    @property
    def monitor(self) -> Sheet | None:
        """The monitor's lit area, where one knows its edges."""
        return monitor_of(self.scene) if self.has_edges else None

    @cached_property
    def whole_sheets(self) -> tuple[Sheet, ...]:
        """Its stimuli at their onset."""
        return first_sheets(self.scene)[1]

    @cached_property
    def boxes(self) -> tuple[Box | None, ...]:
        """Which part of each stimulus is seen; None where nothing is."""
        monitor = self.monitor
        if monitor is None:
            return (WHOLE,) * len(self.whole_sheets)
        return tuple(_box_within(sheet, monitor) for sheet in self.whole_sheets)


def onsets_ns(trial: RecordedTrial) -> list[int]:
    """Return when something else came to be shown in a trial in which flat stimuli were, by its
    frames; nothing of others.
    """
    payloads = trial.recording.events_named("scene", trial.part)["payload"]
    flat_scenes = [p["scene"] for p in payloads if p["scene_name"] == FLAT]
    if not flat_scenes:
        return []
    # What is drawn in a frame is on display by the next: its row says what that was.
    rows = of_part(trial.recording, "scene_states", trial.part)["scene"]
    scene = rows[np.clip(trial.frames["scene_row"][1:], 0, len(rows) - 1)]
    t_ns = trial.frames["t_host_ns"][: len(scene)]
    start_ns, end_ns = trial.span_ns
    inside = (start_ns < t_ns) & (t_ns <= end_ns)
    if not np.isin(scene[inside], flat_scenes).any():
        return []
    changes = np.diff(scene, prepend=scene[:1]) != 0
    return [int(t) for t in t_ns[inside & changes]]


def showing_of(view: SceneFrame, record: RecordedScene) -> Showing | None:
    """Return the flat stimuli of a frame; None where it shows none."""
    scene = view.scene
    if not isinstance(scene, FlatScene):
        return None

    def showing() -> Showing:
        text = str((record.with_onset("shown") or {}).get("areas", "[]"))
        areas = [one for one in read_areas_text(text) if not isinstance(one, RoomAreas)]
        return Showing(scene, tuple(_turning(one, scene) for one in areas))

    return record.once(("showing", scene), showing)


def _turning(one: PictureAreas, scene: FlatScene) -> PictureAreas:
    return replace(one, turns=scene.turns) if isinstance(one, SurroundingAreas) else one


def words_of_files(scene: FlatScene, changed: Collection[str]) -> list[str]:
    """Return which of the flat stimuli of a scene are drawn from files that changed since."""
    names = dict.fromkeys(getattr(one, "file", "") for one in (scene.panorama, *scene.items))
    return [f"{name} is another file now than was shown" for name in names if name in changed]


def flat_ends(
    surfaces: Surfaces,
    picture: Picture,
    showing: Showing,
    origin_m: Vector,
    direction: Vector,
    t_ns: npt.NDArray[np.int64],
) -> RayEnds:
    """Return where rays (n, 3) of unit direction end at times (n,) on flat stimuli or beside them:
    on their areas of interest by name, on the "stimulus", the "screen" or the "panorama".
    """
    ends, monitor = surfaces.ends(picture, origin_m, direction), monitor_of(showing.scene)
    far_m, behind = ends.distance_m, "" if showing.scene.panorama is None else "panorama"
    if monitor is not None:
        behind, with_monitor = behind or "screen", replace(picture, sheets=(monitor,))
        behind_m = surfaces.ends(with_monitor, origin_m, direction).distance_m
    else:
        behind_m = np.full(len(far_m), FAR_M if behind else np.inf)
    is_beside = np.isinf(far_m)
    far_m = np.where(is_beside, behind_m, far_m)
    names = [area.name for one in showing.areas for area in one.areas]
    under = areas_under(showing.areas, names, origin_m, direction, t_ns=t_ns)
    on = np.where(is_beside & np.isfinite(far_m), behind, ends.name)
    return RayEnds(far_m, np.where(under < 0, on, np.array([*names, ""], dtype=object)[under]))


def flat_content(
    showing: Showing,
    t_ns: Sequence[int],
    pictures: Sequence[Picture],
    models: Models,
    bundle: Bundle,
    moving: Sequence[MovingFiles] = (),
) -> dict[str, Any]:
    """Return what a page says of flat stimuli that were shown at times, in these pictures, with the
    files of what moves in each.
    """
    scene, first = showing.scene, pictures[0]
    monitor = showing.monitor
    sheets = [] if monitor is None else [_sheet(monitor, models)]
    for number, (whole, box) in enumerate(zip(showing.whole_sheets, showing.boxes, strict=True)):
        if box is None:
            continue
        sheet = _sheet(_cut(whole, box), models)
        if whole.course is not None:
            sheet["moving"] = moving_content(
                [files.sheets[number] for files in moving],
                models,
                bundle,
                is_film=isinstance(whole.course, FilmReader),
                name=getattr(scene.items[number], "file", ""),
            )
        sheets.append(sheet)
    content: dict[str, Any] = {
        "sheets": sheets,
        "areas": list(_areas(showing, t_ns, bundle)),
    }
    if scene.surface.screen is not None:
        content["eye"] = scene.surface.screen.place.position_m.tolist()
        content["isWide"] = not showing.has_edges
    if first.veil is not None:
        window = first.veil.window
        content["window"] = {"deg": window.window_deg, "isAround": window.is_around}
    if first.surround is not None:
        turns = [p.surround.orientation_wxyz for p in pictures if p.surround is not None]
        is_film = first.surround.course is not None
        pixels = pixels_of(moving[0].around) if is_film else first.surround.eyes[0][..., :3]
        number = models.flat(pixels, "around")
        around = {"picture": number, "turns": _course(bundle, turns)}
        if is_film:
            course = [files.around for files in moving]
            name = getattr(scene.panorama, "file", "")
            around["moving"] = moving_content(course, models, bundle, is_film=True, name=name)
        content["around"] = around
    return content


def _box_within(sheet: Sheet, monitor: Sheet) -> Box | None:
    """Return which part of a sheet in a monitor's plane is on its lit area, in whole pixels of it;
    None where nothing is.
    """
    turn = monitor.pose.orientation_wxyz
    offset_m = rotate(quat_conjugate(turn), sheet.pose.position_m - monitor.pose.position_m)
    middle_m, sides_m = offset_m[:2] * [1, -1], np.array(sheet.size_m)  # right and down
    sides_px = np.array(sheet.pixels.shape[1::-1])
    reach_m = np.array(monitor.size_m) / 2
    low, high = (
        np.rint((edge_m - middle_m + sides_m / 2) / sides_m * sides_px).astype(int)
        for edge_m in (-reach_m, reach_m)
    )
    low, high = np.maximum(low, 0), np.minimum(high, sides_px)
    if (low >= high).any():
        return None
    (left, top), (right, bottom) = (low / sides_px).tolist(), (high / sides_px).tolist()
    return left, top, right, bottom


def _cut(sheet: Sheet, box: Box) -> Sheet:
    """Return a part of a sheet; the whole one as it is."""
    if box == WHOLE:
        return sheet
    low, high, sides_m = np.array(box[:2]), np.array(box[2:]), np.array(sheet.size_m)
    moved_m = ((low + high) / 2 - 0.5) * sides_m * [1, -1]
    turn = sheet.pose.orientation_wxyz
    place_m = sheet.pose.position_m + rotate(turn, np.array([*moved_m, 0.0]))
    sides_px = np.array(sheet.pixels.shape[1::-1])
    (left, top), (right, bottom) = (np.rint(edge * sides_px).astype(int) for edge in (low, high))
    wide_m, high_m = ((high - low) * sides_m).tolist()
    return Sheet(sheet.pixels[top:bottom, left:right], Pose(place_m, turn), (wide_m, high_m))


def _sheet(sheet: Sheet, models: Models) -> dict[str, Any]:
    return {
        "at": sheet.pose.position_m.tolist(),
        "turn": sheet.pose.orientation_wxyz.tolist(),
        "size": list(sheet.size_m),
        "picture": models.flat(sheet.pixels),
    }


def _areas(showing: Showing, t_ns: Sequence[int], bundle: Bundle) -> Iterator[dict[str, Any]]:
    """Yield each area's name and corners (times, corners, 3) in world, one time where it stands
    still; NaN while it is not there. A painted one says how many corners each of its outlines has,
    one behind a monitor whether the upper left corner of that is on it (times, 1).
    """
    screen, monitor = showing.scene.surface.screen, monitor_of(showing.scene)
    eye_m = None if screen is None else screen.place.position_m
    corner_m = None
    if monitor is not None:  # its upper left one, hardly within
        inset = (1 - CORNER_INSET_01) / 2 * np.array([-1.0, 1.0, 0.0])
        offset_m = inset * np.array([*monitor.size_m, 0.0])
        corner_m = monitor.pose.position_m + rotate(monitor.pose.orientation_wxyz, offset_m)
    for one in showing.areas:
        for k, area in enumerate(one.areas):
            is_still = isinstance(one, PlacedAreas) and not area.keys
            times = t_ns[:1] if is_still else t_ns
            shapes = [one.areas_now(t)[k] for t in times]
            lines = _lines(area, shapes, one)
            course = [
                np.full((len(corners), 3), np.nan) if shape is None else one.places_m(corners, t)
                for corners, t, shape in zip(np.concatenate(lines, 1), times, shapes, strict=True)
            ]
            content = {"name": area.name, "corners": _course(bundle, course)}
            if corner_m is not None and eye_m is not None:
                has_corner = _holds(replace(one, areas=(area,)), eye_m, corner_m, times)
                content["hasCorner"] = _course(bundle, list(has_corner))
            yield content | ({"outlines": [a.shape[1] for a in lines]} if area.pixels else {})


def _holds(one: PictureAreas, eye_m: Vector, place_m: Vector, t_ns: Sequence[int]) -> Vector:
    """Return at each time (times, 1) whether an eye sees the only area of a picture at a place: 1
    or 0.
    """
    eyes_m, count = np.tile(eye_m, (len(t_ns), 1)), len(t_ns)
    towards = np.tile(unit(place_m - eye_m), (count, 1))
    if isinstance(one, SurroundingAreas):
        one = replace(one, screen=None)
    area_numbers = one.areas_met(eyes_m, towards, np.array(t_ns), 0.0)
    return (area_numbers >= 0).astype(np.float64)[:, None]


def _lines(area: Area, now: Sequence[Area | None], sheet: PictureAreas) -> list[Vector]:
    """Return the closed lines around an area at each of several times: pixels (times, corners, 2),
    as exact as the page has the picture. What is straight in a panorama bends around the eye, so it
    has corners on its way.
    """
    is_around = isinstance(sheet, SurroundingAreas)
    if area.pixels:
        wide_px = sheet.size_px[0] if is_around else 0
        side_px = SIDE_PX["around" if is_around else "flat"]
        outlines = painted_outlines(area, max(1.0, max(sheet.size_px) / side_px), wide_px)
        lines = [np.broadcast_to(line, (len(now), *line.shape)) for line in outlines]
    else:
        every = ELLIPSE_EVERY if area.is_ellipse else 1
        lines = [np.array([(one or area.first()).corners()[::every] for one in now])]
    if not is_around:
        return lines
    step_px = STEP_DEG / 360.0 * sheet.size_px[0]
    return [_with_steps(line, step_px) for line in lines]


def _with_steps(corners: Vector, step_px: float) -> Vector:
    """Return closed lines (times, corners, 2) with corners no farther apart than a step along
    either axis, as many at every time.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    counts = np.ceil(np.abs(edges).max(axis=(0, 2)) / step_px).clip(1).astype(int)
    of = np.repeat(np.arange(len(counts)), counts)
    shares = np.concatenate([np.arange(n) / n for n in counts])
    return corners[:, of] + shares[:, None] * edges[:, of]


def _course(bundle: Bundle, values: Sequence[Vector]) -> dict[str, Any]:
    """Take in what something is at each of several times; once where it stays the same."""
    course = np.array(values, np.float32)
    stays = np.array_equal(course, np.broadcast_to(course[:1], course.shape), equal_nan=True)
    return bundle.add(course[:1] if stays else course)

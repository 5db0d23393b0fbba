"""Maps of gaze on the scene: how long people looked where, by condition, on what was drawn; on a
panorama all around.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from PIL import Image as PillowImage

from visavis.analysis.gaze.maps import (
    MIN_PEOPLE,
    Cluster,
    Grid,
    Values,
    clusters_of_difference,
    dwell_map,
)
from visavis.analysis.gaze.sphere_maps import SphereGrid, sphere_map
from visavis.analysis.report.notation import count_of
from visavis.cli.film.film import pictures_of
from visavis.cli.film.renderer import session_drawing
from visavis.cli.preview.pictures import symmetric_camera
from visavis.cli.recorded_trial import RecordedTrial, recorded_trial
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import (
    Pose,
    Vector,
    direction_from_yaw_pitch_deg,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    rotate,
    yaw_pitch_deg_of,
)
from visavis.lab.yaml_lines import did_you_mean, names_or_none
from visavis.protocol.plan.shown_scene import of_part
from visavis.recording.cached import CachedRecording
from visavis.results.flat_again import read_items_text
from visavis.results.opened_study import OpenedStudy
from visavis.results.several_sessions import SESSION_NUMBER
from visavis.running.page.seen_trial import is_on_page
from visavis.running.scripts import StudyData
from visavis.stimuli.areas import Area, PictureAreas, SurroundingAreas
from visavis.stimuli.flat import Image, Panorama, Video
from visavis.stimuli.painted_outlines import painted_outlines
from visavis.stimuli.picture import Picture
from visavis.stimuli.room_areas import RoomAreas
from visavis.stimuli.surfaces import Surfaces
from visavis.study.area_measures import areas_shown
from visavis.study.measures import TrialRecord

PICTURE_EVERY_NS: Final = NS_PER_S // 4
"""How often people and things are put where they were, for gaze to end on them: each sample ends on
them as they stood half of this away at most.
"""
MAX_RAYS_HZ: Final = 30
COARSE: Final = 9
"""Level of detail of the people on whom gaze ends: the lightest there is."""
MAX_APART_M: Final = 0.35
"""From eyes farther apart than this one does not see the same picture."""
SIZE_PX: Final = (960, 600)
AROUND_PX: Final = (1440, 720)
CELLS: Final = (160, 100)
MIN_TANGENT, MAX_TANGENT, WITHIN_01 = 0.3, 0.84, 0.98
ALPHA: Final = 0.05
MAX_COMPARED: Final = 3
"""Levels of which every pair is compared; of more two are."""
AT_MIDDLE: Final = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
Pictures = tuple[Image | Video | Panorama, ...]
"""What a trial showed, or the panorama alone that was behind it."""


@dataclass(frozen=True, eq=False)
class TrialGaze:
    """A trial's usable gaze: eyes (n, 3), ends on what was drawn (n, 3), seconds of each sample.

    `pictures` are the images and films that it showed. On a panorama ends are directions in its
    picture, and eyes in their middle.
    """

    participant: str
    level: str
    eyes_m: Vector
    ends_m: Vector
    seconds: Values
    pictures: Pictures = ()

    @property
    def is_around(self) -> bool:
        """Whether it was on a panorama."""
        return any(isinstance(one, Panorama) for one in self.pictures)


@dataclass(frozen=True, eq=False)
class MapDifference:
    """Where two levels differ: clusters below `ALPHA`, their p times the number of pairs compared;
    None where nothing was tested, `why_not` says why.
    """

    first: str
    second: str
    clusters: tuple[Cluster, ...] | None
    why_not: str = ""


@dataclass(frozen=True, eq=False)
class GazeMaps:
    """Maps by level (participants, rows, columns) in s per square degree and trial, on a picture.

    `differences` are those of the pairs of levels that were compared; where there are none,
    `why_not` says why. `picture` names what these trials showed, where others showed another.
    """

    factor: str
    levels: tuple[str, ...]
    people: Mapping[str, tuple[str, ...]]
    maps: Mapping[str, Values]
    grid: Grid | SphereGrid
    image: "np.ndarray[Any, np.dtype[np.uint8]]"
    differences: tuple[MapDifference, ...]
    why_not: str = ""
    outlines: tuple[tuple[str, tuple[Values, ...]], ...] = ()
    """The areas of interest of the trial that is drawn, by name: the corners (n, 2) of each closed
    line, in the grid's own units; painted ones may have several, holes among them.
    """
    picture: str = ""


def gaze_maps(
    data: StudyData,
    factor: str,
    *,
    peek: str | None,
    on_trial: Callable[[int, int], None],
    during: str = "",
    compare: tuple[str, str] | None = None,
) -> tuple[GazeMaps, ...]:
    """Return the maps of a study's trials that count, and where its levels differ.

    Compared are the two levels `compare`; without them every pair of up to `MAX_COMPARED` levels,
    and the first two of more. Where trials showed different pictures or films, each has maps of its
    own. Gaze counts while what the columns of the name `during` tell of was shown; without one,
    always, and on a panorama while that was shown.

    Raises:
        UsageError: there is no such factor or level, no gaze, people looked from places too far
            apart, or a trial showed several pictures and nobody said which one counts.
        StageError: nothing draws here.
    """
    analysis = data.analysis(peek=peek)
    if factor not in analysis.levels:
        names = names_or_none(analysis.levels)
        raise UsageError(f"--by {factor}: {data.study.name} has the factors {names}")
    trials = analysis.selection.counted
    levels = tuple(str(v) for v in analysis.levels[factor] if (trials[factor] == v).any())
    if compare is not None and (compare[0] == compare[1] or not set(compare) <= set(levels)):
        raise UsageError(
            f"--compare {','.join(compare)}: give two of the levels of {factor}, as in "
            f"--compare LEVEL,LEVEL: {names_or_none(levels)}"
        )
    looks, firsts = _looks(data, trials, factor, on_trial, during)
    middle_m = _middle_of_eyes([one for one in looks if not one.is_around])
    file_names = _names_of(firsts) if len(firsts) > 1 else [""]
    of_pictures = []
    for name, (pictures, (first, since_ns)) in zip(file_names, firsts.items(), strict=True):
        mine = [one for one in looks if one.pictures == pictures]
        grid: Grid | SphereGrid
        if mine[0].is_around:
            image, outlines = _all_around(data.study, first, during, since_ns)
            seen_from, grid = AT_MIDDLE, SphereGrid()
        else:
            image, seen_from, grid, t_ns = _scene(
                data.study, first, middle_m, mine, during, since_ns
            )
            outlines = _outlines(first, during, seen_from, t_ns)
        maps, people = {}, {}
        own = tuple(level for level in levels if any(one.level == level for one in mine))
        for level in own:
            of_people = maps_of_people([one for one in mine if one.level == level], seen_from, grid)
            people[level], maps[level] = tuple(of_people), np.array(list(of_people.values()))
        pairs = _pairs(own) if compare is None else [compare] if set(compare) <= set(own) else []
        differences = tuple(_difference(pair, people, maps, grid, len(pairs)) for pair in pairs)
        why_not = "there is one level" if len(own) < 2 else "both levels were not shown with it"
        of_pictures.append(
            GazeMaps(factor, own, people, maps, grid, image, differences, why_not, outlines, name)
        )
    return tuple(sorted(of_pictures, key=lambda maps: maps.picture))


def _middle_of_eyes(looks: Sequence[TrialGaze]) -> Vector:
    """Return the middle of all eyes.

    Raises:
        UsageError: people looked from places too far apart.
    """
    if not looks:
        return np.zeros(3)
    eyes_m = np.concatenate([one.eyes_m for one in looks])
    middle_m: Vector = np.median(eyes_m, axis=0)
    apart_m = float(np.percentile(np.linalg.norm(eyes_m - middle_m, axis=1), 95))
    if apart_m > MAX_APART_M:
        raise UsageError(
            f"people looked from places up to {apart_m:.1f} m apart: no one picture shows "
            "what they saw; visavis view shows a session as it was"
        )
    return middle_m


def _names_of(pictures: Iterable[Pictures]) -> list[str]:
    """Return what each picture is called, or several that were shown together: by their files."""
    names = ["_".join(Path(one.file).stem for one in of) or "none" for of in pictures]
    return [
        name if names.count(name) == 1 else f"{name}_{names[: k + 1].count(name)}"
        for k, name in enumerate(names)
    ]


def _outlines(
    trial: RecordedTrial, during: str, seen_from: Pose, t_ns: int
) -> tuple[tuple[str, tuple[Values, ...]], ...]:
    """Return the areas of interest of what a trial showed, where they were at a time: name and
    tangents x, y (corners, 2) of each line.
    """
    outlines = []
    sheets = areas_shown(TrialRecord(trial.row, trial.recording), during) if during else ()
    for sheet in sheets:
        if isinstance(sheet, RoomAreas):  # things have no outlines that one could draw
            continue
        for area in (area for area in sheet.areas_now(t_ns) if area is not None):
            lines = []
            for line in _lines(area, sheet, SIZE_PX[0]):
                x, y, _ = _tangents(seen_from, sheet.places_m(line, t_ns))
                lines.append(np.stack([x, y], axis=1))
            outlines.append((area.name, tuple(lines)))
    return tuple(outlines)


def _lines(area: Area, sheet: PictureAreas, wide_px: int) -> list[Values]:
    """Return the closed lines (n, 2) around an area of a picture, in its pixels, as exact as a
    drawing so wide shows them.
    """
    if not area.pixels:
        return [area.corners()]
    around_px = sheet.size_px[0] if isinstance(sheet, SurroundingAreas) else 0
    return painted_outlines(area, max(1.0, max(sheet.size_px) / wide_px), around_px)


def _looks(
    data: StudyData,
    trials: pd.DataFrame,
    factor: str,
    on_trial: Callable[[int, int], None],
    during: str,
) -> tuple[list[TrialGaze], dict[Pictures, tuple[RecordedTrial, int]]]:
    """Return the gaze of every trial that counts, and of each picture the first trial that showed
    it, and since when (session time, ns; 0 without any).
    """
    looks: list[TrialGaze] = []
    firsts: dict[Pictures, tuple[RecordedTrial, int]] = {}
    surfaces, number, names = Surfaces(COARSE), 0, set[str]()
    numbers = trials.get(SESSION_NUMBER.name, trials["session"])
    for session in data.sessions:
        manifest = session.recording.manifest
        mine = trials[
            (trials["participant"].astype(str) == manifest.participant)
            & (numbers.astype(int) == manifest.session)
        ]
        recording = CachedRecording(session.path)
        if "gaze_targets" not in recording.stream_names:
            number += len(mine)
            on_trial(number, len(trials))
            continue
        for trial_id, level in zip(mine["trial_id"], mine[factor], strict=True):
            trial = recorded_trial(recording, str(trial_id))
            mine_here = _showings_of(trial)
            names.update(str(p["name"]) for p in mine_here)
            since_ns = _pictures_of(mine_here, during)
            around = next((one for one in since_ns if isinstance(one, Panorama)), None)
            if around is None:
                ends = _ends(data.study, trial, surfaces, during)
            else:
                ends = _directions(trial, during)
            if ends is not None:
                if len(set(since_ns.values())) > 1:
                    several = ", ".join(dict.fromkeys(str(p["name"]) for p in mine_here))
                    raise UsageError(
                        f"{session.path}: trial {trial_id} showed pictures one after another; say "
                        f"by --during while which of them gaze counts ({several})"
                    )
                pictures: Pictures = tuple(since_ns)
                if around is not None:  # the same picture, whatever of it was ahead at first
                    pictures = (replace(around, yaw_deg=0.0, areas=""),)
                firsts.setdefault(pictures, (trial, max(since_ns.values(), default=0)))
                looks.append(TrialGaze(manifest.participant, str(level), *ends, pictures))
            number += 1
            on_trial(number, len(trials))
    if not firsts:
        what = f"while {during!r} was shown" if during else "on a scene"
        why = _why_none(data, during, names)
        raise UsageError(f"{data.path}: no trial that counts has usable gaze {what}{why}")
    return looks, firsts


def _why_none(data: StudyData, during: str, names: Collection[str]) -> str:
    """Return why trials that showed something of these names have no gaze, as far as is known."""
    if all(is_on_page(session.recording) for session in data.sessions):
        return (
            ": there is none on a page, where pointer_at measures a window after the pointer and "
            "visavis view shows it"
        )
    return did_you_mean(during, names) if during and names and during not in names else ""


def _showings_of(trial: RecordedTrial) -> list[Mapping[str, Any]]:
    """Return the events "shown" of a trial."""
    payloads = trial.recording.events_named("shown", trial.part)["payload"]
    return [p for p in payloads if p.get("trial_id") == str(trial.row["trial_id"])]


def _pictures_of(
    payloads: Iterable[Mapping[str, Any]], during: str
) -> dict[Image | Video | Panorama, int]:
    """Return the images, films and panoramas of a trial's events "shown", and when each came first
    (ns).
    """
    since_ns: dict[Image | Video | Panorama, int] = {}
    for payload in payloads:
        if during in ("", payload["name"]):
            behind = f"({payload['option_panorama']},)" if "option_panorama" in payload else "()"
            items = str(payload.get("option_items", "()"))
            for item in (*read_items_text(behind), *read_items_text(items)):
                if isinstance(item, Image | Video | Panorama):
                    since_ns.setdefault(item, int(payload["start_ns"]))
    return since_ns


def _ends(
    study: OpenedStudy, trial: RecordedTrial, surfaces: Surfaces, during: str
) -> tuple[Vector, Vector, Values] | None:
    """Return eyes, ends and seconds of a trial's gaze; None without any on a scene."""
    span_ns = trial.span_of(during)
    if trial.gaze is None or span_ns is None:
        return None
    start_ns, end_ns = span_ns
    stamps = trial.gaze["t_sample_ns"]
    inside = (stamps >= start_ns) & (stamps < end_ns)
    if np.count_nonzero(inside) < 2:
        return None
    # A ray costs as much as the scene has triangles: thirty a second are enough for 1°.
    period_s = float(np.median(np.diff(stamps[inside]))) / NS_PER_S
    every = max(1, round(1 / (MAX_RAYS_HZ * period_s)))
    rows = np.flatnonzero(inside)[::every]
    rows, seconds = rows[trial.gaze["valid"][rows]], every * period_s
    shown_at = pictures_of(study, trial)
    pieces = []
    step = (stamps[rows] - start_ns) // PICTURE_EVERY_NS
    # What was there before a scene came or went is no picture of what was there after.
    of_scene = np.searchsorted(_scene_changes_ns(trial), stamps[rows], side="right")
    _, piece = np.unique(np.stack([step, of_scene]), axis=1, return_inverse=True)
    for k in np.unique(piece):
        here = rows[piece.ravel() == k]
        picture = shown_at(int(stamps[here[0]] + stamps[here[-1]]) // 2)
        if picture.brightness_01 <= 0:
            continue
        eyes_m = trial.gaze["origin_world_m"][here].astype(np.float64)
        direction = trial.gaze["direction_world"][here].astype(np.float64)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        far_m = np.minimum(surfaces.ends(picture, eyes_m, direction).distance_m, 50.0)
        pieces.append((eyes_m, eyes_m + far_m[:, None] * direction))
    if not pieces:
        return None
    eyes, ends = (np.concatenate([piece[i] for piece in pieces]) for i in (0, 1))
    return eyes, ends, np.full(len(eyes), seconds)


def _scene_changes_ns(trial: RecordedTrial) -> Values:
    """Return when another scene, or the dark, came to be on display (n,)."""
    rows = of_part(trial.recording, "scene_states", trial.part)["scene"]
    if not len(rows):
        return np.zeros(0, np.int64)
    # What is drawn in a frame is on display by the next.
    scene = rows[np.clip(trial.frames["scene_row"], 0, len(rows) - 1)]
    changes = np.flatnonzero(np.diff(scene)) + 2
    t_ns: Values = trial.frames["t_host_ns"]
    return t_ns[changes[changes < len(t_ns)]]


def _panoramas_shown(
    trial: RecordedTrial, during: str
) -> Iterator[tuple[SurroundingAreas, tuple[int, int]]]:
    """Yield where each panorama of a trial stood with its areas, and from when to when (ns)."""
    for name in dict.fromkeys(
        str(p["name"]) for p in _showings_of(trial) if "option_panorama" in p
    ):
        span_ns = trial.span_of(name)
        if span_ns is None or during not in ("", name):
            continue
        for sheet in areas_shown(TrialRecord(trial.row, trial.recording), name):
            if isinstance(sheet, SurroundingAreas):
                yield sheet, span_ns


def _directions(trial: RecordedTrial, during: str) -> tuple[Vector, Vector, Values] | None:
    """Return, as `_ends` does, a trial's gaze on a panorama as directions in its picture."""
    if trial.gaze is None:
        return None
    pieces, stamps = [], trial.gaze["t_sample_ns"]
    for around, (start_ns, end_ns) in _panoramas_shown(trial, during):
        inside = (stamps >= start_ns) & (stamps < end_ns)
        if np.count_nonzero(inside) < 2:
            continue
        period_s = float(np.median(np.diff(stamps[inside]))) / NS_PER_S
        rows = np.flatnonzero(inside & trial.gaze["valid"])
        eyes_m, gaze = (
            trial.gaze[name][rows].astype(np.float64)
            for name in ("origin_world_m", "direction_world")
        )
        is_shown = around.is_shown(eyes_m, gaze)  # who looks beside a screen sees none of it
        x, y = around.pixels_met(gaze[is_shown], stamps[rows][is_shown])
        wide, high = around.size_px
        towards = direction_from_yaw_pitch_deg((0.5 - x / wide) * 360.0, (0.5 - y / high) * 180.0)
        pieces.append((towards, np.full(len(towards), period_s)))
    if not pieces:
        return None
    ends, seconds = (np.concatenate([piece[i] for piece in pieces]) for i in (0, 1))
    return np.zeros_like(ends), ends, seconds


def _all_around(
    study: OpenedStudy, first: RecordedTrial, during: str, since_ns: int
) -> tuple[Any, tuple[tuple[str, tuple[Values, ...]], ...]]:
    """Return the whole picture of the first trial's panorama as it was after a time, the left eye's
    if there are two, and its areas, in degrees.
    """
    around, (start_ns, end_ns) = next(_panoramas_shown(first, during))
    t_ns, picture = _lit_picture(study, first, (max(start_ns, since_ns), end_ns))
    assert picture.surround is not None  # noqa: S101 - the event says that there was one
    whole = PillowImage.fromarray(picture.surround.eyes[0][..., :3]).resize(AROUND_PX)
    px_per_deg = around.size_px[0] / 360.0
    outlines = []
    for area in (area for area in around.areas_now(t_ns) if area is not None):
        own = [
            line / px_per_deg * np.array([1, -1]) + np.array([-180, 90])
            for line in _lines(area, around, AROUND_PX[0])
        ]
        for shift_deg in (-360, 0, 360):  # it may reach across the picture's edge
            shifted = [line + np.array([shift_deg, 0.0]) for line in own]
            lines = tuple(a for a in shifted if a[:, 0].max() > -180 and a[:, 0].min() < 180)
            if lines:
                outlines.append((area.name, lines))
    return np.array(whole), tuple(outlines)


def _tangents(seen_from: Pose, places_m: Vector) -> tuple[Values, Values, "np.ndarray[Any, Any]"]:
    """Return tangents x, y of places from an eye, and which lie before it."""
    back = quat_conjugate(seen_from.orientation_wxyz)
    turn = np.stack([rotate(back, axis) for axis in np.eye(3)])
    own = (places_m - seen_from.position_m) @ turn
    before = own[:, 2] < -0.05
    depth = np.where(before, -own[:, 2], 1.0)
    return own[:, 0] / depth, own[:, 1] / depth, before


def _scene(
    study: OpenedStudy,
    first: RecordedTrial,
    eye_m: Vector,
    looks: Sequence[TrialGaze],
    during: str,
    since_ns: int,
) -> tuple[Any, Pose, Grid, int]:
    """Draw the first trial's scene after a time from the middle of all eyes, towards the middle of
    all gaze, and say of which time.
    """
    ends_m = np.concatenate([one.ends_m for one in looks])
    toward = ends_m - eye_m
    toward = (toward / np.linalg.norm(toward, axis=1, keepdims=True)).mean(axis=0)
    yaw_deg = float(np.degrees(np.arctan2(-toward[0], -toward[2])))
    pitch_deg = float(np.degrees(np.arctan2(toward[1], np.hypot(toward[0], toward[2]))))
    seen_from = Pose(eye_m, quat_from_yaw_pitch_deg(yaw_deg, pitch_deg))
    x, y, before = _tangents(seen_from, ends_m)
    aspect = SIZE_PX[0] / SIZE_PX[1]
    tangents = np.maximum(np.abs(x[before]) / aspect, np.abs(y[before]))
    top = float(np.clip(1.1 * np.quantile(tangents, WITHIN_01), MIN_TANGENT, MAX_TANGENT))
    start_ns, end_ns = first.span_of(during) or first.span_ns
    t_ns, picture = _lit_picture(study, first, (max(start_ns, since_ns), end_ns))
    with session_drawing() as drawing:
        image = np.array(drawing.image(picture, symmetric_camera(seen_from, top, aspect), SIZE_PX))
    return image, seen_from, Grid(top * aspect, top, *CELLS), t_ns


def _lit_picture(
    study: OpenedStudy, trial: RecordedTrial, span_ns: tuple[int, int]
) -> tuple[int, Picture]:
    """Return a time within a span of a trial, an eighth of its length after it begins if it was
    light then, and the picture of it.
    """
    shown_at = pictures_of(study, trial)
    for t_ns in np.linspace(*span_ns, 9)[1:-1].astype(np.int64).tolist():
        if (picture := shown_at(t_ns)).brightness_01 > 0:
            return t_ns, picture
    raise UsageError(f"{trial.recording.path}: its first trial shows no scene to draw gaze on")


def maps_of_people(
    looks: Sequence[TrialGaze], seen_from: Pose, grid: Grid | SphereGrid
) -> dict[str, Values]:
    """Return each participant's map in s per square degree and trial, by label."""
    maps = {}
    for who in sorted({one.participant for one in looks}):
        mine = [one for one in looks if one.participant == who]
        ends_m = np.concatenate([one.ends_m for one in mine])
        seconds = np.concatenate([one.seconds for one in mine])
        if isinstance(grid, SphereGrid):
            yaw_deg, pitch_deg = yaw_pitch_deg_of(ends_m)
            maps[who] = sphere_map(grid, -yaw_deg, pitch_deg, seconds) / len(mine)
            continue
        x, y, before = _tangents(seen_from, ends_m)
        maps[who] = dwell_map(grid, x[before], y[before], seconds[before]) / len(mine)
    return maps


def _pairs(levels: Sequence[str]) -> list[tuple[str, str]]:
    """Return the pairs of levels to compare: all, or of many the first two."""
    return list(combinations(levels if len(levels) <= MAX_COMPARED else levels[:2], 2))


def _difference(
    pair: tuple[str, str],
    people: Mapping[str, Sequence[str]],
    maps: Mapping[str, Values],
    grid: Grid | SphereGrid,
    pairs: int,
) -> MapDifference:
    """Return where two levels differ, as one of so many pairs; or why they were not compared."""
    both = [who for who in people[pair[0]] if who in people[pair[1]]]
    if len(both) < MIN_PEOPLE:
        had = count_of(len(both), "participant")
        return MapDifference(*pair, None, f"{had} had both; a test of maps needs {MIN_PEOPLE}")
    first, second = (maps[level][[people[level].index(who) for who in both]] for level in pair)
    cell_deg2 = grid.area_deg2() if isinstance(grid, SphereGrid) else None
    clusters = clusters_of_difference(first - second, cell_deg2=cell_deg2)
    times = [replace(one, p=min(1.0, one.p * pairs)) for one in clusters]
    return MapDifference(*pair, tuple(one for one in times if one.p < ALPHA))

"""Measures of gaze on areas of interest, by name: areas of flat stimuli, and people by their role.

All come from the recording alone: gaze, and the areas with the place where they stood.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import pairwise, permutations
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import LOST, NONE
from visavis.analysis.gaze.looks import LookMeasures, Looks, looks_on, measure_trial
from visavis.analysis.gaze.targets import GazeTargets
from visavis.lab.clock import NS_PER_MS
from visavis.lab.config import Screen
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose, rotate
from visavis.lab.kinds import takes_kinds
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.protocol.plan.steps import Scalar
from visavis.stimuli.areas import (
    Areas,
    SurroundingAreas,
    areas_under,
    read_areas_text,
    rooms_in,
)
from visavis.stimuli.room_areas import ROOM_SHAPE, RoomShape, read_shape_text
from visavis.stimuli.view_turns import VIEW_TURNED, read_turns
from visavis.study.measures import LOOKS, Measure, Of, TrialRecord

POINTER_WINDOW: Final = "pointer_window"
"""The event that says where the window was that followed the pointer on a page."""
POINTER_STEP_NS: Final = 10 * NS_PER_MS
"""A pointer's path is measured in steps of this length; a page moves its window every 17 ms."""


@dataclass(frozen=True, eq=False)
class GazeByArea:
    """A trial's gaze while something was shown: samples (n), and the area (n,) each is on: a place
    in `names`, `NONE` or `LOST`.
    """

    samples: GazeTargets
    area: npt.NDArray[np.int16]
    names: tuple[str, ...]
    window: tuple[int, int]
    same: Mapping[str, str] = field(default_factory=dict)
    """Names of people who have another name too, under which gaze is on them."""

    def place_of(self, name: str) -> int:
        """Return the number of an area."""
        return self.names.index(self.same.get(name, name))

    def looks(self, name: str) -> Looks:
        """Return every look on an area."""
        place = self.place_of(name)
        return looks_on(self.samples.t_ns, self.area, place, *self.window, params=LOOKS)

    def measures(self, name: str) -> LookMeasures:
        """Return the look measures of an area."""
        place = self.place_of(name)
        return measure_trial(self.samples.t_ns, self.area, place, *self.window, params=LOOKS)


Pick: TypeAlias = Callable[[GazeByArea], float | int | None]
"""Picks a measure out of a trial's gaze."""


@lru_cache(maxsize=8)
def gaze_by_area(record: TrialRecord, scene: str, pad_deg: float) -> GazeByArea | None:
    """Return a trial's gaze by area while what `scene` names was shown; None where it was not, or
    without a tracker.
    """
    window = record.window(scene)
    if record.gaze is None or window is None:
        return None
    samples = record.gaze.between(*window)
    sheets = areas_shown(record, scene)
    names = tuple(area.name for one in sheets for area in one.areas)
    prefix = f"{scene}_"
    roles = {
        str(column).removeprefix(prefix): int(value)
        for column, value in record.row.items()
        if str(column).startswith(prefix) and isinstance(value, int | float | np.number)
        if value == value and not str(column).endswith(("_ns", "_ms", "_frames"))
    }
    has_people = samples.angle_deg.shape[1] > 0 and len(roles) > 0
    if not sheets and not has_people:
        return None
    area = on_areas(samples, sheets, names, pad_deg)
    first_role: dict[int, str] = {}
    for role, agent in roles.items():
        first_role.setdefault(agent, role)
    same = {role: first_role[agent] for role, agent in roles.items()}
    if has_people:  # whose heads, where no mesh hides them, are before the things of a room
        agents = samples.areas(pad_deg)
        for agent, role in first_role.items():
            area[agents == agent] = len(names) + tuple(roles).index(role)
    return GazeByArea(samples, area, (*names, *roles), window, same)


def areas_shown(record: TrialRecord, scene: str) -> tuple[Areas, ...]:
    """Return the areas of what a trial showed under a name, where they stood; () without any. A
    page says them of what was seen through a window after the pointer, and of panoramas.
    """
    payloads = (_payloads_of(record, "shown", scene) or pointer_windows(record, scene))[-1:]
    if not payloads or "areas" not in payloads[0]:
        return ()
    text = str(payloads[0]["areas"])
    sheets = read_areas_text(text, _rooms_of(record, rooms_in(text)))
    if not any(isinstance(one, SurroundingAreas) for one in sheets):
        return sheets
    since_ns = int(payloads[0]["start_ns"])
    turned = _payloads_of(record, VIEW_TURNED, scene)
    turns = read_turns(t for t in turned if int(t["changed_ns"]) >= since_ns)
    screen = _screen_of(record)
    return tuple(
        replace(one, turns=turns, screen=screen) if isinstance(one, SurroundingAreas) else one
        for one in sheets
    )


def _screen_of(record: TrialRecord) -> PlacedScreen | None:
    """Return the monitor of a recorded session, before the eyes; None in a headset."""
    recording = record.recording
    content = None if recording is None else recording.manifest.configuration.get("screen")
    if not content:
        return None
    screen = Screen(**content)
    eyes_m = np.array([0.0, screen.eye_height_m, 0.0])
    return PlacedScreen(screen.flat, Pose(eyes_m, np.array([1.0, 0.0, 0.0, 0.0])))


def _rooms_of(record: TrialRecord, names: Iterable[str]) -> Mapping[str, RoomShape]:
    """Return the meshes of rooms by the SHA-256 of their files, as the session describes them."""
    shapes: dict[str, RoomShape] = {}
    for sha256 in names:
        events: Iterable[Mapping[str, Any]] = (p for name, p in record.events if name == ROOM_SHAPE)
        if record.recording is not None:
            part = int(record.row["recording_part"])
            events = record.recording.events_named(ROOM_SHAPE, part)["payload"]
        for event in events:
            if event["sha256"] == sha256:
                shapes[sha256] = read_shape_text(event["file"], sha256, str(event["meshes"]))
                break
    return shapes


def on_areas(
    samples: GazeTargets, sheets: Sequence[Areas], names: Sequence[str], pad_deg: float
) -> npt.NDArray[np.int16]:
    """Return the area (n,) that each sample is on: a place in `names`, `NONE` or `LOST`."""
    direction = samples.direction_world.astype(np.float64)
    origin = samples.origin_world_m
    eyes_m = np.zeros_like(direction) if origin is None else origin.astype(np.float64)
    under = areas_under(sheets, names, eyes_m, direction, pad_deg, samples.t_ns)
    area = np.where(under < 0, NONE, under).astype(np.int16)
    area[~samples.valid | (samples.hit == LOST)] = LOST
    return area


@takes_kinds()
def looks_at(
    *areas: str, scene: str = "stimulus", pad_deg: float = 0.0, prefix: str = ""
) -> tuple[Measure, ...]:
    """Return the measures of gaze on each area: `AREA_dwell_ms`, `AREA_share_01` of usable gaze,
    `AREA_first_look_ms` (missing without any), `AREA_entries` and `AREA_pupil_mm`.

    `scene` is the name of the columns of what is shown ("stimulus2" for the second of a trial);
    roles of people in a scene ("left") are areas too. `pad_deg` widens areas to where no other is.
    A trial that shows no such area has no value. In a `Room` a head holds gaze, within its pad
    too, unless a mesh is before it.

    Raises:
        DesignError: no area is named.
    """
    if not areas:
        raise DesignError("looks_at: name one area at least, as its file or its stimulus does")
    return tuple(m for area in areas for m in _measures_of(area, scene, pad_deg, prefix))


def _measures_of(area: str, scene: str, pad_deg: float, prefix: str) -> tuple[Measure, ...]:
    words = area.replace("_", " ")

    def measure(column: str, unit: str, what: str, pick: Pick) -> Measure:
        return Measure(
            f"{prefix}{area}_{column}",
            unit,
            f"{what} {words}",
            _of(area, partial(gaze_by_area, scene=scene, pad_deg=pad_deg), pick),
            needs_gaze=True,
            areas=(area,),
            scene=scene,
        )

    return (
        measure("dwell_ms", "ms", "Dwell time on", lambda g: g.measures(area).dwell_ms),
        measure(
            "share_01", "1", "Share of usable gaze on", lambda g: g.measures(area).dwell_of_valid_01
        ),
        measure("first_look_ms", "ms", "Time to the first look at", lambda g: _first(g, area)),
        measure("entries", "1", "Looks that came to", lambda g: len(g.looks(area).onset_ns)),
        measure("pupil_mm", "mm", "Mean pupil during looks at", lambda g: _pupil(g, area)),
    )


@takes_kinds()
def transitions(
    *areas: str, scene: str = "stimulus", pad_deg: float = 0.0, prefix: str = ""
) -> tuple[Measure, ...]:
    """Return how often gaze went from one area to another, `FROM_to_TO`, for every two in either
    order; what lies between areas, and loss, does not count as a stop.

    Raises:
        DesignError: there are not two areas.
    """
    if len(areas) < 2:
        raise DesignError("transitions: name two areas at least")
    return tuple(
        Measure(
            f"{prefix}{begin}_to_{end}",
            "1",
            f"Transitions from {begin.replace('_', ' ')} to {end.replace('_', ' ')}",
            _of(
                begin,
                partial(gaze_by_area, scene=scene, pad_deg=pad_deg),
                _transition(begin, end, areas),
            ),
            needs_gaze=True,
            areas=(begin, end),
            scene=scene,
        )
        for begin, end in permutations(areas, 2)
    )


@takes_kinds()
def view_range(scene: str = "stimulus", *, prefix: str = "") -> Measure:
    """Return how much of a panorama was straight ahead, `view_range_deg`: from the farthest to the
    left to the farthest to the right, 360 at most. In a headset the head turns, before a monitor
    or on a page arrow keys turn the view. Missing without a recording, as in power's quick path.
    """
    return Measure(
        f"{prefix}view_range_deg",
        "deg",
        "Width of the panorama that was straight ahead",
        partial(_range_ahead, scene=scene),
        scene=scene,
    )


def _range_ahead(record: TrialRecord, scene: str) -> float | None:
    window = record.window(scene)
    sheets = areas_shown(record, scene)
    around = next((one for one in sheets if isinstance(one, SurroundingAreas)), None)
    if window is None or around is None or record.recording is None:
        return None
    ahead = np.array([0.0, 0.0, -1.0])
    if record.recording.manifest.configuration.get("on") == "browser":
        # A page knows of no head: it is taken to be at rest in every frame.
        t_ns = np.arange(*window, max(around.turns.frame_ns, NS_PER_MS))
        direction = np.broadcast_to(ahead, (len(t_ns), 3))
    else:
        head = record.stream("head", *window)
        t_ns = head["t_host_ns"][head["valid"]]
        direction = rotate(head["orientation_wxyz"][head["valid"]].astype(np.float64), ahead)
    if not len(t_ns):
        return None
    x, _ = around.pixels_met(direction, t_ns)
    yaw_deg = np.unwrap(360.0 * x / around.size_px[0], period=360.0)
    return min(360.0, float(np.ptp(yaw_deg)))


@takes_kinds()
def pointer_at(*areas: str, scene: str = "stimulus", pad_deg: float = 0.0) -> tuple[Measure, ...]:
    """Return the measures of the pointer on each area that `reveal="pointer"` let it uncover on a
    page: `AREA_pointer_ms`, `AREA_pointer_share_01` of the time, `AREA_pointer_first_ms` (missing
    without any) and `AREA_pointer_entries`. It is where the middle of the window was, not gaze.

    Raises:
        DesignError: no area is named.
    """
    if not areas:
        raise DesignError("pointer_at: name one area at least, as its file or its stimulus does")
    path_of = partial(pointer_by_area, scene=scene, pad_deg=pad_deg)

    def measures(area: str) -> Iterator[Measure]:
        words = area.replace("_", " ")
        for column, unit, what, pick in (
            ("ms", "ms", "Time of the pointer on", lambda p: p.measures(area).dwell_ms),
            ("share_01", "1", "Share of time of the pointer on", lambda p: _share(p, area)),
            ("first_ms", "ms", "Time to the pointer's first visit to", lambda p: _first(p, area)),
            ("entries", "1", "Visits of the pointer to", lambda p: len(p.looks(area).onset_ns)),
        ):
            of = _of(area, path_of, pick)
            name = f"{area}_pointer_{column}"
            yield Measure(name, unit, f"{what} {words}", of, areas=(area,), scene=scene)

    return tuple(measure for area in areas for measure in measures(area))


def _share(pointer: GazeByArea, area: str) -> float | None:
    return pointer.measures(area).dwell_of_valid_01


@lru_cache(maxsize=8)
def pointer_by_area(record: TrialRecord, scene: str, pad_deg: float) -> GazeByArea | None:
    """Return where a trial's pointer was while a page showed something through a window after it,
    as `gaze_by_area` returns gaze; None where nothing was shown so.
    """
    window = record.window(scene)
    events = pointer_windows(record, scene)
    if window is None or not events:
        return None
    event = events[-1]
    wide, high = int(event["width_px"]), int(event["height_px"])
    px_per_m = 1000 * event["px_per_mm"]
    screen = FlatScreen(wide / px_per_m, high / px_per_m, wide, high, event["distance_mm"] / 1000)
    path = np.array(json.loads(event["path"]), np.float64).reshape(-1, 3)
    t_ns = np.arange(window[0], window[1], POINTER_STEP_NS)
    # Before it was moved nobody knows where a pointer is, and nothing is uncovered.
    last = np.searchsorted(path[:, 0], t_ns, side="right") - 1
    at_px = np.full((len(t_ns), 2), np.nan)
    at_px[last >= 0] = path[last[last >= 0], 1:]
    direction = screen.directions_of(at_px)
    sheets = read_areas_text(str(event["areas"]))
    names = tuple(area.name for one in sheets for area in one.areas)
    under = areas_under(sheets, names, np.zeros_like(direction), direction, pad_deg)
    samples = GazeTargets(
        t_ns=t_ns.astype(np.int64),
        valid=last >= 0,
        direction_world=direction,
        angle_deg=np.zeros((len(t_ns), 0)),
        radius_deg=np.zeros((len(t_ns), 0)),
        pad_limit_deg=np.zeros((len(t_ns), 0)),
        hit=under,
    )
    return GazeByArea(samples, under, names, window)


def pointer_windows(record: TrialRecord, scene: str) -> list[Mapping[str, Any]]:
    """Return what is recorded of the windows after the pointer through which a page showed what
    columns of a name tell of: `path` has since when, in ns, and the middle in pixels.
    """
    return _payloads_of(record, POINTER_WINDOW, scene)


def _payloads_of(record: TrialRecord, event: str, scene: str) -> list[Mapping[str, Any]]:
    """Return the payloads of a trial's events of a name that tell of what was shown as `scene`."""
    payloads: Iterable[Mapping[str, Any]] = (p for name, p in record.events if name == event)
    if record.recording is not None:
        part = int(record.row["recording_part"])
        payloads = record.recording.events_named(event, part)["payload"]
    trial_id = record.row.get("trial_id")
    return [p for p in payloads if p.get("trial_id") == trial_id and p.get("name") == scene]


def _of(area: str, gaze_of: Callable[[TrialRecord], GazeByArea | None], pick: Pick) -> Of:
    def of(record: TrialRecord) -> Scalar | None:
        gaze = gaze_of(record)
        if gaze is None or area not in gaze.names or gaze.measures(area).lost_01 in (None, 1.0):
            return None  # without gaze the value is missing, not zero
        return pick(gaze)

    return of


def _first(gaze: GazeByArea, area: str) -> float | None:
    onset_ns = gaze.looks(area).onset_ns
    return float(onset_ns[0] - gaze.window[0]) / NS_PER_MS if len(onset_ns) else None


def _pupil(gaze: GazeByArea, area: str) -> float | None:
    if gaze.samples.pupil_mm is None:
        return None
    is_here = (gaze.area == gaze.place_of(area)) & (gaze.samples.t_ns >= gaze.window[0])
    sizes = gaze.samples.pupil_mm[is_here]
    sizes = sizes[np.isfinite(sizes)]
    return float(sizes.mean()) if len(sizes) else None


def _transition(begin: str, end: str, areas: Sequence[str]) -> Callable[[GazeByArea], int | None]:
    def count(gaze: GazeByArea) -> int | None:
        if end not in gaze.names:
            return None
        stops = sorted(
            (int(t_ns), name)
            for name in areas
            if name in gaze.names
            for t_ns in gaze.looks(name).onset_ns
        )
        return sum(a == begin and b == end for (_, a), (_, b) in pairwise(stops))

    return count

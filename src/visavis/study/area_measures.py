"""Measures of gaze on areas of interest, by name: areas of flat stimuli, and people by their role.

All come from the recording alone: gaze, and the areas with the place where they stood.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, permutations
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import LOST, NONE
from visavis.analysis.gaze.looks import LookMeasures, Looks, looks_on, measure_trial
from visavis.analysis.gaze.targets import GazeTargets
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DesignError
from visavis.protocol.plan.steps import Scalar
from visavis.stimuli.areas import PlacedAreas, areas_under, read_areas_text
from visavis.study.measures import LOOKS, Measure, Of, TrialRecord


@dataclass(frozen=True, eq=False)
class GazeByArea:
    """A trial's gaze while something was shown: samples (n), and the area (n,) each is on: a place
    in `names`, `NONE` or `LOST`.
    """

    samples: GazeTargets
    area: npt.NDArray[np.int16]
    names: tuple[str, ...]
    window: tuple[int, int]

    def looks(self, name: str) -> Looks:
        """Return every look on an area."""
        place = self.names.index(name)
        return looks_on(self.samples.t_ns, self.area, place, *self.window, params=LOOKS)

    def measures(self, name: str) -> LookMeasures:
        """Return the look measures of an area."""
        place = self.names.index(name)
        return measure_trial(self.samples.t_ns, self.area, place, *self.window, params=LOOKS)


@lru_cache(maxsize=8)
def gaze_by_area(record: TrialRecord, scene: str, pad_deg: float) -> GazeByArea | None:
    """Return a trial's gaze by area while what `scene` names was shown; None where it was not, or
    without a tracker.
    """
    window = record.window(scene)
    if record.gaze is None or window is None:
        return None
    samples = record.gaze.between(*window)
    placed = areas_shown(record, scene)
    if placed:
        names = tuple(area.name for one in placed for area in one.areas)
        return GazeByArea(samples, on_areas(samples, placed, names, pad_deg), names, window)
    prefix = f"{scene}_"
    roles = {
        str(column).removeprefix(prefix): int(value)
        for column, value in record.row.items()
        if str(column).startswith(prefix) and isinstance(value, int | float | np.number)
        if value == value and not str(column).endswith(("_ns", "_ms", "_frames"))
    }
    if not samples.angle_deg.shape[1] or not roles:
        return None
    agents = samples.areas(pad_deg)
    area = agents.copy()
    for place, agent in enumerate(roles.values()):
        area[agents == agent] = place
    return GazeByArea(samples, area, tuple(roles), window)


def areas_shown(record: TrialRecord, scene: str) -> tuple[PlacedAreas, ...]:
    """Return the areas of what a trial showed under a name, where they stood; () without any."""
    shown: Iterable[Mapping[str, Any]] = record.shown
    if record.recording is not None:
        part = int(record.row["recording_part"])
        shown = record.recording.events_named("shown", part)["payload"]
    mine = [
        payload
        for payload in shown
        if payload.get("trial_id") == record.row.get("trial_id") and payload.get("name") == scene
    ]
    return read_areas_text(str(mine[-1]["areas"])) if mine and "areas" in mine[-1] else ()


def on_areas(
    samples: GazeTargets, placed: Sequence[PlacedAreas], names: Sequence[str], pad_deg: float
) -> npt.NDArray[np.int16]:
    """Return the area (n,) that each sample is on: a place in `names`, `NONE` or `LOST`."""
    direction = samples.direction_world.astype(np.float64)
    origin = samples.origin_world_m
    eyes_m = np.zeros_like(direction) if origin is None else origin.astype(np.float64)
    under = areas_under(placed, names, eyes_m, direction, pad_deg)
    area = np.where(under < 0, NONE, under).astype(np.int16)
    area[~samples.valid | (samples.hit == LOST)] = LOST
    return area


def looks_at(
    *areas: str, scene: str = "stimulus", pad_deg: float = 0.0, prefix: str = ""
) -> tuple[Measure, ...]:
    """Return the measures of gaze on each area: `AREA_dwell_ms`, `AREA_share_01` of usable gaze,
    `AREA_first_look_ms` (missing without any), `AREA_entries` and `AREA_pupil_mm`.

    `scene` is the name of the columns of what is shown ("stimulus2" for the second of a trial);
    roles of people in a scene ("left") are areas too. `pad_deg` widens areas to where no other is.
    A trial that shows no such area has no value.

    Raises:
        DesignError: no area is named.
    """
    if not areas:
        raise DesignError("looks_at: name one area at least, as its file or its stimulus does")
    return tuple(m for area in areas for m in _measures_of(area, scene, pad_deg, prefix))


def _measures_of(area: str, scene: str, pad_deg: float, prefix: str) -> tuple[Measure, ...]:
    words = area.replace("_", " ")

    def measure(column: str, unit: str, what: str, pick: Callable[[GazeByArea], object]) -> Measure:
        return Measure(
            f"{prefix}{area}_{column}",
            unit,
            f"{what} {words}",
            _of(area, scene, pad_deg, pick),
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
            _of(begin, scene, pad_deg, _transition(begin, end, areas)),
            needs_gaze=True,
            areas=(begin, end),
            scene=scene,
        )
        for begin, end in permutations(areas, 2)
    )


def _of(area: str, scene: str, pad_deg: float, pick: Callable[[GazeByArea], object]) -> Of:
    def of(record: TrialRecord) -> Scalar | None:
        gaze = gaze_by_area(record, scene, pad_deg)
        if gaze is None or area not in gaze.names or gaze.measures(area).lost_01 in (None, 1.0):
            return None  # without gaze the value is missing, not zero
        value: Scalar | None = pick(gaze)  # type: ignore[assignment]  # a number, or missing
        return value

    return of


def _first(gaze: GazeByArea, area: str) -> float | None:
    onset_ns = gaze.looks(area).onset_ns
    return float(onset_ns[0] - gaze.window[0]) / NS_PER_MS if len(onset_ns) else None


def _pupil(gaze: GazeByArea, area: str) -> float | None:
    if gaze.samples.pupil_mm is None:
        return None
    is_here = (gaze.area == gaze.names.index(area)) & (gaze.samples.t_ns >= gaze.window[0])
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

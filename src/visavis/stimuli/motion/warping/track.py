"""Offsets of a movement that is known beforehand: keys in time, corrected ahead of what is shown.

A track starts from the offsets found for where the observer was expected. A loop beside the frame
loop corrects key after key for where the observer is, a moment before a key is shown; what a key
has once begun to shape is never changed again. So a track and the keys that were corrected say
what every frame showed.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.warping.control import (
    ControlSettings,
    Situation,
    is_within,
    see,
    steer,
    tolerance_of,
    wanted_features,
)
from visavis.stimuli.motion.warping.units import WarpingUnit, units_named

if TYPE_CHECKING:  # loads SciPy's splines, which showing a scene does not need
    from visavis.stimuli.motion.warping.clips import WarpedClip

LEAD_S: Final = 0.15
"""How long before it shapes what is shown a key is asked for: a solution and a frame or two."""
SHOWN_AHEAD_S: Final = 0.05
"""A frame's light leaves at most so long after the plan has shown it."""
LOOK_S: Final = 0.1
"""How often it is noted from where a corrected movement is seen."""
_SHAPED: Final = 2
"""A key shapes the curve from so many keys before it on."""

Solve = Callable[[float, Vector, Vector], Vector]
"""Time of a key, offsets (w,) to start from and the observer's eye (3,) to new offsets (w,).
It runs in another process: a function of a module, or `functools.partial` of one."""


@dataclass(frozen=True, eq=False)
class WarpTrack:
    """Offsets (k, w) in radians of warping units at keys every `gap_s` from `start_s` on.

    They come in over `fade_s` before the first key and go out over as long after the last.
    """

    units: tuple[WarpingUnit, ...]
    start_s: float
    gap_s: float
    omega_rad: Vector
    fade_s: float

    @property
    def key_s(self) -> Vector:
        """When the keys are (k,)."""
        times: Vector = self.start_s + self.gap_s * np.arange(len(self.omega_rad), dtype=np.float64)
        return times

    def at(self, t_s: float) -> Vector:
        """Return the offsets (w,) at a time: a Catmull-Rom curve through the keys, held at ends."""
        last = len(self.omega_rad) - 1
        place = float(np.clip((t_s - self.start_s) / self.gap_s, 0.0, last))
        k = min(int(place), max(last - 1, 0))
        h = place - k
        a, b, c, d = (self.omega_rad[min(max(k + i, 0), last)] for i in (-1, 0, 1, 2))
        curve: Vector = b + 0.5 * h * (
            c - a + h * (2 * a - 5 * b + 4 * c - d + h * (3 * (b - c) + d - a))
        )
        end_s = self.start_s + last * self.gap_s
        outside = max(self.start_s - t_s, t_s - end_s, 0.0) / max(self.fade_s, 1e-9)
        share = max(0.0, 1.0 - outside)
        return curve * (share**3 * (10 - 15 * share + 6 * share**2))

    def first_open(self, t_s: float) -> int:
        """Return the first key that shapes nothing of what is shown up to a time."""
        if t_s <= self.start_s - self.fade_s:
            return 0
        return max(1, int(np.floor((t_s - self.start_s) / self.gap_s)) + _SHAPED + 1)

    def with_key(self, key: int, omega_rad: Vector) -> "WarpTrack":
        """Return the track with another key; those after it are shifted by as much."""
        reach = np.radians([u.range_deg for u in self.units])
        offsets_rad = self.omega_rad.copy()
        offsets_rad[key:] = np.clip(
            offsets_rad[key:] + (omega_rad - offsets_rad[key]), -reach, reach
        )
        offsets_rad[key] = omega_rad
        return replace(self, omega_rad=offsets_rad)


def solve_offsets(situation: Situation, start_rad: Vector, settings: ControlSettings) -> Vector:
    """Return offsets (w,) for one pose, as few steps from others as `settings` allow.

    Offsets that meet the target as they are stay as they are.
    """
    before = see(situation, np.stack([np.zeros_like(start_rad), start_rad]))
    goal = wanted_features(situation.targets, before[0])
    left = np.abs(goal - before[1])
    if (left <= 0.5 * tolerance_of(situation, before[0], goal)).all() or not before[0].any():
        return start_rad
    return steer(situation, settings, start_rad=start_rad).omega_rad


class TrackLoop:
    """Correct a track key by key for an observer who moves; one key is worked on at a time.

    `beside` performs what it is given where it does not hold up a frame. A key that comes too late
    is left as it was and counted in `late`.
    """

    def __init__(self, track: WarpTrack, solve: Solve, executor: Executor) -> None:
        self.track = track
        self.n_taken = self.late = 0
        self._looks: list[tuple[float, Vector]] = []
        self._solve, self._executor = solve, executor
        self._last = -1
        self._request: Future[Vector] | None = None

    def step(self, t_s: float, eye_m: Vector) -> int | None:
        """Take a finished key and request the next; return the key taken in this frame."""
        due_s = self._looks[-1][0] + LOOK_S if self._looks else self.track.start_s
        if due_s <= t_s < self.track.key_s[-1]:
            self._looks.append((t_s, eye_m))
        new_key = None
        if self._request is not None and self._request.done():
            offsets_rad = self._request.result()
            self._request = None
            if self._last >= self.track.first_open(t_s + SHOWN_AHEAD_S):
                self.track, new_key = self.track.with_key(self._last, offsets_rad), self._last
                self.n_taken += 1
            else:
                self.late += 1
        if self._request is None:
            key = self.track.first_open(t_s + SHOWN_AHEAD_S + LEAD_S)
            if self._last < key < len(self.track.omega_rad):
                start = self.track.omega_rad[key]
                time_s = float(self.track.key_s[key])
                self._last = key
                self._request = self._executor.submit(self._solve, time_s, start, eye_m)
        return new_key

    def came_to(
        self, reached_in: Callable[[Vector, Vector, Vector], "Reached"]
    ) -> "Future[Reached] | None":
        """Let be measured beside what the track came to; None where nobody has looked yet.

        `reached_in` gets times (n,), offsets (n, w) and eyes (n, 3): a function like a `Solve`.
        """
        if not self._looks:
            return None
        times, eyes = (np.array(column) for column in zip(*self._looks, strict=True))
        omega = np.array([self.track.at(float(t_s)) for t_s in times])
        return self._executor.submit(reached_in, times, omega, eyes)


@dataclass(frozen=True)
class Reached:
    """The result of a warp over a movement.

    `wanted` and `reached` features as shares of the original (of their sums), the share of frames
    on target, and of those whose pose alone can come to it (NaN: unknown).
    """

    wanted: float
    reached: float
    met_01: float
    reachable_01: float = float("nan")


def reached_by(situations: Iterable[Situation], omega_rad: Vector) -> Reached:
    """Return what offsets (n, w) come to in n situations.

    Where a feature is not seen at all there is no share of it to raise: that is not on target.
    """
    sums, met = np.zeros(3), 0
    for situation, omega in zip(situations, omega_rad, strict=True):
        original, now = see(situation, np.stack([np.zeros_like(omega), omega]))
        goal = wanted_features(situation.targets, original)
        sums += original.sum(), goal.sum(), now.sum()
        met += bool(original.all()) and is_within(goal, original, now, situation)
    whole = sums[0] if sums[0] > 0 else np.nan
    return Reached(float(sums[1] / whole), float(sums[2] / whole), met / max(len(omega_rad), 1))


def planned_track(
    warped_clip: "WarpedClip",
    start_s: float,
    end_s: float,
    fade_s: float,
    situation_at: Callable[[float], Situation],
    settings: ControlSettings,
) -> tuple[WarpTrack, Reached]:
    """Return a clip's offsets as a track between two times, and what that comes to.

    Every key is solved once more, by `settings`, in its situation; what it comes to is told half
    way between keys, and of the keys the share whose pose alone came to its target.
    """
    gap_s = (end_s - start_s) / max(len(warped_clip.omega_rad) - 1, 1)
    track = WarpTrack(warped_clip.units, start_s, gap_s, warped_clip.omega_rad.copy(), fade_s)
    for k, t_s in enumerate(track.key_s):
        track.omega_rad[k] = solve_offsets(situation_at(float(t_s)), track.omega_rad[k], settings)
    times = track.key_s[:-1] + gap_s / 2
    omega = np.array([track.at(float(t_s)) for t_s in times])
    came_to = reached_by((situation_at(float(t_s)) for t_s in times), omega)
    at_keys = np.minimum(
        np.searchsorted(warped_clip.frame_s, warped_clip.key_s), len(warped_clip.original) - 1
    )
    is_visible = warped_clip.original[at_keys].all(axis=1)
    return track, replace(
        came_to, reachable_01=float((warped_clip.pose_reached & is_visible).mean())
    )


def key_record(track: WarpTrack, key: int) -> dict[str, int | float]:
    """Return what a recording keeps of a corrected key: its number and every unit's offset."""
    angles = zip(track.units, track.omega_rad[key].tolist(), strict=True)
    return {"key": key, **{f"{unit.name}_rad": angle for unit, angle in angles}}


def track_record(track: WarpTrack) -> dict[str, str | float]:
    """Return what a recording keeps of a track: units, times, offsets as JSON, digit by digit."""
    return {
        "units": ",".join(unit.name for unit in track.units),
        "track_start_s": track.start_s,
        "key_gap_s": track.gap_s,
        "fade_s": track.fade_s,
        "offsets_rad": json.dumps(track.omega_rad.tolist()),
    }


def recorded_track(record: Mapping[str, Any], keys: Iterable[Mapping[str, Any]] = ()) -> WarpTrack:
    """Return a track from its record and those of its corrected keys, in the order they came."""
    units = units_named(tuple(str(record["units"]).split(",")))
    omega = np.array(json.loads(record["offsets_rad"]))
    track = WarpTrack(units, record["track_start_s"], record["key_gap_s"], omega, record["fade_s"])
    for key in keys:
        angles = np.array([key[f"{unit.name}_rad"] for unit in units])
        track = track.with_key(int(key["key"]), angles)
    return track

"""Objective measures of a film: how well its camera showed the subject, and how it moved.

It is made from where the camera was and who stood where, whichever camera that was; whether the
subject is seen is counted in the identity image drawn from that camera.
"""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.obstacles import NOBODY, Obstacles
from visavis.stimuli.camera.shots import HEIGHT_SHARE, ShotSize, on_same_side, view_angle_deg
from visavis.stimuli.picture import Camera, Room

SEEN_FROM_01: Final = 0.0004
"""The subject is seen where they fill this share of the picture."""
CUT_FASTER_THAN_MPS: Final = 15.0
"""A camera that goes farther between two pictures was cut, or its own decisions say so."""
RULE_DEG: Final = 30.0
NEAR_M: Final = 0.09
MOVES_FROM_MPS: Final = 0.2
"""Below this speed a subject defines no line of action that a cut could cross."""


@dataclass(frozen=True)
class Sheet:
    """Measures of a film; None where a measure does not apply.

    `seen_01` is the share of looks at the identity image in which the subject was seen, `lost_s`
    the mean and `longest_lost_s` the longest time until they were seen again, `size_off_by` by what
    factor their height in the picture differed from the wanted one (median), angles and lines
    count cuts, `jerk_mps3` is the mean within shots, `collisions` pictures taken from within 9 cm
    of a surface or out of somebody.
    """

    pictures: int
    seconds: float
    seen_01: float | None
    lost_s: float | None
    longest_lost_s: float | None
    size_off_by: float | None
    shots: int
    mean_shot_s: float
    median_shot_s: float
    cuts_below_30_deg: int
    lines_crossed: int
    jerk_mps3: float | None
    collisions: int

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        path.write_text(json.dumps(asdict(self), indent=2) + "\n", encoding="utf-8")

    def sentence(self) -> str:
        """Return the main measures in one line."""
        visibility = (
            "" if self.seen_01 is None else f"participant seen {100 * self.seen_01:.0f} %, "
        )
        return (
            f"{self.shots} shots of {self.median_shot_s:.1f} s (median), {visibility}"
            f"{self.cuts_below_30_deg} cuts below 30°, {self.lines_crossed} lines crossed, "
            f"{self.collisions} collisions"
        )


@dataclass(eq=False)
class FilmLog:
    """The log of a film, picture by picture; `people` (c, 7) are upright capsules."""

    shot: ShotSize | None = None
    t_ns: list[int] = field(default_factory=list)
    places_m: list[Vector] = field(default_factory=list)
    heads_m: list[Vector] = field(default_factory=list)
    size_off: list[float] = field(default_factory=list)
    visibility: list[tuple[int, bool]] = field(default_factory=list)
    collisions: int = 0
    _obstacles: dict[int, tuple[Room, Obstacles]] = field(default_factory=dict)

    def add(self, t_ns: int, camera: Camera, head_m: Vector, room: Room, people: Vector) -> None:
        """Note a picture: its camera, and where the subject's head is."""
        place: Vector = camera.pose.position_m
        self.t_ns.append(t_ns)
        self.places_m.append(place)
        self.heads_m.append(head_m.copy())
        if self.shot is not None:
            tangent = (camera.top - camera.bottom) / 2
            apart_m = float(np.linalg.norm(place - head_m * np.array([1.0, 0.6, 1.0])))
            share = float(head_m[1]) / (2 * max(apart_m, 1e-3) * tangent)
            self.size_off.append(abs(float(np.log2(share / HEIGHT_SHARE[self.shot]))))
        if room.props:
            if id(room) not in self._obstacles:
                self._obstacles[id(room)] = room, Obstacles.of_room(room)
            near = self._obstacles[id(room)][1].is_near(place, NEAR_M)
            self.collisions += int(near or _is_within(place, people))

    def sheet(self, cuts_ns: npt.NDArray[np.int64] | None = None) -> Sheet:
        """Return the sheet; `cuts_ns` are when the camera cut, found by its jumps when left out."""
        t_s = np.array(self.t_ns) / NS_PER_S
        places, heads = np.array(self.places_m), np.array(self.heads_m)
        step_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.04
        if cuts_ns is None:
            step_m = np.linalg.norm(np.diff(places, axis=0), axis=1)
            cuts = np.flatnonzero(step_m > CUT_FASTER_THAN_MPS * step_s) + 1
        else:
            cuts = np.unique(np.searchsorted(self.t_ns, cuts_ns))
            cuts = cuts[(cuts > 0) & (cuts < len(t_s))]
        begins = np.concatenate([[0], cuts]).astype(np.int64)
        ends = np.concatenate([cuts, [len(t_s)]]).astype(np.int64)
        lengths = (ends - begins) * step_s
        velocity = np.gradient(heads, step_s, axis=0) if len(heads) > 1 else np.zeros_like(heads)
        below, n_crossings = 0, 0
        for k in cuts.tolist():
            before, after, subject = places[k - 1], places[k], heads[k]
            below += bool(view_angle_deg(subject, before, after) < RULE_DEG)
            if np.linalg.norm(velocity[k][[0, 2]]) > MOVES_FROM_MPS:
                n_crossings += not on_same_side(subject, velocity[k], before, after)
        jerks = [
            np.linalg.norm(np.diff(places[a:b], n=3, axis=0), axis=1) / step_s**3
            for a, b in zip(begins, ends, strict=True)
            if b - a > 3
        ]
        lost_s = _lost_s(self.visibility)
        return Sheet(
            len(t_s),
            len(t_s) * step_s,
            float(np.mean([s for _, s in self.visibility])) if self.visibility else None,
            float(np.mean(lost_s)) if lost_s else None,
            max(lost_s) if lost_s else None,
            float(2 ** np.median(self.size_off)) if self.size_off else None,
            len(lengths),
            float(lengths.mean()),
            float(np.median(lengths)),
            below,
            n_crossings,
            float(np.concatenate(jerks).mean()) if jerks else None,
            self.collisions,
        )


def _is_within(place: Vector, people: Vector = NOBODY) -> bool:
    """Tell whether a place lies in somebody, upright capsules (c, 7)."""
    if not len(people):
        return False
    nearest = people[:, :3].copy()
    nearest[:, 1] = np.clip(place[1], people[:, 1], people[:, 4])
    return bool((np.linalg.norm(place - nearest, axis=1) < people[:, 6]).any())


def _lost_s(visibility: list[tuple[int, bool]]) -> list[float]:
    """Return how long each time lasted in which the subject was not seen."""
    durations_s: list[float] = []
    since: int | None = None
    for t_ns, is_seen in visibility:
        if not is_seen and since is None:
            since = t_ns
        if is_seen and since is not None:
            durations_s.append((t_ns - since) / NS_PER_S)
            since = None
    if since is not None and visibility[-1][0] > since:
        durations_s.append((visibility[-1][0] - since) / NS_PER_S)
    return durations_s

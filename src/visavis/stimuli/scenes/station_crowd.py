"""A dense crowd of idle people in a metro station: who stands where, and the room around.

Ground plane: x to the right, z towards the viewer, y up; the crowd fills a square centred at the
origin. The participant starts at one corner, the board hangs beyond the opposite one. After
Berton et al. 2020 (10.1109/TVCG.2020.3041341): eight fixed configurations of 1.47 ± 0.06 people
per square metre, on average 0.60 m free between neighbours; half of the people wait and face
the board, the others telephone and face anywhere.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.spatial import Delaunay

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.scene import Scene, SceneFrame

SIDE_M: Final = 8.0
"""Side of the square that the crowd fills; with the margin it fits a tracking area of 10 m."""
ROOM_SIDE_M: Final = 10.0
SPACING_M: Final = 0.68
"""Least distance between two people; fills of other densities than these are drawn again."""
DENSITY_PER_M2: Final = 1.47
DENSITY_WITHIN_PER_M2: Final = 0.06
CONFIGURATIONS: Final = 8
TRAINING_CONFIGURATION: Final = 0
START_M: Final = (-4.45, 4.45)
"""The mark on the floor (x, z): outside one corner of the crowd."""
BOARD_M: Final = (5.1, 2.3, -5.1)
"""Centre of the timetable board."""
READING_M: Final = (4.35, -4.35)
"""A place (x, z) before the board from which it is comfortably read."""
READ_WITHIN_M: Final = 2.0
"""The board shows the track number to a participant at most this far away (on the floor)."""
MIN_DENSITY_PER_M2: Final = 0.3
MAX_DENSITY_PER_M2: Final = 2.5
"""At more, neighbours' bodies would overlap."""
BODY_WIDTH_M: Final = 0.45
BODY_DEPTH_M: Final = 0.25

WAITING: Final = 0
PHONING: Final = 1
BEHAVIOURS: Final = ("waiting", "phoning")
CHARACTERS: Final = (
    *(f"female_{i:02d}" for i in range(1, 7)),
    *(f"male_{i:02d}" for i in range(1, 7)),
)
"""Models that play the people: six women and six men."""

UNLIKE_WITHIN_M: Final = 3.0
"""No two people who look alike stand nearer to each other."""
SAME_FACE_WITHIN_M: Final = 1.8
"""No two people with the same face stand nearer to each other, as long as there are others."""
WITHIN_STEP_M: Final = 0.05
"""Where there are fewer bodies, their least distance is sought from `UNLIKE_WITHIN_M` down in
such steps: with eleven bodies two of one stand 2.3 m apart or more.
"""

_LAYOUT_SEED = 20201
_CANDIDATES = 60
_NO_EYES = np.empty((0, 3)), np.empty(0)


@dataclass(frozen=True, eq=False)
class Crowd:
    """n people standing in place.

    `position_m` (n, 2) x and z on the floor; `yaw_rad` (n,) turn about +y, 0 faces −z;
    `stature_m` (n,) of the characters who play them; `behaviour` (n,) index into `BEHAVIOURS`;
    `character` (n,) index into `CHARACTERS`; `outfit` (n,) which of their clothes they wear, so
    that no two who look alike are within `UNLIKE_WITHIN_M`; `seed` (n,) decides each one's idle
    motion. `spacing_m` is the least distance between two of them.
    """

    configuration: int
    position_m: Vector
    yaw_rad: Vector
    stature_m: Vector
    behaviour: npt.NDArray[np.int64]
    character: npt.NDArray[np.int64]
    seed: npt.NDArray[np.int64]
    outfit: npt.NDArray[np.int64]
    spacing_m: float = SPACING_M

    def __len__(self) -> int:
        return len(self.position_m)

    @cached_property
    def neighbours(self) -> npt.NDArray[np.int64]:
        """Pairs (k, 2) of people with nobody between them: Delaunay edges, rising.

        Edges longer than two spacings are left out: they run along the rim of the crowd.
        """
        triangles = Delaunay(self.position_m).simplices
        edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        pairs: npt.NDArray[np.int64] = np.unique(np.sort(edges, axis=1), axis=0).astype(np.int64)
        a, b = self.position_m[pairs].transpose(1, 0, 2)
        near: npt.NDArray[np.int64] = pairs[np.linalg.norm(a - b, axis=1) <= 2 * self.spacing_m]
        return near


@dataclass(frozen=True)
class CrowdScene(Scene):
    """A station with a crowd; `crowd` is None while nobody is shown."""

    crowd: Crowd | None = None
    dressed_by: str = "visavis.stimuli.dressing.station:station_picture"

    @property
    def stand_m(self) -> Vector:
        """Where the people of the crowd stand."""
        return np.empty((0, 2)) if self.crowd is None else self.crowd.position_m


@dataclass(frozen=True, slots=True)
class CrowdFrame(SceneFrame):
    """The station in one frame.

    `crowd_t_ns` is the time of the people's idle motion, from the trial's start;
    `track` the number on the board, None where the board shows nothing.
    """

    crowd_t_ns: int = 0
    track: str | None = None


def station_frame(
    scene: CrowdScene, t_ns: int, crowd_t_ns: int = 0, track: str | None = None
) -> CrowdFrame:
    """Return the station at a time; its people's eyes are not led one by one."""
    return CrowdFrame(scene, t_ns, *_NO_EYES, crowd_t_ns=crowd_t_ns, track=track)


def max_people(density: float) -> int:
    """Return at most how many people stand in a crowd of so many per square metre."""
    return int(SIDE_M**2 * density * (1 + DENSITY_WITHIN_PER_M2 / DENSITY_PER_M2))


def spacing_for(density: float) -> float:
    """Return the least distance (m) between people that gives about so many per square metre.

    From how many the published spacing holds; those along the rim take space on one side only.
    """
    if density == DENSITY_PER_M2:
        return SPACING_M
    per_row = (1 + SIDE_M / SPACING_M) * np.sqrt(density / DENSITY_PER_M2)
    return float(SIDE_M / (per_row - 1))


@cache
def station_crowd(configuration: int, density: float = DENSITY_PER_M2) -> Crowd:
    """Return a crowd: 1 to 8 as in the study, 0 for training; of so many people per square metre.

    Raises:
        DesignError: there is no such configuration, or no crowd so thin or dense.
    """
    if not MIN_DENSITY_PER_M2 <= density <= MAX_DENSITY_PER_M2:
        raise DesignError(
            f"there is no crowd of {density:g} people per square metre; choose "
            f"{MIN_DENSITY_PER_M2:g} to {MAX_DENSITY_PER_M2:g}"
        )
    if not 0 <= configuration <= CONFIGURATIONS:
        raise DesignError(
            f"there is no crowd configuration {configuration}; choose 1 to {CONFIGURATIONS}, "
            f"or {TRAINING_CONFIGURATION} for training"
        )
    rng = np.random.default_rng(np.random.SeedSequence(_LAYOUT_SEED, spawn_key=(configuration,)))
    spacing_m = spacing_for(density)
    within = DENSITY_WITHIN_PER_M2 * density / DENSITY_PER_M2
    while True:
        position = poisson_disk(SIDE_M, spacing_m, rng) - SIDE_M / 2
        n = len(position)
        if abs(n / SIDE_M**2 - density) <= within:
            break
    behaviour = (rng.random(n) < 0.5).astype(np.int64)
    to_board = np.array([BOARD_M[0], BOARD_M[2]]) - position
    facing = np.arctan2(-to_board[:, 0], -to_board[:, 1]) + np.radians(12) * rng.standard_normal(n)
    anywhere = 2 * np.pi * rng.random(n)
    character = _cast(position, rng.integers(0, len(CHARACTERS), n))
    stature = np.array([default_casting(CHARACTERS[c]).stature_m for c in character])
    return Crowd(
        configuration=configuration,
        position_m=position,
        yaw_rad=np.where(behaviour == WAITING, facing, anywhere),
        stature_m=stature,
        behaviour=behaviour,
        character=character,
        seed=rng.integers(0, 2**31, n),
        outfit=_outfits(position, character),
        spacing_m=spacing_m,
    )


def _cast(position_m: Vector, random_cast: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return who plays whom: as drawn, but those of one body as far apart as their number allows.

    A cast with a body for each of `CHARACTERS` keeps `SAME_FACE_WITHIN_M`.
    """
    skeletons = [default_casting(name).skeleton for name in CHARACTERS]
    first = np.array([next(j for j, s in enumerate(skeletons) if s is own) for own in skeletons])
    bodies = np.unique(first)
    if len(bodies) == len(CHARACTERS):
        return _keep_apart(position_m, random_cast)
    body_choice = np.searchsorted(bodies, first[random_cast])
    for within_m in np.arange(UNLIKE_WITHIN_M, 0.0, -WITHIN_STEP_M).tolist():
        body_of = _all_apart(position_m, body_choice, len(bodies), within_m)
        if body_of is not None:
            return bodies[body_of]
    return bodies[body_choice]


def _all_apart(
    position_m: Vector, body_choice: npt.NDArray[np.int64], bodies: int, within_m: float
) -> npt.NDArray[np.int64] | None:
    """Return bodies so that no two alike stand within a distance, the hardest places first (Brélaz
    1979); None where that finds none.
    """
    near = np.linalg.norm(position_m[:, None] - position_m, axis=2) <= within_m
    body = np.full(len(body_choice), -1)
    is_free = np.ones((len(body_choice), bodies), np.bool_)
    for _ in range(len(body_choice)):
        left = np.where(body < 0, is_free.sum(axis=1), bodies + 1)
        i = int(np.lexsort((-near.sum(axis=1), left))[0])
        turns = (body_choice[i] + np.arange(bodies)) % bodies
        free = turns[is_free[i, turns]]
        if not len(free):
            return None
        body[i] = free[0]
        is_free[near[i], free[0]] = False
    return body


def _keep_apart(position_m: Vector, random_cast: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return who plays whom: as drawn, or the next of `CHARACTERS` where that face is near."""
    character = random_cast.copy()
    for i in range(len(random_cast)):
        away = np.linalg.norm(position_m[:i] - position_m[i], axis=1)
        nearest = np.array(
            [away[character[:i] == c].min(initial=np.inf) for c in range(len(CHARACTERS))]
        )
        turns = (random_cast[i] + np.arange(len(CHARACTERS))) % len(CHARACTERS)
        free = turns[nearest[turns] > SAME_FACE_WITHIN_M]
        character[i] = free[0] if len(free) else turns[nearest[turns].argmax()]
    return character


def _outfits(position_m: Vector, character: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return for each person the first outfit that nobody of the same body wears nearby."""
    outfit = np.zeros(len(character), np.int64)
    for i in range(len(character)):
        away = np.linalg.norm(position_m[:i] - position_m[i], axis=1)
        near = (away <= UNLIKE_WITHIN_M) & (character[:i] == character[i])
        nearby_outfits = set(outfit[:i][near].tolist())
        outfit[i] = next(k for k in range(len(character)) if k not in nearby_outfits)
    return outfit


def poisson_disk(side_m: float, spacing_m: float, rng: np.random.Generator) -> Vector:
    """Fill a square from 0 to `side_m` with points (n, 2) at least `spacing_m` apart.

    After Bridson 2007: new points between one and two spacings from an old one, until none of
    60 candidates fits anywhere.
    """
    points = [side_m * rng.random(2)]
    active = [0]
    while active:
        at = int(rng.random() * len(active))
        turn = 2 * np.pi * rng.random(_CANDIDATES)
        reach = spacing_m * np.sqrt(1 + 3 * rng.random(_CANDIDATES))
        candidates = points[active[at]] + reach[:, None] * np.stack(
            [np.cos(turn), np.sin(turn)], axis=1
        )
        inside = ((candidates >= 0) & (candidates <= side_m)).all(axis=1)
        distance_m = np.linalg.norm(candidates[:, None] - np.array(points), axis=2).min(axis=1)
        fits = np.flatnonzero(inside & (distance_m >= spacing_m))
        if fits.size:
            active.append(len(points))
            points.append(candidates[fits[0]])
        else:
            active.pop(at)
    return np.array(points)


def density_per_m2(crowd: Crowd) -> float:
    """Return people per square metre of the square they fill."""
    return len(crowd) / SIDE_M**2


def body_radius_m(crowd: Crowd, person: npt.NDArray[np.int64], direction: Vector) -> Vector:
    """Return how far the body ellipses of people (k,) reach along unit directions (k, 2)."""
    yaw = crowd.yaw_rad[person]
    aside = np.stack([np.cos(yaw), -np.sin(yaw)], axis=1)
    along = np.abs((direction * aside).sum(axis=1))
    forward = np.sqrt(np.maximum(1 - along**2, 0))
    reach: Vector = 1 / np.hypot(along / (BODY_WIDTH_M / 2), forward / (BODY_DEPTH_M / 2))
    return reach


def can_read(x_m: float, z_m: float) -> bool:
    """Tell whether the board shows its number to somebody who stands there."""
    return bool(np.hypot(x_m - BOARD_M[0], z_m - BOARD_M[2]) <= READ_WITHIN_M)


def in_room(position_m: Vector) -> npt.NDArray[np.bool_]:
    """Tell which places (..., 2) x and z lie in the room that can be walked."""
    return np.asarray((np.abs(position_m) <= ROOM_SIDE_M / 2).all(axis=-1))


EMPTY_STATION: Final = CrowdScene(name="station_empty", agents=(), brightness_01=1.0)

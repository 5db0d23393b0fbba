"""A seated audience of eleven that the participant faces, as geometry.

World frame: the participant's eyes are at `PARTICIPANT_EYE_M`, their view axis is −z. The room's
own axis, on which the speaker's stage and the audience are laid out, is turned
`PARTICIPANT_TURN_DEG` to the left of it: the participant has turned right towards the audience,
which in turn is turned `AUDIENCE_TURN_DEG` to its own right. Bearings are positive to the
participant's right.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg
from visavis.stimuli.scene import Agent, Capsule, Scene

PARTICIPANT_EYE_M: Final = np.array([0.0, 1.2, 0.0])
PARTICIPANT_TURN_DEG: Final = 20.0
AUDIENCE_TURN_DEG: Final = 10.0
HEAD_RADIUS_M: Final = 0.12
EYE_FORWARD_M: Final = 0.09
EYE_UP_M: Final = 0.02
MARK_ELEVATION_DEG: Final = 20.0
MARK_DISTANCE_M: Final = 2.0

DRESSED_BY: Final = "visavis.stimuli.dressing.audience:audience_picture"


@dataclass(frozen=True)
class Seat:
    """Where a head is: bearing from the view axis (right positive), horizontal distance, height."""

    zone: str
    depth: str
    bearing_deg: float
    distance_m: float
    head_height_m: float


SEATS: Final[dict[str, Seat]] = {
    "left_close": Seat("left", "close", -33.0, 1.60, 1.12),
    "left_middle": Seat("left", "middle", -30.5, 2.45, 1.47),
    "left_far": Seat("left", "far", -23.0, 3.40, 1.79),
    "centre_close": Seat("centre", "close", -11.0, 1.40, 1.10),
    "centre_middle": Seat("centre", "middle", -3.0, 2.35, 1.45),
    "centre_far": Seat("centre", "far", -9.5, 3.25, 1.77),
    "right_close": Seat("right", "close", 10.0, 1.60, 1.12),
    "right_middle": Seat("right", "middle", 14.5, 2.50, 1.48),
    "right_far": Seat("right", "far", 7.5, 3.40, 1.80),
    "edge_left": Seat("left", "middle", -41.5, 2.90, 1.48),
    "back_centre": Seat("centre", "far", -16.0, 4.10, 2.06),
}
"""The eleven places; the rows stand on steps of a wooden stage, so no head hides another."""

PLACES: Final[tuple[str, ...]] = tuple(SEATS)
ACTIVE_PLACES: Final[tuple[str, ...]] = PLACES[:9]
"""The nine places that can hold the active agent: three zones × three depths."""


def _from_bearing(bearing_deg: float, distance_m: float, height_m: float) -> Vector:
    ground = direction_from_yaw_pitch_deg(-bearing_deg, 0.0) * distance_m
    return np.array([ground[0], height_m, ground[2]])


SPEAKER_EYE_M: Final = _from_bearing(-148.7, 2.56, 1.62)
"""The eyes of the speaker, standing behind the participant on the left: where averted agents
look."""

MARK_M: Final = (
    PARTICIPANT_EYE_M + direction_from_yaw_pitch_deg(0.0, MARK_ELEVATION_DEG) * MARK_DISTANCE_M
)
"""The fixation mark between trials, above the middle of the view and above every head."""

for _point in (PARTICIPANT_EYE_M, SPEAKER_EYE_M, MARK_M):
    _point.setflags(write=False)


def zone_of(place: str) -> str:
    """Return "left", "centre" or "right"."""
    return _seat(place).zone


def depth_of(place: str) -> str:
    """Return "close", "middle" or "far"."""
    return _seat(place).depth


def _seat(place: str) -> Seat:
    try:
        return SEATS[place]
    except KeyError:
        names = ", ".join(PLACES)
        raise DesignError(f"the audience has no place {place!r}; choose one of {names}") from None


def _yaw_to_speaker_deg(seat: Seat) -> float:
    head = _from_bearing(seat.bearing_deg, seat.distance_m, seat.head_height_m)
    way = SPEAKER_EYE_M - head
    # As headings are counted here: 0 looks towards +z, positive is the participant's left.
    return float(np.degrees(np.arctan2(-way[0], way[2])))


def _facing(seat: Seat) -> Vector:
    """Return where a head points in all conditions: as far beside the speaker from every seat, so
    that no seat asks for more of averted eyes than another; the mean is `AUDIENCE_TURN_DEG`.
    """
    mean_deg = sum(_yaw_to_speaker_deg(s) for s in SEATS.values()) / len(SEATS)
    heading_deg = PARTICIPANT_TURN_DEG - AUDIENCE_TURN_DEG + mean_deg - _yaw_to_speaker_deg(seat)
    # In the room's frame a head with turn 0 faces the participant's side along the room's axis.
    return direction_from_yaw_pitch_deg(heading_deg, 0.0) * [-1.0, 1.0, -1.0]


@lru_cache(maxsize=256)
def agent_at(row: int, character: str) -> Agent:
    """Return the agent at `PLACES[row]`, played by a character; the same object comes back."""
    place = PLACES[row]
    seat = SEATS[place]
    head = _from_bearing(seat.bearing_deg, seat.distance_m, seat.head_height_m)
    facing = _facing(seat)
    eyes = head + EYE_FORWARD_M * facing + np.array([0.0, EYE_UP_M, 0.0])
    for array in (head, facing, eyes):
        array.setflags(write=False)
    return Agent(
        agent_id=f"agent_{row + 1:02d}",
        character=character,
        place=place,
        head_centre_m=head,
        head_radius_m=HEAD_RADIUS_M,
        facing=facing,
        eye_centre_m=eyes,
    )


def _torso(head_centre_m: Vector) -> Capsule:
    return Capsule(
        head_centre_m - np.array([0.0, 0.65, 0.0]), head_centre_m - np.array([0.0, 0.37, 0.0]), 0.19
    )


def stage_front_occluders() -> tuple[Capsule, ...]:
    """Return the wooden front between participant and audience, three beams high."""
    heights_m = (0.68, 0.45, 0.22)
    left, right = (_from_bearing(b, 1.5, 0.0) for b in (-75.0, 60.0))
    corner = _from_bearing(-10.0, 1.0, 0.0)
    return tuple(
        Capsule(a + np.array([0.0, h, 0.0]), b + np.array([0.0, h, 0.0]), 0.12)
        for h in heights_m
        for a, b in ((left, corner), (corner, right))
    )


@lru_cache(maxsize=4)
def _occluders(people: int) -> tuple[Capsule, ...]:
    torsos = tuple(
        _torso(_from_bearing(s.bearing_deg, s.distance_m, s.head_height_m))
        for s in list(SEATS.values())[:people]
    )
    feet = SPEAKER_EYE_M * np.array([1.0, 0.0, 1.0]) + np.array([0.0, 0.2, 0.0])
    return (*torsos, *stage_front_occluders(), Capsule(feet, SPEAKER_EYE_M, 0.2))


def audience_scene(characters: Sequence[str], *, name: str = "audience") -> Scene:
    """Return the lit audience; `characters[i]` plays the agent at `PLACES[i]`.

    The same object comes back for the same characters. Raises DesignError unless there are nine
    to eleven different ones: without the last, the places that never hold the active agent stay
    empty.
    """
    return _scene(tuple(characters), name, 1.0, False)


def training_scene(characters: Sequence[str]) -> Scene:
    """Return the audience of the training phase; the same geometry under its own name."""
    return _scene(tuple(characters), "training", 1.0, False)


def black_scene(characters: Sequence[str]) -> Scene:
    """Return the dark scene between trials: nothing visible but the mark at top centre."""
    return _scene(tuple(characters), "intertrial", 0.0, True)


@lru_cache(maxsize=512)
def _scene(characters: tuple[str, ...], name: str, brightness_01: float, has_mark: bool) -> Scene:
    people = len(characters)
    if not len(ACTIVE_PLACES) <= people <= len(PLACES) or len(set(characters)) != people:
        raise DesignError(
            f"an audience needs {len(ACTIVE_PLACES)} to {len(PLACES)} different characters, one a "
            f"place; got {people}: {', '.join(characters)}"
        )
    return Scene(
        name=name,
        agents=tuple(agent_at(i, c) for i, c in enumerate(characters)),
        occluders=_occluders(people),
        brightness_01=brightness_01,
        mark_m=MARK_M if has_mark else None,
        dressed_by=DRESSED_BY,
    )

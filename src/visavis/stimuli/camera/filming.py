"""Cameras that film a moving person among other people.

The director cuts and moves along the place's own tracks. Two other cameras serve for comparison:
one that follows behind, and several placed by hand that take turns. All of them expect rising times
and decide thirty times a second, at any rate of the film.
"""

from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, unit, yaw_pitch_deg_of
from visavis.stimuli.camera.director import (
    DECISIONS_PER_S,
    HEAD_SHARE,
    CameraView,
    FilmedPlace,
    Moment,
)
from visavis.stimuli.camera.floors import walkable_floors
from visavis.stimuli.camera.following import pull
from visavis.stimuli.camera.graph import floor_table, roadmap, small_triangles
from visavis.stimuli.camera.obstacles import Obstacles
from visavis.stimuli.camera.shots import HEIGHT_SHARE, ShotSize, shot_distance_m, shot_size_score
from visavis.stimuli.picture import Camera, Picture, Room

PERSON_RADIUS_M: Final = 0.22
TOP_ABOVE_HIPS_M: Final = 0.72
FROM_ABOVE_FLOOR_M: Final = 0.3
FACES_RAD_S: Final = 3.0
"""How quickly a camera behind somebody comes round when they turn."""
FOLLOWS_RAD_S: Final = 4.0
TURNS_RAD_S: Final = 6.0
KEEPS_M: Final = 0.2
"""How far before a surface a camera behind somebody stays."""
LOST_S: Final = 0.2
BETTER_BY: Final = 0.3
"""Difference in score at which the picture changes to another camera."""
BETTER_FOR_S: Final = 1.0


class FilmingCamera(Protocol):
    """A camera that films; ask for rising times."""

    def view_at(self, t_ns: int) -> CameraView:
        """Return the camera at a time, at or after those asked before."""
        ...

    @property
    def cut_ns(self) -> tuple[int, ...]:
        """When it cut so far; the beginning is not a cut."""
        ...


def capsules(picture: Picture) -> Vector:
    """Return one upright capsule (n, 7) for everybody."""
    root = picture.people.root_m
    low, high = root.copy(), root.copy()
    low[:, 1], high[:, 1] = FROM_ABOVE_FLOOR_M, root[:, 1] + TOP_ABOVE_HIPS_M
    return np.concatenate([low, high, np.full((len(root), 1), PERSON_RADIUS_M)], axis=1)


def camera_of_view(view: CameraView, fov_v_deg: float, aspect: float) -> Camera:
    """Return a level camera at a view's place that looks at its point."""
    yaw_deg, pitch_deg = yaw_pitch_deg_of(unit(view.looks_at_m - view.position_m))
    turn = quat_from_yaw_pitch_deg(float(yaw_deg), float(pitch_deg))
    top = float(np.tan(np.radians(fov_v_deg) / 2))
    return Camera(Pose(view.position_m, turn), -top * aspect, top * aspect, -top, top)


def scattered_places(
    room: Room, place: FilmedPlace, seed: int = 0, *, per_m2: float = 1.5, link_m: float = 5.0
) -> FilmedPlace:
    """Return a place with camera positions scattered at random in place of its tracks.

    A probabilistic roadmap, with the published system's density and length of links.
    """
    (floor, *_) = walkable_floors(room)
    graph = roadmap(floor, place.obstacles, seed, per_m2=per_m2, link_m=link_m)
    table = floor_table(graph, small_triangles(floor), place.obstacles, seed)
    return FilmedPlace.of_graph(place.obstacles, graph, table)


class Follower:
    """Follows behind somebody without a cut, nearer where a surface stands between.

    It is `back_m` behind, `above_m` over the head and `right_m` to their right; `front_at` tells
    the unit direction (3,) to which the subject's body faces.
    """

    def __init__(
        self,
        obstacles: Obstacles,
        moment_at: Callable[[int], Moment],
        front_at: Callable[[int], Vector],
        *,
        back_m: float = 2.6,
        above_m: float = 0.35,
        right_m: float = 0.45,
        start_ns: int = 0,
    ) -> None:
        self._obstacles, self._away_m = obstacles, (back_m, above_m, right_m)
        self._moment_at, self._front_at = moment_at, front_at
        self._start_ns, self._tick = start_ns, 0
        self._front, self._turning = front_at(start_ns), np.zeros(3)
        self._goal, self._looks_at = self._goal_at(start_ns)
        self._place, self._speed = self._goal, np.zeros(3)
        self._look, self._looking = self._looks_at, np.zeros(3)

    @property
    def cut_ns(self) -> tuple[int, ...]:
        """It never cuts."""
        return ()

    def view_at(self, t_ns: int) -> CameraView:
        """Return the camera at a time, at or after those asked before."""
        while self._time_of(self._tick + 1) <= t_ns:
            t = self._time_of(self._tick + 1)
            self._place, self._speed, self._look, self._looking = self._state_at(t)
            self._front, self._turning = pull(
                self._front, self._turning, self._front_at(t), 1 / DECISIONS_PER_S, FACES_RAD_S
            )
            self._tick += 1
            self._goal, self._looks_at = self._goal_at(t)
        place, _, look, _ = self._state_at(t_ns)
        return CameraView(place, look)

    def _time_of(self, tick: int) -> int:
        return self._start_ns + tick * NS_PER_S // DECISIONS_PER_S

    def _state_at(self, t_ns: int) -> tuple[Vector, Vector, Vector, Vector]:
        dt_s = (t_ns - self._time_of(self._tick)) / NS_PER_S
        place, speed = pull(self._place, self._speed, self._goal, dt_s, FOLLOWS_RAD_S)
        place = self._before_surfaces(place)
        return (place, speed, *pull(self._look, self._looking, self._looks_at, dt_s, TURNS_RAD_S))

    def _before_surfaces(self, place: Vector) -> Vector:
        """Return the place, or one nearer to the head where a surface stands between."""
        away = place - self._head
        length = float(np.linalg.norm(away))
        free = self._obstacles.hit_m(self._head, away / length, length + KEEPS_M) - KEEPS_M
        nearer: Vector = self._head + away / length * max(0.1, min(length, free))
        return nearer

    def _goal_at(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return where the camera should be, and the point it should look at."""
        moment, (back_m, above_m, right_m) = self._moment_at(t_ns), self._away_m
        front = unit(self._front * np.array([1.0, 0.0, 1.0]))
        right = np.array([-front[2], 0.0, front[0]])
        head = moment.subject_m + np.array([0.0, HEAD_SHARE * moment.height_m, 0.0])
        away = right_m * right - back_m * front + np.array([0.0, above_m, 0.0])
        self._head = head
        return self._before_surfaces(head + away), head + 1.0 * front - np.array(
            [0.0, 0.25 * moment.height_m, 0.0]
        )


class TakingTurns:
    """Cameras placed by hand that turn to somebody; the picture is of the one that shows them best.

    A camera's score is how well the size of the shot fits, 0 where something hides the subject. The
    picture changes when the subject has been hidden for 0.2 s, or another camera has been clearly
    better for a second, and never within `min_shot_s`.
    """

    def __init__(
        self,
        obstacles: Obstacles,
        places_m: tuple[tuple[float, float, float], ...],
        moment_at: Callable[[int], Moment],
        *,
        shot: ShotSize = ShotSize.LONG,
        fov_v_deg: float = 40.0,
        min_shot_s: float = 2.0,
        start_ns: int = 0,
    ) -> None:
        if not places_m:
            raise DesignError("no camera was placed; name at least one place (x, y, z) in metres")
        self._obstacles, self._places = obstacles, np.array(places_m, np.float64)
        self._moment_at, self._start_ns, self._tick = moment_at, start_ns, 0
        self._shot, self._fov_v_deg, self._min_shot_s = shot, fov_v_deg, min_shot_s
        self._cut_ns: list[int] = []
        self._since = self._hidden_ticks = self._beaten = 0
        self._centre, scores = self._meet(start_ns)
        self._current = int(np.argmax(scores))
        self._look, self._turning = self._centre, np.zeros(3)

    @property
    def cut_ns(self) -> tuple[int, ...]:
        """When the picture changed to another camera so far."""
        return tuple(self._cut_ns)

    def view_at(self, t_ns: int) -> CameraView:
        """Return the camera at a time, at or after those asked before."""
        while self._time_of(self._tick + 1) <= t_ns:
            t = self._time_of(self._tick + 1)
            self._look, self._turning = self._looks(t)
            self._tick += 1
            self._decide(t)
        return CameraView(self._places[self._current].copy(), self._looks(t_ns)[0])

    def _time_of(self, tick: int) -> int:
        return self._start_ns + tick * NS_PER_S // DECISIONS_PER_S

    def _looks(self, t_ns: int) -> tuple[Vector, Vector]:
        dt_s = (t_ns - self._time_of(self._tick)) / NS_PER_S
        return pull(self._look, self._turning, self._centre, dt_s, TURNS_RAD_S)

    def _meet(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return the middle of the subject, and every camera's score."""
        moment, share = self._moment_at(t_ns), HEIGHT_SHARE[self._shot]
        up = np.array([0.0, moment.height_m, 0.0])
        centre = moment.subject_m + max(0.5, 1.0 - 0.4 / share) * up
        head = moment.subject_m + HEAD_SHARE * up
        wanted_m = shot_distance_m(moment.height_m, self._fov_v_deg, share)
        scores = [
            (0.1 + shot_size_score(float(np.linalg.norm(place - centre)), wanted_m))
            * self._obstacles.sees(place, head, moment.people)
            for place in self._places
        ]
        return centre, np.array(scores)

    def _decide(self, t_ns: int) -> None:
        self._centre, scores = self._meet(t_ns)
        best = int(np.argmax(scores))
        self._hidden_ticks = self._hidden_ticks + 1 if scores[self._current] == 0.0 else 0
        is_beaten = scores[best] > scores[self._current] + BETTER_BY
        self._beaten = self._beaten + 1 if is_beaten else 0
        is_lost = self._hidden_ticks > LOST_S * DECISIONS_PER_S
        beaten = self._beaten > BETTER_FOR_S * DECISIONS_PER_S
        is_due = self._tick - self._since >= self._min_shot_s * DECISIONS_PER_S
        if best != self._current and is_due and (is_lost or beaten):
            self._current, self._since = best, self._tick
            self._hidden_ticks = self._beaten = 0
            self._look, self._turning = self._centre, np.zeros(3)
            self._cut_ns.append(t_ns)

"""What a film by a moving camera shows: the camera's poses and what was seen from there.

The camera runs once, picture by picture, so that the same film always looks the same.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector, rotate
from visavis.lab.yaml_lines import did_you_mean
from visavis.stimuli.camera.director import Director, FilmedPlace, Moment, Style, prepare
from visavis.stimuli.camera.filming import (
    FilmingCamera,
    Follower,
    TakingTurns,
    camera_of_view,
    capsules,
    scattered_places,
)
from visavis.stimuli.camera.obstacles import Obstacles
from visavis.stimuli.camera.sheet import FilmLog, Sheet
from visavis.stimuli.dressing.office import look_of
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.picture import Camera, Picture, Room
from visavis.study.dry_run import still_view
from visavis.study.films import Directed, Film, Following, Lens, Moving
from visavis.study.scenes import StagedScene

EYES_SHARE: Final = 0.936
"""Height of the eyes as a share of the whole person's."""


@dataclass(frozen=True, eq=False)
class FilmSeen:
    """What the pictures of a film show, one row for each picture.

    `t_s` (n,) is its time and `cameras` its camera. `is_visible` (n,) tells whether the head of the
    person filmed is in the picture and unoccluded, `height_01` (n,) their height as a share of the
    picture's, and `cut` (n,) whether the picture is the first of a new shot.
    """

    t_s: npt.NDArray[np.float64]
    cameras: tuple[Camera, ...]
    is_visible: npt.NDArray[np.bool_]
    height_01: npt.NDArray[np.float64]
    cut: npt.NDArray[np.bool_]
    sheet: Sheet

    @cached_property
    def poses(self) -> Vector:
        """Place and turn (n, 7) of the camera."""
        poses: Vector = np.array(
            [[*c.pose.position_m, *c.pose.orientation_wxyz] for c in self.cameras]
        )
        return poses


class _Subject:
    """The person that a film follows, in pictures of a scene at any time."""

    def __init__(self, film: Film, staged_scene: StagedScene, role: str) -> None:
        first = staged_scene.frame(still_view(0), 0)
        if first is None:
            raise DesignError(f"scene {film.scene.name} shows nothing at its onset")
        if role not in staged_scene.roles:
            raise DesignError(
                f"scene {film.scene.name} has nobody who is {role!r} to film"
                f"{did_you_mean(role, staged_scene.roles)}"
            )
        self._frame, self.index = first, staged_scene.roles[role]
        self.picture_at: Callable[[int], Picture] = lru_cache(maxsize=4)(self._draw_picture)
        self.height_m = float(self.eyes_m(0)[1]) / EYES_SHARE

    def _draw_picture(self, t_ns: int) -> Picture:
        return picture_of(replace(self._frame, t_ns=t_ns))

    def eyes_m(self, t_ns: int) -> Vector:
        """Return the middle between the eyes (3,)."""
        picture, i = self.picture_at(t_ns), self.index
        people = picture.people
        return look_of(picture.cast[i], people.root_m[i], people.orientation_wxyz[i])[1]

    def front(self, t_ns: int) -> Vector:
        """Return the direction (3,) to which the body faces."""
        turn = self.picture_at(t_ns).people.orientation_wxyz[self.index, 0]
        front: Vector = rotate(turn, np.array([0.0, 0.0, -1.0]))
        return front

    def others(self, t_ns: int) -> Vector:
        """Return the capsules (n, 7) of everybody else."""
        return np.delete(capsules(self.picture_at(t_ns)), self.index, axis=0)

    def moment(self, t_ns: int) -> Moment:
        """Return the positions of everybody at a time, as cameras get them."""
        eyes = self.eyes_m(t_ns)
        return Moment(np.array([eyes[0], 0.0, eyes[2]]), self.height_m, self.others(t_ns))


def film_scene(film: Film, staged_scene: StagedScene) -> FilmSeen:
    """Film a scene by a moving camera.

    Raises:
        DesignError: nobody in the scene plays the subject, or the room has no place from where the
            camera could film.
    """
    lens = film.lens
    if isinstance(lens, Lens):
        raise DesignError("a lens that stands still films nobody; give the film a moving camera")
    subject = _Subject(film, staged_scene, lens.subject)
    room = subject.picture_at(0).room
    obstacles = _obstacles_of(room)
    camera = _camera(lens, room, obstacles, subject)
    aspect = film.size_px[0] / film.size_px[1]
    log = FilmLog(lens.shot)
    cameras, heights = [], []
    for k in range(film.frame_count):
        t_ns = k * NS_PER_S // film.rate_hz
        shot = camera_of_view(camera.view_at(t_ns), lens.fov_v_deg, aspect)
        cameras.append(shot)
        eyes, others = subject.eyes_m(t_ns), subject.others(t_ns)
        log.add(t_ns, shot, eyes, room, others)
        is_seen = _is_in(shot, eyes) and obstacles.sees(shot.pose.position_m, eyes, others)
        log.visibility.append((t_ns, is_seen))
        apart_m = float(np.linalg.norm(shot.pose.position_m - eyes))
        heights.append(subject.height_m / (2 * max(apart_m, 1e-3) * shot.top))
    times = np.array(log.t_ns)
    cut = np.zeros(len(times), np.bool_)
    at = np.searchsorted(times, camera.cut_ns)
    cut[at[at < len(times)]] = True
    return FilmSeen(
        times / NS_PER_S,
        tuple(cameras),
        np.array([s for _, s in log.visibility]),
        np.array(heights),
        cut,
        log.sheet(np.array(camera.cut_ns, np.int64)),
    )


def _camera(lens: Moving, room: Room, obstacles: Obstacles, subject: _Subject) -> FilmingCamera:
    if isinstance(lens, Directed):
        style = Style(lens.shot, cuts=lens.cuts, moves=lens.moves, fov_v_deg=lens.fov_v_deg)
        place = _place_of(room)
        if lens.over == "scattered":
            place = _scattered_of(room, lens.seed)
        return Director(place, style, subject.moment, seed=lens.seed)
    if isinstance(lens, Following):
        return Follower(
            obstacles,
            subject.moment,
            subject.front,
            back_m=lens.back_m,
            above_m=lens.above_m,
            right_m=lens.right_m,
        )
    return TakingTurns(
        obstacles,
        lens.places_m,
        subject.moment,
        shot=lens.shot,
        fov_v_deg=lens.fov_v_deg,
        min_shot_s=lens.min_shot_s,
    )


def _is_in(camera: Camera, place_m: Vector) -> bool:
    """Tell whether a place (3,) lies within the picture's edges."""
    w, x, y, z = camera.pose.orientation_wxyz
    own = rotate(np.array([w, -x, -y, -z]), place_m - camera.pose.position_m)
    if own[2] >= -camera.near_m:
        return False
    right, up = own[0] / -own[2], own[1] / -own[2]
    return bool(camera.left <= right <= camera.right and camera.bottom <= up <= camera.top)


# Rooms are shared objects, so that the result for one serves every film in it.
@lru_cache(maxsize=4)
def _obstacles_of(room: Room) -> Obstacles:
    return Obstacles.of_room(room)


@lru_cache(maxsize=4)
def _place_of(room: Room) -> FilmedPlace:
    return prepare(room)


@lru_cache(maxsize=4)
def _scattered_of(room: Room, seed: int) -> FilmedPlace:
    return scattered_places(room, _place_of(room), seed)

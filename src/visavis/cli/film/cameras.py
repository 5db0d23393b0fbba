"""Cameras of films; each is asked for its view at rising times."""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from visavis.cli.preview.pictures import Viewpoint, camera_of, symmetric_camera
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError, UsageError
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, rotate, yaw_pitch_deg_of
from visavis.stimuli.camera.director import (
    CameraView,
    Director,
    FilmedPlace,
    Moment,
    Style,
    prepare,
)
from visavis.stimuli.camera.filming import camera_of_view, capsules
from visavis.stimuli.camera.shots import ShotSize
from visavis.stimuli.picture import Camera, Picture, Room
from visavis.stimuli.surfaces import Surfaces
from visavis.study.parts import Posture

FOLLOW_BACK_M: Final = 1.6
FOLLOW_UP_M: Final = 0.4
FOLLOW_TANGENT: Final = 0.6
FOLLOW_CLEAR_M: Final = 0.25
"""How far before a surface the camera over the shoulder stays."""
HEAD_ABOVE_EYES: Final = 1 / 0.936
PEOPLE_EVERY_NS: Final = NS_PER_S // 5
"""How often people who may hide the subject are looked at again."""


class CameraKind(StrEnum):
    """Cameras that films know by name; any other is the file of a film's decisions.

    By default a film of somebody seated takes the camera that follows, over their shoulder; another
    film the topology camera, or orbit where that finds no place to stand.
    """

    AUTO = "auto"
    TOPOLOGY = "topology"
    FOLLOW = "follow"
    EYES = "eyes"
    ABOVE = "above"
    ORBIT = "orbit"


class Cuts(StrEnum):
    """When the topology camera cuts: by itself, never, or by itself between static cameras."""

    AUTO = "auto"
    NONE = "none"
    STATIC = "static"


class FilmCamera(Protocol):
    """Where a film looks from."""

    def at(self, t_ns: int, picture: Picture, head: Pose) -> Camera:
        """Return the camera at a time, at or after those asked before."""
        ...


@dataclass(frozen=True, eq=False)
class ViewpointCamera:
    """A camera at the participant's eyes, above the scene, or around it."""

    view: Viewpoint
    aspect: float
    start_ns: int

    def at(self, t_ns: int, picture: Picture, head: Pose) -> Camera:
        """Return the camera at a time."""
        passed_s = (t_ns - self.start_ns) / NS_PER_S
        return camera_of(self.view, picture, head, self.aspect, passed_s=passed_s)


@dataclass(frozen=True, eq=False)
class FollowCamera:
    """A camera over the participant's shoulder, behind the direction in which they face; it sees
    what they look at, and stays before walls behind them.
    """

    aspect: float
    surfaces: Surfaces = field(default_factory=Surfaces)

    def at(self, t_ns: int, picture: Picture, head: Pose) -> Camera:
        """Return the camera at a time."""
        del t_ns
        yaw_deg, _ = yaw_pitch_deg_of(rotate(head.orientation_wxyz, np.array([0.0, 0.0, -1.0])))
        level = quat_from_yaw_pitch_deg(float(yaw_deg))
        back = rotate(level, np.array([0.35, FOLLOW_UP_M, FOLLOW_BACK_M]))
        away_m = float(np.linalg.norm(back))
        free_m = self.surfaces.end_m(picture, head.position_m, back / away_m) - FOLLOW_CLEAR_M
        place = head.position_m + back * min(1.0, max(0.2, free_m / away_m))
        turn = quat_from_yaw_pitch_deg(float(yaw_deg), -9.0)
        return symmetric_camera(Pose(place, turn), FOLLOW_TANGENT, self.aspect)


@dataclass(frozen=True)
class Decisions:
    """What a film's camera did: `views` (n, 7) of time, place and the point looked at, and cuts.

    `hidden` are the times for which the subject stayed hidden longer than the style allows, and why
    no cut ended them.
    """

    camera: str
    shot: str
    cut_rule: str
    seed: int
    fov_v_deg: float
    cuts: list[dict[str, Any]]
    views: list[list[float]]
    seen: list[bool]
    hidden: list[dict[str, Any]] = field(default_factory=list)

    def write(self, path: Path) -> None:
        """Write them as JSON, one line a view."""
        head = {k: v for k, v in asdict(self).items() if k != "views"}
        lines = ",\n".join(json.dumps(view) for view in self.views)
        path.write_text(json.dumps(head)[:-1] + f', "views": [\n{lines}\n]}}\n', encoding="utf-8")


class TopologyCamera:
    """A camera whose director knows the room and follows the participant wherever they go.

    `people_at` returns what stands about at a time, `head_at` where the participant's head is.
    """

    def __init__(
        self,
        style: Style,
        aspect: float,
        people_at: Callable[[int], Picture],
        head_at: Callable[[int], Pose],
        seed: int = 0,
    ) -> None:
        self._style, self._aspect, self._seed = style, aspect, seed
        self._people_at, self._head_at = people_at, head_at
        self._director: Director | None = None
        self._room: Room | None = None
        self._people: tuple[int, Vector] = (-1, np.empty((0, 7)))
        self._views: list[list[float]] = []
        self._sees_subject: list[bool] = []

    def at(self, t_ns: int, picture: Picture, head: Pose) -> Camera:
        """Return the camera at a time."""
        if self._director is None or picture.room is not self._room:
            self._room = picture.room
            self._director = Director(
                _place_of(picture.room), self._style, self._moment, start_ns=t_ns, seed=self._seed
            )
        view = self._director.view_at(t_ns)
        self._views.append([t_ns, *view.position_m.tolist(), *view.looks_at_m.tolist()])
        self._sees_subject.append(self._director.sees_subject)
        return camera_of_view(view, self._style.fov_v_deg, self._aspect)

    def decisions(self) -> Decisions:
        """Return the decisions so far."""
        cuts = [] if self._director is None else self._director.cuts
        cut_rows = [
            {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(cut).items()}
            for cut in cuts
        ]
        rule = Cuts.NONE if not self._style.cuts else Cuts.AUTO
        rule = rule if self._style.moves else Cuts.STATIC
        return Decisions(
            CameraKind.TOPOLOGY,
            self._style.shot,
            rule,
            self._seed,
            self._style.fov_v_deg,
            [{k: _json_value(v) for k, v in cut.items()} for cut in cut_rows],
            self._views,
            self._sees_subject,
            [vars(hidden) for hidden in (self._director.hidden if self._director else ())],
        )

    def _moment(self, t_ns: int) -> Moment:
        head = self._head_at(t_ns).position_m
        number = t_ns // PEOPLE_EVERY_NS
        if number != self._people[0]:
            self._people = number, capsules(self._people_at(number * PEOPLE_EVERY_NS))
        floor = np.array([head[0], 0.0, head[2]])
        return Moment(floor, float(head[1]) * HEAD_ABOVE_EYES, self._people[1])


def _json_value(value: Any) -> Any:
    """Return a value that JSON can hold; NaN becomes None."""
    if isinstance(value, list):
        return [_json_value(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def camera_for(posture: Posture, *, has_places: bool) -> CameraKind:
    """Return the camera of a film that names none.

    People who sit look at what is before them, which is seen over their shoulder; a camera that
    looks for places to see them by would show the back of what they look at.
    """
    if posture == "seated":
        return CameraKind.FOLLOW
    return CameraKind.TOPOLOGY if has_places else CameraKind.ORBIT


def films_by_topology(pictures: Iterable[Picture]) -> bool:
    """Tell whether every room of a trial that is ever lit has places for a topology camera."""
    try:
        for picture in pictures:
            if picture.brightness_01 > 0:
                _place_of(picture.room)
    except UsageError:
        return False
    return True


_PLACES: dict[int, tuple[Room, FilmedPlace]] = {}


def _place_of(room: Room) -> FilmedPlace:
    if id(room) not in _PLACES:
        try:
            _PLACES[id(room)] = room, prepare(room)
        except DesignError as error:
            others = "follow, eyes, above or orbit"
            raise UsageError(f"{error}, or film by another camera: --camera {others}") from error
    return _PLACES[id(room)][1]


class RecordedCamera:
    """The camera of an earlier film, from the file of its decisions."""

    def __init__(self, path: Path, aspect: float) -> None:
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            self._views = np.array(content["views"], np.float64).reshape(-1, 7)
            self._fov_v_deg = float(content["fov_v_deg"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UsageError(
                f"{path} does not hold the decisions of a film ({error}); give a file that "
                "`visavis film` wrote, or topology, follow, eyes, above or orbit"
            ) from error
        if not len(self._views):
            raise UsageError(f"{path} holds no view; film the trial again")
        self._aspect = aspect

    def at(self, t_ns: int, picture: Picture, head: Pose) -> Camera:
        """Return the camera at a time."""
        del picture, head
        i = max(0, int(np.searchsorted(self._views[:, 0], t_ns, side="right")) - 1)
        row = self._views[i]
        return camera_of_view(CameraView(row[1:4], row[4:7]), self._fov_v_deg, self._aspect)


def style_of(shot: ShotSize, cuts: Cuts) -> Style:
    """Return the style of a film."""
    return replace(Style(), shot=shot, cuts=cuts is not Cuts.NONE, moves=cuts is not Cuts.STATIC)

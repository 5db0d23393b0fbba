"""A picture with areas of interest as targets of a simulated observer."""

from collections.abc import Sequence
from itertools import compress
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, quat_conjugate, rotate, unit
from visavis.lab.screen import PlacedScreen
from visavis.people.observer import state
from visavis.stimuli.areas import ELSEWHERE, Area, PictureAreas, PlacedAreas, SurroundingAreas
from visavis.stimuli.gaze_window import GazeWindow, WindowPlace
from visavis.stimuli.scene import Scene

ELSEWHERE_APPEAL: Final = 0.5
"""Attraction of all of them together; that of an area of average size is 1."""


class PictureLayout:
    """The areas of a picture seen from a seat, each with its appeal: the salience that its study
    gives, or else the root of its share of the mean size. Somebody to whom areas make no difference
    looks all over the picture. Areas of a film may move: they attract where they are, as much as
    at their first key frame.

    Of a panorama before a `screen`, which shows it `turned_deg` to the right and upwards, they see
    what is on the screen.
    """

    _moving_sheets: Sequence[tuple[int, PictureAreas]] = ()
    """Sheets of which some area moves, each with the place of its first area."""
    names: Sequence[str] = ()
    """Areas of its first targets; things of a room have none that a window could hide."""

    def __init__(
        self,
        scene: Scene,
        sheets: Sequence[PictureAreas],
        seat: Vector,
        screen: PlacedScreen | None = None,
        turned_deg: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.scene = scene
        points: list[Vector] = []
        sizes, saliences, is_around, names = [], [], [], []
        self._seat, self._screen, self._turned_deg = seat, screen, turned_deg
        moving: list[tuple[int, PictureAreas]] = []
        for one in sheets:
            if any(area.keys for area in one.areas):
                moving.append((len(points), one))
            for area in one.areas:
                first = area.first()
                names.append(area.name)
                points.append(self._place_m(one, first))
                sizes.append(one.size_deg2(first, seat))
                saliences.append(area.salience)
                is_around.append(isinstance(one, SurroundingAreas))
        self._moving_sheets = moving
        self.names = tuple(names)
        n = len(points)
        size_deg2 = np.array(sizes)
        by_size = np.sqrt(size_deg2 / size_deg2.mean()) if n else size_deg2
        appeals = [s if s is not None else by_size[i] for i, s in enumerate(saliences)]
        around = next((one for one in sheets if isinstance(one, SurroundingAreas)), None)
        if around is not None and screen is not None:
            elsewhere, wide_rad = spots_of(screen)
        elif around is not None:
            elsewhere, wide_rad = around.spots(seat)
        else:
            flat = [one for one in sheets if isinstance(one, PlacedAreas)]
            back = max(flat, key=lambda one: one.size_m[0] * one.size_m[1])
            elsewhere, wide_rad = back.spots(seat)
        rest = np.full(len(elsewhere), ELSEWHERE_APPEAL / len(elsewhere))
        offset = np.array([*points, *elsewhere]) - seat
        if around is not None and screen is not None:
            offset[:n], on_screen = _through(screen, seat, offset[:n], np.array(is_around, bool))
            moves = np.array([area.keys != () for one in sheets for area in one.areas], bool)
            appeals = np.where(on_screen | moves, appeals, 0.0).tolist()
        self.appeal = np.concatenate([appeals, rest])
        self.appeal_anywhere = np.concatenate([np.zeros(n), rest])
        distance = np.linalg.norm(offset, axis=1)
        t = np.zeros(len(offset), dtype=state.TARGET_DTYPE)
        t["kind"], t["agent"], t["lost_ns"] = state.ROOM, -1, -1
        t["direction"], t["distance_m"] = offset / distance[:, None], distance
        t["radius_rad"] = wide_rad
        t["radius_rad"][:n] = np.radians(np.sqrt(size_deg2 / np.pi))
        self.targets = t
        self.agent_eyes = np.zeros((0, 3))
        ahead = offset[:n].mean(axis=0) if around is None else _ahead(around)
        self.rest = (float(np.arctan2(-ahead[0], -ahead[2])), 0.0)

    @property
    def is_moving(self) -> bool:
        """Whether some area moves."""
        return len(self._moving_sheets) > 0

    def move(
        self, targets: npt.NDArray[np.void], appeal: npt.NDArray[np.float64], t_ns: int
    ) -> None:
        """Lead targets to where areas are at a session time; those that are not there attract
        nobody, the others by their `appeal`.
        """
        for first, sheet in self._moving_sheets:
            for i, area in enumerate(sheet.areas_now(t_ns), first):
                targets["appeal"][i] = 0.0 if area is None else appeal[i]
                if area is not None:
                    offset = self._place_m(sheet, area) - self._seat
                    if isinstance(sheet, SurroundingAreas) and self._screen is not None:
                        is_around = np.ones(1, np.bool_)
                        (offset,), (is_there,) = _through(
                            self._screen, self._seat, offset[None], is_around
                        )
                        targets["appeal"][i] = appeal[i] * is_there
                    distance_m = np.linalg.norm(offset)
                    targets["direction"][i] = offset / distance_m
                    targets["distance_m"][i] = distance_m
                    size_deg2 = sheet.size_deg2(area, self._seat)
                    targets["radius_rad"][i] = np.radians(np.sqrt(size_deg2 / np.pi))

    def _place_m(self, one: PictureAreas, area: Area) -> Vector:
        """Return where the middle of an area is, as the view is turned."""
        if isinstance(one, SurroundingAreas):
            return one.place_m(*area.middle(), self._turned_deg)
        return one.place_m(*area.middle())


def hidden_areas(what: PictureLayout, window: GazeWindow) -> frozenset[str]:
    """Return the areas that nobody sees before a window at gaze comes to them: what is around it
    is covered, or blurred by half their width or more.
    """
    half_deg = np.degrees(what.targets["radius_rad"][: len(what.names)])
    is_hidden = (window.blur_deg == 0) | (half_deg <= window.blur_deg)
    return frozenset(compress(what.names, is_hidden.tolist()))


def areas_in_window(
    what: PictureLayout,
    targets: npt.NDArray[np.void],
    window: GazeWindow,
    place: WindowPlace,
    seat: Vector,
) -> frozenset[str]:
    """Return the areas of which a window at a place shows a part, `targets` being where they are
    from a seat.
    """
    of_areas = targets[: len(what.names)]
    places_m = seat + of_areas["direction"] * of_areas["distance_m"][:, None]
    cosine = np.clip(unit(places_m - place.eye_m) @ place.direction, -1.0, 1.0)
    is_in = np.arccos(cosine) < np.radians(window.window_deg / 2) + of_areas["radius_rad"]
    return frozenset(compress(what.names, is_in.tolist()))


def _ahead(around: SurroundingAreas) -> Vector:
    """Return what was straight ahead when a panorama came."""
    return rotate(around.pose.orientation_wxyz, np.array([0.0, 0.0, -1.0]))


def spots_of(screen: PlacedScreen) -> tuple[list[Vector], float]:
    """Return places all over a screen, and the angle around each where people look."""
    left_m, right_m, bottom_m, top_m = screen.flat.edges_m()
    wide_m, high_m = right_m - left_m, top_m - bottom_m
    spots = [
        screen.pose_at(left_m + x * wide_m, bottom_m + y * high_m).position_m
        for x in ELSEWHERE
        for y in ELSEWHERE
    ]
    return spots, float(np.arctan2(wide_m / 3, screen.flat.distance_m))


def _through(
    screen: PlacedScreen, seat: Vector, offset_m: Vector, is_around: npt.NDArray[np.bool_]
) -> tuple[Vector, npt.NDArray[np.bool_]]:
    """Return offsets (n, 3) from a seat, those of what is behind a screen led to its plane, and
    which of them are on it.
    """
    if not len(offset_m):
        return offset_m, is_around
    back = quat_conjugate(screen.place.orientation_wxyz)
    at = np.broadcast_to(rotate(back, seat - screen.place.position_m), offset_m.shape)
    hit_m = screen.flat.meets_m(at, rotate(back, offset_m))
    on_screen = screen.flat.is_on(hit_m)
    on_plane = rotate(screen.place.orientation_wxyz, hit_m) + screen.place.position_m - seat
    led = is_around & on_screen
    return np.where(led[:, None], on_plane, offset_m), on_screen | ~is_around

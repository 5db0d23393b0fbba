"""A director: films somebody in a place with its tracks, cutting and moving as a style says.

Decisions fall thirty times a second, whatever the rate of the film, and between them the camera's
way is known in closed form: a film of 30, 60 or 90 pictures a second shows the same.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.choosing import (
    NO_EDGE,
    Clearance,
    GraphPosition,
    Subject,
    cut_to,
    is_free_step,
    move_to,
    place_on,
)
from visavis.stimuli.camera.floors import Walkers, walkable_floors
from visavis.stimuli.camera.following import Drive, follow, pull
from visavis.stimuli.camera.graph import (
    CameraGraph,
    FloorTable,
    GraphRules,
    floor_table,
    small_triangles,
    track_graph,
)
from visavis.stimuli.camera.obstacles import NOBODY, Obstacles
from visavis.stimuli.camera.shots import (
    HEIGHT_SHARE,
    LogNormalLengths,
    ShotLengths,
    ShotSize,
    flow_cosine,
    shot_distance_m,
    view_angle_deg,
)
from visavis.stimuli.camera.skeleton import medial_axis
from visavis.stimuli.camera.tracks import (
    FOR_ROOMS,
    RayRules,
    TrackRules,
    camera_places,
    tracks_through,
    wall_tracks,
)
from visavis.stimuli.picture import Room

DECISIONS_PER_S: Final = 30
HEAD_SHARE: Final = 0.93
"""Height of the eyes and mouth as a share of a person's."""
CHEST_SHARE: Final = 0.72
SPARE_TO_CUT_M: Final = 4.0
SPARE_TO_MOVE_M: Final = 2.0
"""How much farther than one and a half times the distance of the shot places may be."""
VELOCITY_OVER: Final = 10
"""Decisions over which a subject's velocity is averaged."""


@dataclass(frozen=True)
class Weights:
    """How much each part of a place's score counts."""

    size: float = 1.0
    direct: float = 2.0
    indirect: float = 0.5
    distance: float = 1.0
    angle: float = 1.0
    flow: float = 1.0

    def of_moving(self) -> Vector:
        """Return the weights (6,) of a place to move to, sum 1."""
        return _summing_to_one(self.size, self.direct, self.indirect, self.distance, 0.0, 0.0)

    def of_cutting(self) -> Vector:
        """Return the weights (6,) of a place to cut to, sum 1."""
        return _summing_to_one(self.size, self.direct, self.indirect, 0.0, self.angle, self.flow)


def _summing_to_one(*weights: float) -> Vector:
    values = np.array(weights)
    if (values < 0).any() or values.sum() <= 0:
        raise DesignError(f"weights {weights}; give numbers of at least 0, not all of them 0")
    shares: Vector = values / values.sum()
    return shares


@dataclass(frozen=True)
class Style:
    """How a film is made.

    `lost_s` is how long the subject may be hidden, or its size be off by more than the factor
    `off_by`, before a cut. No shot is shorter than `min_shot_s`, unless the subject is hidden.
    `step_m` is the step along a track towards a better place; a place should see where the subject
    will be in `ahead_s`. The camera keeps `clear_m` from surfaces and `people_clear_m` from people.
    """

    shot: ShotSize = ShotSize.LONG
    cuts: bool = True
    moves: bool = True
    lengths: ShotLengths = field(default_factory=LogNormalLengths)
    min_shot_s: float = 1.0
    lost_s: float = 0.2
    off_by: float = 2.0
    min_angle_deg: float = 30.0
    fov_v_deg: float = 40.0
    weights: Weights = field(default_factory=Weights)
    drive: Drive = field(default_factory=Drive)
    turn_rad_s: float = 6.0
    step_m: float = 0.25
    ahead_s: float = 1.5
    max_tests: int = 48
    clear_m: float = 0.1
    people_clear_m: float = 0.15


NO_PLACE: Final = "no place of the camera graph sees them"
NO_CUTS: Final = "this style does not cut"


@dataclass(frozen=True)
class Hidden:
    """A time for which the subject was hidden longer than `Style.lost_s`, and why it stayed so.

    `t_ns` is when it began, `seconds` how long it lasted.
    """

    t_ns: int
    seconds: float
    why: str


STYLES: Final = {
    # Without cuts, a camera among people must weigh sight more than the exact size.
    "medium-no-cuts": Style(ShotSize.MEDIUM, cuts=False, weights=Weights(direct=6.0)),
    "long-cuts": Style(ShotSize.LONG),
    "extreme-long-static": Style(ShotSize.EXTREME_LONG, moves=False),
}
"""The three styles of the published system."""


@dataclass(frozen=True, eq=False)
class FilmedPlace:
    """Everything precomputed about a place before filming."""

    obstacles: Obstacles
    graph: CameraGraph
    table: FloorTable
    around_01: npt.NDArray[np.float32]

    @classmethod
    def of_graph(
        cls, obstacles: Obstacles, graph: CameraGraph, table: FloorTable, around_m: float = 5.0
    ) -> Self:
        """Prepare a graph for filming."""
        return cls(obstacles, graph, table, table.around_01(around_m))


def prepare(
    room: Room,
    seed: int = 0,
    *,
    walkers: Walkers | None = None,
    rays: RayRules = FOR_ROOMS,
    tracks: TrackRules | None = None,
    joins: GraphRules | None = None,
    triangle_m2: float = 1.5,
    around_m: float = 5.0,
) -> FilmedPlace:
    """Find the tracks of a room, join them, and look at its floor from them.

    The floor is looked at in triangles of at most `triangle_m2`; cameras should see what lies
    within `around_m` of the subject.
    """
    obstacles = Obstacles.of_room(room)
    floors = walkable_floors(room, walkers)
    lines = [
        tracks_through(
            camera_places(f, medial_axis(f.area), obstacles, rays), obstacles, seed, tracks
        )
        for f in floors
    ]
    if not any(len(of_floor) for of_floor in lines):
        lines = [wall_tracks(f, obstacles, rays, tracks) for f in floors]
    graph = track_graph(np.concatenate(lines), obstacles, joins)
    triangles = np.concatenate([small_triangles(f, triangle_m2) for f in floors])
    table = floor_table(graph, triangles, obstacles, seed)
    return FilmedPlace.of_graph(obstacles, graph, table, around_m)


@dataclass(frozen=True, eq=False)
class Moment:
    """The subject's position (3,) and height, and the capsules (c, 7: start, end, radius) of
    everybody else, at one moment.
    """

    subject_m: Vector
    height_m: float
    people: Vector = field(default_factory=lambda: NOBODY)


@dataclass(frozen=True, eq=False)
class CameraView:
    """Where a camera is (3,) and the point (3,) it looks at."""

    position_m: Vector
    looks_at_m: Vector


@dataclass(frozen=True, eq=False)
class Cut:
    """A decision to cut: when, why, from where and whither; angle and flow are NaN at the start."""

    t_ns: int
    reason: str
    from_m: Vector
    to_m: Vector
    subject_m: Vector
    angle_deg: float
    flow: float
    keeps_angle: bool


class Director:
    """Decides where the camera is; call `view_at` with rising times. `moment_at` returns
    everybody's place at a time (ns) and is called thirty times a second.
    """

    def __init__(
        self,
        place: FilmedPlace,
        style: Style,
        moment_at: Callable[[int], Moment],
        *,
        start_ns: int = 0,
        seed: int = 0,
    ) -> None:
        self._place, self._style, self._moment_at = place, style, moment_at
        self._start_ns, self._rng = start_ns, np.random.default_rng(seed)
        self._weights = style.weights.of_moving(), style.weights.of_cutting()
        self._tick = 0
        self._hidden_ticks = self._misframed_ticks = 0
        self._is_held = False
        self.cuts: list[Cut] = []
        self.hidden: list[Hidden] = []
        self._recent: list[Vector] = []
        self._meet(moment_at(start_ns))
        self._edge, self._share = NO_EDGE, 0.0
        self._position = self._velocity = self._look = self._turning = np.full(3, np.nan)
        self._shot_from, self._shot_s, self._retry = 0, style.lengths.draw_s(self._rng), 0
        self._decide()

    def view_at(self, t_ns: int) -> CameraView:
        """Return the camera at a time, at or after those asked before.

        Raises:
            DesignError: the time lies before the last decision.
        """
        while self._time_of(self._tick + 1) <= t_ns:
            self._position, self._velocity, self._look, self._turning = self._state_at(
                self._time_of(self._tick + 1)
            )
            self._tick += 1
            self._meet(self._moment_at(self._time_of(self._tick)))
            self._decide()
        if t_ns < self._time_of(self._tick):
            raise DesignError(f"the camera was asked for {t_ns} ns after a later time; go forward")
        position, _, look, _ = self._state_at(t_ns)
        return CameraView(position, look)

    @property
    def cut_ns(self) -> tuple[int, ...]:
        """Times of the cuts so far; the beginning does not count."""
        return tuple(cut.t_ns for cut in self.cuts[1:])

    @property
    def sees_subject(self) -> bool:
        """Whether nothing hid the subject's head at the last decision."""
        return self._hidden_ticks == 0

    def _time_of(self, tick: int) -> int:
        return self._start_ns + tick * NS_PER_S // DECISIONS_PER_S

    def _state_at(self, t_ns: int) -> tuple[Vector, Vector, Vector, Vector]:
        """Return position, velocity, point looked at and its velocity since the last decision."""
        dt_s = (t_ns - self._time_of(self._tick)) / NS_PER_S
        centre = self._centre
        look, turning = pull(self._look, self._turning, centre, dt_s, self._style.turn_rad_s)
        if self._is_held or not self._style.moves:
            return self._position, np.zeros(3), look, turning
        position, velocity = self._follow(dt_s)
        return position, velocity, look, turning

    def _follow(self, dt_s: float) -> tuple[Vector, Vector]:
        target = place_on(
            self._place.graph.nodes_m, self._place.graph.edges, self._edge, self._share
        )
        return follow(self._position, self._velocity, target, dt_s, self._style.drive, self._head)

    def _meet(self, moment: Moment) -> None:
        """Read the positions of everybody; the picture is centred on the body, or on the head with
        room above.
        """
        share, height_m = HEIGHT_SHARE[self._style.shot], moment.height_m
        self._moment = moment
        self._recent = [*self._recent, moment.subject_m][-VELOCITY_OVER - 1 :]
        self._centre = _above(moment.subject_m, height_m * max(0.5, 1.0 - 0.4 / share))
        self._head = _above(moment.subject_m, HEAD_SHARE * height_m)
        self._wanted_m = shot_distance_m(height_m, self._style.fov_v_deg, share)

    def _subject(self, spare_m: float) -> Subject:
        """Return whom to film: their head and chest now, and the head soon and later.

        Places may be `spare_m` more than one and a half times the shot's distance away.
        """
        head = self._head
        chest = _above(self._moment.subject_m, CHEST_SHARE * self._moment.height_m)
        ahead = self._style.ahead_s * self._subject_velocity()
        points = np.stack([head, chest, head + ahead / 2, head + ahead])
        wanted_m = self._wanted_m
        return Subject(self._centre, points, wanted_m, 1.5 * wanted_m + spare_m)

    def _clearance(self) -> Clearance:
        """Return what the camera keeps clear of now."""
        style = self._style
        return Clearance(
            self._place.obstacles.arrays,
            self._moment.people,
            style.clear_m,
            style.people_clear_m,
        )

    def _decide(self) -> None:
        """Cut, or move the target, at the time of the present decision."""
        style = self._style
        if self._edge == NO_EDGE:
            self._cut("start", may_break_angle=True)
            if self._edge == NO_EDGE:
                raise DesignError("no place of the camera graph sees the subject; nothing to film")
        else:
            self._watch()
            age = self._tick - self._shot_from
            reason = self._reason(age) if style.cuts else ""
            has_cut = False
            if reason and age >= self._retry:
                has_cut = self._cut(reason, may_break_angle=reason == "hidden")
                self._retry = 0 if has_cut else age + DECISIONS_PER_S // 10
            self._note_hidden()
            if style.moves and not has_cut:
                self._retarget()
        self._guard()

    def _note_hidden(self) -> None:
        """Note how long the subject has been hidden by now, and why no cut has ended that."""
        ticks = self._hidden_ticks
        if ticks <= self._style.lost_s * DECISIONS_PER_S:
            return
        why = NO_PLACE if self._style.cuts else NO_CUTS
        begun_ns = self._time_of(self._tick - ticks)
        if self.hidden and self.hidden[-1].t_ns == begun_ns:
            self.hidden.pop()
        self.hidden.append(Hidden(begun_ns, ticks / DECISIONS_PER_S, why))

    def _watch(self) -> None:
        """Count for how many decisions the subject has been hidden or of a wrong size."""
        moment, style = self._moment, self._style
        is_seen = self._place.obstacles.sees(self._position, self._head, moment.people)
        self._hidden_ticks = 0 if is_seen else self._hidden_ticks + 1
        ratio = float(np.linalg.norm(self._position - self._centre)) / self._wanted_m
        fits = 1 / style.off_by <= ratio <= style.off_by
        self._misframed_ticks = 0 if fits else self._misframed_ticks + 1

    def _reason(self, age: int) -> str:
        style = self._style
        if self._hidden_ticks > style.lost_s * DECISIONS_PER_S:
            return "hidden"
        if age < style.min_shot_s * DECISIONS_PER_S:
            return ""
        if self._misframed_ticks > style.lost_s * DECISIONS_PER_S:
            return "size"
        return "length" if age >= self._shot_s * DECISIONS_PER_S else ""

    def _subject_velocity(self) -> Vector:
        if len(self._recent) < 2:
            return np.zeros(3)
        span_s = (len(self._recent) - 1) / DECISIONS_PER_S
        velocity_mps: Vector = (self._recent[-1] - self._recent[0]) / span_s
        return velocity_mps

    def _around(self) -> npt.NDArray[np.float32]:
        triangle = self._place.table.at(self._moment.subject_m)
        row: npt.NDArray[np.float32] = self._place.around_01[triangle]
        return row

    def _cut(self, reason: str, *, may_break_angle: bool) -> bool:
        style, graph = self._style, self._place.graph
        centre, velocity = self._centre, self._subject_velocity()
        edge, share, _, keeps = cut_to(
            self._subject(SPARE_TO_CUT_M),
            velocity,
            self._position,
            style.min_angle_deg,
            graph.network,
            self._around(),
            self._weights[1],
            self._clearance(),
        )
        if edge == NO_EDGE or not (keeps or may_break_angle):
            return False
        to = place_on(graph.nodes_m, graph.edges, edge, share)
        self.cuts.append(
            Cut(
                self._time_of(self._tick),
                reason,
                self._position,
                to,
                centre,
                float(view_angle_deg(centre, self._position, to)),
                float(flow_cosine(centre, velocity, self._position, to)),
                keeps,
            )
        )
        self._edge, self._share = edge, share
        self._position, self._velocity = to, np.zeros(3)
        self._look, self._turning = centre, np.zeros(3)
        self._hidden_ticks = self._misframed_ticks = 0
        self._shot_from, self._retry = self._tick, 0
        self._shot_s = max(style.min_shot_s, style.lengths.draw_s(self._rng))
        return True

    def _retarget(self) -> None:
        style, graph = self._style, self._place.graph
        a, b = graph.edges[self._edge]
        edge, share, _ = move_to(
            self._subject(SPARE_TO_MOVE_M),
            self._position,
            GraphPosition(self._edge, self._share, graph.distance_m[a], graph.distance_m[b]),
            style.step_m,
            style.max_tests,
            graph.network,
            self._around(),
            self._weights[0],
            self._clearance(),
        )
        if edge != NO_EDGE:
            self._edge, self._share = edge, share

    def _guard(self) -> None:
        """Hold the camera until the next decision when its way there is not free."""
        self._is_held = False
        if self._style.moves:
            dt_s = (self._time_of(self._tick + 1) - self._time_of(self._tick)) / NS_PER_S
            there, _ = self._follow(dt_s)
            self._is_held = not is_free_step(self._position, there, self._clearance())


def _above(place_m: Vector, by_m: float) -> Vector:
    higher_m: Vector = place_m.copy()
    higher_m[1] += by_m
    return higher_m

"""A simulated participant of the crowd study: walks through, reads the board, feels, answers.

It receives what the display shows and what the armbands do, and nothing else. What it does not
model: hesitating, stepping back, changing the way after a contact, headset weight; tiredness and
practice only as a form that wanders by chance. What it has learned from vibrations stays from
trial to trial, and is recorded with each, so that a resumed session goes on with it. No answer
depends on vibration: presence and embodiment are drawn round the person's own level, with a spread
per answer, so that the published means come out without any effect of the block (Berton et al. 2020
found none).
"""

import zlib
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import EYES_DTYPE, PressesNothing
from visavis.experiments.crowd.participant import walking
from visavis.experiments.crowd.participant.route import (
    STEP_M,
    Way,
    choose_gaps,
    gap_graph,
    way_through,
)
from visavis.experiments.crowd.participant.traits import (
    DEFAULT_POPULATION,
    SPREAD,
    Person,
    Population,
    draw_person,
    in_form,
)
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.chance import generator
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector, quat_conjugate, rotate, unit
from visavis.people.person import plain_answer
from visavis.stimuli.contact.body import REFERENCE_STATURE_M, bones
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.station_crowd import READING_M, START_M, CrowdFrame, CrowdScene

MAX_ROWS: Final = 30_000
"""Steps of a stretch that are walked; after five minutes the body stands."""
EYES_M: Final = (0.0, 0.061 * REFERENCE_STATURE_M, -0.053 * REFERENCE_STATURE_M)
"""From the head's joint to the middle between the eyes at the reference stature."""
GIVE_UP_S: Final = 10.0
_N_PERSON, _N_TASTE, _N_WALK, _N_ANSWER, _N_FORM = range(5)
_JOINTS = frozenset(BODY_JOINTS)
_STANDING, _OUT, _READING, _BACK, _HOME = range(5)
_ARRIVED_M = 0.06

_SUBSCALES = ("agency", "change", "ownership")
_NOISE = 0.6


def answer_question(
    person: Person, question_id: str, options: Sequence[str], rng: np.random.Generator
) -> str | None:
    """Return an answer in the words of the options, or a number; None to leave it out."""
    if question_id.startswith("presence"):
        return _rating(person.presence, options, rng)
    for subscale, level in zip(_SUBSCALES, person.embodiment, strict=True):
        if question_id.startswith(subscale):
            return _rating(float(level), options, rng)
    return plain_answer(person.age, person.sex, question_id, options, rng)


def _rating(level: float, options: Sequence[str], rng: np.random.Generator) -> str:
    category = round(level + _NOISE * rng.standard_normal())
    return options[min(max(category, 1), len(options)) - 1]


class CrowdParticipant(PressesNothing):
    """Implement `protocol.people`'s `SimulatedParticipant` with limbs and a skin.

    `index` and `seed` make the person; `effect=False` disconnects the vibration from them.
    """

    def __init__(
        self,
        index: int,
        seed: int,
        effect: bool = True,
        *,
        population: Population = DEFAULT_POPULATION,
    ) -> None:
        self.population = population
        self._entropy = (seed, index)
        self.person = draw_person(population, self._rng(_N_PERSON), feels=effect)
        skeleton = bones()
        self._parents, self._offsets = skeleton.parents, skeleton.offsets_m
        self._eyes_m = self.person.stature_m / REFERENCE_STATURE_M * np.array(EYES_M)
        self._states = np.zeros((MAX_ROWS, walking.N_STATE))
        self._row = 0
        self._origin_ns = 0
        self._stretch = 0
        self._fit = 0
        self._bands: dict[str, float] = {}
        self._whole: Sequence[str] = BODY_JOINTS
        self._gaze_target_m: Vector | None = None
        self._scene: CrowdScene | None = None
        self._ways: tuple[tuple[Way, Vector], ...] = ()
        self._still = Way(np.array([START_M, START_M]), np.zeros(2), np.full(2, 2.0))
        self.prepare(0, 0)

    # ---- SimulatedParticipant ----

    def prepare(self, stretch: int, t_ns: int) -> None:
        """Stand on the mark and begin a new stretch of behaviour at this session time."""
        caution_and_alarm = self._states[self._row, [walking.CAUTION, walking.ALARM]].copy()
        self._stretch, self._origin_ns = stretch, t_ns
        self._traits = in_form(self.person, self.population, self.form(stretch))
        self._rng_walk = self._rng(_N_WALK, stretch)
        self._noise = self._rng_walk.standard_normal((MAX_ROWS, 2))
        self._row = 0
        self._states[0] = 0.0
        self._states[0, [walking.CAUTION, walking.ALARM]] = caution_and_alarm
        self._states[0, [walking.X, walking.Z]] = START_M
        self._states[0, walking.HEADING] = np.arctan2(
            START_M[0] - READING_M[0], START_M[1] - READING_M[1]
        )
        self._still = Way(
            np.array([START_M, START_M]),
            np.full(2, self._states[0, walking.HEADING]),
            np.full(2, 2.0),
        )
        self._side = np.ones(2)
        self._doing = _STANDING
        self._until_row = MAX_ROWS
        self._way, self._way_side = self._still, self._side
        # the crowd last seen may still stand on the display: it is no new one
        self.track: str | None = None
        self._bands.clear()

    def wear(self, fit: int) -> None:
        """Put the headset on anew."""
        self._fit = fit

    def look_at(self, target_world_m: Sequence[float] | None, t_ns: int) -> None:
        """Follow the instruction to look at a point (calibration, mark); None ends it."""
        self._gaze_target_m = None if target_world_m is None else np.array(target_world_m, float)

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Answer a question; None when this participant would leave it out."""
        if question_id == "track":
            return self.track
        rng = self._rng(_N_ANSWER, zlib.crc32(question_id.encode()), self._stretch)
        return answer_question(self.person, question_id, options, rng)

    # ---- Learner ----

    def memory(self) -> dict[str, float]:
        """Return what vibrations have taught: caution and alarm, 0 to 1."""
        row = self._states[self._row]
        return {"caution": float(row[walking.CAUTION]), "alarm": float(row[walking.ALARM])}

    def remember(self, memory: Mapping[str, float]) -> None:
        """Take up what was learned in an earlier part of the session."""
        row = self._states[self._row]
        row[walking.CAUTION], row[walking.ALARM] = memory["caution"], memory["alarm"]

    # ---- Viewer ----

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        """Receive what the display shows from `t_display_ns` on."""
        if isinstance(view, CrowdFrame) and view.track is not None and self.track is None:
            self.track = view.track
            if self._doing in (_OUT, _READING):
                seconds = self.person.reading_s
                self._until_row = max(self._until_row_at(t_display_ns, seconds), self._row)
        scene = view.scene
        if scene is self._scene or not isinstance(scene, CrowdScene) or scene.crowd is None:
            return
        self._scene = scene
        if self._doing == _STANDING:
            self._plan(scene)
            self._until_row = self._until_row_at(t_display_ns, self.person.reaction_s)

    # ---- MovingBody ----

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return true eye states, shape (n,), dtype `EYES_DTYPE`."""
        eyes = np.zeros(t_ns.shape[0], EYES_DTYPE)
        ahead = np.array([0.0, 0.0, -1.0])
        eyes["left_direction_head"] = eyes["right_direction_head"] = ahead
        if self._gaze_target_m is not None and t_ns.shape[0]:
            position, orientation = self.head(int(t_ns[-1]))
            aim = unit(rotate(quat_conjugate(orientation), self._gaze_target_m - position))
            eyes["left_direction_head"] = eyes["right_direction_head"] = aim
        eyes["openness_01"] = 1.0
        eyes["pupil_mm"] = 3.5
        return eyes

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) in metres and orientation (4,) (w, x, y, z) in world."""
        self._advance(t_ns)
        position, orientation = np.empty(3), np.empty(4)
        walking.walker_head(
            self._states,
            self._row_of(t_ns),
            self.person.stature_m,
            float(self._traits[SPREAD]),
            self._parents,
            self._offsets,
            self._eyes_m,
            position,
            orientation,
        )
        return position, orientation

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true positions (t, n, 3) and orientations (t, n, 4) of segments in world."""
        is_whole = names is self._whole or tuple(names) == BODY_JOINTS
        if is_whole:
            self._whole = names
            return self._pose(np.asarray(t_ns))
        if not _JOINTS.issuperset(names):
            absent = [name for name in names if name not in _JOINTS]
            raise DataError(
                f"the simulated body has no segment {', '.join(absent)}; "
                f"it has {', '.join(BODY_JOINTS)}"
            )
        positions, worlds = self._pose(np.asarray(t_ns))
        index = [BODY_JOINTS.index(name) for name in names]
        return positions[:, index], worlds[:, index]

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Take in what the motors of the band worn as `role` do from `t_ns` on."""
        self._advance(t_ns)
        self._bands[role] = float(max(amplitudes_01, default=0.0))

    def stretch(self) -> int:
        """Return the number of the present stretch of behaviour."""
        return self._stretch

    def fit(self) -> int:
        """Return how the headset sits."""
        return self._fit

    def next_press_ns(self) -> int | None:
        """Return None: nothing is pressed."""
        return None

    # ---- for tests and benchmarks ----

    @property
    def caution(self) -> float:
        """How careful the participant has become, 0 to 1."""
        return float(self._states[self._row, walking.CAUTION])

    def form(self, stretch: int) -> Vector:
        """Return how the person is on a walk, (4,), standard normal between two of its turns."""
        turn, share = divmod(stretch / self.population.form.form_walks, 1.0)
        one, other = (self._rng(_N_FORM, int(turn) + k).standard_normal(4) for k in (0, 1))
        between: Vector = np.cos(share * np.pi / 2) * one + np.sin(share * np.pi / 2) * other
        return between

    # ---- within ----

    def _pose(self, t_ns: npt.NDArray[np.int64]) -> tuple[Vector, Vector]:
        n = t_ns.shape[0]
        positions, worlds = np.empty((n, walking.N_JOINTS, 3)), np.empty((n, walking.N_JOINTS, 4))
        if n:
            self._advance(int(t_ns[-1]))
            rows = np.array([self._row_of(t) for t in t_ns.tolist()])
            walking.walker_poses(
                self._states,
                rows,
                self.person.stature_m,
                float(self._traits[SPREAD]),
                self._parents,
                self._offsets,
                positions,
                worlds,
            )
        return positions, worlds

    def _row_of(self, t_ns: int) -> float:
        return min(max((t_ns - self._origin_ns) / walking.STEP_NS, 0.0), float(self._row))

    def _until_row_at(self, t_ns: int, seconds: float) -> int:
        return int((t_ns - self._origin_ns) / walking.STEP_NS + 100 * seconds)

    def _advance(self, t_ns: int) -> None:
        until = min(-(-(t_ns - self._origin_ns) // walking.STEP_NS), MAX_ROWS - 1)
        while self._row < until:
            to = min(until, max(self._until_row, self._row + 1), self._row + 8)
            vibration_01 = max(self._bands.values(), default=0.0)
            self._row = walking.advance(
                self._states,
                self._row,
                to,
                self._traits,
                self._way.point_m,
                self._way.heading_rad,
                self._way.free_m,
                self._way_side,
                self._noise,
                vibration_01,
                self._doing in (_OUT, _BACK),
            )
            self._decide()

    def _decide(self) -> None:
        """Go over to what comes next when something is done."""
        if self._doing == _STANDING and self._row >= self._until_row:
            self._set_out(0)
            self._doing = _OUT
        elif self._doing == _OUT and self._has_arrived():
            self._doing = _READING
            seconds = self.person.reading_s if self.track is not None else GIVE_UP_S
            self._until_row = self._row + int(100 * seconds)
        elif self._doing == _READING and self._row >= self._until_row:
            self._set_out(1)
            self._doing = _BACK
        elif self._doing == _BACK and self._has_arrived():
            self._doing = _HOME

    def _has_arrived(self) -> bool:
        length_m = (len(self._way.point_m) - 1) * STEP_M
        return bool(self._states[self._row, walking.PROGRESS] >= length_m - _ARRIVED_M)

    def _set_out(self, leg: int) -> None:
        self._way, self._way_side = self._ways[leg]
        self._states[self._row, walking.PROGRESS] = 0.0
        self._until_row = MAX_ROWS

    def _plan(self, scene: CrowdScene) -> None:
        crowd = scene.crowd
        assert crowd is not None  # noqa: S101 - `see` has looked
        graph = gap_graph(crowd)
        q = self.population
        place = zlib.crc32(np.rint(1000 * crowd.position_m).astype(np.int64).tobytes())
        own = self._rng(_N_TASTE, place)
        mark, board = np.array(START_M), np.array(READING_M)
        ways = []
        for start, goal in ((mark, board), (board, mark)):
            habit = own.standard_normal(len(graph.free_m))
            mood = self._rng_walk.standard_normal(len(graph.free_m))
            taste = np.exp(q.routes.taste_person * habit + q.routes.taste_trial * mood)
            gaps = choose_gaps(
                graph, start, goal, taste, squeeze=q.routes.squeeze, easy_gap_m=q.routes.easy_gap_m
            )
            way = way_through(crowd, gaps, start, goal)
            ways.append((way, self._sides(way)))
        self._ways = tuple(ways)

    def _sides(self, way: Way) -> Vector:
        """Draw for every stretch of the way to which side the shoulders turn there."""
        every = round(1.2 / STEP_M)
        sides = np.where(self._rng_walk.random(len(way.point_m) // every + 1) < 0.5, -1.0, 1.0)
        return np.repeat(sides, every)[: len(way.point_m)]

    def _rng(self, *spawn_key: int) -> np.random.Generator:
        return generator(self._entropy, *spawn_key)

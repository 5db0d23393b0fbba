"""A simulated person who sees people, moves eyes and head, and answers questions.

It receives only the display; no condition, place or trial reaches it.
Gaze follows somebody who moves from fixation to fixation.
Not modelled: fatigue and practice across trials, hearing, smooth pursuit of moving targets,
attraction by an agent's blink, torsion of the eyes, standing or walking.
"""

import zlib
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import EYES_DTYPE, PressesNothing
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg
from visavis.people.observer import attention, attention_causes, state
from visavis.people.observer.picture_layout import PictureLayout
from visavis.people.observer.self_report import answer_question
from visavis.people.observer.temperament import (
    DEFAULT_POPULATION,
    Population,
    Temperament,
    draw_temperament,
)
from visavis.stimuli.moving_heads import agents_at, moving_heads
from visavis.stimuli.room_areas import SeenObject
from visavis.stimuli.scene import Scene, SceneFrame
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M

CHEST_BELOW_HEAD_M = 0.40
ROOM_YAW_PITCH_DEG = (
    (-38.0, 27.0),
    (-8.0, 32.0),
    (22.0, 30.0),
    (40.0, 14.0),
    (-34.0, -12.0),
    (2.0, -24.0),
    (24.0, -20.0),
    (46.0, 2.0),
)
"""Directions of walls, ceiling, stage front and floor round the audience."""
ROOM_DISTANCE_M = 3.5
ROOM_RADIUS_RAD = 0.12
SPEAKER_SIDE_YAW_DEG = 52.0
"""Direction of the gaze of a seated person towards the speaker without turning round."""
MOVES_NS = NS_PER_S // 10
"""In such steps of session time targets that move are where they are then."""
RECALLS_NS = NS_PER_S // 4
"""The last two blinks and sixteen saccades are remembered; blinks are 0.3 s apart at least."""
N_PEOPLE_STREAM = 1
N_BEHAVIOUR_STREAM = 2
N_ANSWER_STREAM = 3
Records: TypeAlias = tuple[npt.NDArray[np.void], npt.NDArray[np.void], npt.NDArray[np.void]]
"""Mind, segments and targets."""


class Observer(PressesNothing):
    """Implement `protocol.people`'s `SimulatedParticipant` for one seated observer.

    `index` and `seed` make the person; `effect=False` makes them blind to gaze contact, so that
    all conditions are alike to them. `seat_m` is where the eyes are with the head straight.
    """

    def __init__(
        self,
        index: int,
        seed: int,
        effect: bool = True,
        *,
        population: Population = DEFAULT_POPULATION,
        seat_m: Vector = PARTICIPANT_EYE_M,
    ) -> None:
        self._population = population
        self._entropy = (seed, index)
        self.temperament: Temperament = draw_temperament(
            self._population, self._rng(N_PEOPLE_STREAM)
        )
        self._effect = effect
        self._seat = np.array(seat_m, dtype=np.float64)
        self._person = self.temperament.constants.copy()
        self._person["seat_x"], self._person["seat_y"], self._person["seat_z"] = self._seat
        self._cos_contact = float(np.cos(np.radians(self._population.noticing.contact_deg)))
        self._mind = np.zeros(1, dtype=state.MIND_DTYPE)
        self._segments = np.zeros(state.N_SEGMENTS, dtype=state.SEGMENT_DTYPE)
        self._targets = np.zeros(1, dtype=state.TARGET_DTYPE)
        self._scratch = np.zeros(1)
        self._agent_eyes = np.zeros((0, 3))
        self._layout: Layout | PictureLayout | None = None
        self._appeal: npt.NDArray[np.float64] = np.zeros(0)
        self._scene: Scene | None = None
        self._gaze: npt.NDArray[np.float64] | None = None
        self._openness: npt.NDArray[np.float64] | None = None
        self._instructed_point: tuple[float, ...] | None = None
        self._scene_keys = np.uint64(0), np.uint64(0)
        self._stretch = 0
        self._fit = 0
        self._origin_ns = 0
        self._plan_number = 0
        self._moving: Layout | PictureLayout | None = None
        self._moved_step = 0
        self.prepare(0, 0)

    # ---- SimulatedParticipant ----

    def prepare(self, stretch: int, t_ns: int) -> None:
        """Begin a new stretch of behaviour (a trial, a validation) at this session time.

        Gaze then rests on the point of the instruction in force, else straight ahead.
        """
        self._plan_number += 1
        self._stretch = stretch
        self._origin_ns = t_ns
        keys = self._sequence(N_BEHAVIOUR_STREAM, stretch).generate_state(4, np.uint64)
        mind = self._mind
        mind["key"], mind["blink_key"] = keys[:2]
        self._scene_keys = keys[2], keys[3]
        mind["rest_yaw"] = mind["rest_pitch"] = 0.0
        direction, dioptre = np.array([0.0, 0.0, -1.0]), 1 / ROOM_DISTANCE_M
        if self._instructed_point is not None:
            direction, dioptre = self._towards(self._instructed_point)
        attention_causes.begin_stretch(mind, self._person, self._segments, direction, dioptre)
        self._scene = self._gaze = self._openness = None
        if self._instructed_point is not None:
            attention_causes.instruct(mind, self._person, direction, dioptre, 0)

    def wear(self, fit: int) -> None:
        """Put the headset on anew."""
        self._fit = fit

    def look_at(self, target_world_m: Sequence[float] | None, t_ns: int) -> None:
        """Follow the instruction to look at a point (calibration, mark); None ends it."""
        self._plan_number += 1
        if target_world_m is None:
            self._instructed_point = None
            attention_causes.release(self._mind, self._person, t_ns - self._origin_ns)
            return
        point = tuple(float(x) for x in target_world_m)
        if point == self._instructed_point:
            return
        self._instructed_point = point
        direction, dioptre = self._towards(point)
        attention_causes.instruct(
            self._mind, self._person, direction, dioptre, t_ns - self._origin_ns
        )

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Answer a question; None when this participant would leave it out."""
        rng = self._rng(N_ANSWER_STREAM, zlib.crc32(question_id.encode()))
        return answer_question(
            self.temperament, self._population, question_id, prompt, options, rng
        )

    # ---- Viewer ----

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        """Receive what the display shows from `t_display_ns` on."""
        if view.scene is not self._scene:
            self._meet(view.scene, t_display_ns - self._origin_ns)
        elif view.gaze_direction is self._gaze and view.eye_openness_01 is self._openness:
            return
        self._gaze, self._openness = view.gaze_direction, view.eye_openness_01
        if self._effect and view.scene.brightness_01 > 0:
            if isinstance(self._moving, Layout):  # a picture has no eyes
                self._agent_eyes = self._moving.eyes_at(t_display_ns)
            self._plan_number += attention_causes.see_gaze(
                self._mind,
                self._agent_eyes,
                self._gaze,
                self._openness,
                self._seat,
                self._cos_contact,
                t_display_ns - self._origin_ns,
            )

    # ---- Body ----

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return true eye states, shape (n,), dtype `EYES_DTYPE`."""
        return self.sense(t_ns)[0]

    def sense(
        self, t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.void], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return eye states (n,), head positions (n, 3) and orientations (n, 4) at these times."""
        n = t_ns.shape[0]
        eyes, positions, orientations = np.empty((n, 8)), np.empty((n, 3)), np.empty((n, 4))
        records = self._mind, self._segments, self._targets
        for run in self._runs(t_ns, records, is_ahead=False):
            self._sense(records, t_ns[run], eyes[run], positions[run], orientations[run])
        return np.ndarray((n,), EYES_DTYPE, eyes), positions, orientations

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) in metres and orientation (4,) (w, x, y, z) in world."""
        position, orientation = np.empty(3), np.empty(4)
        if self._moving is not None:
            records = self._mind, self._segments, self._targets
            self._move_targets(t_ns // MOVES_NS, records, is_ahead=False)
        attention.advance_and_pose(
            self._mind,
            self._person,
            self._segments,
            self._targets,
            self._scratch,
            t_ns - self._origin_ns,
            position,
            orientation,
        )
        return position, orientation

    @property
    def plan_number(self) -> int:
        """Return a number that changes with whatever may change where the head goes."""
        return self._plan_number

    def heads_ahead(
        self, t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return positions (n, 3) and orientations (n, 4) of the head at coming times; what was
        decided for them is forgotten again.
        """
        n = t_ns.shape[0]
        positions, orientations = np.empty((n, 3)), np.empty((n, 4))
        records = _copy_of(self._mind), _copy_of(self._segments), _copy_of(self._targets)
        mind, segments, targets = records
        for run in self._runs(t_ns, records, is_ahead=True):
            attention.heads(
                mind,
                self._person,
                segments,
                targets,
                self._scratch,
                t_ns[run] - self._origin_ns,
                positions[run],
                orientations[run],
            )
        return positions, orientations

    def eyes_ahead(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return eye states (n,) at times of which the last are coming, likewise."""
        eyes = np.empty((t_ns.shape[0], 8))
        for run, some, _, _, _ in self._senses_ahead(t_ns):
            eyes[run] = some
        return np.ndarray((len(eyes),), EYES_DTYPE, eyes)

    def stretch(self) -> int:
        """Return the number of the present stretch of behaviour."""
        return self._stretch

    @property
    def notices_contact(self) -> bool:
        """Whether gaze contact means anything to this participant."""
        return self._effect

    def fit(self) -> int:
        """Return how the headset sits."""
        return self._fit

    def next_press_ns(self) -> int | None:
        """Return None: nothing is pressed."""
        return None

    @property
    def recalls_ns(self) -> int:
        """How long past eye states can be asked for; well within the blinks that are stored."""
        return RECALLS_NS

    # ---- within ----

    def _sequence(self, *spawn_key: int) -> np.random.SeedSequence:
        return np.random.SeedSequence(self._entropy, spawn_key=spawn_key)

    def _rng(self, *spawn_key: int) -> np.random.Generator:
        return np.random.default_rng(self._sequence(*spawn_key))

    def _towards(self, point_m: Sequence[float]) -> tuple[Vector, float]:
        offset = np.array(point_m, dtype=np.float64) - self._seat
        distance = max(float(np.linalg.norm(offset)), 0.1)
        return offset / distance, 1 / distance

    def _sense(
        self,
        records: Records,
        t_ns: npt.NDArray[np.int64],
        eyes: npt.NDArray[np.float64],
        positions: npt.NDArray[np.float64],
        orientations: npt.NDArray[np.float64],
    ) -> None:
        mind, segments, targets = records
        attention.sense(
            mind,
            self._person,
            segments,
            targets,
            self._scratch,
            t_ns,
            self._origin_ns,
            eyes,
            positions,
            orientations,
        )

    def _senses_ahead(
        self, t_ns: npt.NDArray[np.int64]
    ) -> Iterator[tuple[slice, Vector, Vector, Vector, npt.NDArray[np.void]]]:
        """Yield runs of times (n,) of which the last are coming, and for each eye states (k, 8),
        head positions (k, 3) and orientations (k, 4), and the targets as they are then.
        """
        records = _copy_of(self._mind), _copy_of(self._segments), _copy_of(self._targets)
        for run in self._runs(t_ns, records, is_ahead=True):
            k = len(t_ns[run])
            eyes, positions, orientations = np.empty((k, 8)), np.empty((k, 3)), np.empty((k, 4))
            self._sense(records, t_ns[run], eyes, positions, orientations)
            yield run, eyes, positions, orientations, records[2]

    def _runs(
        self,
        t_ns: npt.NDArray[np.int64],
        records: Records,
        *,
        is_ahead: bool,
    ) -> Iterator[slice]:
        """Yield runs of times (n,) in which targets stay where they are, and lead these there."""
        if not len(t_ns):
            return
        if self._moving is None:
            yield slice(0, len(t_ns))
            return
        step = np.maximum.accumulate(t_ns // MOVES_NS)
        begins = [0, *(np.flatnonzero(np.diff(step)) + 1).tolist()]
        for begin, end in zip(begins, [*begins[1:], len(step)], strict=True):
            self._move_targets(int(step[begin]), records, is_ahead=is_ahead)
            yield slice(begin, end)

    def _move_targets(self, step: int, records: Records, *, is_ahead: bool) -> None:
        """Let everything happen that happens before a step of time, with targets where they are at
        each, so that it does not depend on which times are asked for.
        """
        assert self._moving is not None  # noqa: S101 - the callers looked
        mind, segments, targets = records
        for k in range(self._moved_step + 1, step + 1):
            until_ns = k * MOVES_NS - self._origin_ns
            attention.advance(mind, self._person, segments, targets, self._scratch, until_ns)
            self._moving.move(targets, self._appeal, k * MOVES_NS)
        if not is_ahead:
            self._moved_step = max(self._moved_step, step)

    def _meet(self, scene: Scene, t_ns: int) -> None:
        """Receive a scene: its targets and their appeal."""
        self._plan_number += 1
        self._scene = scene
        what = self._layout
        if scene.brightness_01 > 0 and (what is None or what.scene is not scene):
            what = self._layout = self._layout_of(scene)
            self._appeal = np.zeros(0) if what is None else self._appeal_of(what)
        is_lit = scene.brightness_01 > 0 and what is not None
        if is_lit and what is not None:
            self._agent_eyes = what.agent_eyes
            self._targets = what.targets.copy()
            self._targets["appeal"] = self._appeal
            self._scratch = np.zeros(len(self._targets))
            self._mind["rest_yaw"], self._mind["rest_pitch"] = what.rest
        else:
            self._mind["rest_yaw"] = self._mind["rest_pitch"] = 0.0
        self._moving = what if is_lit and what is not None and what.is_moving else None
        self._moved_step = (t_ns + self._origin_ns) // MOVES_NS
        if isinstance(self._moving, PictureLayout):
            self._moving.move(self._targets, self._appeal, t_ns + self._origin_ns)
        n = len(self._targets) if is_lit else 0
        key = self._scene_keys[int(is_lit)]
        attention_causes.begin_scene(self._mind, self._person, key, scene.brightness_01, n, t_ns)
        if self._instructed_point is None and not is_lit and scene.mark_m is not None:
            direction, dioptre = self._towards(scene.mark_m.tolist())
            attention_causes.instruct(self._mind, self._person, direction, dioptre, t_ns)
        elif self._instructed_point is None:
            attention_causes.release(self._mind, self._person, t_ns)

    def _layout_of(self, scene: Scene) -> "Layout | PictureLayout | None":
        """Return where there is something to look at in a scene; None where nothing is known."""
        return Layout(scene, self._seat) if scene.agents else None

    def _appeal_of(self, what: "Layout | PictureLayout") -> npt.NDArray[np.float64]:
        if isinstance(what, PictureLayout):
            return what.appeal if self._effect else what.appeal_anywhere
        q, who = self._population, self.temperament
        by_kind = np.array(
            [
                q.attraction.head_appeal * who.head_appeal,
                q.attraction.body_appeal * who.head_appeal,
                q.attraction.room_appeal,
                q.attraction.speaker_appeal,
            ]
        )
        worth = by_kind[what.targets["kind"]]
        of_people = what.targets["kind"] <= state.BODY
        place_factor = what.size**q.attraction.size_power * np.exp(
            who.left_bias * what.leftward_deg / 20
            - (what.eccentric_deg / q.attraction.centre_deg) ** 2 / 2
        )
        appeal: npt.NDArray[np.float64] = np.where(of_people, worth * place_factor, worth)
        return appeal


def _copy_of(records: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """Return a copy of records; numpy's own goes field by field, which takes ten times as long."""
    return np.frombuffer(bytearray(records.tobytes()), records.dtype)


class Layout:
    """A scene as targets seen from a seat, before anyone's preferences."""

    def __init__(
        self,
        scene: Scene,
        seat: Vector,
        things: Sequence[SeenObject] | None = None,
        names: Sequence[str] = (),
    ) -> None:
        """Look about in a room; with `things` and their names at what is seen of the laboratory's
        own.
        """
        self.scene, self.course, self._seat = scene, moving_heads(scene), seat
        n = len(scene.agents)
        self.names = ("",) * (2 * n) + tuple(names)
        heads = np.array([a.head_centre_m for a in scene.agents])
        bodies = heads - np.array([0.0, CHEST_BELOW_HEAD_M, 0.0])
        self.agent_eyes = np.array([a.eye_centre_m for a in scene.agents])
        middle = (heads - seat) / np.linalg.norm(heads - seat, axis=1, keepdims=True)
        centre = middle.mean(axis=0)
        yaw = float(np.arctan2(-centre[0], -centre[2]))
        self.rest = (yaw, 0.0)
        room = np.array(ROOM_YAW_PITCH_DEG)
        around = seat + ROOM_DISTANCE_M * direction_from_yaw_pitch_deg(
            np.degrees(yaw) - room[:, 0], room[:, 1]
        )
        room_rad = np.full(len(around), ROOM_RADIUS_RAD)
        if things is not None:
            around = np.array([thing.place_m for thing in things]).reshape(-1, 3)
            room_rad = np.array([thing.radius_rad for thing in things])
        aside = direction_from_yaw_pitch_deg(SPEAKER_SIDE_YAW_DEG, 2.0)
        points = np.concatenate([heads, bodies, around, [seat + ROOM_DISTANCE_M * aside]])
        offset = points - seat
        distance = np.linalg.norm(offset, axis=1)
        direction = offset / distance[:, None]
        t = np.zeros(len(points), dtype=state.TARGET_DTYPE)
        t["kind"] = np.repeat(
            [
                state.HEAD,
                state.BODY,
                state.ROOM,
                state.SPEAKER_SIDE,
            ],
            [n, n, len(around), 1],
        )
        t["agent"] = np.concatenate([np.arange(n), np.arange(n), np.full(len(around) + 1, -1)])
        t["direction"], t["distance_m"], t["lost_ns"] = direction, distance, -1
        radius = np.concatenate([np.zeros(2 * n), room_rad, [ROOM_RADIUS_RAD]])
        head_radius = np.array([a.head_radius_m for a in scene.agents]) / distance[:n]
        radius[:n] = radius[n : 2 * n] = head_radius
        t["radius_rad"] = radius
        self.targets = t
        self.size = np.ones(len(points))
        self.size[:n] = self.size[n : 2 * n] = head_radius / head_radius.mean()
        turn = np.degrees(np.arctan2(-direction[:, 0], -direction[:, 2]) - yaw)
        self.leftward_deg = turn
        self.eccentric_deg = np.hypot(turn, np.degrees(np.arcsin(direction[:, 1])))

    def eyes_at(self, t_ns: int) -> Vector:
        """Return where agents' eyes (n, 3) are at a session time."""
        return np.array([a.eye_centre_m for a in agents_at(self.scene, t_ns)])

    @property
    def is_moving(self) -> bool:
        """Whether somebody moves the head."""
        return self.course is not None

    def move(
        self, targets: npt.NDArray[np.void], appeal: npt.NDArray[np.float64], t_ns: int
    ) -> None:
        """Lead targets to where heads, and the bodies below, are at a session time; their `appeal`
        stays.
        """
        if self.course is None:
            return
        (heads,) = self.course.centres_m(np.array([t_ns]))
        n = len(heads)
        offset = np.concatenate([heads, heads - np.array([0.0, CHEST_BELOW_HEAD_M, 0.0])])
        offset -= self._seat
        distance = np.linalg.norm(offset, axis=1)
        targets["direction"][: 2 * n] = offset / distance[:, None]
        targets["radius_rad"][: 2 * n] *= targets["distance_m"][: 2 * n] / distance
        targets["distance_m"][: 2 * n] = distance

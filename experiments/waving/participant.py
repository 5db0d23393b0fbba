"""A simulated participant of the waving study: watches, looks, points at an answer, presses.

It receives what the display shows and nothing else. What it does not model: blinks, pursuit,
looking about before the wave, walking, learning over trials.
"""

import zlib
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from devices.contracts import EYES_DTYPE
from experiments.waving.answers import answer_question
from experiments.waving.judgement import (
    DEFAULT_POPULATION,
    Judgement,
    Population,
    draw_person,
    judge,
)
from experiments.waving.perception import evidence_of
from experiments.waving.pointing import ALONG_FINGERS, middle_of
from experiments.waving.questions import WHO_TEXT
from lab.clock import NS_PER_S
from lab.errors import DataError
from lab.geometry import Vector, quat_conjugate, rotate, unit
from stimuli.contact.body import BODY_JOINTS, REFERENCE_STATURE_M
from stimuli.motion.skeleton import canonical_skeleton
from stimuli.picture import Panel
from stimuli.scene import Agent, SceneFrame
from stimuli.scenes.office import (
    CUSTOMERS,
    STANDING_EYE_M,
    OfficeFrame,
    OfficeScene,
    shift_m,
)

_PERSON, TRIAL_STREAM, _BODY, _ANSWER = range(4)
TURN_S: Final = 0.45
HEAD_SHARE: Final = 0.6
"""Of a gaze shift that the head takes over."""
SWAY_M: Final = 0.006
HALF_IPD_M: Final = 0.0315
HAND_AT_M: Final = (0.26, 1.12, -0.30)
HAND_REST: Final = (0.30, 0.75, -1.0)
"""What the hand points to before a question."""
AHEAD_M: Final = (0.0, 1.35, -5.0)
POINT_S: Final = 0.5


class WavingParticipant:
    """Implement `protocol.participants.SimulatedParticipant` with a hand that points.

    `index` and `seed` make the person. `effect=False` gives somebody who does not attend to the
    waves: their answers follow their leanings alone.
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
        self._effect = effect
        self.person = draw_person(population, self.rng(_PERSON))
        body = self.rng(_BODY)
        self._eye = np.array([0.0, STANDING_EYE_M + 0.06 * body.standard_normal(), 0.0])
        self._sway = body.uniform(0.0, 2 * np.pi, 6)
        self._fit = 0
        self.prepare(0, 0)

    def rng(self, *spawn_key: int) -> np.random.Generator:
        """Return the generator of one purpose."""
        return np.random.default_rng(np.random.SeedSequence(self._entropy, spawn_key=spawn_key))

    # ---- SimulatedParticipant ----

    def prepare(self, stretch: int, t_ns: int) -> None:
        """Begin a new stretch of behaviour at this session time: look ahead, the hand down."""
        self._stretch, self._origin_ns = stretch, t_ns
        self._looks: list[tuple[float, Vector]] = [(-10.0, np.array(AHEAD_M))]
        self._aimed = np.zeros((0, 2))
        self._points: list[tuple[float, Vector]] = [(-10.0, np.array(HAND_REST))]
        self._presses: list[tuple[int, str, float]] = []
        self._scene: OfficeScene | None = None
        self._gaze: Vector | None = None
        self._panel_text = ""
        self._judgement: Judgement | None = None

    def wear(self, fit: int) -> None:
        """Put the headset on anew."""
        self._fit = fit

    def look_at(self, target_world_m: Sequence[float] | None, t_ns: int) -> None:
        """Follow the instruction to look at a point; None ends it."""
        point = AHEAD_M if target_world_m is None else target_world_m
        self._look(self._since_s(t_ns) + 0.2, np.array(point, dtype=np.float64))

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Answer a question; None when this participant would leave it out."""
        if question_id in ("who", "realism") and self._judgement is not None:
            return options[self._choice(prompt)]
        rng = self.rng(_ANSWER, zlib.crc32(question_id.encode()))
        return answer_question(self.person, question_id, options, rng)

    # ---- Viewer ----

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        """Receive what the display shows from `t_display_ns` on."""
        scene = view.scene
        if not isinstance(scene, OfficeScene) or not isinstance(view, OfficeFrame):
            return
        t_s = self._since_s(t_display_ns)
        if scene is not self._scene:
            self._scene = scene
            if scene.waving is not None:
                notice = t_s + scene.waving.start_s + 0.25
                self._look(notice, self._waver(scene).head_centre_m)
        if view.panel is None:
            if scene.waving is not None:
                self._gaze = view.gaze_direction[self._waver_index(scene)]
        elif view.panel.text != self._panel_text and self._gaze is not None:
            self._panel_text = view.panel.text
            self._decide(scene, view.panel, t_s)

    # ---- MovingBody ----

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return true eye states, shape (n,), dtype `EYES_DTYPE`."""
        eyes = np.zeros(t_ns.shape[0], EYES_DTYPE)
        t_s = (t_ns - self._origin_ns) / NS_PER_S
        position, turn = self._heads(t_s)
        target = self._targets(t_s)
        for name, side in (("left", -1.0), ("right", 1.0)):
            at = position + rotate(turn, np.array([side * HALF_IPD_M, 0.0, 0.0]))
            eyes[f"{name}_direction_head"] = unit(rotate(quat_conjugate(turn), target - at))
        eyes["openness_01"] = 1.0
        eyes["pupil_mm"] = 3.5
        return eyes

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) in metres and orientation (4,) (w, x, y, z) in world."""
        position, turn = self._heads(np.array([self._since_s(t_ns)]))
        return position[0], turn[0]

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true positions (t, n, 3) and orientations (t, n, 4) of segments in world."""
        unknown = [name for name in names if name not in BODY_JOINTS]
        if unknown:
            raise DataError(
                f"the simulated body has no segment {', '.join(unknown)}; "
                f"it has {', '.join(BODY_JOINTS)}"
            )
        t_s = (t_ns - self._origin_ns) / NS_PER_S
        head = self._positions(t_s)
        rows = [BODY_JOINTS.index(name) for name in names]
        lean = head - self._eye
        positions = self._standing[rows] + lean[:, None, :]
        turns = np.zeros((len(t_s), len(names), 4))
        turns[..., 0] = 1.0
        if "right_hand" in names:
            k = list(names).index("right_hand")
            hand = np.array(HAND_AT_M) + lean
            positions[:, k] = hand
            turns[:, k] = _fingers_to(unit(_moving(self._points, t_s, POINT_S) - hand))
        return positions, turns

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Feel nothing: nobody wears a band here."""

    def stretch(self) -> int:
        """Return the number of the present stretch of behaviour."""
        return self._stretch

    def fit(self) -> int:
        """Return how the headset sits."""
        return self._fit

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield the presses of the trigger since the last call."""
        while self._presses and self._presses[0][0] <= until_ns:
            yield self._presses.pop(0)

    # ---- within ----

    def _since_s(self, t_ns: int) -> float:
        return (t_ns - self._origin_ns) / NS_PER_S

    def _look(self, t_s: float, point_m: Vector) -> None:
        self._aimed = np.zeros((0, 2))
        self._looks = [look for look in self._looks if look[0] < t_s]
        self._looks.append((t_s, point_m))

    @staticmethod
    def _waver_index(scene: OfficeScene) -> int:
        waving = scene.waving
        return next(
            i for i, a in enumerate(scene.agents) if waving is not None and a.place == waving.clerk
        )

    def _waver(self, scene: OfficeScene) -> Agent:
        return scene.agents[self._waver_index(scene)]

    def _judged(self, scene: OfficeScene) -> Judgement:
        if self._judgement is None:
            if scene.waving is None or self._gaze is None:
                raise DataError("a question was asked about a scene in which nobody waved")
            eye = self._heads(np.zeros(1))[0][0] - shift_m(scene.participant_place)
            evidence = evidence_of(scene.waving, scene.participant_place, eye, self._gaze)
            own = [c.name for c in CUSTOMERS].index(scene.participant_place)
            rng = self.rng(TRIAL_STREAM, self._stretch)
            self._judgement = judge(
                evidence, own, self.person, self.population, rng, effect=self._effect
            )
        return self._judgement

    def _choice(self, prompt: str) -> int:
        if self._judgement is None:
            raise DataError("a question was asked before anything was seen")
        return self._judgement.place if prompt == WHO_TEXT else self._judgement.realism - 1

    def _decide(self, scene: OfficeScene, panel: Panel, t_s: float) -> None:
        judgement = self._judged(scene)
        takes_s = judgement.who_s if panel.text == WHO_TEXT else judgement.realism_s
        takes_s = max(takes_s, POINT_S + 0.15)
        middle = middle_of(panel, self._choice(panel.text))
        self._look(t_s + 0.2, panel.pose.position_m)
        self._look(t_s + takes_s - POINT_S, middle)
        self._points.append((t_s + takes_s - POINT_S, middle))
        press_ns = self._origin_ns + round((t_s + takes_s + 0.1) * NS_PER_S)
        self._presses += [(press_ns, "trigger", 1.0), (press_ns + NS_PER_S // 10, "trigger", 0.0)]

    def _heads(self, t_s: Vector) -> tuple[Vector, Vector]:
        aims = self._aims
        angles = np.broadcast_to(aims[0], (len(t_s), 2))
        if len(aims) > 1:
            starts = np.array([start for start, _ in self._looks[1:]])
            angles = angles + _smooth((t_s[:, None] - starts) / TURN_S) @ np.diff(aims, axis=0)
        y, p = HEAD_SHARE * angles.T / 2
        cy, sy, cp, sp = np.cos(y), np.sin(y), np.cos(p), np.sin(p)
        return self._positions(t_s), np.stack([cy * cp, cy * sp, sy * cp, -sy * sp], axis=1)

    def _positions(self, t_s: Vector) -> Vector:
        wave = np.sin(2 * np.pi * np.array([0.13, 0.11, 0.17]) * t_s[:, None] + self._sway[:3])
        found: Vector = self._eye + SWAY_M * wave
        return found

    @property
    def _aims(self) -> Vector:
        """Yaw and pitch (n, 2) in radians of what is looked at one after the other."""
        if len(self._aimed) != len(self._looks):
            x, y, z = (np.array([point for _, point in self._looks]) - self._eye).T
            self._aimed = np.stack([np.arctan2(-x, -z), np.arctan2(y, np.hypot(x, z))], axis=1)
        return self._aimed

    def _targets(self, t_s: Vector) -> Vector:
        starts = np.array([start for start, _ in self._looks])
        points = np.array([point for _, point in self._looks])
        found: Vector = points[np.searchsorted(starts, t_s, side="right").clip(1) - 1]
        return found

    @cached_property
    def _standing(self) -> Vector:
        skeleton = canonical_skeleton(REFERENCE_STATURE_M)
        rest: Vector = skeleton.rest_m[[skeleton.index(name) for name in BODY_JOINTS]]
        return rest


def _smooth(share: Vector) -> Vector:
    """Return a minimum-jerk course from 0 to 1."""
    x = np.clip(share, 0.0, 1.0)
    course: Vector = x**3 * (10 - 15 * x + 6 * x**2)
    return course


def _moving(keys: list[tuple[float, Vector]], t_s: Vector, takes_s: float) -> Vector:
    """Return where something is (t, 3) that goes from key to key in `takes_s`."""
    point = np.broadcast_to(keys[0][1], (len(t_s), 3))
    for start_s, goal in keys[1:]:
        point = point + _smooth((t_s - start_s) / takes_s)[:, None] * (goal - point)
    return point


def _fingers_to(direction: Vector) -> Vector:
    """Return turns (t, 4) of a right hand whose fingers point along unit directions (t, 3)."""
    found = np.empty((len(direction), 4))
    found[:, 0] = 1.0 + direction @ ALONG_FINGERS
    found[:, 1:] = np.cross(ALONG_FINGERS, direction)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    backwards = np.array([0.0, 0.0, 1.0, 0.0])
    return np.where(length < 1e-9, backwards, found / np.maximum(length, 1e-9))

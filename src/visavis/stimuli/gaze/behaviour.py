"""Eyes of several agents as a function of time: targets, saccades between them, blinks.

Eyes turn at most `MAXIMUM_TURN_DEG` in the head (the head stays still); what lies farther round
is looked towards as far as that goes. A saccade lasts 21 ms + 2.2 ms per degree (the main sequence
of Carpenter, Movements of the Eyes, 1988) and follows a minimum-jerk course, whose peak velocity
is 1.875 times the mean.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.gaze.blinks import CLOSED_01, CLOSING_01, Blinks
from visavis.stimuli.motion.rhythm_kernels import ease
from visavis.stimuli.scene import Scene

MAXIMUM_TURN_DEG: Final = 30.0
SACCADE_BASE_MS: Final = 21.0
SACCADE_MS_PER_DEG: Final = 2.2
NEVER_NS: Final = np.iinfo(np.int64).max
NO_GAZE: Final = np.array([np.nan, 0.0, 0.0])
NO_LIDS: Final = np.full(3, np.nan)
"""Where who has no gaze faces: with lids that blink, and without."""

EyeState = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], bool]


def saccade_duration_ms(amplitude_deg: float) -> float:
    """Return how long a saccade of this size lasts."""
    return SACCADE_BASE_MS + SACCADE_MS_PER_DEG * amplitude_deg


class _Eyes(NamedTuple):
    """The arrays of `EyeBehaviour` and of its blinks, as kernels take them."""

    centre_m: npt.NDArray[np.float64]
    facing: npt.NDArray[np.float64]
    targets_m: npt.NDArray[np.float64]
    follows: npt.NDArray[np.bool_]
    turn_ns: npt.NDArray[np.int64]
    blink_agent: npt.NDArray[np.int64]
    blink_start_ns: npt.NDArray[np.int64]
    blink_end_ns: npt.NDArray[np.int64]


@compiled
def _toward(
    eye: npt.NDArray[np.float64],
    facing: npt.NDArray[np.float64],
    target: npt.NDArray[np.float64],
    limit_rad: float,
    out: npt.NDArray[np.float64],
) -> None:
    """Write the unit direction from an eye to a target, held within a cone around `facing`; NaN
    where that is.
    """
    if np.isnan(facing[0]):
        out[0] = out[1] = out[2] = np.nan
        return
    x, y, z = target[0] - eye[0], target[1] - eye[1], target[2] - eye[2]
    length = np.sqrt(x * x + y * y + z * z)
    if not length > 0.0:
        out[0], out[1], out[2] = facing[0], facing[1], facing[2]
        return
    x, y, z = x / length, y / length, z / length
    along = x * facing[0] + y * facing[1] + z * facing[2]
    if along < np.cos(limit_rad):
        # Keep the side the target is on, turn no farther than the limit.
        sx, sy, sz = x - along * facing[0], y - along * facing[1], z - along * facing[2]
        side = np.sqrt(sx * sx + sy * sy + sz * sz)
        if side < 1e-9:
            out[0], out[1], out[2] = facing[0], facing[1], facing[2]
            return
        c, s = np.cos(limit_rad), np.sin(limit_rad) / side
        x, y, z = c * facing[0] + s * sx, c * facing[1] + s * sy, c * facing[2] + s * sz
    out[0], out[1], out[2] = x, y, z


@compiled
def _eyes_at(
    t_ns: int,
    observer: npt.NDArray[np.float64],
    eyes: _Eyes,
    state: npt.NDArray[np.float64],
) -> bool:
    """Write gaze directions (m, 3) and then openness (m,) into `state` (4 m,); return whether
    anything moves. `observer` (m, 3) is where the observer is for each agent, (1, 3) for all. An
    array that a kernel makes takes a microsecond more to be returned.
    """
    m = eyes.centre_m.shape[0]
    gaze = state[: 3 * m].reshape((m, 3))
    openness = state[3 * m :]
    for j in range(m):
        openness[j] = np.nan if np.isnan(eyes.facing[j, 1]) else 1.0
    old = np.empty(3)
    new = np.empty(3)
    limit_rad = np.radians(MAXIMUM_TURN_DEG)
    moving = False
    for j in range(m):
        has_turned = t_ns >= eyes.turn_ns[j]
        now = 1 if has_turned else 0
        me = observer[min(j, observer.shape[0] - 1)]
        point = me if eyes.follows[now, j] else eyes.targets_m[now, j]
        _toward(eyes.centre_m[j], eyes.facing[j], point, limit_rad, new)
        share = 1.0
        if has_turned:
            before = me if eyes.follows[0, j] else eyes.targets_m[0, j]
            _toward(eyes.centre_m[j], eyes.facing[j], before, limit_rad, old)
            # Angle from chord and sum: exact for small angles, where the arc cosine loses digits.
            chord2, sum2, dot = 0.0, 0.0, 0.0
            for k in range(3):
                chord2 += (new[k] - old[k]) ** 2
                sum2 += (new[k] + old[k]) ** 2
                dot += new[k] * old[k]
            amplitude = 2.0 * np.arctan2(np.sqrt(chord2), np.sqrt(sum2))
            duration_ns = (SACCADE_BASE_MS + SACCADE_MS_PER_DEG * np.degrees(amplitude)) * 1e6
            tau = (t_ns - eyes.turn_ns[j]) / duration_ns
            if tau < 1.0:
                moving = True
                share = ease(tau)
                if amplitude > 1e-9:
                    # Slerp along the great circle, eased: a saccade speeds up and slows down.
                    a = np.sin((1.0 - share) * amplitude) / np.sin(amplitude)
                    b = np.sin(share * amplitude) / np.sin(amplitude)
                    for k in range(3):
                        new[k] = a * old[k] + b * new[k]
        gaze[j, 0], gaze[j, 1], gaze[j, 2] = new[0], new[1], new[2]
    # Blinks are sorted by their start, so that the first later one ends the search.
    for i in range(eyes.blink_agent.shape[0]):
        if eyes.blink_start_ns[i] > t_ns:
            break
        if t_ns < eyes.blink_end_ns[i] and not np.isnan(eyes.facing[eyes.blink_agent[i], 1]):
            moving = True
            tau = (t_ns - eyes.blink_start_ns[i]) / (eyes.blink_end_ns[i] - eyes.blink_start_ns[i])
            if tau < CLOSING_01:
                part = 1.0 - tau / CLOSING_01
            elif tau < CLOSING_01 + CLOSED_01:
                part = 0.0
            else:
                part = (tau - CLOSING_01 - CLOSED_01) / (1.0 - CLOSING_01 - CLOSED_01)
            openness[eyes.blink_agent[i]] = part * part * (3.0 - 2.0 * part)
    return moving


@compiled
def _distances(
    t_ns: int,
    observer: npt.NDArray[np.float64],
    eyes: _Eyes,
    distance_m: npt.NDArray[np.float64],
) -> None:
    for j in range(eyes.centre_m.shape[0]):
        # Row 0 is where the eyes look before their turn, row 1 where they look from then on.
        now = 1 if t_ns >= eyes.turn_ns[j] else 0
        me = observer[min(j, observer.shape[0] - 1)]
        point = me if eyes.follows[now, j] else eyes.targets_m[now, j]
        eye = eyes.centre_m[j]
        x, y, z = point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]
        has_gaze = not np.isnan(eyes.facing[j, 0])
        distance_m[j] = np.sqrt(x * x + y * y + z * z) if has_gaze else np.nan


class Course(NamedTuple):
    """What the eyes of m agents do at n times while they follow an observer in steps.

    `is_new` (n,) whether anything differs from the time before, `is_moving` (n,) whether anything
    moved when it last did; `observer_m` (n, m or 1, 3) where the observer is for them; `state`
    (n, 5 m) gaze directions, openness and distances of what they look at, where new.
    """

    is_new: npt.NDArray[np.bool_]
    is_moving: npt.NDArray[np.bool_]
    observer_m: npt.NDArray[np.float64]
    state: npt.NDArray[np.float64]


@compiled
def _follow(
    since_ns: npt.NDArray[np.int64],
    heads_m: npt.NDArray[np.float64],
    observer: npt.NDArray[np.float64],
    step_m: float,
    is_shown: bool,
    was_moving: bool,
    eyes: _Eyes,
    course: Course,
) -> None:
    """Write what eyes do at n times while they follow a head in steps: `EyeBehaviour.course`."""
    m = eyes.centre_m.shape[0]
    for i in range(since_ns.shape[0]):
        for j in range(observer.shape[0]):
            x = heads_m[i, j, 0] - observer[j, 0]
            y = heads_m[i, j, 1] - observer[j, 1]
            z = heads_m[i, j, 2] - observer[j, 2]
            if not x * x + y * y + z * z < step_m * step_m:
                observer[:] = heads_m[i]
                is_shown = False
                break
        is_moving = _eyes_at(since_ns[i], observer, eyes, course.state[i, : 4 * m])
        is_new = is_moving or was_moving or not is_shown
        if is_new:
            _distances(since_ns[i], observer, eyes, course.state[i, 4 * m :])
            was_moving, is_shown = is_moving, True
        course.is_new[i], course.is_moving[i] = is_new, was_moving
        course.observer_m[i] = observer


@dataclass(frozen=True)
class EyeBehaviour:
    """The behaviour of the eyes of m agents; every result is a function of time alone.

    `eye_centre_m` and `facing` (m, 3) as in the scene, `facing` NO_GAZE or NO_LIDS for agents
    without gaze, whose directions and distances are NaN, and openness without lids; `targets_m`
    (2, m, 3) the points looked at before and after each agent's turn; `follows_observer` (2, m)
    replaces a point by the observer's eyes wherever these are; `turn_ns` (m,) when the saccade
    from one to the other begins, `NEVER_NS` for none.

    Where the observer is, is one point (3,) for all agents, or (m, 3) for each of them as seen
    from `eye_centre_m`: nearer, say, for one who has come nearer. Points go along with agents.
    """

    eye_centre_m: npt.NDArray[np.float64]
    facing: npt.NDArray[np.float64]
    targets_m: npt.NDArray[np.float64]
    follows_observer: npt.NDArray[np.bool_]
    turn_ns: npt.NDArray[np.int64]
    blinks: Blinks
    without_gaze: Mapping[int, str] = field(default_factory=dict)
    """Who plays the agents that have no gaze."""

    @cached_property
    def _arrays(self) -> _Eyes:
        blinks = self.blinks
        return _Eyes(
            self.eye_centre_m,
            self.facing,
            self.targets_m,
            self.follows_observer,
            self.turn_ns,
            blinks.agent,
            blinks.start_ns,
            blinks.end_ns,
        )

    @classmethod
    def of_scene(cls, scene: Scene, *, target_m: Vector, blinks: Blinks) -> Self:
        """Let every agent of a scene look at one point."""
        m = len(scene.agents)
        facing = [
            a.facing if a.has_gaze else NO_GAZE if a.has_lids else NO_LIDS for a in scene.agents
        ]
        return cls(
            np.array([a.eye_centre_m for a in scene.agents], np.float64).reshape(m, 3),
            np.array(facing, np.float64).reshape(m, 3),
            np.tile(np.asarray(target_m, np.float64), (2, m, 1)),
            np.zeros((2, m), np.bool_),
            np.full(m, NEVER_NS, np.int64),
            blinks,
            {i: a.character for i, a in enumerate(scene.agents) if not a.has_gaze},
        )

    def staring(self, agent: int) -> Self:
        """Return the behaviour in which this agent looks at the observer all the time.

        Raises:
            DesignError: it has no gaze.
        """
        self._check_gaze(agent)
        follows = self.follows_observer.copy()
        follows[:, agent] = True
        return replace(self, follows_observer=follows)

    def turning(self, agent: int, t_ns: int, *, to_observer: bool) -> Self:
        """Return the behaviour in which this agent looks elsewhere from `t_ns` on.

        `to_observer` says whether it turns to the observer or from the observer to its point.

        Raises:
            DesignError: it has no gaze.
        """
        self._check_gaze(agent)
        follows = self.follows_observer.copy()
        follows[:, agent] = (not to_observer, to_observer)
        turn_ns = self.turn_ns.copy()
        turn_ns[agent] = t_ns
        return replace(self, follows_observer=follows, turn_ns=turn_ns)

    def _check_gaze(self, agent: int) -> None:
        if agent in self.without_gaze:
            raise DesignError(
                f"{self.without_gaze[agent]} has no gaze: it was imported without, and can look at "
                "nobody; let somebody whose eyes turn play this part"
            )

    def distance_m(self, t_ns: int, observer_eye_m: Vector) -> npt.NDArray[np.float64]:
        """Return how far (m,) from between their eyes what agents look at is."""
        distance_m = np.empty(len(self.turn_ns))
        _distances(t_ns, np.atleast_2d(observer_eye_m), self._arrays, distance_m)
        return distance_m

    def course(
        self,
        since_ns: npt.NDArray[np.int64],
        heads_m: Vector,
        observer_eye_m: Vector,
        step_m: float,
        *,
        is_shown: bool,
        was_moving: bool,
    ) -> Course:
        """Return what the eyes do at times (n,) at which an observer's head is at `heads_m`
        (n, m or 1, 3).

        They look for the observer where they last did, `observer_eye_m`, until the head is `step_m`
        away from there. `is_shown` says whether their state before the first time was
        shown, `was_moving` whether something moved then.
        """
        n, m = len(since_ns), len(self.turn_ns)
        course = Course(
            np.empty(n, np.bool_),
            np.empty(n, np.bool_),
            np.empty(heads_m.shape),
            np.empty((n, 5 * m)),
        )
        _follow(
            since_ns,
            heads_m,
            np.broadcast_to(observer_eye_m, heads_m.shape[1:]).copy(),
            step_m,
            is_shown,
            was_moving,
            self._arrays,
            course,
        )
        return course

    def at(self, t_ns: int, observer_eye_m: Vector) -> EyeState:
        """Return gaze directions (m, 3), unit, world; openness (m,) 0..1; whether anything moves.

        `observer_eye_m` is the midpoint between the observer's eyes in world.
        """
        m = len(self.turn_ns)
        state = np.empty(4 * m)
        is_moving = _eyes_at(t_ns, np.atleast_2d(observer_eye_m), self._arrays, state)
        return state[: 3 * m].reshape(m, 3), state[3 * m :], is_moving

"""The motion of everybody: their activities over time, posed at any time in a few calls."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, quat_from_yaw_pitch_deg, quat_multiply, rotate
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.gaze.eye_kernels import aim_rows, look_rows
from visavis.stimuli.gaze.fixation_kernels import sway_rows
from visavis.stimuli.gaze.gaze_plan import GazePlan
from visavis.stimuli.gaze.turning import Aimed, Gaze, Look
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.blending import CrossFade
from visavis.stimuli.motion.build import Build
from visavis.stimuli.motion.clip import Frames, Motion
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.faces import NEUTRAL, Face
from visavis.stimuli.motion.kinds import (
    NUMBERS,
    Kind,
    Mouth,
    Phone,
    Recorded,
    Run,
    Walk,
    code_of,
    kernel_of,
)
from visavis.stimuli.motion.placing_kernels import mix_rows, placed_rows
from visavis.stimuli.motion.posture_kernels import look_from, pose_rows
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.picture import PosedPeople

Index = npt.NDArray[np.int64]
MOUTH: Final = [MORPHS.index("jaw_open"), MORPHS.index("smile")]


@dataclass(frozen=True)
class Doing:
    """An activity from `start_s` on, taking over within `fade_s`. Without a place of its own it
    happens where the activity before has led to.
    """

    kind: Kind
    start_s: float = -np.inf
    fade_s: float = 0.8
    place_m: tuple[float, float, float] | None = None
    heading_deg: float | None = None


@dataclass(frozen=True, eq=False)
class Person:
    """One person: build, what they do, a seed of their own, and where they are.

    `place_m` (3,) is a point of the floor in world: below the hips of a sitter, between the feet
    of somebody standing, where a walk starts. `heading_deg` is left of −z. `face` is added to what
    lips and jaw do by themselves.
    """

    build: Build
    does: Kind | tuple[Doing, ...]
    seed: int
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading_deg: float = 0.0
    face: Face = NEUTRAL

    @property
    def plan(self) -> tuple[Doing, ...]:
        """The activities, one after the other."""
        return self.does if isinstance(self.does, tuple) else (Doing(self.does),)


@dataclass(frozen=True, eq=False)
class HeldHeads:
    """Heads that a study keeps in place: `eyes_m` (n, 3) between the eyes, `facing` (n, 3) unit.

    They sway about it by a few millimetres, as heads do. Rows that are NaN are not held.
    """

    eyes_m: Vector
    facing: Vector


@dataclass(frozen=True, eq=False)
class PeopleMotion:
    """n people as a function of time; a frame can be asked for again and is the same."""

    people: tuple[Person, ...]
    held_heads: HeldHeads | None = None

    def __post_init__(self) -> None:
        for i, person in enumerate(self.people):
            starts = [d.start_s for d in person.plan]
            if not starts or starts != sorted(starts):
                raise MotionError(f"person {i} has nothing to do, or things out of order")
            for d, later in zip(person.plan, person.plan[1:], strict=False):
                if later.start_s - d.start_s < d.fade_s:
                    raise MotionError(f"person {i} changes at {later.start_s} s before a fade ends")

    @cached_property
    def _builds(self) -> tuple[Vector, Vector, Index, Index]:
        """Lengths (n, B_SIZE), skeletons (k, 55, 3), whose is whose (n,), seeds (n,)."""
        distinct = {id(person.build.skeleton): person.build.skeleton for person in self.people}
        order = {key: i for i, key in enumerate(distinct)}
        return (
            np.array([_lengths_of(q) for q in self.people]).reshape(-1, p.B_SIZE),
            np.array([s.offsets_m for s in distinct.values()]).reshape(-1, p.JOINTS, 3),
            np.array([order[id(q.build.skeleton)] for q in self.people], dtype=np.int64),
            np.array([q.seed for q in self.people], dtype=np.int64),
        )

    @cached_property
    def _plan(self) -> "_Plan":
        return _plan_of(self.people)

    def _posture(self, t_s: Vector, doing: Index, rows: Index) -> Vector:
        """Return the posture (n, SIZE) of `rows` at what they do; others mean nothing."""
        lengths, _, _, seeds = self._builds
        plan = self._plan
        controls = np.zeros((len(self.people), p.SIZE))
        since = t_s - plan.zero_s[doing]
        numbers, codes = plan.numbers[doing], plan.codes[doing]
        for code in np.unique(codes[rows]):
            kernel_of(int(code))(
                rows[codes[rows] == code], since, seeds, numbers, lengths, controls
            )
        placed_rows(controls, plan.place_m[doing], plan.heading_rad[doing])
        return controls

    def posture(self, t_s: float | Vector) -> Vector:
        """Return the rows of posture (n, SIZE) in world that the solver turns into joints.

        `t_s` is a time, or one for each person (n,).
        """
        if not self.people:
            return np.zeros((0, p.SIZE))
        plan, own_s = self._plan, np.broadcast_to(t_s, len(self.people))
        has_begun = plan.start_s <= np.repeat(own_s, plan.lengths)
        begun_count = np.add.reduceat(has_begun.astype(np.int64), plan.first)
        doing = plan.first + np.maximum(begun_count, 1) - 1
        controls = self._posture(own_s, doing, np.arange(len(self.people)))
        share = (own_s - plan.start_s[doing]) / plan.fade_s[doing]
        rows = np.flatnonzero((doing > plan.first) & (share < 1.0))
        if rows.size:
            before = doing.copy()
            before[rows] -= 1
            earlier = self._posture(own_s, before, rows)[rows]
            mix_rows(controls, rows, earlier, share[rows])
        return controls

    def at(
        self,
        t_s: float,
        gaze: Gaze | None = None,
        *,
        turn_changes: Mapping[int, Callable[[Vector], Vector]] = MappingProxyType({}),
    ) -> PosedPeople:
        """Return everybody's pose at a time; without `gaze` people look around and blink.

        `turn_changes` replaces the joint turns (55, 4) of some people before their eyes are aimed.
        """
        return self.pose_of(self.posture(t_s), t_s, gaze, turn_changes)

    def pose_of(
        self,
        controls: Vector,
        t_s: float,
        gaze: Gaze | None,
        turn_changes: Mapping[int, Callable[[Vector], Vector]] = MappingProxyType({}),
    ) -> PosedPeople:
        """Return the poses of rows of posture (n, SIZE), which it changes; see `at`."""
        n = len(self.people)
        gaze = gaze or self._around
        _, offsets, skeleton_of, seeds = self._builds
        is_held, held_eyes, facing = self._held_arrays
        eyes, head, chest = np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 4))
        # How far trunk and head turn depends on where the eyes are, which the posture gives.
        look_from(controls, offsets, skeleton_of, eyes, head, chest)
        front = controls[:, p.FRONT : p.ATTEND + 3].copy()
        turns = gaze.turns_rad(t_s, Look(eyes, head, front, seeds))
        controls[:, p.TRUNK_YAW] += turns[:, 0]
        controls[:, p.HEAD_YAW] += turns[:, 1]
        controls[:, p.HEAD_PITCH] += turns[:, 2]
        if is_held.any():
            held_eyes, facing = held_eyes.copy(), facing.copy()
            sway_rows(t_s, seeds, held_eyes, facing)
        root, joints = np.empty((n, 3)), np.empty((n, p.JOINTS, 4))
        pose_rows(controls, offsets, skeleton_of, is_held, held_eyes, facing, root, joints)
        # People who play a clip take over its whole pose; eyes and lids are still aimed below.
        for i, motion in self._recordings.items():
            frame = motion.at(t_s)
            root[i], joints[i] = frame.root_m, frame.orientation_wxyz
        for i, change in turn_changes.items():
            joints[i] = change(joints[i])
        morphs = np.zeros((n, len(MORPHS)))
        morphs[:, MORPHS.index("jaw_open")] = controls[:, p.JAW]
        morphs[:, MORPHS.index("smile")] = controls[:, p.SMILE]
        for i, start_s, mouth in self._mouths:
            morphs[i, MOUTH] = mouth(t_s - start_s)
        for i, face in self._faces:
            morphs[i] = np.clip(morphs[i] + face.weights(t_s), -1.0, 1.0)
        look_rows(root, joints, offsets, skeleton_of, eyes, head)
        aim = gaze.aim(t_s, Look(eyes, head, front, seeds))
        aim_rows(
            root,
            offsets,
            skeleton_of,
            aim.direction,
            aim.distance_m,
            aim.openness_01,
            joints,
            morphs,
        )
        return PosedPeople(root, joints, morphs)

    @cached_property
    def _recordings(self) -> dict[int, Motion]:
        """Return the whole motion of everybody who plays a clip at some time."""
        return {
            i: _chain(person)
            for i, person in enumerate(self.people)
            if any(isinstance(d.kind, Recorded) for d in person.plan)
        }

    @cached_property
    def _mouths(self) -> tuple[tuple[int, float, Mouth], ...]:
        """Return whose mouth moves with a recording, and from when on."""
        return tuple(
            (i, d.start_s if np.isfinite(d.start_s) else 0.0, d.kind.mouth)
            for i, person in enumerate(self.people)
            for d in person.plan
            if isinstance(d.kind, Recorded) and d.kind.mouth is not None
        )

    @cached_property
    def _faces(self) -> tuple[tuple[int, Face], ...]:
        """Return who makes a face."""
        return tuple((i, q.face) for i, q in enumerate(self.people) if q.face != NEUTRAL)

    @cached_property
    def _around(self) -> Gaze:
        return GazePlan.of(len(self.people))

    @cached_property
    def _held_arrays(self) -> tuple[npt.NDArray[np.bool_], Vector, Vector]:
        n = len(self.people)
        if self.held_heads is None:
            return np.zeros(n, np.bool_), np.zeros((n, 3)), np.zeros((n, 3))
        eyes, facing = (
            np.asarray(x, np.float64) for x in (self.held_heads.eyes_m, self.held_heads.facing)
        )
        is_held = np.asarray(np.isfinite(np.hstack([eyes, facing])).all(axis=1), np.bool_)
        return is_held, eyes, facing


@dataclass(frozen=True, eq=False)
class _Plan:
    """All activities, one per row; `first` (n,) is the first row of each person, `lengths` (n,) how
    many they have.
    """

    first: Index
    lengths: Index
    start_s: Vector
    zero_s: Vector
    fade_s: Vector
    codes: Index
    numbers: Vector
    place_m: Vector
    heading_rad: Vector


def _lengths_of(person: Person) -> Vector:
    if any(isinstance(doing.kind, Phone) for doing in person.plan):
        return person.build.telephoning_m
    return person.build.lengths_m


def _places_of(person: Person) -> list[tuple[Vector, float]]:
    """Return place and heading of everything somebody does; a way leads on to its end."""
    at, heading = np.array(person.place_m, np.float64), float(np.radians(person.heading_deg))
    places = []
    for doing in person.plan:
        if doing.place_m is not None:
            at = np.array(doing.place_m, np.float64)
        if doing.heading_deg is not None:
            # The shorter way round from the heading before.
            turn = np.radians(doing.heading_deg) - heading
            heading += float((turn + np.pi) % (2 * np.pi) - np.pi)
        places.append((at, heading))
        if isinstance(doing.kind, Walk | Run) and np.isfinite(doing.kind.distance_m):
            ahead = np.array([-np.sin(heading), 0.0, -np.cos(heading)])
            at = at + doing.kind.distance_m * ahead
    return places


def _plan_of(people: Sequence[Person]) -> _Plan:
    lengths = [len(q.plan) for q in people]
    doings = [(q, d) for q in people for d in q.plan]
    places = [place for q in people for place in _places_of(q)]
    numbers = np.zeros((len(doings), NUMBERS))
    for i, (q, d) in enumerate(doings):
        own = d.kind.numbers(q.seed)
        numbers[i, : len(own)] = own
    start = np.array([d.start_s for _, d in doings], dtype=np.float64)
    return _Plan(
        np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64),
        np.array(lengths, dtype=np.int64),
        start,
        np.where(np.isfinite(start), start, 0.0),
        np.array([max(d.fade_s, 1e-9) for _, d in doings], dtype=np.float64),
        np.array([code_of(d.kind) for _, d in doings], dtype=np.int64),
        numbers,
        np.array([at for at, _ in places]).reshape(-1, 3),
        np.array([heading for _, heading in places]),
    )


@dataclass(frozen=True, eq=False)
class _Placed:
    """A clip carried to somebody's place, in the time of the session."""

    motion: Motion
    skeleton: Skeleton
    place_m: Vector
    heading_rad: float
    start_s: float

    def at(self, t_s: npt.ArrayLike) -> Frames:
        frames = self.motion.at(np.asarray(t_s, np.float64) - self.start_s)
        turn = quat_from_yaw_pitch_deg(float(np.degrees(self.heading_rad)))
        turns = frames.orientation_wxyz.copy()
        turns[..., 0, :] = quat_multiply(
            np.broadcast_to(turn, turns[..., 0, :].shape), turns[..., 0, :]
        )
        scale = self.skeleton.leg_m / self.motion.skeleton.leg_m
        root = rotate(np.broadcast_to(turn, (*frames.root_m.shape[:-1], 4)), scale * frames.root_m)
        return Frames(self.place_m + root, turns)


@dataclass(frozen=True, eq=False)
class Alone:
    """One thing that one person does, as a motion of its own; the head does not follow a gaze."""

    people: PeopleMotion

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton of the person."""
        return self.people.people[0].build.skeleton

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape."""
        times = np.asarray(t_s, np.float64)
        # Times stand for people, who cost a kernel's row each instead of a call of every kernel.
        each = PeopleMotion(self.people.people * times.size)
        at_rest = Aimed(np.full((times.size, 3), np.nan), np.ones(times.size))
        poses = each.pose_of(each.posture(times.ravel()), np.nan, at_rest)
        return Frames(
            poses.root_m.reshape(*times.shape, 3),
            poses.orientation_wxyz.reshape(*times.shape, p.JOINTS, 4),
        )


def _chain(person: Person) -> Motion:
    """Join everything somebody does by cross-fades."""
    whole: Motion | None = None
    for doing, (at, heading) in zip(person.plan, _places_of(person), strict=True):
        start_s = doing.start_s if np.isfinite(doing.start_s) else 0.0
        own: Motion
        if isinstance(doing.kind, Recorded):
            own = _Placed(doing.kind.motion, person.build.skeleton, at, heading, start_s)
        else:
            place = (float(at[0]), float(at[1]), float(at[2]))
            alone = replace(
                person,
                does=(Doing(doing.kind, doing.start_s),),
                place_m=place,
                heading_deg=float(np.degrees(heading)),
            )
            own = Alone(PeopleMotion((alone,)))
        if whole is None:
            whole = own
        else:
            whole = CrossFade(whole, own, start_s, max(doing.fade_s, 1e-3), start_s)
    if whole is None:
        raise MotionError("a person has no activity; give at least one")
    return whole

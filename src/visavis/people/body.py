"""Simulated bodies: a hand that points and presses, tracked segments, a standing body."""

from collections.abc import Collection, Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import EYES_DTYPE
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector
from visavis.people.body_kernels import (
    POINT_S,
    finger_rows,
    gaze_rows,
    head_rows,
    pointed_rows,
)
from visavis.people.resting_pose import pose_joints, resting_pose
from visavis.protocol.session.boards import ALONG_FINGERS, HAND

RELEASED_AFTER_NS: Final = NS_PER_S // 10
PUPIL_MM: Final = 3.5


class PointingHand:
    """A hand that points and presses; times count from the beginning of a stretch.

    `rest_m` (3,) is the point it points to before any question.
    """

    def __init__(self, rest_m: Vector) -> None:
        self._starts_s, self._points_m = np.array([-10.0]), np.array([rest_m])
        self._presses: list[tuple[int, str, float]] = []

    def point(self, start_s: float, goal_m: Vector) -> None:
        """Begin to point to another point (3,) at a time."""
        self._starts_s = np.append(self._starts_s, start_s)
        self._points_m = np.vstack([self._points_m, goal_m])

    def press(self, t_ns: int, control: str) -> None:
        """Press a control at a session time and release it."""
        self._presses += [(t_ns, control, 1.0), (t_ns + RELEASED_AFTER_NS, control, 0.0)]
        self._presses.sort(key=lambda press: press[0])

    def press_no_more(self, controls: Collection[str] | None = None) -> None:
        """Give up what it meant to press, of some controls or of all; what is pressed is still
        released.
        """
        to_press = {(t_ns, control) for t_ns, control, value in self._presses if value > 0}
        self._presses = [
            (t_ns, control, value)
            for t_ns, control, value in self._presses
            if (controls is not None and control not in controls)
            or (value <= 0 and (t_ns - RELEASED_AFTER_NS, control) not in to_press)
        ]

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield presses and releases since the last call."""
        while self._presses and self._presses[0][0] <= until_ns:
            yield self._presses.pop(0)

    def next_press_ns(self) -> int | None:
        """Return the time of the next press or release; None without one."""
        return self._presses[0][0] if self._presses else None

    def pointed_at(self, t_s: Vector) -> Vector:
        """Return the points (t, 3) it points to."""
        return pointed_rows(t_s, self._starts_s, self._points_m)


def segments_of(
    names: Sequence[str],
    at_m: Vector,
    eyes_m: Vector,
    head_wxyz: Vector,
    hand_m: Vector,
    pointed_m: Vector,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return positions (t, n, 3) and orientations (t, n, 4) of a pointing person's segments.

    The person sits or stands at rest with the eyes at `at_m` (3,) and the feet on the floor; low
    eyes mean sitting. The trunk follows the head: `eyes_m` (t, 3) is the middle between the eyes
    and `head_wxyz` (t, 4) the turn. The right hand is at `hand_m` (t, 3) and its fingers point to
    `pointed_m` (t, 3).

    Raises:
        DataError: the body has no such segment.
    """
    unknown = [name for name in names if name not in BODY_JOINTS]
    if unknown:
        raise DataError(
            f"the simulated body has no segment {', '.join(unknown)}; "
            f"it has {', '.join(BODY_JOINTS)}"
        )
    hand_wxyz = _fingers_to(hand_m, pointed_m)
    rest = resting_pose(*(round(float(v), 3) for v in at_m))
    all_m, all_wxyz = pose_joints(rest, eyes_m, head_wxyz, hand_m, hand_wxyz)
    indices = [rest.skeleton.index(name) for name in names]
    return all_m[:, indices], all_wxyz[:, indices]


def hand_alone(
    hand_m: Vector, pointed_m: Vector
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return only the right hand, as `segments_of` does; this needs no body."""
    return hand_m[:, None, :].copy(), _fingers_to(hand_m, pointed_m)[:, None, :]


def _fingers_to(hand_m: Vector, pointed_m: Vector) -> Vector:
    """Return turns (t, 4) of a right hand whose fingers point from hands to points, both (t, 3)."""
    # One memory layout, so that the kernel is compiled once.
    return finger_rows(np.ascontiguousarray(hand_m), pointed_m, ALONG_FINGERS)


class StandingBody:
    """A standing person who sways, looks from point to point with eyes and head, and points.

    The bodily part of `visavis.protocol.people.simulated_participant.SimulatedParticipant`; a
    subclass adds identity and answers. `eye_m` (3,) is the position of the eyes when upright,
    `sway_rad` (3,) the initial phase of the sway, `ahead_m` the point looked at without
    instruction, `hand_m` the position of the right hand and `rest_m` the point it points to.
    """

    def __init__(
        self, eye_m: Vector, sway_rad: Vector, *, ahead_m: Vector, hand_m: Vector, rest_m: Vector
    ) -> None:
        self._eye, self._sway = eye_m, sway_rad
        self._ahead, self._hand_m, self._rest = ahead_m, hand_m, rest_m
        self._fit = 0
        self.prepare(0, 0)

    # ---- SimulatedParticipant ----

    def prepare(self, stretch: int, t_ns: int) -> None:
        """Begin a new stretch of behaviour at this session time: look ahead, the hand down."""
        self._stretch, self._origin_ns = stretch, t_ns
        self._looks: list[tuple[float, Vector]] = [(-10.0, self._ahead)]
        self._look_rows: tuple[Vector, Vector, Vector] | None = None
        self.hand = PointingHand(self._rest)

    def wear(self, fit: int) -> None:
        """Put the headset on anew."""
        self._fit = fit

    def look_at(self, target_world_m: Sequence[float] | None, t_ns: int) -> None:
        """Follow the instruction to look at a point; None ends it."""
        point = self._ahead if target_world_m is None else target_world_m
        self.look(self.since_s(t_ns) + 0.2, np.array(point, dtype=np.float64))

    # ---- MovingBody ----

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return true eye states, shape (n,), dtype `EYES_DTYPE`."""
        eyes = np.zeros(t_ns.shape[0], EYES_DTYPE)
        t_s = (t_ns - self._origin_ns) / NS_PER_S
        starts_s, points_m, _ = self._looks_now()
        left, right = gaze_rows(t_s, starts_s, points_m, *self._heads(t_s))
        eyes["left_direction_head"], eyes["right_direction_head"] = left, right
        eyes["openness_01"] = 1.0
        eyes["pupil_mm"] = PUPIL_MM
        return eyes

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) in metres and orientation (4,) (w, x, y, z) in world."""
        position, turn = self._heads(np.array([self.since_s(t_ns)]))
        return position[0], turn[0]

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true positions (t, n, 3) and orientations (t, n, 4) of segments in world."""
        t_s = (t_ns - self._origin_ns) / NS_PER_S
        eyes_m, turn = self._heads(t_s)
        hand_m = self._hand_m + eyes_m - self._eye
        if tuple(names) == (HAND,):
            return hand_alone(hand_m, self.hand.pointed_at(t_s))
        return segments_of(names, self._eye, eyes_m, turn, hand_m, self.hand.pointed_at(t_s))

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Feel a vibration; it changes nothing in this body."""

    def stretch(self) -> int:
        """Return the number of the present stretch of behaviour."""
        return self._stretch

    def fit(self) -> int:
        """Return how the headset sits."""
        return self._fit

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield presses and releases since the last call."""
        return self.hand.presses(until_ns)

    def next_press_ns(self) -> int | None:
        """Return when something is pressed or let go of next."""
        return self.hand.next_press_ns()

    # ---- for subclasses ----

    def since_s(self, t_ns: int) -> float:
        """Return a session time as seconds since the stretch began."""
        return (t_ns - self._origin_ns) / NS_PER_S

    def look(self, t_s: float, point_m: Vector) -> None:
        """Look at a point from a time on; later planned looks are dropped."""
        self._look_rows = None
        self._looks = [look for look in self._looks if look[0] < t_s]
        self._looks.append((t_s, point_m))

    def answer_at(self, board_m: Vector, choice_m: Vector, t_s: float, takes_s: float) -> None:
        """Look at a board (3,), then at a choice, point to it and pull the trigger."""
        begin_s = t_s + takes_s - POINT_S
        self.look(t_s + 0.2, board_m)
        self.look(begin_s, choice_m)
        self.hand.point(begin_s, choice_m)
        self.hand.press(self._origin_ns + round((t_s + takes_s + 0.1) * NS_PER_S), "trigger")

    # ---- within ----

    def _looks_now(self) -> tuple[Vector, Vector, Vector]:
        """Return when each look begins (n,), its point (n, 3), its yaw and pitch (n, 2)."""
        if self._look_rows is None:
            starts_s = np.array([start_s for start_s, _ in self._looks])
            points_m = np.array([point for _, point in self._looks])
            x, y, z = (points_m - self._eye).T
            aims_rad = np.stack([np.arctan2(-x, -z), np.arctan2(y, np.hypot(x, z))], axis=1)
            self._look_rows = starts_s, points_m, aims_rad
        return self._look_rows

    def _heads(self, t_s: Vector) -> tuple[Vector, Vector]:
        starts_s, _, aims_rad = self._looks_now()
        return head_rows(t_s, starts_s, aims_rad, self._eye, self._sway)

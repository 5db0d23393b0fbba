"""Ask on a board in the headset; answers come by pointing and confirming, dwelling, or a digit.

One generator asks for both callers: a trial that yields its steps to the session, and the session
itself between trials. What may answer is data (`Ways`).
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np

from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.geometry import Pose, rotate, turn_towards
from visavis.protocol.plan.steps import AskReply, FrameView, NextFrame, Show, Step
from visavis.stimuli.panels import choice_met
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame

CONFIRM: Final = ("trigger", "select")
"""Controls that take the choice pointed at (or looked at, where nothing points)."""
BACK: Final = ("left", "up")
ON: Final = ("right", "down")
"""Controls that go from choice to choice, for those who have keys and nothing to point with."""
LEAVE_OUT_KEY: Final = "0"
HAND: Final = "right_hand"
ALONG_FINGERS: Final = np.array([1.0, 0.0, 0.0])
"""Direction of a right hand in the frame of body trackers: to the right, with the arm held out."""
AHEAD: Final = np.array([0.0, 0.0, -1.0])
NEXT: Final = NextFrame()
Showing: TypeAlias = Callable[[FrameView, Panel], Show | None]
Steps: TypeAlias = Generator[Step, FrameView | AskReply | None, "BoardAnswer"]
NOTHING_IN_TIME: Final = "nothing in time"
"""By whom an answer is that nobody gave before the limit."""


@dataclass(frozen=True)
class DwellRule:
    """How long a choice must be looked at; gaze lost or elsewhere for `gap_ms` starts again."""

    dwell_ms: int = 1200
    gap_ms: int = 150


@dataclass(frozen=True)
class Ways:
    """How questions are answered on boards.

    Without a choice within `limit_s` the question is left unanswered. A choice is taken after a
    look as long as `dwell` says, or earlier by a button. Gaze does not count while a hand or
    controller points anywhere or, with `gaze_beside_hand`, at a choice. Controllers always point; a
    tracked hand and the head do where `hand_points` and `head_points` say so; `beside_01` above or
    below a button, of the board's height, still counts. With `can_leave_out` the digit 0 stands for
    the last choice.
    """

    limit_s: float = 30.0
    dwell: DwellRule | None = field(default_factory=DwellRule)
    hand_points: bool = True
    head_points: bool = True
    gaze_beside_hand: bool = False
    beside_01: float = 0.04
    can_leave_out: bool = False


QUESTIONNAIRE: Final = Ways(
    hand_points=False, head_points=False, gaze_beside_hand=True, beside_01=0.0, can_leave_out=True
)
"""Ways of answering between trials, when hands hang down and controllers are put aside."""


@dataclass(frozen=True, eq=False)
class Ray:
    """A ray along −z of the pose that points; `is_hand` says whether it is a hand's."""

    pose: Pose
    is_hand: bool


@dataclass(frozen=True)
class BoardAnswer:
    """A choice on a board, None where nothing was chosen in time.

    `by` is "keys", "ray", "gaze" or "gaze and button"; `pose` what pointed. `asked_ns` is the
    first frame that showed the board, `view` the frame of the answer.
    """

    choice: int | None
    by: str
    asked_ns: int
    view: FrameView
    pose: Pose | None = None


class GazeDwell:
    """Follow which choice is being looked at, and for how long."""

    def __init__(self, rule: DwellRule) -> None:
        self._rule = rule
        self.choice: int | None = None
        self._since_ns = self._last_ns = 0

    def take(self, choice: int | None, t_ns: int) -> int | None:
        """Take one gaze sample; return the choice once it has been looked at long enough."""
        is_anew = t_ns - self._last_ns > self._rule.gap_ms * NS_PER_MS  # or no sample came
        if choice is not None and (is_anew or choice != self.choice):
            self.choice, self._since_ns = choice, t_ns
        if choice is not None:
            self._last_ns = t_ns
        elif is_anew:
            self.choice = None
        if self.choice is None or choice is None:
            return None
        return choice if t_ns - self._since_ns >= self._rule.dwell_ms * NS_PER_MS else None

    def look(self, panel: Panel, view: FrameView, since_ns: int) -> int | None:
        """Take a frame's samples from `since_ns` on; return what was looked at long enough."""
        gaze = view.gaze
        t_ns, valid = gaze.t_ns.tolist(), gaze.valid.tolist()
        origin_m, direction = gaze.origin_world_m, gaze.direction_world
        for i, at_ns in enumerate(t_ns):
            if at_ns < since_ns:
                continue
            gaze_choice = choice_met(panel, origin_m[i], direction[i]) if valid[i] else None
            dwell_choice = self.take(gaze_choice, at_ns)
            if dwell_choice is not None:
                return dwell_choice
        return None


def ask_on_board(panel: Panel, ways: Ways, first: Show | None, show: Showing) -> Steps:
    """Show a board until something is chosen; yields steps of the engine.

    `first` shows the board; `show` returns the step that shows it in a later frame, None while
    nothing changes: it is called in every frame, with the choice pointed at highlighted. Once keys
    have gone to a choice, neither gaze nor rays take another.
    """
    yield from show_step(first)
    view = yield from frame()
    asked_ns = view.t_ns
    until_ns = asked_ns + round(ways.limit_s * NS_PER_S)
    ray: Ray | None = None
    dwell = None if ways.dwell is None else GazeDwell(ways.dwell)
    key_choice: int | None = None
    # Presses up to this frame were made before the board was there.
    view = view._replace(pressed=(), pressed_ns=())
    while view.t_ns < until_ns:
        ray = newer_ray(ray, view, ways)
        ray_choice, pose = _choice_pointed_at(ray, view, panel, ways)
        by_hand = ray is not None and ray.is_hand
        gaze_counts = ray_choice is None if ways.gaze_beside_hand else not by_hand
        gaze_choice = None if dwell is None else dwell.look(panel, view, asked_ns)
        at_gaze = dwell.choice if dwell is not None and gaze_counts else None
        highlight = ray_choice if at_gaze is None else at_gaze
        for control in view.pressed:
            key_choice = _step(key_choice, control, len(panel.choices))
            if control in CONFIRM and key_choice is not None:
                return BoardAnswer(key_choice, "keys", asked_ns, view)
            if control in CONFIRM and highlight is not None:
                by = "ray" if at_gaze is None else "gaze and button"
                return BoardAnswer(highlight, by, asked_ns, view, pose if at_gaze is None else None)
            digit = _of_digit(control, len(panel.choices), ways.can_leave_out)
            if digit is not None:
                return BoardAnswer(digit, "keys", asked_ns, view)
        if key_choice is not None:
            highlight = key_choice
        elif gaze_choice is not None and gaze_counts:
            return BoardAnswer(gaze_choice, "gaze", asked_ns, view)
        yield from show_step(show(view, replace(panel, highlighted=highlight)))
        view = yield from frame()
    return BoardAnswer(None, NOTHING_IN_TIME, asked_ns, view)


def newer_ray(before: Ray | None, view: FrameView, ways: Ways | None = None) -> Ray | None:
    """Return how the participant points now: controller, tracked hand, or the head.

    A hand or controller once tracked is not replaced by the head.
    """
    ways = Ways() if ways is None else ways
    if view.pointers:
        return Ray(view.pointers[0], is_hand=True)
    body = view.body
    if ways.hand_points and body is not None and HAND in body.segments:
        k = body.segments.index(HAND)
        if body.valid[-1, k]:
            turn = body.orientation_wxyz[-1, k]
            towards = turn_towards(rotate(turn, ALONG_FINGERS))
            return Ray(Pose(body.position_m[-1, k], towards), is_hand=True)
    if before is not None and before.is_hand and ways.hand_points:
        return before
    if not (ways.head_points and view.head_points):
        return None
    return Ray(view.head, is_hand=False) if view.head_valid else before


def choice_under(ray: Pose | None, panel: Panel, beside_01: float = Ways.beside_01) -> int | None:
    """Return which choice a ray meets, None for none."""
    if ray is None:
        return None
    forward = rotate(ray.orientation_wxyz, AHEAD)
    return choice_met(panel, ray.position_m, forward, beside_01=beside_01)


def _choice_pointed_at(
    ray: Ray | None, view: FrameView, panel: Panel, ways: Ways
) -> tuple[int | None, Pose | None]:
    """Return the choice pointed at and what points: the first controller that meets one."""
    poses = view.pointers or (() if ray is None else (ray.pose,))
    for pose in poses:
        choice = choice_under(pose, panel, ways.beside_01)
        if choice is not None:
            return choice, pose
    return None, None


def _step(at: int | None, control: str, n: int) -> int | None:
    """Return the choice a key goes to: from one to the next, at first to the nearest end."""
    if control in ON:
        return 0 if at is None else min(at + 1, n - 1)
    if control in BACK:
        return n - 1 if at is None else max(at - 1, 0)
    return at


def keys_of_choice(choice: int | None, controls: Sequence[str]) -> tuple[str, ...]:
    """Return what to press for a choice, counted from 0, with these controls; () if none does.

    None leaves a question out.
    """
    if choice is None:
        return (LEAVE_OUT_KEY,) if LEAVE_OUT_KEY in controls else ()
    digit = str(choice + 1)
    if len(digit) == 1 and digit in controls:
        return (digit,)
    on = next((c for c in ON if c in controls), None)
    confirm = next((c for c in CONFIRM if c in controls), None)
    return () if on is None or confirm is None else (*[on] * (choice + 1), confirm)


def _of_digit(key: str, n: int, can_leave_out: bool) -> int | None:
    """Return the choice of a digit: 1 is the first; 0 the last, where that leaves out."""
    if not key.isdigit():
        return None
    if can_leave_out and key == LEAVE_OUT_KEY:
        return n - 1
    number = int(key)
    return number - 1 if 1 <= number <= n - can_leave_out else None


def frame(
    quiet_until_ns: int = 0, update: Callable[[FrameView], SceneFrame | None] | None = None
) -> Generator[Step, FrameView | AskReply | None, FrameView]:
    """Wait for the next frame; quiet ones may be passed, see `NextFrame`."""
    view = yield NextFrame(quiet_until_ns, update) if quiet_until_ns else NEXT
    if not isinstance(view, FrameView):
        raise TypeError(f"a plan that asked for a frame was sent {view!r}")
    return view


def show_step(step: Show | None) -> Generator[Step, FrameView | AskReply | None, None]:
    """Show the given step, if there is one."""
    if step is not None:
        yield step

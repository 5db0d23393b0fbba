"""Ask one question, whatever it is asked on: a board, a ray, gaze, keys, or the terminal.

Every way ends in an `Answer`: the option chosen, how, when it was asked and when answered.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np

from lab.clock import NS_PER_MS, NS_PER_S
from lab.geometry import Pose, Vector, rotate, turn_towards, yaw_pitch_deg_of
from protocol.panel_questions import DwellRule, GazeDwell, dwelt
from protocol.steps import Answered, Ask, FrameView, NextFrame, Scalar, Show, Step
from stimuli.panels import choice_met
from stimuli.picture import Panel

Frames: TypeAlias = Generator[Step, FrameView | Answered | None, FrameView]
Asking: TypeAlias = Generator[Step, FrameView | Answered | None, "Answer"]
CONFIRM: Final = ("trigger", "select")
"""Controls that take what is pointed at."""
HAND: Final = "right_hand"
ALONG_FINGERS: Final = np.array([1.0, 0.0, 0.0])
"""Of a right hand in the frame that trackers of bodies use: with the arm held out, to the right."""
AHEAD: Final = np.array([0.0, 0.0, -1.0])
BESIDE_01: Final = 0.04
"""How far above or below a button still counts, of the board's height."""
NEXT: Final = NextFrame()


@dataclass(frozen=True)
class Answer:
    """What was answered: `option` is None when the question was left out.

    `by` is "ray", "gaze", "keys", "keyboard" or "operator" (given over after the limit); `pose`
    is what pointed, where something did. `view` is the frame of the answer.
    """

    option: str | None
    by: str
    asked_ns: int
    answered_ns: int
    view: FrameView
    pose: Pose | None = None

    @property
    def ms(self) -> float:
        """Time from the frame that showed the question to the answer."""
        return (self.answered_ns - self.asked_ns) / NS_PER_MS


@dataclass(frozen=True)
class Ways:
    """How questions are answered on boards.

    `limit_s` after the board appeared the question is given over to the operator. While neither a
    hand nor a controller is tracked, a choice looked at for as long as `dwell` says is taken, and
    before that by a button; `head_points` lets the head point where there is no gaze either.
    """

    limit_s: float = 30.0
    dwell: DwellRule | None = field(default_factory=DwellRule)
    head_points: bool = True


@dataclass(frozen=True, eq=False)
class Ray:
    """From where and along which −z somebody points; `is_hand` says whether with a hand."""

    pose: Pose
    is_hand: bool


def frame() -> Frames:
    """Wait for the next frame."""
    view = yield NEXT
    if not isinstance(view, FrameView):
        raise TypeError(f"a plan that asked for a frame was sent {view!r}")
    return view


def newer_ray(before: Ray | None, view: FrameView, *, head_points: bool = True) -> Ray | None:
    """Return how the participant points now: controller, tracked hand, or the head.

    A hand or controller once tracked is not replaced by the head.
    """
    if view.pointers:
        return Ray(view.pointers[0], is_hand=True)
    body = view.body
    if body is not None and HAND in body.segments:
        k = body.segments.index(HAND)
        if body.valid[-1, k]:
            turn = body.orientation_wxyz[-1, k]
            towards = turn_towards(rotate(turn, ALONG_FINGERS))
            return Ray(Pose(body.position_m[-1, k], towards), is_hand=True)
    if (before is not None and before.is_hand) or not head_points:
        return before
    return Ray(view.head, is_hand=False) if view.head_valid else before


def chosen_by(ray: Pose | None, panel: Panel) -> int | None:
    """Return which choice a ray meets, None for none."""
    if ray is None:
        return None
    forward = rotate(ray.orientation_wxyz, AHEAD)
    return choice_met(panel, ray.position_m, forward, beside_01=BESIDE_01)


def asked_on_board(
    panel: Panel,
    options: tuple[str, ...],
    question_id: str,
    ways: Ways,
    view: FrameView,
    show: Callable[[FrameView, Panel], Show | None],
) -> Asking:
    """Ask on a board: pointed at and confirmed, looked at for long, a digit, else the operator.

    `show` returns the step that shows the board in a frame, None while nothing changes; it is
    called in every frame, with the choice pointed at highlighted.
    """
    yield from _shown(show(view, panel))
    view = yield from frame()
    asked_ns = view.t_ns
    until_ns = asked_ns + round(ways.limit_s * NS_PER_S)
    ray: Ray | None = None
    dwell = None if ways.dwell is None else GazeDwell(ways.dwell)
    # What was pressed up to this frame was pressed before the board was there.
    view = replace(view, pressed=())
    while view.t_ns < until_ns:
        ray = newer_ray(ray, view, head_points=ways.head_points)
        by_hand = ray is not None and ray.is_hand
        looked = None
        if dwell is not None and not by_hand:
            looked = dwelt(dwell, panel, view, asked_ns)
        at_gaze = None if dwell is None or by_hand else dwell.choice
        lit = chosen_by(None if ray is None else ray.pose, panel) if at_gaze is None else at_gaze
        for control in view.pressed:
            if control in CONFIRM and lit is not None:
                if at_gaze is not None or ray is None:
                    return Answer(options[lit], "gaze", asked_ns, view.t_ns, view)
                return Answer(options[lit], "ray", asked_ns, view.t_ns, view, ray.pose)
            if control.isdigit() and 1 <= int(control) <= len(options):
                return Answer(options[int(control) - 1], "keys", asked_ns, view.t_ns, view)
        if looked is not None:
            return Answer(options[looked], "gaze", asked_ns, view.t_ns, view)
        yield from _shown(show(view, replace(panel, highlighted=lit)))
        view = yield from frame()
    return (
        yield from asked_elsewhere(
            question_id, panel.text, options, panel.choices, view, "operator", asked_ns
        )
    )


def asked_elsewhere(
    question_id: str,
    prompt: str,
    options: tuple[str, ...],
    labels: tuple[str, ...],
    view: FrameView,
    by: str = "keyboard",
    asked_ns: int | None = None,
) -> Asking:
    """Ask whoever answers at the terminal; without `options` the answer is free text."""
    began_ns = view.t_ns if asked_ns is None else asked_ns
    reply = yield Ask(question_id, prompt, labels)
    view = yield from frame()
    said = reply.answer if isinstance(reply, Answered) else None
    option = said if said is None or not options else options[labels.index(said)]
    return Answer(option, by, began_ns, view.t_ns, view)


def pressed(controls: tuple[str, ...], limit_s: float, view: FrameView, from_ns: int,
            each_frame: Callable[[FrameView], Show | None]) -> Asking:  # fmt: skip
    """Wait for one of several controls, timed from `from_ns`; missing after `limit_s`."""
    until_ns = from_ns + round(limit_s * NS_PER_S)
    while True:
        for control in view.pressed:
            if control in controls and view.t_ns > from_ns:
                return Answer(control, "keys", from_ns, view.t_ns, view)
        if view.t_ns >= until_ns:
            return Answer(None, "nothing in time", from_ns, view.t_ns, view)
        yield from _shown(each_frame(view))
        view = yield from frame()


def pointed(limit_s: float, view: FrameView,
            each_frame: Callable[[FrameView], Show | None]) -> Asking:  # fmt: skip
    """Wait until a direction is pointed at and confirmed."""
    asked_ns = view.t_ns
    until_ns = asked_ns + round(limit_s * NS_PER_S)
    ray: Ray | None = None
    while view.t_ns < until_ns:
        ray = newer_ray(ray, view)
        if ray is not None and any(c in CONFIRM for c in view.pressed) and view.t_ns > asked_ns:
            return Answer("", "ray", asked_ns, view.t_ns, view, ray.pose)
        yield from _shown(each_frame(view))
        view = yield from frame()
    return Answer(None, "nothing in time", asked_ns, view.t_ns, view)


def direction_columns(name: str, pose: Pose | None, heads_m: Vector, places: tuple[str, ...],
                      within_deg: float = 10.0) -> dict[str, Scalar | None]:  # fmt: skip
    """Return who and where was pointed at: the nearest head (n, 3) within an angle of the ray."""
    if pose is None:
        return {name: None, f"{name}_yaw_deg": None, f"{name}_pitch_deg": None}
    forward = rotate(pose.orientation_wxyz, AHEAD)
    yaw_deg, pitch_deg = yaw_pitch_deg_of(forward)
    who: str | None = None
    if len(places):
        to = heads_m - pose.position_m
        to = to / np.linalg.norm(to, axis=1, keepdims=True)
        chord = np.linalg.norm(to - forward, axis=1)
        nearest = int(np.argmin(chord))
        if np.degrees(2 * np.arcsin(min(1.0, float(chord[nearest]) / 2))) <= within_deg:
            who = places[nearest]
    return {name: who, f"{name}_yaw_deg": round(float(yaw_deg), 3),
            f"{name}_pitch_deg": round(float(pitch_deg), 3)}  # fmt: skip


def _shown(step: Show | None) -> Generator[Step, FrameView | Answered | None, None]:
    if step is not None:
        yield step

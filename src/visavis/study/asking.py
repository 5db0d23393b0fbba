"""Ask one question on a board, by ray, gaze or keys, or at the terminal.

Every way ends in an `Answer`: the option chosen, how, when it was asked and when answered.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.geometry import Pose, Vector, rotate, yaw_pitch_deg_of
from visavis.protocol.plan.steps import Ask, AskReply, FrameView, Scalar, Step
from visavis.protocol.session.boards import (
    AHEAD,
    CONFIRM,
    NOTHING_IN_TIME,
    Ray,
    Showing,
    Ways,
    ask_on_board,
    newer_ray,
)
from visavis.protocol.session.boards import frame as frame
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame
from visavis.study.frames import show_frame

Asking: TypeAlias = Generator[Step, FrameView | AskReply | None, "Answer"]


@dataclass(frozen=True)
class Answer:
    """The answer to a question: `option` is None when the question was left out.

    `by` is "ray", "gaze", "keys", "keyboard" or "operator" (who took over after the time limit);
    `pose` is that of the hand or head that pointed, if one did. `view` is the frame of the answer.
    """

    option: str | None
    by: str
    asked_ns: int
    answered_ns: int
    view: FrameView
    pose: Pose | None = None
    is_right: bool | None = None
    """Whether it is the right one; None where nothing was answered, or nothing is right."""

    @property
    def ms(self) -> float:
        """Time from the frame that showed the question to the answer."""
        return (self.answered_ns - self.asked_ns) / NS_PER_MS


def asked_on_board(
    panel: Panel,
    options: tuple[str, ...],
    question_id: str,
    ways: Ways,
    view: FrameView,
    show: Showing,
) -> Asking:
    """Ask on a board; the answer comes by pointing, dwelling gaze, a digit or the operator.

    `show` returns the step that shows the board in a frame, None while nothing changes.
    """
    board_answer = yield from ask_on_board(panel, ways, show(view, panel), show)
    if board_answer.choice is not None:
        by = "gaze" if board_answer.by.startswith("gaze") else board_answer.by
        t_ns, option = board_answer.view.t_ns, options[board_answer.choice]
        return Answer(option, by, board_answer.asked_ns, t_ns, board_answer.view, board_answer.pose)
    view, asked_ns = board_answer.view, board_answer.asked_ns
    return (
        yield from ask_at_terminal(
            question_id, panel.text, options, panel.choices, view, "operator", asked_ns
        )
    )


def ask_at_terminal(
    question_id: str,
    prompt: str,
    options: tuple[str, ...],
    labels: tuple[str, ...],
    view: FrameView,
    by: str = "keyboard",
    asked_ns: int | None = None,
) -> Asking:
    """Ask at the terminal; without `options` the answer is free text."""
    began_ns = view.t_ns if asked_ns is None else asked_ns
    reply = yield Ask(question_id, prompt, labels)
    view = yield from frame()
    answer_text = reply.answer if isinstance(reply, AskReply) else None
    option = (
        answer_text if answer_text is None or not options else options[labels.index(answer_text)]
    )
    return Answer(option, by, began_ns, view.t_ns, view)


def presses_of(view: FrameView) -> list[tuple[str, int]]:
    """Return what was pressed in a frame, and when: at its own time where that is known."""
    heard_ns = view.pressed_ns or (view.t_ns,) * len(view.pressed)
    return list(zip(view.pressed, heard_ns, strict=True))


def press_in(
    view: FrameView, controls: tuple[str, ...], from_ns: int, until_ns: int
) -> Answer | None:
    """Return the first press of one of several controls that a frame brought, at its own time."""
    for control, t_ns in presses_of(view):
        if control in controls and from_ns < t_ns <= until_ns:
            return Answer(control, "keys", from_ns, t_ns, view)
    return None


def await_press(
    controls: tuple[str, ...],
    limit_s: float,
    view: FrameView,
    from_ns: int,
    each_frame: Callable[[FrameView], SceneFrame | None],
) -> Asking:
    """Wait for one of several controls, timed from `from_ns`; missing after `limit_s`.

    The answer bears the time at which the press was heard, not that of the frame after it.
    """
    until_ns = from_ns + round(limit_s * NS_PER_S)
    while True:
        answer = press_in(view, controls, from_ns, until_ns)
        if answer is not None:
            return answer
        if view.t_ns >= until_ns:
            return Answer(None, NOTHING_IN_TIME, from_ns, view.t_ns, view)
        yield from show_frame(each_frame(view))
        view = yield from frame(until_ns, each_frame)


def await_pointing(
    limit_s: float, view: FrameView, each_frame: Callable[[FrameView], SceneFrame | None]
) -> Asking:
    """Wait until a direction is pointed at and confirmed."""
    asked_ns = view.t_ns
    until_ns = asked_ns + round(limit_s * NS_PER_S)
    ray: Ray | None = None
    while view.t_ns < until_ns:
        ray = newer_ray(ray, view)
        if ray is not None and any(c in CONFIRM for c in view.pressed) and view.t_ns > asked_ns:
            return Answer("", "ray", asked_ns, view.t_ns, view, ray.pose)
        yield from show_frame(each_frame(view))
        view = yield from frame()
    return Answer(None, NOTHING_IN_TIME, asked_ns, view.t_ns, view)


def direction_columns(
    name: str, pose: Pose | None, heads_m: Vector, places: tuple[str, ...], within_deg: float = 10.0
) -> dict[str, Scalar | None]:
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
    return {
        name: who,
        f"{name}_yaw_deg": round(float(yaw_deg), 3),
        f"{name}_pitch_deg": round(float(pitch_deg), 3),
    }

"""How a live figure is moulded, or watched, before a monitor or in a headset: a board beside it.

The board has a row for every slider, one that turns the figure where the camera is free, and a
button. Keys go from row to row (up, down) and move the slider (left, right) by a twentieth of its
range; the trigger puts it where a controller or a tracked hand (without them the head) points.
Before a monitor nothing points.

Figures that are watched (`LiveScene`) have the same board without sliders; its button counts once
they have been seen for as long as the study asks.

The figure stands straight ahead, seen from the side and the distance at which a page's camera
stands (`Live.eye_m`), in the room and the light of films. A monitor shows less than that camera:
before it the figure is farther away, and its middle at the height of the eyes.
"""

import json
from collections.abc import Generator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np

from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, quat_multiply, rotate
from visavis.protocol.plan.steps import AskReply, FrameView, Mark, Show, Step
from visavis.protocol.session.boards import AHEAD, CONFIRM, ON, Ray, frame, newer_ray
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.pose_distance import Likeness, compared_joints
from visavis.stimuli.panels import (
    PanelFrame,
    choice_boxes_01,
    place_m,
    place_met_01,
    track_01,
    track_boxes_01,
)
from visavis.stimuli.picture import Panel, PosedPeople
from visavis.stimuli.scenes.live_figures import LiveFigures
from visavis.study.live import Live, LiveScene, Moulding, Near, Slider

PRESS_01: Final = 0.05
"""How far a key moves a slider, as a share of its range; at least a step of it."""
TURN_DEG: Final = 15.0
APART_M: Final = 0.55
"""Two figures stand so far to both sides, as on a page."""
FILMED_M: Final = 2.6
"""How far ahead films show a person, in the plain room."""
FARTHER_01: Final = 1.3
BOARD_M: Final = (0.3, 0.64)
BOARD_AT_M: Final = (0.51, 0.0, -1.7)
"""The middle of the board as seen from the head: right of the figure, within a monitor."""
KNOB_M: Final = (0.014, 0.034)
SCENE: Final = "live"
ROWS, ACROSS = ("up", "down"), ("left", "right")
FIGURE_ON, SLIDER_MOVED, FIGURE_TURNED = "figure_on", "slider_moved", "figure_turned"
"""Events: a figure is seen, a slider was moved, the figure was turned."""


@dataclass(frozen=True, slots=True)
class MouldingFrame(PanelFrame):
    """Live figures with the board on which one is moulded."""

    moulding: Moulding | None = None
    by_keys: bool = False
    """Whether nothing points, as before a monitor."""


@dataclass(frozen=True)
class BoardWords:
    """What the board says: above the rows, the sliders' names, the figure's turn, the button, and
    how it is worked by keys and by pointing.
    """

    caption: str
    sliders: tuple[str, ...]
    turn: str
    done: str
    keys: str
    ray: str


@dataclass(frozen=True)
class Change:
    """A slider's new value, or a new turn of the figure where `slider` is None."""

    slider: int | None
    value: float
    by: str
    t_ns: int


@dataclass(frozen=True, eq=False)
class MouldingEnd:
    """What came of it: the last values, changes in order, frames drawn, and why it ended."""

    values: tuple[float, ...]
    changes: tuple[Change, ...]
    frames: int
    ended_by: str
    by: str
    """What pressed the button; limit where nothing did."""
    on_ns: int
    distance_m: float | None
    view: FrameView


Steps: TypeAlias = Generator[Step, FrameView | AskReply | None, MouldingEnd]


def press_step(slider: Slider) -> float:
    """Return how far a key moves a slider: a twentieth of its range, in whole steps."""
    return max(1, round(PRESS_01 * (slider.high - slider.low) / slider.step)) * slider.step


class Walking:
    """A blend that walks in place; other weights go on from the same moment of a step."""

    def __init__(self, examples: Examples, shares: Vector, t_ns: int) -> None:
        self._blend = Blend(examples, shares, in_place=True)
        self._from_s, self._from_ns = 0.0, t_ns

    def change(self, shares: Vector, t_ns: int) -> None:
        """Take other weights (n,) from a session time on."""
        phase = self._blend.phase_of(self._own_s(t_ns))
        self._blend = Blend(self._blend.examples, shares, in_place=True)
        key_s = self._blend.key_s
        self._from_s = float(np.interp(phase, np.arange(float(len(key_s))), key_s))
        self._from_ns = t_ns

    def at(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return the root's place (3,) and the turns of joints (j, 4)."""
        frames = self._blend.at(self._own_s(t_ns))
        return frames.root_m, frames.orientation_wxyz

    def _own_s(self, t_ns: int) -> float:
        own_s = self._from_s + max(0, t_ns - self._from_ns) / NS_PER_S
        return float(own_s % self._blend.cycle_s)


class LiveStage:
    """The figures of a moulding, and the board beside them, as they stand now."""

    def __init__(
        self,
        moulding: Moulding,
        words: BoardWords,
        head_m: Vector,
        start_ns: int,
        *,
        by_keys: bool,
    ) -> None:
        live, until = moulding.live, moulding.until
        self.moulding, self._by_keys = moulding, by_keys
        self.values = [slider.start for slider in moulding.sliders]
        self.turn_deg = 0.0
        self._row = 0
        figures = self._figures_from(start_ns)
        self._walks = [(walking, x) for _, walking, x in figures]
        self._no_gaze = np.zeros((0, 3)), np.zeros(0)
        x, _, z = live.eye_m
        distance_m = float(np.hypot(x, z)) * (FARTHER_01 if by_keys else 1.0)
        up_m = float(head_m[1]) - live.aim_m[1] if by_keys else 0.0
        self._ahead_m = np.array([0.0, up_m, -distance_m])
        who = tuple(character for character, _, _ in figures)
        room_at_m = (0.0, up_m, FILMED_M - distance_m)
        self._scene = LiveFigures(SCENE, (), characters=who, room_at_m=room_at_m)
        self._yaw_deg = -float(np.degrees(np.arctan2(x, z)))
        rows = words.sliders + ((words.turn,) if live.camera == "free" else ())
        bearing_deg = -float(np.degrees(np.arctan2(BOARD_AT_M[0], -BOARD_AT_M[2])))
        place = Pose(head_m + np.array(BOARD_AT_M), quat_from_yaw_pitch_deg(bearing_deg))
        text = f"{words.caption}\n{words.keys if by_keys else words.ray}".strip()
        # A step that ends by itself has no button, as on a page.
        choices = (words.done,) if until is None or moulding.is_blind else ()
        self._board = Panel(text, choices, place, BOARD_M, tracks=rows)

    def _figures_from(self, start_ns: int) -> list[tuple[str, Walking, float]]:
        """Return who walks how, and how far to the side."""
        moulding, live, until = self.moulding, self.moulding.live, self.moulding.until
        if moulding.scene is not None:
            walks = [Walking(live.examples, m.weights, start_ns) for m in moulding.scene.motions]
            self._figure = walks[0]
            if len(walks) == 1:
                return [(live.character, self._figure, 0.0)]
            return [(live.character, walks[0], APART_M), (live.beside, walks[1], -APART_M)]
        self._figure = Walking(live.examples, live.shares(self.values), start_ns)
        if until is None or not live.beside:
            return [(live.character, self._figure, 0.0)]
        target = Walking(live.examples, until.shares(live.examples), start_ns)
        figures = [] if moulding.is_blind else [(live.character, self._figure, -APART_M)]
        return [*figures, (live.beside, target, APART_M)]

    @cached_property
    def _likeness(self) -> Likeness | None:
        live, until = self.moulding.live, self.moulding.until
        if until is None:
            return None
        joints = compared_joints(live.examples.skeleton)
        return Likeness(live.examples, until.shares(live.examples), until.poses, joints)

    @property
    def distance_m(self) -> float | None:
        """How far the figure is from its target; None without one."""
        if self._likeness is None:
            return None
        return self._likeness.exact_m(self.moulding.live.shares(self.values))

    def press(self, control: str, point_01: tuple[float, float] | None) -> Change | str | None:
        """Take a press, and where on the board something points: return what it changes (of time
        0), or what pressed the button ("keys", "ray").
        """
        rows = len(self._board.tracks)
        if control in CONFIRM and point_01 is not None:
            return self._confirm(*point_01)
        if control in CONFIRM:
            return "keys" if self._row == rows else None
        if control in ROWS:
            last = rows - 1 + len(self._board.choices)
            self._row = min(max(self._row + (1 if control in ON else -1), 0), last)
        if control not in ACROSS or self._row == rows:
            return None
        sign = 1 if control in ON else -1
        if self._row >= len(self.values):
            return Change(None, self.turn_deg + sign * TURN_DEG, "keys", 0)
        slider = self.moulding.sliders[self._row]
        return self._moved(self._row, self.values[self._row] + sign * press_step(slider), "keys")

    def take(self, change: Change, t_ns: int) -> None:
        """Change the figure from a session time on."""
        if change.slider is None:
            self.turn_deg = change.value
            return
        self.values[change.slider] = change.value
        self._figure.change(self.moulding.live.shares(self.values), t_ns)

    def pointed_01(self, ray: Ray | None) -> tuple[float, float] | None:
        """Return where a ray meets the board; None beside it."""
        if ray is None:
            return None
        forward = rotate(ray.pose.orientation_wxyz, AHEAD)
        place = place_met_01(self._board, ray.pose.position_m, forward)
        is_on = place is not None and all(0 <= share <= 1 for share in place)
        return place if is_on else None

    def seen_from_m(self) -> tuple[float, float, float]:
        """Return where a page's camera would stand to see the figure as it is turned."""
        turn = quat_from_yaw_pitch_deg(-self.turn_deg)
        x, y, z = rotate(turn, np.array(self.moulding.live.eye_m)).tolist()
        return x, y, z

    def frame(self, t_ns: int) -> MouldingFrame:
        """Return the figures and the board at a session time."""
        turn = quat_from_yaw_pitch_deg(self._yaw_deg + self.turn_deg)
        roots, turns = [], []
        for walking, x in self._walks:
            root_m, own = walking.at(t_ns)
            roots.append(self._ahead_m + rotate(turn, root_m + np.array([x, 0.0, 0.0])))
            turns.append(np.concatenate([quat_multiply(turn, own[0])[None], own[1:]]))
        people = PosedPeople(np.array(roots), np.array(turns), np.zeros((len(roots), len(MORPHS))))
        return MouldingFrame(
            self._scene,
            t_ns,
            *self._no_gaze,
            people,
            panels=self._panels(),
            moulding=self.moulding,
            by_keys=self._by_keys,
        )

    def _panels(self) -> tuple[Panel, ...]:
        """Return the board, and a knob on every track; that of the present row is lit."""
        board = replace(
            self._board, highlighted=0 if self._row == len(self._board.tracks) else None
        )
        knobs = []
        for row in range(len(board.tracks)):
            begin, end, down = track_01(board, row)
            middle_m = place_m(board, begin + self._share(row) * (end - begin), down)
            pose = Pose(middle_m, board.pose.orientation_wxyz)
            knobs.append(Panel("", (), pose, KNOB_M, 0 if row == self._row else None))
        return (board, *knobs)

    def _share(self, row: int) -> float:
        if row >= len(self.values):
            return (self.turn_deg % 360.0) / 360.0
        slider = self.moulding.sliders[row]
        return (self.values[row] - slider.low) / (slider.high - slider.low)

    def _confirm(self, across: float, down: float) -> Change | str | None:
        for left, top, right, bottom in choice_boxes_01(self._board).tolist():
            if left <= across <= right and top <= down <= bottom:
                return "ray"
        for row, (_, top, _, bottom) in enumerate(track_boxes_01(self._board).tolist()):
            begin, end, _ = track_01(self._board, row)
            if not (top <= down < bottom and across >= begin):
                continue
            self._row = row
            share = min(max((across - begin) / (end - begin), 0.0), 1.0)
            if row >= len(self.values):
                return Change(None, round(360.0 * share / TURN_DEG) * TURN_DEG, "ray", 0)
            slider = self.moulding.sliders[row]
            return self._moved(row, slider.low + share * (slider.high - slider.low), "ray")
        return None

    def _moved(self, row: int, value: float, by: str) -> Change | None:
        """Return a change to the nearest step of a slider; None where it stands there already."""
        slider = self.moulding.sliders[row]
        steps = round((value - slider.low) / slider.step)
        near = min(max(round(slider.low + steps * slider.step, 10), slider.low), slider.high)
        return None if near == self.values[row] else Change(row, near, by, 0)


def moulded(
    moulding: Moulding, words: BoardWords, about: Mapping[str, Any], view: FrameView
) -> Steps:
    """Let a participant mould a figure by keys or a ray; yields steps of the engine.

    `about` goes into every event: the trial, and which of its figures it is.
    """
    head_m, by_keys = view.head.position_m, not view.head_points
    stage = LiveStage(moulding, words, head_m, view.t_ns, by_keys=by_keys)
    yield Mark(FIGURE_ON, {**about, **_description(moulding, words, view)})
    yield Show(stage.frame(view.t_ns))
    view = yield from frame()
    on_ns, frames = view.t_ns, 1
    end_ns = on_ns + round(moulding.limit_s * NS_PER_S)
    earliest_ns = on_ns + round(moulding.earliest_s * NS_PER_S)
    changes: list[Change] = []
    ray: Ray | None = None
    distance_m, ended_by, pressed_by = stage.distance_m, "", ""
    within_m = 0.0 if moulding.until is None or moulding.is_blind else moulding.until.within_m

    def pass_frame(view: FrameView) -> MouldingFrame:
        nonlocal frames
        frames += 1
        return stage.frame(view.t_ns)

    while not ended_by:
        ray = newer_ray(ray, view)
        point_01 = stage.pointed_01(ray)
        heard_ns = view.pressed_ns or (view.t_ns,) * len(view.pressed)
        for control, t_ns in zip(view.pressed, heard_ns, strict=True):
            if not on_ns < t_ns <= end_ns or pressed_by:  # before the figure was seen, or too late
                continue
            change = stage.press(control, point_01)
            if isinstance(change, str):
                pressed_by = change if t_ns >= earliest_ns else ""
            elif change is not None:
                change = replace(change, t_ns=t_ns)
                changes.append(change)
                stage.take(change, view.t_ns)
                distance_m = stage.distance_m
                yield _mark(stage, change, about, view.t_ns)
        if pressed_by or view.t_ns >= end_ns:
            ended_by = "button" if pressed_by else "limit"
            break
        # What was changed is seen before it ends the step.
        is_near = distance_m is not None and distance_m < within_m
        yield Show(stage.frame(view.t_ns))
        view = yield from frame(0 if is_near else end_ns, pass_frame)
        frames += 1
        ended_by = "near" if is_near else ""
    values = tuple(stage.values)
    by = pressed_by or "limit"
    return MouldingEnd(values, tuple(changes), frames, ended_by, by, on_ns, distance_m, view)


def stage_again(
    live: Live,
    sliders: Mapping[str, Slider],
    description: Mapping[str, Any],
    changes: Sequence[Mapping[str, Any]],
) -> LiveStage:
    """Return a stage as it stood after changes, from the events that tell of it.

    `sliders` are the study's by name.
    """
    names = json.loads(description["sliders"])
    target = json.loads(description["target"] or "null")
    until = Near(target) if isinstance(target, dict) else None
    scene = LiveScene(live, *target) if isinstance(target, list) else None
    own = tuple(sliders[name] for name in names)
    moulding = Moulding(live, own, until, is_blind=bool(description["is_blind"]), scene=scene)
    caption, sliders, *rest = json.loads(description["words"])
    words = BoardWords(caption, tuple(sliders), *rest)
    head_m = np.array([description[axis] for axis in ("x_m", "y_m", "z_m")])
    start_ns, by_keys = int(description["start_ns"]), bool(description["by_keys"])
    stage = LiveStage(moulding, words, head_m, start_ns, by_keys=by_keys)
    for change in sorted(changes, key=lambda change: int(change["changed_ns"])):
        turn_deg, t_ns = change.get("turn_deg"), int(change["changed_ns"])
        if turn_deg is None:
            row, value = names.index(change["slider"]), float(change["value"])
            stage.take(Change(row, value, change["by"], t_ns), t_ns)
        else:
            stage.take(Change(None, float(turn_deg), change["by"], t_ns), t_ns)
    return stage


def _mark(stage: LiveStage, change: Change, about: Mapping[str, Any], t_ns: int) -> Mark:
    payload = {**about, "heard_ns": change.t_ns, "changed_ns": t_ns, "by": change.by}
    if change.slider is None:
        x_m, y_m, z_m = stage.seen_from_m()
        place = {"turn_deg": change.value, "x_m": x_m, "y_m": y_m, "z_m": z_m}
        return Mark(FIGURE_TURNED, payload | place)
    name = stage.moulding.sliders[change.slider].name
    return Mark(SLIDER_MOVED, payload | {"slider": name, "value": change.value})


def _description(moulding: Moulding, words: BoardWords, view: FrameView) -> dict[str, Any]:
    """Return what makes the stage again (`stage_again`), beside the study's own figure."""
    until, scene = moulding.until, moulding.scene
    target = ""
    if until is not None:
        target = json.dumps(dict(until.weights))
    elif scene is not None:
        target = json.dumps([scene.weights, scene.beside])
    x_m, y_m, z_m = view.head.position_m.tolist()
    return {
        "start_ns": view.t_ns,
        "sliders": json.dumps([slider.name for slider in moulding.sliders]),
        "target": target,
        "is_blind": moulding.is_blind,
        "by_keys": not view.head_points,
        "words": json.dumps(list(astuple(words))),
        "x_m": x_m,
        "y_m": y_m,
        "z_m": z_m,
    }

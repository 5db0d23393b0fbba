"""Perform a plan without devices: a gaze that is told where to look, frame after frame."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from visavis.lab.geometry import Pose, unit
from visavis.protocol.plan.steps import (
    AskReply,
    FrameView,
    GazeView,
    Mark,
    NextFrame,
    Plan,
    Prompt,
    Row,
    Show,
)
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M
from visavis.stimuli.visibility import SceneGeometry

FRAME_NS = 11_111_111
SAMPLE_NS = 8_333_333
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])

Look = Callable[[int], int | None]
"""Trial time in ns to the agent looked at, None for the floor, -2 for lost."""


@dataclass
class Performance:
    """What a plan did: its row, its marks with their times, every picture, every gaze view."""

    row: Row = field(default_factory=dict)
    marks: list[tuple[int, Mark]] = field(default_factory=list)
    pictures: list[tuple[int, SceneFrame]] = field(default_factory=list)
    frames_ns: list[int] = field(default_factory=list)
    gaze: list[GazeView] = field(default_factory=list)
    prompts: list[str] = field(default_factory=list)

    def picture_at(self, t_ns: int) -> SceneFrame:
        """Return what the display shows in the frame at this time."""
        return [p for t, p in self.pictures if t <= t_ns][-1]

    def recorded(self) -> dict[str, Any]:
        """Return the columns a session would have recorded."""
        views = [g for g in self.gaze if g.angle_deg.size]
        return {
            "t_sample_ns": np.concatenate([g.t_ns for g in views]),
            "valid": np.concatenate([g.valid for g in views]),
            "direction_world": np.concatenate([g.direction_world for g in views]),
            "angle_deg": np.concatenate([g.angle_deg for g in views]),
            "radius_deg": np.concatenate([g.radius_deg for g in views]),
            "pad_limit_deg": np.concatenate([g.pad_limit_deg for g in views]),
            "hit": np.concatenate([g.hit for g in views]),
        }


def perform(
    plan: Plan,
    look: Look = lambda _: None,
    *,
    begin_ns: int = 5_000_000_000,
    head_m: Callable[[int], np.ndarray] = lambda _: PARTICIPANT_EYE_M,
    sample_delay_ns: int = 0,
    aim_offset_m: np.ndarray | float = 0.0,
    is_attended: bool = False,
    space_ns: int | None = None,
    key_ns: int | None = None,
) -> Performance:
    """Run a plan to its end; trial time counts from the second frame, where a trial's t = 0 is.

    With `is_attended` an operator answers prompts: with the space bar at `space_ns`, if ever. The
    participant presses a key at `key_ns`.
    """
    done = Performance()
    t_ns = begin_ns
    zero_ns = begin_ns + 2 * FRAME_NS
    sample_ns = begin_ns
    shown: SceneFrame | None = None
    reply: FrameView | None = None
    try:
        while True:
            step = plan.send(reply) if reply is not None or done.frames_ns else next(plan)
            while not isinstance(step, NextFrame):
                if isinstance(step, Show):
                    shown = step.view
                    done.pictures.append((t_ns + FRAME_NS, shown))
                elif isinstance(step, Mark):
                    done.marks.append((t_ns, step))
                elif isinstance(step, Prompt):
                    done.prompts.append(step.text)
                answered = isinstance(step, Prompt) and step.text and not is_attended
                step = plan.send(AskReply(None, t_ns) if answered else None)
            t_ns += FRAME_NS
            stamps = []
            while sample_ns + sample_delay_ns < t_ns:
                stamps.append(sample_ns)
                sample_ns += SAMPLE_NS
            gaze = _gaze(np.array(stamps, np.int64), zero_ns, look, shown, head_m, aim_offset_m)
            done.frames_ns.append(t_ns)
            done.gaze.append(gaze)
            reply = FrameView(
                len(done.frames_ns),
                t_ns,
                Pose(head_m(t_ns - zero_ns), UPRIGHT),
                True,
                gaze,
                pressed=("trigger",) if _is_now(key_ns, t_ns - zero_ns) else (),
                went_on=_is_now(space_ns, t_ns - zero_ns),
            )
    except StopIteration as end:
        done.row = end.value
    return done


def _is_now(at_ns: int | None, t_ns: int) -> bool:
    return at_ns is not None and at_ns <= t_ns < at_ns + FRAME_NS


def _gaze(
    t_ns: np.ndarray,
    zero_ns: int,
    look: Look,
    shown: SceneFrame | None,
    head_m: Callable[[int], np.ndarray],
    aim_offset_m: np.ndarray | float,
) -> GazeView:
    n = t_ns.shape[0]
    m = 0 if shown is None else len(shown.scene.agents)
    origin = np.array([head_m(int(t) - zero_ns) for t in t_ns]).reshape(n, 3)
    direction = np.tile(unit(np.array([0.0, -1.0, -0.3])), (n, 1))
    valid = np.ones(n, np.bool_)
    for i, t in enumerate(t_ns):
        where = look(int(t) - zero_ns)
        if where == -2:
            valid[i] = False
            direction[i] = np.nan
        elif where is not None and shown is not None:
            aim_m = shown.scene.agents[where].head_centre_m + aim_offset_m
            direction[i] = unit(aim_m - origin[i])
    if shown is None:
        none = np.empty((n, m))
        return GazeView(t_ns, valid, direction, origin, none, none, none, np.full(n, -1, np.int16))
    seen = SceneGeometry.from_scene(shown.scene).observe(origin, direction, valid)
    return GazeView(t_ns, valid, direction, origin, *seen)

"""One trial of the stare study, frame by frame, and the dark before it.

Times of a row count from the first frame after the scene came on, when its light leaves the
display; that frame's time is `t_start_ns`.
"""

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from analysis.gaze.aoi import aoi_of_samples
from experiments.stare.design import AVERTED_THEN_DIRECTED, DYNAMIC_CONDITIONS, StareParameters
from experiments.stare.scene import active_index_of, dark_scene_of, opening_eyes, scene_of
from lab.clock import NS_PER_MS, NS_PER_S
from lab.geometry import Vector
from protocol.plan import Trial
from protocol.steps import (
    Answered,
    FrameView,
    GazeView,
    Mark,
    NextFrame,
    Plan,
    Prompt,
    Scalar,
    Show,
    Step,
)
from stimuli.gaze.behaviour import EyeBehaviour
from stimuli.scene import Scene, SceneFrame
from stimuli.scenes.audience import PARTICIPANT_EYE_M

TRAINING_PROMPT: Final = (
    "Training: has the participant seen audience and speaker, and is ready? Then space"
)

SwitchCause: TypeAlias = Literal["look", "time"]
Frames: TypeAlias = Generator[Step, FrameView | Answered | None, FrameView]

FOLLOW_STEP_M = 0.005
"""Staring eyes follow the participant's head in steps of this size: 0.2° at the nearest place."""

_NEXT = NextFrame()


@dataclass
class _Picture:
    """What is on the display; shows anew only what changed."""

    scene: Scene
    eyes: EyeBehaviour
    observer_m: Vector
    was_moving: bool = True

    def follow(self, view: FrameView) -> bool:
        """Take note of the participant's head; tell whether it moved enough to matter."""
        if not view.head_valid:
            return False
        x, y, z = (view.head.position_m - self.observer_m).tolist()
        if x * x + y * y + z * z < FOLLOW_STEP_M**2:
            return False
        self.observer_m = np.array(view.head.position_m, np.float64)
        return True

    def at(self, elapsed_ns: int, t_ns: int, *, changed: bool) -> Show | None:
        """Return the step that shows this time's picture; None when it is on already."""
        gaze, openness, moving = self.eyes.at(elapsed_ns, self.observer_m)
        if not (moving or changed or self.was_moving):
            return None
        self.was_moving = moving
        distance_m = self.eyes.distance_m(elapsed_ns, self.observer_m)
        return Show(SceneFrame(self.scene, t_ns, gaze, openness, gaze_distance_m=distance_m))


def _frame() -> Frames:
    """Wait for the next frame."""
    view = yield _NEXT
    if not isinstance(view, FrameView):
        raise TypeError(f"a plan that asked for a frame was sent {view!r}")
    return view


def _first_look_ns(gaze: GazeView, agent: int, pad_deg: float, since_ns: int) -> int | None:
    """Return the time of the first sample since then that is on the agent's padded head."""
    if not gaze.t_ns.shape[0]:
        return None
    aoi = aoi_of_samples(
        gaze.angle_deg, gaze.radius_deg, gaze.pad_limit_deg, gaze.hit, pad_deg=pad_deg
    )
    for i in range(aoi.shape[0]):
        if aoi[i] == agent and gaze.t_ns[i] >= since_ns:
            return int(gaze.t_ns[i])
    return None


def run_trial(trial: Trial, params: StareParameters) -> Plan:
    """Perform a trial; the row says who was active, and when and why their gaze changed.

    In AD and DA the active agent's gaze changes with the first sample on its head, decided by
    the rule analysis uses, or at `switch_at_01` of the trial. The scene stays until the first
    frame at or after the trial's end that has brought a sample of that time, `drain_ms` at most;
    `t_end_ns` is the trial's end, not that frame's. Training lasts until somebody ends it.
    """
    scene = scene_of(trial, params.agents)
    active = active_index_of(trial)
    condition = str(trial.factors["condition"])
    duration_s = params.practice_s if trial.is_practice else params.trial_s
    duration_ns = round(duration_s * NS_PER_S)
    limit_ns = round(duration_ns * params.switch_at_01)
    wait_ns = round(params.look_trigger_ms * NS_PER_MS)
    drain_ns = round(params.drain_ms * NS_PER_MS)
    may_change = condition in DYNAMIC_CONDITIONS and not trial.is_practice
    longest_s = params.practice_limit_s if trial.is_practice else duration_s
    eyes = opening_eyes(trial, scene, longest_s + params.drain_ms / 1000)

    # The frame before tells the time and where the head is; the scene comes on after it.
    view = yield from _frame()
    picture = _Picture(scene, eyes, PARTICIPANT_EYE_M)
    picture.follow(view)
    yield _shown(picture.at(0, view.t_ns, changed=True))
    view = yield from _frame()
    start_ns = view.t_ns
    yield Mark("scene_on", {"trial_id": trial.trial_id, "scene_name": scene.name})

    end_ns = None if trial.is_practice else start_ns + duration_ns
    training = _Training(trial, params, start_ns)
    frames, samples = 0, 0
    look_ns: int | None = None
    switch_ns: int | None = None
    cause: SwitchCause | None = None
    while True:
        now_ns = view.t_ns
        elapsed_ns = now_ns - start_ns
        frames += 1
        samples += view.gaze.t_ns.shape[0]
        if end_ns is None:
            end_ns = yield from training.end_ns(view)
        if end_ns is not None and now_ns >= end_ns and _arrived(view, end_ns, drain_ns):
            break
        changed = picture.follow(view)
        turned = False
        if may_change and switch_ns is None:
            if look_ns is None:
                look_ns = _first_look_ns(view.gaze, active, params.pad_deg, start_ns)
            if look_ns is not None and now_ns >= look_ns + wait_ns:
                turned, cause = True, "look"
            elif elapsed_ns >= limit_ns:
                turned, cause = True, "time"
        if turned:
            picture.eyes = eyes.turning(
                active, elapsed_ns, to_observer=condition == AVERTED_THEN_DIRECTED
            )
            changed = True
        show = picture.at(elapsed_ns, now_ns, changed=changed)
        if show is not None:
            yield show
        view = yield from _frame()
        if turned:
            # As with the scene's onset, the change counts from when its light leaves.
            switch_ns = view.t_ns
            yield Mark("gaze_change", _change(trial, active, condition, cause, switch_ns, start_ns))
    return {
        "active_index": active,
        "active_agent": scene.agents[active].agent_id,
        "active_character": scene.agents[active].character,
        "t_start_ns": start_ns,
        "t_end_ns": end_ns,
        "switch_ns": switch_ns,
        "switch_ms": None if switch_ns is None else (switch_ns - start_ns) / NS_PER_MS,
        "switch_cause": cause,
        "look_ns": look_ns,
        "scene_frames": frames,
        "scene_samples": samples,
    }


@dataclass
class _Training:
    """How long a training lasts: until the operator or the participant ends it."""

    trial: Trial
    params: StareParameters
    start_ns: int
    is_waiting: bool = False

    def end_ns(self, view: FrameView) -> Generator[Step, FrameView | Answered | None, int | None]:
        """Return when the training ended; None while it goes on."""
        elapsed_ns = view.t_ns - self.start_ns
        shortest_ns = round(self.params.practice_s * NS_PER_S)
        limit_ns = round(self.params.practice_limit_s * NS_PER_S)
        by, end_ns = "time", self.start_ns + limit_ns
        if elapsed_ns < shortest_ns:
            return None
        if elapsed_ns < limit_ns:
            if self.is_waiting and view.went_on:
                by, end_ns = "operator", view.t_ns
            elif self.is_waiting and view.pressed:
                by, end_ns = "participant", view.t_ns
            elif self.is_waiting:
                return None
            else:
                reply = yield Prompt(TRAINING_PROMPT)
                self.is_waiting = not isinstance(reply, Answered)
                if self.is_waiting:
                    return None
                end_ns = self.start_ns + shortest_ns
        if self.is_waiting:
            yield Prompt("")
        yield Mark("training_end", {"trial_id": self.trial.trial_id, "by": by})
        return end_ns


def _arrived(view: FrameView, end_ns: int, drain_ns: int) -> bool:
    """Tell whether every sample of the trial is here, or has been waited for long enough."""
    stamps = view.gaze.t_ns
    return bool(view.t_ns >= end_ns + drain_ns or (stamps.shape[0] and stamps[-1] >= end_ns))


def _shown(show: Show | None) -> Show:
    if show is None:
        raise ValueError("a first picture is always shown")
    return show


def _change(
    trial: Trial,
    active: int,
    condition: str,
    cause: SwitchCause | None,
    switch_ns: int,
    start_ns: int,
) -> dict[str, Scalar | None]:
    return {
        "trial_id": trial.trial_id,
        "active_index": active,
        "to": "directed" if condition == AVERTED_THEN_DIRECTED else "averted",
        "cause": cause,
        "t_ns": switch_ns,
        "after_ms": (switch_ns - start_ns) / NS_PER_MS,
    }


def intertrial(trial: Trial, params: StareParameters) -> Plan:
    """Stay dark before a trial, with the mark at top centre, for `intertrial_s`."""
    scene = dark_scene_of(trial, params.agents)
    facing = np.array([a.facing for a in scene.agents])
    view = yield from _frame()
    start_ns = view.t_ns
    yield Show(SceneFrame(scene, start_ns, facing, np.ones(len(scene.agents))))
    until_ns = start_ns + round(params.intertrial_s * NS_PER_S)
    while view.t_ns < until_ns:
        view = yield from _frame()
    return {"intertrial_ms": (view.t_ns - start_ns) / NS_PER_MS}

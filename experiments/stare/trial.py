"""One trial of the stare study, frame by frame.

Times of a row count from the first frame after the scene came on, when its light leaves the
display; that frame's time is `t_start_ns`.
"""

from collections.abc import Generator
from dataclasses import dataclass
from functools import partial
from typing import Final, Literal, TypeAlias

import numpy as np

from visavis.analysis.gaze.aoi import aoi_of_samples
from visavis.experiments.stare.design import (
    AVERTED_THEN_DIRECTED,
    DYNAMIC_CONDITIONS,
    StareParameters,
)
from visavis.experiments.stare.scene import active_index_of, opening_eyes, scene_of
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import (
    AskReply,
    FrameView,
    GazeView,
    Mark,
    Plan,
    Prompt,
    Scalar,
    Step,
)
from visavis.study.asking import frame
from visavis.study.frames import gaze_has_arrived, show_frame
from visavis.study.scenes import PassingScene, WithEyes

TRAINING_PROMPT: Final = (
    "Training: has the participant seen audience and speaker, and is ready? Then space"
)

SwitchCause: TypeAlias = Literal["look", "time"]


def _first_look(gaze: GazeView, agent: int, pad_deg: float, since_ns: int) -> int | None:
    """Return the number of the first sample since then that is on the agent's padded head."""
    if not gaze.sample_count:
        return None
    aoi = aoi_of_samples(
        gaze.angle_deg, gaze.radius_deg, gaze.pad_limit_deg, gaze.hit, pad_deg=pad_deg
    )
    looks = np.flatnonzero((aoi == agent) & (gaze.t_ns >= since_ns))
    return int(looks[0]) if len(looks) else None


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
    may_change = condition in DYNAMIC_CONDITIONS and not trial.is_practice
    longest_s = params.practice_limit_s if trial.is_practice else duration_s
    eyes = opening_eyes(trial, scene, longest_s + params.drain_ms / 1000)

    # The frame before tells the time and where the head is; the scene comes on after it.
    view = yield from frame()
    picture = WithEyes(scene, {}, eyes)
    yield from show_frame(picture.frame(view, 0))
    view = yield from frame()
    start_ns = view.t_ns
    yield Mark("scene_on", {"trial_id": trial.trial_id, "scene_name": scene.name})

    end_ns = None if trial.is_practice else start_ns + duration_ns
    quiet_until_ns = start_ns + duration_ns  # a training does not end before, either
    training = _Training(trial, params, start_ns)
    # counted at the end: gaze nobody looks at costs a simulation less
    gazes: list[GazeView] = []
    passing = PassingScene(picture, start_ns, gazes)
    first_look = partial(_first_look, agent=active, pad_deg=params.pad_deg, since_ns=start_ns)
    look_ns: int | None = None
    switch_ns: int | None = None
    cause: SwitchCause | None = None

    while True:
        now_ns = view.t_ns
        elapsed_ns = now_ns - start_ns
        gazes.append(view.gaze)
        if end_ns is None:
            end_ns = yield from training.end_ns(view)
        if (
            end_ns is not None
            and now_ns >= end_ns
            and gaze_has_arrived(view, end_ns, params.drain_ms)
        ):
            break
        turns_now = False
        if may_change and switch_ns is None:
            look = first_look(view.gaze) if look_ns is None else None
            if look is not None:
                look_ns = int(view.gaze.t_ns[look])
            if look_ns is not None and now_ns >= look_ns + wait_ns:
                turns_now, cause = True, "look"
            elif elapsed_ns >= limit_ns:
                turns_now, cause = True, "time"
        if turns_now:
            to_observer = condition == AVERTED_THEN_DIRECTED
            picture.look(eyes.turning(active, elapsed_ns, to_observer=to_observer))
        yield from show_frame(picture.frame(view, elapsed_ns))
        # Until the change only a look, its time or the limit needs the plan.
        waits_for_look = may_change and switch_ns is None
        passing.stop = first_look if waits_for_look and look_ns is None else None
        until_ns = quiet_until_ns
        if waits_for_look:
            until_ns = min(until_ns, start_ns + limit_ns)
            until_ns = until_ns if look_ns is None else min(until_ns, look_ns + wait_ns)
        view = yield from frame(0 if turns_now else until_ns, passing)
        if turns_now:
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
        "scene_frames": len(gazes),
        "scene_samples": sum(gaze.sample_count for gaze in gazes),
    }


@dataclass
class _Training:
    """How long a training lasts: until the operator or the participant ends it."""

    trial: Trial
    params: StareParameters
    start_ns: int
    is_waiting: bool = False

    def end_ns(self, view: FrameView) -> Generator[Step, FrameView | AskReply | None, int | None]:
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
                self.is_waiting = not isinstance(reply, AskReply)
                if self.is_waiting:
                    return None
                end_ns = self.start_ns + shortest_ns
        if self.is_waiting:
            yield Prompt("")
        yield Mark("training_end", {"trial_id": self.trial.trial_id, "by": by})
        return end_ns


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

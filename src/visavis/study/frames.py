"""Single frames of a trial: dark, shown when they are new, and when their gaze has arrived."""

from typing import Final

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.steps import FrameView, Show
from visavis.stimuli.scene import Scene, SceneFrame
from visavis.study.actions import Performing

DRAIN_MS: Final = 50.0
"""How long a scene waits for samples that were taken before its end and arrive later."""
DARK: Final = Scene(name="dark", agents=(), brightness_01=0.0)


def dark_view(t_ns: int) -> Show:
    """Return the step that makes everything dark."""
    return Show(dark_frame(t_ns))


def dark_frame(t_ns: int) -> SceneFrame:
    """Return the frame in which nothing is lit."""
    return SceneFrame(DARK, t_ns, np.zeros((0, 3)), np.zeros(0))


def show_frame(view: SceneFrame | None) -> Performing:
    """Show a frame if there is a new one."""
    if view is not None:
        yield Show(view)


def gaze_has_arrived(view: FrameView, end_ns: int, drain_ms: float = DRAIN_MS) -> bool:
    """Tell whether all gaze samples from before the end have arrived, or the wait is over."""
    stamps = view.gaze.t_ns
    has_timed_out = view.t_ns >= end_ns + round(drain_ms * NS_PER_MS)
    return has_timed_out or bool(stamps.shape[0] and stamps[-1] >= end_ns)

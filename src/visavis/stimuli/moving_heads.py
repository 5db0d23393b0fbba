"""Where heads are at any time of people who move while their scene is shown."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Vector
from visavis.stimuli.dressing.picture_of import named_function
from visavis.stimuli.scene import Agent, Scene

STEP_NS: Final = 20 * NS_PER_MS
"""Heads are posed in such steps and go evenly between: within 0.3 mm where people walk."""
HEADS_MOVE: Final = "heads_move"
"""What the event "scene" says of people whose heads move: that gaze was measured on them where they
were at the time. Without it, which is so in older recordings, it was where they were at the onset.
"""


@dataclass(frozen=True, eq=False)
class MovingHeads:
    """Centres of n heads over session time; `pose` returns them (n, 3) as drawn at one time."""

    pose: Callable[[int], Vector]
    _poses: dict[int, Vector] = field(default_factory=dict)

    def centres_m(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """Return the centres (k, n, 3) at session times (k,) of any order."""
        step, rest_ns = np.divmod(t_ns, STEP_NS)
        share = (rest_ns / STEP_NS)[:, None, None]
        before, after = (
            np.array([self._at(k) for k in steps.tolist()]) for steps in (step, step + 1)
        )
        centres: npt.NDArray[np.float64] = before + share * (after - before)
        return centres

    def _at(self, step: int) -> Vector:
        if step not in self._poses:
            self._poses[step] = self.pose(step * STEP_NS)
        return self._poses[step]


def moving_heads(scene: Scene) -> MovingHeads | None:
    """Return how a scene's heads move; None where they stay where its agents say.

    Raises:
        DesignError: what moves them cannot be imported.
    """
    if not scene.moved_by or not scene.agents:
        return None
    heads: MovingHeads | None = named_function(scene.moved_by, "moves these people")(scene)
    return heads


def agents_at(scene: Scene, t_ns: int) -> tuple[Agent, ...]:
    """Return a scene's agents with their heads where they are at a session time."""
    heads = moving_heads(scene)
    if heads is None:
        return scene.agents
    (centres_m,) = heads.centres_m(np.array([t_ns]))
    return tuple(
        replace(
            agent,
            head_centre_m=centre_m,
            eye_centre_m=agent.eye_centre_m + centre_m - agent.head_centre_m,
        )
        for agent, centre_m in zip(scene.agents, centres_m, strict=True)
    )

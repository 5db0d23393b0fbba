"""How the view onto a panorama turns before a monitor: by arrow keys, each so far, at one speed."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S

VIEW_TURNED: Final = "view_turned"
"""The event that says that the view turns."""
STEP_DEG: Final = 30.0
"""How far a press turns the view."""
SPEED_DEG_PER_S: Final = 90.0
MAX_PITCH_DEG: Final = 60.0
ARROWS: Final = {"left": (-1, 0), "right": (1, 0), "up": (0, 1), "down": (0, -1)}
"""What each key turns: to the right, and upwards."""
SLACK: Final = 0.01
"""Share of a frame by which its light may come before it is due."""


@dataclass(frozen=True)
class Turn:
    """A turn that was asked for in the frame of `since_ns`, and is seen from the next one on: from
    a direction to another, degrees to the right and upwards.
    """

    since_ns: int
    from_deg: tuple[float, float]
    to_deg: tuple[float, float]

    def as_event(self, frame_ns: int) -> dict[str, float]:
        """Return what an event says of it, on a display with such frames (`read_turns`)."""
        (yaw_deg, pitch_deg), (to_yaw_deg, to_pitch_deg) = self.from_deg, self.to_deg
        return {
            "changed_ns": self.since_ns,
            "frame_ns": frame_ns,
            "yaw_deg": yaw_deg,
            "pitch_deg": pitch_deg,
            "to_yaw_deg": to_yaw_deg,
            "to_pitch_deg": to_pitch_deg,
        }


def goal_after(control: str, goal_deg: tuple[float, float]) -> tuple[float, float]:
    """Return to where an arrow key turns a view that was turning to a goal, in degrees to the right
    and upwards.
    """
    right, up = ARROWS[control]
    pitch_deg = float(np.clip(goal_deg[1] + up * STEP_DEG, -MAX_PITCH_DEG, MAX_PITCH_DEG))
    return goal_deg[0] + right * STEP_DEG, pitch_deg


class ViewTurns:
    """The turns of a view so far, in the rhythm of its display."""

    def __init__(self, frame_ns: int, turns: Iterable[Turn] = ()) -> None:
        self.frame_ns = frame_ns
        self.turns = list(turns)

    @property
    def goal_deg(self) -> tuple[float, float]:
        """To where the view turns, or has turned."""
        return self.turns[-1].to_deg if self.turns else (0.0, 0.0)

    @property
    def there_ns(self) -> int:
        """When the display shows the view at its goal."""
        if not self.turns:
            return 0
        last = self.turns[-1]
        way_deg = float(np.linalg.norm(np.subtract(last.to_deg, last.from_deg)))
        frames = np.ceil(way_deg / SPEED_DEG_PER_S * NS_PER_S / self.frame_ns)
        return last.since_ns + int(frames) * self.frame_ns

    def press(self, control: str, t_ns: int) -> bool:
        """Take a key in the frame of a time; tell whether it turns the view."""
        if control not in ARROWS:
            return False
        to_deg = goal_after(control, self.goal_deg)
        if to_deg == self.goal_deg:
            return False
        self.turns.append(Turn(t_ns, self.at(t_ns), to_deg))
        return True

    def at(self, t_ns: int) -> tuple[float, float]:
        """Return how far the view is turned, in degrees, as the display shows it at a time."""
        right_deg, up_deg = self.course(np.array([t_ns]))[0].tolist()
        return right_deg, up_deg

    def course(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """Return the same at times (n,), as (n, 2). A display changes it from frame to frame."""
        turns_deg = np.zeros((len(t_ns), 2))
        for turn in self.turns:
            after = t_ns >= turn.since_ns
            frames = np.floor((t_ns[after] - turn.since_ns) / self.frame_ns + SLACK)
            reach_deg = frames * self.frame_ns / NS_PER_S * SPEED_DEG_PER_S
            begin, way = np.array(turn.from_deg), np.subtract(turn.to_deg, turn.from_deg)
            share = np.minimum(1.0, reach_deg / max(float(np.linalg.norm(way)), 1e-9))
            turns_deg[after] = begin + share[:, None] * way
        return turns_deg


def read_turns(events: Iterable[Mapping[str, Any]]) -> ViewTurns:
    """Return the turns of which events tell, in their order; none without any."""
    turns, frame_ns = [], 1
    for event in events:
        frame_ns = int(event["frame_ns"])
        begin = float(event["yaw_deg"]), float(event["pitch_deg"])
        goal = float(event["to_yaw_deg"]), float(event["to_pitch_deg"])
        turns.append(Turn(int(event["changed_ns"]), begin, goal))
    return ViewTurns(frame_ns, turns)

"""Gaze in charge: a step that ends when somebody has looked at an area for so long."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import DEFAULT_PAD_DEG, LOST, aoi_of_samples
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds, takes_kinds
from visavis.lab.yaml_lines import did_you_mean
from visavis.protocol.plan.steps import FrameView, GazeView, Scalar
from visavis.stimuli.areas import Areas, areas_under
from visavis.study.gaze_window import BRIDGE_NS
from visavis.study.scenes import StagedScene

ENDINGS: Final = (
    ("_gaze_on_ns", "ns", "when the look began for which {} waited; empty: none was long enough"),
    (
        "_gaze_delay_ms",
        "ms",
        "from the sample of gaze with which that look was long enough to the first frame without "
        "{}: the delay of the whole loop",
    ),
)
"""Endings of the columns that a step adds which waits for gaze, their units and words."""


@dataclass(frozen=True)
class GazeOn:
    """What a step waits for: a look at an area, or at the person of a role, that lasts `seconds`;
    `pad_deg` widens the area.
    """

    name: str
    seconds: float
    pad_deg: float = DEFAULT_PAD_DEG

    def __post_init__(self) -> None:
        if not 0 < self.seconds < 60:
            raise DesignError(f"gaze_on: seconds is {self.seconds:g}; above 0 and below 60")
        if not 0 <= self.pad_deg < 45:
            raise DesignError(f"gaze_on: pad_deg is {self.pad_deg:g}; from 0 to 45 degrees")

    def watch(self, staged_scene: StagedScene, on_ns: int = 0) -> "GazeWatch":
        """Begin to wait for gaze on what is shown since `on_ns`.

        Raises:
            DesignError: it has no such area or role.
        """
        sheets: tuple[Areas, ...] = getattr(staged_scene, "areas", ())
        areas = [area.name for one in sheets for area in one.areas]
        names = [*areas, *staged_scene.roles]
        if self.name not in names:
            near = did_you_mean(self.name, names) or "; nothing that is shown has a name"
            raise DesignError(f"gaze_on: there is no area or role {self.name!r}{near}")
        agent = None if self.name in areas else staged_scene.roles[self.name]
        return GazeWatch(self, sheets, agent, on_ns)


@takes_kinds()
def gaze_on(name: str, seconds: float, *, pad_deg: float = DEFAULT_PAD_DEG) -> GazeOn:
    """Return the condition that somebody has looked at an area, by its name, or at the person of a
    role, for so long without looking elsewhere: `t.show(…, 5, until=gaze_on("cross", 0.5))`.

    Losses of up to 75 ms do not end a look. In a `Room` a head holds gaze unless a mesh is before
    it.
    Columns: `NAME_gaze_on_ns`, when the look began (empty where time ran out), and
    `NAME_gaze_delay_ms`, the delay from the sample that decided to the first frame without the
    stimulus.

    Raises:
        DesignError: a value is not possible.
    """
    return GazeOn(name, seconds, pad_deg)


@dataclass(frozen=True)
@of_kinds()
class WhenGazeOn:
    """What a simulated person's answer to `Keys` may be: to press `option` once they have looked at
    an area for `seconds` without looking elsewhere, and `other_s` later, which deciding and
    pressing take.

    Who does not come to look at it so long has not found it: nothing is pressed. On a page, where
    nobody's eyes are simulated, it is the pointer that comes to the area.

    Raises:
        DesignError: a number is not possible.
    """

    option: str
    area: str
    seconds: float = 0.1
    other_s: float = 0.35

    def __post_init__(self) -> None:
        if not (0 < self.seconds < 60 and 0 <= self.other_s < np.inf):
            raise DesignError(
                f"WhenGazeOn: seconds is {self.seconds:g} and other_s {self.other_s:g}; give "
                "seconds above 0 and below 60, and other_s from 0"
            )

    def place_among(self, names: Sequence[str]) -> int:
        """Return the place of the area among those that are shown.

        Raises:
            DesignError: it is not there.
        """
        if self.area not in names:
            near = (
                did_you_mean(self.area, [name for name in names if name])
                or "; nothing that is shown has an area"
            )
            raise DesignError(
                f"WhenGazeOn: there is no area or mesh {self.area!r}{near}; simulated people know "
                "no roles of others"
            )
        return names.index(self.area)

    def press_ns(self, t_ns: npt.NDArray[np.int64], is_here: npt.NDArray[np.bool_]) -> int | None:
        """Return when the option is pressed, given whether gaze is on the area (n,) at times (n,);
        None if no look is long enough.
        """
        begins = is_here & ~np.concatenate([[False], is_here[:-1]])
        begins_ns = np.maximum.accumulate(np.where(begins, t_ns, t_ns[0]))
        long_enough = is_here & (t_ns - begins_ns >= self.seconds * NS_PER_S)
        if not long_enough.any():
            return None
        return int(t_ns[np.argmax(long_enough)]) + round(self.other_s * NS_PER_S)


class GazeWatch:
    """Follow gaze while something is shown, sample by sample, until a look was long enough."""

    def __init__(
        self, condition: GazeOn, sheets: Sequence[Areas], agent: int | None, on_ns: int
    ) -> None:
        self._condition, self._sheets, self._agent = condition, sheets, agent
        self._from_ns = on_ns
        self._since_ns: int | None = None
        self._last_ns = 0
        self.met_ns: int | None = None
        """The time of the sample with which the look was long enough."""

    def __call__(self, view: FrameView) -> bool:
        """Take the gaze of a frame; tell whether the look was long enough."""
        if self.met_ns is None and view.gaze.sample_count:
            here = self._here(view.gaze)
            for t_ns, on in zip(view.gaze.t_ns.tolist(), here.tolist(), strict=True):
                self._take(t_ns, on)
        return self.met_ns is not None

    def _take(self, t_ns: int, on: int) -> None:
        """Take a sample: 1 on the area, 0 elsewhere, `LOST`."""
        if self.met_ns is not None or t_ns < self._from_ns:
            return
        if on == LOST:
            return
        if on == 0:
            self._since_ns = None
            return
        if self._since_ns is None or t_ns - self._last_ns > BRIDGE_NS:
            self._since_ns = t_ns
        self._last_ns = t_ns
        if t_ns - self._since_ns >= self._condition.seconds * NS_PER_S:
            self.met_ns = t_ns

    def _here(self, gaze: GazeView) -> npt.NDArray[np.int16]:
        agents = aoi_of_samples(
            gaze.angle_deg,
            gaze.radius_deg,
            gaze.pad_limit_deg,
            gaze.hit,
            pad_deg=self._condition.pad_deg,
        )
        if self._agent is not None:
            return np.where(agents == LOST, LOST, agents == self._agent).astype(np.int16)
        under = areas_under(
            self._sheets,
            [self._condition.name],
            gaze.origin_world_m,
            gaze.direction_world,
            self._condition.pad_deg,
            gaze.t_ns,
        )
        is_here = (under == 0) & (agents < 0)  # heads that nothing hides come first
        return np.where(gaze.valid, is_here, LOST).astype(np.int16)

    def columns(self, name: str, off_ns: int) -> dict[str, Scalar | None]:
        """Return the columns of a step that ended at a time."""
        begin, delay = (f"{name}{ending}" for ending, _, _ in ENDINGS)
        if self.met_ns is None:
            return {begin: None, delay: None}
        return {begin: self._since_ns, delay: (off_ns - self.met_ns) / NS_PER_MS}

"""Figures drawn live: one can look at them from all round, and sliders may mould them.

A live figure is made of example motions and of what leads from sliders to their weights. It answers
a slider in the next frame, where a film shows the same to everybody. Poses are the same on every
machine, shading is not: what a participant's graphics chip was, and how many frames it drew, is in
the trial's row.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, Final, Literal

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.pose_distance import MATCH_M, POSES
from visavis.stimuli.motion.synthesis.style_weights import StyleWeights, fit_weights
from visavis.stimuli.motion.synthesis.walk_styles import style_names, walk_examples
from visavis.study.responses import Number

MAX_LIMIT_S: Final = 3600.0
EndedBy = Literal["button", "limit", "near"]
RENDERER: Final = "renderer"
MOULD_COLUMNS: Final = (
    Column("on_ns", "ns", "session time of the figure's first frame"),
    Column("off_ns", "ns", "session time at which the step ended"),
    Column("ended_by", "", "button, limit (the time was over) or near (the target was reached)"),
    Column("moves", "1", "movements of sliders"),
    Column("turns", "1", "places of the camera after its first, at most 20 a second"),
    Column("frames", "1", "frames that the page drew"),
    Column("frames_dropped", "1", "frames that the display showed twice because none was drawn"),
    Column("slider_frames", "1", "most frames from a movement of a slider to its pose"),
    Column("wait_ms", "ms", "from the page's step to the figure's first frame"),
    Column("hidden_ms", "ms", "time for which the page could not be seen"),
    Column(
        "distance_m", "m", "mean distance of joints from the target at the end; empty without one"
    ),
    Column(RENDERER, "", "the graphics renderer that drew the figure"),
)
"""Columns that a moulded figure adds to a trial's row; its name (`mould`) goes before each."""
PLACES: Final = ("headset", "screen")
"""Where a page is seen that may enter a headset."""
BOTH_PLACES: Final = "both"
SEEN_IN: Final = Column(
    "seen_in", "", "where the page was seen: headset, screen, or both during one trial"
)
LIVE_COLUMNS: Final = (
    Column("on_ns", "ns", "session time of the first frame of figures that were watched"),
    Column("off_ns", "ns", "session time at which they were left"),
    Column("turns", "1", "places of the camera after its first, at most 20 a second"),
    Column("rounds", "1", "whole cycles that were shown (of two figures: of the one with fewer)"),
    Column("frames", "1", "frames that the page drew"),
    Column("frames_dropped", "1", "frames that the display showed twice because none was drawn"),
    Column("wait_ms", "ms", "from the page's step to the figures' first frame"),
    Column("hidden_ms", "ms", "time for which the page could not be seen"),
    Column(RENDERER, "", "the graphics renderer that drew the figures"),
)
"""Columns that watched figures add to a trial's row; their name (`live`) goes before each."""


@dataclass(frozen=True)
@of_kinds(unit=Any)
class Slider(Number):
    """A slider that moulds a live figure, from `low` to `high`, which stands at `start` first."""

    low: float = 0.0
    high: float = 1.0
    step: float = 0.01
    start: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.step > 0 or not self.low <= self.start <= self.high:
            raise DesignError(
                f"slider {self.name} starts at {self.start:g}; give a step above 0, and a start "
                f"from {self.low:g} to {self.high:g}"
            )


@cache
def walks(which: str, *names: str, character: str = "female_01") -> Examples:
    """Return example walks on the body of somebody of the cast, all of a set or those named.

    `set_a` has ten styles at one speed, `set_b` nine emotions at three speeds each.

    Raises:
        MotionError: there is no such set, or fewer than three walks are named.
        DesignError: it has no walk of a name, or there is nobody of that name.
    """
    styles = style_names(which)
    unknown = [name for name in names if name not in styles]
    if unknown:
        raise DesignError(f"{which} has no {', '.join(unknown)}; it has {', '.join(styles)}")
    styles_by_name = {name: styles[name] for name in names or styles}
    return walk_examples(styles_by_name, build_of_character(default_casting(character)))


@dataclass(frozen=True, eq=False)
@of_kinds()
class Live:
    """A figure that sliders blend from examples.

    `at` says at which values of the sliders each example stands, by its name; without it every
    slider is the weight of one example. The figure walks in place; a "free" camera circles it at
    the participant's will, a "still" one stays at `eye_m` and looks at `aim_m` (the figure stands
    at the origin and faces −z). `beside` names who walks the target of a step that has one, on the
    left; without it the target is not shown.

    Raises:
        DesignError: an example has no values, or not as many as the others.
        DataError: two examples stand at the same values.
    """

    examples: Examples
    at: Mapping[str, Sequence[float]] | None = None
    character: str = "female_01"
    beside: str = ""
    camera: Literal["free", "still"] = "free"
    eye_m: tuple[float, float, float] = (1.7, 1.35, -3.1)
    aim_m: tuple[float, float, float] = (0.0, 0.92, 0.0)

    def __post_init__(self) -> None:
        if self.camera not in ("free", "still") or self.eye_m == self.aim_m:
            raise DesignError(f"camera is {self.camera!r}; give free or still, and eye_m off aim_m")
        if self.at is None:
            return
        names = set(self.examples.names)
        if set(self.at) != names or len({len(row) for row in self.at.values()}) != 1:
            wrong = sorted(names.symmetric_difference(self.at))
            raise DesignError(
                "a live figure needs equally many slider values for every example"
                + (f"; look at {', '.join(wrong)}" if wrong else "")
            )
        _ = self.weights

    @cached_property
    def weights(self) -> StyleWeights | None:
        """What leads from sliders to weights; None where sliders are weights."""
        if self.at is None:
            return None
        return fit_weights(np.array([self.at[name] for name in self.examples.names], np.float64))

    def check_bodies(self) -> None:
        """Check that the examples are for the bodies of those who walk.

        Raises:
            DesignError: somebody has another body, or there is nobody of a name.
        """
        own = self.examples.skeleton
        for who in filter(None, (self.character, self.beside)):
            body = default_casting(who).skeleton
            if own.names != body.names or not np.allclose(own.offsets_m, body.offsets_m, atol=1e-6):
                raise DesignError(
                    f"the examples are not for the body of {who}; make them for it, as "
                    f"visavis.walks('set_a', character={who!r}) does"
                )

    def shares(self, values: Sequence[float] | Vector) -> Vector:
        """Return the weights (n,) of the examples at values of the sliders; they sum to 1."""
        point = np.asarray(values, dtype=np.float64)
        if self.weights is not None:
            return self.weights.at(point)
        total = float(point.sum())
        n = len(self.examples)
        return point / total if total > 0 else np.full(n, 1.0 / n)

    @property
    def slider_count(self) -> int:
        """How many sliders it takes."""
        return len(self.examples) if self.weights is None else self.weights.examples.shape[1]


@dataclass(frozen=True)
@of_kinds()
class Near:
    """A figure is near enough to another blend: the mean distance of its joints is below
    `within_m`, over `poses` moments of a cycle that are aligned by key times.

    `weights` make the other blend, by names of examples; those not named have none.
    """

    weights: Mapping[str, float] = field(hash=False)
    within_m: float = MATCH_M
    poses: int = POSES

    def __post_init__(self) -> None:
        values = list(self.weights.values())
        if not self.within_m > 0 or not 1 <= self.poses <= 100:
            raise DesignError("a target is reached within_m above 0, over 1 to 100 poses")
        if not values or min(values) < 0 or not sum(values) > 0:
            raise DesignError("a target needs weights of at least 0, one of them above it")

    def shares(self, examples: Examples) -> Vector:
        """Return the weights (n,) of all examples, with the sum 1.

        Raises:
            DesignError: it names an example that there is not.
        """
        return shares_by_name(self.weights, examples, "the target")


def shares_by_name(weights: Mapping[str, float], examples: Examples, of: str) -> Vector:
    """Return weights (n,) of all examples by those that are named, with the sum 1.

    Raises:
        DesignError: there is no example of a name, or no weight above 0; `of` says whose they are.
    """
    unknown = [name for name in weights if name not in examples.names]
    if unknown:
        raise DesignError(
            f"{of} names {', '.join(unknown)}; examples are {', '.join(examples.names)}"
        )
    values = np.array([weights.get(name, 0.0) for name in examples.names], np.float64)
    if not np.isfinite(values).all() or (values < 0).any() or not values.sum() > 0:
        raise DesignError(f"{of} needs weights of at least 0, one of them above it")
    shares: Vector = values / values.sum()
    return shares


@dataclass(frozen=True, eq=False)
class LiveScene:
    """A live figure that moves as one blend of its examples, cycle after cycle: a stimulus, as a
    film is one. `weights` make the blend, by names of examples; those not named have none.

    Where the figure has somebody beside it (`Live.beside`), that person moves as the blend
    `beside`: the figure stands on the left, as the first camera sees them.

    Raises:
        DesignError: there is no example of a name, no weight is above 0, or only one of the two
            says who or how somebody moves beside the figure.
    """

    live: Live
    weights: Mapping[str, float]
    beside: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        if (self.beside is None) is bool(self.live.beside):
            raise DesignError(
                "two figures need both: Live(…, beside=CHARACTER) says who is beside the first, "
                "LiveScene(…, beside=WEIGHTS) how they move"
            )
        _ = self.motions

    @cached_property
    def motions(self) -> tuple[Blend, ...]:
        """How the figure moves in place, and who is beside it."""
        blends = [(self.weights, "the figure's blend"), (self.beside, "the blend beside it")]
        examples = self.live.examples
        return tuple(
            Blend(examples, shares_by_name(weights, examples, of), in_place=True)
            for weights, of in blends
            if weights is not None
        )

    @property
    def cycle_s(self) -> float:
        """How long the longer of the cycles is."""
        return max(motion.cycle_s for motion in self.motions)


@dataclass(frozen=True, eq=False)
class Moulding:
    """A live figure with its sliders; ends by a button, near a target, or after `limit_s`.

    Where it `is_blind` the target is seen and the figure is not: it ends by a button. A `scene` is
    watched only: it has no sliders, and its button counts after `earliest_s`.
    """

    live: Live
    sliders: tuple[Slider, ...]
    until: Near | None = None
    limit_s: float = 300.0
    caption: str = ""
    is_blind: bool = False
    scene: LiveScene | None = None
    earliest_s: float = 0.0

    def __post_init__(self) -> None:
        if self.scene is not None:
            return
        if len(self.sliders) != self.live.slider_count:
            raise DesignError(
                f"t.mould: {len(self.sliders)} sliders for a figure that takes "
                f"{self.live.slider_count}"
            )
        if not 1.0 <= self.limit_s <= MAX_LIMIT_S:
            raise DesignError(f"t.mould: limit_s is {self.limit_s:g}; 1 to {MAX_LIMIT_S:g}")
        if self.until is not None:
            self.until.shares(self.live.examples)
        if self.is_blind and (self.until is None or not self.live.beside):
            raise DesignError(
                "t.mould: who does not see the figure must see its target; give until= and a live "
                "figure with beside="
            )


@dataclass(frozen=True)
class SliderMove:
    """A movement of a slider, at a session time."""

    slider: str
    value: float
    t_ns: int


@dataclass(frozen=True)
class Moulded:
    """What came of moulding: the last values, all movements in order, why it ended, and how far
    from the target in metres; None without a target.
    """

    values: Mapping[str, float]
    moves: tuple[SliderMove, ...]
    ended_by: str
    seconds: float
    distance_m: float | None = None


def live_columns(names: Iterable[str]) -> dict[str, Column]:
    """Return descriptions of the columns of a trial's live figures, by name.

    `names` are the figures': mould, mould2 … of those that are moulded, live, live2 … of others.
    """
    columns = (
        Column(f"{name}_{c.name}", c.unit, c.description)
        for name in names
        for c in (MOULD_COLUMNS if name.startswith("mould") else LIVE_COLUMNS)
    )
    return {c.name: c for c in columns}

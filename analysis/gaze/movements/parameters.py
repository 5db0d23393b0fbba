"""Thresholds of the adaptive detectors of eye movements, by what they decide."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

from visavis.analysis.gaze.movements.kinds import Detector
from visavis.lab.parts import missing_attribute, parts_from, takes_keywords_of


@dataclass(frozen=True, kw_only=True)
class VelocityRule:
    """How velocity is taken, and from which speed on rows are fast.

    It is taken over the first of `windows_ms`, the next wider one while the noise would lift the
    threshold above `max_threshold_deg_s`, or above `wide_max_threshold_deg_s` where the window is a
    wider one or has fewer than `firm_rows` rows to either side. A wider window averages noise and
    makes a saccade slower, so it has its own multiple.
    """

    windows_ms: tuple[float, ...] = (20.0, 30.0, 40.0, 60.0, 80.0, 100.0)
    max_threshold_deg_s: float = 75.0
    wide_max_threshold_deg_s: float = 45.0
    firm_rows: int = 3
    wide_noise_multiple: float = 3.5
    noise_multiple: float = 6.0
    """λ of Engbert & Kliegl (2003): the threshold in spreads of the noise."""
    minimum_deg_s: float = 15.0
    """The least speed of a saccade, however still gaze rests between them."""
    max_minimum_deg_s: float = 45.0
    """Where slow gaze drifts and pursues, its spread raises the least speed up to this."""


@dataclass(frozen=True, kw_only=True)
class SaccadeRule:
    """How long saccades and what swings after them last.

    A saccade lasts `saccade_samples` (Engbert & Kliegl 2003), limited to `min_saccade_ms` to
    `max_min_saccade_ms`, so that rates of 60 to 1000 Hz mean the same.
    """

    saccade_samples: int = 3
    min_saccade_ms: float = 8.0
    max_min_saccade_ms: float = 12.0
    oscillation_ms: float = 40.0


@dataclass(frozen=True, kw_only=True)
class LossRule:
    """What becomes of lost rows."""

    fill_ms: float = 75.0
    """Losses up to this are interpolated."""
    max_blink_ms: float = 500.0
    """Longer ones up to this are blinks, with the fast rows that touch them."""


@dataclass(frozen=True, kw_only=True)
class FixationRule:
    """Which fixations become one, and how long one lasts.

    Two become one when at most `merge_ms` and at most `merge_spreads` times what noise displaces
    gaze within a window (but `min_merge_deg` to `max_merge_deg`) lie between them.
    """

    merge_ms: float = 75.0
    merge_spreads: float = 3.0
    min_merge_deg: float = 0.1
    max_merge_deg: float = 1.0
    border_ms: float = 100.0
    min_fixation_ms: float = 60.0


@dataclass(frozen=True, kw_only=True)
class PursuitRule:
    """Which slow drift is pursuit."""

    pursuit: bool = True
    """Whether any is; otherwise it is called fixation, as published."""
    pursuit_change_cost: float = 3.0
    min_pursuit_ms: float = 100.0


@dataclass(frozen=True, kw_only=True)
class I2mcRule:
    """How I2MC (Hessels et al. 2017) clusters gaze, and joins what it finds."""

    cluster_window_ms: float = 200.0
    cluster_advance_ms: float = 20.0
    cluster_max_changes: int = 10
    cluster_spreads: float = 2.0
    cluster_merge_deg: float = 0.7
    cluster_merge_ms: float = 40.0
    cluster_border_spreads: float = 3.0
    max_saccade_ms: float = 150.0
    """What lies between two fixations is a saccade up to this."""


PARTS: Final[Mapping[str, type[Any]]] = {
    "velocity": VelocityRule,
    "saccades": SaccadeRule,
    "losses": LossRule,
    "fixations": FixationRule,
    "pursuits": PursuitRule,
    "i2mc": I2mcRule,
}
"""The parts of the parameters by the names under which they have them."""


@dataclass(frozen=True)
class _Keywords(I2mcRule, PursuitRule, FixationRule, LossRule, SaccadeRule, VelocityRule):
    """The keywords of `MovementParameters`: every field of every part."""

    detector: Detector | Literal["auto"] = "auto"
    nominal_rate_hz: float | None = field(default=None, kw_only=True)
    velocity: VelocityRule | None = field(default=None, kw_only=True)
    saccades: SaccadeRule | None = field(default=None, kw_only=True)
    losses: LossRule | None = field(default=None, kw_only=True)
    fixations: FixationRule | None = field(default=None, kw_only=True)
    pursuits: PursuitRule | None = field(default=None, kw_only=True)
    i2mc: I2mcRule | None = field(default=None, kw_only=True)


@dataclass(frozen=True, init=False)
class MovementParameters:
    """Thresholds of the adaptive detectors; durations in ms, angles in degrees.

    Fields of its parts are given by their names: `MovementParameters(min_fixation_ms=80)`.
    """

    detector: Detector | Literal["auto"]
    """The detector, or "auto": the one that suits rate and noise."""
    velocity: VelocityRule
    """From which speed on rows are fast."""
    saccades: SaccadeRule
    """How long saccades last."""
    losses: LossRule
    """What becomes of lost rows."""
    fixations: FixationRule
    """Which fixations become one, and how long one lasts."""
    pursuits: PursuitRule
    """Which slow drift is pursuit."""
    i2mc: I2mcRule
    """How I2MC clusters gaze."""
    nominal_rate_hz: float | None
    """The tracker's rate; taken from the stamps if left out."""

    @takes_keywords_of(_Keywords)
    def __init__(
        self,
        detector: Detector | Literal["auto"] = "auto",
        *,
        nominal_rate_hz: float | None = None,
        **keywords: Any,
    ) -> None:
        own = {"detector": detector, "nominal_rate_hz": nominal_rate_hz}
        for name, value in {**own, **parts_from(PARTS, keywords)}.items():
            object.__setattr__(self, name, value)  # the fields are frozen for everyone else

    if not TYPE_CHECKING:  # type checkers report a missing attribute themselves

        def __getattr__(self, name: str) -> Any:
            """Raise with the part that has this attribute."""
            raise missing_attribute(self, name, PARTS)

    def by_name(self) -> dict[str, Any]:
        """Return every threshold by its name, as files list them: without the parts."""
        parts = {k: v for name in PARTS for k, v in asdict(getattr(self, name)).items()}
        return {"detector": self.detector, **parts, "nominal_rate_hz": self.nominal_rate_hz}


AUTO: Final = MovementParameters()
STILL: Final = MovementParameters(pursuit=False)
"""For pictures in which nothing moves: no pursuit. Take it for all trials or for none."""

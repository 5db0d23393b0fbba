"""Everything about looks on one agent in a trial: whole, in parts, by ray, by other detectors.

A study declares `looks=LooksOn(...)`; the columns, their dictionary and what depends on padding and
minimum duration follow. Column names are constants here, `LOOK_COLUMNS` says what each holds.
Missing is None.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import (
    DEFAULT_PAD_DEG,
    SENSITIVITY_PADS_DEG,
    aoi_by_pad,
)
from visavis.analysis.gaze.events import (
    IDT_HEADSET,
    IVT_SCREEN,
    Fixations,
    IdtParameters,
    IvtParameters,
    detect_idt,
    detect_ivt,
)
from visavis.analysis.gaze.looks import (
    LookMeasures,
    LookParameters,
    measure_trial,
)
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement, Movements, fixations_of
from visavis.analysis.gaze.movements.parameters import AUTO, MovementParameters
from visavis.analysis.gaze.sensitivity import SENSITIVITY_MINIMA_MS, sensitivity_of_trial
from visavis.analysis.gaze.stamps import order_of
from visavis.analysis.gaze.targets import GazeTargets
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DataError
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.steps import Row, Scalar
from visavis.study.measures import LOOKS, TrialRecord

DWELL_MS: Final = "dwell_ms"
FIXATION_COUNT: Final = "fixation_count"
FIRST_FIXATION_TIME_MS: Final = "first_fixation_time_ms"
FIRST_FIXATION_DURATION_MS: Final = "first_fixation_duration_ms"
SECOND_FIXATION_TIME_MS: Final = "second_fixation_time_ms"
SECOND_FIXATION_DURATION_MS: Final = "second_fixation_duration_ms"

MAIN_MEASURES: Final = (
    DWELL_MS,
    FIXATION_COUNT,
    FIRST_FIXATION_DURATION_MS,
    FIRST_FIXATION_TIME_MS,
    SECOND_FIXATION_DURATION_MS,
    SECOND_FIXATION_TIME_MS,
)
"""The main measures of looks; recomputed for every padding and minimum duration."""

BEFORE: Final = "before_"
AFTER: Final = "after_"
RAW: Final = "raw_"
IVT: Final = "ivt_"
IDT: Final = "idt_"
ADAPTIVE: Final = "adaptive_"


_OF_LOOKS: Final = (
    Column(DWELL_MS, "ms", "time of valid gaze on the agent's head"),
    Column("dwell_in_fixations_ms", "ms", "the part of the dwell time that lies in fixations"),
    Column(FIXATION_COUNT, "1", "looks of at least the minimum duration (150 ms)"),
    Column("glance_count", "1", "shorter looks"),
    Column(FIRST_FIXATION_TIME_MS, "ms", "onset of the first fixation from the start"),
    Column(FIRST_FIXATION_DURATION_MS, "ms", "its duration, bridged loss included"),
    Column(SECOND_FIXATION_TIME_MS, "ms", "onset of the second fixation from the start"),
    Column(SECOND_FIXATION_DURATION_MS, "ms", "its duration, bridged loss included"),
    Column("on_at_onset", "", "the first sample was on the agent"),
    Column("cut_at_end", "", "the last look ran into the end"),
    Column("lost_01", "1", "share of the time without usable gaze, missing samples included"),
    Column("off_01", "1", "share of the time with valid gaze elsewhere"),
    Column("dwell_of_valid_01", "1", "dwell time as a share of the time with usable gaze"),
)
_EVENT_COLUMNS: Final = (
    Column("fixation_count", "1", "fixations anywhere in the scene"),
    Column("mean_fixation_ms", "ms", "their mean duration; missing without any"),
    Column("fixation_share_01", "1", "share of samples in a fixation"),
    Column("on_active_count", "1", "fixations with most of their samples on the agent"),
)
_MOVEMENT_COLUMNS: Final = (
    *_EVENT_COLUMNS,
    Column("saccade_count", "1", "saccades"),
    Column("pursuit_share_01", "1", "share of samples in smooth pursuit"),
    Column("blink_count", "1", "blinks"),
    Column("detector", "", "the detector chosen from rate and noise"),
)


def _with_prefix(prefix: str, note: str, columns: Sequence[Column]) -> tuple[Column, ...]:
    return tuple(Column(prefix + c.name, c.unit, f"{note}: {c.description}") for c in columns)


LOOK_COLUMNS: Final[tuple[Column, ...]] = (
    *_OF_LOOKS,
    Column("repeated_samples", "1", "samples left out because they repeat a time stamp"),
    Column("conflicting_samples", "1", "those of them that contradict the one kept, the first"),
    Column("backward_samples", "1", "samples stamped before the one that came before; sorted in"),
    Column("gaze_samples", "1", "samples within the trial"),
    *_with_prefix(RAW, "by the bare ray, without padding", _OF_LOOKS),
    *_with_prefix(BEFORE, "from the start to the change", _OF_LOOKS),
    *_with_prefix(AFTER, "from the change to the end", _OF_LOOKS),
    *_with_prefix(IVT, "by velocity, gaze in world", _EVENT_COLUMNS),
    *_with_prefix(IDT, "by dispersion, gaze in world", _EVENT_COLUMNS),
    *_with_prefix(ADAPTIVE, "by adaptive thresholds, gaze in world", _MOVEMENT_COLUMNS),
    Column("frozen_samples", "1", "samples that repeat one direction for 100 ms or more: lost"),
)
"""Every column that looks add to a trial's row."""

_NO_LOOKS: Final[Mapping[str, None]] = {c.name: None for c in _OF_LOOKS}


@dataclass(frozen=True)
class MeasureParameters:
    """The thresholds of the measures; they appear in the report.

    A tracker's faulty stamps must not cost a study its session: they are mended and counted in
    the row (`conflicting_samples`, `backward_samples`).
    """

    pad_deg: float = DEFAULT_PAD_DEG
    looks: LookParameters = field(default=LOOKS)
    ivt: IvtParameters = field(default=IVT_SCREEN)
    idt: IdtParameters = field(default=IDT_HEADSET)
    adaptive: MovementParameters = field(default=AUTO)


DEFAULT_MEASURE_PARAMETERS: Final = MeasureParameters()


@dataclass(frozen=True)
class TrialSpan:
    """The part of a trial's row that the measures need."""

    active: int
    start_ns: int
    end_ns: int
    switch_ns: int | None


def span_of_row(row: Row) -> TrialSpan:
    """Return what the measures need of a row; raises DataError where it is missing."""
    numbers: dict[str, int | None] = {}
    for name in ("active_index", "t_start_ns", "t_end_ns", "switch_ns"):
        value = row.get(name)
        if value is None or value != value:  # NaN where a table held a missing number
            numbers[name] = None
        elif isinstance(value, str):
            raise DataError(f"trial {row.get('trial_id')}: {name} is {value!r}, not a number")
        else:
            numbers[name] = int(value)
    active, start, end, switch = numbers.values()
    if active is None or start is None or end is None:
        raise DataError(
            f"trial {row.get('trial_id')}: active_index, t_start_ns or t_end_ns is missing; only "
            "trials that were carried through can be measured"
        )
    return TrialSpan(active, start, end, switch)


def trial_measures(
    targets: GazeTargets, row: Row, *, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> dict[str, Scalar | None]:
    """Measure a trial: the columns of `LOOK_COLUMNS`, without the second view's.

    `targets` may hold the whole session; `row` is the trial's, with `active_index`, `t_start_ns`,
    `t_end_ns` and, after a gaze change, `switch_ns`. Parts exist only with a change; their
    fixation times count from the part's own start and looks are cut at the change. Raises
    DataError for a row without those or samples that contradict themselves.
    """
    span = span_of_row(row)
    samples = targets.between(span.start_ns, span.end_ns)
    aoi = samples.areas(params.pad_deg)
    whole = _looks_within(samples, aoi, span, params.looks, span.switch_ns)
    raw = _looks_within(samples, samples.hit, span, params.looks, None)
    stamps = order_of(
        samples.t_ns, aoi, backward=params.looks.backward, conflicts=params.looks.conflicts
    )
    columns: dict[str, Scalar | None] = {
        **whole.as_row(),
        "repeated_samples": whole.repeated,
        "conflicting_samples": stamps.conflicting,
        "backward_samples": stamps.backward,
        "gaze_samples": int(np.count_nonzero(samples.t_ns >= span.start_ns)),
        **raw.as_row(RAW),
    }
    for number, prefix in enumerate((BEFORE, AFTER)):
        if whole.parts:
            columns |= whole.parts[number].as_row(prefix)
        else:
            columns |= {prefix + name: None for name in _NO_LOOKS}
    return columns


def _looks_within(
    samples: GazeTargets,
    aoi: npt.NDArray[np.integer[Any]],
    span: TrialSpan,
    params: LookParameters,
    switch_ns: int | None,
) -> LookMeasures:
    return measure_trial(
        samples.t_ns,
        aoi,
        span.active,
        span.start_ns,
        span.end_ns,
        switch_ns=switch_ns,
        params=params,
    )


def samples_in_order(
    targets: GazeTargets, span: TrialSpan, params: MeasureParameters
) -> GazeTargets:
    """Return a trial's samples in the order of their stamps, without repeated ones."""
    samples = targets.between(span.start_ns, span.end_ns)
    order = order_of(
        samples.t_ns,
        samples.hit,
        backward=params.looks.backward,
        conflicts=params.looks.conflicts,
    )
    return samples if order.rows is None else samples.rows(order.rows)


def second_view(
    targets: GazeTargets, row: Row, *, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> dict[str, Scalar | None]:
    """Return the results of detectors of eye movements: I-VT, I-DT and adaptive columns.

    A fixation counts as on the active agent when more than half its samples are, by the padded
    rule.
    """
    span = span_of_row(row)
    samples = samples_in_order(targets, span, params)
    t_ns, aoi = samples.t_ns, samples.areas(params.pad_deg)
    direction = np.where(samples.valid[:, None], samples.direction_world, np.nan)
    on_active = aoi == span.active
    columns = _event_columns(IVT, detect_ivt(t_ns, direction, params.ivt), on_active)
    columns |= _event_columns(IDT, detect_idt(t_ns, direction, params.idt), on_active)
    movements = detect_movements(t_ns, direction, params.adaptive, in_head=samples.direction_head)
    columns |= _event_columns(ADAPTIVE, fixations_of(movements), on_active)
    return columns | _movement_columns(movements)


def _movement_columns(movements: Movements) -> dict[str, Scalar | None]:
    n = len(movements.movement)
    return {
        ADAPTIVE + "saccade_count": int((movements.kind == Movement.SACCADE).sum()),
        ADAPTIVE + "pursuit_share_01": movements.share_01(Movement.PURSUIT) if n else None,
        ADAPTIVE + "blink_count": int((movements.kind == Movement.BLINK).sum()),
        ADAPTIVE + "detector": movements.detector if n else None,
    }


def _event_columns(
    prefix: str, fixations: Fixations, on_active: npt.NDArray[np.bool_]
) -> dict[str, Scalar | None]:
    active_before = np.concatenate([[0], np.cumsum(on_active)])
    on = active_before[fixations.last_row + 1] - active_before[fixations.first_row]
    length = fixations.last_row + 1 - fixations.first_row
    n = on_active.shape[0]
    return {
        prefix + "fixation_count": len(fixations),
        prefix + "mean_fixation_ms": (
            float(fixations.duration_ns.mean()) / NS_PER_MS if len(fixations) else None
        ),
        prefix + "fixation_share_01": float(fixations.in_fixation.mean()) if n else None,
        prefix + "on_active_count": int(np.count_nonzero(2 * on > length)),
    }


def sensitivity_rows(
    targets: GazeTargets,
    row: Row,
    *,
    pads_deg: Sequence[float] = SENSITIVITY_PADS_DEG,
    minima_ms: Sequence[float] = SENSITIVITY_MINIMA_MS,
    params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
) -> Iterator[dict[str, Scalar | None]]:
    """Yield the six measures for every padding and minimum fixation duration."""
    span = span_of_row(row)
    samples = targets.between(span.start_ns, span.end_ns)
    areas = aoi_by_pad(
        samples.angle_deg,
        samples.radius_deg,
        samples.pad_limit_deg,
        samples.hit,
        pads_deg=pads_deg,
    )
    results = sensitivity_of_trial(
        samples.t_ns,
        areas,
        span.active,
        span.start_ns,
        span.end_ns,
        minima_ms=minima_ms,
        params=params.looks,
    )
    for one in results:
        measures = one.measures.as_row()
        yield {
            "pad_deg": one.pad_deg,
            "minimum_fixation_ms": one.minimum_fixation_ms,
            **{name: measures[name] for name in MAIN_MEASURES},
        }


@dataclass(frozen=True)
@of_kinds()
class LooksOn:
    """Ask for everything about looks on the agent whose index a trial's row names.

    `agent`, `start`, `end` and `switch` are columns of the row; without `switch` there are no
    parts. `pad` names the parameter of the plan that pads heads: measures follow the rule that
    trials decided looks by.
    """

    agent: str = "scene_active"
    start: str = "scene_on_ns"
    end: str = "scene_off_ns"
    switch: str = ""
    pad: str = "pad_deg"

    def rules(self, plan: Mapping[str, Any]) -> MeasureParameters:
        """Return the thresholds for a recorded plan."""
        pad_deg = plan.get("parameters", {}).get(self.pad, DEFAULT_MEASURE_PARAMETERS.pad_deg)
        return replace(DEFAULT_MEASURE_PARAMETERS, pad_deg=float(pad_deg))

    def measure(
        self, record: TrialRecord, frozen: npt.NDArray[np.bool_], params: MeasureParameters
    ) -> tuple[dict[str, Scalar | None], list[dict[str, Scalar | None]]]:
        """Return a trial's columns, and its main measures by padding and minimum duration.

        `frozen` says of every sample of the part whether it repeats one direction too long.
        """
        if record.gaze is None:
            return {c.name: None for c in LOOK_COLUMNS}, []
        columns = self.columns(record, frozen, params)
        return columns, list(sensitivity_rows(record.gaze, self.row_of(record), params=params))

    def row_of(self, record: TrialRecord) -> Row:
        """Return a trial's row with the names that `trial_measures` knows."""
        return {
            "trial_id": record.row.get("trial_id"),
            "active_index": record.row.get(self.agent),
            "t_start_ns": record.row.get(self.start),
            "t_end_ns": record.row.get(self.end),
            "switch_ns": record.row.get(self.switch) if self.switch else None,
        }

    def columns(
        self, record: TrialRecord, frozen: npt.NDArray[np.bool_], params: MeasureParameters
    ) -> dict[str, Scalar | None]:
        """Return a trial's columns alone."""
        if record.gaze is None:
            return {c.name: None for c in LOOK_COLUMNS}
        row = self.row_of(record)
        span = span_of_row(row)
        within = (record.gaze.t_ns >= span.start_ns) & (record.gaze.t_ns < span.end_ns)
        columns = trial_measures(record.gaze, row, params=params)
        columns |= {"frozen_samples": int(frozen[within].sum())}
        return columns | second_view(record.gaze, row, params=params)

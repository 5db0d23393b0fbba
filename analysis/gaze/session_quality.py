"""Measure a session's gaze by the field's standard: accuracy, precision, loss, rate, latency."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.loss import DEFAULT_LOSS, Loss, loss, usable_samples
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement, Movements
from visavis.analysis.gaze.pupil import (
    Pupil,
    PupilResponse,
    prepared_pupil,
    pupil_mm_of,
    response,
)
from visavis.analysis.gaze.pupil_blinks import PupilBlinks, pupil_blinks
from visavis.analysis.gaze.quality import moving_precision_deg
from visavis.analysis.gaze.stamps import Times, order_of
from visavis.analysis.gaze.targets import gaze_delay_ms
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector
from visavis.recording.reader import Recording

GAZE, TARGETS, FRAMES = "gaze", "gaze_targets", "frames"
EYES: Mapping[str, tuple[str, str]] = {
    "combined": ("direction_head", "valid"),
    "left": ("left_direction_head", "left_valid"),
    "right": ("right_direction_head", "right_valid"),
}
MAX_LATENCY_MS = 1000.0
"""A larger age is not latency: the tracker's clock was not fitted yet."""


@dataclass(frozen=True, slots=True)
class ValidationQuality:
    """One validation: where in the session it stood, and the combined eye's error in degrees."""

    moment: str
    block: int
    accepted: bool
    accuracy_deg: float
    worst_point_deg: float
    rms_s2s_deg: float
    std_deg: float
    lost_01: float


@dataclass(frozen=True, slots=True)
class EyeQuality:
    """One eye over the whole session; precision in free viewing, over windows of 200 ms."""

    eye: str
    loss: Loss
    rms_s2s_median_deg: float
    rms_s2s_calmest_deg: float
    std_median_deg: float


@dataclass(frozen=True, slots=True)
class Latency:
    """Age of gaze in ms, medians and 95th percentiles; NaN where it cannot be measured.

    `handed_over` when the session had a sample, `shown` when the frame that used it was due on
    the display, from the sample's time on: what the tracker itself takes before it stamps a sample
    is in both where its delay is configured, in neither where it is not.
    """

    handed_over_ms: float
    handed_over_p95_ms: float
    shown_ms: float
    shown_p95_ms: float


@dataclass(frozen=True, slots=True)
class TrialPupil:
    """Pupil size in one finished trial against the moment before it."""

    trial_id: str
    response: PupilResponse


@dataclass(frozen=True)
class SessionQuality:
    """Everything the page on a session's gaze shows; `pupil` None where none was recorded."""

    participant: str
    session: int
    is_simulated: bool
    study: str
    tracker: str
    nominal_rate_hz: float
    gaze_delay_ms: float | None
    validations: tuple[ValidationQuality, ...]
    eyes: tuple[EyeQuality, ...]
    latency: Latency
    movements: Movements
    pupil: Pupil | None
    pupil_trials: tuple[TrialPupil, ...]
    pupil_blinks: PupilBlinks | None = None


def session_quality(recording: Recording) -> SessionQuality:
    """Measure a session. Raises DataError when it recorded no gaze."""
    if GAZE not in recording.stream_names:
        raise DataError(
            f"{recording.path}: no gaze was recorded; there is nothing to measure. "
            "`visavis check` lists the recorded streams"
        )
    gaze = recording.stream_arrays(GAZE)
    schema = recording.stream_schema(GAZE)
    rate_hz = schema.nominal_rate_hz if schema is not None else 0.0
    order = order_of(
        gaze["t_host_ns"], gaze["direction_head"], backward="sort", conflicts="keep_first"
    )
    rows = np.arange(len(gaze["t_host_ns"])) if order.rows is None else order.rows
    delay_ms = gaze_delay_ms(recording)
    t_ns = gaze["t_host_ns"][rows] - round((delay_ms or 0.0) * NS_PER_MS)
    if rate_hz <= 0 or not len(t_ns):
        raise DataError(f"{recording.path}: the gaze stream has no samples or states no rate")
    pupil_mm = pupil_mm_of(gaze)
    in_head = np.where(gaze["valid"][:, None], gaze["direction_head"], np.nan)[rows]
    pupil = None if pupil_mm is None else prepared_pupil(t_ns, pupil_mm[rows], in_head)
    devices = recording.manifest.configuration.get("devices", {})
    return SessionQuality(
        participant=recording.manifest.participant,
        session=recording.manifest.session,
        is_simulated=recording.is_simulated,
        study=recording.manifest.study,
        tracker=str(devices.get("eye_tracker", {}).get("driver", "unknown")),
        nominal_rate_hz=rate_hz,
        gaze_delay_ms=delay_ms,
        validations=_validations(recording),
        eyes=tuple(
            _eye(name, t_ns, gaze[direction][rows], gaze[valid][rows], rate_hz)
            for name, (direction, valid) in EYES.items()
            if direction in gaze and valid in gaze
        ),
        latency=_latency(recording),
        movements=_movements(
            recording,
            t_ns,
            np.stack([gaze["recording_part"], gaze["seq"]], axis=1)[rows].astype(np.int64),
            in_head,
        ),
        pupil=pupil,
        pupil_trials=() if pupil is None else _pupil_trials(recording, t_ns, pupil),
        pupil_blinks=None if pupil_mm is None else pupil_blinks(t_ns, pupil_mm[rows]),
    )


def _eye(
    name: str,
    t_ns: Times,
    direction: npt.NDArray[np.floating],
    valid: npt.NDArray[np.bool_],
    rate_hz: float,
) -> EyeQuality:
    usable = usable_samples(t_ns, direction, valid=valid)
    usable_gaze = np.where(usable[:, None], direction, np.nan)
    median, calmest = moving_precision_deg(t_ns, usable_gaze)
    return EyeQuality(
        name,
        loss(t_ns, direction, usable, nominal_rate_hz=rate_hz, frozen_ms=DEFAULT_LOSS.frozen_ms),
        median,
        calmest,
        _moving_std_deg(t_ns, usable_gaze),
    )


def _moving_std_deg(t_ns: Times, direction: Vector, window_ms: float = 200.0) -> float:
    """Return the median spread about the mean over consecutive windows; NaN when none is full."""
    place = (t_ns - t_ns[0]) // round(window_ms * NS_PER_MS)
    is_known = np.isfinite(direction[:, 0])
    places, first = np.unique(place[is_known], return_index=True)
    if not len(places):
        return np.nan
    v = direction[is_known].astype(np.float64)
    count = np.diff(np.append(first, len(v)))
    sums = np.add.reduceat(v, first, axis=0)
    # the mean squared distance of unit vectors from their mean is 1 − |mean|²
    spread = np.sqrt(np.maximum(0.0, 1.0 - ((sums / count[:, None]) ** 2).sum(axis=1)))
    full = count >= max(3, np.max(count) / 2)
    return float(np.degrees(np.median(spread[full]))) if full.any() else np.nan


def _validations(recording: Recording) -> tuple[ValidationQuality, ...]:
    events = recording.events()
    payloads = events.loc[events["name"] == "validation", "payload"] if len(events) else ()
    return tuple(
        ValidationQuality(
            moment=str(v["moment"]),
            block=int(v["block"]),
            accepted=bool(v["accepted"]),
            accuracy_deg=_number(v["accuracy_deg"]),
            worst_point_deg=_number(v["worst_point_deg"]),
            rms_s2s_deg=_number(v["precision_deg"]),
            std_deg=_mean(p["std_deg"] for p in v.get("points", ()) if p["eye"] == "combined"),
            lost_01=_number(v["lost_01"]),
        )
        for v in payloads
    )


def _number(value: Any) -> float:
    return np.nan if value is None else float(value)


def _mean(values: Any) -> float:
    numbers = [float(v) for v in values if v is not None]
    return float(np.mean(numbers)) if numbers else np.nan


def _latency(recording: Recording) -> Latency:
    if TARGETS not in recording.stream_names or FRAMES not in recording.stream_names:
        return Latency(np.nan, np.nan, np.nan, np.nan)
    targets, frames = recording.stream_arrays(TARGETS), recording.stream_arrays(FRAMES)
    age_at_hand_over_ms = (targets["t_host_ns"] - targets["t_sample_ns"]) / NS_PER_MS
    key = np.stack([frames["recording_part"], frames["frame_index"]], axis=1).tolist()
    due = dict(zip(map(tuple, key), frames["predicted_display_ns"].tolist(), strict=True))
    of = np.stack([targets["recording_part"], targets["frame_index"]], axis=1).tolist()
    age_on_display_ms = np.array(
        [
            (due.get((part, frame), np.nan) - t) / NS_PER_MS
            for (part, frame), t in zip(of, targets["t_sample_ns"].tolist(), strict=True)
        ]
    )
    return Latency(*_middle_and_late(age_at_hand_over_ms), *_middle_and_late(age_on_display_ms))


def _middle_and_late(ms: npt.NDArray[np.floating]) -> tuple[float, float]:
    plausible = ms[np.abs(ms) <= MAX_LATENCY_MS]
    if not plausible.size:
        return np.nan, np.nan
    middle, late = np.percentile(plausible, (50, 95))
    return float(middle), float(late)


def _movements(
    recording: Recording, t_ns: Times, numbers: npt.NDArray[np.int64], in_head: Vector
) -> Movements:
    """Find eye movements of the session, in world where the session knew it.

    `numbers` (n, 2) are recording part and number of every sample.
    """
    if TARGETS not in recording.stream_names:
        return detect_movements(t_ns, in_head)
    targets = recording.stream_arrays(TARGETS)
    world = np.full(in_head.shape, np.nan)
    for part in np.unique(numbers[:, 0]):
        own = np.flatnonzero(numbers[:, 0] == part)
        by_seq = own[np.argsort(numbers[own, 1])]
        target_rows = np.flatnonzero((targets["recording_part"] == part) & targets["valid"])
        gaze_numbers = targets["gaze_seq"][target_rows]
        at = np.minimum(np.searchsorted(numbers[by_seq, 1], gaze_numbers), len(by_seq) - 1)
        fits = numbers[by_seq[at], 1] == gaze_numbers
        world[by_seq[at[fits]]] = targets["direction_world"][target_rows[fits]]
    if not np.isfinite(world[:, 0]).any():
        return detect_movements(t_ns, in_head)
    return detect_movements(t_ns, world, in_head=in_head)


def _pupil_trials(recording: Recording, t_ns: Times, pupil: Pupil) -> tuple[TrialPupil, ...]:
    return tuple(
        TrialPupil(
            str(row["trial_id"]),
            response(t_ns, pupil, int(row["t_start_ns"]), int(row["t_end_ns"])),
        )
        for row in recording.trials().to_dict("records")
        if row.get("status") == "complete"
        and all(row.get(c) is not None and row[c] == row[c] for c in ("t_start_ns", "t_end_ns"))
    )


def blinks_a_minute(quality: SessionQuality) -> float:
    """Return the rate of blinks over the time recorded; NaN without an eye."""
    if not quality.eyes or not quality.eyes[0].loss.duration_ms:
        return np.nan
    blinks = int((quality.movements.kind == Movement.BLINK).sum())
    return blinks * 60_000 / quality.eyes[0].loss.duration_ms

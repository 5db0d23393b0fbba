"""Say how well a stream arrives: rate, gaps, jitter and delay, from its batches alone."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import NO_DEVICE_TIME, ClockPair
from visavis.devices.meter import GAP_PERIODS
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.clock_fit import ClockFit, fit_clock, fit_one_way, offset_ns
from visavis.lab.schema import SampleBatch, StreamSchema

MIN_FOR_FIGURES = 10
THIN_NS = NS_PER_S // 2
MIN_NS_FOR_DRIFT = 5 * NS_PER_S


@dataclass(frozen=True)
class StreamFigures:
    """One stream of a capture; None where it cannot be known.

    `gaps` are spacings of more than 1.5 nominal periods; `lost` are holes in the numbering.
    `jitter_ms` is the standard deviation of arrival against the device's own time. `delay_ms`
    and `delay_p99_ms` are from the device's time to arrival: absolute with time exchanges
    (`delay_is_absolute`), above the quickest sample of this capture without.
    """

    stream: str
    samples: int
    nominal_rate_hz: float
    rate_hz: float | None
    gaps: int
    longest_gap_ms: float | None
    lost: int
    jitter_ms: float | None
    delay_ms: float | None
    delay_p99_ms: float | None
    delay_is_absolute: bool


@dataclass(frozen=True)
class ClockFigures:
    """A device's clock compared with ours; `bound_ms` is half the best round trip, the largest
    error of the offset by an asymmetric link; None for a device that answers no requests.
    `drift_ppm` is None for a capture too short to know it.
    """

    exchanges: int
    offset_ms: float
    drift_ppm: float | None
    residual_ms: float | None
    bound_ms: float | None


def stream_figures(
    schema: StreamSchema, batches: Sequence[SampleBatch], pairs: Sequence[ClockPair] = ()
) -> StreamFigures:
    """Measure one stream; `batches` are those of this schema, in the order they came."""
    own = [batch for batch in batches if batch.schema.name == schema.name and len(batch)]
    count = sum(map(len, own))
    empty = np.zeros(0, np.int64)
    seq, device, host = (
        np.concatenate([getattr(b, name) for b in own]) if own else empty
        for name in ("seq", "t_device_ns", "t_host_ns")
    )
    has_device_time = (device != NO_DEVICE_TIME).all() if count else False
    stamps = device if has_device_time else host
    steps = np.diff(stamps)
    rate_hz = None
    if count > 1 and stamps[-1] > stamps[0]:
        rate_hz = float((count - 1) * NS_PER_S / (stamps[-1] - stamps[0]))
    gaps, longest_ms = 0, None
    if schema.nominal_rate_hz > 0 and steps.size:
        gaps = int((steps > GAP_PERIODS * NS_PER_S / schema.nominal_rate_hz).sum())
        longest_ms = float(steps.max() / NS_PER_MS)
    jitter_ms = delay_ms = late_ms = None
    enough = count >= MIN_FOR_FIGURES and np.unique(device).size >= MIN_FOR_FIGURES
    is_own = has_device_time and not np.array_equal(device, host)  # else stamped by our own clock
    if is_own and enough and schema.nominal_rate_hz > 0:
        fit = steady_fit(pairs) if pairs else fit_one_way(device, host)
        delays = (host - fit.to_host_ns(device)) / NS_PER_MS
        jitter_ms = float(np.std(delays))
        delay_ms, late_ms = (float(v) for v in np.percentile(delays, (50, 99)))
    return StreamFigures(
        schema.name,
        count,
        schema.nominal_rate_hz,
        rate_hz,
        gaps,
        longest_ms,
        _holes(seq),
        jitter_ms,
        delay_ms,
        late_ms,
        bool(pairs),
    )


def clock_figures(
    batches: Sequence[SampleBatch], pairs: Sequence[ClockPair] = ()
) -> ClockFigures | None:
    """Fit a device's clock: on its exchanges, or on the arrivals of its first regular stream."""
    if pairs:
        best_ns = min(pair.host_receive_ns - pair.host_send_ns for pair in pairs)
        return _clock(steady_fit(pairs), len(pairs), best_ns / 2 / NS_PER_MS, _span_ns(pairs))
    regular = [b for b in batches if b.schema.nominal_rate_hz > 0 and len(b)]
    own = [b for b in regular if b.schema.name == regular[0].schema.name]
    if not own:
        return None
    device = np.concatenate([b.t_device_ns for b in own])
    host = np.concatenate([b.t_host_ns for b in own])
    if (device == host).all() or np.unique(device).size < MIN_FOR_FIGURES:
        return None
    return _clock(fit_one_way(device, host), 0, None, int(host[-1] - host[0]))


def steady_fit(pairs: Sequence[ClockPair]) -> ClockFit:
    """Fit a clock on the best exchange of every half second.

    Exchanges of the opening lie close together and would give a drift made of their noise. Over
    less than five seconds the drift is taken as zero.
    """
    best: dict[int, ClockPair] = {}
    for pair in pairs:
        bin_number = pair.host_send_ns // THIN_NS
        if bin_number not in best or _round_trip_ns(pair) < _round_trip_ns(best[bin_number]):
            best[bin_number] = pair
    fit = fit_clock(list(best.values()))
    if _span_ns(pairs) >= MIN_NS_FOR_DRIFT:
        return fit
    return replace(fit, offset_ns=offset_ns(pairs), drift_ppm=0.0)


def _round_trip_ns(pair: ClockPair) -> int:
    return pair.host_receive_ns - pair.host_send_ns


def _span_ns(pairs: Sequence[ClockPair]) -> int:
    return pairs[-1].host_send_ns - pairs[0].host_send_ns


def _clock(fit: ClockFit, exchanges: int, bound_ms: float | None, span_ns: int) -> ClockFigures:
    residual_ms = None if np.isnan(fit.residual_ms) else fit.residual_ms
    drift_ppm = fit.drift_ppm if span_ns >= MIN_NS_FOR_DRIFT else None
    return ClockFigures(exchanges, fit.offset_ns / NS_PER_MS, drift_ppm, residual_ms, bound_ms)


def _holes(seq: npt.NDArray[np.int64]) -> int:
    return int((np.diff(seq) - 1).clip(min=0).sum()) if seq.size > 1 else 0

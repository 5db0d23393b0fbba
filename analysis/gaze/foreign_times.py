"""Judge the stamps of a recording from elsewhere: what they cannot be, and what is odd about them.

What cannot be a tracker's time is refused with the likely reason; what is odd is told.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.foreign import GazeRecording, rows_of
from visavis.analysis.gaze.stamps import Times, typical_step_ns
from visavis.analysis.gaze.text_table import NS_PER_UNIT
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.sampling import Sampling, time_returns

MAX_RATE_HZ, MIN_RATE_HZ = 4000.0, 1.0
"""No eye tracker samples faster, and none that is analysed slower."""
LIKELY_HZ = (20.0, 2500.0)
MAX_ROWS_PER_STAMP = 32
"""More rows than this share a stamp on average only where stamps were rounded or ruined."""
COARSE_01, MIN_COARSE_ROWS = 0.05, 10
"""From this share of rows that share a stamp on they are coarse stamps, and no repeated rows."""
OFF_RATE_01 = 0.1


def recordings_of(recording: GazeRecording) -> tuple[GazeRecording, ...]:
    """Return the recordings that lie one after the other in a file, NAME_1, NAME_2, …; or the one.

    Another one begins where time begins anew: a program that was started twice and appended, or
    a clock that was set back, so that the time between them is unknown.
    """
    returns = time_returns(recording.t_ns)
    if not returns.restarts:
        return (recording,)
    edges = (0, *returns.restarts, len(recording))
    rows = {
        reason: ", ".join(
            str(row + 1)
            for row, why in zip(returns.restarts, returns.reasons, strict=True)
            if why == reason
        )
        for reason in returns.reasons
    }
    reasons = " and ".join(f"a {reason} from row {at} on" for reason, at in rows.items())
    remark = f"{len(edges) - 1} recordings in one file: {reasons}"
    return tuple(
        replace(
            rows_of(recording, np.arange(edges[i], edges[i + 1])),
            name=f"{recording.name}_{i + 1}",
            remarks=(*recording.remarks, f"{remark}; this is number {i + 1}"),
        )
        for i in range(len(edges) - 1)
    )


def checked_times(
    recording: GazeRecording, values: npt.NDArray[np.floating]
) -> tuple[Times, tuple[str, ...]]:
    """Return the stamps (n,) to use, and remarks; `values` (n, k) are the samples.

    Samples that share coarse stamps are spread evenly up to the next stamp.

    Raises:
        DataError: nearly all stamps are equal, or the rate is none of an eye tracker.
    """
    t_ns = recording.t_ns
    n = len(t_ns)
    distinct = np.unique(t_ns)
    if n > MAX_ROWS_PER_STAMP * len(distinct):
        raise DataError(
            f"{recording.name}: nearly all stamps are equal ({len(distinct)} different ones in {n} "
            "rows); a spreadsheet that shows few digits writes no more of them: take the file as "
            "the tracker's program wrote it"
        )
    remarks: tuple[str, ...] = ()
    shares = np.concatenate([[False], np.diff(t_ns) == 0])
    with np.errstate(invalid="ignore"):
        differs = (np.diff(values, axis=0) != 0).any(axis=1)
    coarse = int((shares[1:] & differs).sum())
    if coarse > max(COARSE_01 * n, MIN_COARSE_ROWS) and len(distinct) > 1:
        t_ns = _spread(t_ns, shares)
        remarks = (
            f"{coarse} samples share the stamp of the one before: stamps are coarse, and samples "
            "were spread evenly up to the next stamp",
        )
        distinct = np.unique(t_ns)
    if len(distinct) > 2:
        _refuse_implausible_rate(recording, NS_PER_S / typical_step_ns(distinct))
    return t_ns, remarks


def recorded_times(t_ns: Times, resumed_ns: Sequence[int]) -> Times:
    """Return increasing stamps (n,) as if the recorder had not paused: a usual step for each pause.

    `resumed_ns` are the stamps at which it went on.
    """
    rows = np.unique(np.searchsorted(t_ns, np.array(resumed_ns, np.int64)))
    rows = rows[(rows > 0) & (rows < len(t_ns))]
    if not len(rows):
        return t_ns
    steps = np.diff(t_ns, prepend=t_ns[:1])
    steps[rows] = np.minimum(steps[rows], typical_step_ns(np.unique(t_ns)))
    out: Times = t_ns[0] + np.cumsum(steps)
    return out


def _spread(t_ns: Times, shares: npt.NDArray[np.bool_]) -> Times:
    """Return stamps in which those that share one lie evenly between it and the next."""
    first = np.flatnonzero(~shares)
    counts = np.diff(np.append(first, len(t_ns)))
    starts = t_ns[first]
    steps = np.diff(starts)
    usual = float(np.median(steps[steps > 0] / counts[:-1][steps > 0])) if (steps > 0).any() else 0
    spans = np.append(steps, round(usual * counts[-1])).astype(np.float64)
    # Before a pause, or where time goes back, by the usual period.
    odd = (spans <= 0) | (spans > 4 * usual * counts)
    spans[odd] = usual * counts[odd]
    place = np.arange(len(t_ns)) - np.repeat(first, counts)
    away = np.repeat(spans / counts, counts) * place
    out: Times = t_ns + away.astype(np.int64)
    return out


def _refuse_implausible_rate(recording: GazeRecording, rate_hz: float) -> None:
    if MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ:
        return
    hint = "is the unit of time another"
    if recording.time_unit in NS_PER_UNIT:
        own = NS_PER_UNIT[recording.time_unit]
        likely = [
            unit
            for unit, ns in NS_PER_UNIT.items()
            if LIKELY_HZ[0] <= rate_hz * own / ns <= LIKELY_HZ[1]
        ]
        hint = f"is the unit {' or '.join(likely)}" if likely else hint
    rate = f"{rate_hz:,.0f}".replace(",", " ") if rate_hz > 10 else f"{rate_hz:.2g}"
    raise DataError(f"{recording.name}: no eye tracker has {rate} Hz; {hint}?")


def sampling_remarks(sampling: Sampling, stated_hz: float | None) -> tuple[str, ...]:
    """Return what is odd about how a recording was sampled."""
    remarks = []
    rates = sampling.rates_hz
    if len(rates) > 1:
        rates_text = ", then ".join(f"{rate:.4g}" for rate in rates)
        remarks.append(f"the rate changes: {rates_text} Hz")
    elif stated_hz is not None and abs(sampling.rate_hz / stated_hz - 1) > OFF_RATE_01:
        remarks.append(
            f"{sampling.rate_hz:.4g} Hz by its stamps, {stated_hz:g} Hz stated; what is lost is "
            "counted by the stated rate"
        )
    if not sampling.is_even:
        remarks.append(
            f"stamps are uneven though nothing is lost between them, as a host's are; "
            f"{sampling.rate_hz:.4g} Hz by regression"
        )
    return tuple(remarks)

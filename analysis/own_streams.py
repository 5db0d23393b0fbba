"""Streams of the lab's own devices: every column described and drawn.

Such a stream (a belt, an amplifier) is known by nothing but its columns and their units.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.report import Column, Paragraph, Picture, Section, Table
from visavis.analysis.report.notation import decimal, percentage
from visavis.devices.meter import GAP_PERIODS
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.config import ARMBAND_ROLE, ROLES, TAKEN_STREAMS
from visavis.lab.sampling import gaps_beyond
from visavis.recording.reader import PART_COLUMN, Recording, flat_components

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from visavis.analysis.plots import ReportFigure

MAX_CURVES: Final = 12
"""Most columns drawn of one stream; an amplifier's further ones look alike."""
BINS: Final = 400
"""Points along a curve; each is drawn with the range of what lies in it."""
OF_VISAVIS: Final = frozenset({*ROLES, *TAKEN_STREAMS})

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class OwnColumn:
    """One column; NaN where it has no values. `curve` is its course over the session.

    `curve` has shape (n, 4): seconds, lowest, middle, highest of the samples around.
    """

    name: str
    unit: str
    mean: float
    sd: float
    low: float
    high: float
    missing_01: float
    curve: Values


@dataclass(frozen=True)
class OwnStream:
    """One stream over a session. `expected` and the longest gap are None without a stated rate."""

    participant: str
    session: int
    name: str
    is_simulated: bool
    rows: int
    nominal_rate_hz: float
    rate_hz: float
    expected: int | None
    gaps: int | None
    longest_gap_ms: float | None
    columns: tuple[OwnColumn, ...]


def is_own_stream(name: str) -> bool:
    """Say whether a stream is of a device of the lab's own, by its name."""
    return not any(
        name == ours or ARMBAND_ROLE.fullmatch(name.removeprefix(f"{ours}_")) for ours in OF_VISAVIS
    )


def own_streams(recording: Recording) -> tuple[OwnStream, ...]:
    """Describe every stream of the lab's own devices in a session."""
    return tuple(_stream(recording, name) for name in recording.stream_names if is_own_stream(name))


def _stream(recording: Recording, name: str) -> OwnStream:
    schema = recording.stream_schema(name)
    arrays = recording.stream_arrays(name)
    t_ns, parts = arrays["t_host_ns"], arrays[PART_COLUMN]
    nominal_hz = 0.0 if schema is None else schema.nominal_rate_hz
    spans_ns, steps = 0, []
    gap_count = 0
    for part in np.unique(parts):
        own = t_ns[parts == part]
        spans_ns += int(own[-1] - own[0])
        steps.append(np.diff(own))
        if nominal_hz > 0:
            gap_count += gaps_beyond(own, GAP_PERIODS * NS_PER_S / nominal_hz)
    gaps_ns = np.concatenate(steps) if steps else np.zeros(0, np.int64)
    is_regular = nominal_hz > 0
    fields = () if schema is None else schema.fields
    return OwnStream(
        participant=recording.manifest.participant,
        session=recording.manifest.session,
        name=name,
        is_simulated=recording.is_simulated,
        rows=len(t_ns),
        nominal_rate_hz=nominal_hz,
        rate_hz=gaps_ns.size * NS_PER_S / spans_ns if spans_ns else np.nan,
        expected=round(spans_ns * nominal_hz / NS_PER_S) + len(np.unique(parts))
        if is_regular and len(t_ns)
        else None,
        gaps=gap_count if is_regular else None,
        longest_gap_ms=float(gaps_ns.max() / NS_PER_MS) if is_regular and gaps_ns.size else None,
        columns=tuple(
            _column(column, field.unit, t_ns, values.astype(np.float64))
            for field in fields
            if field.unit != "ns" and (field.dtype != "u1" or not field.shape)  # times, texts
            for column, values in flat_components(field.name, arrays[field.name])
        ),
    )


def _column(name: str, unit: str, t_ns: npt.NDArray[np.int64], values: Values) -> OwnColumn:
    finite = values[np.isfinite(values)]
    if not finite.size:
        nothing = np.zeros((0, 4))
        return OwnColumn(name, unit, np.nan, np.nan, np.nan, np.nan, 1.0, nothing)
    return OwnColumn(
        name,
        unit,
        float(finite.mean()),
        float(finite.std(ddof=1)) if finite.size > 1 else np.nan,
        float(finite.min()),
        float(finite.max()),
        1 - finite.size / values.size,
        _curve((t_ns - t_ns[0]) / NS_PER_S, values),
    )


def _curve(t_s: Values, values: Values) -> Values:
    """Return at most `BINS` points with the range around each, so that no peak is lost."""
    if t_s.size <= BINS:
        return np.stack([t_s, values, values, values], axis=1)
    edges = np.searchsorted(t_s, np.linspace(t_s[0], t_s[-1], BINS + 1)[1:-1])
    points = []
    for times, group in zip(np.split(t_s, edges), np.split(values, edges), strict=True):
        finite = group[np.isfinite(group)]
        if times.size:
            middle = (finite.min(), float(np.median(finite)), finite.max()) if finite.size else ()
            points.append((times.mean(), *(middle or (np.nan,) * 3)))
    return np.array(points)


def streams_section(streams: Sequence[OwnStream], pictures: Sequence[Picture]) -> Section:
    """Return the section of a report on the lab's own devices, with the pictures given."""
    return Section(
        "own-devices",
        "Devices of the lab's own",
        (
            _arrivals(streams),
            _numbers(streams),
            *pictures,
            Paragraph(
                "Recorded as the devices sent them, in their units (UCUM); nothing was filtered "
                "and nothing left out. Missing values are missing, never zero."
            ),
        ),
    )


def _arrivals(streams: Sequence[OwnStream]) -> Table:
    heads = (
        "Participant",
        "Session",
        "Stream",
        "Samples",
        "Of expected",
        "Rate (Hz)",
        "Stated (Hz)",
        "Gaps",
        "Longest gap (ms)",
    )
    return Table(
        tuple(Column(h, "left" if i in (0, 2) else "right") for i, h in enumerate(heads)),
        tuple(
            (
                s.participant,
                str(s.session),
                s.name,
                str(s.rows),
                percentage(s.rows / s.expected) if s.expected else "–",
                decimal(s.rate_hz, 2),
                decimal(s.nominal_rate_hz, 1) if s.nominal_rate_hz else "irregular",
                "–" if s.gaps is None else str(s.gaps),
                "–" if s.longest_gap_ms is None else decimal(s.longest_gap_ms, 0),
            )
            for s in streams
        ),
        "What arrived",
        f"A gap is more than {GAP_PERIODS:g} periods of the stated rate; packets that come on time "
        "are none.",
    )


def _numbers(streams: Sequence[OwnStream]) -> Table:
    heads = (
        "Participant",
        "Stream",
        "Column",
        "Unit",
        "Mean",
        "SD",
        "Lowest",
        "Highest",
        "Missing",
    )
    return Table(
        tuple(Column(h, "left" if i < 4 else "right") for i, h in enumerate(heads)),
        tuple(
            (
                s.participant,
                s.name,
                c.name,
                c.unit or "–",
                *(decimal(v, 2) for v in (c.mean, c.sd, c.low, c.high)),
                percentage(c.missing_01),
            )
            for s in streams
            for c in s.columns
        ),
        "What they measured, over the whole session",
    )


def figures_of_streams(streams: Sequence[OwnStream]) -> "Iterator[ReportFigure]":
    """Yield a figure per stream that has numbers, drawn as asked for: columns over the session."""
    return (
        _figure_of_stream(stream) for stream in streams if any(len(c.curve) for c in stream.columns)
    )


def _figure_of_stream(stream: OwnStream) -> "ReportFigure":
    from visavis.analysis.plots import (
        draw,  # late: half a second of matplotlib that a page's server saves
    )

    drawable_columns = [c for c in stream.columns if len(c.curve)][:MAX_CURVES]
    left_out = len(stream.columns) - len(drawable_columns)
    more = f" {left_out} further columns are not drawn." if left_out else ""
    return draw(
        f"stream_{stream.name}_{stream.participant}",
        partial(_figure, drawable_columns),
        title=f"{stream.name} of {stream.participant}, session {stream.session}",
        caption="Every column over the session: the middle of the samples around each moment, and "
        f"shaded their range.{more}",
        alternative=f"Course of {', '.join(c.name for c in drawable_columns)} over the session.",
        is_simulated=stream.is_simulated,
    )


def _figure(columns: Sequence[OwnColumn]) -> "Figure":
    from visavis.analysis.plots import BLUE, new_figure  # late, as above

    figure = new_figure(9.6, 0.7 + 1.2 * len(columns))
    grid = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    for axes, column in zip(grid, columns, strict=True):
        t_s, low, middle, high = column.curve.T
        axes.fill_between(t_s, low, high, color=BLUE, alpha=0.25, linewidth=0)
        axes.plot(t_s, middle, color=BLUE, linewidth=0.9)
        axes.set_ylabel(f"{column.name}\n({column.unit})" if column.unit else column.name)
    grid[-1].set_xlabel("Time since the first sample (s)")
    figure.align_ylabels(grid)
    return figure

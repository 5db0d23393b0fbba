"""Judge recordings made elsewhere by their times alone: XDF files and BIDS data sets.

Reports what LabRecorder and others do not: streams without clock offsets, stamps that go back,
gaps, rates off the nominal, streams that began or ended apart from the others.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.bids_pauses import Pauses, pauses_in_set
from visavis.analysis.session_verdict import Level
from visavis.analysis.xdf_times import (
    MAX_CLOCK_S,
    MAX_DRIFT,
    ClockSegment,
    on_common_clock,
    read_xdf,
    whole_ns,
)
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.foreign_text import decode_text
from visavis.lab.plain_files import read_packed, read_plain
from visavis.lab.sampling import sampling_of, time_returns
from visavis.recording.bids_sidecar import DESCRIPTION, sidecar_of

LONG_GAP_S = 1.0
RATE_AMBER_01, RATE_RED_01 = 0.01, 0.05
APART_S = 5.0
"""Streams that begin or end further from the others than this are reported."""
MIN_WITHOUT_EXCHANGE_S = 60.0
UNKNOWN_DRIFT_PPM = 50.0
MIN_SETTING_S = 0.05
"""How far two quartz clocks may run apart where nobody knows; a fit's drift where it is more."""
XDF_ENDINGS = (".xdf", ".xdfz", ".xdf.gz")
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
SECONDS |= {"seconds": 1.0, "sec": 1.0, "milliseconds": 1e-3, "msec": 1e-3}

Times = npt.NDArray[np.float64]
Findings = Iterator[tuple[Level, str, str]]


@dataclass(frozen=True)
class ForeignStream:
    """The times of one stream: stamps in seconds, corrected where offsets are known.

    `segments` are those of the sender's clock (None where the format has no offsets); `host` is
    empty if unknown; `notes` say what could not be read, or is not known, with what to do;
    `pauses` are those of its user, in seconds, in which nothing was lost.
    """

    name: str
    stamps_s: Times = field(repr=False)
    rate_hz: float
    segments: tuple[ClockSegment, ...] | None = None
    host: str = ""
    notes: tuple[tuple[str, str], ...] = ()
    pauses: Pauses = ()

    @property
    def has_offsets(self) -> bool:
        """Say whether its times are on the clock of the others, as far as the format tells."""
        return self.segments is None or any(s.exchanges for s in self.segments)


@dataclass(frozen=True)
class StreamVerdict:
    """Verdict on one stream; `findings` are pairs of a problem and its remedy."""

    name: str
    samples: int
    rate_hz: float | None
    level: Level
    findings: tuple[tuple[str, str], ...]


def check_foreign(path: Path) -> tuple[StreamVerdict, ...]:
    """Return a verdict on every stream of an XDF file or a BIDS data set.

    Raises:
        DataError: it is neither, or it cannot be read, with the place.
    """
    name = path.name.lower()
    is_xdf = name.endswith(XDF_ENDINGS)
    streams = read_xdf_times(path) if is_xdf else read_bids_times(path)
    if not streams:
        raise DataError(f"{path} holds no stream with times; give an XDF file or a BIDS data set")
    return tuple(_verdict(s, streams) for s in streams)


def _verdict(stream: ForeignStream, streams: Sequence[ForeignStream]) -> StreamVerdict:
    findings: list[tuple[Level, str, str]] = [
        *((Level.AMBER, what, remedy) for what, remedy in stream.notes),
        *_of_clock(stream, streams),
    ]
    with np.errstate(invalid="ignore"):
        is_time = np.abs(stream.stamps_s) < MAX_CLOCK_S
    stamps = stream.stamps_s[is_time]
    odd = int((~is_time & ~np.isnan(stream.stamps_s)).sum())
    if odd:
        what = f"{odd} stamps that no clock shows"
        findings.append((Level.RED, what, "the file is damaged, or the sender stamps wrongly"))
    if not len(stamps):
        findings.append(
            (Level.RED, "no sample", "see whether the program that sends it was running")
        )
    measured_hz, of_times = _of_times(stamps, stream)
    findings += of_times
    if stream.rate_hz and len(stamps) > 1:
        findings += _apart(stream, streams)
    level = max((f[0] for f in findings), default=Level.GREEN)
    return StreamVerdict(
        stream.name,
        len(stream.stamps_s),
        measured_hz,
        level,
        tuple((what, remedy) for _, what, remedy in findings),
    )


def _of_clock(stream: ForeignStream, streams: Sequence[ForeignStream]) -> Findings:
    """Yield what is wrong with a sender's clock: no offset, resets, exchanges that end early."""
    if stream.segments is None or not len(stream.stamps_s):
        return
    if not stream.has_offsets:
        several_hosts = len({s.host for s in streams if s.host}) > 1
        yield (
            Level.RED if several_hosts else Level.AMBER,
            "no clock offset",
            "its times are of the sender's clock alone; from another computer they cannot be "
            "compared with the others: record it again, let the sender run to the end",
        )
        return
    for before, after in pairwise(stream.segments):
        pause_s = float(stream.stamps_s[after.first] - stream.stamps_s[before.after - 1])
        if not (before.exchanges and after.exchanges):
            yield (
                Level.RED,
                f"its clock was reset before sample {after.first}, and no exchange maps one of the "
                "parts",
                "use the part that has clock offsets; nobody knows when the other was",
            )
            continue
        yield (
            Level.AMBER,
            f"its clock was reset before sample {after.first}, after a pause of {pause_s:.1f} s",
            "each part was mapped by its own clock offsets; leave out trials in the pause",
        )
    outlying = sum(s.outlying for s in stream.segments)
    if outlying:
        yield (
            Level.AMBER,
            f"{outlying} clock exchanges lie far from the others",
            "they were left out of the fit; look at the network of that computer",
        )
    for segment in stream.segments:
        if segment.exchanges:
            yield from _uncovered(stream, segment)
        away_s = abs(segment.drift_ppm) * 1e-6 * (segment.to_s - segment.from_s)
        if abs(segment.drift_ppm) > MAX_DRIFT * 1e6 and away_s > MIN_SETTING_S:
            yield (
                Level.RED,
                f"its clock goes off by {away_s:.2f} s at {segment.drift_ppm:.0f} ppm, as no clock "
                "does: it was set while it ran",
                "its times are wrong by up to as much; use the part before or after its offsets "
                "jump",
            )


def _uncovered(stream: ForeignStream, segment: ClockSegment) -> Findings:
    """Yield stretches at the ends of a segment for which no exchange says how its clock ran."""
    own = stream.stamps_s[segment.first : segment.after]
    covered_s = max(segment.to_s - segment.from_s, 0.0)
    span_s = float(own[-1] - own[0])
    without_s = span_s - covered_s
    if without_s < max(MIN_WITHOUT_EXCHANGE_S, 0.2 * span_s) or segment.exchanges < 1:
        return
    drift_ppm = max(abs(segment.drift_ppm), UNKNOWN_DRIFT_PPM)
    yield (
        Level.AMBER,
        f"{without_s / 60:.0f} of {span_s / 60:.0f} min have no clock exchange; at "
        f"{drift_ppm:.0f} ppm its clock goes off by {drift_ppm * 1e-6 * without_s:.2f} s in them",
        f"they were mapped along the line of the others ({segment.drift_ppm:.0f} ppm); where "
        "milliseconds count use the time that exchanges cover",
    )


def _of_times(
    stamps: Times, stream: ForeignStream
) -> tuple[float | None, list[tuple[Level, str, str]]]:
    """Return the measured rate and what is wrong with stamps: order, gaps, rate."""
    findings: list[tuple[Level, str, str]] = []
    rate_hz, resets = stream.rate_hz, {s.first for s in stream.segments or ()}
    t_ns = whole_ns(stamps)
    returns = time_returns(t_ns)
    back = sorted({*returns.restarts, *returns.disorder} - resets)
    if back:
        steps_s = np.diff(stamps)
        furthest_ms = -float(min(steps_s[row - 1] for row in back)) * 1000
        what = f"stamps go back {len(back)} times, by up to {furthest_ms:.0f} ms"
        restarts = sorted(set(returns.restarts) - resets)
        if restarts:
            reasons = dict(zip(returns.restarts, returns.reasons, strict=True))
            what += f"; at sample {restarts[0]} begins a {reasons[restarts[0]]}"
        remedy = (
            "take the parts one by one: they are recordings of their own"
            if restarts
            else "do not sort blindly: the sender stamps wrongly, or two senders share one name"
        )
        findings.append((Level.RED, what, remedy))
    distinct = np.unique(t_ns)
    if not rate_hz or len(distinct) < 3:
        return None, findings
    sampling = sampling_of(distinct)
    measured_hz = sampling.rate_hz
    # Pauses at resets are told there; what is missing within the parts is a gap.
    rows = np.flatnonzero(sampling.missing > 0)
    at_resets = {int(t_ns[row]) for row in resets if 0 < row < len(t_ns)}
    edges_s = distinct / NS_PER_S
    gaps_s = np.array(
        [
            edges_s[row] - edges_s[row - 1]
            for row in rows
            if int(distinct[row]) not in at_resets
            and not any(a < edges_s[row] and b > edges_s[row - 1] for a, b in stream.pauses)
        ]
    )
    if len(gaps_s):
        findings.append(
            (
                Level.RED if gaps_s.max() > LONG_GAP_S else Level.AMBER,
                f"{len(gaps_s)} gaps, the longest {gaps_s.max():.3f} s",
                "samples were lost on the way or never sent; leave out trials they overlap",
            )
        )
    # Stamps may be coarser than samples: two of 2000 Hz share a millisecond.
    per_stamp = len(t_ns) / len(distinct)
    if per_stamp > 1 + RATE_AMBER_01 and abs(measured_hz * per_stamp / rate_hz - 1) < RATE_AMBER_01:
        measured_hz *= per_stamp
        what = f"{len(t_ns) - len(distinct)} samples share the stamp of the one before"
        remedy = "its stamps are coarse; `visavis import gaze` spreads them up to the next stamp"
        findings.append((Level.AMBER, what, remedy))
    off = abs(measured_hz / rate_hz - 1)
    if len(sampling.rates_hz) > 1:
        rates = ", then ".join(f"{rate:.4g}" for rate in sampling.rates_hz)
        findings.append(
            (
                Level.RED,
                f"the rate changes: {rates} Hz",
                "use the stamps, and analyse the parts of different rate one by one",
            )
        )
    elif off > RATE_AMBER_01:
        findings.append(
            (
                Level.RED if off > RATE_RED_01 else Level.AMBER,
                f"{measured_hz:.2f} Hz instead of {rate_hz:g} Hz nominal",
                "use the stamps, not the nominal rate; find out which of the two is right",
            )
        )
    return measured_hz, findings


def _apart(stream: ForeignStream, streams: Sequence[ForeignStream]) -> Findings:
    """Yield how far a stream lies from the others that have a known clock, or else from all."""
    others = [s for s in streams if s is not stream and s.rate_hz and len(s.stamps_s) > 1]
    on_clock = [s for s in others if s.has_offsets]
    others = on_clock or others
    if not others:
        return
    first_s, last_s = float(stream.stamps_s[0]), float(stream.stamps_s[-1])
    begin = float(np.median([s.stamps_s[0] for s in others]))
    end = float(np.median([s.stamps_s[-1] for s in others]))
    if last_s < begin or first_s > end:
        off = f"{first_s - begin:,.0f}".replace(",", " ")
        if on_clock or not stream.has_offsets:
            yield (
                Level.RED,
                f"does not overlap the others: off by {off} s",
                "its clock was not mapped onto the others'; look for its clock offsets",
            )
        else:
            names = ", ".join(s.name for s in others)
            yield (
                Level.AMBER,
                f"does not overlap {names}, which has no clock offset: off by {off} s",
                f"nothing is wrong with this stream; map the clock of {names} onto it",
            )
        return
    for what, off_s in (("begins", first_s - begin), ("ends", last_s - end)):
        if abs(off_s) > APART_S:
            side = "after" if off_s > 0 else "before"
            yield (
                Level.AMBER,
                f"{what} {abs(off_s):.0f} s {side} the others",
                "analyse only the time that all streams cover",
            )


# ---- XDF -------------------------------------------------------------------------------------


def read_xdf_times(path: Path) -> tuple[ForeignStream, ...]:
    """Return the times of every stream of an XDF file on one clock.

    Raises:
        DataError: it is no XDF file, or nothing of it can be read, with the place.
    """
    streams, damage = read_xdf(path)
    remedy = "what was read before and after counts; copy the file anew if there is another copy"
    notes = tuple((what, remedy) for what in damage)
    out = []
    for stream in streams:
        stamps, segments = on_common_clock(stream)
        out.append(ForeignStream(stream.name, stamps, stream.rate_hz, segments, stream.host, notes))
    return tuple(out)


# ---- BIDS ------------------------------------------------------------------------------------


def read_bids_times(root: Path) -> tuple[ForeignStream, ...]:
    """Return the times of every recording of a data set that bears times for its samples.

    Raises:
        DataError: it is no data set, or a file cannot be read.
    """
    if not (root / DESCRIPTION).is_file():
        raise DataError(f"{root} is no BIDS data set: it has no {DESCRIPTION}")
    streams = []
    for path in sorted((*root.rglob("*_physio.tsv.gz"), *root.rglob("*_motion.tsv"))):
        try:
            sidecar = sidecar_of(path)
            rate_hz = float(sidecar.get("SamplingFrequency") or 0)
            stamps, notes = _times_of(path, sidecar, rate_hz)
            unit = str(dict(sidecar.get("timestamp") or {}).get("Units", "s"))
            scale = SECONDS.get(unit.strip().lower(), 1.0)
            pauses = pauses_in_set(path, 1 / scale)
        except (OSError, ValueError, LookupError, TypeError, OverflowError, DataError) as error:
            raise DataError(f"{path} cannot be read with its sidecars (.json): {error}") from error
        if stamps is not None:
            name = path.relative_to(root).as_posix()
            pauses = tuple((a * scale, b * scale) for a, b in pauses)
            streams.append(ForeignStream(name, stamps, rate_hz, notes=notes, pauses=pauses))
    return tuple(streams)


def _times_of(
    path: Path, sidecar: Mapping[str, Any], rate_hz: float
) -> tuple[Times | None, tuple[tuple[str, str], ...]]:
    """Return a file's times in seconds: its column timestamp, or its channel latency.

    Motion without a latency has the times that its rate gives, and a note that says so; other
    tables without stamps have none.
    """
    is_motion = path.name.endswith("_motion.tsv")
    if is_motion:
        channels = path.with_name(path.name.replace("_motion.tsv", "_channels.tsv"))
        lines = decode_text(read_plain(channels))[0].splitlines()
        heads = lines[0].split("\t") if lines else []
        rows = [dict(zip(heads, line.split("\t"), strict=False)) for line in lines[1:]]
        names = [row.get("name", "") for row in rows]
        kinds = [row.get("type", "").upper() for row in rows]
        column = names[kinds.index("LATENCY")] if "LATENCY" in kinds else "latency"
        units = [row.get("units", "") for row in rows if row.get("name") == column]
        unit, text = (units or [""])[0] or "s", decode_text(read_plain(path))[0]
    else:
        names, column = [str(c) for c in sidecar["Columns"]], "timestamp"
        unit = str(dict(sidecar.get("timestamp") or {}).get("Units", "s"))
        text = decode_text(read_packed(path))[0]
    lines = [line for line in text.splitlines() if line.strip()]
    if column not in names:
        if not (is_motion and rate_hz > 0):
            return None, ()
        note = (
            "no latency: its times are those of its nominal rate",
            "nobody can tell from the file whether samples were lost",
        )
        with np.errstate(over="ignore"):  # times that no clock shows are told
            return np.arange(len(lines)) / rate_hz, (note,)
    at = names.index(column)
    cells = [line.split("\t")[at] for line in lines]
    stamps = np.array([float("nan") if c == "n/a" else float(c) for c in cells], np.float64)
    scale = SECONDS.get(unit.strip().lower())
    if scale is None:
        raise ValueError(f"{column} is in {unit!r}; use s, ms, us or ns")
    return stamps * scale, ()

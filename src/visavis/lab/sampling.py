"""Tell from stamps alone how a stream was sampled: its period, and which samples never came.

The period is found twice, as the mean of the steps that are about as long as the median, and by
regression of stamps on sample numbers. They agree where stamps are even. Where they do not, stamps
are either uneven and nothing is lost (a host that polls every 4 ms, packets of ten samples): they
then stay near the regression's line, or steps are of one length and its double alone. Or samples
are lost at random: stamps then wander away from the line, and some steps are of three periods.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S

Times = npt.NDArray[np.int64]
Rows = npt.NDArray[np.int64]

USUAL_STEPS = 1.5
"""A step of more than this many median steps may be a gap."""
BLOCK_ROWS = 64
MIN_BLOCK_ROWS = 8
MANY_BLOCKS = 8
MAX_WANDERING = 1.7
"""Residuals over 8 blocks spread as over one where nothing is lost, and √8 as far where samples
are lost at random; this lies between."""
MAX_WANDERING_OF_DOUBLES = 1.2
MAX_REGULAR_CV = 0.5
"""Spread over mean of the distances between long steps: 1 at random, near 0 of a polling host."""
HOLE_S = 1.0
"""A pause this long, 20 periods and 3 packets long ends a stretch."""
HOLE_PERIODS, HOLE_PACKETS = 20, 3
FEW_HOLES, MAX_PACKET_ROWS = 10, 256
"""Fewer holes than this, or more rows between them, are pauses between recordings, no packets."""
RATE_CHANGE_01 = 0.2
MIN_STRETCH_BLOCKS = 3
PACKETS_NEARBY = 9
SHIFT_PERIODS = 0.6
MAX_REFITS = 5
MIN_SHORT_01, SHORT_01 = 0.3, 0.25
"""So many steps shorter than a quarter of the median are those within packets of two or three."""
MIN_TRIPLES, MAX_TRIPLES_01 = 8, 0.25
"""Single losses at random would give so many steps of three periods; fewer than this share of them
says that double steps are a host's two ticks, and nothing was lost."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows `first` to before `after`, sampled at one rate without a pause.

    `jitter_ns` is the standard deviation of stamps about the line through them.
    """

    first: int
    after: int
    step_ns: float
    jitter_ns: float

    @property
    def rate_hz(self) -> float:
        """Samples per second."""
        return NS_PER_S / self.step_ns


@dataclass(frozen=True, slots=True)
class Sampling:
    """How n samples with increasing stamps lie in time.

    `step_ns` is the period over all stretches (NaN below three stamps). `missing` (n,) counts the
    samples that never came before each row, within a stretch or in the pause before one.
    `is_even` is False where stamps are uneven although nothing is lost between them.
    """

    stretches: tuple[Stretch, ...]
    step_ns: float
    missing: Rows
    is_even: bool

    @property
    def rate_hz(self) -> float:
        """Samples per second, pauses and gaps left out; NaN below three stamps."""
        return NS_PER_S / self.step_ns

    @property
    def gaps(self) -> int:
        """How often samples are missing between two rows."""
        return int((self.missing > 0).sum())

    @property
    def lost_01(self) -> float:
        """Share of the samples due between first and last row that never came."""
        lost = int(self.missing.sum())
        return lost / (lost + len(self.missing)) if len(self.missing) else np.nan

    @property
    def rates_hz(self) -> tuple[float, ...]:
        """The different rates, in order; more than one where the rate changes on the way."""
        rates: list[float] = []
        for stretch in self.stretches:
            if stretch.after - stretch.first < MIN_STRETCH_BLOCKS * BLOCK_ROWS // 4:
                continue
            if not rates or abs(stretch.rate_hz / rates[-1] - 1) > RATE_CHANGE_01:
                rates.append(stretch.rate_hz)
        return tuple(rates)


def sampling_of(t_ns: Times) -> Sampling:
    """Describe stamps (n,) that increase strictly, in ns.

    Raises ValueError when they do not: what repeats or goes back is to be told apart before.
    """
    n = len(t_ns)
    missing = np.zeros(n, np.int64)
    if n < 3:
        return Sampling((), np.nan, missing, True)
    steps = np.diff(t_ns)
    if steps.min() <= 0:
        raise ValueError("stamps repeat or go back; only increasing ones show how it was sampled")
    pattern = _pattern(t_ns)
    stretches = []
    edges = _edges(t_ns, pattern)
    for first, after in itertools.pairwise(edges):
        own = t_ns[first:after]
        # Of uneven stamps all of them show the pattern best, of even ones each stretch its rate.
        part = _pattern(own) if pattern.is_even and after - first >= BLOCK_ROWS else pattern
        before = _missing_before(own, part)
        step_ns, away_ns = part.step_ns, 0.0
        if after - first >= 3:
            slope, away_ns = _line(np.arange(after - first) + np.cumsum(before), own)
            if after - first >= BLOCK_ROWS and not (part.is_even or part.is_of_ticks):
                # A better period counts better what is missing, which gives a better period.
                for _ in range(MAX_REFITS):
                    step_ns, longest_ns = slope, USUAL_STEPS * slope
                    again = _missing_before(
                        own, replace(part, step_ns=slope, longest_ns=longest_ns)
                    )
                    if np.array_equal(again, before):
                        break
                    before = again
                    slope, away_ns = _line(np.arange(after - first) + np.cumsum(before), own)
        missing[first:after] = before
        stretches.append(Stretch(int(first), int(after), step_ns, away_ns))
        if first:
            pause_ns = float(t_ns[first] - t_ns[first - 1])
            # Between two packets a pause is usual; only what is longer lost samples.
            is_in_packets = pattern.packet > 1 and 2 * np.quantile(steps, 0.25) < step_ns
            between = steps[steps > pattern.longest_ns] if is_in_packets else steps[:0]
            usual_ns = float(np.median(between)) if between.size else step_ns
            missing[first] = max(0, round((pause_ns - usual_ns) / step_ns))
    rows = np.array([s.after - s.first for s in stretches], np.float64)
    step_ns = float(np.average([s.step_ns for s in stretches], weights=rows))
    return Sampling(tuple(stretches), step_ns, missing, pattern.is_even)


def step_ns_of(t_ns: Times) -> float:
    """Return the period of stamps (n,) that increase, in ns; NaN below three."""
    return _pattern(t_ns).step_ns if len(t_ns) > 2 else np.nan


def gaps_beyond(t_ns: Times, limit_ns: float) -> int:
    """Count the steps beyond a limit; of uneven stamps (packets, ticks) those that lose samples."""
    steps = np.diff(t_ns)
    is_long = steps > limit_ns
    if len(steps) > 1 and steps.min() > 0:
        sampling = sampling_of(t_ns)
        if not sampling.is_even:
            is_long &= sampling.missing[1:] > 0
    return int(is_long.sum())


@dataclass(frozen=True, slots=True)
class _Pattern:
    """The period, whether stamps are even, the longest step over which nothing is missing, and
    whether steps are one tick of a host or two.
    """

    step_ns: float
    is_even: bool
    longest_ns: float
    is_of_ticks: bool = False
    packet: int = 1


def _pattern(t_ns: Times) -> _Pattern:
    steps = np.diff(t_ns)
    median_ns = int(np.median(steps))
    holes = steps > max(HOLE_S * NS_PER_S, HOLE_PERIODS * median_ns)
    between_packets = steps[(2 * steps > 3 * median_ns) & ~holes]
    if len(between_packets) >= FEW_HOLES:  # a lost packet is no pause
        holes &= steps > HOLE_PACKETS * np.median(between_packets)
    n_holes = int(holes.sum())
    if 0 < n_holes and (n_holes < FEW_HOLES or len(t_ns) > MAX_PACKET_ROWS * n_holes):
        # Pauses say nothing of the period: the stamps are looked at as if there had been none.
        steps = np.where(holes, median_ns, steps)
        t_ns = t_ns[0] + np.concatenate([[0], np.cumsum(steps)])
    is_short = steps < SHORT_01 * median_ns
    if is_short.mean() > MIN_SHORT_01:
        median_ns = int(np.median(steps[is_short]))
    is_long = 2 * steps > 3 * median_ns
    usual = steps[~is_long]
    usual_ns = float(max(1, int(usual.sum()) // usual.size)) if usual.size else float(median_ns)
    even = _Pattern(max(1.0, usual_ns), True, USUAL_STEPS * usual_ns)
    n_long = int(is_long.sum())
    # A few holes, or holes that hardly take time: the usual steps show the period.
    if n_long < 3 or float(steps[is_long].sum()) < 0.03 * float(steps.sum()):
        return even
    # Steps of two lengths alone.
    doubles = int((is_long & (2 * steps <= 5 * median_ns)).sum())
    triples = int(((2 * steps > 5 * median_ns) & (2 * steps <= 7 * median_ns)).sum())
    chance = doubles**2 / len(steps)
    if chance >= MIN_TRIPLES and triples < MAX_TRIPLES_01 * chance:
        of_two = steps[2 * steps <= 5 * median_ns]
        return _Pattern(float(of_two.mean()), False, 2.5 * median_ns, is_of_ticks=True)
    if len(t_ns) < MIN_BLOCK_ROWS:  # too few to lie near a line
        return even
    # Stamps near a line, or long steps at regular distances; packets must lie whole in a block.
    packet = len(steps) / n_long
    block = round(packet) * max(1, round(BLOCK_ROWS / packet), 4 if packet > BLOCK_ROWS / 4 else 1)
    if len(t_ns) < 2 * block:
        block = max(MIN_BLOCK_ROWS, len(t_ns) // 4)
    many = min(MANY_BLOCKS * block, len(t_ns))
    narrow, wide = _wandering_ns(t_ns, block), _wandering_ns(t_ns, many)
    distances = np.diff(np.flatnonzero(is_long))
    is_regular = len(distances) >= 10 and distances.std() < MAX_REGULAR_CV * distances.mean()
    # Doubles are what single losses leave; a few of them may wander little by chance.
    limit = MAX_WANDERING if 2 * doubles < n_long else MAX_WANDERING_OF_DOUBLES
    is_near_line = many >= 4 * block and wide <= limit * narrow
    if not (is_near_line or is_regular):
        return even
    spans = (t_ns[block:] - t_ns[:-block]) / block
    share = 0.5 if is_near_line else 0.25  # a block without losses is the shortest
    step_ns = max(1.0, float(np.quantile(spans, share)))
    return _Pattern(step_ns, False, USUAL_STEPS * step_ns, packet=max(1, round(packet)))


def _wandering_ns(t_ns: Times, rows: int) -> float:
    """Return the middle of the blocks' standard deviations about a line through each."""
    starts = range(0, len(t_ns) - rows + 1, rows)
    count = np.arange(rows)
    return float(np.median([_line(count, t_ns[s : s + rows])[1] for s in starts]))


def _line(count: Rows, t_ns: Times) -> tuple[float, float]:
    """Return slope and standard deviation of stamps about their line on sample numbers."""
    x = count - count.mean()
    y = (t_ns - t_ns[0]).astype(np.float64)
    y -= y.mean()
    slope = float(x @ y) / float(x @ x)
    return slope, float((y - slope * x).std())


def _edges(t_ns: Times, pattern: _Pattern) -> list[int]:
    """Return where stretches begin, and n: after long pauses and where the rate changes."""
    steps = np.diff(t_ns)
    hole_ns = max(HOLE_S * NS_PER_S, HOLE_PERIODS * pattern.step_ns)
    if not pattern.is_even:
        between = steps[steps > pattern.longest_ns]  # packets, which may be long apart themselves
        hole_ns = max(hole_ns, HOLE_PACKETS * float(np.median(between)) if between.size else 0.0)
    edges = [0, *(np.flatnonzero(steps > hole_ns) + 1).tolist(), len(t_ns)]
    inner = [
        edge
        for first, after in itertools.pairwise(edges)
        for edge in _rate_changes(t_ns[first:after], first, pattern)
    ]
    return sorted({*edges, *inner})


def _rate_changes(t_ns: Times, offset: int, pattern: _Pattern) -> Iterator[int]:
    """Yield the rows from which on the period is another for at least three blocks."""
    size = pattern.packet * -(-BLOCK_ROWS // pattern.packet)  # whole packets
    n_blocks = len(t_ns) // size
    if n_blocks < 2 * MIN_STRETCH_BLOCKS:
        return
    steps = _without_lost_packets(np.diff(t_ns)[: n_blocks * size - 1], pattern)
    padded = np.append(steps, steps[-1]).reshape(n_blocks, size)
    periods = np.median(padded, axis=1) if pattern.is_even else padded.mean(axis=1)
    begin = 0
    for block in range(MIN_STRETCH_BLOCKS, n_blocks - MIN_STRETCH_BLOCKS + 1):
        if block - begin < MIN_STRETCH_BLOCKS:
            continue
        before = float(np.median(periods[begin:block]))
        after = periods[block : block + MIN_STRETCH_BLOCKS] / before
        if bool((np.abs(after - 1) > RATE_CHANGE_01).all()) and float(np.ptp(after)) < (
            RATE_CHANGE_01 * float(after.mean())
        ):
            begin = block
            yield offset + _first_row_of(steps, block * size, size, before, after.mean() * before)


def _without_lost_packets(steps: Times, pattern: _Pattern) -> Times:
    """Return steps, of which those much longer than others between packets nearby are as long.

    Few packets make a block: were each of three blocks to lose one, it would look like a rate.
    """
    long_rows = np.flatnonzero(steps > pattern.longest_ns)
    if pattern.is_even or len(long_rows) < PACKETS_NEARBY:
        return steps
    between = steps[long_rows]
    around = np.pad(between, PACKETS_NEARBY // 2, "reflect")
    usual = np.median(np.lib.stride_tricks.sliding_window_view(around, PACKETS_NEARBY), axis=1)
    short_steps = steps.copy()
    short_steps[long_rows] = np.where(between > USUAL_STEPS * usual, usual, between)
    return short_steps


def _first_row_of(steps: Times, row: int, size: int, before_ns: float, after_ns: float) -> int:
    """Return the row, within `size` of the given one, at which the steps change best."""
    low, high = row - size, min(row + size, len(steps))
    part = steps[low:high].astype(np.float64)
    nearer = np.abs(part - before_ns) - np.abs(part - after_ns)  # above 0 after the change
    gain = np.concatenate([[0.0], np.cumsum(np.clip(nearer, -after_ns, after_ns))])
    return low + int(np.argmin(gain)) + 1


def _missing_before(t_ns: Times, pattern: _Pattern) -> Rows:
    """Return (n,) how many samples are missing before each row.

    A long step is a gap only when what follows does not catch up: late samples come closer
    together afterwards, lost ones leave all that follows later.
    """
    steps, step_ns = np.diff(t_ns), pattern.step_ns
    missing = np.zeros(len(t_ns), np.int64)
    long_rows = np.flatnonzero(steps > pattern.longest_ns) + 1
    periods = steps / step_ns
    is_whole = np.abs(periods - np.rint(periods)) < 0.25
    if (pattern.is_even and bool(is_whole.all())) or pattern.is_of_ticks:
        missing[long_rows] = np.maximum(np.rint(periods[long_rows - 1]), 2) - 1
        return missing
    late = (t_ns - t_ns[0]) - step_ns * np.arange(len(t_ns))
    packet = 1.0 if pattern.is_even else len(t_ns) / max(1, len(long_rows))
    # The earliest of so many: some of them came without delay.
    few = 8 if pattern.is_even or len(t_ns) < 4 * BLOCK_ROWS else 16
    width = int(min(max(few, 2 * np.ceil(packet)), 256))
    last = 0
    for row in long_rows.tolist():
        before = float(late[max(last, row - width) : row].min())
        after = float(late[row : row + width].min())
        if row + packet <= len(t_ns) and after - before > SHIFT_PERIODS * step_ns:
            missing[row] = max(1, round((after - before) / step_ns))
            last = row
    return missing


# ---- time that goes back ---------------------------------------------------------------------


MIN_RESTART_ROWS = 32
MAX_OVERLAP_01 = 0.1


@dataclass(frozen=True, slots=True)
class TimeReturns:
    """Where stamps (n,) go back, and why.

    At the rows `restarts` time begins anew: `reasons` holds for each "new recording" (it repeats
    times that were there) or "clock reset" (it begins before all of them). The rows `disorder`
    came late, such as a packet on the way or two eyes that take turns: sorting puts them right.
    """

    restarts: tuple[int, ...]
    reasons: tuple[str, ...]
    disorder: tuple[int, ...]


def time_returns(t_ns: Times) -> TimeReturns:
    """Tell new recordings, clock resets and rows in disorder apart, by what follows."""
    restarts: list[int] = []
    reasons: list[str] = []
    disorder: list[int] = []
    begin = 0
    highest_so_far = np.maximum.accumulate(t_ns)
    for row in (np.flatnonzero(np.diff(t_ns) < 0) + 1).tolist():
        highest = int(highest_so_far[row - 1])
        enough = min(MIN_RESTART_ROWS, max(3, (row - begin) // 2), max(8, len(t_ns) - row))
        if (t_ns[row : row + enough] >= highest).any() or row + enough > len(t_ns):
            disorder.append(row)
            continue
        # Many rows stay before what was reached: do they fill a pause, or repeat times?
        later = t_ns[row:] >= highest
        own = t_ns[row : row + int(np.argmax(later))] if later.any() else t_ns[row:]
        earlier = np.sort(t_ns[begin:row])
        first, after = np.searchsorted(earlier, [own.min(), own.max()], "right")
        repeats = after - first > MAX_OVERLAP_01 * len(own)
        if not repeats and int(own.min()) >= int(earlier[0]):
            disorder.append(row)
            continue
        restarts.append(row)
        is_reset = int(own[0]) < int(earlier[0]) - (highest - int(earlier[0])) // 2
        reasons.append("clock reset" if is_reset else "new recording")
        begin = row
        highest_so_far[row:] = np.maximum.accumulate(t_ns[row:])
    return TimeReturns(tuple(restarts), tuple(reasons), tuple(disorder))

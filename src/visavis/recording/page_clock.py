"""A page's clock on the session's, by four stamps of each of its posts.

The page says when a post left and when its answer came, the server when it arrived and when the
answer left. Half of the way there and back together is the most by which the offset can be wrong. A
quartz that is 50 ppm off moves by 180 ms in an hour, so the offset is taken anew whenever a post
comes, from the quickest ways of the last half minute, and recorded where it is another one;
between two recorded offsets the clock is followed by a line.

Pages of earlier versions, and those of bundles, give no such stamps: they are placed by the
event with the least delay.
"""

from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from visavis.lab.clock import NS_PER_MS, NS_PER_S

WINDOW_NS: Final = 30 * NS_PER_S
"""How old an exchange may be."""
DRIFT_PPM: Final = 100
"""By how much an exchange is less certain for its age: the drift of a poor quartz."""
SAME_NS: Final = 1000
"""Offsets that differ by less are the same."""
STEP_NS: Final = 5 * NS_PER_MS
"""By how much two exchanges differ at least, beyond what their round trips and drift leave open,
where a clock was set meanwhile."""
STEP_PPM: Final = 500
ASLEEP_NS: Final = 5 * NS_PER_S
"""A page's clock that stops for longer than this means that the computer slept."""
MAX_POSTS: Final = 64
"""Posts whose stamps are kept until the page says when their answers came."""
CLOCK: Final = "clock"
"""Kind of the page event that records an offset."""
PAGE_ROLE: Final = "page"
"""Role of a page's clock among the recorded exchanges."""


@dataclass(frozen=True)
class PageExchange:
    """Four stamps of one post: out and in by the page's clock, between them in and out by ours."""

    page_out_ns: int
    server_in_ns: int
    server_out_ns: int
    page_in_ns: int

    @property
    def round_trip_ns(self) -> int:
        """How long post and answer were under way together; never below 0 in an honest exchange."""
        return self.way_there_ns + self.way_back_ns

    @property
    def way_there_ns(self) -> int:
        """How long it went to the server, and the offset of the clocks with it."""
        return self.server_in_ns - self.page_out_ns

    @property
    def way_back_ns(self) -> int:
        """How long it went back, less the offset of the clocks."""
        return self.page_in_ns - self.server_out_ns

    @property
    def page_ns(self) -> int:
        """The page's clock in the middle of the exchange."""
        return (self.page_out_ns + self.page_in_ns) // 2

    @property
    def offset_ns(self) -> int:
        """Session time minus the page's clock, if both ways took as long."""
        return (self.server_in_ns + self.server_out_ns) // 2 - self.page_ns

    @property
    def as_row(self) -> list[int]:
        """The exchange as if the session had asked the page: sent, the page's clock, received."""
        middle_ns, half_ns = self.page_ns + self.offset_ns, self.round_trip_ns // 2
        return [middle_ns - half_ns, self.page_ns, middle_ns + half_ns]


@dataclass
class PageClock:
    """Place the clock of one page, which lives as long as its tab, in session time.

    `offsets` are offsets that were recorded, by the page's clock: `(page_ns, offset_ns)`, in order.
    """

    offsets: list[tuple[int, int]] = field(default_factory=list)
    _exchanges: list[PageExchange] = field(default_factory=list)
    _posts: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    _least_ns: int | None = None
    _ahead_ms: float | None = None
    _round_trip_ns: int = 0
    """Of the last recorded offset."""

    def t_ns(self, at_ms: float) -> int:
        """Return the session time of a time on the page's clock."""
        return self.placing()(at_ms)

    def placing(self) -> Callable[[float], int]:
        """Return the conversion of page times to session time as it is now."""
        offsets, least_ns = tuple(self.offsets), self._least_ns or 0

        def t_ns_of(at_ms: float) -> int:
            at_ns = _ns_of_ms(at_ms)
            return at_ns + (_offset_at(offsets, at_ns) if offsets else least_ns)

        return t_ns_of

    # ---- one way -----------------------------------------------------------------------------

    def add_event(self, at_ms: float, t_ns: int) -> None:
        """Note when an event came that happened at a time of the page."""
        offset_ns = t_ns - _ns_of_ms(at_ms)
        self._least_ns = offset_ns if self._least_ns is None else min(self._least_ns, offset_ns)

    def has_slept(self, at_ms: float, wall_ms: float, t_ns: int) -> bool:
        """Tell whether a page's clock stood still since its last events.

        `wall_ms` is the time of day there. A slow network delays events, and setting a clock
        changes its time of day. A computer that slept does both.
        """
        before_ms, self._ahead_ms = self._ahead_ms, wall_ms - at_ms
        if before_ms is None or (self._least_ns is None and not self.offsets):
            return False
        late_ns = t_ns - self.t_ns(at_ms)
        return min(late_ns, _ns_of_ms(self._ahead_ms - before_ms)) > ASLEEP_NS

    def begin_anew(self, at_ms: float, t_ns: int) -> None:
        """Forget what was known of the clock, which stood still or was set."""
        self._least_ns = t_ns - _ns_of_ms(at_ms)
        self.offsets.clear()
        self._exchanges.clear()
        self._posts.clear()

    # ---- four stamps ---------------------------------------------------------------------------

    def add_post(self, post: int, page_out_ms: float, in_ns: int, out_ns: int) -> None:
        """Keep three stamps of a post, until the page says when its answer came."""
        self._posts[post] = (_ns_of_ms(page_out_ms), in_ns, out_ns)
        while len(self._posts) > MAX_POSTS:
            del self._posts[next(iter(self._posts))]

    def add_answer(self, post: int, page_in_ms: float) -> PageExchange | None:
        """Complete the stamps of a post; None where they are unknown, or cannot be.

        A page that slept between question and answer has a round trip below nothing.
        """
        stamps = self._posts.pop(post, None)
        if stamps is None:
            return None
        exchange = PageExchange(*stamps, _ns_of_ms(page_in_ms))
        if exchange.round_trip_ns < 0:
            return None
        if self._exchanges and _is_apart(self._exchanges[-1], exchange):
            self._exchanges.clear()  # somebody set a clock: what was before it says nothing
        self._exchanges.append(exchange)
        return exchange

    def offset_to_place(self, now_ns: int) -> dict[str, Any] | None:
        """Return what is to be recorded of the best exchange; None where nothing is new."""
        self._exchanges = [e for e in self._exchanges if now_ns - e.server_in_ns <= WINDOW_NS]
        if not self._exchanges:
            return None
        # The quickest way there and the quickest way back are seldom of one exchange.
        out = min(self._exchanges, key=lambda e: e.way_there_ns + _aged_ns(now_ns, e))
        back = min(self._exchanges, key=lambda e: e.way_back_ns + _aged_ns(now_ns, e))
        page_ns = (out.page_out_ns + back.page_in_ns) // 2
        offset_ns = (out.way_there_ns - back.way_back_ns) // 2
        round_trip_ns = out.way_there_ns + back.way_back_ns
        before_ns = self.t_ns(page_ns / NS_PER_MS) - page_ns
        is_first = not self.offsets and self._least_ns is None
        is_set = self._is_set_at(page_ns, offset_ns, round_trip_ns)
        is_older = bool(self.offsets) and page_ns <= self.offsets[-1][0] and not is_set
        if is_older or (not is_first and abs(before_ns - offset_ns) < SAME_NS):
            return None
        return {
            "kind": CLOCK,
            "page_ms": page_ns / NS_PER_MS,
            "offset_ns": offset_ns,
            "round_trip_ms": round_trip_ns / NS_PER_MS,
            "is_set": is_set,
        }

    def offset_of_one_way(self, page_out_ms: float, in_ns: int) -> dict[str, Any] | None:
        """Return what is to be recorded of a post of a page of which nothing is known so far.

        What waited there while a server began anew came with it, and happened before it left. It
        may be wrong by the way of this one post; None where more is known already.
        """
        if self.offsets or self._least_ns is not None:
            return None
        offset_ns = in_ns - _ns_of_ms(page_out_ms)
        about = {"page_ms": page_out_ms, "offset_ns": offset_ns, "round_trip_ms": None}
        return {"kind": CLOCK, **about, "is_set": False}

    def place(self, payload: Mapping[str, Any]) -> None:
        """Use a recorded offset from now on, and back to the one before it."""
        if payload.get("offset_ns") is None:  # a shared copy, without what tells of the page
            return
        if payload.get("is_set"):
            self.offsets.clear()
        self.offsets.append((_ns_of_ms(float(payload["page_ms"])), int(payload["offset_ns"])))
        round_trip_ms = payload.get("round_trip_ms")  # None: of one way
        self._round_trip_ns = WINDOW_NS if round_trip_ms is None else _ns_of_ms(round_trip_ms)

    def _is_set_at(self, page_ns: int, offset_ns: int, round_trip_ns: int) -> bool:
        """Tell whether a clock was set between the last recorded offset and this one.

        Either may be wrong by half its round trip.
        """
        if not self.offsets:
            return False
        at_ns, before_ns = self.offsets[-1]
        open_ns = STEP_NS + (self._round_trip_ns + round_trip_ns) // 2
        open_ns += abs(page_ns - at_ns) * STEP_PPM // 1_000_000
        return abs(offset_ns - before_ns) > open_ns


@dataclass
class PageClocks:
    """The clocks of a session's pages, by their tabs, as the events of one part tell them."""

    _of_tab: dict[str, PageClock] = field(default_factory=dict)

    def of(self, tab: str) -> PageClock:
        """Return the clock of a tab."""
        return self._of_tab.setdefault(tab, PageClock())

    def follow(self, payload: Mapping[str, Any], t_ns: int) -> None:
        """Follow a page event that was recorded at a session time."""
        clock = self.of(str(payload.get("tab", "")))
        if payload["kind"] == CLOCK:
            clock.place(payload)
        elif "at_ms" not in payload:  # a refusal has neither tab nor time
            return
        elif payload["kind"] == "slept":
            clock.begin_anew(float(payload["at_ms"]), t_ns)
        else:
            clock.add_event(float(payload["at_ms"]), t_ns)


def _offset_at(offsets: tuple[tuple[int, int], ...], at_ns: int) -> int:
    """Return the offset at a page time: on the line between two recorded ones, else the nearest."""
    after = bisect_right(offsets, at_ns, key=lambda point: point[0])
    if after == 0:
        return offsets[0][1]
    if after == len(offsets):
        return offsets[-1][1]
    (from_ns, offset_ns), (to_ns, next_ns) = offsets[after - 1], offsets[after]
    share = (at_ns - from_ns) / (to_ns - from_ns)
    return offset_ns + round(share * (next_ns - offset_ns))


def _aged_ns(now_ns: int, exchange: PageExchange) -> int:
    """Return by how much an exchange is less certain for its age."""
    return (now_ns - exchange.server_in_ns) * DRIFT_PPM // 1_000_000


def _is_apart(before: PageExchange, after: PageExchange) -> bool:
    """Tell whether two exchanges cannot both be right of one clock that nobody set."""
    passed_ns = abs(after.server_in_ns - before.server_in_ns)
    open_ns = (before.round_trip_ns + after.round_trip_ns) // 2 + STEP_NS
    return abs(after.offset_ns - before.offset_ns) > open_ns + passed_ns * STEP_PPM // 1_000_000


def _ns_of_ms(ms: float) -> int:
    return round(ms * NS_PER_MS)

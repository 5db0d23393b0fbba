"""A page's clock stays true for an hour, whatever its quartz, its network and its computer do."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from tests.running.page.pages import TAB, Page, begin_session, go_on_with
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.recording.page_clock import PAGE_ROLE, PageClock
from visavis.recording.reader import Recording
from visavis.running.page.desk import CLOCK_FLAG, SLEEP_FLAG, Post

TRUE_WITHIN_MS = 2.0
BEAT_S = 4.0


@dataclass
class Network:
    """A page with a clock of its own behind a network: what its posts say, and when they come."""

    ppm: float = 0.0
    begun_s: float = 3.0
    leaps_s: list[tuple[float, float]] = field(default_factory=list)
    """By how much the page's clock leaps, from a session time on."""
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(4))
    way_ms: float = 4.0
    queue_ms: float = 2.0
    post: int = 0
    heard: list[tuple[int, float]] = field(default_factory=list)

    def page_ms(self, t_s: float) -> float:
        """Return what the page's clock shows at a session time."""
        leap_s = sum(by for at, by in self.leaps_s if t_s >= at)
        return 1000 * ((t_s - self.begun_s) * (1 + self.ppm * 1e-6) + leap_s)

    def way_s(self) -> float:
        """Return how long a message is under way."""
        return (self.way_ms + self.rng.exponential(self.queue_ms)) / 1000

    def exchange(self, t_s: float, take: Callable[[Post, int], Callable[[int], None]]) -> float:
        """Post at a session time; return when the answer is in."""
        self.post += 1
        in_s = t_s + self.way_s()
        heard, self.heard = tuple(self.heard), []
        post = Post(
            self.page_ms(t_s), 1.7e12 + 1000 * t_s, self.post, round(in_s * NS_PER_S), heard
        )
        answer = take(post, round(in_s * NS_PER_S))
        out_s = in_s + 0.03
        answer(round(out_s * NS_PER_S))
        back_s = out_s + self.way_s()
        self.heard.append((self.post, self.page_ms(back_s)))
        return back_s


def follow(clock: PageClock, network: Network, until_s: float, from_s: float = 10.0) -> None:
    """Let a page post every few seconds."""

    def take(post: Post, in_ns: int) -> Callable[[int], None]:
        clock.add_event(post.out_ms, in_ns)
        for number, in_ms in post.answers:
            clock.add_answer(number, in_ms)
        if (offset := clock.offset_to_place(in_ns)) is not None:
            clock.place(offset)
        return lambda out_ns: clock.add_post(post.number or 0, post.out_ms, post.in_ns, out_ns)

    t_s = from_s
    while t_s < until_s:
        network.exchange(t_s, take)
        t_s += BEAT_S


@pytest.mark.parametrize("ppm", [-50.0, 0.0, 20.0, 50.0])
def test_a_page_s_clock_is_true_within_two_milliseconds_after_an_hour(ppm: float) -> None:
    clock, network = PageClock(), Network(ppm)
    for from_s, until_s in ((10.0, 600.0), (600.0, 1800.0), (1800.0, 3600.0)):
        follow(clock, network, until_s, from_s)
        errors_ms = [
            clock.t_ns(network.page_ms(t_s)) / NS_PER_MS - 1000 * t_s
            for t_s in np.linspace(until_s - 500, until_s, 40)
        ]
        assert TRUE_WITHIN_MS > np.abs(errors_ms).max()


def test_a_clock_that_is_followed_by_arrivals_alone_is_far_off_after_an_hour() -> None:
    clock, network = PageClock(), Network(-20.0)
    for t_s in range(10, 3600, 4):
        clock.add_event(network.page_ms(t_s), round(t_s * NS_PER_S))
    error_ms = clock.t_ns(network.page_ms(3600.0)) / NS_PER_MS - 3600_000
    assert 60 < abs(error_ms)


@pytest.mark.parametrize("leap_s", [-3600.0, -0.5, 0.5, 7200.0])
def test_a_page_s_clock_that_is_set_is_followed_from_the_next_exchanges(leap_s: float) -> None:
    clock, network = PageClock(), Network(20.0, leaps_s=[(600.0, leap_s)])
    follow(clock, network, 700.0)
    error_ms = clock.t_ns(network.page_ms(700.0)) / NS_PER_MS - 700_000
    assert TRUE_WITHIN_MS > abs(error_ms)


def test_stamps_that_no_page_can_have_are_left_out() -> None:
    clock = PageClock()
    clock.add_post(1, 1000.0, 5 * NS_PER_S, 5 * NS_PER_S + 30_000_000)
    assert clock.add_answer(2, 1100.0) is None  # no such post
    assert clock.add_answer(1, 1010.0) is None  # in before the server was done: it slept
    assert clock.add_answer(1, 1100.0) is None  # only the first is heard
    assert clock.offset_to_place(6 * NS_PER_S) is None


def at_a_film(page: Page) -> None:
    """Answer until a film is told."""
    while page.desk.state()["step"]["kind"] != "watch":
        page.answer()


def beats(page: Page, network: Network, until_s: float) -> None:
    """Let a page post what happens every few seconds, which is nothing."""

    def take(post: Post, in_ns: int) -> Callable[[int], None]:
        page.clock.sleep_until_ns(in_ns)
        page.desk.take(TAB, [], post)

        def answer(out_ns: int) -> None:
            page.clock.sleep_until_ns(out_ns)
            page.desk.note_answer(TAB, post)

        return answer

    t_s = page.clock.now_ns() / NS_PER_S
    while t_s < until_s:
        t_s = max(t_s + BEAT_S, network.exchange(t_s, take))


def film_reply(page: Page, network: Network, on_s: float) -> dict[str, object]:
    """Return the reply to a film that was seen at a session time, by the page's clock."""
    event = page.event()
    reply = event["reply"]
    shift_ms = network.page_ms(on_s) - reply["films"]["film"]["first_ms"]
    reply["films"]["film"]["first_ms"] += shift_ms
    for name in ("shown_ms", "off_ms"):
        reply[name] += shift_ms
    for answer in reply["answers"].values():
        answer["at_ms"] += shift_ms
    event["at_ms"] += shift_ms
    return event


@pytest.mark.parametrize("ppm", [-50.0, 50.0])
def test_a_film_s_onset_is_true_after_an_hour_and_is_seen_again_at_the_same_time(
    ppm: float, tmp_path: Path
) -> None:
    network = Network(ppm)
    with begin_session(tmp_path) as (page, path):
        at_a_film(page)
        beats(page, network, 3600.0)
        on_s = page.clock.now_ns() / NS_PER_S
        page.desk.take(TAB, [film_reply(page, network, on_s)])
        page.answer_all()
        page.desk.recorder.close("complete")
    row = Recording(path).trials().iloc[0]
    assert TRUE_WITHIN_MS > abs(row["film_on_ns"] / NS_PER_MS - 1000 * on_s)
    events = Recording(path).events()
    stamps = list(events.loc[events["name"] == "clock_exchanges", "payload"])
    assert [PAGE_ROLE] == [p["role"] for p in stamps]
    assert 800 < len(stamps[0]["stamps_ns"])


def test_a_page_that_slept_is_placed_by_the_exchanges_after_it(tmp_path: Path) -> None:
    network = Network(20.0, leaps_s=[(1000.0, -900.0)])  # its clock stands for a quarter of an hour
    with begin_session(tmp_path) as (page, path):
        at_a_film(page)
        beats(page, network, 995.0)
        page.clock.sleep_until_ns(1900 * NS_PER_S)
        beats(page, network, 1990.0)
        on_s = page.clock.now_ns() / NS_PER_S
        page.desk.take(TAB, [film_reply(page, network, on_s)])
        page.answer_all()
        page.desk.recorder.close("complete")
    row = Recording(path).trials().iloc[0]
    assert SLEEP_FLAG == row["flags"]
    assert TRUE_WITHIN_MS > abs(row["film_on_ns"] / NS_PER_MS - 1000 * on_s)


def test_a_page_whose_clock_was_set_is_flagged(tmp_path: Path) -> None:
    network = Network(leaps_s=[(100.0, 3600.0)])
    with begin_session(tmp_path) as (page, path):
        at_a_film(page)
        beats(page, network, 200.0)
        page.desk.take(TAB, [film_reply(page, network, page.clock.now_ns() / NS_PER_S)])
        page.answer_all()
        page.desk.recorder.close("complete")
    assert CLOCK_FLAG == Recording(path).trials().iloc[0]["flags"]


@pytest.mark.parametrize("slow_ms", [(150.0, 0.0), (0.0, 150.0)])
def test_one_slow_way_is_no_clock_that_was_set(
    slow_ms: tuple[float, float], tmp_path: Path
) -> None:
    network = Network(queue_ms=0.1)
    with begin_session(tmp_path) as (page, path):
        at_a_film(page)
        ways_s = iter([way_ms / 1000 for way_ms in slow_ms])
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(network, "way_s", lambda: next(ways_s, 0.002))
            beats(page, network, 60.0)
        page.desk.take(TAB, [film_reply(page, network, page.clock.now_ns() / NS_PER_S)])
        page.answer_all()
        page.desk.recorder.close("complete")
    assert "" == Recording(path).trials().iloc[0]["flags"]


def test_a_clock_outlives_its_server_only_as_far_as_session_time_does(tmp_path: Path) -> None:
    network = Network(50.0)
    with begin_session(tmp_path) as (page, path):
        at_a_film(page)
        beats(page, network, 400.0)
        page.desk.recorder.checkpoint()
    with go_on_with(path) as page:  # session time begins anew
        page.answer_all()
        page.desk.recorder.close("complete")
    row = Recording(path).trials().iloc[0]
    assert 0 <= row["film_on_ns"] < 60 * NS_PER_S

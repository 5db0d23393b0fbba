"""One participant's session on a page: events in, each acknowledged once on the disk; steps out."""

import secrets
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from typing import Any, Final

from visavis.lab.clock import NS_PER_S, Clock
from visavis.protocol.session.progress import FINAL_STATUSES
from visavis.recording.page_clock import CLOCK, PAGE_ROLE, PageClocks, PageExchange
from visavis.recording.session_times import EXCHANGE_EVENT
from visavis.recording.writer import Recorder
from visavis.running.page.course import DONE, Course, Event, Notes, TrialRow
from visavis.running.page.earlier_parts import PAGE_EVENT, REWOUND, REWOUND_FLAG, EarlierParts
from visavis.running.page.replies import check_reply
from visavis.running.page.steps import (
    MOULDER,
    PRELOAD,
    BadEventError,
    OpenElsewhereError,
    PageError,
    PageStep,
    Reply,
    check_moves,
    count,
    mapping,
    number,
)
from visavis.running.page.stream_batches import (
    PageBatch,
    PageStreams,
    check_happening,
    read_batch,
)
from visavis.running.page.streams import HAPPENINGS
from visavis.study.information import about_with_facts
from visavis.study.live import PLACES

LEASE_NS: Final = 12 * NS_PER_S
"""After this silence a page counts as gone, and another may take its place."""
MAX_EVENTS: Final = 500
"""How many events a page may send at once."""
KINDS: Final = ("reply", "moved", "about", "visibility", "fullscreen", "resize", "problem")
KINDS_OF_HEADSET: Final = ("stream", "xr")
MAX_TAB: Final = 200
ROWS_AT_ONCE: Final = 16_384
"""Rows that the recorder takes before the disk must have them, below what its queues hold."""
LOST_FLAG: Final = "frames lost"
RELOAD_FLAG: Final = "page reloaded"
SLEEP_FLAG: Final = "computer asleep"
CLOCK_FLAG: Final = "page clock set"


@dataclass(frozen=True)
class Post:
    """A post of a page: its number there, when it came, and when answers to earlier posts were in.

    `out_ms` and `answers` (post, time in ms) are by the page's clock, `wall_ms` by the time of day
    there.
    """

    out_ms: float
    wall_ms: float
    number: int | None = None
    in_ns: int = 0
    answers: tuple[tuple[int, float], ...] = ()


@dataclass
class PageDesk:
    """Own the course of one session on a page.

    `key` is the secret in the page's address. Methods are called one after another; what they
    return may be sent once `recorder.checkpoint` has returned.
    """

    course: Course
    recorder: Recorder
    clock: Clock
    notes: Notes
    past: EarlierParts | None = None
    key: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    last_event_number: int = 0
    step_number: int = 0
    step: PageStep = field(default_factory=lambda: PageStep("end"))
    outcome: str = ""
    trial_id: str = ""
    trial_steps: list[PageStep] = field(default_factory=list)
    """Steps that the current trial has shown so far."""
    on_trial: Callable[[], None] | None = None
    take_place: Callable[[], bool] | None = None
    """Called at the first answer of a person, which is their consent where one is asked for; False
    ends the session, as all places are taken."""
    headset_streams: Sequence[str] = ()
    """The streams that the study's page sends from a headset; none where it enters none."""

    def __post_init__(self) -> None:
        self._tab = ""
        self._heard_ns = -LEASE_NS
        self._has_left = True
        self._clocks = PageClocks()
        self._exchanges: list[PageExchange] = []
        self._moves: list[Mapping[str, Any]] = []
        self._opened_before_consent: tuple[int, Mapping[str, Any]] | None = None
        self.has_answered = False
        """As `visavis.running.page.board.has_answered` tells of what is recorded."""
        rows_on_disk = {} if self.past is None else self.past.rows_on_disk
        self._streams = PageStreams(self.recorder, rows_on_disk)
        self._trials_finished: set[str] = set()
        self._answer_counts: Counter[tuple[str, str]] = Counter()
        self._is_replaying = self.past is not None
        self._advance(None)
        if self.past is not None:
            self._replay(self.past)
            self._is_replaying = False
            if self.past.rewinding is not None:
                self.recorder.event(PAGE_EVENT, self.clock.now_ns(), **self.past.rewinding)

    @property
    def trials_done(self) -> int:
        """How many trials need no further attempt."""
        return len(self._trials_finished)

    # ---- what a page asks --------------------------------------------------------------------

    def hello(
        self,
        tab: str,
        *,
        before: str = "",
        takes_over: bool = False,
        about: Mapping[str, Any] | None = None,
        at_ms: float = 0.0,
    ) -> None:
        """Give the session to a page: the only one, a returning one, or one that may take over.

        `before` is the earlier tab of the same browser, which the browser reports as closed.

        Raises:
            OpenElsewhereError: another page has it.
        """
        now_ns = self.clock.now_ns()
        is_free = self._has_left or now_ns - self._heard_ns > LEASE_NS
        if not (tab == self._tab or is_free or takes_over or (before and before == self._tab)):
            raise OpenElsewhereError("the study is open in another tab or browser")
        payload = {
            "kind": "opened",
            "tab": tab,
            "at_ms": at_ms,
            "about": about_with_facts(about or {}),
        }
        self._record(payload, now_ns)
        self._apply_opening(payload, now_ns)
        self._heard_ns, self._has_left = now_ns, False

    def take(self, tab: str, events: Sequence[Any], post: Post | None = None) -> bool:
        """Take numbered events of the page that has the session; skip acknowledged ones.

        `post` is what is known of the post that brought them. Return whether there may be
        something to write.

        Raises:
            OpenElsewhereError: another page has it.
            BadEventError: an event says what cannot be; those before it are taken.
            PageError: an event is none, or a number is missing.
        """
        if tab != self._tab:
            raise OpenElsewhereError("the study goes on in another tab or browser")
        if len(events) > MAX_EVENTS:
            raise PageError(f"{len(events)} events at once; {MAX_EVENTS} are taken")
        now_ns = self.clock.now_ns()
        self._heard_ns = now_ns
        is_changed = post is not None and self._take_times(tab, post, now_ns)
        waiting_rows = 0
        for content in events:
            event = mapping(content, "an event")
            n = count(event.get("n"), "n")
            if n <= self.last_event_number:
                continue
            if n != self.last_event_number + 1:
                raise PageError(f"event {n} came after {self.last_event_number}; one is missing")
            try:
                batch = self._batch_of(event)
                payload = self._payload_of(event, tab, batch)
            except PageError as error:
                raise BadEventError(n, str(error)) from error
            except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
                why = f"no page writes such an event ({type(error).__name__}: {error})"
                raise BadEventError(n, why) from error
            if self._comes_too_late(payload):
                agreed = {"agreed": True} if self.step.kind == "consent" else {}
                payload["reply"] = {**agreed, "is_full": True}
            self._report_trial()
            if batch is not None:
                self._write_batch(batch, payload, now_ns)
                waiting_rows += len(batch.rows)
                if waiting_rows > ROWS_AT_ONCE:
                    self.recorder.checkpoint()
                    waiting_rows = 0
            self._record(payload, now_ns)
            self._apply(payload, now_ns)
        return is_changed or bool(events)

    def note_answer(self, tab: str, post: Post) -> None:
        """Note that the answer to a post leaves now."""
        if post.number is not None and self.step.kind != "consent":
            clock, now_ns = self._clocks.of(tab), self.clock.now_ns()
            clock.add_post(post.number, post.out_ms, post.in_ns, now_ns)

    def state(self) -> dict[str, Any]:
        """Return the state for the page: the last event on the disk, and the step to show."""
        return {
            "ack": self.last_event_number,
            "number": self.step_number,
            "step": {"kind": self.step.kind, **self.step.content},
        }

    @property
    def next_rows(self) -> dict[str, int]:
        """The number from which a page goes on in each stream of a headset that has any."""
        return self._streams.going_on

    def leave(self, tab: str) -> None:
        """Note that a page was closed or reloaded; another may connect at once."""
        if tab == self._tab:
            self._has_left = True

    def is_left_for(self, tab: str) -> bool:
        """Tell whether another page says hello after this session's page was closed."""
        is_begun = self.step.kind != "consent" and not self.is_over
        return bool(tab) and is_begun and tab != self._tab and self._has_left

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to do."""
        return bool(self.outcome)

    @property
    def heard_ns(self) -> int:
        """When the page was last heard, in session time."""
        return self._heard_ns

    # ---- within ------------------------------------------------------------------------------

    def _take_times(self, tab: str, post: Post, now_ns: int) -> bool:
        """Follow the page's clock by the stamps of a post; tell whether something was recorded."""
        clock = self._clocks.of(tab)
        if clock.has_slept(post.out_ms, post.wall_ms, now_ns):
            payload: dict[str, Any] = {"kind": "slept", "tab": tab, "at_ms": post.out_ms}
            self._record(payload, now_ns)
            self._apply_sleep(payload, now_ns)
            return True
        exchanges = [clock.add_answer(number, in_ms) for number, in_ms in post.answers]
        if self.step.kind == "consent":  # nothing about a page is recorded yet
            return False
        self._exchanges += filter(None, exchanges)
        offset = clock.offset_to_place(now_ns) or clock.offset_of_one_way(post.out_ms, post.in_ns)
        if offset is None:
            return False
        payload = {**offset, "tab": tab}
        self._record(payload, now_ns)
        self._clocks.follow(payload, now_ns)
        if payload["is_set"]:
            self.notes.add(CLOCK_FLAG)
        return True

    def _record(self, payload: Mapping[str, Any], t_ns: int) -> None:
        """Record an event of the page; before consent nothing, with a refusal only the refusal.

        Which page somebody agreed on is recorded with their consent: replies are its.
        """
        if self.step.kind != "consent":
            self.recorder.event(PAGE_EVENT, t_ns, **payload)
        elif payload["kind"] == "opened":
            self._opened_before_consent = t_ns, payload
        elif payload["kind"] == "reply" and payload["reply"].get("is_full"):
            late = {"kind": "reply", "n": payload["n"], "step": payload["step"]}
            self.recorder.event(PAGE_EVENT, t_ns, **late, reply=payload["reply"])
        elif payload["kind"] == "reply" and payload["reply"].get("agreed") is True:
            if self._opened_before_consent is not None:
                opened_ns, opening = self._opened_before_consent
                self.recorder.event(PAGE_EVENT, opened_ns, **opening)
            self.recorder.event(PAGE_EVENT, t_ns, **payload)
        elif payload["kind"] == "reply":
            refusal = {"kind": "reply", "n": payload["n"], "step": payload["step"]}
            if "stop" in payload["reply"]:
                refusal["reply"] = {"stop": payload["reply"]["stop"]}
            else:
                refusal["reply"] = {"agreed": False}
            self.recorder.event(PAGE_EVENT, t_ns, **refusal)

    def _comes_too_late(self, payload: Mapping[str, Any]) -> bool:
        """Tell whether somebody begins for whom there is no place any more; take it else."""
        is_first = payload["kind"] == "reply" and self.step.kind != PRELOAD
        if not is_first or self.has_answered or self.take_place is None:
            return False
        takes_part = "stop" not in payload["reply"] and payload["reply"].get("agreed") is not False
        return takes_part and not self.take_place()

    def _report_trial(self) -> None:
        if self.on_trial is not None and self.trial_id:
            self.on_trial()

    def _batch_of(self, event: Mapping[str, Any]) -> PageBatch | None:
        """Return the samples of an event, once they were checked; None where it has none."""
        if event.get("kind") not in KINDS_OF_HEADSET:
            return None
        if not self.headset_streams or self.step.kind == "consent" or self.is_over:
            raise PageError("nobody entered a headset")
        if event["kind"] == "xr":
            check_happening(event)
            return None
        batch = read_batch(event, self.headset_streams)
        self._streams.check_number(batch)
        return batch

    def _write_batch(self, batch: PageBatch, payload: Mapping[str, Any], now_ns: int) -> None:
        """Hand samples to the recorder before the journal says that they are there."""
        if self._streams.has_hole_before(batch):
            self.notes.add(LOST_FLAG)
        self._clocks.follow(payload, now_ns)
        clock = self._clocks.of(payload["tab"])
        self._streams.write(batch, clock.placing(), now_ns)

    def _payload_of(
        self, event: Mapping[str, Any], tab: str, batch: PageBatch | None
    ) -> dict[str, Any]:
        """Return what is recorded of an event, once it was checked."""
        if event.get("kind") not in (*KINDS, *KINDS_OF_HEADSET):
            raise PageError(f"there is no event {str(event.get('kind'))[:40]!r}")
        number(event.get("at_ms"), "at_ms")
        of_tab = event.get("tab", tab)  # what waited in the store may be of an earlier one
        if not isinstance(of_tab, str) or not 0 < len(of_tab) <= MAX_TAB:
            raise PageError("a tab is a short text")
        if batch is not None:
            own = {name: event[name] for name in ("n", "kind", "at_ms")}
            return {**own, "tab": of_tab, **batch.journaled}
        payload = {**event, "tab": of_tab}
        if payload["kind"] == "about":
            payload["about"] = about_with_facts(mapping(payload.get("about"), "about"))
        self._check_event(payload)
        return payload

    def _check_event(self, payload: Mapping[str, Any]) -> None:
        if payload["kind"] == "reply":
            if self.is_over or payload.get("step") != self.step_number:
                raise PageError(
                    f"a reply to step {payload.get('step')}; step {self.step_number} is shown"
                )
            check_reply(self.step, mapping(payload.get("reply"), "a reply"))
        elif payload["kind"] == "moved":
            check_moves(payload)
            # They may come after their step, from a page that was left in the middle of it.
            if payload.get("step") == self.step_number and payload["names"] != [
                question["name"]
                for question in self.step.content.get("questions", ())
                if question["kind"] == MOULDER
            ]:
                raise PageError("these sliders are not those of the step that is shown")

    def _apply(self, payload: Mapping[str, Any], t_ns: int) -> None:
        self.last_event_number = int(payload["n"])
        self._clocks.follow(payload, t_ns)
        if payload["kind"] == "problem":
            self.notes.add("page problem")
        elif payload["kind"] == "stream":
            self._streams.note(payload["stream"], payload["seq0"] + payload["rows"])
        elif payload["kind"] == "xr":
            self._apply_happening(payload["what"])
        elif payload["kind"] == REWOUND:
            self.notes.add(REWOUND_FLAG)
            self.step_number = int(payload["number"])
        elif payload["kind"] == "moved" and payload.get("step") == self.step_number:
            self._moves.append(payload)
        elif payload["kind"] == "reply":
            self.has_answered = self.has_answered or self.step.kind != PRELOAD
            tab = str(payload.get("tab", ""))
            moves = tuple(m for m in self._moves if m.get("tab", "") == tab)  # of the same clock
            self._advance(Reply(payload["reply"], t_ns, self._clocks.of(tab).placing(), moves))

    def _apply_opening(self, payload: Mapping[str, Any], t_ns: int) -> None:
        tab = str(payload["tab"])
        if self._tab and tab != self._tab:
            self.notes.add(RELOAD_FLAG)
            self._leave_headset()
            self._moves.clear()  # their times are of the other page's clock
        self._tab = tab
        self._clocks.follow(payload, t_ns)

    def _apply_happening(self, what: str) -> None:
        if flag := HAPPENINGS[what]:
            self.notes.add(flag)
        if what == "entered":
            self.notes.move_to(PLACES[0])
        elif what == "ended":
            self._leave_headset()

    def _leave_headset(self) -> None:
        """Note that the page is seen on its screen, if somebody had entered a headset."""
        if self.notes.place:
            self.notes.move_to(PLACES[1])

    def _apply_sleep(self, payload: Mapping[str, Any], t_ns: int) -> None:
        self.notes.add(SLEEP_FLAG)
        self._clocks.follow(payload, t_ns)

    def _advance(self, reply: Reply | None) -> None:
        try:
            while True:
                out = self.course.send(reply)
                reply = None
                if isinstance(out, PageStep):
                    self.step, self.step_number = out, self.step_number + 1
                    self._moves.clear()
                    self.trial_steps.append(out)
                    self._report_trial()
                    return
                self._write(out)
        except StopIteration as end:
            self.outcome = end.value or DONE
            self.step, self.step_number = (
                PageStep("end", {"outcome": self.outcome}),
                self.step_number + 1,
            )

    def _write(self, out: Event | TrialRow) -> None:
        if isinstance(out, Event) and out.name == "trial_start":
            self.trial_id, self.trial_steps = str(out.payload["trial_id"]), []
        if isinstance(out, TrialRow):
            if out.row["status"] in FINAL_STATUSES:
                self._trials_finished.add(str(out.row["trial_id"]))
            self._record_exchanges()
            past = self.past if self._is_replaying else None
            attempt = (str(out.row["trial_id"]), out.row["attempt"])
            if past is None or attempt not in past.rows:
                self.recorder.trial(out.row)
        elif not (self._is_replaying and self.past is not None and self._is_known(out, self.past)):
            self.recorder.event(out.name, self.clock.now_ns(), **out.payload)

    def _record_exchanges(self) -> None:
        """Note all stamps since the last trial, from which streams are dated afterwards."""
        if self._exchanges and not self._is_replaying:
            rows = [exchange.as_row for exchange in self._exchanges]
            stamps = [list(astuple(exchange)) for exchange in self._exchanges]
            self._exchanges.clear()
            now_ns = self.clock.now_ns()
            self.recorder.event(
                EXCHANGE_EVENT,
                now_ns,
                role=PAGE_ROLE,
                send_device_receive_ns=rows,
                stamps_ns=stamps,
            )

    def _replay(self, past: EarlierParts) -> None:
        """Replay the course up to its last reply; flag a trial that a restart interrupted."""
        part = None
        for its_part, t_ns, payload in past.events:
            if part is not None and its_part != part:
                self._flag_interruption(past)
                self._clocks = PageClocks()  # session time began anew
            part = its_part
            if payload["kind"] == "opened":
                self._apply_opening(payload, t_ns)
            elif payload["kind"] == "slept":
                self._apply_sleep(payload, t_ns)
            elif payload["kind"] == CLOCK:
                self._clocks.follow(payload, t_ns)
            else:
                self._apply(payload, t_ns)
        self._clocks = PageClocks()
        self._flag_interruption(past)
        self._has_left = not self._tab  # nobody agreed yet: whoever comes has it
        self._heard_ns = self.clock.now_ns()

    def _flag_interruption(self, past: EarlierParts) -> None:
        if past.broken_by:
            self.notes.add(past.broken_by)

    def _is_known(self, event: Event, past: EarlierParts) -> bool:
        """Tell whether an event that the course repeats is in an earlier part."""
        payload = event.payload
        match event.name:
            case "trial_start":
                return (payload["trial_id"], payload["attempt"]) in past.started
            case "answer":
                return (payload["questionnaire"], payload["question"]) in past.answers
            case "answered":
                key = (payload["trial_id"], payload["question"])
                self._answer_counts[key] += 1
                return self._answer_counts[key] <= past.answered_questions[key]
            case "questionnaire_complete":
                return payload["questionnaire"] in past.complete
            case _:
                return True

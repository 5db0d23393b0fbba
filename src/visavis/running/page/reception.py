"""Receive the participants of a served study, each in a session of their own, at the same time."""

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, Final

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import LabError, LedgerError, UsageError
from visavis.protocol.people.ledger import Ledger, Participant
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.recording.folder import SessionFolder, create_session, open_session, session_dir
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.recording.writer import CloseStatus, Recorder
from visavis.running.film_store import FilmStore, require_roles_of_pages
from visavis.running.page.arrivals import (
    LINK,
    PLACES_AHEAD,
    Arrival,
    Order,
    arrival_of,
    completion_of,
    least_filled,
    order_of,
)
from visavis.running.page.board import ARRIVED, COUNTING, Board, Place, board_of, place_of
from visavis.running.page.course import DECLINED, DONE, FULL, WITHDRAWN, texts_of_page
from visavis.running.page.earlier_parts import returning_to
from visavis.running.page.opening_code import OpeningCode
from visavis.running.page.perform import (
    ENDINGS,
    SERVED_EVENT,
    about_of,
    board_key_of,
    experiment_of,
    key_of,
    manifest_of,
    page_session_of,
)
from visavis.running.page.rate_limit import ArrivalLimits
from visavis.running.page.server import EndedSession, PageServer, PageSession
from visavis.running.page.steps import CannotGoOnError, PageError
from visavis.running.sessions.device_setup import is_simulated
from visavis.running.sessions.next_session import next_session
from visavis.running.sessions.recorded_part import (
    begin_part,
    end_part,
    recorder_of,
    refuse_other_plan,
)
from visavis.running.sessions.session_request import Request, SessionPerson
from visavis.study.experiment import StudyExperiment
from visavis.study.returning import EXPIRED

IDLE_NS: Final = 30 * 60 * NS_PER_S
"""After this silence a page counts as left: its place is filled again, its session is kept."""
ARRIVED_IDLE_NS: Final = 5 * 60 * NS_PER_S
"""The same for a page whose participant has not begun yet; an open page is heard oftener."""
ROUND_S: Final = 5.0
PLANS_IN_MEMORY: Final = 8
"""A plan is looked at several times while somebody arrives."""
MAX_OPEN: Final = 500
"""Sessions that are open at once."""
SQUARES: Final = ("latin_square", "williams")
LEFT: Final = "the page was left"
SERVER_ENDED: Final = "the server was ended"
WITHDRAWN_ELSEWHERE: Final = "the researchers withdrew the participant"
CANNOT_GO_ON: Final = "this session cannot go on; please tell the researchers"


@dataclass(frozen=True)
class Rules:
    """How a study is served: how many people are wanted, and where they go afterwards.

    `group_quota` is how many of each group may take part.
    """

    quota: int | None = None
    completion: str = ""
    group_quota: int | None = None


@dataclass(eq=False)
class _OpenSession:
    """An open session: what serves it, and the recorder that writes it."""

    entry: Participant
    page: PageSession
    folder: SessionFolder
    recorder: Recorder
    begun_ns: int
    stack: ExitStack = field(default_factory=ExitStack)


class Reception:
    """Own the sessions of everybody who comes to a served study.

    `base` is a request that is completed for each person. `identify` stores a person's identity
    separately from the data, `identity_of` returns it, `forget` deletes it; `withdraw` deletes a
    participant's data. Where `code` is given, sessions begin by it alone.
    """

    def __init__(
        self,
        base: Request,
        store: FilmStore,
        ledger: Ledger,
        rules: Rules,
        *,
        identify: Callable[[str, Mapping[str, str]], None],
        identity_of: Callable[[str], Mapping[str, str] | None],
        forget: Callable[[str], object],
        withdraw: Callable[[str], None],
        say: Callable[[str], None] = lambda text: None,
        code: OpeningCode | None = None,
    ) -> None:
        self.board_key = board_key_of(base)
        self._base, self._store, self._ledger, self._rules = base, store, ledger, rules
        self._experiment = experiment = experiment_of(base)
        self._plan = lru_cache(PLANS_IN_MEMORY)(lambda index: experiment.plan(index, base.seed))
        self._of_session = lru_cache(experiment.of_session)
        self._identify, self._identity_of, self._forget = identify, identity_of, forget
        self._withdraw = withdraw
        self._say_line = say
        self._code = code
        self._simulated = is_simulated(base.config)
        self._contact = base.config.privacy.contact
        self._returning = self._experiment.study.procedure.returning
        self._root = base.config.data_root
        self._open: dict[str, _OpenSession] = {}
        self._keys: dict[str, str] = {}
        self._of_panel: dict[tuple[str, str], str] = {}
        self._orders: dict[int, Order] = {}
        self._places: dict[str, Place] = {}
        self._session_numbers: dict[str, int] = {}
        """The session of each participant that was begun last, where it is not the first."""
        self._turn = asyncio.Lock()
        self._closing: set[asyncio.Task[None]] = set()
        self._opening: set[asyncio.Task[_OpenSession | None]] = set()
        self._is_ending = False
        self._port = 0
        self._ledger_state = self._read_ledger_state()
        self._limits = ArrivalLimits()
        self._taking_place = threading.Lock()
        for entry in ledger.list():
            self._read(entry)
        self._states = {place.label: place.state for place in self._board().places}
        """State of every participant's last session, without reading the disk."""
        for entry in ledger.list():
            if entry.label in self._session_numbers:
                self._states[entry.label] = place_of(entry, self._path(entry)).state

    # ---- what the server asks ----------------------------------------------------------------

    async def arrive(
        self, parameters: Mapping[str, str], before: str = "", address: str = "", code: str = ""
    ) -> Mapping[str, Any]:
        """Return the key of a session for a person who arrives, or why there is none.

        `before` is the key that their browser remembers. If others could guess the identifier, a
        session continues only in the browser that began it. A place is taken with the consent, or
        with the first answer where none is asked for. Where a code opens sessions, `code` is what
        was typed of it; a browser that remembers a session of this study needs none.
        """
        words = dict(texts_of_page(self._experiment))
        if self._code is not None and before not in self._keys:
            name = self._code.refusal(code, address, self._base.clock.now_ns())
            if name:
                texts = {"title": words.get("code_title", ""), "text": words.get(name, "")}
                return {"refused": "code", **texts, "go_on": words.get("next", "")}
        try:
            arrival = self._with_label(arrival_of(parameters))
        except PageError as error:
            self._say(f"somebody came and got no session: {error}")
            return {"refused": "address", "text": words.get("address", "")}
        await self._notice_withdrawals()
        async with self._turn:
            key = self._of_panel.get((arrival.panel, arrival.identifier))
            if arrival.identifier and key is not None:
                later = await self._run(self._later_session, key)
                if isinstance(later, str):
                    return {"refused": "early", "text": later}
                if later is not None:
                    return await self._admit(partial(self._begin, arrival, *later), words, address)
                if arrival.can_be_guessed and key != before:
                    self._say(
                        f"{arrival.panel} {arrival.identifier} has a session and came again from "
                        "another browser, with an identifier that others could guess: refused"
                    )
                    return {"refused": "begun", "text": words.get("begun_elsewhere", "")}
                return {"key": key}
            if self._is_full():
                return {"refused": "full", "text": words.get("full", "")}
            return await self._admit(partial(self._begin, arrival), words, address)

    async def _admit(
        self, begin: Callable[[], _OpenSession], words: Mapping[str, str], address: str
    ) -> Mapping[str, Any]:
        """Begin a session, if not too many are; return its key, or why there is none."""
        open_count = sum(not session.page.closed.is_set() for session in self._open.values())
        if (
            self._is_ending
            or open_count >= MAX_OPEN
            or not self._limits.lets_pass(address, self._base.clock.now_ns())
        ):
            return {"refused": "busy", "text": words.get("busy", "")}
        try:
            session = await self._open_and_keep(begin)
            assert session is not None  # noqa: S101  # only one that is gone on with may be
        except LabError as error:
            self._say(f"somebody came and got no session: {error}")
            return {"refused": "failed", "text": words.get("failed", "")}
        return {"key": session.page.desk.key}

    def _later_session(self, key: str) -> tuple[Participant, int] | str | None:
        """Return the participant and number of a further session that somebody comes to, or when it
        is due; None where they come to the one that is there.
        """
        design, label = self._experiment.study.design, self._keys[key]
        if not design.sessions or self._states.get(label) != "complete":
            return None
        entry = self._ledger.resolve(label)
        person, now = self._path(entry).parent, self._base.clock.wall_iso()
        number = self._session_numbers.get(label, 1)
        if number == len(design.sessions):
            return None
        try:
            due = next_session(person, design.sessions, design.days_between, now)
        except UsageError:  # the end of their last session is not on the disk yet
            return None
        if due.is_early:
            self._say(f"{label} came again: {due.words}")
            days = {"n": due.first_day, "m": due.last_day}
            return self._experiment.texts.get("page.early", days)
        return entry, due.number

    async def session_of(self, key: str, new_tab: str = "") -> PageSession | EndedSession | None:
        """Return the session of a key, open where it was left; None if there is none.

        `new_tab` is a page that says hello: a study may let it go on from a checkpoint alone.

        Raises:
            CannotGoOnError: the operator of the server is told why.
        """
        if key in self._open:
            session = self._open[key]
            if self._returning.is_usual or not session.page.desk.is_left_for(new_tab):
                return session.page
            await self._close(session, "aborted", LEFT)
        await self._notice_withdrawals()
        async with self._turn:
            if key not in self._open and key in self._keys:
                if (ending := self._ending_of(key)) is not None:
                    return ending
                if self._is_ending:
                    raise CannotGoOnError(CANNOT_GO_ON)
                try:
                    open_session = await self._open_and_keep(self._go_on, key)
                    if open_session is None:
                        return self._ended(self._keys[key], EXPIRED)
                except LabError as error:
                    self._say(f"{self._keys[key]} came again and could not go on: {error}")
                    raise CannotGoOnError(CANNOT_GO_ON) from error
        return self._open[key].page if key in self._open else None

    async def board(self) -> Mapping[str, Any]:
        """Return what the researcher's page shows."""
        board = await self._run(self._board)
        title = self._experiment.study.title
        return {"title": title, "is_simulated": self._simulated, **board.as_data()}

    # ---- what whoever serves asks --------------------------------------------------------------

    async def serve(self, server: PageServer, until: asyncio.Event) -> None:
        """Look after the sessions until `until` is set, then stop the server and close them all.

        Answers are kept. Deletions that an earlier server could not finish are done first.
        """
        self._port = server.port
        for label, state in list(self._states.items()):
            if state == WITHDRAWN:  # the server was killed before it was done
                await self._delete(label)
        try:
            while not until.is_set():
                await self._notice_withdrawals()
                await self._leave_idle()
                try:
                    await asyncio.wait_for(until.wait(), ROUND_S)
                except TimeoutError:
                    continue
        finally:
            self._is_ending = True
            await server.stop()  # an event that arrives now would reopen its session
            # Who is being let in may have closed their page: aiohttp ends no handler then.
            await asyncio.gather(*self._opening, return_exceptions=True)
            open_sessions = list(self._open.values())
            await asyncio.gather(*(self._close(s, "aborted", SERVER_ENDED) for s in open_sessions))
            if self._closing:
                await asyncio.gather(*self._closing)

    # ---- within ------------------------------------------------------------------------------

    async def _run(self, act: Callable[..., Any], *arguments: Any) -> Any:
        if self._base.clock.is_virtual:
            return act(*arguments)
        return await asyncio.to_thread(act, *arguments)

    async def _open_and_keep(
        self, act: Callable[..., _OpenSession | None], *arguments: Any
    ) -> _OpenSession | None:
        """Open a session and keep it, also if whoever asked for it is cancelled meanwhile."""

        async def open_and_keep() -> _OpenSession | None:
            session: _OpenSession | None = await self._run(act, *arguments)
            if session is not None:
                self._keep(session)
            return session

        opening = asyncio.create_task(open_and_keep())
        self._opening.add(opening)
        opening.add_done_callback(self._opening.discard)
        return await asyncio.shield(opening)

    def _say(self, text: str) -> None:
        """Say one line: a break or a terminal's command that a stranger sent would forge ours."""
        self._say_line("".join(c if c.isprintable() else " " for c in text))

    def _is_full(self) -> bool:
        """Tell whether all places are taken: by people who completed, or are at it."""
        n_taken = sum(state in COUNTING for state in list(self._states.values()))
        if self._rules.quota is not None and n_taken >= self._rules.quota:
            return True
        return self._rules.group_quota is not None and set(self._groups) <= self._full_groups()

    @cached_property
    def _groups(self) -> tuple[str, ...]:
        """The groups of the study: a run of places holds each once before one comes again."""
        names = (str(self._order(index)[0]) for index in range(PLACES_AHEAD))
        return tuple(dict.fromkeys(names))

    def _full_groups(self) -> set[str]:
        """Return the groups of which as many people as wanted completed, or are at it."""
        most = self._rules.group_quota
        if most is None:
            return set()
        group_of = {entry.label: entry.group for entry in self._ledger.list()}
        states = list(self._states.items())
        taken = Counter(group_of.get(label) for label, state in states if state in COUNTING)
        return {str(group) for group, n in taken.items() if group is not None and n >= most}

    def _take_place(self, label: str) -> bool:
        """Give a participant who begins a place; tell whether there is one. Thread-safe."""
        with self._taking_place:
            if self._states.get(label) not in COUNTING:
                group = next((e.group for e in self._ledger.list() if e.label == label), "")
                if self._is_full() or group in self._full_groups():
                    return False
            self._states[label] = "running"
            return True

    def _path(self, entry: Participant) -> Path:
        return session_dir(
            self._root,
            self._base.study.name,
            entry.label,
            self._session_numbers.get(entry.label, 1),
            is_simulated=self._simulated,
        )

    def _board(self) -> Board:
        folder = self._path_of_study()
        return board_of(
            self._ledger.list(),
            folder,
            quota=self._rules.quota,
            cached_places=self._places,
            shown_group=self._experiment.study.procedure.shown_group,
        )

    def _path_of_study(self) -> Path:
        return self._ledger.path.parent

    def _order(self, index: int) -> Order:
        if index not in self._orders:
            plan = self._plan(index)
            in_squares = self._experiment.study.design.order in SQUARES
            self._orders[index] = order_of(plan, trials_too=in_squares)
        return self._orders[index]

    def _plan_of(self, entry: Participant) -> SessionPlan:
        experiment = self._experiment_for(entry)
        if experiment is not self._experiment:
            return experiment.plan(entry.index, self._base.seed, entry.group)
        plan = self._plan(entry.index)
        if entry.group in ("", plan.group):
            return plan
        return experiment.plan(entry.index, self._base.seed, entry.group)

    def _experiment_for(self, entry: Participant) -> StudyExperiment:
        """Return the experiment of a participant's session."""
        return self._of_session(self._session_numbers.get(entry.label, 1))

    def _read(self, entry: Participant) -> None:
        """Register the key and the participant of a session that was begun earlier."""
        for number in range(2, len(self._experiment.study.design.sessions) + 1):
            self._session_numbers[entry.label] = number
            if not (self._path(entry) / "manifest.json").exists():
                self._session_numbers.pop(entry.label)
                if number > 2:
                    self._session_numbers[entry.label] = number - 1
                break
        path = self._path(entry)
        if entry.status != "active" or not (path / "manifest.json").exists():
            return
        try:
            is_of_page = read_manifest(path).configuration.get("on") == "browser"
        except LabError as error:
            self._say(f"{entry.label} is passed over: {error}")
            return
        if not is_of_page:
            return
        key = key_of(self._request(entry))
        self._keys[key] = entry.label
        who = self._identity_of(entry.label)
        if who and who.get("identifier"):
            self._of_panel[who.get("panel", ""), who["identifier"]] = key

    def _begin(
        self, arrival: Arrival, entry: Participant | None = None, number: int = 1
    ) -> _OpenSession:
        """Begin a new person's session, or a further one of somebody.

        Raises:
            LabError: the study needs what no page has, or the session cannot be begun.
        """
        require_roles_of_pages(self._of_session(number))
        if entry is None:
            entry = self._registered(arrival) or self._add_to_ledger()
            if arrival.identifier:
                self._identify(entry.label, arrival.identity)
        else:
            self._forget_key(entry.label)
            self._session_numbers[entry.label] = number
        request = self._request(entry)
        stack = ExitStack()
        with stack:
            folder = stack.enter_context(
                create_session(
                    self._root,
                    manifest_of(request, self._experiment_for(entry), self._plan_of(entry)),
                )
            )
            session = self._part(request, entry, folder, None, key_of(request), arrival)
            session.stack = stack.pop_all()
        self._keys[session.page.desk.key] = entry.label
        if arrival.identifier:
            self._of_panel[arrival.panel, arrival.identifier] = session.page.desk.key
        return session

    def _forget_key(self, label: str) -> None:
        """Forget the page of a participant's session that is over."""
        for key in [key for key, of in self._keys.items() if of == label]:
            del self._keys[key]
            self._open.pop(key, None)

    def _with_label(self, arrival: Arrival) -> Arrival:
        """Return the arrival, with the ledger's label if a link (participant=07) names an entry.

        This holds if that participant has no session yet, or came by such a link before.
        """
        if arrival.panel != LINK:
            return arrival
        try:
            entry = self._ledger.resolve(arrival.identifier)
        except LedgerError:
            return arrival
        is_theirs = (LINK, entry.label) in self._of_panel or not self._has_session(entry)
        return replace(arrival, identifier=entry.label) if is_theirs else arrival

    def _has_session(self, entry: Participant) -> bool:
        return (self._path(entry) / "manifest.json").exists()

    def _registered(self, arrival: Arrival) -> Participant | None:
        """Return the participant in the ledger with this label and no session yet."""
        entries = self._ledger.list() if arrival.panel == LINK else ()
        matches = [e for e in entries if e.label == arrival.identifier and e.status == "active"]
        return matches[0] if matches and not self._has_session(matches[0]) else None

    def _add_to_ledger(self) -> Participant:
        """Add a participant to the ledger, at the place whose order the fewest people have."""
        entries = [e for e in self._ledger.list() if not e.has_freed_place]
        filling = (*COUNTING, ARRIVED)
        counting = [e.index for e in entries if self._states.get(e.label) in filling]
        full_groups = self._full_groups()
        index = least_filled(
            [e.index for e in entries],
            counting,
            self._order,
            is_open=lambda place: self._order(place)[0] not in full_groups,
        )
        return self._ledger.add(index=index, group=self._plan(index).group)

    def _go_on(self, key: str) -> _OpenSession | None:
        """Go on with a session where it was left; None where it is too old for that."""
        entry = self._ledger.resolve(self._keys[key])
        path, request = self._path(entry), self._request(entry)
        arrival = self._arrival(entry.label)
        stack = ExitStack()
        with stack:
            folder, _ = open_session(path)
            stack.enter_context(folder)
            recording = Recording(path)
            refuse_other_plan(recording, self._plan_of(entry))
            past = returning_to(recording, self._returning, request.clock.wall_iso())
            if past is None:
                return None
            session = self._part(request, entry, folder, past, key, arrival)
            session.stack = stack.pop_all()
        return session

    def _ending_of(self, key: str) -> EndedSession | None:
        """Return a session that is over and takes no more events; None if it continues."""
        label = self._keys[key]
        state = self._states.get(label, "")
        outcome = DONE if state == "complete" else state
        return self._ended(label, outcome) if outcome in (DONE, *ENDINGS) else None

    def _ended(self, label: str, outcome: str) -> EndedSession:
        arrival = self._arrival(label)
        about = about_of(self._experiment, self._simulated, self._contact)
        where = self._rules.completion
        return EndedSession(outcome, {**about, "completion": completion_of(where, arrival)})

    def _arrival(self, label: str) -> Arrival:
        who = self._identity_of(label) or {}
        return Arrival(who.get("panel", ""), who.get("identifier", ""))

    def _request(self, entry: Participant) -> Request:
        return replace(
            self._base,
            person=SessionPerson(
                entry.label,
                entry.index,
                entry.group,
                self._session_numbers.get(entry.label, 1),
                consent_version=entry.consent_version,
            ),
            experiment=self._experiment_for(entry),
        )

    def _part(
        self,
        request: Request,
        entry: Participant,
        folder: SessionFolder,
        past: Any,
        key: str,
        arrival: Arrival,
    ) -> _OpenSession:
        clock = request.clock
        part_dir = begin_part(clock, folder)
        recorder: Recorder | None = None
        try:
            recorder = recorder_of(part_dir, clock, is_simulated=self._simulated)
            recorder.event(SERVED_EVENT, clock.now_ns(), port=self._port)
            page_session = page_session_of(
                request,
                self._experiment_for(entry),
                self._plan_of(entry),
                self._store,
                folder,
                recorder,
                past,
                key,
            )
        except BaseException as error:
            end_part(clock, folder, recorder, "aborted", str(error) or repr(error), error)
            raise
        if self._rules.completion:
            where = completion_of(self._rules.completion, arrival)
            page_session = replace(page_session, about={**page_session.about, "completion": where})
        return _OpenSession(entry, page_session, folder, recorder, clock.now_ns())

    def _keep(self, session: _OpenSession) -> None:
        desk, label = session.page.desk, session.entry.label
        key = desk.key
        is_later = label in self._session_numbers  # who has a place keeps it
        self._states[label] = "running" if desk.has_answered or is_later else ARRIVED
        desk.take_place = partial(self._take_place, label)
        self._open[key] = session
        task = asyncio.get_running_loop().create_task(self._end_when_over(session))
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)
        if session.page.desk.is_over:
            session.page.over.set()

    async def _end_when_over(self, session: _OpenSession) -> None:
        over = asyncio.ensure_future(session.page.over.wait())
        closing = asyncio.ensure_future(session.page.closed.wait())
        try:
            await asyncio.wait({over, closing}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            over.cancel()
            closing.cancel()
        if session.page.closed.is_set():
            return
        if session.page.failures:
            self._note_end(session, "left")
            await self._close(session, "aborted", str(session.page.failures[0]))
            return
        outcome = session.page.desk.outcome
        why = ENDINGS.get(outcome, "")
        self._note_end(session, outcome if why else "complete")
        await self._close(session, "aborted" if why else "complete", why.partition(";")[0])
        if outcome == WITHDRAWN:
            await self._delete(session.entry.label)
        if outcome in (DECLINED, FULL) and session.entry.label not in self._session_numbers:
            await self._forget_identity(session.entry.label)

    def _note_end(self, session: _OpenSession, state: str) -> None:
        """Note how a session ended; however a later one ends, the first keeps its place."""
        is_later = session.entry.label in self._session_numbers and state != WITHDRAWN
        self._states[session.entry.label] = "complete" if is_later else state

    async def _forget_identity(self, label: str) -> None:
        """Keep nothing of whoever declined, or had no place, but that somebody did."""
        self._of_panel = {
            who: key for who, key in self._of_panel.items() if self._keys.get(key) != label
        }
        try:
            await self._run(self._forget, label)
        except LabError as error:
            self._say(f"{label} does not take part; their identifier is still stored: {error}")

    async def _delete(self, label: str) -> None:
        try:
            await self._run(self._withdraw, label)
        except LabError as error:
            self._say(f"{label} wants everything deleted: {error}")

    def _read_ledger_state(self) -> tuple[int, int]:
        """Return the time and size of the ledger's file, which change with every entry."""
        try:
            file_status = self._ledger.path.stat()
        except FileNotFoundError:
            return 0, 0
        return file_status.st_mtime_ns, file_status.st_size

    async def _notice_withdrawals(self) -> None:
        """Forget participants who were withdrawn meanwhile; delete those who are at a page."""
        ledger_state = self._read_ledger_state()
        if ledger_state == self._ledger_state:
            return
        self._ledger_state = ledger_state
        for entry in await self._run(self._ledger.list):
            state = self._states.get(entry.label, WITHDRAWN)
            if entry.status == "active" or state == WITHDRAWN:  # the page itself asked for it
                continue
            self._states[entry.label] = WITHDRAWN
            self._places.pop(entry.label, None)
            key = next((key for key, label in self._keys.items() if label == entry.label), "")
            self._keys.pop(key, None)
            self._of_panel = {who: of for who, of in self._of_panel.items() if of != key}
            session = self._open.pop(key, None)
            if session is not None and not session.page.closed.is_set():
                await self._close(session, "aborted", WITHDRAWN_ELSEWHERE)
                await self._delete(entry.label)
                self._say(f"{entry.label} was at a page, and is withdrawn and deleted")

    async def _leave_idle(self) -> None:
        now_ns = self._base.clock.now_ns()
        for session in list(self._open.values()):
            has_arrived = self._states.get(session.entry.label) == ARRIVED
            idle_ns = ARRIVED_IDLE_NS if has_arrived else IDLE_NS
            if now_ns - max(session.page.desk.heard_ns, session.begun_ns) > idle_ns:
                if not session.page.desk.is_over:
                    self._note_end(session, "left")
                    await self._close(session, "aborted", LEFT)

    async def _close(self, session: _OpenSession, status: CloseStatus, reason: str) -> None:
        """Close a recording; its page gets the last state until it says hello again."""
        key = session.page.desk.key
        async with session.page.lock:
            if session.page.closed.is_set():
                return
            session.page.closed.set()

            def end() -> None:
                with session.stack:
                    end_part(
                        self._base.clock, session.folder, session.recorder, status, reason, None
                    )

            try:
                await self._run(end)
            except (LabError, OSError) as error:  # a failing session must not end the others
                self._say(f"{session.entry.label}: {error}")
        if not session.page.desk.is_over:
            self._open.pop(key, None)

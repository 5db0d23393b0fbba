"""Read what people did with a bundle, and record it as if they had been served.

Every line names its run and its number. Lines that were sent twice count once. Before anything is
written, the replies are fed to the study's own course, and its steps compared with the bundle's.
"""

import json
import zipfile
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from visavis.lab.clock import StampClock
from visavis.lab.errors import DataError, LabError, LedgerError
from visavis.lab.plain_files import parse_json, read_plain, unpacked, with_whole_characters
from visavis.protocol.people.ledger import Ledger, Participant
from visavis.recording.folder import SessionFolder, create_session, open_session
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.recording.writer import REAL_TIME_BATCH_NS, CloseStatus, Recorder
from visavis.running.film_store import FilmStore
from visavis.running.page.arrivals import LINK, Arrival, arrival_of
from visavis.running.page.course import DECLINED, DONE, WITHDRAWN, course
from visavis.running.page.desk import PageDesk
from visavis.running.page.earlier_parts import EarlierParts, past_of
from visavis.running.page.other_hosts.bundle import (
    FORMAT,
    digest_of,
    files_of,
    steps_of_place,
    visit_of,
)
from visavis.running.page.perform import (
    ENDINGS,
    experiment_of,
    manifest_of,
    page_session_of,
    plan_of,
)
from visavis.running.page.reception import LEFT
from visavis.running.page.steps import PageError, PageStep, count, mapping, number, unix_ms
from visavis.running.sessions.device_setup import is_simulated
from visavis.running.sessions.recorded_part import begin_part, end_part
from visavis.running.sessions.session_request import Request, SessionPerson

IMPORT_KEY: Final = "imported"
"""Key in a session's configuration for the run and the bundle that it comes from."""
ARCHIVES: Final = (".zip", ".jrzip")
TEXTS: Final = (".jsonl", ".txt", ".json")
MAX_RESULTS_BYTES: Final = 2 << 30
MAX_FILE_BYTES: Final = 256 << 20
"""Largest file of results, within an archive or by itself."""
MAX_LINES: Final = 1_000_000
MAX_LINE: Final = 4 << 20
"""Longest line of results, in bytes: more than a page ever hands over at once."""
MAX_PLACES_LOOKED_AT: Final = 1000
ENDED_EARLY: Final = tuple(why.partition(";")[0] for why in ENDINGS.values())
"""Reasons of an early end after which a session does not continue."""


@dataclass(frozen=True, eq=False)
class Run:
    """What one person did with a bundle: how they arrived, and their lines in order."""

    key: str
    header: Mapping[str, Any]
    lines: tuple[Mapping[str, Any], ...]

    @property
    def place(self) -> int:
        """Which place of the plan they had, from 0."""
        return count(self.header.get("place"), "place")

    def lines_after(self, opening_count: int, last_number: int) -> "tuple[Mapping[str, Any], ...]":
        """Return the lines after the first openings of the page and after an event's number.

        Left out are `opening_count` openings, and events up to the number `last_number`. The tab
        that was open last continues with its own lines.
        """
        left = opening_count
        rest = []
        for line in self.lines:
            if "opened" in line:
                left -= 1
                if left < 0:
                    rest.append(line)
            elif left <= 0 and "event" in line and int(line["event"]["n"]) > last_number:
                rest.append(line)
        return tuple(rest)

    @cached_property
    def begun_ms(self) -> float:
        """When they came, in milliseconds since 1970."""
        return unix_ms(self.lines[0].get("at_ms"), "at_ms")

    @cached_property
    def arrival(self) -> Arrival:
        """The panel they came from, and its identifier for them."""
        name = "told" if "told" in self.header else "parameters"  # `told`: bundles before 0.3
        parameters = mapping(self.header.get(name, {}), name)
        return arrival_of({name: str(value) for name, value in parameters.items()})


@dataclass
class ImportSummary:
    """Outcome of an import: sessions by label, and what was left out and why."""

    sessions: dict[str, Path]
    continued_sessions: dict[str, Path] = field(default_factory=dict)
    """Participants who were imported before they finished, and have continued since."""
    recorded_before: int = 0
    unfinished: int = 0
    withdrawn_runs: tuple[str, ...] = ()
    moved_labels: tuple[str, ...] = ()
    """Participants whose place was taken, and who have another one in the ledger."""
    twice: tuple[tuple[str, str], ...] = ()
    """Further runs of people who have a session, with their label: they used two browsers."""
    refused_runs: tuple[str, ...] = ()
    unreadable: int = 0


def read_runs(paths: Iterable[Path]) -> tuple[list[Run], int]:
    """Return the runs of files, folders and archives, and how many lines could not be read.

    Raises:
        DataError: a file is not there, is damaged or too large, or none holds results of a bundle.
    """
    lines: dict[str, dict[int, Mapping[str, Any]]] = {}
    unreadable = 0
    n_lines = 0
    for text in _texts(paths):
        for line in filter(None, map(bytes.strip, BytesIO(_in_utf8(text)))):
            n_lines += 1
            if n_lines > MAX_LINES:
                raise DataError(
                    f"these files hold more than {MAX_LINES:,} lines of results; give some of "
                    "them at a time"
                )
            try:
                if len(line) > MAX_LINE:
                    raise ValueError("no page writes such a line")
                entry = with_whole_characters(parse_json(line.decode("utf-8", errors="replace")))
                key, its = str(entry["run"]), int(entry["line"])
            except (ValueError, TypeError, KeyError, OverflowError):
                unreadable += 1
                continue
            lines.setdefault(key, {}).setdefault(its, entry)
    runs = []
    for key, of_run in lines.items():
        first = of_run.get(0, {}).get("arrived")
        if not isinstance(first, Mapping):
            unreadable += len(of_run)
            continue
        runs.append(Run(key, first, tuple(of_run[n] for n in sorted(of_run))))
    if not runs:
        raise DataError(
            "there are no results of a bundle in these files; give what JATOS exports as results, "
            "or the folder that --results saved"
        )
    return runs, unreadable


def import_runs(
    base: Request,
    store: FilmStore,
    ledger: Ledger,
    runs: Iterable[Run],
    *,
    identify: Callable[[str, Mapping[str, str]], None],
    identity_of: Callable[[str], Mapping[str, str] | None] = lambda label: None,
    unfinished_too: bool = False,
) -> ImportSummary:
    """Record every run that is not recorded yet; identities go to `identify`, not to the data.

    `identity_of` returns the stored identity of a participant. A person who came in two browsers is
    one participant, and the run that got furthest counts. A run that was recorded before its end
    continues in its session.
    """
    summary = ImportSummary({})
    people = _People(base, ledger, identity_of)
    sessions_by_run = _sessions_by_run(ledger.path.parent)
    # Check every run first: the ledger takes people in order of rank, not of lines in files.
    fit: list[_ReadyRun] = []
    for run in runs:
        try:
            session = sessions_by_run.get(run.key)
            if session is not None and _is_over(session):
                summary.recorded_before += 1
                continue
            outcome = _check_run(base, store, run)
            one = _ReadyRun(run, people.with_label(run.arrival), outcome, run.begun_ms)
            if outcome == WITHDRAWN:
                summary.withdrawn_runs += (run.key,)
            elif session is not None:
                if _record_rest(base, store, one, session):
                    summary.continued_sessions[read_manifest(session).participant] = session
                else:
                    summary.recorded_before += 1
            elif not outcome and not unfinished_too:
                summary.unfinished += 1
            else:
                fit.append(one)
        except LabError as error:
            summary.refused_runs += (f"run {run.key[:8]}: {error}",)
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            why = f"it holds what no page writes ({type(error).__name__}: {error})"
            summary.refused_runs += (f"run {run.key[:8]}: {why}",)
    # Of several runs of one person, the first in this order is recorded.
    for one in sorted(fit, key=lambda one: one.rank):
        try:
            if label := people.label_of(one.arrival):
                summary.twice += ((one.run.key, label),)
                continue
            entry = people.registered(one.arrival)
            label, path, place = _import(base, store, ledger, one, entry, identify)
            people.add(one.arrival, label)
            summary.sessions[label] = path
            summary.moved_labels += () if place == one.run.place else (label,)
        except LabError as error:
            summary.refused_runs += (f"run {one.run.key[:8]}: {error}",)
    return summary


# ---- within ----------------------------------------------------------------------------------


def _texts(paths: Iterable[Path]) -> Iterator[bytes]:
    for path in paths:
        if path.is_dir():
            yield from _texts(sorted(p for p in path.rglob("*") if p.suffix in ARCHIVES + TEXTS))
        elif not path.is_file():
            raise DataError(f"there is no file {path}; give the results' files or their folder")
        else:
            try:
                if zipfile.is_zipfile(path):
                    for _, data in unpacked(
                        path,
                        _is_result,
                        max_bytes=MAX_RESULTS_BYTES,
                        max_member_bytes=MAX_FILE_BYTES,
                    ):
                        yield data
                else:
                    yield read_plain(path, max_bytes=MAX_FILE_BYTES)
            except (OSError, ValueError) as error:
                raise DataError(
                    f"{path} cannot be read ({error}); download it again, or fewer at once"
                ) from error


def _is_result(name: str) -> bool:
    return name.endswith(TEXTS) and not name.endswith("metadata.json")


def _in_utf8(data: bytes) -> bytes:
    """Return a file's text; editors on Windows save what people send with a mark, or as UTF-16."""
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace").encode()
    return data.removeprefix(BOM_UTF8)


@dataclass(frozen=True, eq=False)
class _ReadyRun:
    """A run that can be recorded: whose it is, how it ended ("" where it did not)."""

    run: Run
    arrival: Arrival
    outcome: str
    begun_ms: float

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Order of runs: complete ones, then ended ones, then the others, each in order of time.

        The ledger gets its entries in this order, and of one person the first run counts.
        """
        return self.outcome != DONE, not self.outcome, self.begun_ms


class _People:
    """Index of the people who have a session, by their identifier at a panel or in a link."""

    def __init__(
        self, base: Request, ledger: Ledger, identity_of: Callable[[str], Mapping[str, str] | None]
    ) -> None:
        self._base, self._ledger = base, ledger
        self._labels: dict[tuple[str, str], str] = {}
        for entry in ledger.list():
            if entry.status != "active" or not self._has_session(entry):
                continue
            self._labels[LINK, entry.label] = entry.label
            who = identity_of(entry.label)
            if who and who.get("identifier"):
                self._labels[who.get("panel", ""), who["identifier"]] = entry.label

    def with_label(self, arrival: Arrival) -> Arrival:
        """Return the arrival, with the ledger's label if a link names an entry."""
        if arrival.panel != LINK:
            return arrival
        try:
            return replace(arrival, identifier=self._ledger.resolve(arrival.identifier).label)
        except LedgerError:
            return arrival

    def label_of(self, arrival: Arrival) -> str:
        """Return the label of a person who has a session; "" if they have none."""
        if not arrival.identifier:
            return ""
        return self._labels.get((arrival.panel, arrival.identifier), "")

    def registered(self, arrival: Arrival) -> Participant | None:
        """Return the ledger's entry that a link names; None for a new person."""
        entries = self._ledger.list() if arrival.panel == LINK else ()
        return next((e for e in entries if e.label == arrival.identifier), None)

    def add(self, arrival: Arrival, label: str) -> None:
        """Learn that somebody has a session now."""
        self._labels[LINK, label] = label
        if arrival.identifier:
            self._labels[arrival.panel, arrival.identifier] = label

    def _has_session(self, entry: Participant) -> bool:
        folder = self._ledger.path.parent / f"sub-{entry.label}"
        return any(folder.glob("ses-*/manifest.json"))


def _sessions_by_run(study_folder: Path) -> dict[str, Path]:
    """Return the existing sessions by the key of their run."""
    sessions = {}
    for manifest in study_folder.glob("sub-*/ses-*/manifest.json"):
        origin = read_manifest(manifest.parent).configuration.get(IMPORT_KEY)
        if isinstance(origin, Mapping):
            sessions[str(origin.get("run"))] = manifest.parent
    return sessions


def _is_over(session: Path) -> bool:
    """Return whether a session has ended, and was not only left before its end."""
    part = read_manifest(session).parts[-1]
    return part.status == "complete" or part.reason in ENDED_EARLY


def _record_rest(base: Request, store: FilmStore, one: _ReadyRun, session: Path) -> bool:
    """Record the lines of a run that are new since its last import; return whether it had any."""
    past = replace(past_of(Recording(session)), broken_by="")
    opening_count = sum(payload["kind"] == "opened" for _, _, payload in past.events)
    last_event_number = max((int(p["n"]) for _, _, p in past.events if "n" in p), default=0)
    lines = one.run.lines_after(opening_count, last_event_number)
    if not lines:
        return False
    clock = StampClock(unix_ms(lines[0].get("at_ms"), "at_ms"))
    folder, _ = open_session(session)
    with folder:
        manifest = folder.manifest
        request = replace(
            base,
            person=SessionPerson(
                manifest.participant,
                one.run.place,
                experiment_of(base).plan(one.run.place, base.seed).group,
                consent_version=manifest.consent_version,
            ),
            clock=clock,
        )
        _record(request, store, folder, replace(one.run, lines=lines), past, one.outcome)
    return True


class _NullRecorder:
    """A recorder that writes nothing."""

    def event(self, name: str, t_ns: int, **content: object) -> None: ...

    def trial(self, row: Mapping[str, Any]) -> None: ...


def _check_run(base: Request, store: FilmStore, run: Run) -> str:
    """Feed a run's replies to the study's course; return how it ended, "" if it did not.

    Raises:
        PageError: it is of another study or version, or the course would show other steps.
    """
    header, ours = run.header, {"format": FORMAT, "study": base.study.name, "seed": base.seed}
    for name, our_value in ours.items():
        if header.get(name) != our_value:
            raise PageError(
                f"its {name} is {str(header.get(name))[:40]!r}, but here it is {our_value!r}"
            )
    steps = steps_of_place(base, store, run.place)
    if digest_of(steps) != header.get("sha256"):
        raise PageError(
            "what it was shown is not what this study shows now; import it with the study's files "
            "and options (--set, --language) as they were when the bundle was written"
        )
    clock = StampClock(run.begun_ms)
    plan = experiment_of(base).plan(run.place, base.seed)
    describe = files_of(store, experiment_of(base))[0]
    visit = replace(visit_of(base, describe, run.place, plan.group), now_ns=clock.now_ns)
    recorder: Any = _NullRecorder()
    desk = PageDesk(course(visit), recorder, clock, visit.notes)
    step_index, number_shown = 0, desk.step_number
    for line in _replay_lines(desk, clock, run):
        if desk.is_over:
            continue
        if desk.step_number != number_shown:
            step_index, number_shown = _following(steps, step_index, line), desk.step_number
        if step_index >= len(steps) or _plain(desk.step) != _plain(steps[step_index]):
            raise PageError(f"step {desk.step_number} was not what the study would have shown then")
    return desk.outcome


def _following(steps: Sequence[PageStep], index: int, line: Mapping[str, Any]) -> int:
    """Return the index of the next step; a film that failed ends its trial."""
    has_failed = line["event"]["reply"].get("failed") is not None
    trial = _trial_of(steps[index])
    index += 1
    while has_failed and index < len(steps) and _trial_of(steps[index]) == trial:
        index += 1
    return index


def _trial_of(step: PageStep) -> tuple[Any, Any]:
    return step.content.get("trial"), step.content.get("is_practice")


def _plain(step: PageStep) -> Any:
    return step.kind, json.loads(json.dumps(dict(step.content)))


def _replay_lines(desk: PageDesk, clock: StampClock, run: Run) -> Iterator[Mapping[str, Any]]:
    """Pass a run's lines to a desk at their times; yield each line afterwards."""
    for line in run.lines:
        clock.tell(unix_ms(line.get("at_ms"), "at_ms"))
        if "opened" in line:
            opening = mapping(line["opened"], "opened")
            about = opening.get("about")
            desk.hello(
                str(opening.get("tab", ""))[:200],
                takes_over=True,
                about=about if isinstance(about, Mapping) else {},
                at_ms=number(opening.get("at_ms"), "at_ms"),
            )
        elif "event" in line and not desk.is_over:
            desk.take(str(line.get("tab", ""))[:200], [line["event"]])
        yield line


def _import(
    base: Request,
    store: FilmStore,
    ledger: Ledger,
    one: _ReadyRun,
    registered: Participant | None,
    identify: Callable[[str, Mapping[str, str]], None],
) -> tuple[str, Path, int]:
    run = one.run
    experiment, clock = experiment_of(base), StampClock(run.begun_ms)
    group = experiment.plan(run.place, base.seed).group
    entry = registered or ledger.add(index=_free_place(base, ledger, run.place, group), group=group)
    if one.arrival.identifier and one.outcome != DECLINED:
        identify(entry.label, one.arrival.identity)
    request = replace(
        base,
        person=SessionPerson(entry.label, run.place, group, consent_version=entry.consent_version),
        clock=clock,
    )
    manifest = manifest_of(request, experiment, plan_of(request, experiment))
    of_bundle = {"run": run.key, "bundle": str(run.header.get("bundle"))}
    manifest = replace(manifest, configuration={**manifest.configuration, IMPORT_KEY: of_bundle})
    with create_session(base.config.data_root, manifest) as folder:
        _record(request, store, folder, run, None, one.outcome)
        return entry.label, folder.path, entry.index


def _record(
    request: Request,
    store: FilmStore,
    folder: SessionFolder,
    run: Run,
    past: EarlierParts | None,
    outcome: str,
) -> None:
    """Record a part of a session from lines of a run, by their own times."""
    clock = request.clock
    assert isinstance(clock, StampClock)  # noqa: S101  # both callers made it
    part_dir = begin_part(clock, folder)
    recorder: Recorder | None = None
    try:
        recorder = Recorder(
            part_dir,
            clock,
            threaded=False,
            max_batch_ns=REAL_TIME_BATCH_NS,
            is_simulated=is_simulated(request.config),
        )
        experiment = experiment_of(request)
        plan = plan_of(request, experiment)
        session = page_session_of(request, experiment, plan, store, folder, recorder, past, run.key)
        for _ in _replay_lines(session.desk, clock, run):
            pass
    except BaseException as error:
        end_part(clock, folder, recorder, "aborted", str(error) or repr(error), error)
        raise
    status, why = _ending(outcome)
    end_part(clock, folder, recorder, status, why, None)


def _ending(outcome: str) -> tuple[CloseStatus, str]:
    if not outcome:
        return "aborted", LEFT
    why = ENDINGS.get(outcome, "").partition(";")[0]
    return ("aborted" if why else "complete"), why


def _free_place(base: Request, ledger: Ledger, place: int, group: str) -> int:
    """Return the place, or if it is taken the next free one of the same group."""
    taken_places = {entry.index for entry in ledger.list() if not entry.has_freed_place}
    if place not in taken_places:
        return place
    experiment = experiment_of(base)
    for index in range(max(taken_places) + 1, max(taken_places) + 1 + MAX_PLACES_LOOKED_AT):
        if experiment.plan(index, base.seed).group == group:
            return index
    raise DataError(f"there is no free place of group {group!r}")

"""Read what people did with a bundle, and record it as if they had been served.

Every line says whose it is and its number. Lines that were handed over twice count once. Before
anything is written, the replies lead the study's own course, step by step beside the bundle's.
"""

import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from lab.clock import ToldClock
from lab.errors import DataError, LabError
from lab.plain_files import MAX_UNPACKED_BYTES, parse_json, read_plain
from protocol.ledger import Ledger
from recording.folder import create_session
from recording.manifest import read_manifest
from recording.writer import REAL_TIME_BATCH_NS, CloseStatus, Recorder
from visavis.page.arrivals import Arrival, arrival_of
from visavis.page.course import WITHDRAWN, course
from visavis.page.desk import PageDesk
from visavis.page.elsewhere.bundle import FORMAT, digest_of, steps_of_place, visit_of
from visavis.page.errors import PageError
from visavis.page.film_store import FilmStore
from visavis.page.perform import ENDINGS, experiment_of, held_of, manifest_of
from visavis.page.reception import LEFT
from visavis.page.steps import PageStep, count, mapping, number
from visavis.sessions.perform import Request, end_part
from visavis.sessions.rig import is_simulated

IMPORTED: Final = "imported"
"""Where a session's configuration says which run of which bundle it was."""
ARCHIVES: Final = (".zip", ".jrzip")
TEXTS: Final = (".jsonl", ".txt", ".json")
MAX_PLACES_LOOKED_AT: Final = 1000


@dataclass(frozen=True, eq=False)
class Run:
    """What one person did with a bundle: how they came, and their lines in order."""

    key: str
    arrived: Mapping[str, Any]
    lines: tuple[Mapping[str, Any], ...]

    @property
    def place(self) -> int:
        """Which place of the plan they had, from 0."""
        return count(self.arrived.get("place"), "place")

    @cached_property
    def begun_ms(self) -> float:
        """When they came, in milliseconds since 1970."""
        return number(self.lines[0].get("at_ms"), "at_ms")

    @cached_property
    def arrival(self) -> Arrival:
        """Who they are to a panel."""
        told = mapping(self.arrived.get("told", {}), "told")
        return arrival_of({name: str(value) for name, value in told.items()})


@dataclass
class Imported:
    """What came of files of results: sessions by label, and what was left out and why."""

    sessions: dict[str, Path]
    known: int = 0
    unfinished: int = 0
    withdrawn: tuple[str, ...] = ()
    moved: tuple[str, ...] = ()
    """Who had a place that somebody has, and stands at another one in the ledger."""
    refused: tuple[str, ...] = ()
    unreadable: int = 0


def read_runs(paths: Iterable[Path]) -> tuple[list[Run], int]:
    """Return the runs of files, folders and archives, and how many lines could not be read.

    Raises:
        DataError: a file is not there, is damaged or too large, or none holds results of a bundle.
    """
    lines: dict[str, dict[int, Mapping[str, Any]]] = {}
    unreadable = 0
    for text in _texts(paths):
        for line in filter(None, map(str.strip, text.splitlines())):
            try:
                told = parse_json(line)
                key, its = str(told["run"]), int(told["line"])
            except (ValueError, TypeError, KeyError, OverflowError):
                unreadable += 1
                continue
            lines.setdefault(key, {}).setdefault(its, told)
    runs = []
    for key, of_run in lines.items():
        first = of_run.get(0, {}).get("arrived")
        if not isinstance(first, Mapping):
            unreadable += len(of_run)
            continue
        runs.append(Run(key, first, tuple(of_run[n] for n in sorted(of_run))))
    if not runs:
        raise DataError("there are no results of a bundle in these files")
    return runs, unreadable


def import_runs(
    base: Request,
    store: FilmStore,
    ledger: Ledger,
    runs: Iterable[Run],
    *,
    identify: Callable[[str, Mapping[str, str]], None],
    unfinished_too: bool = False,
) -> Imported:
    """Record every run that is not recorded yet; who is who goes to `identify`, not to the data."""
    made = Imported({})
    known = _recorded(ledger.path.parent)
    fit = []
    for run in runs:
        if run.key in known:
            made.known += 1
            continue
        try:
            fit.append((run.begun_ms, run.arrival, run))
        except PageError as error:
            made.refused += (f"run {run.key[:8]}: {error}",)
    for _, arrival, run in sorted(fit, key=lambda one: one[0]):
        try:
            outcome = _checked(base, store, run)
            if outcome == WITHDRAWN:
                made.withdrawn += (run.key,)
            elif not outcome and not unfinished_too:
                made.unfinished += 1
            else:
                label, path, place = _import(base, store, ledger, run, arrival, outcome, identify)
                made.sessions[label] = path
                made.moved += () if place == run.place else (label,)
        except (PageError, LabError) as error:
            made.refused += (f"run {run.key[:8]}: {error}",)
    return made


# ---- within ----------------------------------------------------------------------------------


def _texts(paths: Iterable[Path]) -> Iterator[str]:
    for path in paths:
        if path.is_dir():
            yield from _texts(sorted(p for p in path.rglob("*") if p.suffix in ARCHIVES + TEXTS))
        elif not path.is_file():
            raise DataError(f"there is no file {path}")
        else:
            try:
                yield from (
                    _packed(path)
                    if zipfile.is_zipfile(path)
                    else [_text(read_plain(path, max_bytes=MAX_UNPACKED_BYTES))]
                )
            except (
                OSError, ValueError, LookupError, EOFError, RuntimeError, struct.error,
                zipfile.BadZipFile, zlib.error,
            ) as error:  # fmt: skip
                raise DataError(f"{path} cannot be read ({error}); download it again") from error


def _packed(path: Path) -> list[str]:
    """Return the texts of results in an archive, no larger together than a file may be."""
    found, left = [], MAX_UNPACKED_BYTES
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            if name.endswith(TEXTS) and not name.endswith("metadata.json"):
                with archive.open(name) as file:
                    data = file.read(left + 1)
                left -= len(data)
                if left < 0:
                    raise ValueError(f"it unpacks to more than {MAX_UNPACKED_BYTES} bytes")
                found.append(_text(data))
    return found


def _text(data: bytes) -> str:
    return data.decode("utf-8", errors="replace")


def _recorded(study_folder: Path) -> set[str]:
    """Return the runs that have a session already."""
    found = set()
    for manifest in study_folder.glob("sub-*/ses-*/manifest.json"):
        told = read_manifest(manifest.parent).configuration.get(IMPORTED)
        if isinstance(told, Mapping):
            found.add(str(told.get("run")))
    return found


class _Nobody:
    """Writes nothing down."""

    def event(self, name: str, t_ns: int, **content: object) -> None: ...

    def trial(self, row: Mapping[str, Any]) -> None: ...


def _checked(base: Request, store: FilmStore, run: Run) -> str:
    """Lead the study's course by a run's replies; return how it ended, "" where it did not.

    Raises:
        PageError: it is of another study or version, or the course would have gone elsewhere.
    """
    told, ours = run.arrived, {"format": FORMAT, "study": base.study.name, "seed": base.seed}
    for name, wanted in ours.items():
        if told.get(name) != wanted:
            raise PageError(f"it is of {name} {str(told.get(name))[:40]!r}, here is {wanted!r}")
    steps = steps_of_place(base, store, run.place)
    if digest_of(steps) != told.get("sha256"):
        raise PageError(
            "what it was shown is not what this study shows now; import it with the study's files "
            "and options (--set, --language) as they were when the bundle was written"
        )
    clock = ToldClock(run.begun_ms)
    plan = experiment_of(base).plan(run.place, base.seed)
    visit = replace(visit_of(base, store.told, run.place, plan.group), now_ns=clock.now_ns)
    recorder: Any = _Nobody()
    desk = PageDesk(course(visit), recorder, clock, visit.notes)
    shown, number_shown = 0, desk.step_number
    for line in _led(desk, clock, run):
        if desk.is_over:
            continue
        if desk.step_number != number_shown:
            shown, number_shown = _following(steps, shown, line), desk.step_number
        if shown >= len(steps) or _plain(desk.step) != _plain(steps[shown]):
            raise PageError(f"step {desk.step_number} was not what the study would have shown then")
    return desk.outcome


def _following(steps: Sequence[PageStep], index: int, line: Mapping[str, Any]) -> int:
    """Return which step followed; a film that failed ends its trial."""
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


def _led(desk: PageDesk, clock: ToldClock, run: Run) -> Iterator[Mapping[str, Any]]:
    """Give a desk what a page did, at its times; yields each line after it."""
    for line in run.lines:
        clock.tell(number(line.get("at_ms"), "at_ms"))
        if "opened" in line:
            opened = mapping(line["opened"], "opened")
            about = opened.get("about")
            desk.hello(
                str(opened.get("tab", ""))[:200],
                takes_over=True,
                about=about if isinstance(about, Mapping) else {},
                at_ms=number(opened.get("at_ms"), "at_ms"),
            )
        elif "event" in line and not desk.is_over:
            desk.take(str(line.get("tab", ""))[:200], [line["event"]])
        yield line


def _import(
    base: Request,
    store: FilmStore,
    ledger: Ledger,
    run: Run,
    arrival: Arrival,
    outcome: str,
    identify: Callable[[str, Mapping[str, str]], None],
) -> tuple[str, Path, int]:
    experiment, clock = experiment_of(base), ToldClock(run.begun_ms)
    group = experiment.plan(run.place, base.seed).group
    entry = ledger.add(index=_free_place(base, ledger, run.place, group), group=group)
    if arrival.identifier:
        identify(entry.label, arrival.identity)
    request = replace(
        base, participant_label=entry.label, participant_index=run.place, group=group,
        consent_version=entry.consent_version, clock=clock,
    )  # fmt: skip
    manifest = manifest_of(request, experiment)
    of_bundle = {"run": run.key, "bundle": str(run.arrived.get("bundle"))}
    manifest = replace(manifest, configuration={**manifest.configuration, IMPORTED: of_bundle})
    with create_session(base.config.data_root, manifest) as folder:
        part_dir = folder.begin_part(clock)
        recorder: Recorder | None = None
        try:
            recorder = Recorder(part_dir, clock, threaded=False, max_batch_ns=REAL_TIME_BATCH_NS,
                                is_simulated=is_simulated(base.config))  # fmt: skip
            held = held_of(request, experiment, store, folder, recorder, None, run.key)
            for _ in _led(held.desk, clock, run):
                pass
        except BaseException as error:
            end_part(clock, folder, recorder, "aborted", str(error) or repr(error), error)
            raise
        status, why = _ending(outcome)
        end_part(clock, folder, recorder, status, why, None)
        return entry.label, folder.path, entry.index


def _ending(outcome: str) -> tuple[CloseStatus, str]:
    if not outcome:
        return "aborted", LEFT
    why = ENDINGS.get(outcome, "").partition(";")[0]
    return ("aborted" if why else "complete"), why


def _free_place(base: Request, ledger: Ledger, wanted: int, group: str) -> int:
    """Return the place, or where somebody has it the next free one of the same group."""
    taken = {entry.index for entry in ledger.list() if not entry.has_freed_place}
    if wanted not in taken:
        return wanted
    experiment = experiment_of(base)
    for index in range(max(taken) + 1, max(taken) + 1 + MAX_PLACES_LOOKED_AT):
        if experiment.plan(index, base.seed).group == group:
            return index
    raise DataError(f"there is no free place of group {group!r}")

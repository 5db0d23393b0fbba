"""A study on another web host: its bundle in a real browser, and its results as recordings."""

import base64
import contextlib
import functools
import hashlib
import http.server
import json
import threading
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.running.page.pages import config
from visavis.lab.clock import StopWatch, SystemClock
from visavis.lab.errors import DesignError, UsageError
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.plan.experiment import no_progress
from visavis.protocol.session.operator import UnattendedOperator
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.film_store import FILM_QUALITY, FilmStore, film_store
from visavis.running.page.other_hosts.bundle import (
    completed_places,
    open_places,
    steps_of_place,
    write_bundle,
)
from visavis.running.page.other_hosts.results import import_runs, read_runs
from visavis.running.page.perform import DRAWN_EVENT, experiment_of
from visavis.running.page.spoken_digits import hear_digits, spoken_digits
from visavis.running.sessions.session_request import Request, SessionPerson
from visavis.study.experiment import StudyExperiment

PATIENCE_S = 60.0
STUDY = """
from visavis import Factor, Number, Rating, Study

study = Study("apart", factors=[Factor("place", [1, 2, 3, 4])], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
    yield t.ask(Number("share", "%", low=0, high=100))
"""
BRANCHING = """
from visavis import Factor, Rating, Study

study = Study("apart", factors=[Factor("place", [1, 2])], on="browser", uses=(), calibrate=False)


@study.trial
def trial(t):
    given = yield t.ask(Rating("answer", 1, 9))
    if given.option == "9":
        yield t.ask(Rating("again", 1, 9))
"""


FILMS = """
from visavis import Factor, Film, Number, Rating, Scene, Study

study = Study("apart", factors=[Factor("motion", ["idle", "wave"])], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    film = Film(Scene("person", motion=t.motion), 0.5, size_px=(160, 160), rate_hz=30)
    yield t.watch(film, Rating("answer", 1, 9))
    yield t.ask(Number("share", "%", low=0, high=100))
"""


class Host:
    """A study with a lab of its own, exported and imported."""

    def __init__(self, root: Path, text: str = STUDY) -> None:
        self.root = root
        file = root / "apart.py"
        file.write_text(text, "utf-8")
        study: Any = find_study(str(file))
        experiment = study.experiment({})
        assert isinstance(experiment, StudyExperiment)
        self.base = Request(
            study=study,
            experiment=experiment,
            config=config(root),
            person=SessionPerson("", 0),
            seed=7,
            clock=SystemClock(),
            operator=UnattendedOperator(),
            on="browser",
        )
        self.store: FilmStore = film_store(experiment)
        self.who: dict[str, Any] = {}
        folder = self.base.config.data_root / "simulated" / "apart"
        folder.mkdir(parents=True)
        self.ledger = Ledger(folder, SystemClock(), prefix="S")

    def export(self, name: str = "bundle", **options: Any) -> Path:
        path = self.root / name
        write_bundle(self.base, self.store, path, **{"places": 3, **options})
        return path

    def take_in(self, *files: Path, **options: Any) -> Any:
        runs, _ = read_runs(files)
        return import_runs(
            self.base,
            self.store,
            self.ledger,
            runs,
            identify=self.who.__setitem__,
            identity_of=self.who.get,
            **options,
        )


@pytest.fixture
def host(tmp_path: Path) -> Host:
    return Host(tmp_path)


def lines_of(
    bundle: Path,
    place: int,
    *,
    key: str = "r1",
    replies: int = 99,
    parameters: dict[str, str] | None = None,
) -> list[dict[str, Any]]:
    """Return what a page hands over that answers every step by its first option."""
    about = json.loads((bundle / "bundle.json").read_text("utf-8"))
    steps = json.loads((bundle / "places" / f"{place}.json").read_text("utf-8"))
    head = {n: about[n] for n in ("format", "study", "seed")}
    arrived = {**head, "bundle": about["id"], "place": place, "sha256": steps["sha256"]}
    lines: list[dict[str, Any]] = [
        {"arrived": {**arrived, "parameters": parameters or {}}},
        {"opened": {"tab": "t", "at_ms": 10.0, "about": {}}},
    ]
    for n, step in enumerate(steps["steps"][:replies], start=1):
        at_ms = 1000.0 * n
        answers = {
            q["name"]: {
                "option": (q.get("options") or [{"value": "5"}])[0]["value"],
                "at_ms": at_ms,
                "by": "keys",
            }
            for q in step.get("questions", ())
        }
        reply = {"shown_ms": at_ms - 700, "hidden_ms": 0.0, "answers": answers}
        event = {"n": n, "kind": "reply", "at_ms": at_ms, "step": n, "reply": reply}
        lines.append({"tab": "t", "event": event})
    begun_ms = 1_800_000_000_000.0
    return [
        {"run": key, "line": k, "at_ms": begun_ms + 1000.0 * k, **line}
        for k, line in enumerate(lines)
    ]


def write(path: Path, *runs: list[dict[str, Any]]) -> Path:
    path.write_text("".join(f"{json.dumps(line)}\n" for run in runs for line in run), "utf-8")
    return path


def test_what_people_did_elsewhere_becomes_a_session_like_any_other(host: Host) -> None:
    bundle = host.export()
    lines = lines_of(bundle, 1, parameters={"PROLIFIC_PID": "5f3a99c"})
    results = write(host.root / "r.jsonl", [*lines[:3], *lines])  # some came twice
    intake = host.take_in(results)
    assert () == intake.refused_runs
    ((label, path),) = intake.sessions.items()
    recording = Recording(path)
    assert "complete" == recording.status
    rows = recording.trials()
    assert [1.0] * 4 == list(rows["answer"])
    assert [5.0] * 4 == list(rows["share"])
    assert [700.0] * 4 == list(rows["answer_ms"])
    assert host.base.experiment.plan(1, 7).trials[0].factors["place"] == rows["place"].iloc[0]
    assert recording.manifest.created_wall_iso.startswith("2027-01-15T08:00:00")
    assert [1] == [entry.index for entry in host.ledger.list()]
    assert {label: {"panel": "Prolific", "identifier": "5f3a99c"}} == host.who
    assert all(b"5f3a99c" not in p.read_bytes() for p in path.rglob("*") if p.is_file())

    again = host.take_in(results)
    assert (1, {}) == (again.recorded_before, again.sessions)


def test_a_place_that_two_people_had_loses_nobody(host: Host) -> None:
    bundle = host.export()
    intake = host.take_in(
        write(host.root / "r.txt", lines_of(bundle, 2), lines_of(bundle, 2, key="r2"))
    )
    assert 2 == len(intake.sessions)
    assert [2, 3] == [entry.index for entry in host.ledger.list()]
    assert (list(intake.sessions)[1],) == intake.moved_labels
    plans = [Recording(path).manifest.plan for path in intake.sessions.values()]
    assert plans[0] == plans[1]


def test_who_left_is_recorded_when_asked_for_and_who_withdrew_never(host: Host) -> None:
    bundle = host.export()
    left, gone = lines_of(bundle, 0, replies=4), lines_of(bundle, 1, key="r2", replies=4)
    gone[-1]["event"]["reply"] = {"stop": "delete", "hidden_ms": 0.0}
    results = write(host.root / "r.jsonl", left, gone)
    intake = host.take_in(results)
    assert ({}, 1, ("r2",)) == (intake.sessions, intake.unfinished, intake.withdrawn_runs)
    intake = host.take_in(results, unfinished_too=True)
    (path,) = intake.sessions.values()
    assert ("aborted", 1) == (Recording(path).status, len(Recording(path).trials()))


def test_who_was_recorded_unfinished_goes_on_in_the_same_session_once_more_is_there(
    host: Host,
) -> None:
    bundle = host.export()
    unfinished = host.take_in(
        write(host.root / "r.jsonl", lines_of(bundle, 0, replies=5)), unfinished_too=True
    )
    later = lines_of(bundle, 0)
    later.insert(
        7,
        {
            "run": "r1",
            "line": 7,
            "at_ms": later[6]["at_ms"] + 500,
            "opened": {"tab": "t", "at_ms": 5200.0, "about": {}},
        },
    )
    for n, line in enumerate(later):
        line["line"] = n
    results = write(host.root / "r.jsonl", later)
    intake = host.take_in(results)
    assert ((), {}) == (intake.refused_runs, intake.sessions)
    assert unfinished.sessions == intake.continued_sessions
    (path,) = intake.continued_sessions.values()
    recording = Recording(path)
    assert "complete" == recording.status
    rows = recording.trials()
    assert [1.0] * 4 == list(rows["answer"])
    assert [5.0] * 4 == list(rows["share"])
    assert [""] * 4 == list(rows["flags"].fillna(""))
    replies = [e["n"] for e in recording.events()["payload"] if e.get("kind") == "reply"]
    assert sorted(set(replies)) == replies
    assert [0] == [entry.index for entry in host.ledger.list()]
    again = host.take_in(results)
    assert (1, {}, {}) == (again.recorded_before, again.sessions, again.continued_sessions)


def test_one_identifier_in_two_browsers_is_one_participant_whose_whole_run_counts(
    host: Host,
) -> None:
    bundle, who = host.export(), {"PROLIFIC_PID": "5f3a99c"}
    first = lines_of(bundle, 0, replies=4, parameters=who)
    whole, third = (lines_of(bundle, k, key=f"r{k + 1}", parameters=who) for k in (1, 2))
    intake = host.take_in(write(host.root / "r.jsonl", first, whole, third), unfinished_too=True)
    ((label, path),) = intake.sessions.items()
    assert "r2" == Recording(path).manifest.configuration["imported"]["run"]
    assert {("r1", label), ("r3", label)} == {*intake.twice}
    later = host.take_in(write(host.root / "r.jsonl", third))
    assert ({}, (("r3", label),)) == (later.sessions, later.twice)
    assert 1 == len(host.ledger.list())


def test_a_link_that_names_somebody_of_the_ledger_is_recorded_as_theirs(host: Host) -> None:
    host.ledger.add()
    entry = host.ledger.add()
    bundle = host.export()
    intake = host.take_in(
        write(
            host.root / "r.jsonl",
            lines_of(bundle, 1, parameters={"participant": "2"}),
            lines_of(bundle, 2, key="r2", parameters={"participant": entry.label}),
            lines_of(bundle, 2, key="r3", parameters={"participant": "2H-99"}),
        )
    )
    assert (("r2", entry.label),) == intake.twice
    assert [entry.label, host.ledger.list()[2].label] == list(intake.sessions)
    assert "complete" == Recording(intake.sessions[entry.label]).status
    assert () == intake.refused_runs


PLACEHOLDER = {"id": "{{%ID%}}"}
"""What a panel left in the address in place of an identifier."""


@pytest.mark.parametrize(
    ("spoil", "refusal"),
    [
        (lambda lines: lines[0]["arrived"].update(seed=8), "seed"),
        (lambda lines: lines[0]["arrived"].update(sha256="0"), "is not what this study shows"),
        (lambda lines: lines.pop(4), "one is missing"),
        (lambda lines: lines[3]["event"]["reply"].update(answers={}), "not an object"),
        (lambda lines: lines[3].update(at_ms="x"), "at_ms"),
        (lambda lines: lines[0].pop("at_ms"), "at_ms"),
        (lambda lines: lines[0].update(at_ms=990_000_000_000_000.0), "between 1970 and 2200"),
        (lambda lines: lines[-1].update(at_ms=990_000_000_000_000.0), "between 1970 and 2200"),
        (lambda lines: lines[3]["event"].update(at_ms=1e14), "at_ms is"),
        (lambda lines: lines[3].update(event=[]), "not an object"),
        (lambda lines: lines[3]["event"].update(reply=None), "not an object"),
        (lambda lines: lines[3]["event"].update(n="x"), "counts nothing"),
        (lambda lines: lines[2].pop("tab"), "another tab"),
        (lambda lines: lines[0]["arrived"].update(place="x"), "place"),
        (lambda lines: lines[0]["arrived"].update(parameters=PLACEHOLDER), "not an identifier"),
        (lambda lines: lines[0]["arrived"].update(told=PLACEHOLDER), "not an identifier"),  # 0.2
    ],
)
def test_results_that_do_not_fit_are_left_out_whole_with_the_reason(
    host: Host, spoil: Any, refusal: str
) -> None:
    bundle = host.export()
    lines = lines_of(bundle, 0)
    spoil(lines)
    other = lines_of(bundle, 1, key="r2")
    intake = host.take_in(write(host.root / "r.jsonl", lines, other))
    assert refusal in intake.refused_runs[0]
    assert (1, 1) == (len(intake.sessions), len(host.ledger.list()))


def test_a_study_whose_steps_depend_on_answers_cannot_be_written_down(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match=r"depends on answers .*visavis serve"):
        Host(tmp_path, BRANCHING).export()


def test_a_folder_that_is_there_is_not_written_over(host: Host) -> None:
    bundle = host.export()
    with pytest.raises(UsageError, match="there already"):
        host.export()
    assert 3 == len(list((bundle / "places").iterdir()))


def test_the_archive_is_a_study_as_jatos_imports_it(host: Host) -> None:
    path = host.export("apart.jzip")
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        (study,) = (n for n in names if n.endswith(".jas"))
        export = json.loads(archive.read(study))
        page = archive.read("visavis_apart/index.html").decode()
    assert "3" == export["version"]
    (component,) = export["data"]["componentList"]
    assert ("index.html", True) == (component["htmlFilePath"], component["reloadable"])
    assert {
        f"{export['data']['dirName']}/{n}" for n in ("page.js", "wire.js", "places/2.json")
    } <= {*names}
    assert '<script src="jatos.js">' in page
    assert not list(host.root.glob(".*.draft"))


def test_what_jatos_exports_is_read(host: Host) -> None:
    bundle = host.export()
    text = write(host.root / "r", lines_of(bundle, 0)).read_text("utf-8")
    archive_path = host.root / "results.jrzip"
    with zipfile.ZipFile(archive_path, "w") as archive:
        archive.writestr("metadata.json", "{}")
        archive.writestr("study_result_1/comp-result_1/data.txt", text)
        archive.writestr("study_result_1/comp-result_2/data.txt", text[:300])  # of a reload, cut
    runs, unreadable = read_runs([archive_path])
    assert ([0], 1) == ([run.place for run in runs], unreadable)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_results_that_an_editor_saved_anew_are_read(host: Host, encoding: str) -> None:
    path = write(host.root / "r.jsonl", lines_of(host.export(), 0))
    path.write_text(path.read_text("utf-8"), encoding)
    runs, unreadable = read_runs([path])
    assert ([0], 0) == ([run.place for run in runs], unreadable)


def test_two_places_have_the_orders_of_the_plan(host: Host) -> None:
    first, second = (steps_of_place(host.base, host.store, k) for k in (0, 1))
    assert len(first) == len(second)
    assert [s.kind for s in first] == [s.kind for s in second]
    other = replace(host.base, seed=8)
    assert first == steps_of_place(host.base, host.store, 0)
    assert len(first) == len(steps_of_place(other, host.store, 0))


GROUPS = STUDY.replace("factors=[", 'factors=[Factor("training", ["none", "long"], between=True), ')


def places_in(bundle: Path) -> list[int]:
    return sorted(int(file.stem) for file in (bundle / "places").glob("*.json"))


def test_place_that_nobody_completed_is_given_back_by_a_second_bundle(host: Host) -> None:
    first = host.export(places=open_places(host.base, 4, None, {}))
    assert [0, 1, 2, 3] == places_in(first)
    file = write(
        host.root / "r.jsonl",
        lines_of(first, 0, key="r0"),
        lines_of(first, 2, key="r2"),
        lines_of(first, 3, key="r3", replies=1),  # left
    )
    host.take_in(file, unfinished_too=True)
    done = completed_places(host.ledger.path.parent)
    assert {0: 1, 2: 1} == done
    second = host.export("second", places=open_places(host.base, 4, None, done))
    assert [1, 3] == places_in(second)
    assert [1, 3] == json.loads((second / "bundle.json").read_text("utf-8"))["places"]
    # What comes of it is recorded as of the first, at the place that it had.
    rest = write(host.root / "s.jsonl", *[lines_of(second, k, key=f"s{k}") for k in (1, 3)])
    assert 2 == len(host.take_in(rest).sessions)
    with pytest.raises(UsageError, match="as many people as that have completed"):
        open_places(host.base, 4, None, completed_places(host.ledger.path.parent))


@pytest.mark.parametrize("done", [{}, {0: 1}, {0: 1, 1: 2, 5: 1}, {40: 1}])
def test_each_group_gets_as_many_places_as_it_lacks(tmp_path: Path, done: dict[int, int]) -> None:
    base = Host(tmp_path, GROUPS).base

    def group_of(place: int) -> str:
        return experiment_of(base).plan(place, base.seed).group

    places = open_places(base, None, 3, done)
    assert not set(places) & set(done)
    counts = Counter(map(group_of, places))
    for index, n in done.items():
        counts[group_of(index)] += n
    assert {3} == set(counts.values())
    assert 2 == len(counts)
    with pytest.raises(UsageError, match="--places takes 1 to"):
        open_places(base, None, 6000, {})


def test_one_damaged_line_leaves_the_results_of_everybody_else(host: Host) -> None:
    bundle = host.export()
    damaged = lines_of(bundle, 1, key="r2")
    damaged[0]["at_ms"] = None
    results = write(host.root / "r.jsonl", damaged, lines_of(bundle, 0))
    results.write_text(results.read_text("utf-8") + '{"run": "r3", "line": Infinity}\n', "utf-8")
    _, unreadable = read_runs([results])
    assert 1 == unreadable
    intake = host.take_in(results)
    assert (1, 1) == (len(intake.sessions), len(intake.refused_runs))


def with_damaged_films(host: Host) -> Host:
    """Return a study of films whose files are as they were built, and are no films."""
    host.store = FilmStore(host.store.makers, host.store.study_folder, host.root / "films")
    host.store.folder.mkdir()
    for film in host.base.experiment.films:
        path = host.store.folder / f"{host.store.name_of(film)}.webm"
        path.write_bytes(b"no film")
        about = {"sha256": hashlib.sha256(b"no film").hexdigest(), "renderer": "a card"}
        path.with_suffix(".json").write_text(json.dumps(about), "utf-8")
    return host


def test_whose_film_failed_is_recorded_with_that_trial_skipped(tmp_path: Path) -> None:
    host = with_damaged_films(Host(tmp_path, FILMS))
    bundle = host.export()
    steps = json.loads((bundle / "places" / "0.json").read_text("utf-8"))["steps"]
    lines = lines_of(bundle, 0)
    replies = [line for line in lines if "event" in line]
    n = 0
    for step, line in zip(steps, replies, strict=True):
        if step["kind"] == "watch" and not step["films"]:
            lines.remove(line)  # the question after a film that failed
            continue
        n += 1
        line["event"] |= {"n": n, "step": n}
        if step["kind"] == "preload":
            line["event"]["reply"] = {"films": {}, "hidden_ms": 0.0}
        elif step["kind"] == "watch":
            line["event"]["reply"] = {"shown_ms": 0.0, "failed": {"film": "f", "why": "error 4"}}
    intake = host.take_in(write(host.root / "r.jsonl", lines))
    assert () == intake.refused_runs
    (path,) = intake.sessions.values()
    rows = Recording(path).trials()
    assert ["skipped", "skipped"] == list(rows["status"])
    assert ["film f: error 4"] * 2 == list(rows["reason"])
    (drawn,) = (e for e in Recording(path).events().to_dict("records") if e["name"] == DRAWN_EVENT)
    assert (["a card"], dict(FILM_QUALITY)) == (
        drawn["payload"]["renderers"],
        drawn["payload"]["quality"],
    )


# ---- in a browser ----------------------------------------------------------------------------


@pytest.fixture
def site(host: Host) -> Iterator[tuple[Host, str]]:
    """A bundle behind a server of files that knows nothing of it."""
    with served_files(host.export()) as address:
        yield host, address


def answer(page: Any) -> None:
    """Answer what a page asks, as far as it can be done now."""
    from playwright.sync_api import Error

    with contextlib.suppress(Error):  # the page went on meanwhile
        if page.query_selector("#main input.number"):
            page.fill("#main input.number", "33")
        elif page.query_selector("#main input[type=radio]:not([disabled])"):
            page.keyboard.press("3")
        button = page.query_selector("#main button:not([disabled]):not(.quiet)")
        if button:
            button.click(timeout=2000)
    page.wait_for_timeout(80)


def answer_until(page: Any, words: str, steps: int = 60) -> None:
    """Answer what a page asks until it says something."""
    for _ in range(steps):
        if words in page.inner_text("#main"):
            return
        answer(page)
    raise AssertionError(page.inner_text("#main"))


def save(page: Any, host: Host) -> Path:
    """Save the answers that a finished page offers as a file."""
    with page.expect_download() as download:
        page.click("#main a[download]")
    results = host.root / "sent.jsonl"
    download.value.save_as(results)
    return results


def recording_of(host: Host, results: Path) -> tuple[str, Recording]:
    """Import the answers of one person; return label and session."""
    intake = host.take_in(results)
    assert () == intake.refused_runs
    ((label, path),) = intake.sessions.items()
    return label, Recording(path)


def test_a_bundle_on_a_plain_host_goes_from_beginning_to_a_file_of_answers(
    site: tuple[Host, str], browser: Any
) -> None:
    host, address = site
    page = browser.new_context(accept_downloads=True).new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(f"{address}?place=2&id=abc-123")
    page.wait_for_selector("#main button")
    while "2 of 4" not in page.inner_text("#progress"):
        answer(page)
    before = page.inner_text("#progress")
    page.reload()
    page.wait_for_selector("#main button")
    assert before == page.inner_text("#progress")
    answer_until(page, "Save my answers")
    results = save(page, host)
    assert [] == problems
    label, recording = recording_of(host, results)
    assert "complete" == recording.status
    assert [3.0] * 4 == list(recording.trials()["answer"])
    assert [33.0] * 4 == list(recording.trials()["share"])
    assert "page reloaded" in ";".join(recording.trials()["flags"])
    assert {"panel": "link", "identifier": "abc-123"} == host.who[label]


def test_who_types_what_the_page_says_has_heard_it(tmp_path: Path, browser: Any) -> None:
    host = Host(tmp_path, STUDY.replace("uses=()", 'uses=(), screening=["sound"]'))
    bundle = host.export()
    steps = json.loads((bundle / "places" / "1.json").read_text("utf-8"))["steps"]
    (wav,) = (base64.b64decode(step["wav"]) for step in steps if step["kind"] == "sound")
    digits = hear_digits(wav, spoken_digits("en", None))
    page = browser.new_context(accept_downloads=True).new_page()
    with served_files(bundle) as address:
        page.goto(f"{address}?place=2")
        page.wait_for_selector("#heard")
        assert page.query_selector("#main button:has-text('Continue')[disabled]")
        page.click("text=Play the voice")
        page.wait_for_selector("#heard:focus")  # it plays
        page.keyboard.type(digits)
        page.keyboard.press("Enter")
        answer_until(page, "Save my answers")
        results = save(page, host)
    _, recording = recording_of(host, results)
    events = recording.events()
    (checked,) = events.loc[events["name"] == "sound_checked", "payload"]
    assert {"said": digits, "heard": digits, "is_right": True, "played": 1} == checked


@contextlib.contextmanager
def served_files(folder: Path) -> Iterator[str]:
    """Serve files and nothing else."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: Any) -> None: ...

    serve = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), serve) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/index.html"
        server.shutdown()


def test_a_film_that_cannot_be_played_ends_its_trial_and_the_results_are_taken(
    tmp_path: Path, browser: Any
) -> None:
    from playwright.sync_api import Error

    host = with_damaged_films(Host(tmp_path, FILMS))
    page = browser.new_context(accept_downloads=True).new_page()
    with served_files(host.export()) as address:
        page.goto(address)
        page.wait_for_selector("#main button")
        while not page.query_selector("#main a[download]"):
            if page.query_selector("#main button.quiet"):  # the film failed: skip it
                with contextlib.suppress(Error):  # it was tried again
                    page.click("text=Go on without it", timeout=2000)
            else:
                answer(page)
        results = save(page, host)
    _, recording = recording_of(host, results)
    assert ["skipped", "skipped"] == list(recording.trials()["status"])


def test_a_page_that_is_reloaded_without_a_network_goes_on_with_its_films(
    tmp_path: Path, browser: Any
) -> None:
    host = Host(tmp_path, FILMS)
    host.store = FilmStore(host.store.makers, host.store.study_folder, tmp_path / "films")
    host.store.build(host.base.experiment.films, no_progress)
    page = browser.new_context(accept_downloads=True).new_page()
    with served_files(host.export()) as address:
        page.goto(f"{address}?place=1")
        page.wait_for_selector("#main button")
        while "1 of 2" not in page.inner_text("#progress"):
            answer(page)
    page.reload()  # nobody serves it any more
    answer_until(page, "Save my answers")
    results = save(page, host)
    _, recording = recording_of(host, results)
    rows = recording.trials()
    assert ["complete"] * 2 == list(rows["status"])
    assert (rows["film_frames"] > 0).all()


def run_of(page: Any) -> str:
    """Return which run a page shows, as its address says."""
    page.wait_for_selector("#main button")
    return str(page.url.partition("#")[2])


def test_a_second_person_at_one_computer_is_asked_whether_it_is_theirs(
    site: tuple[Host, str], browser: Any
) -> None:
    _, address = site
    context = browser.new_context()
    page = context.new_page()
    page.goto(address)
    first = run_of(page)
    while "2 of 4" not in page.inner_text("#progress"):
        answer(page)
    page.close()

    page = context.new_page()
    page.goto(address)
    assert first == run_of(page)
    mine, other = page.query_selector_all("#main button")
    assert ["Go on where I was", "I am somebody else"] == [mine.inner_text(), other.inner_text()]
    mine.click()
    page.wait_for_selector("#main input")
    assert "2 of 4" in page.inner_text("#progress")
    page.close()

    page = context.new_page()
    page.goto(address)
    page.wait_for_selector("#main button.quiet").click()
    page.wait_for_url(lambda url: "#" in url and first not in url)
    while "of 4" not in page.inner_text("#progress"):
        answer(page)
    assert "1 of 4" in page.inner_text("#progress")


def test_a_link_of_a_panel_opened_again_goes_on_and_a_placeholder_is_refused(
    site: tuple[Host, str], browser: Any
) -> None:
    _, address = site
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"{address}?PROLIFIC_PID=5f3a99c")
    first = run_of(page)
    answer(page)
    page.close()
    page = context.new_page()
    page.goto(f"{address}?PROLIFIC_PID=5f3a99c&SESSION_ID=2")
    assert first == run_of(page)
    page.close()
    page = context.new_page()
    page.goto(f"{address}?PROLIFIC_PID=other")
    assert first != run_of(page)
    page.goto("about:blank")
    page.goto(address + "?PROLIFIC_PID={{%PROLIFIC_PID%}}")
    page.wait_for_selector("#main h1")
    assert "#" not in page.url
    assert [] == page.query_selector_all("#main button")


JATOS = """
const empty = '{"lines": "", "batch": {}, "ended": []}';
const store = JSON.parse(sessionStorage.getItem("jatos") || empty);
const keep = () => sessionStorage.setItem("jatos", JSON.stringify(store));
let isEnding = false;
const ending = (act) => {
  if (isEnding) throw "Can end/abort study only once.";
  isEnding = true;
  if (!store.failed) { store.failed = true; keep(); throw "GET to end failed: 0"; }
  act(); keep();
};
window.jatos = {
  studyResultUuid: "run-1", urlQueryParameters: { PROLIFIC_PID: "5f3a99c" },
  onLoad: (act) => setTimeout(act, 30),
  appendResultData: async (text) => {
    if (store.lines && Math.random() < 0.2) throw "500, no connection";
    store.lines += text; keep();
  },
  batchSession: {
    getAll: () => store.batch,
    set: async (name, value) => {
      if (!store.tried) { store.tried = true; throw "version"; }
      store.batch[name] = value; keep();
    },
    remove: async (path) => { delete store.batch[path.slice(1)]; keep(); },
  },
  endStudyWithoutRedirect: async (...said) => ending(() => store.ended.push(["end", ...said])),
  abortStudyWithoutRedirect: async (...said) => ending(() => {
    store.lines = ""; store.ended.push(["abort", ...said]);
  }),
};
"""
"""What jatos.js gives a component: every fifth answer fails, the first end of a run fails, too, and
an end that failed is not asked again by the same page (as in jatos.js 3.10.4)."""


def jatos_calls(page: Any) -> dict[str, Any]:
    """Return what JATOS received once the run has ended: the page is loaded anew to ask again."""
    from playwright.sync_api import Error

    watch = StopWatch()
    calls: dict[str, Any] = {"ended": []}
    while not calls["ended"]:
        assert watch.elapsed_s() < PATIENCE_S, calls
        page.wait_for_timeout(50)
        with contextlib.suppress(Error):  # it is being loaded anew
            calls = json.loads(page.evaluate("sessionStorage.getItem('jatos')"))
    return calls


@pytest.mark.parametrize("stops", [False, True])
def test_in_jatos_answers_are_handed_over_and_the_run_is_ended(
    site: tuple[Host, str], browser: Any, stops: bool
) -> None:
    host, address = site
    page = browser.new_context().new_page()
    page.add_init_script(JATOS)
    page.goto(address)
    page.wait_for_selector("#main button")
    if stops:
        page.wait_for_selector("#main button:not([disabled]):not(.quiet)").click()
        page.click("#stop")
        page.click("text=Stop, and delete my answers")
        page.wait_for_selector("text=You have stopped")
    else:
        page.reload()
        answer_until(page, "Thank you")
    calls = jatos_calls(page)
    if stops:
        assert ([["abort", "stop and delete"]], "", {}) == (
            calls["ended"],
            calls["lines"],
            calls["batch"],
        )
        return
    assert [["end", True, "done"]] == calls["ended"]
    assert 1 == len(calls["batch"])
    results = host.root / "data.txt"
    results.write_text(calls["lines"], "utf-8")
    _, recording = recording_of(host, results)
    assert [3.0] * 4 == list(recording.trials()["answer"])
    assert [0] == [entry.index for entry in host.ledger.list()]

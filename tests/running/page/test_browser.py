"""The page itself in a real browser: from consent to thanks, through reloads and kills."""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from benchmarks.page_faults.browser_kills import Chromium
from tests.commands import COMMANDS, RunningCommand
from tests.running.page.pages import STUDY
from visavis.lab.clock import StopWatch
from visavis.lab.config_files import EXAMPLE
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.running.page.desk import RELOAD_FLAG, SLEEP_FLAG
from visavis.running.page.earlier_parts import RESTART_FLAG
from visavis.running.page.server import SITE

REPOSITORY = Path(__file__).resolve().parents[3]
PATIENCE_S = 120.0
CLICK_S = 30
"""A click waits for two pictures, which a busy computer draws slowly where figures move."""
POLL_S = 0.05

pytestmark = [
    pytest.mark.slow,  # a browser, and films that are drawn
    pytest.mark.timeout(600),
]


@dataclass
class Server:
    """`visavis run --on browser` in a process of its own."""

    root: Path
    process: RunningCommand | None = None
    lines: list[str] = field(default_factory=list)

    def start(self, *arguments: str) -> str:
        """Start it and return the page's address."""
        environment = os.environ | {
            "XDG_CACHE_HOME": str(self.root / "cache"),
            "PYTHONPATH": str(REPOSITORY),
            "COLUMNS": "200",
        }
        self.process = COMMANDS.start(
            *["-m", "visavis.cli.main", *arguments, "--devices", "sim"],
            cwd=self.root,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line)
            found = re.search(r"https?://\S+", line)
            if found:
                return found.group()
        raise AssertionError("".join(self.lines))

    def kill(self) -> None:
        """Kill it as a power cut would."""
        assert self.process is not None
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def end(self) -> str:
        """Wait until it has ended by itself; return what it said."""
        assert self.process is not None
        rest, _ = self.process.communicate(timeout=PATIENCE_S)
        return "".join(self.lines) + rest


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    made = Server(tmp_path)
    yield made
    if made.process is not None:
        made.kill()


def state_of(page: Any) -> dict[str, Any]:
    """Return what a page shows."""
    found: dict[str, Any] = page.evaluate(
        """() => ({kind: document.getElementById("main").className,
                   text: document.getElementById("main").innerText})"""
    )
    return found


def step_on(page: Any, words: str = "") -> None:
    """Do one thing the page asks for, if any can be done now: the next may be another page's.

    A page that says `words` is not left: it may have come since somebody looked.
    """
    if page.query_selector("#agree") and not page.is_checked("#agree"):
        page.check("#agree")
        return
    for field_set in page.query_selector_all("fieldset"):
        radios = field_set.query_selector_all("input[type=radio]:not([disabled])")
        if radios and not field_set.query_selector("input:checked"):
            radios[len(radios) // 2].click()
            return
        slider = field_set.query_selector(".untouched input:not([disabled])")
        if slider:
            slider.focus()
            page.keyboard.press("ArrowRight")
            return
    for number in page.query_selector_all("input.number"):
        if not number.input_value():
            number.fill("33")
            return
    # The button first: once the page has gone on, it is nobody's, and a click on it fails.
    button = page.query_selector("#main button:not([disabled]):not(.quiet)")
    if button and not (words and words in state_of(page)["text"]):
        try:
            button.click(timeout=1000 * CLICK_S)
        except Exception as gone:  # of playwright, which need not be installed
            if "not attached" not in str(gone):
                raise  # else the page went on by itself meanwhile


def until(page: Any, words: str, *, steps: bool = True) -> None:
    """Go on until the page says something."""
    watch = StopWatch()
    while words not in state_of(page)["text"]:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        if steps:
            with contextlib.suppress(playwright_error()):  # the page went on meanwhile
                step_on(page, words)
        page.wait_for_timeout(POLL_S * 1000)


def playwright_error() -> type[Exception]:
    from playwright.sync_api import Error

    return Error


def test_a_browser_that_remembers_a_session_of_another_study_begins_anew(
    server: Server, browser: Any
) -> None:
    address = server.start("serve", str(STUDY), "--port", "0")
    page = browser.new_context().new_page()
    page.goto(f"{address}/page.css")
    page.evaluate("localStorage.setItem('visavis-session', 'of-another-study')")
    page.goto(address)
    page.wait_for_selector("#agree", timeout=PATIENCE_S * 1000)
    assert "of-another-study" not in page.url


ASKING = """
from visavis import Factor, Rating, Study

study = Study("asked", factors=[Factor("place", [1, 2])], on="browser", uses=(), calibrate=False)


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
"""


def test_an_answer_that_cannot_be_is_asked_again_and_the_session_goes_on(
    server: Server, browser: Any
) -> None:
    (server.root / "asked.py").write_text(ASKING, "utf-8")
    address = server.start("serve", "asked.py", "--port", "0")
    page = browser.new_context().new_page()
    spoiled: list[int] = []

    def spoil(route: Any) -> None:
        body = route.request.post_data_json
        for event in body["events"]:
            if not spoiled and "answers" in event.get("reply", {}):
                spoiled.append(event["n"])
                event["reply"]["answers"]["answer"]["option"] = "ten"
        route.continue_(post_data=json.dumps(body))

    page.route("**/api/events", spoil)
    page.goto(address)
    until(page, "Thank you")
    (path,) = (server.root / "data/simulated/asked").glob("sub-*/ses-001")
    page.wait_for_timeout(2000)
    recording = Recording(path)
    assert 1 == len(spoiled)
    assert {"5"} == set(recording.trials()["answer"].astype(int).astype(str))
    events = recording.events()
    payloads = events.loc[events["name"] == "page_event", "payload"]
    problems = [payload["what"] for payload in payloads if payload["kind"] == "problem"]
    assert ["set aside" in problem for problem in problems] == [True]


TYPING = """
from visavis import Factor, Study, Text

study = Study("typed", factors=[Factor("place", [1, 2])], on="browser", uses=(), calibrate=False)


@study.trial
def trial(t):
    yield t.ask(Text("answer"))
"""

GO_ON = """() => {
    const [agree, area] = ["#agree", "#main textarea"].map((one) => document.querySelector(one));
    if (agree && !agree.checked) agree.click();
    else if (!area || area.value)
        document.querySelector("#main button:not([disabled]):not(.quiet)")?.click();
}"""
"""Goes on, but from a page that asks for a text only once it has one: looked at and pressed at
once, or the button could be the next page's by then."""


def test_an_answer_that_was_pasted_says_so_and_one_that_was_typed_does_not(
    server: Server, browser: Any
) -> None:
    (server.root / "typed.py").write_text(TYPING, "utf-8")
    address = server.start("serve", "typed.py", "--port", "0")
    page = browser.new_context().new_page()
    page.goto(address)
    texts = iter(["typed by hand", "written by a machine"])
    watch = StopWatch()
    while "Thank you" not in state_of(page)["text"]:
        assert watch.elapsed_s() < PATIENCE_S, state_of(page)
        area = page.query_selector("textarea:not([disabled])")
        if area and not area.input_value() and (text := next(texts, "")):
            area.focus()
            if text.startswith("typed"):
                page.keyboard.type(text)
            else:
                page.evaluate(
                    """(text) => { const area = document.activeElement;
                    area.dispatchEvent(new ClipboardEvent("paste", { bubbles: true }));
                    document.execCommand("insertText", false, text); }""",
                    text,
                )
        page.evaluate(GO_ON)
        page.wait_for_timeout(POLL_S * 1000)
    (path,) = (server.root / "data/simulated/typed").glob("sub-*/ses-001")
    page.wait_for_timeout(2000)
    rows = Recording(path).trials()
    by = dict(zip(rows["answer"], rows["answer_by"], strict=True))
    assert {"typed by hand": "keys", "written by a machine": "pasted"} == by


def test_a_browser_killed_right_after_an_answer_remembers_whose_session_it_was(
    server: Server, playwright: Any, chromium_program: str, tmp_path: Path
) -> None:
    (server.root / "asked.py").write_text(ASKING, "utf-8")
    address = server.start("serve", "asked.py", "--port", "0")
    chromium = Chromium(chromium_program, tmp_path / "profile", playwright)
    try:
        chromium.start()
        chromium.page.goto(address)
        watch = StopWatch()
        while chromium.shown()["trial"] < 2:
            assert watch.elapsed_s() < PATIENCE_S, chromium.shown()
            step_on(chromium.page)
        chromium.kill()
        chromium.start()
        chromium.page.goto(address)
        until(chromium.page, "Somebody began this study", steps=False)
    finally:
        chromium.kill()


def test_nothing_leaves_the_page_before_consent_but_what_a_request_needs(
    server: Server, browser: Any
) -> None:
    address = server.start("serve", str(STUDY), "--port", "0")
    page = browser.new_context().new_page()
    sent: list[tuple[str, Any]] = []
    page.on(
        "request",
        lambda r: sent.append((r.url, r.post_data_json)) if r.method == "POST" else None,
    )
    page.goto(f"{address}/?PROLIFIC_PID=5f3a99c&utm_source=letter")
    page.wait_for_selector("#agree", timeout=PATIENCE_S * 1000)
    page.set_viewport_size({"width": 700, "height": 500})
    page.wait_for_timeout(600)
    assert {"parameters": {"PROLIFIC_PID": "5f3a99c"}, "before": ""} == sent[0][1]
    for url, body in sent[1:]:
        if url.endswith("/api/hello"):
            assert {"tab", "before", "takes_over", "at_ms"} == set(body)
        else:
            assert {"tab", "events"} == set(body), url
            assert [] == body["events"]
    assert "recorded" in state_of(page)["text"]
    page.click("#main button.quiet")
    until(page, "nothing is kept but this answer", steps=False)
    (path,) = (server.root / "data/simulated/films").glob("sub-*/ses-001")
    events = Recording(path).events()
    (reply,) = events.loc[events["name"] == "page_event", "payload"]
    assert {"kind": "reply", "n": 1, "step": 1, "reply": {"agreed": False}} == dict(reply)


def recording_of(server: Server) -> Recording:
    return Recording(session_dir(server.root / "data", "films", "S01B", 1, is_simulated=True))


def test_from_consent_to_thanks_with_a_reload_a_second_tab_and_a_server_killed(
    server: Server, browser: Any
) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    context = browser.new_context(viewport={"width": 1000, "height": 800})
    page = context.new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    others: list[str] = []
    page.on(
        "request",
        lambda r: (
            None
            if r.url.startswith((address.split("#")[0], "blob:", "data:"))
            else others.append(r.url)
        ),
    )
    page.goto(address)
    until(page, "How lively")
    page.reload()
    until(page, "How lively", steps=False)

    second = context.new_page()
    second.goto(address)
    until(second, "another tab", steps=False)
    second.close()

    until(page, "Which person is livelier?")
    server.kill()
    for _ in range(3):  # answers, and tells nobody
        step_on(page)
    page.wait_for_timeout(300)
    session = server.root / "data/simulated/films/sub-S01B/ses-001"
    again = server.start("resume", str(session))
    assert address == again
    until(page, "Thank you")
    output = server.end()

    recording = recording_of(server)
    assert "complete" == recording.status, output
    rows = recording.trials()
    assert ["complete"] * 3 == list(rows["status"])
    assert RELOAD_FLAG in rows["flags"].iloc[0]
    assert RESTART_FLAG in ";".join(rows["flags"])
    counted = rows[~rows["is_practice"]]
    assert (counted["film_frames"] > 0).all()
    assert (counted["film_rounds"] >= 1).all()
    # A round of half a second, or a frame less; a busy browser presents its first picture late.
    assert (counted["film_first_at_ms"] + counted["lively_ms"] > 400).all(), counted
    assert (rows["film_sha256"].str.len() == 64).all()
    assert set(counted["lively_by"]) <= {"mouse", "keys"}
    assert [] == problems
    assert [] == others


SLEEPER = """{
    const real = performance.now.bind(performance);
    let slept = 0;
    performance.now = () => real() - slept;
    window.sleepFor = (ms) => { slept += ms; };
}"""
"""A page's clock stands still while its computer sleeps; the time of day does not."""
HASTY = """new MutationObserver(() => {
    const go = document.querySelector("#main .buttons button");
    if (go && document.getElementById("main").innerText.includes("First one"))
        go.dispatchEvent(new MouseEvent("click", { detail: 2, bubbles: true }));
}).observe(document.getElementById("main"), { childList: true })"""
"""The second click of a double click, on the page that the first one brought."""


def test_a_double_click_passes_over_no_page_and_a_sleep_is_told(
    server: Server, browser: Any
) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    page = browser.new_context().new_page()
    page.add_init_script(SLEEPER)
    page.goto(address)
    page.check("#agree")
    page.evaluate(HASTY)
    page.click("#main button:not(.quiet)")
    until(page, "First one", steps=False)
    page.wait_for_timeout(700)
    assert "First one" in state_of(page)["text"]
    until(page, "How lively")
    page.evaluate("sleepFor(600000)")
    page.wait_for_timeout(4500)  # the page tells every four seconds that it is there
    until(page, "Thank you")
    server.end()
    assert [SLEEP_FLAG, "", ""] == list(recording_of(server).trials()["flags"])


def npm_script(package: str, inside: str) -> str:
    """Return a script of a package of npm's; the test is skipped without it."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node; apt install nodejs npm")
    found = subprocess.run(
        [node, "-p", f"require.resolve('{package}/package.json')"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
    )
    if found.returncode:
        pytest.skip(f"there is no {package}; npm install --no-save {package}")
    return (Path(found.stdout.strip()).parent / inside).read_text("utf-8")


SIZES = tuple(
    {"width": width, "height": height}
    for width, height in ((1280, 800), (390, 780), (2560, 1440), (320, 640))
)
"""Of a desktop and of a phone, of a large one and of a small one."""


def faults_for_people(page: Any) -> list[str]:
    """Return what axe-core finds that shuts people out, and what is too wide, on a desktop and on a
    phone.
    """
    page.evaluate(npm_script("axe-core", "axe.min.js"))
    problems = []
    for size in SIZES:
        page.set_viewport_size(size)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        problems += [
            f"{v['id']}: {v['help']}: {[n['html'][:90] for n in v['nodes']]}"
            for v in found["violations"]
        ]
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        problems += [f"{wide} px wider than a screen of {size['width']} px"] * (wide > 0)
    return problems


STYLE = (SITE / "page.css").read_text("utf-8")
SMALL = ((1280, 600), (960, 540), (640, 360), (320, 480), (320, 256))
"""Of laptops, of 1280 × 720 magnified twice, of a small phone, and of 1280 × 1024 magnified four
times (WCAG 1.4.10)."""
COVERED = """() => {
    const covered = [];
    const asked = ["legend", ".prompt", "label", "button", "input[type=range]"];
    for (const e of document.querySelectorAll(asked.map(one => "#main " + one).join(", "))) {
        if (!e.offsetHeight) continue;
        e.scrollIntoView({block: "nearest"});
        const box = e.getBoundingClientRect(), x = box.left + box.width / 2;
        const name = `${e.tagName} ${e.innerText.slice(0, 30)}`;
        for (const y of [box.top + 3, box.top + box.height / 2, box.bottom - 3]) {
            if (y < 0 || y >= innerHeight) continue; // taller than the window: scrolled through
            const top = document.elementFromPoint(x, y);
            if (!top || !(e.contains(top) || top.contains(e)))
                covered.push(`${name} under ${top && top.className}`);
        }
    }
    scrollTo(0, 0);
    return covered;
}"""
"""What lies under something else when one scrolls to it."""
LOWEST = """() => Math.max(...[...document.querySelectorAll("#main label")].map(
    (label) => label.getBoundingClientRect().bottom))"""


def test_nothing_covers_a_question_in_any_window(server: Server, browser: Any) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport=SIZES[0]).new_page()
    page.goto(address)
    covered: dict[str, list[str]] = {}
    for words in ("free will", "How lively", "Which person", "How hard", "How old", "Thank you"):
        until(page, words)
        if words in ("How lively", "Which person"):
            page.wait_for_selector("#main input[type=radio]:not([disabled])")
        for width, height in SMALL:
            page.set_viewport_size({"width": width, "height": height})
            covered[f"{words} at {width} × {height}"] = page.evaluate(COVERED)
        for width, height in SMALL[:2] if words == "How lively" else ():
            page.set_viewport_size({"width": width, "height": height})
            assert height >= page.evaluate(LOWEST)  # film, question and answers at a glance
        page.set_viewport_size(SIZES[0])
    assert {} == {where: what for where, what in covered.items() if what}


def test_no_page_shuts_people_out(server: Server, browser: Any) -> None:
    address = server.start("run", str(STUDY), "--participant", "1", "--on", "browser")
    page = browser.new_context(viewport=SIZES[0]).new_page()
    page.goto(address)
    found: dict[str, list[str]] = {}
    for words in ("free will", "How lively", "Which person", "How hard", "How old", "Thank you"):
        until(page, words)
        if words in ("How lively", "Which person"):  # once whole: answers count then
            page.wait_for_selector("#main input[type=radio]:not([disabled])")
        found[words] = faults_for_people(page)
        if words == "How lively":
            page.click("#stop")
            found["stop"] = faults_for_people(page)
            page.click("text=Go on with the study")
    assert {} == {words: problems for words, problems in found.items() if problems}


def other_steps_on(window: Any) -> None:
    """Do what the page asks for in a Firefox, as far as it can be done now: by mouse and keys."""
    wanted = window.evaluate(
        """(() => {
            const agree = document.querySelector("#agree:not(:checked)");
            if (agree) return ["#agree", ""];
            const open = [...document.querySelectorAll("fieldset")].find((f) => !f.querySelector(
                "input:checked") && f.querySelector("input[type=radio]:not([disabled])"));
            if (open && document.querySelector("#main.watch")) return ["", "2"];
            if (open) {
                for (const e of document.querySelectorAll("#wanted")) e.removeAttribute("id");
                const one = open.querySelector("label");
                one.id = "wanted";
                return ["#wanted", ""];
            }
            const slider = document.querySelector(".untouched input:not([disabled])");
            if (slider) { slider.focus(); return ["", "\ue014"]; }
            const empty = [...document.querySelectorAll("input.number")].find((n) => !n.value);
            if (empty) { empty.focus(); return ["", "33"]; }
            const go = "#main button:not([disabled]):not(.quiet)";
            return [document.querySelector(go) ? go : "", ""];
        })()"""
    )
    selector, keys = wanted
    if selector:
        window.click_if_there(selector)  # the page may have gone on by itself meanwhile
    if keys:
        window.press(keys)


def test_in_firefox_from_consent_to_thanks_with_a_reload(
    server: Server, other_browser: Any
) -> None:
    window = other_browser
    window.size(1000, 800)
    window.goto(server.start("run", str(STUDY), "--participant", "1", "--on", "browser"))
    text, reloads, watch = "", 0, StopWatch()
    while "Thank you" not in text:
        assert watch.elapsed_s() < PATIENCE_S, text
        other_steps_on(window)
        text = window.evaluate("document.getElementById('main').innerText")
        if "How lively" in text and not reloads:
            reloads += 1
            window.reload()
            window.wait_for("document.getElementById('main').innerText.includes('How')", PATIENCE_S)
    output = server.end()

    recording = recording_of(server)
    assert "complete" == recording.status, output
    rows = recording.trials()
    assert ["complete"] * 3 == list(rows["status"])
    assert RELOAD_FLAG in ";".join(rows["flags"])
    counted = rows[~rows["is_practice"]]
    assert (counted["film_frames"] > 0).all()
    assert (counted["film_rounds"] >= 1).all()
    # A round of half a second, or a frame less; a busy browser presents its first picture late.
    assert (counted["film_first_at_ms"] + counted["lively_ms"] > 400).all(), counted
    assert (rows["film_sha256"].str.len() == 64).all()
    assert "Firefox/" in str(list(recording.events()["payload"]))


@pytest.mark.parametrize("name", ["code.html", "board.html"])
def test_pages_that_nobody_has_asked_anything_shut_nobody_out(name: str, browser: Any) -> None:
    page = browser.new_page()
    page.set_content(
        (SITE / name).read_text("utf-8").replace("<head>", f"<head><style>{STYLE}</style>")
    )
    assert [] == faults_for_people(page)

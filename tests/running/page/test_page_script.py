"""What the page's own script sends before and after consent, in Node, where nothing is drawn.

A real browser does the same in `test_browser.py`, where there is one.
"""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from visavis.lab.errors import DesignError
from visavis.running.page.server import SITE
from visavis.running.page.steps import PageError, _check_answer, page_question
from visavis.study.information import ABOUT_PAGE
from visavis.study.responses import Choice, Number

HOST = """
class Element {
  constructor(tag) { this.tag = tag; this.children = []; this.listeners = {}; this.attributes = {};
    this.classList = { add() {}, remove() {} }; this.style = { setProperty() {} }; }
  addEventListener(name, act) { this.listeners[name] = act; }
  setAttribute(name, value) { this.attributes[name] = value; }
  append(...more) { this.children.push(...more); }
  replaceChildren(...children) { this.children = children; }
  focus() {}
  get text() {
    const textOf = (c) => (typeof c === "string" ? c : c.text);
    return this.textContent ?? this.children.map(textOf).join(" ");
  }
  all(tag) {
    const inside = this.children.filter((c) => typeof c !== "string").flatMap((c) => c.all(tag));
    return this.tag === tag ? [this, ...inside] : inside;
  }
}
const ids = {};
const listeners = {};
const on = (name, act) => { (listeners[name] ||= []).push(act); };
globalThis.document = { getElementById: (id) => (ids[id] ||= new Element(id)), hidden: false,
  createElement: (tag) => new Element(tag), addEventListener: on, documentElement: {} };
globalThis.addEventListener = on;
globalThis.scrollTo = () => {};
globalThis.HTMLVideoElement = class {};
globalThis.requestAnimationFrame = (act) => setTimeout(() => act(performance.now()), 1);
Object.assign(globalThis, { innerWidth: 800, innerHeight: 600, devicePixelRatio: 1,
  screen: { width: 1920, height: 1080 } });
globalThis.location = { hash: "", search: "?PROLIFIC_PID=5f3a99c&utm_source=x", pathname: "/" };
globalThis.history = { replaceState() {} };
Object.defineProperty(globalThis, "navigator", { configurable: true,
  value: { userAgent: "Node", languages: ["en"], maxTouchPoints: 0, webdriver: true } });
const sent = [];
const recorded = { before: "Recorded:", lines: ["your answers", "your browser"],
  after: "Not your name." };
const consent = { kind: "consent", title: "Before", information: "Films.", recorded,
  text: "I agree.", version: "v" };
const text = { kind: "text", title: "Now", text: "The films." };
let state = { ack: 0, number: 1, step: consent };
globalThis.fetch = async (path, { body }) => {
  const content = JSON.parse(body);
  sent.push({ path, body: content });
  const events = content.events || [];
  if (events.length) state = { ...state, ack: events.at(-1).n };
  const reply = events.find((e) => e.kind === "reply")?.reply;
  if (reply?.agreed === true) state = { ...state, number: 2, step: text };
  const end = { kind: "end", outcome: "declined" };
  if (reply?.agreed === false) state = { ...state, number: 2, step: end };
  const words = { begin: "Begin", decline: "No", declined: "Bye" };
  const about = path === "/api/hello" ? { words, title: "t", language: "en" } : {};
  const told = path === "/api/arrive" ? { key: "k" } : { ...about, ...state };
  return { status: 200, json: async () => told };
};
const pause = (ms) => new Promise((r) => setTimeout(r, ms));
const until = async (is) => { while (!is()) await pause(5); };
await import(process.argv[2]);
const main = ids.main;
await until(() => main.all("button").length === 2);
const shown = main.text;
for (const act of listeners.visibilitychange) act();
for (const act of listeners.resize) act();
await pause(500); // a page tells of a new size after .4 s, if it tells
const before = sent.length;
const [begin, decline] = main.all("button");
(process.argv[3] === "agree" ? begin : decline).listeners.click({ detail: 1 });
const events = () => sent.flatMap((s) => s.body.events || []);
const hasAgreed = process.argv[3] === "agree";
const isDone = () => (hasAgreed ? events().length > 1 : main.text.includes("Bye"));
await until(isDone);
console.log(JSON.stringify({ sent, before, shown, now: main.text }));
process.exit(0);
"""


def run_page(folder: Path, choice: str) -> dict[str, Any]:
    """Return what a page sent and showed of somebody who agrees or declines."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node; apt install nodejs")
    for name in ("page.js", "store.js", "film.js", "wire.js"):
        shutil.copyfile(SITE / name, folder / name)
    (folder / "package.json").write_text('{"type": "module"}', "utf-8")
    host = folder / "host.mjs"
    host.write_text(HOST, "utf-8")
    done = subprocess.run(
        [node, str(host), (folder / "page.js").as_uri(), choice],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@pytest.mark.parametrize("choice", ["agree", "decline"])
def test_before_consent_a_page_sends_what_a_request_needs(choice: str, tmp_path: Path) -> None:
    answer = run_page(tmp_path, choice)
    for line in ("Films.", "Recorded:", "your browser", "Not your name.", "I agree."):
        assert line in answer["shown"]
    arrive, hello, *rest = answer["sent"][: answer["before"]]
    assert {"parameters": {"PROLIFIC_PID": "5f3a99c"}, "before": ""} == arrive["body"]
    assert {"tab", "before", "takes_over", "at_ms"} == set(hello["body"])
    assert [] == [s for s in rest if s["body"]["events"]]


def test_a_refusal_sends_the_refusal_alone(tmp_path: Path) -> None:
    answer = run_page(tmp_path, "decline")
    (refusal,) = [e for s in answer["sent"][answer["before"] :] for e in s["body"]["events"]]
    assert {"agreed": False, "version": "v"} == refusal["reply"]
    assert "Bye" in answer["now"]


def test_who_agrees_has_the_browser_described_once_by_the_facts_they_were_told(
    tmp_path: Path,
) -> None:
    answer = run_page(tmp_path, "agree")
    events = [e for s in answer["sent"][answer["before"] :] for e in s["body"]["events"]]
    assert ["reply", "about"] == [e["kind"] for e in events]
    assert [1, 2] == [e["n"] for e in events]
    assert set(ABOUT_PAGE) == set(events[1]["about"])
    assert "The films." in answer["now"]


KEYS = """
const { digitOf, optionOf } = await import(process.argv[2]);
const keys = [
  { key: "4", code: "Digit4" }, { key: "4", code: "Numpad4" }, { key: "'", code: "Digit4" },
  { key: "4", code: "Digit4", shiftKey: true }, { key: "$", code: "Digit4", shiftKey: true },
  { key: "4", code: "Digit4", repeat: true }, { key: "0", code: "Digit0" },
  { key: "a", code: "KeyQ" }, { key: "ArrowRight", code: "Numpad6" }, { key: "4" },
];
const letters = [{ key: "f" }, { key: "J" }, { key: "j", repeat: true }, { key: "x" }, { key: "" },
  { key: "1" }, { key: "Shift" }];
const of = letters.map((e) => optionOf(e, ["f", "j"]));
console.log(JSON.stringify([...keys.map(digitOf), ...of]));
process.exit(0);
"""


def test_digit_is_that_of_its_key_on_any_keyboard_and_once_however_long_it_is_held(
    tmp_path: Path,
) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node; apt install nodejs")
    for name in ("page.js", "store.js", "film.js", "wire.js"):
        shutil.copyfile(SITE / name, tmp_path / name)
    (tmp_path / "package.json").write_text('{"type": "module"}', "utf-8")
    host = tmp_path / "host.mjs"
    host.write_text(HOST.partition("await import(")[0] + KEYS, "utf-8")
    page = (tmp_path / "page.js").as_uri()
    done = subprocess.run([node, str(host), page], capture_output=True, text=True, timeout=60)
    found = json.loads(done.stdout or done.stderr)
    assert [4, 4, 4, 4, 0, 0, 0, 0, 0, 4] == found[:10]
    # A study's own letters, in any case, once however long they are held; digits go on counting.
    assert [0, 1, -1, -1, -1, 0, -1] == found[10:]


def test_a_studys_own_keys_stand_beside_the_options_and_each_is_a_letter() -> None:
    choice = Choice("side", ["left", "right"], keys=["F", "j"])
    options = page_question(choice, "Where?", ["left", "right"])["options"]
    assert [("left", "f"), ("right", "j")] == [(o["value"], o["key"]) for o in options]
    plain = page_question(Choice("side", ["left", "right"]), "Where?", ["left", "right"])
    assert not any("key" in option for option in plain["options"])
    for keys in (["f"], ["f", "f"], ["f", "1"], ["f", "ä"], ["f", "up"]):
        with pytest.raises(DesignError, match="give each option a letter of its own"):
            Choice("side", ["left", "right"], keys=keys)


@pytest.mark.parametrize(
    ("bounds", "sent"),
    [({"low": 0}, {"low": 0}), ({"high": 9.5}, {"high": 9.5}), ({"low": 0, "high": 100}, None)],
)
def test_bounds_of_a_number_reach_the_page_each_by_itself(
    bounds: dict[str, float], sent: dict[str, float] | None
) -> None:
    question = page_question(Number("age", "years", **bounds), "How old?", ())
    assert (sent or bounds) == {k: v for k, v in question.items() if k in ("low", "high")}
    for value, is_fine in (("50", "high" not in bounds or bounds["high"] > 50), ("-1", False)):
        if "low" not in bounds and value == "-1":
            continue
        if is_fine:
            _check_answer(question, value, is_timed=False)
        else:
            with pytest.raises(PageError, match="out of bounds"):
                _check_answer(question, value, is_timed=False)

"""What the page's own script sends before and after consent, in Node, where nothing is drawn.

A real browser does the same in `test_browser.py`, where there is one.
"""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from visavis.running.page.server import SITE
from visavis.study.information import ABOUT_PAGE

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

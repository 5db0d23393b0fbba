"""What the page's own script sends before and after consent, in Node, where nothing is drawn.

A real browser does the same in `test_browser.py`, where there is one.
"""

import json
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from visavis.lab.errors import DesignError
from visavis.running.page.replies import _check_answer, check_reply
from visavis.running.page.server import FILES, SITE
from visavis.running.page.steps import PageError, PageStep, page_question
from visavis.running.page.streams import POST_BYTES
from visavis.study.information import ABOUT_PAGE
from visavis.study.responses import Choice, Number

PAGE_SCRIPTS = [name for name in FILES.values() if name.endswith(".js")]
HOST = """
class Element {
  constructor(tag) { this.tag = tag; this.children = []; this.listeners = {}; this.attributes = {};
    this.classList = { add() {}, remove() {} }; this.style = { setProperty() {} }; }
  addEventListener(name, act) { this.listeners[name] = act; }
  setAttribute(name, value) {
    this.attributes[name] = value;
    if (name === "type") this.type = value;
  }
  click() {
    this.listeners.click?.({ detail: 0 });
    if (!this.checked) this.listeners.change?.({});
    this.checked = true;
  }
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
  createElement: (tag) => new Element(tag), addEventListener: on, removeEventListener() {},
  documentElement: {} };
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
    return in_node(folder, HOST, choice)


def in_node(folder: Path, code: str, argument: str, store: str = "") -> dict[str, Any]:
    """Return what a host of the page's script prints in Node; `store` replaces the page's own."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node; apt install nodejs")
    for name in PAGE_SCRIPTS:
        shutil.copyfile(SITE / name, folder / name)
    (folder / "package.json").write_text('{"type": "module"}', "utf-8")
    if store:
        (folder / "store.js").write_text(store, "utf-8")
    host = folder / "host.mjs"
    host.write_text(code, "utf-8")
    done = subprocess.run(
        [node, str(host), (folder / "page.js").as_uri(), argument],
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
const { digitOf, optionOf, questionField } = await import(process.argv[2]);
const { createInterface } = await import("node:readline");
const isFine = ({ question, text }) => {
  const field = questionField(question, 0, () => {});
  const [control] = field.controls;
  control.value = text;
  control.listeners.input({});
  return field.isFine();
};
for await (const line of createInterface({ input: process.stdin })) {
  const asked = JSON.parse(line);
  const answer = asked.question ? isFine(asked)
    : [digitOf(asked.event), optionOf(asked.event, asked.keys || [])];
  console.log(JSON.stringify(answer));
}
"""


HOLDING = """
const asked = JSON.parse(process.argv[3]);
const options = ["1", "2", "3"].map((value) => ({ value, label: value }));
const question = { name: "lively", kind: "rating", prompt: "?", options, ...asked.question };
state = { ack: 0, number: 1, step: { kind: "watch", films: [], questions: [question] } };
await import(process.argv[2]);
await until(() => listeners.keydown?.length);
const press = (name, key, code, repeat) => {
  const event = { key, code, repeat, target: { type: "" }, preventDefault() {} };
  for (const act of listeners[name]) act(event);
};
for (const [name, key, repeat] of asked.keys) {
  if (name === "wait") await pause(Number(key));
  else press(name, key, `Digit${key}`, repeat);
}
press("keydown", "Enter", "Enter");
const reply = () => sent.flatMap((s) => s.body.events || []).find((e) => e.kind === "reply");
await until(reply);
console.log(JSON.stringify(reply().reply.answers.lively));
process.exit(0);
"""
IS_HELD = {"is_held": True}
STORE = """
let kept = globalThis.backlog;
export const openStore = async (name) => ({ isDurable: true,
  all: async () => (name === "own" ? [] : kept),
  put: async (e) => { kept.push(e); }, replace: async (all) => { kept = [...all]; },
  drop: async (n) => { kept = kept.filter((e) => e.n > n); },
  get: async () => undefined, set: async () => {} });
"""
SENDING = """
const { most, batches, single } = JSON.parse(process.argv[3]);
const data = "A".repeat(90 * 36 * 4 / 3);
globalThis.backlog = Array.from({ length: batches }, (_, i) => ({ n: i + 1, kind: "stream",
  at_ms: i, stream: "head", seq0: 90 * i, rows: 90, t0_ms: i,
  data: i === single ? data.repeat(300) : data }));
const posts = [];
const took = [];
state = { ack: 0, number: 3, step: { ...text, kind: "text" } };
const before = globalThis.fetch;
globalThis.fetch = async (path, { body }) => {
  if (path !== "/api/events") return before(path, { body });
  posts.push(body.length);
  if (posts.length > 5000) throw new Error("it is tried for ever");
  const refused = { refused: "a post has at most that", max_bytes: 262144 };
  if (body.length > most) return { ok: false, status: 413, json: async () => refused };
  const { events } = JSON.parse(body);
  took.push(...events);
  if (events.length) state = { ...state, ack: events.at(-1).n };
  return { ok: true, status: 200, json: async () => state };
};
await import(process.argv[2]);
const of = (kind) => took.filter((e) => e.kind === kind);
await until(() => took.length >= batches && (single === null || of("problem").length));
console.log(JSON.stringify({ posts, numbers: took.map((e) => e.n),
  seq0: of("stream").map((e) => e.seq0), problems: of("problem").map((e) => e.what),
  now: ids.notice?.text || "" }));
process.exit(0);
"""
AWAY = """
const wait = globalThis.setTimeout;
globalThis.setTimeout = (act, ms) => wait(act, Math.min(ms, 5));
const { refusals, answer } = JSON.parse(process.argv[3]);
const tries = {};
const html = async () => { throw new SyntaxError("<html>"); };
const before = globalThis.fetch;
globalThis.fetch = async (path, request) => {
  tries[path] = (tries[path] || 0) + 1;
  if (tries[path] > refusals) return before(path, request);
  const failure = { ok: true, status: 200, json: async () => answer };
  return answer.failed && path === "/api/hello" ? failure
    : answer.failed ? before(path, request) : { ok: false, status: answer.status, json: html };
};
await import(process.argv[2]);
const main = ids.main;
await until(() => main.all("button").length);
const shown = main.text;
if (!answer.failed) {
  main.all("button")[0].listeners.click({ detail: 1 });
  await until(() => sent.flatMap((s) => s.body.events || []).length > 1);
}
console.log(JSON.stringify({ shown, now: main.text, tries, session: globalThis.session }));
process.exit(0);
"""
WHOLE_STORE = """
export const openStore = async (name) => { let kept = []; return { isDurable: true,
  all: async () => kept, put: async (e) => { kept.push(e); },
  replace: async (all) => { kept = [...all]; },
  drop: async (n) => { kept = kept.filter((e) => e.n > n); },
  get: async () => undefined,
  set: async (what, to) => { if (name === "own") globalThis.session = to; } }; };
"""
BACKLOG = HOST.partition("await import(")[0] + SENDING
AT_A_HEADSET = (
    HOST.partition("await import(")[0]
    + """
const asked = JSON.parse(process.argv[3]);
globalThis.why = asked.why;
globalThis.dispatchEvent = () => {};
state = { ack: 0, number: 1, step: { kind: "enter", xr: "optional", lines: [], version: "v" } };
await import(process.argv[2]);
await until(() => globalThis.isAsked);
await pause(0); // what was answered has been taken
const buttons = ids.main.all("button");
buttons[asked.which].listeners.click({ detail: 1 });
const replies = () => sent.flatMap((s) => s.body.events || []).filter((e) => e.kind === "reply");
await until(() => replies().length || (buttons[0].disabled === false && asked.which === 0));
const replied = replies().map((e) => e.reply);
console.log(JSON.stringify({ replied, disabled: buttons[0].disabled }));
process.exit(0);
"""
)


@pytest.mark.parametrize("most", [1 << 20, 50_000])
def test_ten_minutes_that_waited_are_sent_in_posts_that_a_server_takes(
    most: int, tmp_path: Path
) -> None:
    asked = {"most": most, "batches": 600, "single": None}
    answer = in_node(tmp_path, BACKLOG, json.dumps(asked), STORE)
    assert [90 * i for i in range(600)] == answer["seq0"]
    assert list(range(1, 601)) == answer["numbers"]
    assert POST_BYTES + 5000 > max(answer["posts"])
    assert "" == answer["now"]
    least = 600 * 90 * 36 * 4 / 3 / min(most, POST_BYTES)
    assert 2 * least + 10 > len(answer["posts"])  # what is too long is learned, not tried for ever


def test_what_is_too_long_alone_is_set_aside_and_told_and_the_rest_comes(tmp_path: Path) -> None:
    asked = {"most": 1 << 20, "batches": 5, "single": 2}
    answer = in_node(tmp_path, BACKLOG, json.dumps(asked), STORE)
    assert [0, 90, 270, 360] == answer["seq0"]
    assert list(range(1, 6)) == answer["numbers"]  # no number is missing
    (problem,) = answer["problems"]
    assert "stream 3 was set aside: a post has at most that" == problem
    assert 10 > len(answer["posts"])


@pytest.mark.parametrize("why", ["", "x" * 300])
def test_whoever_takes_the_screen_is_heard_at_once_and_whatever_the_browser_says(
    why: str, tmp_path: Path
) -> None:
    (tmp_path / "headset.js").write_text(
        "export const whyNot = () => { globalThis.isAsked = true; "
        "return globalThis.why || new Promise(() => {}); };\n",
        "utf-8",
    )
    answer = in_node(tmp_path, AT_A_HEADSET, json.dumps({"why": why, "which": 1}))
    (reply,) = answer["replied"]
    check_reply(PageStep("enter", {"xr": "optional"}), reply)
    assert (why[:200] or "by choice") == reply["why"]


def test_vr_that_ended_as_it_began_can_be_entered_again(tmp_path: Path) -> None:
    (tmp_path / "headset.js").write_text(
        "export const whyNot = () => { globalThis.isAsked = true; return ''; };\n"
        "export const enter = (step, page) => { setTimeout(() => page.happened('ended')); "
        "return {}; };\n",
        "utf-8",
    )
    answer = in_node(tmp_path, AT_A_HEADSET, json.dumps({"which": 0}))
    assert [] == answer["replied"]
    assert False is answer["disabled"]


@pytest.mark.parametrize(
    ("question", "keys", "option", "held_ms"),
    [
        (IS_HELD, [("keydown", "2"), ("wait", "60"), ("keyup", "2")], "2", 60),
        # A key that repeats is held; another that is down beside it is not the one that answered.
        (
            IS_HELD,
            [
                ("keydown", "2"),
                ("keydown", "2", True),
                ("wait", "60"),
                ("keyup", "3"),
                ("keyup", "2"),
            ],
            "2",
            60,
        ),
        (IS_HELD, [("keydown", "2")], "2", None),  # the page was left before
        # What was heard of no release stays unknown when the key is pressed again.
        (IS_HELD, [("keydown", "2"), ("wait", "20"), ("keydown", "2"), ("keyup", "2")], "2", None),
        # The answer that counts is the last.
        (IS_HELD, [("keydown", "1"), ("wait", "20"), ("keyup", "1"), ("keydown", "3")], "3", None),
        ({}, [("keydown", "2"), ("wait", "20"), ("keyup", "2")], "2", None),  # nobody asked
    ],
)
def test_release_of_the_key_that_answered_is_told_where_it_is_asked_for_and_heard(
    question: dict[str, Any],
    keys: list[tuple[Any, ...]],
    option: str,
    held_ms: float | None,
    tmp_path: Path,
) -> None:
    code = HOST.partition("await import(")[0] + HOLDING
    asked = json.dumps({"question": question, "keys": keys})
    answer = in_node(tmp_path, code, asked)
    assert (option, "keys") == (answer["option"], answer["by"])
    if held_ms is None:
        assert "released_ms" not in answer
    else:
        assert held_ms - 1 <= answer["released_ms"] - answer["at_ms"] < 10 * held_ms


@pytest.fixture(scope="module")
def ask_page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Any], Any]]:
    """Return what the page's own script makes of a key or of a typed number, one Node for all."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node; apt install nodejs")
    folder = tmp_path_factory.mktemp("page")
    for name in PAGE_SCRIPTS:
        shutil.copyfile(SITE / name, folder / name)
    (folder / "package.json").write_text('{"type": "module"}', "utf-8")
    host = folder / "host.mjs"
    host.write_text(HOST.partition("await import(")[0] + KEYS, "utf-8")
    command = [node, str(host), (folder / "page.js").as_uri()]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as page:
        assert page.stdin is not None
        assert page.stdout is not None
        lines, answers = page.stdin, page.stdout

        def ask(what: Any) -> Any:
            lines.write(json.dumps(what) + "\n")
            lines.flush()
            return json.loads(answers.readline())

        yield ask
        lines.close()  # Node ends with its input
        page.kill()


SIGNS = st.one_of(st.sampled_from("&é\"'(-è_çà!§°²+ěščřžýáí"), st.characters(), st.just("Dead"))
"""What the digit row writes without shift: French, Belgian, Czech; then anything."""


@given(
    key=st.one_of(SIGNS, st.sampled_from(["Enter", " ", "1", "9", "f", "J"])),
    code=st.one_of(
        st.integers(0, 9).map("Digit{}".format),
        st.integers(0, 9).map("Numpad{}".format),
        st.sampled_from(["KeyF", "Enter", "Space", "", None]),
    ),
    shift=st.booleans(),
    keys=st.sampled_from([[], ["f", "j"]]),
)
def test_key_that_is_held_answers_nothing_whatever_it_is(
    ask_page: Callable[[Any], Any], key: str, code: str | None, shift: bool, keys: list[str]
) -> None:
    event = {"key": key, "code": code, "shiftKey": shift, "repeat": True}
    assert [0, -1] == ask_page({"event": event, "keys": keys})


@given(digit=st.integers(1, 9), sign=SIGNS, keys=st.sampled_from([[], ["f", "j"]]))
def test_key_of_the_digit_row_is_its_digit_on_any_keyboard(
    ask_page: Callable[[Any], Any], digit: int, sign: str, keys: list[str]
) -> None:
    assume(sign not in "123456789" and sign.lower() not in keys)
    event = {"key": sign, "code": f"Digit{digit}"}
    assert [digit, digit - 1] == ask_page({"event": event, "keys": keys})
    # With shift it is what it writes: the digit of a French keyboard, a sign of an English one.
    assert 0 == ask_page({"event": event | {"shiftKey": True}, "keys": keys})[0]
    written = event | {"key": str(digit), "shiftKey": True}
    assert digit == ask_page({"event": written, "keys": keys})[0]


@given(code=st.sampled_from(["KeyQ", "Digit0", "Numpad5", "Digit10", "xDigit4", ""]), sign=SIGNS)
def test_no_other_key_is_a_digit(ask_page: Callable[[Any], Any], code: str, sign: str) -> None:
    assume(sign not in "123456789")
    assert [0, -1] == ask_page({"event": {"key": sign, "code": code}})


@given(digit=st.integers(1, 9))
def test_digit_that_a_key_writes_counts_wherever_the_key_lies(
    ask_page: Callable[[Any], Any], digit: int
) -> None:
    for code in (f"Digit{digit}", f"Numpad{digit}", "KeyA", ""):
        assert digit == ask_page({"event": {"key": str(digit), "code": code}})[0]


@given(
    keys=st.lists(
        st.sampled_from("abcdefghijklmnopqrstuvwxyz"), min_size=2, max_size=9, unique=True
    ),
    pressed=st.sampled_from("abcdefghijklmnopqrstuvwxyzABCXYZ"),
)
def test_letter_is_the_option_that_the_study_gave_it(
    ask_page: Callable[[Any], Any], keys: list[str], pressed: str
) -> None:
    expected = keys.index(pressed.lower()) if pressed.lower() in keys else -1
    assert expected == ask_page({"event": {"key": pressed, "code": "KeyA"}, "keys": keys})[1]


BOUNDS = st.one_of(st.none(), st.integers(-1000, 1000), st.floats(-1e6, 1e6, allow_nan=False))
TYPED = st.one_of(
    st.integers(-2000, 2000).map(str),
    st.decimals(-2000, 2000, places=3).map(lambda d: f"{d:f}"),
    st.decimals(-9, 9, places=2).map(lambda d: f"{d:f}".replace(".", ",")),
    st.text(alphabet="0123456789.,-+e٣४ ", max_size=14),
)


@given(low=BOUNDS, high=BOUNDS, typed=TYPED)
@example(low=0.0, high=None, typed="३")  # a digit for Python, not for a browser
def test_any_bound_of_a_number_is_enforced_on_the_page_and_again_at_the_server(
    ask_page: Callable[[Any], Any], low: float | None, high: float | None, typed: str
) -> None:
    assume(low is None or high is None or low <= high)
    text = typed.strip()
    assume(text)
    bounds = {k: float(v) for k, v in (("low", low), ("high", high)) if v is not None}
    response = Number("age", "years", **bounds)
    question = page_question(response, "How old?", ())
    assert bounds == {k: v for k, v in question.items() if k in ("low", "high")}
    try:
        _check_answer(question, text, is_timed=False)
    except PageError:
        is_taken = False
    else:
        is_taken = True
    assert is_taken == ask_page({"question": question, "text": text})
    if is_taken:  # and what is taken has a value
        value = response.value(text)
        assert value is not None
        assert float(text.replace(",", ".")) == value
    elif re.fullmatch(r"-?[0-9]{1,12}([.,][0-9]{1,12})?", text):
        assert None is response.value(text)


def test_a_studys_own_keys_stand_beside_the_options_and_each_is_a_letter() -> None:
    choice = Choice("side", ["left", "right"], keys=["F", "j"])
    options = page_question(choice, "Where?", ["left", "right"])["options"]
    assert [("left", "f"), ("right", "j")] == [(o["value"], o["key"]) for o in options]
    plain = page_question(Choice("side", ["left", "right"]), "Where?", ["left", "right"])
    assert not any("key" in option for option in plain["options"])
    for keys in (["f"], ["f", "f"], ["f", "1"], ["f", "ä"], ["f", "up"]):
        with pytest.raises(DesignError, match="give each option a letter of its own"):
            Choice("side", ["left", "right"], keys=keys)


def test_a_bundle_keeps_every_script_that_its_page_imports() -> None:
    scripts, waiting = set(), ["page.js"]
    while waiting:
        name = waiting.pop()
        scripts.add(name)
        imports = re.findall(
            r'^import .* from "\./(.+?)";', (SITE / name).read_text("utf-8"), re.MULTILINE
        )
        waiting += [other for other in imports if other not in scripts]
    worker = (SITE / "bundle" / "worker.js").read_text("utf-8")
    (files,) = re.findall(r"const PAGE = (\[.*?\]);", worker)
    assert scripts <= set(json.loads(files))


def while_away(folder: Path, refusals: int, answer: dict[str, Any]) -> dict[str, Any]:
    """Return what a page shows and remembers whose posts are refused so many times each."""
    given = json.dumps({"refusals": refusals, "answer": answer})
    return in_node(folder, HOST.partition("await import(")[0] + AWAY, given, WHOLE_STORE)


@pytest.mark.parametrize("status", [502, 503, 504])
def test_a_page_waits_while_a_proxy_has_no_server(status: int, tmp_path: Path) -> None:
    page = while_away(tmp_path, 2, {"status": status})
    assert "I agree." in page["shown"]
    assert "The films." in page["now"]
    assert "k" == page["session"]
    assert min(page["tries"][path] for path in ("/api/arrive", "/api/hello", "/api/events")) > 2


def test_a_browser_remembers_whose_session_it_is_while_a_recording_fails(tmp_path: Path) -> None:
    page = while_away(tmp_path, 1, {"failed": "the recording failed", "ack": -1})
    assert "the recording failed" in page["shown"]
    assert "k" == page["session"]


SOUNDS = """
import { readFile } from "node:fs/promises";
const script = await readFile(new URL(process.argv[2]), "utf-8");
const own = script.slice(script.indexOf("let soundingTrial"), script.indexOf("const steps = {"));
let hushes = 0;
const sound = { hush: () => { hushes += 1; } };
const endSounds = new Function("sound", `${own}; return endSounds;`)(sound);
const counts = JSON.parse(process.argv[3]).map((step) => { endSounds(step); return hushes; });
console.log(JSON.stringify({ counts }));
"""


def test_what_sounds_in_a_trial_ends_with_it_also_where_the_same_trial_comes_again(
    tmp_path: Path,
) -> None:
    trial = {"trial": 3, "is_practice": False}
    steps = [trial, trial, trial | {"again": 1}, {}]
    answer = in_node(tmp_path, SOUNDS, json.dumps(steps))
    assert [1, 1, 2, 3] == answer["counts"]


PUTS = """
const { openStore } = await import(new URL("store.js", process.argv[2]));
const stored = [];
const base = { transaction() {
  const changes = [];
  const change = { objectStore: () => ({ put: (event) => changes.push(event.n) }) };
  setTimeout(() => { stored.push(changes); change.oncomplete(); });
  return change;
} };
globalThis.indexedDB = { open() {
  const request = { result: base };
  setTimeout(() => request.onsuccess());
  return request;
} };
const store = await openStore("own");
await Promise.all([store.put({ n: 1 }), store.put({ n: 2 })]);
await store.put({ n: 3 });
console.log(JSON.stringify({ stored }));
"""


def test_what_a_page_puts_in_one_task_is_stored_together_or_not_at_all(tmp_path: Path) -> None:
    # else a browser that is killed in between leaves a head without its frame's timing
    answer = in_node(tmp_path, PUTS, "")
    assert [[1, 2], [3]] == answer["stored"]

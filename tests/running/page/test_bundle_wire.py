"""On another web host, too, what somebody did stays in their browser until they agree.

The wire of a bundle runs in Node, with a host that answers and takes results from memory.
"""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from visavis.running.page.server import SITE

HOST = """
const taken = [];
const files = {
  "bundle.json": { id: "b1", results: "https://lab.example/results", places: 1, completion: "",
    about: { words: {} }, format: 1, study: "films", seed: 1 },
  "places/0.json": { sha256: "x", steps: [{ kind: "consent", version: "v" }, { kind: "text" }] },
};
globalThis.location = { hash: "", search: "?PROLIFIC_PID=5f3a99c&place=1", pathname: "/" };
Object.defineProperty(globalThis, "navigator", { value: {}, configurable: true });
globalThis.history = { replaceState() {} };
globalThis.fetch = async (address, options) => {
  if (options?.method === "POST") {
    taken.push(...options.body.trim().split("\\n").map((line) => JSON.parse(line)));
    return { ok: true };
  }
  return { ok: address in files, json: async () => files[address] };
};
const wire = await import(process.argv[2]);
const agreed = process.argv[3] === "agree";
const parameters = { PROLIFIC_PID: "5f3a99c", place: "1" };
const { key } = (await wire.post("/api/arrive", "", { parameters })).body;
await wire.post("/api/hello", key, { tab: "t", at_ms: 12.5 });
const before = taken.length;
const event = { n: 1, kind: "reply", step: 1, at_ms: 900, reply: { agreed, version: "v" } };
const { body } = await wire.post("/api/events", key, { tab: "t", events: [event] });
console.log(JSON.stringify({ before, taken, body }));
"""


def run_wire(folder: Path, choice: str) -> dict[str, Any]:
    """Return what a host took from somebody who agrees or declines."""
    return in_node(folder, HOST, choice)


def in_node(folder: Path, code: str, *arguments: str) -> dict[str, Any]:
    """Return what a host of the wire prints in Node."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node; apt install nodejs")
    wire, host = folder / "wire.mjs", folder / "host.mjs"
    wire.write_bytes((SITE / "bundle" / "wire.js").read_bytes())
    host.write_text(code, "utf-8")
    done = subprocess.run(
        [node, str(host), wire.as_uri(), *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def test_nothing_is_handed_over_before_somebody_agrees_and_everything_then(tmp_path: Path) -> None:
    answer = run_wire(tmp_path, "agree")
    assert 0 == answer["before"]
    arrived, opened, reply = answer["taken"]
    assert {"PROLIFIC_PID": "5f3a99c", "place": "1"} == arrived["arrived"]["parameters"]
    assert {"tab": "t", "at_ms": 12.5} == opened["opened"]
    assert reply["event"]["reply"] == {"agreed": True, "version": "v"}
    assert "text" == answer["body"]["step"]["kind"]


def test_of_a_refusal_the_refusal_alone_is_handed_over(tmp_path: Path) -> None:
    answer = run_wire(tmp_path, "decline")
    arrived, opened, reply = answer["taken"]
    assert (0, {}) == (answer["before"], arrived["arrived"]["parameters"])
    assert {"tab": "-", "at_ms": 0} == opened["opened"]
    assert {"n": 1, "kind": "reply", "step": 1, "at_ms": 0, "reply": {"agreed": False}} == reply[
        "event"
    ]
    assert "5f3a99c" not in json.dumps(answer["taken"])
    assert {"kind": "end", "outcome": "declined"} == answer["body"]["step"]


ARRIVALS = """
const drawn = [];
for (const place of [undefined, undefined, undefined, "1", "2", "5", "x"]) {
  const { body } = await wire.post("/api/arrive", "", { parameters: { place } });
  const { arrived } = taken.at(-1);
  drawn.push(arrived.place);
  if (drawn.length === 1) {
    const { body: state } = await wire.post("/api/hello", body.key, { tab: "t", at_ms: 12.5 });
    drawn.state = state.step;
  }
}
console.log(JSON.stringify({ drawn, step: drawn.state }));
"""


@pytest.mark.parametrize(
    ("within_h", "step"),
    [(24, {"kind": "text"}), (1e-9, {"kind": "end", "outcome": "expired"})],
)
def test_bundle_hands_out_its_own_places_and_goes_on_with_no_visit_that_is_too_old(
    within_h: float, step: dict[str, str], tmp_path: Path
) -> None:
    head = HOST.partition("const agreed")[0]
    head = head.replace("places: 1,", f"places: [1, 4], within_h: {within_h!r},")
    for place in (1, 4):
        head = head.replace(
            '"places/0.json"',
            f'"places/{place}.json": {{ sha256: "x", steps: [TEXT] }}, "places/0.json"',
        ).replace("TEXT", '{ kind: "text" }')
    answer = in_node(tmp_path, head + ARRIVALS)
    *by_chance, first, second, fifth, other = answer["drawn"]
    assert {1, 4} >= {*by_chance, first, other}
    assert (1, 4) == (second, fifth)
    assert step == answer["step"]

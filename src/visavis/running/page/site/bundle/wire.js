// The wire of a page on another web host: the steps of a place were written down beforehand, and
// this takes the server's part. Every line is in this browser's own store, and where somebody takes
// them (JATOS, or an address of the lab's) handed over, before it is acknowledged.

const jatos = globalThis.jatos;
if (jatos) await new Promise((resolve) => jatos.onLoad(resolve));

const WORKER_MS = 3000;
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// What this page is made of is kept here too, for a reload without a network. JATOS has pages of its
// own; a browser that allows no worker goes on without.
async function keepFiles() {
  const workers = navigator.serviceWorker;
  if (jatos || !workers) return;
  try {
    const isHere = new Promise((resolve) => workers.addEventListener("controllerchange", resolve, { once: true }));
    await workers.register("worker.js");
    if (!workers.controller) await Promise.race([isHere, pause(WORKER_MS)]);
    workers.controller?.postMessage(location.href);
  } catch { /* goes on without */ }
}
await keepFiles();

const bundle = await (await fetch("bundle.json", { cache: "no-store" })).json();
// The places of the plan that this bundle has: so many from the first, or a list of them.
const PLACES = Array.isArray(bundle.places) ? bundle.places : Array.from({ length: bundle.places }, (_, k) => k);
const CLAIM_TRIES = 12;
const CLAIM_PAUSE_MS = 400;
const AGAIN_MS = 2000;
const MAX_AGAIN_MS = 60000;
const ID = /^[A-Za-z0-9_-]{1,64}$/;
const PANELS = ["PROLIFIC_PID", "survey_code", "participant", "id"];

export const scope = `-${bundle.id}${jatos ? `-${jatos.studyResultUuid}` : ""}`;
export const query = () => new URLSearchParams(jatos ? jatos.urlQueryParameters : location.search);
// JATOS gives each run an address of its own: what was begun under it goes on under it.
const RUN = `visavis-run${scope}`;
const remembered = (change) => { try { return change(localStorage); } catch { return null; } };
export const keyHere = () => (jatos ? remembered((k) => k.getItem(RUN)) || "" : location.hash.slice(1));
export const keepKey = (key) => {
  if (jatos) remembered((k) => k.setItem(RUN, key));
  else history.replaceState(null, "", `${location.pathname}#${key}`);
};
export const leave = () => {};
export const film = (name) => fetch(`films/${name}.webm`);
export const asset = (name) => fetch(`assets/${name}`);

// ---- what is kept here ----------------------------------------------------------------------

const resultOf = (request) => new Promise((resolve, reject) => {
  request.onsuccess = () => resolve(request.result);
  request.onerror = () => reject(request.error);
});

async function openStore() {
  try {
    const request = indexedDB.open(`visavis-bundle-${bundle.id}`, 1);
    request.onupgradeneeded = () => request.result.createObjectStore("lines", { keyPath: ["run", "line"] });
    const base = await resultOf(request);
    const change = (act) => new Promise((resolve, reject) => {
      const changing = base.transaction("lines", "readwrite", { durability: "strict" });
      changing.oncomplete = () => resolve();
      changing.onerror = changing.onabort = () => reject(changing.error);
      act(changing.objectStore("lines"));
    });
    const span = (run) => IDBKeyRange.bound([run], [run, []]);
    return {
      of: (run) => resultOf(base.transaction("lines").objectStore("lines").getAll(span(run))),
      all: () => resultOf(base.transaction("lines").objectStore("lines").getAll()),
      put: (lines) => change((s) => { for (const line of lines) s.put(line); }),
      drop: (run) => change((s) => s.delete(span(run))),
    };
  } catch { // a private window of some browsers
    const all = new Map();
    return {
      of: async (run) => [...(all.get(run) || new Map()).values()],
      all: async () => [...all.values()].flatMap((lines) => [...lines.values()]),
      put: async (lines) => { for (const line of lines) all.set(line.run, (all.get(line.run) || new Map()).set(line.line, line)); },
      drop: async (run) => { all.delete(run); },
    };
  }
}

const store = await openStore();
const nowMs = () => performance.timeOrigin + performance.now();
const asText = (lines) => lines.map((line) => `${JSON.stringify(line)}\n`).join("");

async function handOver(lines) {
  if (jatos) { await jatos.appendResultData(asText(lines)); return; }
  if (!bundle.results) return;
  const response = await fetch(bundle.results, { method: "POST", headers: { "Content-Type": "text/plain" }, body: asText(lines) });
  if (!response.ok) throw new Error(`answers were not taken: ${response.status}`);
}

// Line -1 of a run says up to which line somebody has taken them.
async function write(run, lines) {
  await store.put(lines);
  await handOver(lines);
  await store.put([{ run, line: -1, handed: lines.at(-1).line }]);
}

// The parameters of the address; runs begun before 0.3 have them as `told`.
const parametersOf = (arrived) => arrived.parameters ?? arrived.told;

// ---- where a run is ---------------------------------------------------------------------------

// Of the run that is open here: its steps, which of them is shown (from 0), the how-manieth shown
// that is (from 1), and what is acknowledged.
let at = null;

async function stepsOf(place) {
  const response = await fetch(`places/${place}.json`, { cache: "no-store" });
  if (!response.ok) throw new Error(`place ${place} is not there: ${response.status}`);
  return response.json();
}

// A film that failed ends its trial, as it does where a server runs.
function nextIndex(index, hasFailed) {
  const was = at.steps[index];
  let next = index + 1;
  while (hasFailed && at.steps[next]?.trial === was.trial && at.steps[next].is_practice === was.is_practice) next += 1;
  return next;
}

// Where a run is after an event; null where it is a reply to a step that is not shown.
function after(was, event) {
  const now = { ack: event.n, number: was.number, index: was.index, outcome: was.outcome };
  if (event.kind !== "reply") return now;
  if (was.outcome || event.step !== was.number) return null;
  const { reply } = event;
  now.index = nextIndex(was.index, reply.failed);
  if (reply.stop) now.outcome = reply.stop === "keep" ? "stopped" : "withdrawn";
  else if (at.steps[was.index].kind === "consent" && reply.agreed !== true) now.outcome = "declined";
  else if (now.index >= at.steps.length) now.outcome = "done";
  now.number += 1;
  return now;
}

async function openRun(run) {
  if (at?.run === run) return true;
  const lines = (await store.of(run)).sort((a, b) => a.line - b.line);
  const first = lines.find((line) => line.arrived);
  if (!first) return false;
  const place = await stepsOf(first.arrived.place);
  if (place.sha256 !== first.arrived.sha256) return false; // another bundle lies here by now
  const handed = lines[0].line === -1 ? lines.shift().handed : -1;
  const rest = lines.filter((line) => line.line > handed);
  at = { run, steps: place.steps, ack: 0, number: 1, index: 0, outcome: "", next: lines.at(-1).line + 1, parameters: parametersOf(first.arrived) };
  for (const line of lines) if (line.event) Object.assign(at, after(at, line.event));
  // What is too old to go on with is kept and told as far as it came.
  if (!at.outcome && bundle.within_h && nowMs() - first.at_ms > bundle.within_h * 3600000) at.outcome = "expired";
  // kept as the connection was lost, or the page closed
  if (rest.length && !isBeforeConsent(at)) await write(run, rest);
  return true;
}

// Until somebody agrees, what they did stays in this browser.
const isBeforeConsent = (of) => !of.outcome && of.steps[of.index].kind === "consent";

// Of who refuses, the refusal is kept and handed over, and nothing of how they came.
async function refuse(run, line) {
  const { arrived, at_ms } = (await store.of(run)).find((one) => one.arrived);
  const { n, kind, step } = line.event;
  const lines = [
    { run, line: 0, at_ms, arrived: { ...arrived, parameters: {} } },
    { run, line: 1, at_ms: line.at_ms, opened: { tab: "-", at_ms: 0 } },
    { run, line: 2, at_ms: line.at_ms, tab: "-", event: { n, kind, step, at_ms: 0, reply: { agreed: false } } },
  ];
  await store.drop(run);
  await write(run, lines);
  return lines.length;
}

const state = () => ({ ack: at.ack, number: at.number, step: at.outcome ? { kind: "end", outcome: at.outcome } : at.steps[at.index] });

function completion() {
  const name = PANELS.find((n) => at.parameters[n]);
  return bundle.completion.replaceAll("{id}", encodeURIComponent(name ? at.parameters[name] : ""));
}

// ---- what the server would answer -------------------------------------------------------------

const claimName = (place) => `visavis-${bundle.id}-${place}`;

// JATOS keeps one list for all who come: everybody claims the first place that nobody has. Null
// where there is none, undefined where others were quicker each time.
async function claimed(run) {
  for (let attempt = 0; attempt < CLAIM_TRIES; attempt += 1) {
    const claims = jatos.batchSession.getAll() || {};
    const place = PLACES.find((k) => claims[claimName(k)] === undefined);
    if (place === undefined) return null;
    try {
      await jatos.batchSession.set(claimName(place), run);
      return place;
    } catch {
      await pause(CLAIM_PAUSE_MS * (1 + Math.random())); // somebody else was quicker
    }
  }
  return undefined;
}

async function placeOf(parameters, run) {
  if (jatos?.batchSession) return claimed(run);
  const number = Number(parameters.place ?? NaN);
  if (PLACES.includes(number - 1)) return number - 1;
  return PLACES[crypto.getRandomValues(new Uint32Array(1))[0] % PLACES.length];
}

// The run that somebody of a panel has in this browser; JATOS's own address says which it is.
async function runOf(name, identifier) {
  if (jatos || !name) return undefined;
  return (await store.all()).find((line) => line.arrived && parametersOf(line.arrived)[name] === identifier)?.run;
}

async function arrive({ parameters }) {
  const name = PANELS.find((n) => parameters[n] !== undefined);
  const { words } = bundle.about;
  if (name && !ID.test(parameters[name])) return { refused: "address", text: words.address };
  const before = await runOf(name, parameters[name]);
  if (before) return { key: before };
  const run = [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");
  const place = await placeOf(parameters, run);
  if (place === null) return { refused: "full", text: words.full };
  if (place === undefined) return { refused: "busy", text: words.busy };
  const { sha256, steps } = await stepsOf(place);
  const { format, study, seed, id } = bundle;
  await (steps[0].kind === "consent" ? store.put : write.bind(null, run))([{ run, line: 0, at_ms: nowMs(), arrived: { format, study, seed, bundle: id, place, sha256, parameters } }]);
  return { key: run };
}

async function hello({ tab, at_ms }) {
  const line = { run: at.run, line: at.next++, at_ms: nowMs(), opened: { tab, at_ms } };
  await (isBeforeConsent(at) ? store.put([line]) : write(at.run, [line]));
  return { ...bundle.about, completion: completion(), ...state() };
}

async function take({ tab, events }) {
  let now = { ack: at.ack, number: at.number, index: at.index, outcome: at.outcome };
  const lines = [];
  let isRefused = false;
  for (const event of events.filter((e) => e.n > at.ack)) {
    const then = after(now, event);
    isRefused = then === null; // somebody pressed twice: the page says hello and drops the second
    if (isRefused) break;
    now = then;
    lines.push({ run: at.run, line: at.next + lines.length, at_ms: nowMs(), tab, event });
  }
  if (lines.length) {
    let next = at.next + lines.length;
    if (now.outcome === "declined") next = await refuse(at.run, lines.at(-1));
    else if (isBeforeConsent({ ...at, ...now })) await store.put(lines);
    else if (isBeforeConsent(at)) await write(at.run, [...(await store.of(at.run)).filter((one) => one.line >= 0), ...lines]);
    else await write(at.run, lines);
    Object.assign(at, now, { next });
  }
  return isRefused ? { status: 400, body: { refused: "that step is not shown" } } : { status: 200, body: state() };
}

export async function post(path, key, body) {
  if (path === "/api/arrive") return { status: 200, body: await arrive(body) };
  if (!await openRun(key)) return { status: 400, body: { refused: "this browser knows no such session" } };
  return path === "/api/hello" ? { status: 200, body: await hello(body) } : take(body);
}

// ---- the end ----------------------------------------------------------------------------------

// jatos.js ends a run once in a page: where that failed, a page that is loaded anew asks again, as soon
// as the host answers. Only then is forgotten here what is to be deleted there.
async function endInJatos(outcome, place) {
  const mark = `visavis-ended-${at.run}`;
  const tries = `visavis-ending-${at.run}`;
  if (remembered((k) => k.getItem(mark))) return;
  try {
    if (outcome === "withdrawn" || outcome === "declined") await giveBack(claimName(place));
    if (outcome === "withdrawn") await (jatos.abortStudyWithoutRedirect || jatos.abortStudyAjax)("stop and delete");
    else await (jatos.endStudyWithoutRedirect || jatos.endStudyAjax)(outcome === "done", outcome);
  } catch (error) {
    const count = Number(remembered((k) => k.getItem(tries))) || 0;
    remembered((k) => k.setItem(tries, count + 1));
    hostAnswers(Math.min(AGAIN_MS * 2 ** count, MAX_AGAIN_MS)).then(() => location.reload());
    throw error;
  }
  remembered((k) => k.setItem(mark, "1"));
  if (outcome === "withdrawn") await store.drop(at.run);
}

// The place is another's; one that somebody else has claimed by now stays theirs.
async function giveBack(claim) {
  try {
    if ((jatos.batchSession.getAll() || {})[claim] === at.run) await jatos.batchSession.remove(`/${claim}`);
  } catch { /* it stays given */ }
}

async function hostAnswers(everyMs) {
  for (;;) {
    await pause(everyMs);
    try { if ((await fetch("bundle.json", { cache: "no-store" })).ok) return; } catch { /* not yet */ }
  }
}

// Whose answers nobody took has them as a file; who wants them deleted, deleted wherever they are.
export async function finish(outcome) {
  const lines = (await store.of(at.run)).filter((line) => line.line >= 0);
  if (jatos) { await endInJatos(outcome, lines[0]?.arrived.place); return null; }
  if (outcome === "withdrawn") await store.drop(at.run);
  if (bundle.results || outcome === "withdrawn" || outcome === "declined") return null;
  const name = `${bundle.study}-${at.run.slice(0, 8)}.jsonl`;
  return { name, address: URL.createObjectURL(new Blob([asText(lines)], { type: "application/x-ndjson" })) };
}

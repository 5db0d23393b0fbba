// The participant's page: shows the step the server tells, and sends numbered events until each is
// acknowledged, which means that it is on the server's disk.

import { openStore } from "./store.js";
import * as film from "./film.js";
import * as flat from "./flat.js";
import * as sound from "./sound.js";
import * as wire from "./wire.js";

const BEAT_MS = 4000;
const WAITING_MS = 3000;
const RETRY_MS = [200, 400, 800, 1500, 2000];
const REPEAT_ASKING_MS = 2500;
const MAX_AT_ONCE = 200;
const MAX_BYTES = 256 * 1024;
const MAX_WAITING = 4800; // events: ten minutes of a headset's four streams
const MAX_HEARD = 64;

const SESSION = `visavis-session${wire.scope}`;
const ONWARD_MS = 4000;
const BUSY_MS = 5000;
const DOUBLE_MS = 500;
const CODE_DIGITS = 6;
const ENTERED_MS = 300;
// A CSS pixel by its standard, and where a centimetre is a degree: for who could not measure theirs.
const USUAL_PX_PER_MM = 96 / 25.4;
const USUAL_DISTANCE_MM = 570;
// What an address may say about whoever comes; other parameters stay here.
const OF_ARRIVALS = ["PROLIFIC_PID", "STUDY_ID", "SESSION_ID", "survey_code", "participant", "id", "place"];

let key = wire.keyHere();
const tab = globalThis.crypto?.randomUUID?.() || `${Date.now()}-${Math.random().toString(36).slice(2)}`;
const main = document.getElementById("main");
const notice = document.getElementById("notice");
const stop = document.getElementById("stop");

let store = null;
let words = {};
let queue = [];
let next = 1;
let stepNumber = -1;
let replyNumber = -1;
let isSending = false;
let isOver = false;
let cleanUp = () => {};
let hiddenSince = null;
let hiddenMs = 0;
let putMs = 0;
let mostBytes = MAX_BYTES;
let posts = 0;
let arrivals = []; // of earlier posts: number, and when their answers came

// ---- small things ---------------------------------------------------------------------------

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== undefined && value !== null) node.setAttribute(name, value);
  }
  node.append(...children.filter((c) => c !== null && c !== undefined));
  return node;
}

const say = (name, values = {}) => (words[name] || "").replace(/\{(\w+)\}/g, (_, n) => values[n] ?? "");
// The second click of a double click is not meant for the page that the first one brought.
const once = (act) => (e) => { if (e.detail < 2 || performance.now() - putMs > DOUBLE_MS) act(e); };
const button = (text, act, quiet = false) => element("button", { type: "button", class: quiet ? "quiet" : false, onclick: once(act) }, text);
const paragraph = (text, kind) => element("p", { class: kind || false }, text);

const whomToAsk = () => (contact ? paragraph(say("contact", { contact }), "contact") : null);

function tell(text, ...more) {
  notice.replaceChildren(...(text ? [paragraph(text), ...more] : []));
}

function put(kind, ...children) {
  putMs = performance.now();
  main.className = kind;
  main.replaceChildren(...children.filter((c) => c !== null && c !== undefined));
  main.focus({ preventScroll: true });
  scrollTo(0, 0);
}

// ---- the wire -------------------------------------------------------------------------------

const post = (path, body) => wire.post(path, key, body);

async function send(kind, more = {}) {
  if ((isOver || !mayRecord()) && kind !== "reply") return;
  if (kind === "stream" && queue.length >= MAX_WAITING) { giveUp(); return; }
  const event = { n: next++, kind, at_ms: performance.now(), tab, ...more };
  queue.push(event);
  numberRows(event);
  await store.put(event);
  flush();
}

function numberRows({ kind, stream, seq0, rows }) {
  if (kind === "stream") nextRows[stream] = Math.max(nextRows[stream] || 0, seq0 + rows);
}

// A post stays far below what a server takes at once, however long the connection was lost.
function firstOf(events) {
  let bytes = 0;
  const end = events.findIndex((e, i) => { bytes += JSON.stringify(e).length; return i >= MAX_AT_ONCE || (i > 0 && bytes > mostBytes); });
  return end < 0 ? events : events.slice(0, end);
}

async function flush() {
  if (isSending || isOver) return;
  isSending = true;
  let failures = 0;
  let isLate = false;
  try {
    do {
      const sent = firstOf(queue);
      let answer;
      const waiting = setTimeout(() => { isLate = true; tell(say("waiting")); }, WAITING_MS);
      try {
        // Four times of an exchange say how the clocks of page and server lie.
        posts += 1;
        const [number, latest] = [posts, arrivals.slice(-MAX_HEARD)];
        const times = mayRecord() ? { sent_ms: performance.now(), wall_ms: Date.now(), post: number, heard: latest } : {};
        answer = await post("/api/events", { tab, events: sent, ...times });
        arrivals = [...arrivals.slice(latest.length), [number, performance.now()]];
      } catch {
        failures += 1;
        if (failures > 1) tell(say("lost"));
        await new Promise((r) => setTimeout(r, RETRY_MS[Math.min(failures, RETRY_MS.length) - 1]));
        continue;
      } finally {
        clearTimeout(waiting);
      }
      if (answer.status === 409) { elsewhere(); return; }
      if (answer.status === 413 && sent.length > 1) { mostBytes = Math.min(mostBytes / 2, answer.body.max_bytes ?? Infinity); continue; }
      const bad = answer.body.event || (answer.status === 413 && sent.length === 1 ? sent[0].n : 0);
      if (bad && queue.some((e) => e.n === bad)) { await setAside(bad, answer.body.refused); continue; }
      if (answer.status === 400 && failures < 3) { // a server that began anew and knows us not yet
        failures += 1;
        await new Promise((r) => setTimeout(r, RETRY_MS[failures]));
        const again = await hello(false);
        if (again.status === 200 && !again.body.failed && !queue.length) await take(again.body);
        continue;
      }
      if (answer.status !== 200 || answer.body.failed) { showProblem(answer.body.refused || answer.body.failed); return; }
      if (failures || isLate) tell("");
      [failures, isLate] = [0, false];
      await take(answer.body);
    } while (queue.length && !isOver); // what happens after the end is recorded nowhere
  } finally {
    isSending = false;
  }
}

// What the server cannot take would be sent for ever, and nothing behind it.
async function setAside(n, why) {
  const wrong = queue.find((e) => e.n === n);
  queue = queue.filter((e) => e !== wrong);
  for (const e of queue) if (e.n > n) e.n -= 1;
  next -= 1;
  await store.replace(queue);
  if (wrong.kind === "problem") return;
  if (wrong.kind === "reply" && wrong.step === stepNumber) {
    replyNumber = -1;
    tell(`${say("failed")} ${why || ""}`);
    if (current.kind) show(current);
  }
  send("problem", { what: `${wrong.kind} ${n} was set aside: ${why}`.slice(0, 200) });
}

async function take(state) {
  queue = queue.filter((e) => e.n > state.ack);
  await store.drop(state.ack);
  if (state.number !== stepNumber) {
    stepNumber = state.number;
    replyNumber = -1;
    show(state.step);
  }
}

// What waits has no end: a trial ends that was not recorded on, and says why.
function giveUp() {
  tell(say("away"));
  if (!["watch", "mould"].includes(current.kind) || replyNumber === stepNumber) return;
  cleanUp();
  reply({ shown_ms: performance.now(), failed: { why: "the network was away" } });
}

async function hello(takesOver) {
  const before = await store.get("tab");
  const answer = await post("/api/hello", { tab, before: before && before !== tab ? before : "", takes_over: takesOver,
    at_ms: performance.now() });
  if (answer.status === 409) return answer;
  if (answer.status !== 200 || answer.body.failed) return answer;
  await store.set("tab", tab);
  const state = answer.body;
  nextRows = { ...state.streams };
  helloKind = state.step.kind;
  // A reply to a step that has passed was given elsewhere; what is left is numbered anew.
  const rest = queue.filter((e) => e.n > state.ack && (e.kind !== "reply" || e.step === state.number));
  rest.forEach((e, i) => { e.n = state.ack + 1 + i; });
  queue = rest;
  next = state.ack + 1 + rest.length;
  rest.forEach(numberRows);
  await store.replace(rest);
  return answer;
}

async function about() {
  return {
    user_agent: navigator.userAgent,
    languages: [...(navigator.languages || [])],
    screen_px: [screen.width, screen.height],
    view_px: [innerWidth, innerHeight],
    pixel_ratio: devicePixelRatio,
    refresh_hz: await refreshHz(),
    touch_points: navigator.maxTouchPoints || 0,
    is_automated: navigator.webdriver === true,
    keeps_events: store.isDurable,
    checks_files: Boolean(globalThis.crypto?.subtle),
    tells_frames: "requestVideoFrameCallback" in HTMLVideoElement.prototype,
  };
}

let refresh = null;
async function refreshHz() {
  if (refresh !== null || document.hidden) return refresh;
  const times = [];
  await new Promise((resolve) => {
    const look = (t) => { times.push(t); if (times.length > 20) resolve(); else requestAnimationFrame(look); };
    requestAnimationFrame(look);
    setTimeout(resolve, 1000);
  });
  const gaps = times.slice(1).map((t, i) => t - times[i]).sort((a, b) => a - b);
  refresh = gaps.length ? Math.round(10000 / gaps[gaps.length >> 1]) / 10 : null;
  return refresh;
}

const reply = (content) => {
  if (replyNumber === stepNumber) return undefined; // pressed twice
  replyNumber = stepNumber;
  tell("");
  headset?.close();
  const breaks = sound.breaksSince();
  const whole = mayRecord() ? { hidden_ms: hiddenNow(), ...(breaks ? { sound_breaks: breaks } : {}), ...content } : content;
  stop.hidden = true;
  return send("reply", { step: stepNumber, reply: whole });
};

// ---- what happens around a step -------------------------------------------------------------

function hiddenNow() {
  return hiddenMs + (hiddenSince === null ? 0 : performance.now() - hiddenSince);
}

document.addEventListener("visibilitychange", () => {
  if (document.hidden) hiddenSince = performance.now();
  else if (hiddenSince !== null) { hiddenMs += performance.now() - hiddenSince; hiddenSince = null; }
  if (store && stepNumber >= 0) send("visibility", { is_visible: !document.hidden });
});
document.addEventListener("fullscreenchange", () => { if (stepNumber >= 0) send("fullscreen", { is_full: !!document.fullscreenElement }); });
let resizing = 0;
addEventListener("resize", () => {
  clearTimeout(resizing);
  resizing = setTimeout(() => { if (stepNumber >= 0) send("resize", { view_px: [innerWidth, innerHeight], pixel_ratio: devicePixelRatio }); }, 400);
});
addEventListener("error", (e) => { if (stepNumber >= 0) send("problem", { what: String(e.message).slice(0, 200) }); });
addEventListener("pagehide", () => wire.leave(key, tab));

function elsewhere() {
  cleanUp();
  isOver = true;
  stop.hidden = true;
  put("narrow", element("h1", {}, say("elsewhere") || "This study is open in another tab."),
    element("div", { class: "buttons" }, button(say("here") || "Go on here", () => { isOver = false; stepNumber = -1; begin(true); })));
}

function showProblem(why) {
  cleanUp();
  isOver = true;
  stop.hidden = true;
  put("narrow", paragraph(say("failed") || "Something failed."), paragraph(why || "", "hint"), whomToAsk(),
    element("div", { class: "buttons" }, button(say("again") || "Try again", () => location.reload())));
}

stop.addEventListener("click", () => {
  cleanUp();
  put("narrow", element("h1", {}, say("stop_title")), paragraph(say("stop_text")), whomToAsk(),
    element("div", { class: "buttons" },
      button(say("stop_back"), () => { const step = current; show(step); }),
      button(say("stop_keep"), () => reply({ stop: "keep" }), true),
      button(say("stop_delete"), () => reply({ stop: "delete" }), true)));
});

// ---- a headset ------------------------------------------------------------------------------

const around = document.getElementById("headset");
let headset = null;
let ofHeadset = null; // the step by which somebody entered
let nextRows = {}; // of each stream: behind what the server has, waits here or was sent from here
let onHeadset = () => {};

const WITHOUT = ["", "consent", "enter", "end"];
const QUESTIONS = "questions";
const INTERRUPTS = ["blurred", "hidden", "off"];

async function enterHeadset(step) {
  const { enter } = await import("./headset.js");
  headset = await enter(step, { main, notice: around, stop, say, send, happened, next: { ...nextRows } });
  ofHeadset = step;
  await store.set("vr", step);
  globalThis.dispatchEvent(new CustomEvent("headset", { detail: headset }));
}

function tellAround(text, ...more) {
  around.replaceChildren(...(text ? [paragraph(text), element("div", { class: "buttons" }, ...more)] : []));
}

// Each is flagged by the server; here what was seen in part is shown again, and answers stay.
function happened(what) {
  if (what === "ended") {
    headset = null;
    askBack();
  } else if (INTERRUPTS.includes(what)) tellAround(say("vr_paused"));
  else if (what === "controllers_asleep") tellAround(say("vr_controllers"));
  else if (["visible", "on", "controllers_awake", "hands"].includes(what) && headset && !headset.isPaused()) tellAround("");
  onHeadset(what);
}

// Who left VR to type something goes on outside until something else than questions comes.
let isOutside = false;
const isTyped = (question) => !question.options?.length && question.kind !== "slider";

function askBack() {
  isOutside = current.kind === QUESTIONS && (isOutside || current.questions.some(isTyped));
  if (!isOver && !isOutside && !WITHOUT.includes(current.kind)) offerHeadset();
}

// Somebody may come back, go on at the screen where the study allows it, or leave this trial out.
function offerHeadset() {
  main.inert = true;
  const settle = () => { main.inert = false; tellAround(""); };
  const isFigure = current.kind === "mould" || (current.kind === "watch" && current.live);
  tellAround(say("vr_ended"),
    button(say("vr_enter"), async () => {
      try {
        await enterHeadset(ofHeadset);
        settle();
        send("xr", { what: "entered", detail: "again" });
        onHeadset("entered");
      } catch (error) { tell(say("vr_failed", { why: String(error.message || error) })); }
    }),
    ofHeadset.xr === "optional" ? button(say("vr_screen"), () => { settle(); store.set("vr", null); onHeadset("screen"); }, true) : "",
    isFigure ? button(say("skip"), () => {
      settle();
      cleanUp();
      reply({ shown_ms: performance.now(), failed: { why: "VR ended" } });
    }, true) : "");
}

// Let a step's figure be drawn in the headset, now and whenever somebody comes back.
async function drawInHeadset(figure, repeated, mayRepeat) {
  let isHeld = false;
  const again = () => { isHeld = false; figure.resume(mayRepeat); if (mayRepeat) repeated(); };
  onHeadset = async (what) => {
    if (INTERRUPTS.includes(what)) { isHeld = true; figure.pause(); }
    else if (what === "ended") { isHeld = true; figure.pause(); await figure.enter(null); }
    else if (what === "entered") { await figure.enter(headset); again(); }
    else if (what === "screen" || what === "reset") again();
    else if (isHeld && ["visible", "on"].includes(what) && !headset?.isPaused()) again();
  };
  if (headset) await figure.enter(headset);
  if (headset?.isPaused()) { isHeld = true; figure.pause(); }
}

// ---- keys -----------------------------------------------------------------------------------

// The digit that a key stands for, 1 to 9, else 0. Keys of the digit row count on any keyboard: on a
// French one they write other signs without shift. A key that is held answers once.
export function digitOf(e) {
  if (e.repeat) return 0;
  if (/^[1-9]$/.test(e.key)) return Number(e.key);
  const place = e.shiftKey ? null : /^Digit([1-9])$/.exec(e.code || "");
  return place ? Number(place[1]) : 0;
}

// The option that a key stands for, by its digit or the study's own letter; -1 for none.
export function optionOf(e, keys) {
  const at = e.repeat ? -1 : keys.indexOf(e.key.toLowerCase());
  return at >= 0 && e.key.length === 1 ? at : digitOf(e) - 1;
}

// ---- questions ------------------------------------------------------------------------------

export function questionField(question, index, changed) {
  let answer = null;
  const choose = (option, by) => { answer = { option, at_ms: performance.now(), by }; changed(); };
  const byOf = (e) => (e.pointerType ? e.pointerType : "keys");
  const legend = [question.prompt, question.is_optional ? element("span", { class: "optional" }, ` (${say("optional")})`) : null];
  let by = "mouse";
  let field;
  let controls = [];
  if (question.options?.length) {
    controls = question.options.map((option) => element("input", { type: "radio", name: `q${index}`, value: option.value,
      onchange: () => choose(option.value, by) }));
    const isShort = question.options.every((o) => o.label.length <= 2);
    const kind = question.kind === "list" ? "list" : isShort ? "short" : "";
    field = element("fieldset", {}, element("legend", {}, ...legend),
      element("div", { class: `options ${kind}` }, ...question.options.map((o, i) => element("label", {}, controls[i],
        element("span", {}, ...(o.key ? [element("kbd", {}, o.key.toUpperCase()), " "] : []), o.label)))));
    field.addEventListener("pointerdown", (e) => { by = e.pointerType || "mouse"; });
    field.addEventListener("keydown", () => { by = "keys"; });
  } else if (question.kind === "slider") {
    const out = element("output", {}, "–");
    const control = element("input", { type: "range", min: question.low, max: question.high, step: question.step, value: (question.low + question.high) / 2,
      "aria-label": question.prompt });
    const holder = element("div", { class: "slider untouched" }, element("span", {}, `${question.low}`), control, element("span", {}, `${question.high}`), out);
    const onMove = (e) => { holder.classList.remove("untouched"); out.value = `${control.value} ${question.unit === "1" ? "" : question.unit}`; choose(control.value, byOf(e)); };
    control.addEventListener("pointerdown", (e) => { by = e.pointerType || "mouse"; });
    control.addEventListener("keydown", () => { by = "keys"; });
    control.addEventListener("input", () => onMove({ pointerType: by === "keys" ? "" : by }));
    control.addEventListener("pointerup", onMove);
    controls = [control];
    field = element("fieldset", {}, element("legend", {}, ...legend), holder);
  } else {
    const isText = question.kind === "text";
    const control = element(isText ? "textarea" : "input", { type: isText ? false : "text", class: isText ? false : "number",
      rows: isText ? 3 : false, maxlength: isText ? 10000 : 20, inputmode: isText ? false : "decimal", autocomplete: "off", id: `q${index}` });
    let way = "keys"; // of what stands there: "pasted" once anything of it was, until it is empty
    for (const name of ["paste", "drop"]) control.addEventListener(name, () => { way = "pasted"; });
    control.addEventListener("input", () => {
      const text = control.value.trim();
      choose(text === "" ? null : text, way);
      if (text === "") way = "keys";
    });
    controls = [control];
    field = element("div", {}, element("label", { class: "prompt", for: `q${index}` }, ...legend), control);
  }
  const isNumber = question.kind === "number";
  return {
    field,
    controls,
    name: question.name,
    isHeld: Boolean(question.is_held),
    keys: (question.options || []).map((o) => o.key || ""),
    answer: () => answer,
    isFine: () => {
      const option = answer?.option ?? null;
      if (option === null) return Boolean(question.is_optional) || question.kind === "text";
      if (!isNumber) return true;
      const value = Number(option.replace(",", "."));
      return /^-?\d{1,12}([.,]\d{1,12})?$/.test(option) && !(value < question.low) && !(value > question.high);
    },
    enable: (on) => { for (const c of controls) c.disabled = !on; },
    pick: (i) => { if (controls[i] && !controls[i].disabled && controls[i].type === "radio") { by = "keys"; controls[i].click(); controls[i].focus(); } },
  };
}

// ---- steps ----------------------------------------------------------------------------------

let current = { kind: "" };
let helloKind = ""; // of the step that the server said first: what waits is sent before it is shown
let isDescribed = false;

// Before somebody agrees, nothing leaves this page but what a request needs.
const mayRecord = () => !["", "consent", "end"].includes(current.kind || helloKind);

async function describe() {
  if (isDescribed || !mayRecord()) return;
  isDescribed = true;
  const facts = await about();
  send("about", { about: facts });
}

// Draw a step's figures and send how they and the camera move; null where another step came meanwhile.
async function opened(step, canvas, ended, began, repeated = () => {}) {
  const live = await import("./live.js");
  const own = { step: stepNumber, names: step.motions ? [] : step.questions.map((q) => q.name) };
  const figure = await live.open(step, canvas, key, (rows) => send("moved", { ...own, ...rows }), ended, began);
  if (current !== step) { figure.close(); return null; }
  if (ofHeadset) await drawInHeadset(figure, repeated, Boolean(step.motions));
  canvas.dataset.ready = "true";
  return figure;
}

// A browser plays nothing before a gesture, and may stop later: then the page asks for another one.
async function awaitSound(where) {
  while (!await sound.wake()) {
    await new Promise((resolve) => {
      const line = paragraph(say("sound_needed"));
      const on = button(say("sound_on"), () => { sound.wake(); line.remove(); on.remove(); resolve(); });
      where.append(line, element("div", { class: "buttons" }, on));
      on.focus();
    });
  }
}

// What sounds in a trial ends with it.
let soundingTrial = "";
function endSounds(step) {
  const trial = step.trial ? `${step.is_practice} ${step.trial} ${step.again || 0}` : "";
  if (trial !== soundingTrial) sound.hush();
  soundingTrial = trial;
}

const steps = {
  consent(step) {
    const box = element("input", { type: "checkbox", id: "agree", onchange: () => { go.disabled = !box.checked; } });
    const go = button(say("begin"), () => reply({ agreed: true, version: step.version }));
    go.disabled = true;
    put("narrow", element("h1", {}, step.title), step.information ? paragraph(step.information) : null,
      paragraph(step.recorded.before), element("ul", {}, ...step.recorded.lines.map((line) => element("li", {}, line))),
      paragraph(step.recorded.after), paragraph(step.text),
      element("div", { class: "agree" }, box, element("label", { for: "agree" }, say("agree"))),
      whomToAsk(),
      element("div", { class: "buttons" }, go, button(say("decline"), () => reply({ agreed: false, version: step.version }), true)));
  },

  // The width of a card held against the screen says how large its pixels are.
  card(step) {
    const [width, height] = step.card_mm;
    const card = element("div", { class: "card" });
    const most = Math.max(200, Math.min(main.clientWidth - 8, 900));
    const slider = element("input", { type: "range", min: 120, max: most, step: 1, value: 220, "aria-label": say("card_title") });
    const finish = async (pxPerMm) => {
      if (!step.usual_distance_mm) { reply({ px_per_mm: pxPerMm }); return; }
      const distanceMm = far.value.trim() === "" ? null : 10 * Number(far.value.trim().replace(",", "."));
      if (distanceMm !== null && !(distanceMm >= 150 && distanceMm <= 3000)) { far.focus(); return; }
      await store.set("screen", { px_per_mm: pxPerMm, distance_mm: distanceMm });
      reply({ px_per_mm: pxPerMm, distance_mm: distanceMm });
    };
    const far = element("input", { type: "text", class: "number", id: "far", inputmode: "decimal", maxlength: 6, autocomplete: "off" });
    const distance = step.usual_distance_mm
      ? element("div", {}, element("label", { class: "prompt", for: "far" }, say("card_distance", { usual: step.usual_distance_mm / 10 })), far) : null;
    const go = button(say("next"), () => finish(Number(slider.value) / width));
    go.disabled = true;
    const draw = () => { card.style.width = `${slider.value}px`; card.style.height = `${slider.value * height / width}px`; };
    slider.addEventListener("input", () => { go.disabled = false; draw(); });
    put("narrow", element("h1", {}, say("card_title")), paragraph(say("card_text")), card, element("div", { class: "slider" }, slider), distance,
      element("div", { class: "buttons" }, go, button(say("card_none"), () => finish(null), true)));
    draw();
  },

  // Who types what was said can hear this computer; who hears nothing says so.
  sound(step) {
    const bytes = Uint8Array.from(atob(step.wav), (c) => c.charCodeAt(0));
    const voice = new Audio(URL.createObjectURL(new Blob([bytes], { type: "audio/wav" })));
    let played = 0;
    const hint = paragraph("", "hint");
    const field = element("input", { type: "text", class: "number", id: "heard", inputmode: "numeric", maxlength: 8, autocomplete: "off" });
    const go = button(say("next"), () => finish(field.value.trim()));
    go.disabled = true;
    const finish = (heard) => { cleanUp(); reply({ heard, played }); };
    const play = button(say("sound_play"), () => {
      voice.currentTime = 0;
      voice.play().then(() => { played += 1; field.focus(); }, (error) => { hint.textContent = String(error.message || error); });
    });
    field.addEventListener("input", () => { go.disabled = !/^\d{1,8}$/.test(field.value.trim()); });
    field.addEventListener("keydown", (e) => { if (e.key === "Enter" && !e.repeat && !go.disabled) go.click(); });
    cleanUp = () => { voice.pause(); cleanUp = () => {}; };
    put("narrow", element("h1", {}, say("sound_title")), paragraph(say("sound_text")), element("div", { class: "buttons" }, play), hint,
      element("div", {}, element("label", { class: "prompt", for: "heard" }, say("sound_heard")), field),
      element("div", { class: "buttons" }, go, button(say("sound_none"), () => finish(null), true)));
  },

  async preload(step) {
    const assets = step.assets || [];
    const pictures = step.pictures || [];
    const sounds = step.sounds || [];
    const first = assets.length + pictures.length + sounds.length;
    const all = first + step.films.length;
    const bar = element("progress", { max: all, value: 0, "aria-label": say("loading", { n: 0, m: all }) });
    const line = paragraph("");
    const report = (n) => { bar.value = n; line.textContent = say("loading", { n, m: all }); };
    report(0);
    put("narrow", line, bar);
    const pictureReports = {};
    try {
      // The library that draws figures is loaded only by studies that show some.
      if (assets.length) {
        const live = await import("./live.js");
        for (const asset of assets) { await live.load(asset, key); report(bar.value + 1); }
      }
      for (const picture of pictures) { pictureReports[picture.picture] = await flat.load(picture, key); report(bar.value + 1); }
      for (const one of sounds) { await sound.load(one, key); report(bar.value + 1); }
    } catch (error) {
      put("narrow", paragraph(say("load_failed", { why: String(error.message || error) })), element("div", { class: "buttons" }, button(say("again"), () => steps.preload(step))));
      return;
    }
    const { reports, failures } = await film.loadAll(step.films, key, (n) => report(first + n));
    if (sounds.length) await awaitSound(main);
    if (current !== step) return;
    const more = pictures.length ? { pictures: pictureReports } : {};
    if (!failures.length) { reply({ films: reports, ...more }); return; }
    put("narrow", paragraph(say("load_failed", { why: failures[0].why })), element("div", { class: "buttons" },
      button(say("again"), () => steps.preload(step)),
      button(say("skip"), () => reply({ ...more, films: { ...reports, ...Object.fromEntries(failures.map((f) => [f.film.film, { failed: f.why }])) } }), true)));
  },

  hush() {
    sound.hush();
    reply({});
  },

  // Texts, pictures, shapes, gratings and sounds, one after another; see flat.js.
  async show(step) {
    const sounds = step.parts.flatMap((part) => part.sounds || []);
    if (sounds.length && !sound.isAwake()) {
      put("narrow");
      await awaitSound(main);
      if (current !== step) return;
    }
    const shownMs = performance.now();
    hiddenMs = 0;
    if (hiddenSince !== null) hiddenSince = shownMs;
    // What stood there last stays until the next is drawn: a change of pages must not flash.
    const holder = element("div", { class: "stage" });
    holder.style.background = step.parts[0].background;
    put("flat", holder);
    let opened = null;
    const leave = (e) => { if (e.key === "Escape") stop.click(); };
    document.addEventListener("keydown", leave);
    cleanUp = () => { document.removeEventListener("keydown", leave); if (opened) opened.close(); cleanUp = () => {}; };
    const measured = (await store.get("screen")) || {};
    const screen = { px_per_mm: measured.px_per_mm ?? null, distance_mm: measured.distance_mm ?? null };
    const showFailure = (failed) => {
      if (current !== step) return;
      cleanUp();
      put("narrow", paragraph(say(failed.sound ? "sound_failed" : "play_failed", { why: failed.why })), element("div", { class: "buttons" },
        button(say("again"), () => show(step)),
        button(say("skip"), () => reply({ shown_ms: shownMs, failed }), true)));
    };
    const inUse = { px_per_mm: screen.px_per_mm ?? USUAL_PX_PER_MM, distance_mm: screen.distance_mm ?? USUAL_DISTANCE_MM };
    try {
      const frameMs = 1000 / (await refreshHz() || 60);
      for (const picture of flat.picturesOf(step.parts)) await flat.load(picture, key);
      for (const one of sounds) await sound.load(one, key);
      for (const one of step.parts.flatMap((part) => part.items).filter((item) => item.kind === "video")) await film.load(one, key);
      if (current !== step) return;
      opened = await flat.open(step, holder, inUse, frameMs, (content) => {
        cleanUp();
        reply({ shown_ms: shownMs, screen, ...content });
      }, (error) => showFailure({ ...(error.file ? { file: error.file } : { sound: true }), why: error.message }));
      if (current !== step) opened.close();
    } catch (error) {
      showFailure({ file: error.file || "", why: String(error.message || error) });
    }
  },

  // A browser enters a headset only where somebody presses a button.
  async enter(step) {
    const hint = paragraph("", "hint");
    const go = button(say("vr_enter"), async () => {
      go.disabled = true;
      try {
        await enterHeadset(step);
        await new Promise((resolve) => setTimeout(resolve, ENTERED_MS)); // controllers wake, frames come
        if (headset) reply({ ...headset.facts(), version: step.version });
        else go.disabled = false; // VR ended meanwhile
      } catch (error) {
        hint.textContent = say("vr_failed", { why: String(error.message || error) });
        go.disabled = false;
      }
    });
    let why = "";
    const screen = button(say("vr_screen"), () => reply({ entered: false, why: why.slice(0, 200) || "by choice" }), true);
    go.disabled = true;
    put("narrow", element("h1", {}, say("vr_title")), element("ul", {}, ...(step.lines || []).map((line) => element("li", {}, line))), hint,
      element("div", { class: "buttons" }, go, step.xr === "optional" ? screen : null));
    const { whyNot } = await import("./headset.js");
    why = await whyNot();
    go.disabled = Boolean(why);
    if (why) hint.textContent = say(step.xr === "optional" ? "vr_none" : "vr_needed", { why });
  },

  text(step) {
    put("narrow", element("h1", {}, step.title || ""), paragraph(step.text),
      element("div", { class: "buttons" }, button(say("next"), () => reply({}))));
  },

  blank(step) {
    put("narrow");
    const timer = setTimeout(() => reply({}), step.seconds * 1000);
    cleanUp = () => clearTimeout(timer);
  },

  async watch(step) {
    let shownMs = performance.now();
    hiddenMs = 0;
    if (hiddenSince !== null) hiddenSince = shownMs;
    const hint = paragraph(step.min_rounds ? say(step.live ? "figures_first" : "watch_first") : "", "hint");
    const go = button(say("next"), () => finish());
    const update = () => { go.disabled = !(isOpen && questions.every((q) => q.isFine())); };
    const questions = step.questions.map((q, i) => questionField(q, i, update));
    let isOpen = false;
    let player = null;
    let figure = null;
    let openedMs = null;
    const open = () => { isOpen = true; openedMs = performance.now(); hint.textContent = ""; for (const q of questions) q.enable(true); update(); };
    const shut = () => { isOpen = false; for (const q of questions) q.enable(false); update(); };
    shut();
    const videos = step.films.map((f) => element("video", { playsinline: true, muted: true, preload: "auto", width: f.width_px, height: f.height_px,
      "aria-label": say(f.place) || step.caption || "film", disablepictureinpicture: true }));
    // Of a pair one film is heard: both say the same.
    const heard = step.films.findIndex((f) => f.sound);
    videos.forEach((v, i) => { v.muted = i !== heard; v.volume = 1; });
    // Live figures stand where films do: somebody may turn and zoom the view.
    const canvas = step.live ? element("canvas", { class: "figure", tabindex: 0, "aria-label": step.caption || say("figure") }) : null;
    const films = canvas ? element("div", { class: "films" }, canvas) : step.films.length ? element("div", { class: `films ${step.films.length > 1 ? "pair" : ""}` },
      ...step.films.map((f, i) => element("figure", {}, videos[i], step.films.length > 1 ? element("figcaption", {}, say(f.place)) : null))) : null;
    if (videos.length) films.style.setProperty("--shape", Math.max(...step.films.map((f) => f.width_px / f.height_px)));
    const fields = questions.map((q) => q.field);
    // A long list of questions stands in columns, with the films in sight above it.
    put("watch", step.caption ? paragraph(step.caption, "caption") : null, films, hint,
      ...(fields.length > 8 ? [element("div", { class: "many" }, ...fields)] : fields),
      element("div", { class: "buttons" }, go));
    // Which answer a key gave that is down. A release that the page does not hear stays unknown.
    const down = new Map();
    const release = (e) => {
      const given = down.get(e.code || e.key);
      if (given) given.released_ms = performance.now();
      down.delete(e.code || e.key);
    };
    const keys = (e) => {
      if (!e.repeat) down.delete(e.code || e.key);
      if (e.ctrlKey || e.altKey || e.metaKey || /^(textarea|text)$/.test(e.target.type || "")) return;
      const target = questions.find((q) => q.answer() === null) || questions[0];
      const chosen = optionOf(e, target?.keys || []);
      if (chosen >= 0 && target && isOpen) {
        const before = target.answer();
        target.pick(chosen);
        if (target.isHeld && target.answer() !== before) down.set(e.code || e.key, target.answer());
      } else if (e.key === "Enter" && !e.repeat && !go.disabled && e.target !== go && e.target.type !== "button") { e.preventDefault(); go.click(); }
    };
    const back = () => { if (!document.hidden && player) player.resume(); };
    document.addEventListener("keydown", keys);
    document.addEventListener("keyup", release);
    document.addEventListener("visibilitychange", back);
    cleanUp = () => {
      document.removeEventListener("keydown", keys);
      document.removeEventListener("keyup", release);
      document.removeEventListener("visibilitychange", back);
      if (player) player.end();
      if (figure) figure.close();
      onHeadset = () => {};
      cleanUp = () => {};
    };
    const showFailure = (which, why) => {
      cleanUp();
      put("narrow", paragraph(say("play_failed", { why })), element("div", { class: "buttons" },
        button(say("again"), () => show(step)),
        button(say("skip"), () => reply({ shown_ms: shownMs, failed: { film: which?.film || "", place: which?.place || "", why } }), true)));
    };
    const finish = () => {
      const content = { shown_ms: shownMs, off_ms: performance.now(), hidden_ms: hiddenNow(),
        answers: Object.fromEntries(questions.map((q) => [q.name, q.answer() || { option: null, at_ms: performance.now(), by: "keys" }])) };
      if (figure) {
        const { problem, ...report } = figure.report();
        Object.assign(content, report, { ended_by: "button", opened_ms: openedMs });
      }
      if (player) { content.films = player.report(); content.apart_ms = player.apartMs(); }
      cleanUp();
      go.disabled = true;
      reply(content);
    };
    if (canvas) {
      const lost = () => { if (current === step) showFailure(null, figure.report().problem); };
      try {
        figure = await opened(step, canvas, lost, (rounds) => { if (rounds >= step.min_rounds && !isOpen) open(); }, shut);
      } catch (error) {
        if (current === step) showFailure(null, String(error.message || error));
      }
      return;
    }
    if (!videos.length) { open(); return; }
    try {
      for (const f of step.films) await film.load(f, key);
    } catch (error) {
      showFailure(step.films.find((f) => !film.isLoaded(f)), error.message);
      return;
    }
    if (current !== step) return;
    if (heard >= 0 && !film.mayBeHeard()) {
      await new Promise((resolve) => {
        const start = button(say("sound_play"), () => { start.remove(); resolve(); });
        hint.before(start);
        start.focus();
      });
      if (current !== step) return;
      shownMs = performance.now();
      hiddenMs = 0;
    }
    player = film.play(step.films, videos, (rounds) => { if (rounds >= step.min_rounds && !isOpen) open(); }, step.once);
    try {
      await player.first;
      if (!step.min_rounds) open();
    } catch (error) {
      if (current === step) showFailure(error.film, error.message);
    }
  },

  // A figure that sliders mould, seen by a camera that the participant may turn.
  async mould(step) {
    const shownMs = performance.now();
    hiddenMs = 0;
    if (hiddenSince !== null) hiddenSince = shownMs;
    let figure = null;
    let isEnded = false;
    const moved = step.questions.map((q) => ({ option: String(q.start), at_ms: null, by: null }));
    const canvas = element("canvas", { class: "figure", tabindex: 0, "aria-label": step.caption || say("figure") });
    const controls = step.questions.map((q, i) => {
      let by = "mouse";
      const control = element("input", { type: "range", min: q.low, max: q.high, step: q.step, value: q.start, id: `slider${i}`, disabled: true });
      control.addEventListener("pointerdown", (e) => { by = e.pointerType || "mouse"; });
      control.addEventListener("keydown", () => { by = "keys"; });
      control.addEventListener("input", () => {
        if (!figure || isEnded) return;
        moved[i] = { option: control.value, at_ms: performance.now(), by };
        figure.move(i, Number(control.value));
      });
      return control;
    });
    const end = (how, by) => {
      if (!figure || isEnded) return;
      isEnded = true;
      go.disabled = true;
      const offMs = performance.now();
      const { problem, ...report } = figure.report();
      const content = { shown_ms: shownMs, off_ms: offMs, hidden_ms: hiddenNow(), ended_by: how, ...report,
        answers: Object.fromEntries(step.questions.map((q, i) => [q.name, { option: moved[i].option, at_ms: moved[i].at_ms ?? offMs, by: moved[i].by || by }])) };
      cleanUp();
      if (how === "failed") showFailure(problem);
      else reply(content);
    };
    const go = button(say("next"), (e) => end("button", e.detail ? e.pointerType || "mouse" : "keys"));
    go.disabled = true;
    const isCrowded = step.questions.length > 8;
    // The figure leaves as much of the window as its sliders need.
    canvas.style.setProperty("--below", `${isCrowded ? 1.35 * Math.ceil(step.questions.length / 3) : 2.7 * step.questions.length}rem`);
    put("watch", step.caption ? paragraph(step.caption, "caption") : null, canvas,
      element("div", { class: isCrowded ? "sliders crowded" : "sliders" }, ...step.questions.flatMap((q, i) => [element("label", { class: "prompt", for: `slider${i}` }, q.prompt), controls[i]])),
      element("div", { class: "buttons" }, go));
    const showFailure = (why) => {
      cleanUp();
      put("narrow", paragraph(say("play_failed", { why })), element("div", { class: "buttons" },
        button(say("again"), () => show(step)),
        button(say("skip"), () => reply({ shown_ms: shownMs, failed: { why } }), true)));
    };
    cleanUp = () => { if (figure) figure.close(); figure = null; onHeadset = () => {}; cleanUp = () => {}; };
    try {
      figure = await opened(step, canvas, (how) => end(how, "limit"));
      if (!figure) return;
      await figure.seen; // nobody moulds what is not yet there
      if (current !== step || isEnded) return;
      for (const control of controls) control.disabled = false;
      go.disabled = Boolean(step.until) && !step.is_blind;
    } catch (error) {
      if (current === step) showFailure(String(error.message || error));
    }
  },

  questions(step) {
    const go = button(say("next"), () => {
      const wrong = questions.find((q) => !q.isFine());
      if (wrong) { wrong.field.classList.add("wrong"); wrong.controls[0].focus(); return; }
      reply({ answers: Object.fromEntries(questions.map((q) => [q.name, q.answer()?.option ?? null])) });
    });
    const questions = step.questions.map((q, i) => questionField(q, i, () => { for (const one of questions) if (one.isFine()) one.field.classList.remove("wrong"); }));
    put("narrow", element("h1", {}, step.title), step.text ? paragraph(step.text) : null, ...questions.map((q) => q.field),
      element("div", { class: "buttons" }, go));
  },

  async end(step) {
    isOver = true;
    forgetSession();
    const textName = { done: "thanks", stopped: "stopped", withdrawn: "stopped", declined: "declined", full: "full", expired: "expired" }[step.outcome] || "thanks";
    put("narrow", element("h1", {}, say(textName)), whomToAsk());
    let file = null;
    let isTold = true;
    try { file = await wire.finish(step.outcome); } catch { isTold = false; tell(say("lost")); }
    if (file) main.append(paragraph(say("hand_in")), element("p", {}, element("a", { href: file.address, download: file.name }, say("save"))));
    if (!completion || step.outcome !== "done") return;
    main.append(element("p", {}, element("a", { href: completion }, say("onward"))));
    if (isTold && !file) setTimeout(() => location.assign(completion), ONWARD_MS);
  },
};

function show(step) {
  cleanUp();
  current = step;
  endSounds(step);
  headset?.begin();
  stop.hidden = !["enter", "card", "sound", "preload", "text", "watch", "mould", "questions"].includes(step.kind);
  const progress = document.getElementById("progress");
  progress.textContent = step.trial ? (step.is_practice ? `${say("practice")} ` : "") + say("progress", { n: step.trial, m: step.trials }) : "";
  steps[step.kind](step);
  if (isOutside) askBack();
  describe();
}

// ---- begin ----------------------------------------------------------------------------------

// A lock of the browser tells at once, and ends with its tab: two tabs of one browser are refused.
function alone() {
  if (!navigator.locks) return Promise.resolve(true);
  return new Promise((resolve) => {
    navigator.locks.request(`visavis-${key}`, { ifAvailable: true }, (lock) => {
      resolve(lock !== null);
      return lock ? new Promise(() => {}) : undefined;
    });
  });
}

// A browser that keeps nothing for us throws; then a page without its key begins anew.
function remembered(change) {
  try { return change(localStorage); } catch { return null; }
}

// A browser writes what is remembered there to its disk seconds later; a kill before that must not
// lose whose session this is.
const own = openStore("own");

async function forgetSession() {
  remembered((storage) => storage.removeItem(SESSION));
  await (await own).set(SESSION, "");
}

// Somebody who comes to a served study gets a session; who comes again gets the one they had.
async function arrive() {
  const parameters = Object.fromEntries([...wire.query()].filter(([n]) => OF_ARRIVALS.includes(n)).map(([n, v]) => [n, v.slice(0, 200)]));
  const before = remembered((storage) => storage.getItem(SESSION)) || await (await own).get(SESSION) || "";
  isRemembered = Boolean(before) && !location.search;
  if (isRemembered) key = before;
  else {
    let answer;
    try {
      do answer = await post("/api/arrive", { parameters, before, ...(code ? { code } : {}) });
      while (answer.body.refused === "code" && (code = await codeTyped(answer.body)));
    } catch (error) {
      if (error instanceof TypeError) {
        put("narrow", paragraph("The study cannot be reached. This page asks again."));
        setTimeout(() => begin(false), RETRY_MS[2]);
      } else put("narrow", paragraph("This address is not complete. Please open it again as you were given it."));
      return;
    }
    if (!answer.body.key) {
      put("narrow", element("h1", {}, answer.body.text || answer.body.refused));
      if (answer.body.refused === "busy") setTimeout(() => begin(false), BUSY_MS);
      return;
    }
    key = answer.body.key;
  }
  remembered((storage) => storage.setItem(SESSION, key));
  await (await own).set(SESSION, key);
  wire.keepKey(key);
}

// On a network of a lab whoever serves shows six digits: nobody types a long address in a headset.
function codeTyped({ title, text, go_on: goOn }) {
  return new Promise((resolve) => {
    const field = element("input", { type: "text", class: "number", id: "code", inputmode: "numeric", maxlength: 9, autocomplete: "off" });
    const go = button(goOn, () => resolve(field.value.replace(/\D/g, "")));
    go.disabled = true;
    field.addEventListener("input", () => { go.disabled = field.value.replace(/\D/g, "").length !== CODE_DIGITS; });
    field.addEventListener("keydown", (e) => { if (e.key === "Enter" && !e.repeat && !go.disabled) go.click(); });
    put("narrow", element("h1", {}, title), element("label", { class: "prompt", for: "code" }, text), field,
      element("div", { class: "buttons" }, go));
    field.focus();
  });
}

// At a computer of a lab or a library the next person must not go on as the one before.
function isTheirs() {
  return new Promise((resolve) => {
    put("narrow", element("h1", {}, say("begun_title")), paragraph(say("begun_text")),
      element("div", { class: "buttons" }, button(say("begun_mine"), () => resolve(true)), button(say("begun_other"), () => resolve(false), true)));
  });
}

let isLocked = false;
let isRemembered = false;
let completion = "";
let contact = "";
let code = "";

async function begin(takesOver) {
  if (!key) await arrive();
  if (!key) return;
  isLocked = isLocked || await alone();
  if (!isLocked) {
    put("narrow", element("h1", {}, say("elsewhere") || "This study is open in another tab."));
    setTimeout(() => begin(false), REPEAT_ASKING_MS);
    return;
  }
  if (!store) {
    store = await openStore(key);
    queue = await store.all();
  }
  let answer;
  try {
    answer = await hello(takesOver);
  } catch {
    tell(say("lost") || "The connection is lost.");
    setTimeout(() => begin(takesOver), RETRY_MS[2]);
    return;
  }
  if (answer.status === 409) {
    put("narrow", element("h1", {}, "This study is open in another tab or browser."),
      element("div", { class: "buttons" }, button("Go on here", () => begin(true))));
    return;
  }
  if (answer.status !== 200 || answer.body.failed) {
    if (answer.status === 400) await forgetSession(); // else it is there, and cannot go on now
    if (isRemembered && answer.status === 400) { // of another study, or another lab's time
      [key, store, queue, isLocked] = ["", null, [], false];
      await begin(false);
      return;
    }
    showProblem(answer.body.refused || answer.body.failed);
    return;
  }
  tell("");
  const state = answer.body;
  words = state.words;
  completion = state.completion || "";
  contact = state.contact || "";
  document.documentElement.lang = state.language;
  document.title = state.title;
  document.getElementById("title").textContent = state.title;
  stop.textContent = say("stop");
  const rehearsal = document.getElementById("rehearsal");
  rehearsal.hidden = !state.is_simulated;
  rehearsal.textContent = say("rehearsal");
  if (state.mime && !document.createElement("video").canPlayType(state.mime)) {
    put("narrow", paragraph(say("no_play")));
    return;
  }
  if (state.draws && !(window.DecompressionStream && document.createElement("canvas").getContext("webgl2"))) {
    put("narrow", paragraph(say("no_figures")));
    return;
  }
  if (isRemembered && state.number > 1 && state.step.kind !== "end" && !await isTheirs()) {
    await wire.leave(key, tab);
    await forgetSession();
    location.assign(location.pathname);
    return;
  }
  isRemembered = false;
  ofHeadset = state.xr ? await store.get("vr") || null : null;
  if (queue.length) { stepNumber = state.number; await flush(); if (stepNumber === state.number && current.kind === "") show(state.step); }
  else { stepNumber = -1; await take(state); }
  if (ofHeadset && !headset) askBack(); // the page was opened anew
}

setInterval(() => { if (stepNumber >= 0 && !isOver) flush(); }, BEAT_MS);
begin(false);

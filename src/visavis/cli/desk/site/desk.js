// The desk: shows what the session says, and sends what the operator asks for. It keeps nothing
// that the session needs, so the page may be closed at any time.

const key = location.hash.slice(1) || sessionStorage.getItem("key") || "";
sessionStorage.setItem("key", key);
history.replaceState(null, "", location.pathname);

const QUIET_S = 3;
const TODAY_EVERY_MS = 15000;
const BUTTONS = [
  ["pause", "Pause", "P", ""],
  ["note", "Note", "N", "What happened?"],
  ["flag", "Flag", "F", ""],
  ["reason", "Why?", "W", "Why was the last flag or pause?"],
  ["repeat", "Repeat trial", "R", ""],
  ["skip", "Skip trial", "S", "Why is this trial skipped?"],
  ["recalibrate", "Recalibrate", "C", ""],
  ["check_drift", "Check drift", "D", ""],
  ["silence", "Silence vibration", "X", ""],
  ["abort", "End session", "Esc", ""],
];
const SAY = {
  instructing: "instructions", intertrial: "between trials", trial: "trial runs", calibrating: "calibrating",
  validating: "validating", paused: "paused", break: "break", questionnaire: "questions",
  preflight: "getting ready", finished: "finished", aborted: "ended early", failed: "failed", idle: "getting ready",
};

const at = (id) => document.getElementById(id);
let session = null, status = null, seen = null, ended = null, allowed = [], pendingAction = null, heardAt = performance.now(), today = null, bounds = null, isOffline = false, which = "", selection = "";

function el(name, content = {}, ...inner) {
  const node = document.createElement(name);
  for (const [attribute, value] of Object.entries(content)) {
    if (attribute === "text") node.textContent = value;
    else if (attribute === "on") node.addEventListener("click", value);
    else if (value !== undefined && value !== "") node.setAttribute(attribute, value);
  }
  node.append(...inner.filter(Boolean));
  return node;
}

// Text with commands between backticks, as parts of an element.
function withCode(text) {
  return text.split("`").map((part, i) => (i % 2 ? el("code", { text: part }) : part)).filter(Boolean);
}

async function post(path, content = {}) {
  const answer = await fetch(path, {
    method: "POST", headers: { "Content-Type": "application/json", "X-Visavis-Key": key }, body: JSON.stringify(content),
  });
  const result = await answer.json();
  if (!answer.ok) throw new Error(result.refused || `the desk answered ${answer.status}`);
  return result;
}

function tell(text) {
  at("notice").hidden = !text;
  if (at("notice").textContent !== text) at("notice").textContent = text;
}

let warnedUntil = 0;
function warn(text) {
  warnedUntil = performance.now() + 5000;
  tell(text);
}

const count = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;
const minutes = (s) => (s < 90 ? `${Math.ceil(s)} s` : `${Math.round(s / 60)} min`);
const number = (value, digits, unit) => (value === null ? "–" : `${value.toFixed(digits)}${unit}`);

// ---- commands ---------------------------------------------------------------------------------

async function command(action, text = "", code = "") {
  try {
    await post("/api/command", { action, text, code, which });
  } catch (error) {
    warn(`Not sent: ${error.message}`);
  }
}

const HAS_REASON = ["skip", "reason"];

function press([action, label, , question]) {
  if (!question && action !== "abort") { command(action); return; }
  pendingAction = action;
  const coded = HAS_REASON.includes(action) ? Object.entries(session.incidents) : [];
  at("ask-codes").hidden = !coded.length;
  at("ask-list").replaceChildren(...coded.map(([code, words]) =>
    el("label", {}, el("input", { type: "radio", name: "code", value: code }), document.createTextNode(words))));
  at("ask-text-label").hidden = !question;
  at("ask-text-label").textContent = coded.length ? "In your words" : "Note";
  at("ask-label").textContent = question || "End the session? Finished trials are kept, and it can be resumed.";
  at("ask-text").hidden = !question;
  at("ask-text").value = "";
  at("ask-yes").textContent = action === "note" ? "Write it down" : label;
  at("ask").showModal();
  (coded.length ? at("ask-list").querySelector("input") : question ? at("ask-text") : at("ask-no")).focus();
}

at("ask-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const text = at("ask-text").value.trim();
  const choice = at("ask-list").querySelector("input:checked");
  if (!at("ask-text").hidden && !text && !choice) { at("ask-text").focus(); return; }
  at("ask").close();
  command(pendingAction, text, choice ? choice.value : "");
});
at("ask-no").addEventListener("click", () => at("ask").close());

document.addEventListener("keydown", (event) => {
  if (!session || at("ask").open || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  const target = event.target.tagName;
  if (["INPUT", "TEXTAREA"].includes(target) || (event.key === " " && ["BUTTON", "SUMMARY"].includes(target))) return;
  const name = event.key === "Escape" ? "Esc" : event.key.toUpperCase();
  const match = BUTTONS.find((button) => button[2] === name && allowed.includes(button[0]));
  if (event.key === " " && allowed.includes("advance") && status && status.can_go_on) {
    event.preventDefault();
    command("advance");
  } else if (match) {
    event.preventDefault();
    press(match);
  }
});

document.addEventListener("click", (event) => {  // a button pressed by mouse leaves the keys free
  if (event.detail && event.target instanceof Element) event.target.closest("button")?.blur();
});

// ---- the session ------------------------------------------------------------------------------

let frame = null;

function build() {
  const fact = (id, name) => el("div", {}, el("dt", { text: name }), el("dd", { id }));
  const buttons = BUTTONS.filter((button) => allowed.includes(button[0])).map((button) =>
    el("button", { type: "button", class: button[0] === "abort" ? "end" : "quiet", id: `do-${button[0]}`, on: () => press(button) },
      document.createTextNode(button[1]), el("kbd", { text: button[2], "aria-hidden": "true" })));
  frame = el("div", {},
    el("dl", { class: "facts" },
      fact("f-participant", "participant"), fact("f-block", "block"), fact("f-trial", "trial"), fact("f-left", "trial ends in"),
      fact("f-done", "trials done"), fact("f-session", "session left"), fact("f-condition", "condition")),
    el("progress", { id: "bar", "aria-label": "trials done" }),
    el("div", { class: "prompt", id: "prompt" }, el("p", { id: "prompt-text" }),
      allowed.includes("advance") ? el("button", { type: "button", id: "do-advance", on: () => command("advance") }, document.createTextNode("Go on"), el("kbd", { text: "space", "aria-hidden": "true" })) : null),
    buttons.length ? el("div", { class: "buttons" }, ...buttons)
      : el("p", { class: "faint", text: "This session goes on at the participant's page; nothing can be commanded from here. Ctrl-C in the terminal ends it, and every answer is kept." }),
    el("ul", { class: "plain", id: "messages", "aria-live": "polite" }),
    el("div", { id: "flags" }), el("div", { id: "faults", "aria-live": "polite" }), el("div", { id: "calibration" }),
    el("div", { class: "wide", id: "streams" }));
  const title = el("h2", { text: `${session.study}, session ${session.session}` });
  at("session").replaceChildren(el("div", { class: "title" }, title, el("strong", { id: "f-state", class: "state" })), frame);
}

function put(id, text) {
  const place = at(id);
  if (place && place.textContent !== text) place.textContent = text;
}

const lastTexts = new Map();
function renew(id, content, make) {
  const now = JSON.stringify(content);
  if (lastTexts.get(id) === now && at(id).childNodes.length) return;
  lastTexts.set(id, now);
  at(id).replaceChildren(...make());
}

function showStatus() {
  const s = status;
  put("f-participant", session.participant);
  showState(s);
  put("f-block", s.block || "–");
  put("f-trial", s.trial_id || "–");
  put("f-done", `${s.trials_done} of ${s.trials_planned}${s.trials_skipped ? `, ${s.trials_skipped} skipped` : ""}`);
  put("f-left", s.trial_left_s === null ? "–" : `${Math.ceil(s.trial_left_s)} s`);
  put("f-session", allowed.length ? `about ${minutes(s.session_left_s)}` : "–");
  put("f-condition", s.condition || (session.is_blind && s.trial_id ? "hidden" : "–"));
  at("bar").max = Math.max(1, s.trials_planned);
  at("bar").value = s.trials_done + s.trials_skipped;
  renew("flags", s.flags, () => s.flags.map((flag) => el("span", { class: "flag", text: flag })));
  renew("faults", [s.faults, s.losses, allowed.length], () => s.faults.length ? s.faults.map((fault) =>
    el("div", { class: `fault ${fault.severity}` }, el("strong", { text: fault.role }), document.createTextNode(`: ${fault.message}`),
      el("span", { class: "remedy", text: fault.remedy }))) : allowed.length ? [s.losses
      ? el("p", { class: "look", text: `No fault now, but ${s.losses}.` }) : el("p", { class: "good", text: "No faults." })] : []);
  showCalibration(s);
  renew("streams", s.streams, () => s.streams.length ? [streams(s.streams)] : []);
  renew("messages", s.messages, () => [...s.messages].reverse().map((message) => el("li", { text: message })));
  showScene(s);
}

// What an operator must see at a glance: it goes by itself, it waits for them, or a device is away.
// Its place keeps its height, so that no button moves away under a finger.
function showState(s) {
  const away = s.waiting || s.faults.filter((fault) => fault.severity === "blocking").map((fault) => `${fault.role}: ${fault.message}`).join(" ");
  const kind = away ? "bad" : s.prompt || ["paused", "failed", "aborted"].includes(s.state) ? "look" : s.state === "trial" ? "good" : "";
  put("f-state", SAY[s.state] || s.state);
  at("f-state").className = `state ${kind}`;
  const calm = s.state === "questionnaire" ? "Questions are being answered." : "Goes on by itself.";
  put("prompt-text", [away, s.prompt].filter(Boolean).join("\n") || calm);
  at("prompt").className = `prompt ${away || s.prompt ? kind : "idle"}`;
  if (at("do-advance")) at("do-advance").disabled = !s.can_go_on;
  for (const id of ["prompt", "f-condition"]) {
    const height = at(id).getBoundingClientRect().height;
    if (height > (parseFloat(at(id).style.minHeight) || 0)) at(id).style.minHeight = `${height}px`;
  }
}
addEventListener("resize", () => ["prompt", "f-condition"].forEach((id) => at(id) && (at(id).style.minHeight = "")));

function showCalibration(s) {
  let text = "", kind = "faint";
  if (s.accuracy_deg !== null) {
    text = `Calibration: accuracy ${s.accuracy_deg.toFixed(2)}°, precision ${number(s.precision_deg, 2, "°")}, ${minutes(s.calibration_age_s || 0)} old.`;
    kind = s.accuracy_deg <= 1.5 ? "good" : "bad";
  } else if (s.is_calibrated_first && allowed.length) {
    text = "Calibration: none yet.";
    kind = "look";
  }
  put("calibration", text);
  at("calibration").className = kind;
}

function streams(rows) {
  const more = (column) => ([3, 5].includes(column) ? "more" : "");
  const cells = (row) => row.received
    ? [row.nominal_rate_hz === null ? `${row.rate_hz.toFixed(1)} Hz` : `${row.rate_hz.toFixed(1)} of ${+row.nominal_rate_hz.toFixed(1)} Hz`, `${row.gaps}`, number(row.longest_gap_ms, 0, " ms"), number(row.last_sample_age_ms, 0, " ms"), `${row.dropped}`]
    : ["nothing yet", "", "", "", ""];
  const table = el("table", {}, el("caption", { text: "Streams" }),
    el("thead", {}, el("tr", {}, ...["device", "rate", "gaps", "longest gap", "last sample", "lost"].map((name, i) => el("th", { scope: "col", text: name, class: more(i) })))));
  const body = el("tbody");
  for (const row of rows) {
    const battery = row.battery_01 === null ? "" : `, battery ${Math.round(row.battery_01 * 100)} %`;
    body.append(el("tr", { class: row.needs_look ? "bad" : row.received ? "" : "idle" },
      el("td", { text: row.role.replaceAll("_", " ") + battery }), ...cells(row).map((text, i) => el("td", { text, class: more(i + 1) }))));
  }
  table.append(body);
  return table;
}

// ---- the scene from above ---------------------------------------------------------------------

const SVG = "http://www.w3.org/2000/svg";
function shape(name, attributes, text) {
  const node = document.createElementNS(SVG, name);
  for (const [attribute, value] of Object.entries(attributes)) node.setAttribute(attribute, value);
  if (text) node.textContent = text;
  return node;
}

// Colours of both drawings; who is looked at and who is touched differ in more than colour.
const PERSON = { fill: "#b7c0c9", stroke: "#4a525b" };
const MET = { fill: "#f2a900", stroke: "#4a525b" };
const TOUCHED = { fill: "#f6d3d6", stroke: "#a3121f" };
const AREA = { fill: "none", stroke: "#14509a" };

function showScene(s) {
  showAbove(s);
  showView(seen && seen.jpeg ? seen : s.from_head);
}

function showAbove(s) {
  const above = s.above;
  at("place").hidden = !above;
  if (!above) return;
  const points = [...above.people.map((person) => [person[1], person[2]]), ...(above.head ? [above.head] : [])];
  for (const [x, z] of points) {
    bounds = bounds ? [Math.min(bounds[0], x), Math.min(bounds[1], z), Math.max(bounds[2], x), Math.max(bounds[3], z)] : [x, z, x, z];
  }
  if (!bounds) return;
  const wide = Math.max(bounds[2] - bounds[0] + 1.6, 3), deep = Math.max(bounds[3] - bounds[1] + 1.6, 2.2);
  const x0 = (bounds[0] + bounds[2] - wide) / 2, z0 = (bounds[1] + bounds[3] - deep) / 2, size = Math.max(wide, deep);
  const thin = size * 0.003, shapes = [];
  above.areas.forEach((r, i) => shapes.push(shape("circle", { class: "area", cx: above.people[i][1], cy: above.people[i][2], r, ...AREA, "stroke-width": thin, "stroke-dasharray": size * 0.012 })));
  above.people.forEach((person, i) => {
    const isTouched = above.touched.includes(i);
    const look = isTouched ? TOUCHED : i === above.hit ? MET : PERSON;
    shapes.push(shape("circle", { class: isTouched ? "touched" : "person", cx: person[1], cy: person[2], r: Math.max(person[3], size * 0.014), ...look, "stroke-width": isTouched ? 3 * thin : thin }));
  });
  if (above.gaze) {
    const [x, z, dx, dz] = above.gaze;
    shapes.push(shape("line", { x1: x, y1: z, x2: x + 2 * size * dx, y2: z + 2 * size * dz, stroke: "#c0392b", "stroke-width": size * 0.006, "stroke-opacity": 0.8 }));
  }
  if (above.head) {
    const [x, z] = above.head, r = Math.max(0.16, size * 0.018);
    const length = Math.hypot(...above.ahead) || 1, ux = above.ahead[0] / length, uz = above.ahead[1] / length;
    shapes.push(shape("path", { d: `M ${x + ux * r * 2} ${z + uz * r * 2} L ${x - uz * r} ${z + ux * r} L ${x + uz * r} ${z - ux * r} Z`, fill: "#14509a" }));
    shapes.push(shape("circle", { cx: x, cy: z, r, fill: "#14509a" }));
    for (const contact of s.contacts) {  // at the side of the arm that touches, bolder while its band vibrates
      const side = contact.segment.startsWith("left") ? 1 : -1;
      shapes.push(shape("circle", { class: "contact", cx: x + side * uz * r * 1.5, cy: z - side * ux * r * 1.5, r: r * 0.6, fill: contact.vibrates ? "#a3121f" : "#fff", stroke: "#a3121f", "stroke-width": 3 * thin }));
    }
  }
  const bar = size > 12 ? 5 : 1, y = z0 + deep - size * 0.03, x = x0 + size * 0.03;
  shapes.push(shape("path", { d: `M ${x} ${y} h ${bar}`, stroke: "#4a525b", "stroke-width": size * 0.006 }));
  shapes.push(shape("text", { x: x + bar + size * 0.015, y: y + size * 0.012, "font-size": size * 0.04, fill: "#4a525b" }, `${bar} m`));
  at("above").setAttribute("viewBox", `${x0} ${z0} ${wide} ${deep}`);
  at("above").replaceChildren(...shapes);
  put("above-text", [gazeWords(s), contactWords(s)].filter(Boolean).join(" "));
  put("above-key", above.areas.length ? "Dashed: areas of interest, as wide as the study counts looks." : "");
}

function gazeWords(s) {
  if (!s.streams.some((row) => row.role === "eye_tracker")) return "Gaze is not measured.";
  if (!s.above.gaze) return "Gaze is lost.";
  const met = s.above.people[s.above.hit];
  return met ? `Looks at ${met[0].replaceAll("_", " ")}.` : "Looks at nobody.";
}

function contactWords(s) {
  const now = s.contacts.map((one) => `${one.segment.replaceAll("_", " ") || "body"} touches ${one.person === null ? "somebody" : `person ${one.person + 1}`}${one.vibrates ? ", its band vibrates" : ""}`);
  const contacts = s.contacts_begun ? `${count(s.contacts_begun, "contact")} in this trial.` : "";
  return [now.length ? `${now.join("; ")}.`.replace(/^./, (c) => c.toUpperCase()) : "", contacts].filter(Boolean).join(" ");
}

// Tangents to the right and up of straight ahead; SVG's y points down.
function showView(view) {
  at("view-figure").hidden = !view;
  if (!view) return;
  const [left, right, bottom, top] = view.tangents, size = right - left, thin = size * 0.004;
  const box = { x: left, y: -top, width: size, height: top - bottom };
  const shapes = [shape("rect", { ...box, fill: view.jpeg ? "#000" : "#eef1f4" })];
  if (view.jpeg) shapes.push(shape("image", { ...box, preserveAspectRatio: "none", href: `data:image/jpeg;base64,${view.jpeg}` }));
  else {
    for (const corners of view.boards) shapes.push(shape("polygon", { points: corners.map(([x, y]) => `${x},${-y}`).join(" "), fill: "#fff", stroke: "#4a525b", "stroke-width": thin }));
    view.heads.forEach(([, x, y, r], i) => {
      const look = i === view.hit ? MET : PERSON;
      shapes.push(shape("path", { d: `M ${x - 2 * r} ${-y + 4.5 * r} V ${-y + 2.2 * r} Q ${x - 2 * r} ${-y + 1.3 * r} ${x} ${-y + 1.3 * r} Q ${x + 2 * r} ${-y + 1.3 * r} ${x + 2 * r} ${-y + 2.2 * r} V ${-y + 4.5 * r} Z`, ...PERSON, "stroke-width": thin }));
      shapes.push(shape("ellipse", { class: "head", cx: x, cy: -y, rx: 0.85 * r, ry: 1.1 * r, ...look, "stroke-width": thin }));
    });
    if (view.mark) shapes.push(shape("circle", { cx: view.mark[0], cy: -view.mark[1], r: size * 0.012, fill: "#1d2126" }));
  }
  for (const [x, y, r] of view.areas) shapes.push(shape("circle", { class: "area", cx: x, cy: -y, r, ...AREA, "stroke-width": thin, "stroke-dasharray": size * 0.016 }));
  if (view.gaze) {
    shapes.push(shape("circle", { cx: view.gaze[0], cy: -view.gaze[1], r: size * 0.022, fill: "none", stroke: "#fff", "stroke-width": 3.5 * thin }));
    shapes.push(shape("circle", { class: "gaze", cx: view.gaze[0], cy: -view.gaze[1], r: size * 0.022, fill: "none", stroke: "#c0392b", "stroke-width": 2 * thin }));
  }
  const seenBox = `${left} ${-top} ${size} ${top - bottom}`, inner = shape("svg", { ...box, viewBox: seenBox });
  inner.append(...shapes);  // whose overflow is cut
  at("view").setAttribute("viewBox", seenBox);
  at("view").replaceChildren(inner);
  put("view-of", view.jpeg ? "left eye, a moment ago" : session.is_blind ? "in outline, as you are blinded" : "in outline: no picture is drawn");
}

// ---- today and doctor -------------------------------------------------------------------------

// Findings of one level and subject in one line each, as they came.
function bySubject(findings) {
  const groups = new Map();
  for (const { level, subject, message } of findings) {
    if (!groups.has(subject)) groups.set(subject, { level, subject, messages: [] });
    groups.get(subject).messages.push(message);
  }
  return [...groups.values()];
}

function verdictOf(verdict, label) {
  const line = ({ level, subject, messages }) => el("li", { class: level === "red" ? "bad" : level === "amber" ? "look" : "" },
    el("b", { text: subject.replaceAll("_", " ") }), document.createTextNode(`: ${messages.join("; ")}`));
  const of = (level) => bySubject(verdict.findings.filter((finding) => finding.level === level));
  const wrong = [...of("red"), ...of("amber")], right = of("green");
  return el("div", { class: `verdict ${verdict.level}` },
    el("strong", { text: verdict.answer }),
    el("span", { text: `Participant ${label}: ${verdict.done} of ${count(verdict.planned, "trial")} done.` }),
    verdict.redo.length ? el("ul", { class: "plain", "aria-label": "what to do" }, ...verdict.redo.map((step) => el("li", { class: "remedy" }, ...withCode(step)))) : null,
    el("ul", { class: "plain findings", "aria-label": "why" }, ...wrong.map(line)),
    el("details", {}, el("summary", { text: `${right.length} as they should be` }), el("ul", { class: "plain" }, ...right.map(line))));
}

function copied(text) {
  const button = el("button", { type: "button", class: "quiet small", text: "Copy" });
  button.addEventListener("click", async () => {
    await navigator.clipboard.writeText(text);
    button.textContent = "Copied";
  });
  return button;
}

function person(who) {
  const verdict = who.verdict;
  const short = verdict ? { green: "good", amber: "look", red: "bad" }[verdict.level] : "faint";
  const state = who.session && who.state !== "to come" ? `session ${who.session} ${who.state}` : who.state;
  return el("div", { class: "person" }, el("b", { text: who.label }), el("span", { text: state }),
    verdict ? el("div", { class: short, text: `${verdict.answer} ${verdict.done} of ${verdict.planned} trials done.` }) : null,
    verdict && who.state === "complete" ? el("ul", { class: "plain" }, ...verdict.redo.map((step) => el("li", { class: "remedy" }, ...withCode(step)))) : null,
    who.command ? el("div", {}, el("code", { text: who.command }), document.createTextNode(" "), copied(who.command)) : null);
}

async function showToday() {
  today = await post("/api/today");
  put("lab-name", today.lab);
  put("lab-file", ` · ${today.configuration}`);
  at("rehearsal").hidden = !today.is_simulated;
  const shown = today.studies.filter((study) => study.people.length || study.problem);
  const before = (study) => (study.before ? `${count(study.before, "participant")} on other days` : "");
  renew("people", today.studies, () => shown.length ? shown.map((study) =>
    el("div", {}, el("h3", { text: study.study }), study.problem ? el("p", { class: "bad", text: study.problem }) : null,
      ...study.people.map(person), before(study) ? el("p", { class: "faint", text: before(study) }) : null))
    : [el("p", { class: "faint", text: "Nobody is here yet today. Somebody new: visavis participant add STUDY" })]);
  if (today.doctor) showDoctor(today.doctor);
  if (!session) showNoSession();
}

function showNoSession() {
  const who = today && today.studies.flatMap((study) => study.people).find((one) => one.path === ended);
  const idle = el("p", { class: "faint", text: "No session goes on. Begin one in a terminal with visavis run; it appears here by itself." });
  const content = who ? [el("h2", { text: "Can they leave?" }), who.verdict ? verdictOf(who.verdict, who.label) : el("p", { text: "looking …" }),
    who.command ? el("p", {}, el("code", { text: who.command }), document.createTextNode(" "), copied(who.command)) : null, idle]
    : [el("h2", { text: "Session" }), idle];
  renew("session", [ended, who], () => content.filter(Boolean));
}

function showDoctor(doctor) {
  const wrong = doctor.findings.filter((f) => ["missing", "warning"].includes(f.level)).sort((a, b) => (a.level === "missing" ? 0 : 1) - (b.level === "missing" ? 0 : 1));
  const { missing, warning } = doctor.count;
  const line = missing ? ["bad", `Not ready: ${count(missing, "thing")} missing.`] : warning ? ["look", `Ready, with ${warning} to look at.`] : ["good", "Ready."];
  renew("findings", doctor, () => [
    el("p", { class: line[0] }, el("strong", { text: line[1] })),
    ...wrong.map((f) => el("div", { class: `fault ${f.level === "missing" ? "blocking" : ""}` }, el("strong", { text: f.subject }),
      document.createTextNode(`: ${f.found}`), f.remedy ? el("span", { class: "remedy", text: f.remedy }) : null)),
    el("details", {}, el("summary", { text: `all ${doctor.findings.length} findings` }), el("ul", { class: "plain faint" }, ...doctor.findings.map((f) =>
      el("li", { text: `${{ ok: "✓", note: "·", warning: "!", missing: "✗" }[f.level]} ${f.subject}: ${f.found}` })))),
    el("p", { class: "faint", text: `looked at ${new Date(doctor.made_wall_iso).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hourCycle: "h23" })}` }),
  ]);
}

async function look() {
  at("look").disabled = true;
  at("look").textContent = "Looking …";
  try {
    const { doctor } = await post("/api/doctor");
    if (doctor) showDoctor(doctor);
    else at("findings").replaceChildren(el("p", { class: "faint", text: "Nothing is known yet." }));
  } catch (error) {
    warn(error.message);
  }
  at("look").disabled = false;
  at("look").textContent = "Look again";
}
at("look").addEventListener("click", look);

function showSessions(sessions) {
  at("sessions").hidden = sessions.length < 2;
  renew("sessions", [sessions, which], () => sessions.map((one) =>
    el("button", { type: "button", class: one.which === which ? "" : "quiet", "aria-pressed": String(one.which === which),
      text: `${one.participant} · ${one.study}${one.session > 1 ? `, session ${one.session}` : ""}`,
      on: () => { selection = one.which; } })));
}

// ---- what is new ------------------------------------------------------------------------------

async function follow() {
  let after = null;
  for (;;) {
    try {
      const news = await post("/api/live", after === null || selection !== which ? { which: selection } : { after, which });
      if (news.number !== after) heardAt = performance.now();
      after = news.number;
      const before = session && session.path + session.participant;
      session = news.session;
      if (!selection || !news.sessions.some((one) => one.which === selection)) selection = news.which;
      which = news.which;
      showSessions(news.sessions);
      status = news.status;
      seen = news.seen;
      ended = news.ended;
      const now = session && session.path + session.participant;
      if (session && (now !== before || !frame || !frame.isConnected)) {
        allowed = session.commands;
        bounds = null;
        lastTexts.clear();
        build();
      }
      if (now !== before) {
        if (!session) { frame = null; at("place").hidden = true; at("ask").close(); }
        showToday().then(session ? look : undefined).catch(() => {});
      }
      if (session && status) showStatus();
      else if (session) {
        put("f-state", SAY.preflight);
        put("prompt-text", "Goes on by itself.");
        put("f-participant", session.participant);
      }
      if (isOffline) { isOffline = false; tell(""); }
    } catch (error) {
      isOffline = true;
      tell(error instanceof TypeError ? "The desk is closed; the session goes on without it. Open it again: visavis desk" : error.message);
      await new Promise((resolve) => setTimeout(resolve, 1000));
      after = null;
    }
  }
}

setInterval(() => {
  if (isOffline || performance.now() < warnedUntil) return;
  const quiet_s = (performance.now() - heardAt) / 1000;
  const isQuiet = session && allowed.length && status && quiet_s > QUIET_S;
  tell(isQuiet ? `No news from the session for ${Math.round(quiet_s)} s: look at its terminal, where questions may be waiting.` : "");
}, 1000);
setInterval(() => showToday().catch(() => {}), TODAY_EVERY_MS);

follow();
showToday().then(look).catch((error) => warn(error.message));

// The researcher's page: who is where, asked again every few seconds.

const AGAIN_MS = 5000;
const headers = { "X-Visavis-Key": location.hash.slice(1), "Content-Type": "application/json" };
const main = document.getElementById("main");
const notice = document.getElementById("notice");

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) if (value !== undefined) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

const minutes = (m) => (m === null ? "–" : m < 10 ? m.toFixed(1) : String(Math.round(m)));

function table(caption, heads, rows) {
  return element("div", { class: "wide" }, element("table", {}, element("caption", {}, caption),
    element("thead", {}, element("tr", {}, ...heads.map((h) => element("th", { scope: "col" }, h)))),
    element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map((cell, i) => element(i ? "td" : "th", i ? { "data-head": heads[i] } : { scope: "row" }, cell)))))));
}

function show(state) {
  document.title = `${state.title}: board`;
  document.getElementById("title").textContent = state.title;
  document.getElementById("rehearsal").hidden = !state.is_simulated;
  document.getElementById("when").textContent = new Date().toLocaleTimeString();
  const present = Object.entries(state.states).filter(([name]) => state.counts[name]);
  const complete = state.counts.complete || 0;
  const summary = [`${complete}${state.quota ? ` of ${state.quota}` : ""} complete`];
  if (state.median_minutes !== null) summary.push(`median time ${minutes(state.median_minutes)} min`);
  main.replaceChildren(
    element("h1", {}, summary.join(", ")),
    element("p", { class: "hint" }, present.map(([name, words]) => `${state.counts[name]} ${words}`).join(" · ") || "Nobody has come yet."),
    table("Participants", ["Participant", "Where", "Trials", "Minutes", "Group", "Flags"], state.places.map((p) => [
      p.label, state.states[p.state] || p.state, p.trials_planned ? `${p.trials_done} of ${p.trials_planned}` : "–",
      minutes(p.minutes), p.group || "–", p.flags.join(", ") || "–"])));
}

async function ask() {
  try {
    const response = await fetch("/api/board", { method: "POST", headers, body: "{}" });
    const state = await response.json();
    if (response.status !== 200) { notice.textContent = state.refused || "The board is not available."; return; }
    notice.textContent = "";
    show(state);
  } catch {
    notice.textContent = "The server does not answer; asked again in a moment.";
  }
  setTimeout(ask, AGAIN_MS);
}

ask();

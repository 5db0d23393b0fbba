// A figure to play with: sliders, the weights they make, and the command that writes the motion.

import * as live from "./live.js";
import * as blends from "./blend.js";
import { rendererName } from "./painting.js";

const main = document.getElementById("main");
const CROWDED = 8;
const HEAVY = 0.005;

function element(tag, attributes, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

async function begin() {
  if (rendererName() === null) throw new Error("this browser cannot draw with WebGL 2");
  const step = await (await fetch("/figure", { cache: "no-store" })).json();
  document.title = step.title;
  document.getElementById("title").textContent = step.title;
  const isCrowded = step.questions.length > CROWDED;
  const canvas = element("canvas", { class: "figure", tabindex: 0, "aria-label": step.title });
  const rows = isCrowded ? 1.35 * Math.ceil(step.questions.length / 3) : 2.7 * step.questions.length;
  canvas.style.setProperty("--below", `${rows}rem`);
  const controls = step.questions.map((q, i) => element("input", { type: "range", min: q.low, max: q.high, step: q.step, value: q.start, id: `slider${i}`, disabled: "" }));
  const shares = element("p", { class: "hint", id: "shares" });
  const command = element("code", { id: "command" });
  main.replaceChildren(canvas,
    element("div", { class: isCrowded ? "sliders crowded" : "sliders" }, ...step.questions.flatMap((q, i) => [element("label", { class: "prompt", for: `slider${i}` }, q.name.replaceAll("_", " ")), controls[i]])),
    shares, element("p", { class: "hint" }, command));
  const figure = await live.open(step, canvas, "", () => {}, () => {});
  const blend = blends.readBlend(await live.load(step.live.blend, ""));
  const tell = () => {
    const weights = [...blends.weightsAt(blend, figure.values)].map((w, i) => [w, blend.names[i]]);
    shares.textContent = weights.filter(([w]) => w >= HEAVY).sort((a, b) => b[0] - a[0]).map(([w, name]) => `${name} ${w.toFixed(2)}`).join(", ");
    const values = step.questions.map((q, i) => `${q.name}=${figure.values[i]}`).join(",");
    command.textContent = `${step.command} ${step.option} ${values} -o motion.glb`;
  };
  controls.forEach((control, i) => {
    control.disabled = false;
    control.addEventListener("input", () => { figure.move(i, Number(control.value)); tell(); });
  });
  tell();
  canvas.dataset.ready = "true";
}

begin().catch((error) => { main.replaceChildren(element("p", { class: "wrong" }, String(error.message || error))); });

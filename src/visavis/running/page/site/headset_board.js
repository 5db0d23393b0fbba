// The board in a headset: it shows what the page shows, drawn into a picture, and a press on it is a
// press on the page's own control. So there is one code for questions, and one place for answers.

const [WIDTH_PX, HEIGHT_PX] = [1024, 704];
export const WIDTH_M = 1.0;
export const HEIGHT_M = WIDTH_M * HEIGHT_PX / WIDTH_PX;
const MARGIN_PX = 36;
const QUESTIONS_AT_ONCE = 3;
const [TEXT_PX, TITLE_PX, BUTTON_PX, BAR_PX] = [29, 38, 58, 34];
const FONT = "system-ui, sans-serif";

function wrapped(pen, text, width) {
  const lines = [];
  let line = "";
  for (const word of text.split(/\s+/)) {
    const longer = line ? `${line} ${word}` : word;
    if (line && pen.measureText(longer).width > width) { lines.push(line); line = word; } else line = longer;
  }
  return line ? [...lines, line] : lines;
}

const textOf = (node) => node.textContent.trim();

// A control of the page, pressed by a ray: the page hears how.
function press(control) {
  if (control.disabled) return;
  control.dispatchEvent(new PointerEvent("pointerdown", { bubbles: true, pointerType: "ray" }));
  control.dispatchEvent(new PointerEvent("click", { bubbles: true, cancelable: true, pointerType: "ray", detail: 1 }));
}

function slide(control, share) {
  if (control.disabled) return;
  const [low, high] = [Number(control.min), Number(control.max)];
  control.dispatchEvent(new PointerEvent("pointerdown", { bubbles: true, pointerType: "ray" }));
  control.value = low + Math.min(1, Math.max(0, share)) * (high - low);
  control.dispatchEvent(new Event("input", { bubbles: true }));
}

const isTyped = (input) => input.tagName === "TEXTAREA" || input.type === "text";

/** Return what a page shows, as a board needs it: lines, questions, sliders, what is typed, buttons. */
function contentOf(main, notice) {
  const lines = [...notice.querySelectorAll("p"), ...main.querySelectorAll("h1, p, li")].filter((node) => textOf(node))
    .map((node) => ({ text: textOf(node), isTitle: node.tagName === "H1" }));
  const questions = [...main.querySelectorAll("fieldset")].map((field) => ({ text: textOf(field.querySelector("legend")),
    options: [...field.querySelectorAll(".options label")].map((label) => ({ text: textOf(label.querySelector("span") || label), control: label.querySelector("input") })),
    slider: field.querySelector("input[type=range]") }));
  const sliders = [...main.querySelectorAll(".sliders label")].map((label) => ({ text: textOf(label), options: [], slider: document.getElementById(label.htmlFor) }));
  const buttons = [...notice.querySelectorAll("button"), ...main.querySelectorAll(".buttons button")].map((control) => ({ text: textOf(control), control }));
  const boxes = [...main.querySelectorAll(".agree input")].map((control) => ({ text: textOf(control.parentNode), control }));
  const hasTyped = [...main.querySelectorAll("input, textarea")].some(isTyped) || main.querySelector("video") !== null;
  return { lines, questions: [...questions, ...sliders], buttons: [...boxes, ...buttons], hasTyped };
}

/**
 * Return a board: `refresh()` draws it anew where the page has changed, and tells whether it did;
 * `point(at)` tells which control lies at a place of it (two numbers from 0 to 1, from the upper left);
 * `press(at)` and `drag(at)` use that control.
 */
export function newBoard(main, notice, stop, say, leave) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [WIDTH_PX, HEIGHT_PX];
  const pen = canvas.getContext("2d");
  let places = [];
  let first = 0;
  let lastLooks = "";
  let hovered = null;

  const lay = (text, x, y, width, how) => { places.push({ x, y, width, height: how.height || BUTTON_PX, ...how, text }); };
  const isAnswered = ({ options, slider }) => options.some((o) => o.control.checked) || (slider && !slider.closest(".untouched"));
  const turn = (to) => { first = to; lastLooks = ""; };

  function drawPlaces() {
    for (const place of places) {
      const { x, y, width, height, control, text, kind, isChosen } = place;
      const isOff = control?.disabled;
      if (kind === "slider") {
        const share = (Number(control.value) - Number(control.min)) / (Number(control.max) - Number(control.min));
        pen.fillStyle = "#c9c5be";
        pen.fillRect(x, y + height / 2 - 5, width, 10);
        pen.fillStyle = isOff ? "#aaa" : "#20507a";
        pen.beginPath();
        pen.arc(x + share * width, y + height / 2, 17, 0, 7);
        pen.fill();
        continue;
      }
      pen.fillStyle = isChosen ? "#20507a" : isOff ? "#e4e1dc" : place === hovered ? "#cfe0ee" : "#ffffff";
      pen.strokeStyle = place === hovered && !isOff ? "#20507a" : "#8c877f";
      pen.lineWidth = place === hovered ? 4 : 2;
      pen.beginPath();
      pen.roundRect(x, y, width, height, 9);
      pen.fill();
      pen.stroke();
      pen.fillStyle = isChosen ? "#ffffff" : isOff ? "#8c877f" : "#1c1b19";
      pen.textAlign = "center";
      pen.fillText(text, x + width / 2, y + height / 2 + 10, width - 12);
      pen.textAlign = "left";
    }
  }

  function draw({ lines, questions, buttons, hasTyped }) {
    const width = WIDTH_PX - 2 * MARGIN_PX;
    const bottom = HEIGHT_PX - MARGIN_PX - BUTTON_PX;
    places = [];
    pen.fillStyle = "#f6f4f0";
    pen.fillRect(0, 0, WIDTH_PX, HEIGHT_PX);
    pen.fillStyle = "#1c1b19";
    let y = MARGIN_PX;
    const write = (text, px, weight = "") => {
      pen.font = `${weight} ${px}px ${FONT}`;
      for (const line of wrapped(pen, text, width)) {
        y += 1.28 * px;
        if (y < bottom - 12) pen.fillText(line, MARGIN_PX, y - 0.3 * px);
      }
    };
    for (const { text, isTitle } of lines) write(text, isTitle ? TITLE_PX : TEXT_PX, isTitle ? "600" : "");
    if (hasTyped) write(say("vr_flat"), TEXT_PX);
    first = Math.min(first, Math.max(0, questions.length - 1));
    first -= first % QUESTIONS_AT_ONCE;
    for (const { text, options, slider } of questions.slice(first, first + QUESTIONS_AT_ONCE)) {
      write(text, TEXT_PX);
      y += 6;
      const columns = options.length > 12 ? Math.ceil(options.length / 2) : options.length;
      const each = width / Math.max(1, columns);
      options.forEach(({ text: label, control }, i) => lay(label, MARGIN_PX + (i % columns) * each, y + BUTTON_PX * Math.floor(i / columns), each - 8,
        { control, isChosen: control.checked, height: BUTTON_PX - 6 }));
      if (options.length) y += BUTTON_PX * Math.ceil(options.length / columns);
      if (slider) { lay("", MARGIN_PX + 10, y, width - 20, { kind: "slider", control: slider, height: BAR_PX }); y += BAR_PX + 8; }
    }
    const below = buttons.map(({ text, control }) => ({ text, control, isChosen: control.type === "checkbox" && control.checked }));
    if (first > 0) below.unshift({ text: "◀", act: () => turn(first - QUESTIONS_AT_ONCE) });
    if (first + QUESTIONS_AT_ONCE < questions.length) below.push({ text: "▶", act: () => turn(first + QUESTIONS_AT_ONCE) });
    if (!stop.hidden) below.push({ text: textOf(stop), control: stop });
    below.push({ text: say("vr_leave"), act: leave });
    below.forEach((one, i) => lay(one.text, MARGIN_PX + i * width / below.length, bottom, width / below.length - 10, one));
    pen.font = `${TEXT_PX - 3}px ${FONT}`;
    drawPlaces();
    const question = questions.slice(first, first + QUESTIONS_AT_ONCE);
    return question.length > 0 && question.every(isAnswered) && first + QUESTIONS_AT_ONCE < questions.length;
  }

  const at = ([u, v]) => places.find((p) => u * WIDTH_PX >= p.x && u * WIDTH_PX <= p.x + p.width && v * HEIGHT_PX >= p.y && v * HEIGHT_PX <= p.y + p.height) || null;
  const slideTo = (place, [u]) => slide(place.control, (u * WIDTH_PX - place.x) / place.width);
  let held = null;

  return {
    canvas,
    refresh() {
      const content = contentOf(main, notice);
      const looks = JSON.stringify([first, hovered?.text, hovered?.x, hovered?.y, content.lines, content.hasTyped, stop.hidden,
        content.questions.map((q) => [q.text, q.slider?.value, q.options.map((o) => [o.text, o.control.checked, o.control.disabled])]),
        content.buttons.map((b) => [b.text, b.control.disabled, b.control.checked])]);
      if (looks === lastLooks) return false;
      lastLooks = looks;
      draw(content);
      if (hovered) hovered = places.find((p) => p.x === hovered.x && p.y === hovered.y) || null;
      return true;
    },
    /** Tell whether another control is pointed at than before, and one that can be used. */
    point(uv) {
      const now = uv && at(uv);
      const isNew = now !== hovered && Boolean(now) && !now.control?.disabled;
      hovered = now;
      return isNew;
    },
    press(uv) {
      const place = at(uv);
      if (!place) return false;
      if (place.act) place.act();
      else if (place.kind === "slider") { held = place; slideTo(place, uv); }
      else {
        press(place.control);
        // Who has answered all that is in sight sees what comes next.
        if (place.control.type === "radio" && draw(contentOf(main, notice))) turn(first + QUESTIONS_AT_ONCE);
      }
      return true;
    },
    drag(uv) { if (held && uv) slideTo(held, uv); },
    release() { held = null; },
    /** Where a text of the board is, for tests: two numbers from 0 to 1. */
    placeOf(text, nth = 0) {
      const place = places.filter((p) => p.text === text)[nth];
      return place ? [(place.x + place.width / 2) / WIDTH_PX, (place.y + place.height / 2) / HEIGHT_PX] : null;
    },
    texts: () => places.map((p) => p.text),
    begin() { first = 0; held = null; },
  };
}

// Flat stimuli: texts, pictures, shapes, gratings and dots on a canvas over the whole window, in degrees
// of visual angle, one after another without a break, and what is heard with them. Every picture is
// loaded once, and decoded before anything of its step is shown.

import { dotsPixels, stepAt } from "./dots.js";
import * as film from "./film.js";
import { loaded } from "./loading.js";
import * as panorama from "./panorama.js";
import * as sound from "./sound.js";
import * as wire from "./wire.js";

const NAMES = { " ": ["space", "trigger"], enter: ["enter", "select"], arrowleft: ["left"], arrowright: ["right"], arrowup: ["up"], arrowdown: ["down"] };
const LINE_EM = 1.2;
const MAX_PATH = 20000; // places of the pointer in a part
const files = new Map();

// ---- pictures -------------------------------------------------------------------------------

export async function load(picture, key) {
  if (!files.has(picture.picture)) {
    files.set(picture.picture, await loaded(() => wire.asset(picture.picture, key), picture.bytes, async (buffer) => {
      const blob = new Blob([buffer], { type: picture.mime || "image/png" });
      (await decoded(blob)).close();
      return { blob };
    }));
  }
  return files.get(picture.picture).report;
}

const decoded = (blob, more = {}) => createImageBitmap(blob, { colorSpaceConversion: "none", ...more });

// The pictures that parts of a step show: those of items, and what is around.
export const picturesOf = (parts) => [...parts.flatMap((part) => part.items).filter((item) => item.kind === "image"), ...panoramasOf(parts)];

const panoramasOf = (parts) => parts.map((part) => part.panorama).filter(Boolean);

const fileOf = (item) => {
  const file = files.get(item.picture);
  if (!file) throw Object.assign(new Error("it was not loaded"), { file: item.file });
  return file.blob;
};

// ---- places and sizes -----------------------------------------------------------------------

const rad = (deg) => deg * Math.PI / 180;

// Left, top, width and height in pixels of the canvas: angles count along each axis, from the middle.
export function boxOf(atDeg, sizeDeg, canvas, distancePx) {
  const edge = (axis, sign) => distancePx * Math.tan(rad(atDeg[axis] + sign * sizeDeg[axis] / 2));
  const left = Math.round(canvas.width / 2 + edge(0, -1));
  const top = Math.round(canvas.height / 2 - edge(1, 1));
  const right = Math.max(left + 1, Math.round(canvas.width / 2 + edge(0, 1)));
  const bottom = Math.max(top + 1, Math.round(canvas.height / 2 - edge(1, -1)));
  return [left, top, right - left, bottom - top];
}

// The height of a line is that from the top of an h to the bottom of a g.
function fontOf(context, linePx) {
  const family = 'system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
  const heightAt = (px) => {
    context.font = `${px}px ${family}`;
    const m = context.measureText("hg");
    return [m.actualBoundingBoxAscent, m.actualBoundingBoxDescent];
  };
  const [up, down] = heightAt(100);
  return heightAt(100 * linePx / (up + down));
}

function sizeOf(item, context) {
  if (item.kind === "text") {
    const lines = item.text.split("\n");
    const [up, down] = fontOf(context, 100);
    const wide = Math.max(...lines.map((line) => context.measureText(line).width));
    return [(wide / (up + down) + 0.1) * item.height_deg, lines.length * LINE_EM * item.height_deg];
  }
  if (item.kind === "image" || item.kind === "video") {
    const shape = item.width_px / item.height_px;
    if (item.width_deg === null) return [item.height_deg * shape, item.height_deg];
    return [item.width_deg, item.height_deg ?? item.width_deg / shape];
  }
  return [item.width_deg, item.height_deg ?? item.width_deg];
}

// ---- drawing --------------------------------------------------------------------------------

// The pixels of a grating, as `visavis.stimuli.flat_pixels` makes them.
export function gratingPixels(item, wide, high) {
  const pixels = new Uint8ClampedArray(4 * wide * high);
  const degPerPx = item.width_deg / wide;
  const turn = rad(item.orientation_deg);
  for (let row = 0; row < high; row += 1) {
    const y = (high / 2 - row - 0.5) * degPerPx;
    for (let column = 0; column < wide; column += 1) {
      const x = (column + 0.5 - wide / 2) * degPerPx;
      const across = x * Math.cos(turn) + y * Math.sin(turn);
      const radius = Math.hypot(x, y);
      let wave = item.contrast_01 * Math.cos(2 * Math.PI * item.cycles_per_deg * across + rad(item.phase_deg));
      if (item.mask === "gauss") wave *= Math.exp(-0.5 * (radius / item.sd_deg) ** 2);
      const at = 4 * (row * wide + column);
      pixels.fill(127.5 + 127.5 * wave, at, at + 3); // a clamped array rounds halves to even
      pixels[at + 3] = item.mask === "circle" && radius > item.width_deg / 2 ? 0 : 255;
    }
  }
  return pixels;
}

function drawPixels(context, pixels, [left, top, wide, high]) {
  const own = new OffscreenCanvas(wide, high);
  own.getContext("2d").putImageData(new ImageData(pixels, wide, high), 0, 0);
  context.drawImage(own, left, top);
}

const drawGrating = (context, item, box) => drawPixels(context, gratingPixels(item, box[2], box[3]), box);

function drawText(context, item, [left, top, wide, high]) {
  const lines = item.text.split("\n");
  const linePx = high / (lines.length * LINE_EM);
  const [up, down] = fontOf(context, linePx);
  context.fillStyle = item.rgb;
  context.textAlign = "center";
  context.textBaseline = "alphabetic";
  lines.forEach((line, k) => {
    const middle = top + high * (k + 0.5) / lines.length;
    context.fillText(line, left + wide / 2, middle + (up - down) / 2);
  });
}

function drawShape(context, item, [left, top, wide, high]) {
  const line = Math.round(item.line_deg / item.width_deg * wide);
  const path = new Path2D();
  context.fillStyle = context.strokeStyle = item.rgb;
  if (item.shape === "cross") {
    const bar = line || Math.floor(Math.min(wide, high) / 5);
    context.fillRect(left + (wide - bar) / 2, top, bar, high);
    context.fillRect(left, top + (high - bar) / 2, wide, bar);
    return;
  }
  if (item.shape === "ellipse") path.ellipse(left + wide / 2, top + high / 2, wide / 2, high / 2, 0, 0, 2 * Math.PI);
  else if (item.shape === "rectangle") path.rect(left, top, wide, high);
  else { path.moveTo(left + wide / 2, top); path.lineTo(left + wide, top + high); path.lineTo(left, top + high); path.closePath(); }
  if (!line) { context.fill(path); return; }
  context.save(); // an outline lies within its shape
  context.clip(path);
  context.lineWidth = 2 * line;
  context.stroke(path);
  context.restore();
}

function drawPicture(context, item, [left, top, wide, high], bitmaps) {
  context.imageSmoothingEnabled = true;
  context.imageSmoothingQuality = "high";
  context.drawImage(bitmaps.get(item.picture), left, top, wide, high);
}

// A blurred copy of a page: drawn small, and large again. Not every browser has a filter for it.
function blurred(page, blurPx) {
  const small = new OffscreenCanvas(Math.max(1, Math.round(page.width / blurPx)), Math.max(1, Math.round(page.height / blurPx)));
  const large = new OffscreenCanvas(page.width, page.height);
  for (const [from, to] of [[page, small], [small, large]]) {
    const on = to.getContext("2d", { alpha: false });
    on.imageSmoothingEnabled = true;
    on.imageSmoothingQuality = "high";
    on.drawImage(from, 0, 0, to.width, to.height);
  }
  return large;
}

const DRAW = { text: drawText, shape: drawShape, grating: drawGrating, image: drawPicture };

// A film stands over the canvas, and what is in front of it over that.
function filmOver(item, [left, top, wide, high], ratio) {
  const video = document.createElement("video");
  Object.assign(video, { muted: true, playsInline: true, preload: "auto", disablePictureInPicture: true });
  const px = { left, top, width: wide, height: high };
  for (const [name, value] of Object.entries(px)) video.style[name] = `${value / ratio}px`;
  film.prepare(item, video);
  return video;
}

// The first picture of a film has to be there before anything of its step is shown.
const decodedFilm = (item, video) => new Promise((resolve, reject) => {
  if (video.readyState >= 3) resolve();
  video.addEventListener("canplay", resolve, { once: true });
  video.addEventListener("error", () => reject(Object.assign(new Error(video.error?.message || "it cannot be played"), { file: item.file })), { once: true });
});

// ---- one step -------------------------------------------------------------------------------

// Shows the parts of a step one after another in `holder`; `done` gets when each was there, by the
// page's clock, and the key; `broken` why its sounds were not heard whole. A part is drawn within a
// frame and lit from the next one on.
export async function open(step, holder, screen, frameMs, done, broken) {
  const hasSounds = step.parts.some((part) => part.sounds?.length);
  if (hasSounds) sound.forget();
  const canvas = document.createElement("canvas");
  const ratio = devicePixelRatio || 1;
  canvas.className = "flat";
  canvas.style.touchAction = step.parts.some((part) => part.reveal) ? "none" : ""; // a finger uncovers, it does not scroll
  canvas.width = Math.max(1, Math.round(innerWidth * ratio));
  canvas.height = Math.max(1, Math.round(innerHeight * ratio));
  const hasAround = panoramasOf(step.parts).length > 0; // behind a canvas that is clear around its items
  const context = canvas.getContext("2d", { alpha: hasAround });
  const distancePx = screen.distance_mm * screen.px_per_mm * ratio;
  const bitmaps = new Map();
  for (const item of step.parts.flatMap((part) => part.items)) {
    if (item.kind !== "image" || bitmaps.has(item.picture)) continue;
    bitmaps.set(item.picture, await decoded(fileOf(item)));
  }
  const around = hasAround ? await panorama.open(panoramasOf(step.parts), [canvas.width, canvas.height], distancePx,
    (one, most) => decoded(fileOf(one), one.width_px > most ? { resizeWidth: most, resizeHeight: most / 2, resizeQuality: "high" } : {})) : null;
  let outside = 0;
  // What stands still is drawn beforehand: up to the first dots on `pages`, the rest in layers over it.
  const layers = step.parts.map(() => []);
  const films = step.parts.map(() => []); // the films of each part, those of the one before where it goes on
  const pages = step.parts.map((part, k) => {
    const page = new OffscreenCanvas(canvas.width, canvas.height);
    let on = page.getContext("2d", { alpha: Boolean(part.panorama) });
    on.fillStyle = part.background;
    if (!part.panorama) on.fillRect(0, 0, page.width, page.height);
    for (const item of part.items) {
      const box = boxOf(item.at_deg, sizeOf(item, on), canvas, distancePx);
      const isWhole = box[0] >= 0 && box[1] >= 0 && box[0] + box[2] <= page.width && box[1] + box[3] <= page.height;
      if (!isWhole && !part.goes_on) outside += 1;
      if (item.kind === "video") {
        const over = document.createElement("canvas");
        [over.width, over.height] = [canvas.width, canvas.height];
        on = over.getContext("2d");
        if (part.goes_on) { films[k] = films[k - 1]; continue; }
        films[k].push({ item, over, video: filmOver(item, box, ratio), player: null });
      } else if (item.kind === "dots") {
        const over = new OffscreenCanvas(canvas.width, canvas.height);
        on = over.getContext("2d");
        layers[k].push({ item, box, over });
      } else DRAW[item.kind](on, item, box, bitmaps);
    }
    return page;
  });
  const drawPage = (k) => {
    if (step.parts[k].panorama) context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(pages[k], 0, 0);
  };
  const move = (k, elapsedMs) => {
    drawPage(k);
    for (const { item, box, over } of layers[k]) {
      drawPixels(context, dotsPixels(item, box[2], box[3], stepAt(item, elapsedMs / 1000)), box);
      context.drawImage(over, 0, 0);
    }
  };
  for (const bitmap of bitmaps.values()) bitmap.close();
  const pxOf = (deg) => distancePx * rad(deg);
  const veils = step.parts.map((part, k) => part.reveal ? blurred(pages[k], pxOf(part.reveal.blur_deg)) : null);
  let pointer = null; // where it was last, in pixels of the window
  const onPointer = (e) => { pointer = [e.clientX, e.clientY]; };
  document.addEventListener("pointermove", onPointer);
  document.addEventListener("pointerdown", onPointer);
  // The veil, and the window in it around the pointer.
  const reveal = (k) => {
    context.drawImage(veils[k], 0, 0);
    if (!pointer) return;
    context.save();
    context.beginPath();
    context.arc(pointer[0] * ratio, pointer[1] * ratio, pxOf(step.parts[k].reveal.window_deg) / 2, 0, 2 * Math.PI);
    context.clip();
    context.drawImage(pages[k], 0, 0);
    context.restore();
  };
  const showFilms = (k) => {
    for (const one of films.flat()) one.video.style.visibility = one.over.style.visibility = films[k]?.includes(one) ? "visible" : "hidden";
    for (const one of films[k] || []) {
      if (one.player) continue;
      one.player = film.play([{ ...one.item, place: "film" }], [one.video], () => {}, true);
      one.player.first.catch((error) => { if (!isOver) { close(); broken(Object.assign(error, { file: one.item.file })); } });
    }
  };
  const draw = (k, elapsedMs) => {
    canvas.dataset.part = k;
    showFilms(k);
    if (k < pages.length && layers[k].length) { move(k, elapsedMs); return; }
    if (k < pages.length && veils[k]) { reveal(k); return; }
    if (k < pages.length) drawPage(k);
    else { context.fillStyle = step.parts.at(-1).background; context.fillRect(0, 0, canvas.width, canvas.height); }
  };

  const { keys } = step;
  const lit = [];
  const presses = [];
  let answer = null;
  let isOver = false;
  let isLate = false;
  const optionOf = (e) => {
    const name = e.key.toLowerCase();
    return [name, ...(NAMES[name] || [])].find((one) => keys.options.includes(one));
  };
  const arrows = []; // pressed since the last frame
  const onKey = (e) => {
    if (e.repeat || e.ctrlKey || e.altKey || e.metaKey) return;
    const name = e.key.toLowerCase();
    if (step.parts[drawn]?.panorama && panorama.turnsView(name)) {
      e.preventDefault();
      arrows.push({ name, at_ms: e.timeStamp });
      return;
    }
    if (!keys) return;
    const option = optionOf(e);
    if (option === undefined) return;
    e.preventDefault();
    presses.push({ option, at_ms: e.timeStamp, by: "keys" });
  };
  document.addEventListener("keydown", onKey);
  const close = () => {
    isOver = true;
    document.removeEventListener("keydown", onKey);
    document.removeEventListener("pointermove", onPointer);
    document.removeEventListener("pointerdown", onPointer);
    for (const { player } of films.flat()) player?.end();
  };

  // `drawn` is the part that the frame before drew; it has been lit since this one.
  let drawn = -1;
  let frames = 0;
  let dropped = 0;
  let before = null;
  let windowAt = null; // where the window is that was drawn last
  const heard = new Map(); // what began of the sounds of each part
  const isHeardAlone = (k) => Boolean(step.parts[k].sounds?.length) && !step.parts[k].items.length && !step.parts[k].panorama;
  // From when on a part is timed: what is heard alone from its first sample.
  const timedFrom = (k) => (isHeardAlone(k) && heard.has(k) ? sound.timeOf(heard.get(k)).on_ms : lit[k].on_ms);
  // For how long a part is lit; null where only a key ends it.
  const lastsMs = (k) => {
    const { frames: count, seconds } = step.parts[k];
    if (count !== null) return count * frameMs;
    return seconds === null ? null : Math.round(1000 * seconds / frameMs) * frameMs;
  };
  // Sounds are begun as long before their part is lit as the browser takes to play them; before the
  // first part that takes, the page waits.
  let beginMs = null;
  const beginSounds = (now) => {
    if (!hasSounds) return;
    sound.follow();
    if (beginMs === null) beginMs = step.parts[0].sounds?.length ? now + frameMs * Math.ceil(sound.leadMs() / frameMs) : now + frameMs;
    let atMs = drawn < 0 ? beginMs : lit[drawn].on_ms + (lastsMs(drawn) ?? Infinity);
    if (drawn >= 0 && isHeardAlone(drawn)) atMs += Math.max(0, timedFrom(drawn) - lit[drawn].on_ms);
    for (let k = drawn + 1; k < step.parts.length && atMs - now <= sound.leadMs(); k += 1) {
      if (step.parts[k].sounds?.length && !heard.has(k)) heard.set(k, sound.begin(step.parts[k].sounds, Math.max(atMs, now + frameMs)));
      atMs += lastsMs(k) ?? Infinity;
    }
  };
  // How long what moves in a part will have moved in the next frame; it goes on from part to part.
  const movedMs = (k, now) => {
    let first = k;
    while (step.parts[first] && step.parts[first].goes_on) first -= 1;
    return lit[first] ? now + frameMs - lit[first].on_ms : 0;
  };
  // The view onto what is around a part: it goes on turning from part to part.
  let view = null;
  let seenDeg = null; // which of it was drawn last
  const turn = (now) => {
    for (const { name, at_ms } of arrows.splice(0)) {
      const turn = at_ms > lit[drawn].on_ms || step.parts[drawn].goes_on ? view.press(name, now) : null;
      if (turn) lit[drawn].turns.push(turn);
    }
  };
  const drawAround = (k, now) => {
    const part = step.parts[k];
    if (!part?.panorama) return;
    if (k !== drawn && !part.goes_on) view = panorama.viewTurns(frameMs);
    const deg = view.at(now + 1.5 * frameMs); // in the middle of the frame that it will be lit for
    if (k === drawn && deg.join() === seenDeg) return;
    around.draw(part.panorama, deg);
    seenDeg = deg.join();
  };
  const show = (k, now) => {
    if (step.parts[k]?.sounds?.length && !heard.has(k)) heard.set(k, sound.begin(step.parts[k].sounds, now + frameMs));
    draw(k, movedMs(k, now));
    drawAround(k, now);
    drawn = k;
    windowAt = pointer;
  };
  const onFrame = (now) => {
    if (isOver) return;
    requestAnimationFrame(onFrame);
    const missed = before === null ? 0 : Math.max(0, Math.round((now - before) / frameMs) - 1);
    before = now;
    if (lit.length === drawn) { // its first frame, and the first without the one before
      if (drawn > 0) Object.assign(lit[drawn - 1], { off_ms: now, frames, dropped: dropped + missed });
      lit.push({ on_ms: now });
      if (step.parts[drawn] && step.parts[drawn].reveal) lit[drawn].pointer = windowAt ? [[now, ...windowAt]] : [];
      if (step.parts[drawn]?.panorama) lit[drawn].turns = [];
      frames = dropped = 0;
      if (drawn === step.parts.length || answer || isLate) { finish(); return; }
    } else dropped += missed;
    beginSounds(now);
    if (drawn < 0) { if (beginMs === null || now + 1.5 * frameMs > beginMs) show(0, now); return; }
    frames += 1;
    const part = step.parts[drawn];
    if (part.panorama) turn(now);
    if (part.reveal && pointer && pointer !== windowAt && lit[drawn].pointer.length < MAX_PATH) { // what is drawn now is lit from the next frame on
      reveal(drawn);
      windowAt = pointer;
      lit[drawn].pointer.push([now + frameMs, ...pointer]);
    }
    const onMs = timedFrom(drawn);
    if (keys && drawn >= keys.since) {
      const fromMs = timedFrom(keys.from);
      const sinceMs = Math.max(fromMs, lit[keys.since].on_ms);
      answer = presses.find((p) => p.at_ms > sinceMs && p.at_ms <= fromMs + 1000 * keys.limit_s) || null;
      isLate = !answer && now + frameMs / 2 > fromMs + 1000 * keys.limit_s;
      if (answer || isLate) { draw(step.parts.length); drawn += 1; return; }
    }
    const lasts = part.frames !== null ? frames >= part.frames
      : part.seconds !== null && now + (isHeardAlone(drawn) ? 1 : 1.5) * frameMs > onMs + 1000 * part.seconds;
    if (lasts) show(drawn + 1, now);
    else {
      if (layers[drawn].length) move(drawn, movedMs(drawn, now));
      drawAround(drawn, now);
    }
  };
  const finish = () => {
    close();
    if (![...heard.values()].every(sound.hasBegun)) { broken(new Error("its clock stands still")); return; }
    for (const [k, begun] of heard) if (lit[k]) lit[k].sound = sound.timeOf(begun);
    step.parts.forEach((part, k) => {
      if (lit[k] && !part.goes_on && films[k].length) lit[k].films = films[k].map(({ player }) => ({ ...player.report().film, first_ms: player.report().film.first_ms ?? lit[k].on_ms }));
    });
    done({ parts: lit.slice(0, -1), answer, outside, ...(hasAround ? { frame_ms: frameMs } : {}), view_px: [Math.round(canvas.width / ratio), Math.round(canvas.height / ratio)] });
  };
  holder.append(...(around ? [around.canvas] : []), canvas, ...films.flat().flatMap(({ video, over }) => [video, over]));
  showFilms(-1);
  await Promise.all(films.flat().map(({ item, video }) => decodedFilm(item, video)));
  sound.onBreak(() => { if (hasSounds && !isOver) { close(); broken(new Error("the browser stopped it")); } });
  requestAnimationFrame(onFrame);
  return { close: () => { if (!isOver) sound.hush(); close(); } };
}

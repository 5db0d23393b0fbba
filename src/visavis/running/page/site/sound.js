// Tones and sounds: loaded whole, begun together at a time of the audio clock. When that was by the
// page's clock follows from what the browser says of its output.

import { loaded, pause } from "./loading.js";
import * as wire from "./wire.js";

const RATE_HZ = 48000;
const WAKE_MS = 1000;
const MARGIN_S = 0.03; // from a call to its first sample; no thread is so late
const MAX_READINGS = 300;
const buffers = new Map();
const sources = new Set();
let context = null;
let readings = [];
let breaks = 0;
let whenBroken = () => {};

export async function load(sound, key) {
  if (!buffers.has(sound.sound)) {
    buffers.set(sound.sound, await loaded(() => wire.asset(sound.sound, key), sound.bytes, (content) => {
      const length = sound.bytes / 4 / sound.channels;
      const buffer = new AudioBuffer({ length, numberOfChannels: sound.channels, sampleRate: RATE_HZ });
      for (let c = 0; c < sound.channels; c += 1) buffer.copyToChannel(new Float32Array(content, 4 * length * c, length), c);
      return { buffer };
    }));
  }
  return buffers.get(sound.sound).report;
}

// ---- the audio clock ------------------------------------------------------------------------

function opened() {
  const own = new AudioContext({ sampleRate: RATE_HZ, latencyHint: "interactive" });
  const broke = () => {
    if (own.state === "running" || !sources.size) return;
    breaks += 1;
    hush();
    whenBroken();
  };
  own.addEventListener("statechange", broke);
  own.addEventListener("error", broke);
  return own;
}

// Whether sounds are heard now. Browsers play none before a gesture, and may stop later.
export async function wake() {
  context ??= opened();
  if (context.state !== "running") await Promise.race([context.resume().catch(() => {}), pause(WAKE_MS)]);
  return context.state === "running";
}

export const isAwake = () => context?.state === "running";

// What to do when the browser stops what sounds; how often it did since this was asked last.
export function onBreak(act) { whenBroken = act; }
export function breaksSince() {
  const count = breaks;
  breaks = 0;
  return count;
}

// How much later the page's clock is than the audio clock at the output, and who says so.
function reading() {
  const stamp = context.getOutputTimestamp?.();
  if (stamp?.performanceTime > 0 && stamp.contextTime > 0) return { offsetMs: stamp.performanceTime - 1000 * stamp.contextTime, by: "output_timestamp" };
  const by = context.outputLatency === undefined ? "current_time" : "output_latency";
  const latencyS = context.baseLatency + (context.outputLatency || 0);
  return { offsetMs: performance.now() - 1000 * (context.currentTime - latencyS), by };
}

// A step with sounds begins anew, and follows in every frame.
export const forget = () => { readings = []; };
export function follow() { readings = [...readings.slice(1 - MAX_READINGS), reading()]; }

const latencyMs = () => 1000 * context.currentTime + reading().offsetMs - performance.now();

// How long before it is to be heard a sound has to be begun.
export const leadMs = () => Math.max(0, latencyMs()) + 2000 * MARGIN_S;

// ---- playing --------------------------------------------------------------------------------

// Let sounds begin together, to be heard at a time of the page's clock or as soon after it as can be.
export function begin(sounds, atMs) {
  const calledMs = performance.now();
  const soonestS = context.currentTime + MARGIN_S;
  const whenS = Math.round(RATE_HZ * Math.max((atMs - reading().offsetMs) / 1000, soonestS)) / RATE_HZ;
  for (const sound of sounds) {
    const source = new AudioBufferSourceNode(context, { buffer: buffers.get(sound.sound).buffer });
    source.addEventListener("ended", () => sources.delete(source));
    source.connect(context.destination);
    sources.add(source);
    source.start(whenS);
  }
  follow();
  return { whenS, lateMs: Math.max(0, performance.now() - calledMs - 1000 * MARGIN_S), latencyMs: latencyMs() };
}

// When a sound was heard by the page's clock, and how sure that is: half the range of what was read.
export function timeOf({ whenS, lateMs, latencyMs: latency }) {
  const offsets = readings.map((r) => r.offsetMs).sort((a, b) => a - b);
  const spreadMs = (offsets.at(-1) - offsets[0]) / 2;
  return { on_ms: offsets[offsets.length >> 1] + 1000 * whenS, error_ms: spreadMs + lateMs, by: readings.at(-1).by, latency_ms: latency };
}

// A clock that stands still plays nothing, whatever its browser says.
export const hasBegun = ({ whenS }) => context.currentTime > whenS;

export function hush() {
  for (const source of sources) source.stop();
  sources.clear();
}

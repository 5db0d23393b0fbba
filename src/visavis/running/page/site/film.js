// Films: loaded whole before they are needed, checked, played together. Each film reports how it was presented.

import { loaded } from "./loading.js";
import * as wire from "./wire.js";

const AT_ONCE = 2;
const FIRST_FRAME_LIMIT_MS = 10000;
const MAX_AHEAD_S = 0.1;
const TOGETHER_S = 0.04;
const KEYS = ["play", "pause", "stop", "seekbackward", "seekforward", "seekto"];
const cache = new Map();

async function hashOf(buffer) {
  if (!globalThis.crypto?.subtle) return null; // not on a plain address of another machine
  const digest = await crypto.subtle.digest("SHA-256", buffer);
  return [...new Uint8Array(digest)].map((b) => b.toString(16).padStart(2, "0")).join("");
}

// The media keys of a keyboard or of headphones neither stop a film nor begin it anew.
for (const action of KEYS) {
  try {
    globalThis.navigator?.mediaSession?.setActionHandler(action, () => {});
  } catch { /* this browser has no such key */ }
}

// Browsers begin sound only after a click or a key: a page loaded anew has had neither.
export function mayBeHeard() {
  return navigator.userActivation?.hasBeenActive !== false;
}

export function isLoaded(film) {
  return cache.has(film.film);
}

export async function load(film, key) {
  if (!cache.has(film.film)) {
    cache.set(film.film, await loaded(() => wire.film(film.film, key), film.bytes, async (buffer) => {
      const hash = await hashOf(buffer);
      if (hash !== null && hash !== film.sha256) throw new Error("it came damaged");
      return { url: URL.createObjectURL(new Blob([buffer], { type: film.mime || "video/webm" })), report: { is_checked: hash !== null } };
    }));
  }
  return cache.get(film.film).report;
}

export async function loadAll(films, key, onProgress) {
  const reports = {};
  const failures = [];
  const waiting = [...films];
  let count = 0;
  async function worker() {
    while (waiting.length) {
      const film = waiting.shift();
      try {
        reports[film.film] = await load(film, key);
      } catch (error) {
        failures.push({ film, why: error.message });
      }
      onProgress(++count);
    }
  }
  await Promise.all(Array.from({ length: AT_ONCE }, worker));
  return { reports, failures };
}

class Player {
  constructor(film, video) {
    this.film = film;
    this.video = video;
    this.firstMs = null;
    this.firstAtS = null; // where the film stood then
    this.frames = 0;
    this.rounds = 0;
    this.stalls = 0;
    this.mediaS = 0;
    this.soundMs = null;
    this.volume = 0;
    this.isOver = false;
    this.waits = false;
    this.hasFrameTimes = "requestVideoFrameCallback" in video;
    video.addEventListener("waiting", () => { if (this.firstMs !== null && !video.ended) this.stalls += 1; });
  }

  watch(onFrame, onRendered) {
    const onPresented = (now, data) => {
      if (this.isOver) return;
      onRendered(now);
      if (this.firstMs === null) {
        this.firstMs = data.expectedDisplayTime || now;
        this.firstAtS = data.mediaTime;
        this.hear(data.mediaTime);
      }
      this.frames = Math.max(this.frames + (data.presentedFrames ? 0 : 1), data.presentedFrames || 0);
      this.mediaS = data.mediaTime;
      onFrame(this);
      this.video.requestVideoFrameCallback(onPresented);
    };
    if (this.hasFrameTimes) {
      this.video.requestVideoFrameCallback(onPresented);
      return;
    }
    let last = -1;
    const look = (now) => {
      if (this.isOver) return;
      onRendered(now);
      const at = this.video.currentTime;
      if (at !== last && this.video.readyState >= 2 && !this.video.paused) {
        if (this.firstMs === null) { this.firstMs = now; this.firstAtS = at; this.hear(at); }
        this.frames += 1;
        this.mediaS = at;
        onFrame(this);
      }
      last = at;
      requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  }

  // Sound and pictures of a film share one clock: its sound began when that stood at zero.
  hear(mediaS) {
    if (!this.film.sound) return;
    this.volume = this.video.muted ? 0 : this.video.volume;
    if (this.volume > 0) this.soundMs = this.firstMs - 1000 * mediaS;
  }

  report() {
    const isSilent = this.video.webkitAudioDecodedByteCount === 0 || this.video.mozHasAudio === false; // undefined where a browser does not say
    const quality = this.video.getVideoPlaybackQuality?.();
    return {
      first_ms: this.firstMs,
      first_at_ms: this.firstAtS === null ? null : 1000 * this.firstAtS,
      frames: this.frames,
      dropped: quality ? quality.droppedVideoFrames : 0,
      rounds: this.rounds,
      stalls: this.stalls,
      ...(this.film.sound ? { sound_ms: isSilent ? null : this.soundMs, volume_01: isSilent ? 0 : this.volume } : {}),
    };
  }
}

// Let a film's first pictures be decoded.
export function prepare(film, video) {
  const url = cache.get(film.film)?.url || "";
  if (video.src !== url) video.src = url;
}

// Plays films round after round (or once), begun together; resolves `first` with when all were presented.
export function play(films, videos, onRound, once = false) {
  const players = films.map((film, i) => new Player(film, videos[i]));
  let apartMs = 0;
  let fail = () => {};
  // Films tell of the same rendering one after another: it is complete when the next one's first tells.
  let renderedMs = null;
  const onRendered = (now) => {
    if (now === renderedMs) return;
    renderedMs = now;
    if (players.length < 2 || players.some((p) => p.firstMs === null || p.video.ended || p.rounds !== players[0].rounds)) return;
    const last = Math.min(...players.map((p) => p.mediaS));
    for (const player of players) {
      const aheadS = player.mediaS - last;
      apartMs = Math.max(apartMs, 1000 * aheadS);
      if (aheadS > MAX_AHEAD_S && !player.video.ended) { player.waits = true; player.video.pause(); }
      if (aheadS < TOGETHER_S) goOn(player);
    }
  };
  // Of a pair the film that is ahead waits for the other.
  const goOn = (player) => {
    if (!player.waits) return;
    player.waits = false;
    player.video.play().catch(() => {});
  };
  const first = new Promise((resolve, reject) => {
    fail = (film, why) => reject(Object.assign(new Error(why), { film }));
    const limit = setTimeout(() => {
      const late = players.find((p) => p.firstMs === null);
      if (late) fail(late.film, "no picture was presented in ten seconds");
    }, FIRST_FRAME_LIMIT_MS);
    const onFrame = () => {
      if (players.every((p) => p.firstMs !== null)) {
        clearTimeout(limit);
        resolve(Math.max(...players.map((p) => p.firstMs)));
      }
    };
    for (const player of players) {
      const { video, film } = player;
      video.addEventListener("error", () => fail(film, `error ${video.error?.code}: ${video.error?.message || "it cannot be played"}`));
      player.watch(onFrame, onRendered);
    }
  });
  const again = () => {
    if (players.some((p) => p.isOver)) return;
    players.forEach(goOn); // nobody is waited for who is at the end
    if (players.some((p) => !p.video.ended)) return;
    for (const player of players) { player.rounds += 1; player.mediaS = 0; }
    onRound(players[0].rounds);
    if (once) return;
    for (const { video } of players) { video.currentTime = 0; video.play().catch(() => {}); }
  };
  for (const { video, film } of players) {
    video.addEventListener("ended", again);
    prepare(film, video);
  }
  const ready = players.map(({ video }) => new Promise((resolve) => {
    if (video.readyState >= 3) resolve(); else video.addEventListener("canplay", resolve, { once: true });
  }));
  Promise.all(ready).then(() => {
    for (const { video, film } of players) {
      video.play().catch((error) => { if (!video.error) fail(film, `${error.name}: ${error.message}`); });
    }
  });
  return {
    first,
    report: () => Object.fromEntries(players.map((p) => [p.film.place, p.report()])),
    apartMs: () => (players.length > 1 ? apartMs : null),
    resume: () => { for (const p of players) if (p.video.paused && !p.video.ended && !p.waits) p.video.play().catch(() => {}); },
    end: () => { for (const p of players) { p.isOver = true; p.video.pause(); } },
  };
}

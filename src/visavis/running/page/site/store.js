// The page's own store: events that the server has not acknowledged yet survive reload and crash.

const STORE = "events";

function resultOf(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

// Without IndexedDB (a private window of some browsers) events are kept in memory alone.
class InMemory {
  constructor() { this.events = new Map(); this.meta = new Map(); this.isDurable = false; }
  async all() { return [...this.events.values()]; }
  async put(event) { this.events.set(event.n, event); }
  async replace(events) { this.events = new Map(events.map((e) => [e.n, e])); }
  async drop(upTo) { for (const n of [...this.events.keys()]) if (n <= upTo) this.events.delete(n); }
  async get(name) { return this.meta.get(name); }
  async set(name, value) { this.meta.set(name, value); }
}

class Durable {
  constructor(base) { this.base = base; this.isDurable = true; this.waiting = []; this.together = null; }
  change(name, act) {
    return new Promise((resolve, reject) => {
      const change = this.base.transaction(name, "readwrite", { durability: "strict" });
      change.oncomplete = () => resolve();
      change.onerror = change.onabort = () => reject(change.error);
      act(change.objectStore(name));
    });
  }
  all() { return resultOf(this.base.transaction(STORE).objectStore(STORE).getAll()); }
  // What is put in one task is stored together or not at all: of a frame, its head and its timing.
  put(event) {
    this.waiting.push(event);
    this.together ??= Promise.resolve().then(() => {
      const events = this.waiting;
      [this.waiting, this.together] = [[], null];
      return this.change(STORE, (s) => { for (const e of events) s.put(e); });
    });
    return this.together;
  }
  replace(events) { return this.change(STORE, (s) => { s.clear(); for (const e of events) s.put(e); }); }
  drop(upTo) { return this.change(STORE, (s) => s.delete(IDBKeyRange.upperBound(upTo))); }
  get(name) { return resultOf(this.base.transaction("meta").objectStore("meta").get(name)); }
  set(name, value) { return this.change("meta", (s) => s.put(value, name)); }
}

export async function openStore(name) {
  try {
    const request = indexedDB.open(`visavis-${name}`, 1);
    request.onupgradeneeded = () => {
      request.result.createObjectStore(STORE, { keyPath: "n" });
      request.result.createObjectStore("meta");
    };
    return new Durable(await resultOf(request));
  } catch {
    return new InMemory();
  }
}

// Keeps a bundle's files in the browser, so that a page that is reloaded without a network goes on,
// with its films. What the host gives counts; what was kept stands in where it cannot be asked.

const KEPT = `visavis-${self.registration.scope}`;
const PAGE = ["page.js", "store.js", "film.js", "flat.js", "dots.js", "panorama.js", "sound.js", "loading.js", "wire.js", "page.css", "bundle.json"];

self.addEventListener("install", (event) => {
  self.skipWaiting();
  event.waitUntil(caches.open(KEPT).then((cache) => cache.addAll(PAGE)));
});
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));
self.addEventListener("fetch", (event) => {
  const isOurs = event.request.url.startsWith(self.registration.scope);
  if (event.request.method === "GET" && isOurs) event.respondWith(respond(event.request));
});
self.addEventListener("message", (event) => { // the page itself, which came before this was here
  event.waitUntil(fetch(event.data).then((response) => keep(event.data, response)));
});

const nameOf = (address) => Object.assign(new URL(address), { search: "", hash: "" }).href;

async function keep(address, response) {
  if (response.ok) await (await caches.open(KEPT)).put(nameOf(address), response.clone());
  return response;
}

async function respond(request) {
  try {
    return await keep(request.url, await fetch(request));
  } catch (error) {
    const match = await (await caches.open(KEPT)).match(nameOf(request.url));
    if (match) return match;
    throw error;
  }
}

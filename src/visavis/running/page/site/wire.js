// The wire to the server that this page came from. A bundle for another web host has a wire of its
// own in place of this one, with the same functions.

export const scope = "";
export const keyHere = () => location.hash.slice(1);
export const keepKey = (key) => history.replaceState(null, "", `/#${key}`);
export const query = () => new URLSearchParams(location.search);

// What a proxy answers while the server behind it is begun anew.
const AWAY = [502, 503, 504];

const keyed = (key) => ({ "X-Visavis-Key": key });

export async function post(path, key, body) {
  const response = await fetch(path, {
    method: "POST",
    headers: { ...keyed(key), "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });
  if (AWAY.includes(response.status)) throw new TypeError(`the server is away: ${response.status}`); // as fetch, where nothing answers
  // Whatever stands before a server may answer in its own words.
  const answer = response.ok ? await response.json() : await response.json().catch(() => ({ refused: `the server answered ${response.status}` }));
  return { status: response.status, body: answer };
}

export function leave(key, tab) {
  navigator.sendBeacon("/api/leave", new Blob([JSON.stringify({ key, tab })], { type: "application/json" }));
}

export const film = (name, key) => fetch(`/films/${name}`, { headers: keyed(key), cache: "no-store" });

export const asset = (name, key) => fetch(`/assets/${name}`, { headers: keyed(key), cache: "no-store" });

// What a page shows below its thanks; the server has everything already.
export const finish = async () => null;

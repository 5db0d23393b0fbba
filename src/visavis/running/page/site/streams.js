// Batches of samples for the wire, as visavis.running.page.streams describes them: rows of float32,
// numbered without holes, the first column milliseconds since the batch's first row.

export const MAX_ROWS = 2048;
export const BATCH_MS = 500;
const CHUNK = 0x2000;

export function base64Of(floats) {
  const bytes = new Uint8Array(floats.buffer, floats.byteOffset, floats.byteLength);
  let text = "";
  for (let i = 0; i < bytes.length; i += CHUNK) text += String.fromCharCode(...bytes.subarray(i, i + CHUNK));
  return btoa(text);
}

/**
 * Return what collects rows and passes full batches to `pass(event)`.
 *
 * `row(stream, ms, values, more)` adds a row at the page's clock, `skip(stream, n)` counts rows that
 * were lost, `close()` passes on what there is. `next` holds the number of each stream's next row.
 */
export function newStreams(pass, next = {}) {
  const open = new Map();
  const closeOne = (stream) => {
    const batch = open.get(stream);
    if (!batch) return;
    open.delete(stream);
    const { seq0, rows, t0Ms, more, values } = batch;
    pass({ stream, seq0, rows, t0_ms: t0Ms, ...more, data: base64Of(Float32Array.from(values)) });
  };
  // The batch that a row of this moment belongs to; undefined where it begins one.
  const batchOf = (stream, ms) => {
    const batch = open.get(stream);
    if (batch && (batch.rows >= MAX_ROWS || ms - batch.t0Ms >= BATCH_MS)) closeOne(stream);
    return open.get(stream);
  };
  return {
    next,
    row(stream, ms, values, more = {}) {
      let batch = batchOf(stream, ms);
      if (!batch) { batch = { seq0: next[stream] || 0, rows: 0, t0Ms: ms, more, values: [] }; open.set(stream, batch); }
      batch.lastMs = Math.max(batch.lastMs ?? ms, ms);
      batch.values.push(batch.lastMs - batch.t0Ms, ...values);
      batch.rows += 1;
      next[stream] = batch.seq0 + batch.rows;
    },
    skip(stream, n) { closeOne(stream); next[stream] = (next[stream] || 0) + n; },
    start(stream, ms) { return batchOf(stream, ms)?.more; },
    close() { for (const stream of [...open.keys()]) closeOne(stream); },
  };
}

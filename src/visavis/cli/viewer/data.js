'use strict';
// What the page carries: a header, and arrays that it tells the places of.

const KINDS = {u1: Uint8Array, i1: Int8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array,
  i4: Int32Array, f4: Float32Array, f8: Float64Array};
const MISSING = 65535;
const HELD = 3, MOMENTS = 5;

class Content {
  constructor(buffer) {
    const length = Number(new DataView(buffer).getBigUint64(0, true));
    this.header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
    this.buffer = buffer;
    this.from = 8 + length;
    this.pieces = new Pieces(this.header.pieces || []);
  }

  // The elements of an array, column after column.
  flat(ref) {
    const n = ref.s.reduce((a, b) => a * b, 1);
    return new KINDS[ref.d](this.buffer, this.from + ref.o, n);
  }

  // The picture in a file; null where it cannot be decoded.
  async picture(ref, how) {
    const content = ref.in === undefined ? this : await this.pieces.get(ref.in);
    return content && createImageBitmap(new Blob([content.flat(ref)], {type: 'image/webp'}), how).catch(() => null);
  }

  // Columns of an array: whole numbers exactly; others were stored in parts of their range, and
  // missing values are NaN.
  columns(ref) {
    const codes = this.flat(ref), rows = ref.s[0], out = [];
    for (let c = 0; c < (ref.columns || 0); c++) {
      const values = new Float64Array(rows);
      let value = 0;
      for (let i = 0; i < rows; i++) values[i] = value += codes[c * rows + i];
      out.push(values);
    }
    if (ref.columns !== undefined) return out;
    for (let c = 0; c < ref.low.length; c++) {
      const values = new Float32Array(rows);
      let code = 0;
      for (let i = 0; i < rows; i++) {
        code = (code + codes[c * rows + i]) & 65535;
        values[i] = code === MISSING ? NaN : ref.low[c] + code * ref.step[c];
      }
      out.push(values);
    }
    return out;
  }

  // The same, row after row, as a graphics card wants it.
  rows(ref) {
    const columns = this.columns(ref), n = ref.s[0], k = columns.length;
    const out = new Float32Array(n * k);
    for (let c = 0; c < k; c++) for (let i = 0; i < n; i++) out[i * k + c] = columns[c][i];
    return out;
  }

  // An array as it is, row after row; `pad` more elements a row.
  plainRows(ref, pad = 0) {
    const flat = this.flat(ref), n = ref.s[0], k = flat.length / Math.max(1, n);
    const out = new KINDS[ref.d](n * (k + pad));
    for (let c = 0; c < k; c++) for (let i = 0; i < n; i++) out[i * (k + pad) + c] = flat[c * n + i];
    return out;
  }

  seconds(ref) {
    const steps = this.flat(ref), out = new Float64Array(steps.length);
    let micros = 0;
    for (let i = 0; i < steps.length; i++) out[i] = (micros += steps[i]) / 1e6;
    return out;
  }
}

// Files beside the page with pictures of long films: the last few that were asked for are held.
class Pieces {
  constructor(places) { this.places = places; this.held = new Map(); this.loads = new Map(); }

  // A promise of a file's content; of null where it is not beside the page.
  get(n) {
    const content = this.held.get(n) || this.loads.get(n) || this.load(n);
    this.held.delete(n);
    this.held.set(n, content);
    for (const k of [...this.held.keys()].slice(0, -HELD)) this.held.delete(k);
    return content;
  }

  // One that is no longer among those held may still be on its way.
  load(n) {
    const place = this.places[n], content = new Promise(done => {
      const script = document.createElement('script');
      script.onerror = () => done(null);
      script.onload = () => script.remove();
      Session.waiting.set(place, text => { Session.waiting.delete(place); unpacked(text).then(done, () => done(null)); });
      script.src = place;
      document.head.append(script);
    }).finally(() => this.loads.delete(n));
    this.loads.set(n, content);
    return content;
  }
}

// Moments in words, the first of many: `secondsOf` each of the numbers.
function momentsInWords(numbers, secondsOf) {
  const sorted = [...numbers].sort((a, b) => a - b), first = sorted.slice(0, MOMENTS).map(n => `${secondsOf(n).toFixed(2)} s`);
  return first.join(', ') + (sorted.length > MOMENTS ? ` and ${sorted.length - MOMENTS} more` : '');
}

async function unpacked(text) {
  const packed = atob(text.trim()), bytes = new Uint8Array(packed.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = packed.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Content(await new Response(stream).arrayBuffer());
}

// A code name as people read it.
const inWords = name => String(name).replaceAll('_', ' ');

// The place of the last element that is at most x, −1 before the first.
function lastAt(sorted, x) {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= x) low = middle + 1; else high = middle;
  }
  return low - 1;
}

// ---- vectors and turns (w, x, y, z) ----

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const size = a => Math.hypot(a[0], a[1], a[2]);
const unit = a => { const s = size(a) || 1; return [a[0] / s, a[1] / s, a[2] / s]; };
function rotate(q, v) {
  const [w, x, y, z] = q;
  const tx = 2 * (y * v[2] - z * v[1]), ty = 2 * (z * v[0] - x * v[2]), tz = 2 * (x * v[1] - y * v[0]);
  return [v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx];
}
function turnOf(yaw, pitch) {
  const cy = Math.cos(yaw / 2), sy = Math.sin(yaw / 2), cp = Math.cos(pitch / 2), sp = Math.sin(pitch / 2);
  return [cy * cp, cy * sp, sy * cp, -sy * sp];
}
function modelMatrix(at, q, scale = [1, 1, 1]) {
  const x = rotate(q, [scale[0], 0, 0]), y = rotate(q, [0, scale[1], 0]), z = rotate(q, [0, 0, scale[2]]);
  return new Float32Array([...x, 0, ...y, 0, ...z, 0, ...at, 1]);
}
function spanning(a, b, radius) { // a y-axis cylinder of height 1 between two points
  const along = sub(b, a), y = unit(along);
  const side = unit(cross(Math.abs(y[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0], y)), third = cross(side, y);
  return new Float32Array([...side.map(v => v * radius), 0, ...along, 0, ...third.map(v => v * radius), 0, ...a, 1]);
}

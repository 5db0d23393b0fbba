// Random dots: where each is after so many steps, and their pixels, by the formulae of
// `visavis.stimuli.dots` and `visavis.stimuli.flat_pixels`.

const COLUMN = 0, ROW = 1, DIRECTION = 2, PHASE = 3;
const rounded = (x) => Math.floor(x + 0.5);

function mix(number) {
  let x = number >>> 0;
  x = Math.imul(x ^ (x >>> 16), 0x7feb352d) >>> 0;
  x = Math.imul(x ^ (x >>> 15), 0x846ca68b) >>> 0;
  return (x ^ (x >>> 16)) >>> 0;
}

const random01 = (seed, dot, life, what) => mix(mix(mix(mix(seed) + dot) + life) + what) / 2 ** 32;

export const stepAt = (item, elapsedS) => Math.max(0, rounded(elapsedS * item.rate_hz));

// [right, up] of every dot that is within the field, in degrees from its middle.
export function placesDeg(item, step) {
  const wide = item.width_deg;
  const { seed } = item;
  const count = halfEven(item.density_per_deg2 * wide ** 2);
  const signals = rounded(item.coherence_01 * count);
  const lasts = item.lifetime_s === null ? 0 : Math.max(1, rounded(item.lifetime_s * item.rate_hz));
  const within = (v) => v - wide * Math.floor(v / wide) - wide / 2;
  const places = [];
  for (let dot = 0; dot < count; dot += 1) {
    const wholeAge = step + (lasts ? Math.floor(random01(seed, dot, 0, PHASE) * lasts) : 0);
    let life = lasts ? Math.floor(wholeAge / lasts) : 0;
    const age = lasts ? wholeAge % lasts : step;
    const isSignal = dot < signals;
    const angle = isSignal ? item.direction_deg * (Math.PI / 180) : 2 * Math.PI * random01(seed, dot, life, DIRECTION);
    let wayDeg = item.speed_deg_per_s / item.rate_hz * age;
    if (item.noise === "position" && !isSignal) { life = step; wayDeg = 0; }
    const x = within(wide * random01(seed, dot, life, COLUMN) + wayDeg * Math.cos(angle));
    const y = within(wide * random01(seed, dot, life, ROW) + wayDeg * Math.sin(angle));
    if (item.aperture === "square" || Math.hypot(x, y) <= (wide - item.dot_deg) / 2) places.push([x, y]);
  }
  return places;
}

// As Python rounds.
function halfEven(x) {
  const low = Math.floor(x);
  if (x - low !== 0.5) return rounded(x);
  return low % 2 === 0 ? low : low + 1;
}

export function dotsPixels(item, wide, high, step) {
  const pixels = new Uint8ClampedArray(4 * wide * high);
  const colour = Number.parseInt(item.rgb.slice(1), 16);
  const rgb = [colour >> 16, (colour >> 8) & 255, colour & 255];
  for (let at = 0; at < pixels.length; at += 4) pixels.set(rgb, at);
  const disc = Math.max(1, rounded(item.dot_deg / item.width_deg * wide));
  for (const [x, y] of placesDeg(item, step)) {
    const left = rounded((x / item.width_deg + 0.5) * wide - disc / 2);
    const top = rounded((0.5 - y / item.width_deg) * high - disc / 2);
    for (let down = Math.max(0, -top); down < disc && top + down < high; down += 1) {
      for (let right = Math.max(0, -left); right < disc && left + right < wide; right += 1) {
        if (Math.hypot(down + 0.5 - disc / 2, right + 0.5 - disc / 2) <= disc / 2) pixels[4 * ((top + down) * wide + left + right) + 3] = 255;
      }
    }
  }
  return pixels;
}

// One trial's scene: who stands how at a time, found again from key poses.

class Keys {
  constructor(content, keys) {
    this.k = keys.k;
    this.step = keys.step;
    if (!keys.k) { this.tracks = 0; return; }
    const counts = content.flat(keys.counts);
    this.at = content.flat(keys.at);
    this.v = content.plainRows(keys.v);
    this.tracks = counts.length;
    this.first = new Int32Array(counts.length + 1);
    for (let i = 0; i < counts.length; i++) this.first[i + 1] = this.first[i] + counts[i];
    this.cursor = this.first.slice(0, counts.length);
  }

  // Write what a track is at sample `x` (may lie between two) to `out` from `o` on.
  read(track, x, out, o, turns) {
    const {at, v, k} = this, low = this.first[track], high = this.first[track + 1] - 1;
    let i = this.cursor[track];
    if (at[i] > x) i = low;
    while (i < high && at[i + 1] <= x) i++;
    this.cursor[track] = i;
    const j = Math.min(i + 1, high), span = at[j] - at[i], share = span > 0 ? Math.min(1, (x - at[i]) / span) : 0;
    let length = 0;
    for (let c = 0; c < k; c++) {
      const value = this.step * (v[i * k + c] + share * (v[j * k + c] - v[i * k + c]));
      out[o + c] = value;
      length += value * value;
    }
    if (turns && length > 0) { const s = 1 / Math.sqrt(length); for (let c = 0; c < k; c++) out[o + c] *= s; }
  }
}

class Scene {
  constructor(content, data) {
    this.data = data;
    const own = this.content = data.content || content; // a trial beside the page has its own arrays
    this.root = new Keys(own, data.root);
    this.turns = new Keys(own, data.turns);
    this.morphs = new Keys(own, data.morphs);
    this.light = own.columns(data.light)[0];
    this.flat = data.flat ? new Flat(own, data.flat, data.rate) : null;
    const n = data.cast.length, joints = data.joints;
    this.bones = new Float32Array(n * joints * 12);
    this.shapes = new Float32Array(SHAPES * n);
    this.place = new Float32Array(3 * n);
    this.head = new Float32Array(3 * n);
    this.skeletons = data.cast.map(k => {
      const person = content.header.people[k];
      return person.skeleton ||= {parents: person.parents, offsets: content.plainRows(person.offsets), rest: content.plainRows(person.rest)};
    });
    this.posedAt = NaN;
    this.q = new Float32Array(4 * joints);
    this.w = new Float32Array(4 * joints);
    this.p = new Float32Array(3 * joints);
  }

  row(t) { return Math.floor(this.sample(t)); }
  sample(t) { return Math.max(0, Math.min(this.data.n - 1, (t - this.data.t0) * this.data.rate)); }

  // Place and point looked at (6) of the camera that knows the room; it jumps where it cuts.
  filmedFrom(t) {
    this.views ||= this.content.columns(this.data.topology.views);
    const x = this.sample(t), i = Math.floor(x), j = Math.min(i + 1, this.data.n - 1);
    const cuts = this.data.topology.cuts.some(c => c * this.data.rate > i && c * this.data.rate <= j);
    return this.views.map(v => cuts ? v[i] : v[i] + (x - i) * (v[j] - v[i]));
  }

  brightness(t) { return this.light[Math.round(this.sample(t))]; }

  pose(t) {
    if (t === this.posedAt) return;
    this.posedAt = t;
    const x = this.sample(t), joints = this.data.joints, n = this.data.cast.length;
    const {q, w, p, bones, place, head} = this;
    const morph = new Float32Array(SHAPES);
    for (let r = 0; r < n; r++) {
      this.root.read(r, x, place, 3 * r, false);
      this.morphs.read(r, x, morph, 0, false);
      this.shapes.set(morph, SHAPES * r);
      const {parents, offsets, rest} = this.skeletons[r];
      for (let j = 0; j < joints; j++) {
        this.turns.read(r * joints + j, x, q, 4 * j, true);
        const b = 4 * j, a = 4 * parents[j], o = 3 * j;
        if (parents[j] < 0) {
          for (let c = 0; c < 4; c++) w[b + c] = q[b + c];
          for (let c = 0; c < 3; c++) p[o + c] = place[3 * r + c];
        } else {
          const aw = w[a], ax = w[a + 1], ay = w[a + 2], az = w[a + 3];
          const vx = offsets[o], vy = offsets[o + 1], vz = offsets[o + 2];
          const tx = 2 * (ay * vz - az * vy), ty = 2 * (az * vx - ax * vz), tz = 2 * (ax * vy - ay * vx);
          const from = 3 * parents[j];
          p[o] = p[from] + vx + aw * tx + ay * tz - az * ty;
          p[o + 1] = p[from + 1] + vy + aw * ty + az * tx - ax * tz;
          p[o + 2] = p[from + 2] + vz + aw * tz + ax * ty - ay * tx;
          const bw = q[b], bx = q[b + 1], by = q[b + 2], bz = q[b + 3];
          w[b] = aw * bw - ax * bx - ay * by - az * bz;
          w[b + 1] = aw * bx + ax * bw + ay * bz - az * by;
          w[b + 2] = aw * by - ax * bz + ay * bw + az * bx;
          w[b + 3] = aw * bz + ax * by - ay * bx + az * bw;
        }
        boneRows(w, b, p, o, rest, o, bones, 12 * (r * joints + j));
      }
      for (let c = 0; c < 3; c++) head[3 * r + c] = p[15 + c]; // joint 5 is the head
    }
  }
}

// ---- streams ----

class Streams {
  constructor(content, header) {
    this.content = content;
    this.header = header;
    this.byName = new Map(header.streams.map(s => [s.name, s]));
    this.times = new Map();
    this.read = new Map();
  }

  has(name) { return this.byName.has(name) && this.byName.get(name).t.s[0] > 0; }

  t(name) {
    if (!this.times.has(name)) this.times.set(name, this.content.seconds(this.byName.get(name).t));
    return this.times.get(name);
  }

  // The columns of a field, as Float32Arrays; null where there is no such stream or field.
  field(name, field) {
    const key = name + '.' + field;
    if (!this.read.has(key)) {
      const column = this.byName.get(name)?.columns.find(c => c.name === field);
      this.read.set(key, column ? this.content.columns(column.v) : null);
    }
    return this.read.get(key);
  }

  // A field's values in the last row at or before t; null where that is older than `atMost` s.
  at(name, field, t, atMost = 0.5) {
    const columns = this.field(name, field);
    if (!columns) return null;
    const times = this.t(name), i = lastAt(times, t);
    return i < 0 || t - times[i] > atMost ? null : columns.map(c => c[i]);
  }

  headAt(t) {
    if (!this.has('head')) return null;
    const times = this.t('head'), i = lastAt(times, t);
    if (i < 0) return null;
    const p = this.field('head', 'position_m'), q = this.field('head', 'orientation_wxyz');
    const j = Math.min(i + 1, times.length - 1), span = times[j] - times[i];
    const share = span > 0 && span < 0.2 ? Math.min(1, (t - times[i]) / span) : 0;
    const at = p.map(c => c[i] + share * (c[j] - c[i]));
    let a = q.map(c => c[i]);
    const b = q.map(c => c[j]), sign = a.reduce((s, v, k) => s + v * b[k], 0) < 0 ? -1 : 1;
    a = a.map((v, k) => v + share * (sign * b[k] - v));
    const length = Math.hypot(...a);
    return at.some(Number.isNaN) ? null : {at, turn: a.map(v => v / length)};
  }

  gazeAt(t) {
    if (!this.has('gaze_targets')) return null;
    const times = this.t('gaze_targets'), i = lastAt(times, t);
    if (i < 0 || t - times[i] > 0.1) return null;
    const from = this.field('gaze_targets', 'origin_world_m').map(c => c[i]);
    const along = this.field('gaze_targets', 'direction_world').map(c => c[i]);
    const valid = this.field('gaze_targets', 'valid')[0][i] > 0.5;
    return {i, from, along, valid: valid && !along.some(Number.isNaN), hit: this.field('gaze_targets', 'hit')[0][i], ...this.endAt(times[i])};
  }

  // How far from the eyes the sample of gaze of time t ended on what is drawn, and on what.
  endAt(t) {
    const ends = this.header.gazeEnds.find(e => t >= e.t0 - 1e-3 && t <= e.t1 + 1e-3);
    if (!ends) return {far: NaN, on: ''};
    const own = ends.content || this.content;
    const read = ends.read ||= {t: own.seconds(ends.t), far: own.columns(ends.far)[0], on: own.flat(ends.on)};
    const i = lastAt(read.t, t + 2e-6);
    return i >= 0 && t - read.t[i] < 2e-6 ? {far: read.far[i], on: ends.names[read.on[i]]} : {far: NaN, on: ''};
  }
}

// Where gaze ends: on what is drawn, else 2.5 m away in the air.
function gazeEnd(gaze) { return add(gaze.from, gaze.along, Number.isNaN(gaze.far) ? 2.5 : gaze.far); }

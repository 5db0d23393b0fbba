// The time line: trials, what was looked at, touched and felt, events, and columns of streams.

const LABEL_PX = 168, ROW_PX = 17, PLOT_PX = 62;
const LOOKS = ['#f2b134', '#4fb3bf', '#e8756a', '#8fb339', '#b388eb', '#5a9bd8', '#e39ac0', '#c7a17a', '#7fd1ae', '#d9d264', '#9aa7b1', '#f08c3a'];
const LANE_COLOURS = {contact: '#ff6b5e', vibration: '#5ec8ff'};
const PRACTICE = '#3b4654';
const STATUS = {complete: '#3f6b4b', damaged: '#8a3a34', interrupted: '#7a5a2a', repeated: '#7a5a2a', aborted: '#7a5a2a'};

class Timeline {
  constructor(canvas, sessions, seek, slow) {
    const [{header, streams}] = sessions;
    // Where the processor draws, a canvas in its own memory is much the quicker one.
    this.g = canvas.getContext('2d', {willReadFrequently: slow});
    this.cursor = $('cursor'); this.values = $('values');
    this.sessions = sessions; this.apart = false;
    this.canvas = canvas; this.header = header; this.streams = streams; this.seek = seek;
    this.end = Math.max(1, ...header.trials.map(t => t.t1 || 0), ...header.events.map(e => e.t));
    this.from = 0; this.to = this.end; this.t = 0;
    this.plots = [];
    this.marks = header.events.filter(e => e.name !== 'scene');
    this.tip = () => {};
    matchMedia('(prefers-color-scheme: light)').addEventListener('change', () => { this.viewKey = ''; this.dirty = true; });
    this.listen();
  }

  // Show the time line of other sessions, mostly of the first, with the same plots where it has their columns.
  take(sessions) {
    const [{header, streams}] = sessions;
    Object.assign(this, {sessions, header, streams, marks: header.events.filter(e => e.name !== 'scene')});
    this.viewKey = '';
    this.plots = this.plots.filter(p => streams.byName.get(p.stream)?.columns.some(c => c.of.includes(p.column))).map(({key, stream, column}) => ({key, stream, column}));
    this.dirty = true;
  }

  plot(stream, column) {
    const key = stream + '.' + column;
    const k = this.plots.findIndex(p => p.key === key);
    if (k >= 0) this.plots.splice(k, 1); else this.plots.push({key, stream, column});
    this.dirty = true;
  }

  show(from, to) {
    const width = Math.min(this.end, Math.max(0.05, to - from));
    this.from = Math.max(0, Math.min(this.end - width, from));
    this.to = this.from + width;
    this.dirty = true;
  }

  zoom(factor, about = this.t) {
    this.show(about - (about - this.from) * factor, about + (this.to - about) * factor);
  }

  follow(t, playing) {
    this.t = t;
    if (playing && (t > this.to || t < this.from)) this.show(t - 0.05 * (this.to - this.from), t + 0.95 * (this.to - this.from));
    this.dirty = true;
  }

  x(t) { return LABEL_PX + (t - this.from) / (this.to - this.from) * (this.width - LABEL_PX - 8); }
  time(x) { return this.from + (x - LABEL_PX) / (this.width - LABEL_PX - 8) * (this.to - this.from); }

  listen() {
    const c = this.canvas;
    let drag = null;
    const at = e => e.clientX - c.getBoundingClientRect().left;
    c.addEventListener('pointerdown', e => {
      c.setPointerCapture(e.pointerId);
      const y = e.clientY - c.getBoundingClientRect().top;
      const close = this.closers?.find(b => Math.abs(at(e) - b.x) < 9 && Math.abs(y - b.y) < 9);
      if (close) { this.plots.splice(close.k, 1); this.dirty = true; return; }
      drag = {x: at(e), from: this.from, to: this.to, moves: e.shiftKey || e.button === 1};
      if (!drag.moves && at(e) > LABEL_PX) this.seek(this.time(at(e)));
    });
    c.addEventListener('pointerleave', () => this.tip(''));
    c.addEventListener('pointermove', e => {
      if (!drag) { this.tip(this.under(at(e), e.clientY - c.getBoundingClientRect().top), e.clientX, e.clientY); return; }
      if (drag.moves) {
        const by = (at(e) - drag.x) / (this.width - LABEL_PX - 8) * (drag.to - drag.from);
        this.show(drag.from - by, drag.to - by);
      } else this.seek(this.time(at(e)));
    });
    c.addEventListener('pointerup', () => { drag = null; });
    c.addEventListener('wheel', e => {
      if (Math.abs(e.deltaX) > Math.abs(e.deltaY)) {
        const by = e.deltaX / this.width * (this.to - this.from);
        this.show(this.from + by, this.to + by);
      } else this.zoom(Math.exp(0.0015 * e.deltaY), this.time(at(e)));
      e.preventDefault();
    }, {passive: false});
  }

  // What lies at a place of the time line, in words.
  under(x, y) {
    if (x < LABEL_PX || y < 20) return '';
    const t = this.time(x), row = this.rows()[Math.floor((y - 20) / (ROW_PX + 2))], near = 4 * (this.to - this.from) / this.width;
    const within = spans => spans.find(([a, b]) => t >= a - near && t <= b + near);
    if (!row) return '';
    if (row.name === 'trials') {
      const trial = this.header.trials.find(one => t >= one.t0 && t < one.t1);
      return trial ? `${trial.id}${trial.practice ? ' (practice)' : ''}, ${trial.status}: ${Object.values(trial.factors).map(inWords).join(', ')}` : '';
    }
    if (row.looks) return row.looks.filter(([, spans]) => within(spans)).map(([name, spans]) => `${inWords(name || row.name)} for ${(within(spans)[1] - within(spans)[0]).toFixed(2)} s`).join(', ');
    if (row.name === 'events') return this.marks.filter(e => Math.abs(e.t - t) <= near).slice(0, 6).map(e => `${clockText(e.t)} ${inWords(e.name)} ${e.text}`.slice(0, 160)).join('\n');
    if (row.name === 'coded') { const one = this.coded.find(s => t >= s.from - near && t <= s.to + near); return one ? `${one.label} ${one.comment}` : ''; }
    const span = within(this.header.lanes.find(l => l.name === row.name)?.spans || []);
    return span ? `${row.name} ${(span[1] - span[0]).toFixed(2)} s ${span[2]}` : '';
  }

  whom() { return this.sessions[0].whom(); }

  rows() {
    const rows = [{name: 'trials', draw: (c, y) => this.drawTrials(c, y)}];
    // One line of everything looked at for each participant; or, of each thing apart, one with everybody's looks at it.
    const all = this.sessions.map(one => one.whom()), names = [...new Set(all.flatMap(looks => looks.map(([name]) => name)))].sort();
    const colour = name => LOOKS[names.indexOf(name) % LOOKS.length], several = this.sessions.length > 1;
    const add = (name, looks, ink) => rows.push({name, looks, draw: (c, y) => looks.forEach(([what, spans], k) => this.spans(c, y, spans, ink(what, k), what && inWords(what)))});
    if (this.apart) for (const name of names) add(inWords(name), all.map((looks, k) => [several ? this.sessions[k].label : '', looks.find(([one]) => one === name)?.[1] || []]), (_, k) => several ? this.sessions[k].colour : colour(name));
    else this.sessions.forEach((one, k) => { if (all[k].length) add(several ? `${one.label} looks at` : 'looks at', all[k], colour); });
    for (const lane of this.header.lanes)
      rows.push({name: lane.name, draw: (c, y) => this.spans(c, y, lane.spans, LANE_COLOURS[lane.kind])});
    if (this.coded?.length) rows.push({name: 'coded', draw: (c, y) => this.coded.forEach(s => this.spans(c, y, [[s.from, s.to]], '#b388eb', s.label))});
    rows.push({name: 'events', draw: (c, y) => this.drawEvents(c, y)});
    return rows;
  }

  // Everything, anew only where something else than the present moment changed.
  draw() {
    const viewKey = [this.from, this.to, this.canvas.clientWidth, window.devicePixelRatio, ...this.plots.map(p => p.key)].join();
    if (viewKey !== this.viewKey) { this.viewKey = viewKey; this.drawStill(); }
    const x = this.x(this.t), inside = x >= LABEL_PX && x <= this.width - 8;
    this.cursor.style.display = inside ? 'block' : 'none';
    this.cursor.style.height = this.height - 2 + 'px';
    this.cursor.style.transform = `translateX(${x.toFixed(1)}px)`;
    const outside = !this.header.trials.some(s => s.shown && this.t >= s.t0 && this.t < s.t1);
    this.plots.forEach((plot, k) => {
      const stream = this.streams.byName.get(plot.stream), {field, values, times} = this.of(plot);
      const now = lastAt(times, this.t), value = now >= 0 ? values[now] : NaN;
      const reading = (Number.isNaN(value) ? '–' : shortNumber(value)) + (field.unit && field.unit !== '1' ? ' ' + field.unit : '');
      const text = reading + ((outside ? stream.every : stream.everyInside) > 1 ? `\n1 row of ${outside ? stream.every : stream.everyInside} here` : ''), box = this.values.children[k];
      if (box.textContent !== text) box.textContent = text;
    });
  }

  of(plot) {
    const field = this.streams.byName.get(plot.stream).columns.find(c => c.of.includes(plot.column));
    return {field, values: this.streams.field(plot.stream, field.name)[field.of.indexOf(plot.column)], times: this.streams.t(plot.stream)};
  }

  drawStill() {
    const c = this.canvas, ratio = window.devicePixelRatio || 1;
    const rows = this.rows(), width = c.clientWidth || 800;
    const height = 20 + rows.length * (ROW_PX + 2) + this.plots.length * (PLOT_PX + 4) + 6;
    if (c.width !== Math.round(width * ratio) || c.height !== Math.round(height * ratio)) {
      c.width = Math.round(width * ratio);
      c.height = Math.round(height * ratio);
      c.style.height = height + 'px';
    }
    this.width = width;
    this.height = height;
    const g = this.g, style = getComputedStyle(document.documentElement), own = name => style.getPropertyValue(name).trim();
    this.ink = {row: own('--panel'), edge: own('--edge'), quiet: own('--quiet'), text: own('--text')};
    c.setAttribute('aria-label', `Time line from ${clockText(this.from, 0)} to ${clockText(this.to, 0)} minutes: ${rows.map(r => r.name).join(', ')}` + (this.plots.length ? `, plots of ${this.plots.map(p => inWords(p.column)).join(', ')}` : ''));
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    g.font = '11px system-ui, sans-serif';
    g.textBaseline = 'middle';
    this.axis(g);
    let y = 20;
    for (const row of rows) {
      g.fillStyle = this.ink.row;
      g.fillRect(LABEL_PX, y, width - LABEL_PX - 8, ROW_PX);
      this.name(g, row.name, y + ROW_PX / 2);
      g.save();
      g.beginPath();
      g.rect(LABEL_PX, y, width - LABEL_PX - 8, ROW_PX);
      g.clip();
      row.draw(g, y);
      g.restore();
      y += ROW_PX + 2;
    }
    this.closers = [];
    this.values.replaceChildren(...this.plots.map((plot, k) => {
      this.drawPlot(g, plot, y, k);
      const box = document.createElement('output');
      box.style.top = y + 30 + 'px';
      y += PLOT_PX + 4;
      return box;
    }));
  }

  labelOf(plot) {
    const field = this.streams.byName.get(plot.stream).columns.find(c => c.of.includes(plot.column));
    return field.labels[field.of.indexOf(plot.column)];
  }

  name(g, text, y, colour = this.ink.quiet) {
    g.fillStyle = colour;
    g.textAlign = 'right';
    let shown = text;
    while (shown.length > 4 && g.measureText(shown).width > LABEL_PX - 14) shown = shown.slice(0, -2) + '…';
    g.fillText(shown, LABEL_PX - 8, y);
    g.textAlign = 'left';
  }

  axis(g) {
    const span = this.to - this.from, raw = span / Math.max(2, (this.width - LABEL_PX) / 90);
    const steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 3600];
    const step = steps.find(s => s >= raw) || 3600;
    g.fillStyle = this.ink.quiet;
    g.strokeStyle = this.ink.edge;
    for (let t = Math.ceil(this.from / step) * step; t <= this.to; t += step) {
      const x = this.x(t);
      g.beginPath(); g.moveTo(x, 14); g.lineTo(x, this.height); g.stroke();
      g.fillText(clockText(t, step < 1 ? (step < 0.1 ? 2 : 1) : 0), x + 3, 9);
    }
    this.name(g, 'min : s', 9);
  }

  drawTrials(g, y) {
    for (const trial of this.header.trials) {
      const a = this.x(trial.t0), b = this.x(trial.t1);
      if (b < LABEL_PX || a > this.width) continue;
      g.fillStyle = trial.practice ? PRACTICE : STATUS[trial.status] || '#4a4d52';
      g.globalAlpha = trial.shown ? 1 : 0.45;
      g.fillRect(a, y, Math.max(1, b - a - 1), ROW_PX);
      g.globalAlpha = 1;
      const label = trial.id + (trial.status === 'complete' ? '' : ' ' + trial.status) + '  ' + Object.values(trial.factors).map(inWords).join(' ');
      const left = Math.max(a, LABEL_PX) + 4, room = Math.min(b, this.width) - left - 2;
      if (room > 18) this.fitText(g, label, left, y + ROW_PX / 2, room, '#e6e7e9');
    }
  }

  fitText(g, text, x, y, room, colour) {
    let shown = text;
    if (g.measureText(shown).width > room) {
      while (shown.length > 1 && g.measureText(shown + '…').width > room) shown = shown.slice(0, -1);
      if (shown.length < 2) return;
      shown += '…';
    }
    g.fillStyle = colour;
    g.fillText(shown, x, y);
  }

  spans(g, y, spans, colour, name = '') {
    g.fillStyle = colour;
    for (const [t0, t1] of spans) {
      const a = this.x(t0), b = this.x(t1);
      if (b < LABEL_PX || a > this.width) continue;
      g.fillStyle = colour;
      g.fillRect(a, y + 1, Math.max(1.5, b - a), ROW_PX - 2);
      if (name && b - a > 44) this.fitText(g, name, Math.max(a, LABEL_PX) + 3, y + ROW_PX / 2, b - Math.max(a, LABEL_PX) - 5, '#111');
    }
  }

  drawEvents(g, y) {
    const shown = this.marks.filter(e => !(/_(begin|end)$/.test(e.name) && this.header.lanes.length)).map(e => ({e, x: this.x(e.t)}))
      .filter(one => one.x >= LABEL_PX && one.x <= this.width);
    for (const {e, x} of shown) { g.fillStyle = eventColour(e.name, this.ink); g.fillRect(x, y, 1.5, ROW_PX); }
    // A name stands where no other event's mark or name is in its way; the pointer over it tells the others.
    this.named = [];
    shown.forEach(({e, x}, k) => {
      const text = inWords(e.name), end = x + 4 + g.measureText(text).width, next = shown[k + 1];
      if (next && next.x < end + 3) return;
      g.fillStyle = eventColour(e.name, this.ink);
      g.fillText(text, x + 4, y + ROW_PX / 2);
      this.named.push([x, end]);
    });
  }

  drawPlot(g, plot, y, k) {
    const {values, times} = this.of(plot);
    const width = this.width - LABEL_PX - 8;
    g.fillStyle = this.ink.row;
    g.fillRect(LABEL_PX, y, width, PLOT_PX);
    const first = Math.max(0, lastAt(times, this.from)), last = Math.min(times.length - 1, lastAt(times, this.to) + 1);
    let low = Infinity, high = -Infinity;
    for (let i = first; i <= last; i++) if (values[i] < low) low = values[i];
    for (let i = first; i <= last; i++) if (values[i] > high) high = values[i];
    const colour = LOOKS[(k + 5) % LOOKS.length];
    this.name(g, inWords(plot.stream), y + 9);
    this.name(g, this.labelOf(plot), y + 23, colour);
    g.fillStyle = this.ink.quiet;
    g.fillText('×', LABEL_PX - 160, y + 9);
    this.closers.push({x: LABEL_PX - 157, y: y + 9, k});
    if (!(high >= low)) { g.fillText('no value here', LABEL_PX + 8, y + PLOT_PX / 2); return; }
    const room = high > low ? 0.06 * (high - low) : 1;
    const top = high + room, bottom = low - room;
    const py = v => y + PLOT_PX * (top - v) / (top - bottom);
    g.save();
    g.beginPath(); g.rect(LABEL_PX, y, width, PLOT_PX); g.clip();
    g.strokeStyle = colour;
    g.lineWidth = 1;
    g.beginPath();
    // Of many rows in one pixel the lowest and the highest are drawn.
    let px = -1, least = 0, most = 0, open = false;
    const gap = 5 * (times[last] - times[first]) / Math.max(1, last - first);
    for (let i = first; i <= last; i++) {
      if (Number.isNaN(values[i])) { open = false; px = -1; continue; }
      const x = this.x(times[i]), column = Math.round(x);
      if (open && i > first && times[i] - times[i - 1] > Math.max(0.5, gap)) open = false;
      if (column === px && open) {
        if (values[i] < least) { least = values[i]; g.lineTo(x, py(least)); }
        else if (values[i] > most) { most = values[i]; g.lineTo(x, py(most)); }
        continue;
      }
      px = column; least = most = values[i];
      if (open) g.lineTo(x, py(values[i])); else { g.moveTo(x, py(values[i])); g.lineTo(x + 0.5, py(values[i])); }
      open = true;
    }
    g.stroke();
    g.fillStyle = this.ink.quiet;
    g.fillText(shortNumber(high), LABEL_PX + 3, y + 8);
    g.fillText(shortNumber(low), LABEL_PX + 3, y + PLOT_PX - 8);
    g.restore();
  }
}

function eventColour(name, ink) {
  if (/flag|note|lost|fault|stall|problem|interrupt|missed/.test(name)) return '#ff6b5e';
  if (/calibration|validation/.test(name)) return '#8fb339';
  return /trial|block|session|break/.test(name) ? ink.quiet : ink.text;
}
function clockText(t, digits = 2) {
  const rounded = Math.max(0, t), minutes = Math.floor((rounded + 0.5 * 10 ** -digits) / 60);
  const seconds = Math.max(0, rounded - 60 * minutes).toFixed(digits);
  return `${minutes}:${seconds.padStart(digits ? 3 + digits : 2, '0')}`;
}
function shortNumber(v) {
  const size = Math.abs(v);
  return size >= 1000 ? v.toFixed(0) : size >= 10 ? v.toFixed(1) : size >= 0.01 || v === 0 ? v.toFixed(3) : v.toExponential(1);
}

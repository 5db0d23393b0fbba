// Pictures and films of what is seen, each with a caption that says of whom, when, and from which recording it is.

const FILM_HZ = 25, CAPTION_PX = 26, SIZES = [1, 2, 4];
// What draws as a canvas does, but into the text of an SVG picture.
class SvgPen {
  constructor(width, height) {
    Object.assign(this, {width, height, parts: [], d: '', defs: [], globalAlpha: 1, fillStyle: '#000', strokeStyle: '#000', lineWidth: 1, font: '', textAlign: 'left', textBaseline: 'alphabetic', globalCompositeOperation: 'source-over'});
    this.measure = document.createElement('canvas').getContext('2d');
  }

  measureText(text) { this.measure.font = this.font; return this.measure.measureText(text); }
  beginPath() { this.d = ''; }
  moveTo(x, y) { this.d += `M${x.toFixed(1)} ${y.toFixed(1)}`; }
  lineTo(x, y) { this.d += `L${x.toFixed(1)} ${y.toFixed(1)}`; }
  closePath() { this.d += 'Z'; }
  // Whole circles alone are drawn.
  arc(x, y, r) { for (const [from, by] of [[x - r, 2 * r], [x + r, -2 * r]]) this.d += `${by > 0 ? `M${from.toFixed(1)} ${y.toFixed(1)}` : ''}a${r.toFixed(1)} ${r.toFixed(1)} 0 0 1 ${by.toFixed(1)} 0`; }
  roundRect(x, y, w, h) { this.d += `M${x} ${y}h${w}v${h}h${-w}Z`; }
  clearRect() {}
  fillRect(x, y, w, h) { this.beginPath(); this.roundRect(x, y, w, h); this.fill(); }
  fill() { this.put(`<path d="${this.d}" ${this.paint('fill', this.fillStyle)}/>`); }
  stroke() { this.put(`<path d="${this.d}" fill="none" ${this.paint('stroke', this.strokeStyle)} stroke-width="${this.lineWidth}"/>`); }
  fillText(text, x, y) { this.write(text, x, y, this.paint('fill', this.fillStyle)); }
  strokeText(text, x, y) { this.write(text, x, y, `fill="none" stroke-linejoin="round" ${this.paint('stroke', this.strokeStyle)} stroke-width="${this.lineWidth}"`); }
  drawImage(image, x, y, w, h) {
    const copy = document.createElement('canvas');
    copy.width = image.width; copy.height = image.height;
    copy.getContext('2d').drawImage(image, 0, 0);
    this.put(`<image x="${x}" y="${y}" width="${w}" height="${h}" href="${copy.toDataURL('image/png')}"/>`);
  }
  createRadialGradient(x0, y0, r0, x, y, r) {
    const id = `g${this.defs.length}`, stops = [];
    const here = this.defs.push(null) - 1;
    const close = () => { this.defs[here] = `<radialGradient id="${id}" gradientUnits="userSpaceOnUse" cx="${x}" cy="${y}" r="${r}">${stops.join('')}</radialGradient>`; };
    return {url: `url(#${id})`, addColorStop: (at, colour) => { stops.push(`<stop offset="${at}" stop-color="${colour}"/>`); close(); }};
  }

  paint(name, colour) { return `${name}="${escaped(colour.url || colour)}"` + (this.globalAlpha < 1 ? ` ${name}-opacity="${this.globalAlpha.toFixed(3)}"` : ''); }
  put(part) { this.parts.push(this.globalCompositeOperation === 'lighter' ? part.replace('/>', ' style="mix-blend-mode:plus-lighter"/>') : part); }
  write(text, x, y, paint) {
    const anchor = {center: 'middle', right: 'end'}[this.textAlign] || 'start', size = parseFloat(this.font);
    this.put(`<text x="${x.toFixed(1)}" y="${(y + (this.textBaseline === 'middle' ? 0.35 * size : 0)).toFixed(1)}" font-size="${size}" text-anchor="${anchor}" ${paint}>${escaped(text)}</text>`);
  }

  text(title) {
    const inHtml = document.createElement('div');
    inHtml.innerHTML = '<svg></svg>';
    return `<svg xmlns="${inHtml.firstChild.namespaceURI}" width="${this.width}" height="${this.height}" viewBox="0 0 ${this.width} ${this.height}" font-family="system-ui, sans-serif"><title>${escaped(title)}</title><defs>${this.defs.join('')}</defs>${this.parts.join('\n')}</svg>\n`;
  }
}

const escaped = text => String(text).replace(/[&<>"]/g, c => `&#${c.charCodeAt(0)};`);

class Saving {
  constructor(viewer) {
    this.viewer = viewer;
    this.stop = null;
    $('save-size').append(...SIZES.map(n => new Option(`${n}×`, n)));
    $('save-png').onclick = () => this.png().then(blob => this.give(blob, 'png'));
    $('save-svg').onclick = () => this.svg().then(text => this.give(new Blob([text], {type: 'image/svg+xml'}), 'svg'));
    $('save-film').onclick = () => { if (this.stop) this.stop(); else this.film().then(blob => blob && this.give(blob, 'webm')); };
    if (!window.VideoEncoder) { $('save-film').disabled = true; $('save-film').title = 'this browser makes no films; visavis film does'; }
  }

  // Of whom and when the picture is, the seed of the session, and what its manifest's checksum begins with.
  caption() {
    const v = this.viewer, trial = v.trialAt(v.t), whole = v.content.header;
    const when = trial ? `${trial.id} at ${(v.t - trial.t0).toFixed(2)} s` : `at ${clockText(v.t)}`;
    const who = v.seen.length > 1 ? `${v.seen.length} participants` : `${v.header.participant} session ${v.header.session}`;
    const from = v.seen.length > 1 ? `recordings ${v.seen.map(one => one.header.sha256.slice(0, 6)).join(' ')}` : `seed ${v.header.seed} · recording ${v.header.sha256.slice(0, 12)}`;
    return [`${v.header.study} ${who}`, when, `camera: ${$('camera').selectedOptions[0].text}`, from, `Visavis ${v.header.version}`, ...whole.simulated ? ['SIMULATED'] : []].join(' · ');
  }

  name(kind) {
    const v = this.viewer, trial = v.trialAt(v.t);
    return [v.header.study, v.seen.length > 1 ? 'all' : v.header.participant, trial ? `${trial.id}_${(v.t - trial.t0).toFixed(2)}s` : clockText(v.t).replace(':', '-'), v.camera].join('_') + '.' + kind;
  }

  give(blob, kind) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = this.name(kind);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  }

  // Draw the present moment in full, `times` as large as it stands on the page, and call `take` while it is there.
  at(times, take, pen = null) {
    const v = this.viewer, over = v.over;
    v.scale = times;
    v.moveMs = -1e9;
    if (pen) v.over = pen;
    try { v.draw(); return take($('picture'), $('overlay')); }
    finally { v.scale = 1; v.over = over; v.dirty = true; }
  }

  // Both canvases on one another, with the caption below.
  onto(canvas, picture, overlay) {
    const strip = Math.round(CAPTION_PX * picture.width / Math.max(1, $('stage').clientWidth)), g = canvas.getContext('2d');
    if (canvas.width !== picture.width || canvas.height !== picture.height + strip) { canvas.width = picture.width; canvas.height = picture.height + strip; }
    g.drawImage(picture, 0, 0);
    g.drawImage(overlay, 0, 0, picture.width, picture.height);
    this.writeCaption(g, picture.width, picture.height, strip);
    return canvas;
  }

  writeCaption(g, width, top, strip) {
    g.fillStyle = '#111'; g.fillRect(0, top, width, strip);
    g.fillStyle = '#eee';
    g.textAlign = 'left'; g.textBaseline = 'middle';
    const text = this.caption();
    g.font = `${0.5 * strip}px system-ui, sans-serif`;
    const room = (width - strip) / g.measureText(text).width;
    if (room < 1) g.font = `${0.5 * strip * room}px system-ui, sans-serif`;
    g.fillText(text, strip / 2, top + strip / 2);
  }

  async png(times = Number($('save-size').value)) {
    await this.viewer.drawWhole();
    const canvas = this.at(times, (picture, overlay) => this.onto(document.createElement('canvas'), picture, overlay));
    return new Promise(done => canvas.toBlob(done, 'image/png'));
  }

  // The scene as a picture, all that is drawn over it as lines and letters.
  async svg(times = Number($('save-size').value)) {
    await this.viewer.drawWhole();
    const pen = new SvgPen(0, 0);
    return this.at(times, picture => {
      const strip = Math.round(CAPTION_PX * picture.width / Math.max(1, $('stage').clientWidth));
      const below = new SvgPen(picture.width, picture.height + strip);
      below.drawImage(picture, 0, 0, picture.width, picture.height);
      below.parts.push(...pen.parts);
      below.defs.push(...pen.defs);
      this.writeCaption(below, picture.width, picture.height, strip);
      return below.text(this.caption());
    }, pen);
  }

  // The trial from its beginning, 25 pictures a second of its time, however long each takes to be drawn; another
  // press ends it there.
  async film(seconds = Infinity) {
    const v = this.viewer, trial = v.trialAt(v.t);
    if (!trial || this.stop) return null;
    const canvas = document.createElement('canvas'), before = v.t, film = new WebmFile(1000 / FILM_HZ);
    let isOn = true, problem = null;
    this.stop = () => { isOn = false; };
    v.play(false);
    const encoder = new VideoEncoder({output: chunk => film.add(chunk), error: e => { problem = e; }});
    const pictures = Math.ceil(FILM_HZ * Math.min(seconds, trial.t1 - trial.t0));
    for (let k = 0; k < pictures && isOn && !problem; k++) {
      v.seek(trial.t0 + k / FILM_HZ);
      await v.drawWhole();
      this.at(1, (picture, overlay) => this.onto(canvas, picture, overlay));
      // Codecs take even sides alone.
      const width = canvas.width & ~1, height = canvas.height & ~1;
      if (!k) { film.size = [width, height]; encoder.configure({codec: 'vp8', width, height, framerate: FILM_HZ, bitrate: 8e6}); }
      const frame = new VideoFrame(canvas, {timestamp: 1e6 * k / FILM_HZ, visibleRect: {x: 0, y: 0, width, height}});
      encoder.encode(frame, {keyFrame: k % FILM_HZ === 0});
      frame.close();
      $('save-film').textContent = `end film ${Math.round(100 * (k + 1) / pictures)} %`;
      await new Promise(done => setTimeout(done));
    }
    try { if (!problem) await encoder.flush(); } catch (e) { problem = e; }
    this.stop = null;
    $('save-film').textContent = 'film';
    $('save-film').title = problem ? `no film was made: ${problem.message}; visavis film makes one` : 'the trial, as it is seen now';
    v.seek(before);
    return problem ? null : film.blob();
  }
}

// A file of coded pictures (WebM, RFC 9559): a cluster from every picture that needs no other.
class WebmFile {
  constructor(stepMs) { Object.assign(this, {stepMs, size: [0, 0], clusters: [], n: 0}); }

  add(chunk) {
    const bytes = new Uint8Array(chunk.byteLength), ms = Math.round(chunk.timestamp / 1000), isKey = chunk.type === 'key';
    chunk.copyTo(bytes);
    if (isKey) this.clusters.push({ms, blocks: []});
    const cluster = this.clusters[this.clusters.length - 1], since = ms - cluster.ms;
    cluster.blocks.push(element(0xa3, new Uint8Array([0x81, since >> 8, since & 255, isKey ? 0x80 : 0]), bytes));
    this.n++;
  }

  blob() {
    const [width, height] = this.size, duration = new Uint8Array(8);
    new DataView(duration.buffer).setFloat64(0, this.n * this.stepMs);
    const head = element(0x1a45dfa3, whole(0x4286, 1), whole(0x42f7, 1), whole(0x42f2, 4), whole(0x42f3, 8), letters(0x4282, 'webm'), whole(0x4287, 4), whole(0x4285, 2));
    const info = element(0x1549a966, whole(0x2ad7b1, 1000000), element(0x4489, duration), letters(0x4d80, 'Visavis'), letters(0x5741, 'Visavis'));
    const track = element(0xae, whole(0xd7, 1), whole(0x73c5, 1), whole(0x83, 1), letters(0x86, 'V_VP8'), element(0xe0, whole(0xb0, width), whole(0xba, height)));
    const clusters = this.clusters.map(one => element(0x1f43b675, whole(0xe7, one.ms), ...one.blocks));
    return new Blob([head, element(0x18538067, info, element(0x1654ae6b, track), ...clusters)], {type: 'video/webm'});
  }
}

// An element of such a file: its number, its length in eight bytes, and what is in it.
function element(id, ...parts) {
  const length = parts.reduce((n, part) => n + part.length, 0), number = bytesOf(id), out = new Uint8Array(number.length + 8 + length);
  out.set(number);
  new DataView(out.buffer).setBigUint64(number.length, (1n << 56n) | BigInt(length));
  let at = number.length + 8;
  for (const part of parts) { out.set(part, at); at += part.length; }
  return out;
}
function bytesOf(n) { const out = []; do { out.unshift(n % 256); n = Math.floor(n / 256); } while (n); return new Uint8Array(out); }
function whole(id, n) { return element(id, bytesOf(n)); }
function letters(id, text) { return element(id, new TextEncoder().encode(text)); }

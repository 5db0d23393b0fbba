// Flat stimuli as they stood before somebody: pictures, a picture all around, areas of interest, the window after gaze.

const WINDOW = '#7fd1ae', RIM = 64;

// A rectangle with a picture in its own colours, whatever lamps there are; AROUND: a window onto a picture all around.
const SHEET = [`#version 300 es
uniform mat4 projection; uniform mat4 model; out vec2 v_uv; out vec3 v_place;
void main() {
  v_uv = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec4 world = model * vec4(v_uv.x - 0.5, 0.5 - v_uv.y, 0.0, 1.0);
  v_place = world.xyz;
  gl_Position = projection * world;
}`, `#version 300 es
precision highp float;
in vec2 v_uv; in vec3 v_place; uniform sampler2D picture; uniform vec3 eye; uniform mat3 own; out vec4 o;
void main() {
#ifdef AROUND
  vec3 d = own * normalize(v_place - eye);
  o = textureLod(picture, vec2(0.5 + atan(d.x, -d.z) / 6.28318531, acos(clamp(d.y, -1.0, 1.0)) / 3.14159265), 0.0);
#else
  o = texture(picture, v_uv);
#endif
}`];

// A monitor around and behind its lit area.
function caseOf({at, turn, size: [wide, high]}) {
  return {solid: 'box', model: modelMatrix(add(at, rotate(turn, [0, 0, 1]), -0.012), turn, [wide + 0.02, high + 0.02, 0.02]), paint: [0.1, 0.1, 0.11]};
}

// A picture that moves, by the file of each of its samples: one is decoded when it is asked for, and until then the one
// before it stays, for ever if it cannot be decoded.
class MovingPicture {
  constructor(content, {files, at, isShared, name}) { Object.assign(this, {content, files, isShared, name, at: content.flat(at), missing: new Set()}); }

  // The number of the picture of a sample among those of a drawing; at first that of the onset.
  numberAt(k, d, first) {
    this.wanted = this.at[Math.min(k, this.at.length - 1)];
    if (this.wanted !== this.shown && !this.isDecoding) this.decode(d);
    return this.number ?? first;
  }

  decode(d) {
    const wanted = this.wanted, content = this.isShared ? d.content : this.content;
    this.isDecoding = true;
    d.wait(content.picture(this.files[wanted], {premultiplyAlpha: 'premultiply'}).then(image => {
      if (image) this.number = d.takeFlat(image, this.number); else this.missing.add(wanted);
      this.shown = wanted;
      this.isDecoding = false;
      if (this.wanted !== wanted) this.decode(d);
    }));
  }

  // Which pictures are missing, of those that were asked for; `rate` a second.
  notes(rate) {
    const times = momentsInWords(this.missing, one => this.at.indexOf(one) / rate);
    return times ? [`${this.name || 'what moves'}: no picture at ${times} after its onset (the page, or a file beside it, is damaged or gone); the one before it stays`] : [];
  }
}

class Flat {
  constructor(content, data, rate) {
    Object.assign(this, {data, content, rate});
    this.monitor = data.eye && !data.isWide ? data.sheets[0] : null;
    this.framed = this.monitor || data.eye && this.reach() || null; // what fills the view of who sat before it
    const courseOf = ref => { const flat = content.flat(ref), n = ref.s[0]; return k => Array.from({length: flat.length / n}, (_, c) => flat[c * n + Math.min(k, n - 1)]); };
    this.areas = data.areas.map(({name, corners, outlines, hasCorner}) => ({name, at: courseOf(corners), outlines, hasCorner: hasCorner && courseOf(hasCorner)}));
    this.turnAt = data.around && courseOf(data.around.turns);
    this.moving = new Map([...data.sheets, data.around].filter(one => one?.moving).map(one => [one, new MovingPicture(content, one.moving)]));
  }

  // A picture as it was at a sample.
  at(k, d, sheet) { return {...sheet, picture: this.moving.get(sheet)?.numberAt(k, d, sheet.picture) ?? sheet.picture}; }

  // A rectangle straight ahead of the eye with all stimuli in it, where nobody knows the edges of the page.
  reach() {
    const {eye, sheets} = this.data, far = sheets.length ? eye[2] - sheets[0].at[2] : 1, at = [eye[0], eye[1], eye[2] - far];
    return {at, size: [0, 1].map(a => 2.2 * Math.max(far / 20, ...sheets.map(s => Math.abs(s.at[a] - eye[a]) + s.size[a] / 2)))};
  }

  // What stands there at a sample (whole number) of the scene: areas of interest as {name, corners, outlines}, of each
  // outline how many corners are its own.
  areasAt(k) {
    const areas = this.areas.map(({name, at, outlines, hasCorner}) => {
      const numbers = at(k), corners = Array.from({length: numbers.length / 3}, (_, c) => numbers.slice(3 * c, 3 * c + 3));
      const area = {name, corners, outlines: outlines || [corners.length]};
      if (!this.monitor || Number.isNaN(corners[0][0])) return area;
      return this.throughMonitor(area, !!hasCorner && hasCorner(k)[0] > 0);
    });
    return areas.filter(area => area.corners.length && !Number.isNaN(area.corners[0][0]));
  }

  // An area as it was seen through the monitor, cut at its edges.
  throughMonitor({name, corners, outlines}, hasCorner) {
    const {at, turn, size: sides} = this.monitor, {eye} = this.data, [w, x, y, z] = turn;
    const own = p => rotate([w, -x, -y, -z], sub(p, eye));
    let from = 0;
    const lines = cutByWindow(outlines.map(n => corners.slice(from, from += n).map(own)), own(at), sides, hasCorner);
    return {name, outlines: lines.map(line => line.length), corners: lines.flat().map(p => add(at, rotate(turn, [...p, 0])))};
  }

  // Where a line from an eye meets the monitor's plane; null where it leads away from it.
  onMonitor(eye, along) {
    const front = rotate(this.monitor.turn, [0, 0, 1]), dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2], ahead = -dot(along, front);
    return ahead > 1e-6 ? add(eye, along, dot(sub(eye, this.monitor.at), front) / ahead) : null;
  }

  // What is all around: behind a monitor as through a window, else wherever one looks.
  drawAround(d, view, k) {
    if (!this.turnAt) return;
    const before = {at: add(view.at, rotate(view.turn, [0, 0, -1])), turn: view.turn, size: [2.01 * view.top * view.aspect, 2.01 * view.top]};
    d.drawSheets([{...this.monitor || before, picture: this.at(k, d, this.data.around).picture}], view.projection, {eye: this.data.eye || view.at, turn: this.turnAt(k), isBehind: !this.monitor});
  }

  draw(d, view, k) {
    const sheets = this.data.sheets.map(sheet => this.at(k, d, sheet)), behind = this.monitor ? 1 : 0;
    d.drawSheets(sheets.slice(0, behind), view.projection);
    if (this.monitor) this.drawAround(d, view, k);
    d.drawSheets(sheets.slice(behind), view.projection);
  }

  // The rim of the window at a time: after gaze, of which a stream tells, or after the pointer; null where there was none.
  rimAt(streams, t) {
    if (this.data.window.t) return this.rimOfPointer(t);
    const read = name => streams.at('gaze_window', name, t, 0.1), valid = read('valid');
    return valid && valid[0] > 0.5 ? this.rim(read('origin_world_m'), unit(read('direction_world'))) : null;
  }

  // A circle on the page around the pointer; null before that had moved.
  rimOfPointer(t) {
    const {at, radius, t: times} = this.data.window;
    this.path ||= {t: this.content.flat(times), at: this.content.flat(at)};
    const n = this.path.t.length, k = lastAt(this.path.t, t);
    if (k < 0) return null;
    const middle = [0, 1, 2].map(a => this.path.at[a * n + k]);
    return Array.from({length: RIM + 1}, (_, i) => add(middle, [radius * Math.cos(2 * Math.PI * i / RIM), radius * Math.sin(2 * Math.PI * i / RIM), 0]));
  }

  // What one must know of it: how large the page was, what the recording lacks.
  notesAt(t) {
    const notes = [...this.data.notes || [], ...[...this.moving.values()].flatMap(one => one.notes(this.rate))];
    return this.data.window?.t && !this.rimOfPointer(t) ? [...notes, 'the pointer had not moved yet: all was blurred'] : notes;
  }

  // The rim of the window around what is looked at from an eye: on the monitor, or on the stimuli in their distance.
  rim(eye, along) {
    const radius = this.data.window.deg / 2 * Math.PI / 180, side = unit(cross(along, [0, 1, 0])), up = cross(side, along), out = [];
    const far = size(sub(this.data.sheets[0]?.at || add(eye, along, 2), eye));
    for (let k = 0; k <= RIM; k++) {
      const a = 2 * Math.PI * k / RIM, r = unit(add(add(along, side, Math.tan(radius) * Math.cos(a)), up, Math.tan(radius) * Math.sin(a)));
      out.push(this.monitor ? this.onMonitor(eye, r) : add(eye, r, far));
    }
    return out;
  }
}

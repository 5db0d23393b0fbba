// The page: cameras, what is drawn over the scene, controls, and keys.

const $ = id => document.getElementById(id);
const LAYERS = [['gaze', 'gaze (G)', true], ['areas', 'areas of interest (O)', true], ['heat', 'heat map of gaze (H)', false],
  ['path', 'path of gaze, 2 s (P)', false], ['fixations', 'fixations (F)', false], ['dwell', 'dwell: spheres by its time (D)', false],
  ['order', 'order of fixations (N)', false], ['walked', 'walked path (W)', true],
  ['body', 'participant (B)', true], ['bones', 'measured joints (M)', false], ['labels', 'labels (L)', true],
  ['room', 'room', true], ['people', 'people', true], ['light', 'keep the light on', false]];
const KEY_OF = {g: 'gaze', o: 'areas', h: 'heat', p: 'path', f: 'fixations', d: 'dwell', n: 'order', w: 'walked', b: 'body', m: 'bones', l: 'labels'};
const GAZE = '#ffbe28';
const MANY = 24; // of more people only those near enough are labelled
const CLICK_PX = 4, NEAR_PX = 12;
const CAMERAS = ['free', 'eyes', 'follow', 'above', 'topology'];
const CEILING_M = 2.7;
const FAINT = 0.2; // share of a mark's colour behind somebody or something
const PERSON_M = 1.25; // around somebody's hips, with everything of them in it
const SHARES = [1, 0.75, 0.5], ON_TIME_MS = 20, LATE_MS = 30;
const AWAY_S = 2; // a pause of the browser this long was no slow picture: the page was not seen
const TELL_MS = 100; // between two times that words beside the picture change while it moves, where the processor draws
const REST_MS = 300; // after which people are drawn in full where the processor draws

class Viewer {
  constructor(content) {
    this.content = content;
    const of = content.header.sessions || [content.header];
    this.sessions = of.map((h, k) => new Session(content, h, of.length > 1 ? LOOKS[k % LOOKS.length] : GAZE));
    this.picked = -1; // of several sessions the one that is looked at alone
    this.hover = null;
    const header = this.header;
    this.drawing = new Drawing($('picture'), content, () => { this.dirty = true; });
    this.pages = new Pages(content, this.drawing);
    this.show = Object.fromEntries(LAYERS.map(([name, , on]) => [name, on]));
    this.outlines = [];
    this.t = [header.scenes[0], header.pages[0]].filter(Boolean).map(s => s.t0).sort((a, b) => a - b)[0] ?? header.trials[0]?.t0 ?? 0;
    this.playing = false; this.speed = 1;
    this.free = {at: [0, 1.6, 3], yaw: 0, pitch: -0.1};
    this.above = {zoom: 1, by: [0, 0]};
    this.pressedKeys = new Set();
    this.frames = 0; this.spent = 0; this.scale = 1;
    this.moveMs = -1e9; this.quick = false; this.panelMs = -1e9;
    this.coarse = 0; this.pace = ON_TIME_MS; this.timed = false;
    this.line = new Timeline($('line'), this.seen, t => this.seek(t), this.drawing.slow);
    this.over = $('overlay').getContext('2d', {willReadFrequently: this.drawing.slow});
    this.segments = this.segmentsOf();
    this.page();
    this.coding = new Coding(this);
    this.saving = new Saving(this);
    this.headset = new Headset(this);
    this.listen();
    this.startView();
    if (this.session.isFlat) this.setCamera('eyes'); // what they saw is what one looks for
    this.line.tip = (text, x, y) => this.tip(text, x, y);
    const options = new URLSearchParams(location.hash.slice(1));
    if (options.get('t')) this.seek(Number(options.get('t')));
    const named = this.header.trials.findLast(s => s.t0 !== null && s.id === options.get('trial'));
    if (named) this.seek(named.t0 + 0.01);
    if (CAMERAS.includes(options.get('camera'))) this.setCamera(options.get('camera'));
    const trial = this.trialAt(this.t);
    if (trial) this.line.show(trial.t0 - 1, trial.t1 + 1);
    this.defaultPlots();
    this.line.follow(this.t, false);
    this.dirty = true;
    this.drawing.ready.then(() => { this.dirty = true; document.body.dataset.ready = 'yes'; });
    const tick = now => { this.tick(now); requestAnimationFrame(tick); };
    requestAnimationFrame(tick);
  }

  // ---- where we are ----

  get session() { return this.sessions[Math.max(0, this.picked)]; } // whose place is drawn
  get header() { return this.session.header; }
  get streams() { return this.session.streams; }
  get seen() { return this.picked < 0 ? this.sessions : [this.session]; } // whose gaze is drawn
  sceneAt(t) { return this.session.sceneAt(t); }
  trialAt(t) { return this.session.trialAt(t); }

  // Look at one of several sessions, or at all of them together (−1).
  pick(k) {
    this.picked = k < 0 || k >= this.sessions.length ? -1 : k;
    this.line.take(this.seen);
    this.heatOf = this.panelTrial = undefined;
    this.tellSession();
    this.tellAbout();
    this.markPicked();
    this.dirty = true;
  }

  seek(t) {
    this.moveMs = performance.now();
    this.t = Math.max(0, Math.min(this.line.end, t));
    this.line.follow(this.t, false);
    this.dirty = true;
  }

  step(which) {
    const trials = this.header.trials.filter(t => t.t0 !== null);
    const to = which > 0 ? trials.find(t => t.t0 > this.t + 1e-6) : [...trials].reverse().find(t => t.t0 < this.t - 0.3);
    if (!to) return;
    this.seek(to.t0);
    this.line.show(to.t0 - 1, to.t1 + 1);
    this.startView();
  }

  // ---- cameras ----

  setCamera(name) { $('camera').value = name; this.above = {zoom: 1, by: [0, 0]}; this.dirty = true; }
  get camera() { return $('camera').value; }

  // The middle and the reach of everybody throughout a scene, so that the view from above stands still.
  middle(scene) {
    if (scene?.middle) return scene.middle;
    const points = [], {t0, t1} = scene ? scene.data : {t0: this.t, t1: this.t};
    for (const share of [0, 0.25, 0.5, 0.75, 0.999]) {
      const t = t0 + share * (t1 - t0), head = this.session.headAt(t);
      if (head) points.push(head.at);
      if (!scene) continue;
      scene.pose(t);
      for (let i = 0; i < scene.data.cast.length; i++) points.push([...scene.place.subarray(3 * i, 3 * i + 3)]);
    }
    if (scene) scene.pose(this.t);
    if (!points.length) points.push([0, 1, 0]);
    const low = [0, 1, 2].map(k => Math.min(...points.map(p => p[k]))), high = [0, 1, 2].map(k => Math.max(...points.map(p => p[k])));
    const centre = low.map((v, k) => (v + high[k]) / 2);
    centre[1] = 1;
    const middle = {centre, radius: Math.max(1.6, ...points.map(p => Math.hypot(p[0] - centre[0], p[2] - centre[2]) + 0.5))};
    if (scene) scene.middle = middle;
    return middle;
  }

  startView() { // behind and beside the participant, who looks at what there is
    const head = this.session.headAt(this.t) || {at: [0, 1.6, 0], turn: [1, 0, 0, 0]};
    const front = unit([...[rotate(head.turn, [0, 0, -1])].map(v => [v[0], 0, v[2]])][0]);
    const right = [-front[2], 0, front[0]];
    const monitor = this.session.monitor, near = monitor ? 0.35 : 1;
    const at = add(add(add(head.at, front, -1.5 * near), right, 0.9 * near), [0, 0.45 * near, 0]);
    const towards = unit(sub(monitor ? monitor.at : add(add(head.at, front, 2.5), [0, -0.35, 0]), at));
    this.free = {at, yaw: Math.atan2(-towards[0], -towards[2]), pitch: Math.asin(towards[1])};
  }

  view(scene, width, height) {
    const aspect = width / height, head = this.session.headAt(this.t);
    let at = this.free.at, turn = turnOf(this.free.yaw, this.free.pitch), top = 0.577, near = 0.08;
    if (this.camera === 'eyes' && head) {
      ({at, turn} = head);
      const monitor = scene?.flat?.framed || this.session.monitor; // which fills the view
      top = monitor ? 0.58 * Math.max(monitor.size[1], monitor.size[0] / aspect) / size(sub(monitor.at, at)) : 0.84;
    }
    if (this.camera === 'follow' && head) {
      const f = rotate(head.turn, [0, 0, -1]), yaw = Math.atan2(-f[0], -f[2]);
      turn = turnOf(yaw, -0.12);
      at = add(add(head.at, rotate(turnOf(yaw, 0), [0, 0, 1]), 1.35), [0.0, 0.35, 0]);
    }
    if (this.camera === 'above') {
      const {centre, radius} = this.middle(scene), back = radius / 0.45 / this.above.zoom;
      at = [centre[0] + this.above.by[0], centre[1] + back, centre[2] + this.above.by[1]];
      turn = turnOf(0, -Math.PI / 2 + 1e-4);
      top = 0.45;
      near = Math.max(0.05, at[1] - CEILING_M);
    }
    if (this.camera === 'topology' && scene?.data.topology) {
      const row = scene.filmedFrom(this.t), towards = unit(sub(row.slice(3), row));
      at = row.slice(0, 3);
      turn = turnOf(Math.atan2(-towards[0], -towards[2]), Math.asin(Math.max(-1, Math.min(1, towards[1]))));
      top = Math.tan(scene.data.topology.fov * Math.PI / 360);
    }
    const far = 120, back = [turn[0], -turn[1], -turn[2], -turn[3]];
    const origin = rotate(back, at).map(v => -v);
    const x = rotate(back, [1, 0, 0]), y = rotate(back, [0, 1, 0]), z = rotate(back, [0, 0, 1]);
    const world = new Float32Array([...x, 0, ...y, 0, ...z, 0, ...origin, 1]);
    const flat = new Float32Array([1 / (top * aspect), 0, 0, 0, 0, 1 / top, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
    return {projection: product(flat, world), world, at, turn, top, aspect, near};
  }

  project(view, p, width, height) {
    const m = view.projection, w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
    if (w < 0.03) return null;
    const x = m[0] * p[0] + m[4] * p[1] + m[8] * p[2] + m[12], y = m[1] * p[0] + m[5] * p[1] + m[9] * p[2] + m[13];
    return [(x / w * 0.5 + 0.5) * width, (0.5 - y / w * 0.5) * height, w];
  }

  inView(scene, view) {
    const planes = planesOf(view.projection), {place} = scene;
    return scene.data.cast.map((_, i) => i).filter(i => isInFront(planes, place[3 * i], place[3 * i + 1], place[3 * i + 2], PERSON_M));
  }

  // ---- one picture ----

  tick(now) {
    if (this.headset.isWorn) return; // its own pictures move time
    const elapsedS = this.advance(now);
    // How late pictures come is the time until the browser asks again after one, whatever moves time.
    if (this.timed && elapsedS > 0) this.pace += 0.2 * (1000 * elapsedS - this.pace);
    this.timed = false;
    if (this.pressedKeys.size) this.fly(elapsedS);
    if (this.quick && now - this.moveMs >= REST_MS) this.dirty = true;
    if (this.dirty || this.resized()) { this.dirty = false; this.draw(); }
    if (this.line.dirty) { this.line.dirty = false; this.line.draw(); }
  }

  // Time goes on however long a picture took, so that 1× is 1×; not while nobody saw one. Returns the seconds since the last.
  advance(now) {
    const sinceS = (now - (this.last || now)) / 1000, elapsedS = sinceS > AWAY_S ? 0 : sinceS;
    this.last = now;
    if (this.playing) {
      this.t = Math.min(this.line.end, this.t + elapsedS * this.speed);
      if (this.t >= this.line.end) this.play(false);
      this.line.follow(this.t, true);
      this.dirty = true;
      this.moveMs = performance.now();
    }
    return elapsedS;
  }

  resized() {
    const c = $('stage'), size = [c.clientWidth, c.clientHeight, window.devicePixelRatio].join();
    if (size === this.size) return false;
    this.size = size;
    this.line.dirty = true;
    return true;
  }

  draw() {
    const startMs = performance.now();
    const quick = this.quick = this.drawing.slow && startMs - this.moveMs < REST_MS;
    const stage = $('stage'), ratio = this.scale * Math.min(2, window.devicePixelRatio || 1);
    const width = Math.max(2, Math.round(stage.clientWidth * ratio)), height = Math.max(2, Math.round(stage.clientHeight * ratio));
    const scene = this.sceneNow(), t = this.t;
    const view = this.view(scene, width, height), light = this.lightOf(scene);
    const share = quick ? this.share() : 1, wide = Math.round(width * share), high = Math.round(height * share);
    this.timed = quick;
    this.drawing.begin(wide, high, ...this.background(scene, light));
    this.drawWorld(scene, view, light, this.camera !== 'eyes', quick ? [wide, high] : null);
    const step = this.pages.at(t);
    if (step) this.drawPage(step, width, height);
    else this.drawOver(scene, view, width, height, light);
    if (!quick || startMs - this.panelMs >= TELL_MS) { this.panelMs = startMs; this.tell(scene, light, step); }
    this.frames++;
    this.spent += performance.now() - startMs;
  }

  // Draws this moment when all pictures in it are decoded.
  async drawWhole() {
    this.draw();
    while (this.drawing.waiting.size) { await Promise.all(this.drawing.waiting); this.draw(); }
  }

  // What was there at this moment; null where nothing was, or it is still being loaded.
  sceneNow() {
    const scene = this.sceneAt(this.t);
    if (scene) scene.pose(this.t);
    else {
      const loading = this.session.load(this.trialAt(this.t));
      if (loading) this.drawing.wait(loading.then(problem => { this.problem = problem; this.line.take(this.seen); }));
    }
    return scene;
  }

  lightOf(scene) { return scene && !this.show.light ? scene.brightness(this.t) : 1; }
  roomOf(scene) { return scene ? this.content.header.rooms[scene.data.room] : null; }

  // What is seen where nothing is: its colour, and how bright it is.
  background(scene, light) {
    const room = this.roomOf(scene), flat = scene?.flat;
    return [room && (room.lamps.length || flat && !flat.monitor) ? room.background : [34, 36, 40], scene && !room.lamps.length ? 1 : light];
  }

  // What was there, from a view; the participant, too, for who looks from outside of them. `quick` is the size of the
  // picture where the processor draws it while time moves.
  drawWorld(scene, view, light, isOutside, quick = null) {
    const d = this.drawing, t = this.t, room = this.roomOf(scene), flat = scene?.flat;
    if (flat && this.show.room && !flat.monitor) flat.drawAround(d, view, scene.row(t));
    if (scene) {
      const drawRoom = () => { if (this.show.room && room.lamps.length) d.drawRoom(scene.data.room, view.projection, light, quick ? quick[1] : 0); };
      // A camera that stands still sees the same room again.
      const isThere = quick && d.drawCached([scene.data.room, this.show.room, light, ...view.projection].join(), ...quick, drawRoom);
      if (this.show.people && scene.data.cast.length) {
        const visible = this.inView(scene, view).filter(i => i !== scene.data.participant || this.show.body && isOutside);
        if (quick) (scene.quick ||= new QuickPeople(d, scene.data.cast)).draw(visible, scene, view, quick[1], room, light);
        else d.drawPeople(scene.data.cast, visible, scene.bones, scene.data.joints, scene.shapes, view.projection, room, light);
      }
      if (!isThere) drawRoom();
      d.drawThings(scene.data.moving.map(m => ({mesh: m.mesh, model: modelMatrix(m.at, m.turn), glow: m.glow})), view.projection, room, light);
    }
    d.drawThings(this.bodyThings(scene, isOutside), view.projection, null, 1);
    const monitor = flat ? flat.monitor : this.session.monitor;
    if (monitor && this.show.room) d.drawThings([caseOf(monitor)], view.projection, null, 1);
    if (flat && this.show.room) flat.draw(d, view, scene.row(t));
  }

  // Which share of the pixels' rows and columns a processor draws while time moves: fewer where it is late.
  share() {
    if (this.pace > LATE_MS && this.coarse < SHARES.length - 1) { this.coarse++; this.pace = ON_TIME_MS; }
    return SHARES[this.coarse];
  }

  segmentsOf() {
    const column = this.streams.byName.get('body')?.columns.find(c => c.name === 'position_m');
    if (!column) return [];
    return (column.about.split(': ')[1] || '').split(' ');
  }

  // Where no body was measured, the posture that the study declares, below the head and turned as it faces.
  atRest(head) {
    if (!head || !this.header.rest) return null;
    const {joints, yaw_rad} = this.header.rest, front = rotate(head.turn, [0, 0, -1]);
    const turn = turnOf(yaw_rad === null ? Math.atan2(-front[0], -front[2]) : yaw_rad, 0);
    return Object.fromEntries(Object.entries(joints).map(([name, p]) => [name, add(rotate(turn, p), [head.at[0], 0, head.at[2]])]));
  }

  // The participant's headset, and their joints: all where asked for or where nobody stands in for them, else those that feel something.
  bodyThings(scene, isOutside) {
    const isDressed = !!scene && scene.data.participant >= 0, bare = this.show.bones || this.show.body && !isDressed;
    const out = [], t = this.t, head = this.streams.headAt(t);
    const body = this.streams.has('body') ? this.streams.at('body', 'position_m', t, 0.3) : null;
    const felt = new Map();
    for (const lane of this.header.lanes) for (const [a, b] of lane.spans)
      if (t >= a && t < Math.max(b, a + 0.08)) felt.set(lane.role, lane.kind === 'vibration' ? 'buzz' : felt.get(lane.role) || 'touch');
    const colour = name => {
      for (const [role, how] of felt) if (role.includes(name)) return how === 'buzz' ? [0.25, 0.75, 1] : [1, 0.35, 0.3];
      return [0.78, 0.8, 0.84];
    };
    if (!this.show.body && !this.show.bones) return out;
    const at = body && this.segments.length * 3 === body.length
      ? Object.fromEntries(this.segments.map((name, k) => [name, body.slice(3 * k, 3 * k + 3)])) : isOutside ? this.atRest(head) : null;
    if (at) {
      const isFelt = name => [...felt.keys()].some(role => role.includes(name));
      const good = p => p && !p.some(Number.isNaN);
      const bones = [];
      const chains = [['hips', 'spine', 'chest', 'upper_chest', 'neck', 'head'],
        ...['left', 'right'].flatMap(s => [['upper_chest', s + '_shoulder', s + '_upper_arm', s + '_lower_arm', s + '_hand'].map((n, i) => i ? n : at.upper_chest ? n : 'chest'),
          ['hips', s + '_upper_leg', s + '_lower_leg', s + '_foot', s + '_toes']])];
      if (bare) for (const chain of chains) {
        const there = chain.filter(n => good(at[n]));
        for (let k = 1; k < there.length; k++) bones.push([there[k - 1], there[k]]);
      }
      for (const [a, b] of bones) {
        // The bone from elbow to hand is the forearm, that from shoulder to elbow the upper arm.
        const part = b.endsWith('_hand') ? b.replace('hand', 'forearm') : b.endsWith('_lower_arm') ? b.replace('lower_arm', 'upper_arm')
          : b.endsWith('_foot') ? b.replace('foot', 'shin') : b.endsWith('_lower_leg') ? b.replace('lower_leg', 'thigh') : b;
        const thick = /leg|thigh|shin|spine|chest|hips/.test(a + b) ? 0.05 : 0.032;
        out.push({solid: 'rod', model: spanning(at[a], at[b], thick), paint: colour(part)});
      }
      for (const [name, p] of Object.entries(at)) if (good(p) && name !== 'head' && (bare || isFelt(name)))
        out.push({solid: 'ball', model: modelMatrix(p, [1, 0, 0, 0], Array(3).fill(/hand/.test(name) ? 0.05 : 0.045)), paint: colour(name)});
    }
    if (head && isOutside) {
      const middle = add(head.at, rotate(head.turn, [0, 0.02, 0.09]));
      if (!isDressed || !this.show.body) out.push({solid: 'ball', model: modelMatrix(middle, head.turn, [0.078, 0.115, 0.095]), paint: [0.8, 0.72, 0.62]});
      if (!this.session.monitor) out.push({solid: 'box', model: modelMatrix(add(head.at, rotate(head.turn, [0, 0, -0.02])), head.turn, [0.17, 0.09, 0.07]), paint: [0.12, 0.13, 0.15]});
    }
    return out;
  }

  drawPage(step, width, height) {
    const c = $('overlay');
    if (c.width !== width || c.height !== height) { c.width = width; c.height = height; }
    this.pages.draw(this.over, step, this.t, width, height);
  }

  drawOver(scene, view, width, height, light) {
    const c = $('overlay');
    if (c.width !== width || c.height !== height) { c.width = width; c.height = height; }
    const g = this.over, ratio = width / Math.max(1, $('stage').clientWidth), t = this.t;
    g.clearRect(0, 0, width, height);
    const agents = scene ? scene.data.agents : [], gaze = this.streams.gazeAt(t), trial = this.trialAt(t);
    const labels = new Labels(g, ratio, width, height);
    this.rings = []; this.touches = [];
    const at = p => this.project(view, p, width, height);
    const scale = height / (2 * view.top);
    g.font = `${12 * ratio}px system-ui, sans-serif`;
    g.textAlign = 'center';
    if (scene && scene.data.mark && light <= 0.5) this.dot(g, at(scene.data.mark), 3 * ratio, '#ddd');
    // What lies behind somebody or something, as the camera sees it, is faint.
    const mark = p => {
      const q = at(p);
      if (q) q.share = scene && !scene.flat && isBehind(scene, this.content.header, view.at, p) ? FAINT : 1;
      return q;
    };
    if (this.show.heat && scene) this.drawHeat(g, scene, mark, scale, ratio);
    if (this.show.walked) for (const one of this.seen) this.drawWalked(g, one, mark, ratio);
    const named = [];
    if (this.show.areas && light > 0) agents.forEach((agent, k) => {
      const p = at(agent.at);
      if (!p) return;
      const r = agent.radius / p[2] * scale, isHit = this.seen.length === 1 && gaze && gaze.valid && gaze.hit === k;
      g.beginPath(); g.arc(p[0], p[1], r, 0, 7);
      g.lineWidth = (isHit ? 2.5 : 1) * ratio;
      g.strokeStyle = isHit ? GAZE : 'rgba(255,255,255,.45)';
      g.stroke();
      if (isHit || agents.length <= MANY || r > 14 * ratio) named.push({text: inWords(agent.place || agent.id), x: p[0], y: p[1] - r - 8 * ratio, colour: isHit ? GAZE : '#ddd', far: isHit ? 0 : p[2]});
    });
    this.outlines = this.show.areas && scene?.flat ? scene.flat.areasAt(scene.row(t)) : [];
    for (const area of this.outlines) this.drawArea(g, area, at, ratio, this.seen.length === 1 && gaze?.valid && gaze.on === area.name, named, width, height);
    if (this.show.gaze && scene?.flat?.data.window) this.drawWindow(g, scene.flat, at, ratio);
    if (this.show.path) for (const one of this.seen) this.drawPath(g, one, mark, ratio);
    for (const one of this.seen) if (trial) this.drawFixations(g, one, one.trialAt(t) || trial, mark, scale, ratio, labels);
    if (this.show.gaze) for (const one of this.seen) this.drawGaze(g, one, at, ratio, width, height, labels);
    // Whoever is looked at and the nearest come first: the others' labels make way.
    this.namedPeople = 0;
    if (this.show.labels) for (const n of named.sort((a, b) => a.far - b.far)) if (labels.put(n.text, n.x, n.y, n.colour)) this.namedPeople++;
    this.boxes = labels.boxes;
    if (this.show.body && this.streams.has('pointer')) {
      const p = this.streams.at('pointer', 'position_m', t, 0.2), q = this.streams.at('pointer', 'orientation_wxyz', t, 0.2), ok = this.streams.at('pointer', 'valid', t, 0.2);
      if (p && q && ok && ok[0] > 0.5) {
        const a = at(p), b = at(add(p, rotate(q, [0, 0, -1]), 3));
        if (a && b) { g.strokeStyle = 'rgba(94,200,255,.9)'; g.lineWidth = 1.5 * ratio; g.beginPath(); g.moveTo(a[0], a[1]); g.lineTo(b[0], b[1]); g.stroke(); }
      }
    }
    if (scene) for (const panel of scene.data.panels) this.drawPanel(g, panel, at, ratio);
  }

  drawPanel(g, panel, at, ratio) {
    const [w, h] = panel.size, corner = (x, y) => at(add(panel.at, rotate(panel.turn, [x * w / 2, y * h / 2, 0])));
    const corners = [corner(-1, 1), corner(1, 1), corner(1, -1), corner(-1, -1)];
    if (corners.some(p => !p)) return;
    g.beginPath();
    corners.forEach((p, k) => k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1]));
    g.closePath();
    g.fillStyle = 'rgba(20,22,26,.85)'; g.fill();
    const x = corners.reduce((s, p) => s + p[0], 0) / 4, y = corners.reduce((s, p) => s + p[1], 0) / 4;
    writeOn(g, panel.text, x, y - 8 * ratio, '#fff', ratio);
    writeOn(g, panel.choices.map((c, k) => k === panel.lit ? `[${c}]` : c).join('   '), x, y + 12 * ratio, '#ccc', ratio);
  }

  // An area of interest on a picture; a painted one may have several outlines.
  drawArea(g, area, at, ratio, isHit, named, width, height) {
    const places = area.corners.map(at), corners = places.filter(p => p && p[0] >= 0 && p[0] <= width && p[1] >= 0 && p[1] <= height);
    if (!corners.length) return; // none is in view
    let from = 0;
    area.paths = area.outlines.map(n => places.slice(from, from += n));
    for (const path of area.paths) this.outline(g, [...path, path[0]], isHit ? GAZE : '#d8d8d8', (isHit ? 2.5 : 1) * ratio, ratio);
    const top = corners.reduce((a, b) => b[1] < a[1] ? b : a);
    named.push({text: inWords(area.name), x: corners.reduce((s, p) => s + p[0], 0) / corners.length, y: top[1] - 8 * ratio, colour: isHit ? GAZE : '#ddd', far: isHit ? 0 : top[2]});
    area.paths = area.paths.map(path => path.filter(Boolean).map(p => [p[0] / ratio, p[1] / ratio]));
  }

  // Where the window was that followed gaze or the pointer.
  drawWindow(g, flat, at, ratio) {
    const rim = flat.rimAt(this.streams, this.t)?.map(p => p && at(p));
    if (rim?.every(Boolean)) this.outline(g, rim, WINDOW, 2 * ratio, ratio);
  }

  // A line through points, readable on any colour; it breaks where one is missing.
  outline(g, points, colour, wide, ratio) {
    g.beginPath();
    points.forEach((p, k) => p && (points[k - 1] ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1])));
    for (const [more, ink] of [[2 * ratio, 'rgba(20,20,20,.6)'], [0, colour]]) { g.lineWidth = wide + more; g.strokeStyle = ink; g.stroke(); }
  }

  dot(g, p, r, colour) { if (p) { g.fillStyle = colour; g.beginPath(); g.arc(p[0], p[1], r, 0, 7); g.fill(); } }
  ring(g, p, r, ratio, own = GAZE) {
    for (const [by, colour] of [[1.5 * ratio, 'rgba(20,20,20,.8)'], [0, own]]) {
      g.strokeStyle = colour; g.lineWidth = 2.5 * ratio;
      g.beginPath(); g.arc(p[0], p[1], r + by, 0, 7); g.stroke();
    }
  }

  drawGaze(g, one, at, ratio, width, height, labels) {
    const gaze = one.streams.gazeAt(this.t), alone = this.seen.length === 1;
    if (!gaze) return;
    if (!gaze.valid) { if (alone) writeOn(g, 'gaze lost', width / 2, height - 16 * ratio, '#ff6b5e', ratio); return; }
    const a = at(add(gaze.from, gaze.along, 0.1)), b = at(gazeEnd(gaze));
    if (this.camera !== 'eyes' && a && b) {
      g.strokeStyle = one.colour;
      g.globalAlpha = alone ? 0.9 : 0.35;
      g.lineWidth = (alone ? 2 : 1) * ratio;
      g.beginPath(); g.moveTo(a[0], a[1]); g.lineTo(b[0], b[1]); g.stroke();
      g.globalAlpha = 1;
    }
    if (!b) return;
    // In the air in front of nothing there is nothing to ring, but for their own eyes.
    if (!Number.isNaN(gaze.far) || this.camera === 'eyes') {
      this.ring(g, b, 9 * ratio, ratio, one.colour);
      this.rings.push({k: this.sessions.indexOf(one), x: b[0] / ratio, y: b[1] / ratio});
    }
    if (!this.show.labels) return;
    if (!alone) labels.put(one.label, b[0], b[1] + 20 * ratio, one.colour);
    else if (gaze.on && gaze.hit < 0 && !this.outlines.some(area => area.name === gaze.on)) labels.put(inWords(gaze.on), b[0], b[1] + 22 * ratio, GAZE);
  }

  drawWalked(g, one, at, ratio) {
    const trial = one.trialAt(this.t);
    if (!trial) return;
    let before = null;
    g.lineWidth = 2.5 * ratio;
    g.strokeStyle = one.colour;
    for (const point of one.walked(trial)) {
      const p = at(point.at);
      if (p && before) {
        g.globalAlpha = (point.t <= this.t ? 0.9 : 0.3) * p.share;
        g.beginPath(); g.moveTo(before[0], before[1]); g.lineTo(p[0], p[1]); g.stroke();
      }
      before = p;
    }
    g.globalAlpha = 1;
    // Where on the way something was touched or felt.
    if (one.walked(trial).length) for (const lane of one.header.lanes) for (const [from] of lane.spans) {
      const head = from >= trial.t0 && from < trial.t1 ? one.streams.headAt(from) : null, p = head && at([head.at[0], 0.01, head.at[2]]);
      if (!p) continue;
      g.globalAlpha = (from <= this.t ? 1 : 0.4) * p.share;
      this.dot(g, p, 5 * ratio, '#111');
      this.dot(g, p, 4 * ratio, LANE_COLOURS[lane.kind]);
      this.touches.push({x: p[0] / ratio, y: p[1] / ratio, t: from, text: `${this.sessions.length > 1 ? one.label + ': ' : ''}${lane.name} at ${(from - trial.t0).toFixed(2)} s`});
    }
    g.globalAlpha = 1;
  }

  // Fixations of a trial, those to come faint: discs by their length, a line from each to the next, their numbers;
  // and spheres whose area is the time spent on what they lie on.
  drawFixations(g, one, trial, at, scale, ratio, labels) {
    const fixations = one.fixations(trial);
    if (this.show.dwell) this.drawDwell(g, one, fixations, at, ratio, labels);
    if (!this.show.fixations && !this.show.order) return;
    let before = null;
    fixations.forEach((f, k) => {
      const p = at(f.at);
      if (!p) { before = null; return; }
      g.globalAlpha = (f.t0 <= this.t ? 0.95 : 0.3) * p.share;
      g.strokeStyle = g.fillStyle = one.colour;
      g.lineWidth = 1.5 * ratio;
      if (before) { g.beginPath(); g.moveTo(before[0], before[1]); g.lineTo(p[0], p[1]); g.stroke(); }
      const r = ratio * Math.min(22, 4 + 12 * Math.sqrt(f.t1 - f.t0));
      g.beginPath(); g.arc(p[0], p[1], r, 0, 7);
      g.globalAlpha *= 0.45; g.fill(); g.globalAlpha /= 0.45; g.stroke();
      if (this.show.order) writeOn(g, String(k + 1), p[0], p[1], '#fff', ratio);
      before = p;
    });
    g.globalAlpha = 1;
  }

  drawDwell(g, one, fixations, at, ratio, labels) {
    const sums = new Map();
    for (const f of fixations) {
      const key = one.keyOf(f.hit, f.on, f.t0);
      if (!key) continue;
      const id = key.kind + key.name, sum = sums.get(id) || {key, s: 0, at: [0, 0, 0]};
      const s = f.t1 - f.t0;
      sum.s += s;
      sum.at = sum.at.map((v, a) => v + s * f.at[a]);
      sums.set(id, sum);
    }
    for (const sum of [...sums.values()].sort((a, b) => b.s - a.s)) {
      const p = at(sum.at.map(v => v / sum.s));
      if (!p) continue;
      g.globalAlpha = 0.4 * p.share;
      g.fillStyle = one.colour;
      g.beginPath(); g.arc(p[0], p[1], 18 * ratio * Math.sqrt(sum.s), 0, 7); g.fill();
      g.globalAlpha = 1;
      if (this.show.labels && this.seen.length === 1) labels.put(`${inWords(sum.key.name)} ${sum.s.toFixed(2)} s`, p[0], p[1] + 26 * ratio, '#fff');
    }
  }

  fell(from, to) { return this.session.fell(from, to); }

  drawHeat(g, scene, at, scale, ratio) {
    const key = scene.data.t0;
    if (this.heatOf !== key) {
      this.heatOf = key;
      const cells = new Map();
      for (const f of this.seen.flatMap(one => one.fell(scene.data.t0, scene.data.t1))) {
        if (!f) continue;
        const id = f.at.map(v => Math.round(v / 0.04)).join();
        const cell = cells.get(id) || {at: f.at, n: 0};
        cell.n++;
        cells.set(id, cell);
      }
      this.heat = [...cells.values()].sort((a, b) => a.n - b.n);
      this.most = Math.max(1, ...this.heat.map(c => c.n));
    }
    g.globalCompositeOperation = 'lighter';
    for (const cell of this.heat) {
      const p = at(cell.at);
      if (!p) continue;
      const r = Math.max(4 * ratio, 0.07 / p[2] * scale), share = Math.sqrt(cell.n / this.most);
      const paint = g.createRadialGradient(p[0], p[1], 0, p[0], p[1], r);
      paint.addColorStop(0, `rgba(255,${Math.round(60 + 150 * share)},30,${0.08 + 0.5 * share})`);
      paint.addColorStop(1, 'rgba(255,60,0,0)');
      g.fillStyle = paint;
      g.globalAlpha = p.share;
      g.fillRect(p[0] - r, p[1] - r, 2 * r, 2 * r);
    }
    g.globalAlpha = 1;
    g.globalCompositeOperation = 'source-over';
  }

  drawPath(g, one, at, ratio) {
    const points = one.fell(this.t - 2, this.t);
    g.lineWidth = 1.5 * ratio;
    let before = null;
    points.forEach((f, k) => {
      const p = f && at(f.at);
      if (p && before) {
        g.strokeStyle = this.sessions.length > 1 ? one.colour : '#78dcff';
        g.globalAlpha = (0.15 + 0.8 * k / points.length) * p.share;
        g.beginPath(); g.moveTo(before[0], before[1]); g.lineTo(p[0], p[1]); g.stroke();
      }
      before = p;
    });
    g.globalAlpha = 1;
  }

  // ---- words ----

  tell(scene, light, step = null) {
    const trial = this.trialAt(this.t);
    $('clock').textContent = `${clockText(this.t)} of ${clockText(this.line.end, 0)}` + (trial ? `   ${trial.id} ${(this.t - trial.t0).toFixed(2)} s` : '   between trials');
    $('said').classList.toggle('on-page', !!step);
    const recent = this.line.marks.filter(e => e.t <= this.t && e.t > this.t - 1.5).slice(-4);
    const felt = this.header.lanes.filter(l => l.spans.some(([a, b]) => this.t >= a && this.t < Math.max(b, a + 0.08))).map(l => l.name);
    $('said').textContent = [...this.header.warning ? [this.header.warning] : [], ...scene?.flat?.notesAt(this.t) || [], ...step ? this.pages.notesAt(step) : [],
      ...this.drawing.missing ? [`${this.drawing.missing} pictures of this page cannot be decoded and are white: its file is damaged`] : [], ...trial?.problem ? [trial.problem] : [], ...recent.map(e => inWords(e.name)), ...felt].join('\n');
    const dark = scene && light <= 0;
    $('nothing').style.display = step || scene && !dark ? 'none' : 'grid';
    $('nothing').textContent = dark ? 'dark' : trial ? trial.shown ? trial.beside && !trial.isLoaded ? this.problem || `loading ${trial.id} …` : '' : `${trial.id} is not in this page in space\nvisavis view … --trial ${trial.id}`
      : `between trials: . goes to the next`;
    const key = trial ? trial.id + trial.t0 : '';
    if (key !== this.panelTrial) { this.panelTrial = key; this.tellTrial(trial); this.tellTransitions(trial); this.tellAlike(trial); }
    this.tellEvents();
    const place = trial ? `trial ${trial.id} at ${(this.t - trial.t0).toFixed(1)} s` : 'between trials';
    $('overlay').setAttribute('aria-label', `The scene, ${place}, camera ${inWords(this.camera)}` + (this.session.streams.gazeAt(this.t)?.on ? `, gaze on ${inWords(this.session.streams.gazeAt(this.t).on)}` : ''));
  }

  // From what to what gaze went in the trial: the most looked at on a circle, lines as wide as the moves are many.
  tellTransitions(trial) {
    const box = $('transitions'), {nodes, moves} = transitionsOf(this.seen, trial);
    $('transitions-box').hidden = !moves.length;
    if (!moves.length) { box.replaceChildren(); return; }
    const colour = this.seen.length > 1 ? 'var(--quiet)' : this.session.colour;
    box.innerHTML = '<svg viewBox="0 0 360 220"></svg>';
    const svg = box.firstChild;
    const make = (name, attributes, parent) => {
      const one = document.createElementNS(svg.namespaceURI, name);
      for (const [k, v] of Object.entries(attributes)) one.setAttribute(k, v);
      parent.append(one);
      return one;
    };
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', 'Moves of gaze: ' + moves.map(m => `${m.from} to ${m.to} ${m.n}`).join(', '));
    const place = new Map(nodes.map((n, k) => { const a = 2 * Math.PI * k / nodes.length - Math.PI / 2; return [n.name, [180 + 75 * Math.cos(a), 110 + 75 * Math.sin(a)]]; }));
    for (const m of moves) {
      const a = place.get(m.from), b = place.get(m.to);
      if (!a || !b) continue;
      const c = [(a[0] + b[0]) / 2 + (b[1] - a[1]) * 0.15, (a[1] + b[1]) / 2 - (b[0] - a[0]) * 0.15]; // there and back side by side
      const line = make('path', {d: `M${a} Q${c} ${b}`, fill: 'none', stroke: colour, 'stroke-width': 1 + m.n, 'stroke-opacity': 0.55}, svg);
      make('title', {}, line).textContent = `${inWords(m.from)} → ${inWords(m.to)}: ${m.n}`;
      const q = t => [0, 1].map(k => (1 - t) ** 2 * a[k] + 2 * t * (1 - t) * c[k] + t * t * b[k]), tip = q(0.72), tail = q(0.66), turn = Math.atan2(tip[1] - tail[1], tip[0] - tail[0]) * 180 / Math.PI;
      make('path', {d: 'M0 0L-8 -4L-8 4Z', transform: `translate(${tip}) rotate(${turn})`, fill: colour}, svg);
    }
    for (const n of nodes) {
      const [x, y] = place.get(n.name);
      make('circle', {cx: x, cy: y, r: 3 + 5 * Math.sqrt(n.s), fill: colour}, svg);
      const right = (x - 180) / 75, name = inWords(n.name);
      make('text', {x: x + 13 * right, y: y + 16 * (y - 110) / 75 + 4, 'text-anchor': Math.abs(right) < 0.3 ? 'middle' : right > 0 ? 'start' : 'end'}, svg)
        .textContent = `${name.length > 17 ? name.slice(0, 16) + '…' : name} ${n.s.toFixed(1)} s`;
    }
  }

  // How alike the views of participants were: with each other one on average, or with the one picked out.
  tellAlike(trial) {
    const box = $('alike');
    $('alike-box').hidden = this.sessions.length < 2 || !trial;
    if ($('alike-box').hidden) return;
    const pairs = alikeOf(this.sessions, trial), picked = this.picked, table = document.createElement('table');
    const mean = values => values.length ? values.reduce((a, b) => a + b, 0) / values.length : null;
    const head = table.createTHead().insertRow();
    for (const [text, about] of [['who', ''], ['at once', 'share of the time with gaze of both in which both look at the same'], ['in all', 'how much of the time on heads and things both share, whenever it was']]) {
      const th = document.createElement('th');
      th.textContent = text; th.title = about;
      head.append(th);
    }
    const body = table.createTBody();
    this.sessions.forEach((one, k) => {
      if (k === picked) return;
      const own = pairs.filter(p => (p.a === k || p.b === k) && (picked < 0 || p.a === picked || p.b === picked));
      const row = body.insertRow();
      for (const text of [one.label, ...['atOnce', 'inAll'].map(name => { const m = mean(own.map(p => p[name]).filter(v => v !== null)); return m === null ? '–' : `${Math.round(100 * m)} %`; })]) row.insertCell().textContent = text;
      row.onclick = () => this.pick(k);
    });
    const about = document.createElement('p');
    about.className = 'quiet';
    about.textContent = picked < 0 ? 'with the others, on average' : `with ${this.sessions[picked].label}`;
    box.replaceChildren(about, table);
  }

  tellTrial(trial) {
    const box = $('trial');
    box.replaceChildren();
    if (!trial) { box.textContent = 'between trials'; return; }
    const rows = [['trial', trial.id + (trial.practice ? ' (practice)' : '')], ['status', trial.status], ['attempt', trial.attempt],
      ...Object.entries(trial.factors).map(([name, value]) => [inWords(name), inWords(value), String(value)]), ...trial.row.filter(([, value]) => value !== null && value !== '')];
    const table = document.createElement('table');
    for (const [name, value, raw] of rows) {
      const row = table.insertRow();
      row.insertCell().textContent = name;
      const cell = row.insertCell();
      cell.textContent = value !== null && typeof value === 'object' ? clockText(value.at, 3) : typeof value === 'number' && !Number.isInteger(value) ? shortNumber(value)
        : typeof value === 'boolean' ? value ? 'yes' : 'no' : / sha256$/.test(name) ? String(value).slice(0, 12) + ' …' : String(value);
      cell.title = raw ?? String(value);
    }
    box.append(table);
  }

  tellEvents() {
    const k = lastAt(this.eventTimes, this.t);
    if (k === this.panelEvent) return;
    this.eventButtons[this.panelEvent]?.classList.remove('now');
    this.panelEvent = k;
    const button = this.eventButtons[k];
    if (!button) return;
    button.classList.add('now');
    const box = $('events');
    if (box.offsetParent) box.scrollTop = button.offsetTop - box.offsetTop - box.clientHeight / 2;
  }

  page() {
    for (const [name, text] of LAYERS) {
      const label = document.createElement('label'), box = document.createElement('input');
      box.type = 'checkbox';
      box.checked = this.show[name];
      box.id = 'layer-' + name;
      box.onchange = () => { this.show[name] = box.checked; this.dirty = true; };
      label.append(box, ' ' + text);
      $('layers').append(label);
    }
    this.tellSession();
    this.legend();
  }

  // What the page says of the session that is looked at.
  tellSession() {
    const h = this.header;
    for (const id of ['findings', 'column']) $(id).replaceChildren(...(id === 'column' ? [$(id).firstElementChild] : []));
    $('events').replaceChildren();
    this.panelEvent = undefined;
    $('badge').textContent = h.simulated ? 'SIMULATED' : '';
    const findings = h.findings || []; // of one trial of many sessions check says nothing
    const worst = findings.some(f => f.level === 'red') ? 'red' : findings.some(f => f.level === 'amber') ? 'amber' : 'green';
    const off = findings.filter(f => f.level !== 'green');
    $('findings-box').hidden = !h.findings;
    $('verdict').className = worst;
    $('verdict').textContent = !h.findings ? '' : `${h.status}${off.length ? `, ${off.length} ${off.length === 1 ? 'deviation' : 'deviations'}` : ', nothing found by check'}`;
    $('n-findings').textContent = off.length ? `(${off.length})` : '';
    $('findings-box').open = off.length > 0;
    for (const f of [...off, ...findings.filter(f => f.level === 'green')]) {
      const div = document.createElement('div'), p = document.createElement('p'), dot = document.createElement('span');
      div.className = 'finding';
      dot.className = f.level;
      dot.textContent = '● ';
      p.append(dot, `${f.subject}: ${f.message}`);
      div.append(p);
      if (f.redo) { const redo = document.createElement('p'); redo.className = 'redo'; redo.textContent = '→ ' + f.redo; div.append(redo); }
      const trial = h.trials.find(t => f.subject === t.id || f.message.includes(t.id + ' ') || f.message.endsWith(t.id));
      if (trial) { p.style.cursor = 'pointer'; p.onclick = () => { this.seek(trial.t0); this.line.show(trial.t0 - 1, trial.t1 + 1); }; }
      $('findings').append(div);
    }
    for (const stream of h.streams) {
      if (!stream.t.s[0]) continue;
      const group = document.createElement('optgroup');
      group.label = `${inWords(stream.name)} (${stream.rows} rows)`;
      for (const field of stream.columns) field.of.forEach((column, k) => {
        const option = document.createElement('option');
        option.value = JSON.stringify([stream.name, column]);
        option.textContent = field.labels[k];
        option.title = `${column}: ${field.about}`;
        group.append(option);
      });
      $('column').append(group);
    }
    this.eventTimes = this.line.marks.map(e => e.t);
    this.eventButtons = this.line.marks.map(e => {
      const button = document.createElement('button'), time = document.createElement('time');
      time.textContent = clockText(e.t);
      button.append(time, ` ${inWords(e.name)} `);
      const text = document.createElement('span');
      text.textContent = e.text;
      text.style.color = 'var(--quiet)';
      button.append(text);
      button.title = e.text;
      button.onclick = () => this.seek(e.t);
      return button;
    });
    $('events').append(...this.eventButtons);
  }

  // What colours and shapes mean; of several sessions who they are, to be picked out.
  legend() {
    const box = $('legend');
    if (this.sessions.length > 1) {
      const all = [...this.sessions.map((one, k) => [one.label, one.colour, k, Object.values(one.header.trials[0]?.factors || {}).map(inWords).join(', ')]), ['all together', '', -1, 'the place drawn is that of ' + this.sessions[0].label]];
      box.replaceChildren(...all.map(([name, colour, k, note]) => {
        const button = document.createElement('button'), quiet = document.createElement('small');
        button.className = 'who';
        button.dataset.k = k;
        if (colour) button.append(swatch(colour));
        quiet.textContent = note;
        button.append(name, ' ', quiet);
        button.onclick = () => { this.pick(k); button.blur(); };
        return button;
      }));
      this.markPicked();
      return;
    }
    const flats = this.header.scenes.map(s => s.flat).filter(Boolean);
    const lines = [...this.streams.has('gaze_targets') ? [[GAZE, 'gaze: where it ends on what is drawn; area it is on'], ['#78dcff', 'path of gaze, 2 s']] : [],
      ...this.streams.has('gaze_targets') || flats.some(f => f.areas.length) ? [['#d8d8d8', 'area of interest']] : [],
      ...this.header.trials.some(t => t.shown && this.session.walked(t).length) ? [[GAZE, 'walked path, on the floor: what is to come is faint']] : [],
      ...[...new Set(flats.filter(f => f.window).map(({window: w}) => w.t ? 'the pointer: it alone was sharp' : w.isAround ? 'gaze: all but it was seen' : 'gaze: it alone was seen'))].map(text => [WINDOW, `window after ${text}`]),
      ...flats.some(f => [...f.sheets, f.around].some(one => one?.moving)) ? [['#8a8f98', `moving dots and films: ${this.header.scenes[0].rate} pictures a second`]] : [],
      ...this.header.lanes.some(l => l.kind === 'contact') ? [[LANE_COLOURS.contact, 'contact']] : [], ...this.header.lanes.some(l => l.kind !== 'contact') ? [[LANE_COLOURS.vibration, 'vibration']] : [],
      [STATUS.complete, 'trial: complete'], [STATUS.damaged, 'trial: damaged'], [STATUS.interrupted, 'trial: interrupted, aborted or repeated'], [PRACTICE, 'trial: practice']];
    const seen = new Set(this.header.trials.map(t => t.practice ? 'practice' : t.status));
    box.replaceChildren(...lines.filter(([, text]) => !text.startsWith('trial: ') || [...seen].some(s => text.includes(s))).map(([colour, text]) => {
      const line = document.createElement('div');
      line.append(swatch(colour), text);
      return line;
    }));
  }

  markPicked() {
    for (const button of document.querySelectorAll('.who')) button.setAttribute('aria-pressed', String(Number(button.dataset.k) === this.picked));
  }

  defaultPlots() {
    const has = (s, c) => this.streams.has(s) && this.streams.byName.get(s).columns.some(f => f.of.includes(c));
    for (const [s, c] of [['gaze', 'left_pupil_mm'], ['head', 'position_z_m']]) if (has(s, c)) this.line.plot(s, c);
  }

  // What lies under a point of the stage: a ring of gaze, a person, a thing; null for nothing.
  under(x, y) {
    const scene = this.sceneAt(this.t), stage = $('stage'), width = stage.clientWidth, height = stage.clientHeight;
    const ring = (this.rings || []).find(r => Math.hypot(r.x - x, r.y - y) < NEAR_PX);
    if (ring && this.sessions.length > 1) return {session: ring.k, text: `gaze of ${this.sessions[ring.k].label}`};
    if (!scene || this.pages.at(this.t)) return null;
    const touch = (this.touches || []).find(c => Math.hypot(c.x - x, c.y - y) < NEAR_PX / 2);
    if (touch) return touch;
    const area = this.outlines.findLast(one => one.paths?.reduce((is, path) => is !== isWithin(path, x, y), false));
    if (area) return this.tipOf({kind: 'thing', name: area.name});
    const view = this.view(scene, width, height);
    const along = unit(rotate(view.turn, [(2 * x / width - 1) * view.top * view.aspect, (1 - 2 * y / height) * view.top, -1]));
    const key = metBy(scene, this.content.header, view.at, along);
    return key && this.tipOf(key);
  }

  tipOf(key) {
    const m = this.session.measures(key, this.trialAt(this.t));
    return {key, text: inWords(key.name) + (m ? m.dwell > 0 ? `: looked at for ${m.dwell.toFixed(2)} s` : ': not looked at' : '')};
  }

  click(x, y) {
    const there = this.under(x, y);
    if (there && there.t !== undefined) { this.seek(there.t); return; }
    if (there && there.session !== undefined) { this.pick(there.session === this.picked ? -1 : there.session); return; }
    this.about = there ? there.key : null;
    this.tellAbout();
  }

  // Dwell, fixations and latency on what was clicked, here and of everybody on the page.
  tellAbout() {
    const box = $('about'), key = this.about;
    $('about-box').hidden = !key;
    if (!key) return;
    $('about-box').open = true;
    const table = document.createElement('table'), head = table.createTHead().insertRow();
    const own = this.sessions.length > 1;
    for (const text of [own ? 'who' : 'trial', 'dwell (s)', 'fixations', 'first after (s)']) { const th = document.createElement('th'); th.textContent = text; head.append(th); }
    const body = table.createTBody(), now = this.trialAt(this.t), rows = [];
    const measured = own ? this.sessions.map(one => ({name: one.label, m: one.measures(key, one.trialAt(this.t) || one.header.trials[0]), is: one === this.session && this.picked >= 0, k: this.sessions.indexOf(one)}))
      : this.header.trials.filter(trial => trial.shown && (key.kind === 'person' || !trial.beside || trial.isLoaded)).map(trial => ({name: trial.id, m: this.session.measures(key, trial), is: trial === now, t: trial.t0}));
    for (const one of measured) if (one.m) rows.push(one);
    const mean = pick => { const v = rows.map(r => pick(r.m)).filter(n => n !== null); return v.length ? v.reduce((a, b) => a + b, 0) / v.length : null; };
    const write = (name, m, strong) => {
      const row = body.insertRow();
      if (strong) row.className = 'now';
      for (const text of [name, m.dwell === null ? '–' : m.dwell.toFixed(2), m.count === null ? '–' : Number.isInteger(m.count) ? m.count : m.count.toFixed(1), m.latency === null ? '–' : m.latency.toFixed(2)]) row.insertCell().textContent = text;
      return row;
    };
    for (const one of rows) {
      const row = write(one.name, one.m, one.is);
      row.onclick = () => { if (own) this.pick(one.k); else this.seek(one.t); };
    }
    if (rows.length > 1) write(own ? 'mean of all' : 'mean of trials', {dwell: mean(m => m.dwell), count: mean(m => m.count), latency: mean(m => m.latency)}, false).className = 'mean';
    const title = document.createElement('p');
    title.textContent = `${inWords(key.name)}${key.kind === 'person' ? ' (head)' : ''}`;
    box.replaceChildren(title, rows.length ? table : 'no gaze was recorded');
  }

  tip(text, x = 0, y = 0) {
    const tip = $('tip');
    tip.hidden = !text;
    if (!text) return;
    tip.textContent = text;
    const box = tip.getBoundingClientRect();
    tip.style.left = Math.max(4, Math.min(innerWidth - box.width - 4, x + 14)) + 'px';
    tip.style.top = Math.max(4, y + 18 + box.height > innerHeight ? y - box.height - 8 : y + 18) + 'px';
  }

  // ---- hands on it ----

  play(on = !this.playing) {
    if (on && this.t >= this.line.end) this.t = 0;
    this.playing = on;
    $('play').textContent = on ? '❙❙' : '▶';
    $('play').setAttribute('aria-label', on ? 'Pause' : 'Play');
  }

  toggle(name) { $('layer-' + name).click(); }

  fly(elapsedS) {
    const by = 2.5 * elapsedS, turn = turnOf(this.free.yaw, this.free.pitch);
    const moves = {w: [0, 0, -1], s: [0, 0, 1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0]};
    this.moveMs = performance.now();
    for (const key of this.pressedKeys) this.free.at = add(this.free.at, rotate(turn, moves[key]), by);
    this.dirty = true;
  }

  toFree() {
    if (this.camera === 'free') return;
    const stage = $('stage'), view = this.view(this.sceneAt(this.t), stage.clientWidth, stage.clientHeight);
    const f = rotate(view.turn, [0, 0, -1]);
    this.free = {at: view.at, yaw: Math.atan2(-f[0], -f[2]), pitch: Math.asin(Math.max(-1, Math.min(1, f[1])))};
    this.setCamera('free');
  }

  listen() {
    $('play').onclick = () => this.play();
    $('previous').onclick = () => this.step(-1);
    $('next').onclick = () => this.step(1);
    $('speed').onchange = () => { this.speed = Number($('speed').value); };
    $('camera').onchange = () => { this.above = {zoom: 1, by: [0, 0]}; this.dirty = true; $('camera').blur(); };
    $('column').onchange = () => {
      if ($('column').value) this.line.plot(...JSON.parse($('column').value));
      $('column').value = '';
      $('column').blur();
    };
    $('apart').onclick = () => { this.line.apart = !this.line.apart; this.line.viewKey = ''; this.line.dirty = true; $('apart').setAttribute('aria-pressed', String(this.line.apart)); $('apart').blur(); };
    $('apart').hidden = this.line.whom().length < 2;
    $('fit-all').onclick = () => this.line.show(0, this.line.end);
    $('fit-trial').onclick = () => { const t = this.trialAt(this.t); if (t) this.line.show(t.t0 - 0.5, t.t1 + 0.5); };
    $('help-button').onclick = () => $('help').showModal();
    addEventListener('keydown', e => this.key(e));
    addEventListener('keyup', e => { if (e.key === 'Shift') this.pressedKeys.clear(); else this.pressedKeys.delete(e.key.toLowerCase()); });
    addEventListener('blur', () => this.pressedKeys.clear());
    const over = $('overlay');
    let drag = null;
    over.addEventListener('contextmenu', e => e.preventDefault());
    let down = null;
    const isClick = e => down && Math.hypot(e.clientX - down[0], e.clientY - down[1]) < CLICK_PX;
    over.addEventListener('pointerdown', e => { over.setPointerCapture(e.pointerId); down = [e.clientX, e.clientY]; drag = [...down, e.button === 2 || e.shiftKey]; });
    over.addEventListener('pointerup', e => { if (drag && isClick(e)) this.click(e.offsetX, e.offsetY); drag = null; });
    over.addEventListener('pointerleave', () => this.tip(''));
    over.addEventListener('pointermove', e => {
      if (!drag) { const there = this.under(e.offsetX, e.offsetY); this.tip(there ? there.text : '', e.clientX, e.clientY); return; }
      if (isClick(e)) return;
      this.tip('');
      this.moveMs = performance.now();
      const dx = e.clientX - drag[0], dy = e.clientY - drag[1];
      drag = [e.clientX, e.clientY, drag[2]];
      if (this.camera === 'above') {
        const {radius} = this.middle(this.sceneAt(this.t)), scale = 2 * radius / this.above.zoom / over.clientHeight;
        this.above.by = [this.above.by[0] - dx * scale, this.above.by[1] - dy * scale];
      } else {
        this.toFree();
        if (drag[2]) this.free.at = add(this.free.at, rotate(turnOf(this.free.yaw, this.free.pitch), [-dx, dy, 0]), 0.006);
        else {
          this.free.yaw += 0.004 * dx;
          this.free.pitch = Math.max(-1.55, Math.min(1.55, this.free.pitch + 0.004 * dy));
        }
      }
      this.dirty = true;
    });
    over.addEventListener('wheel', e => {
      e.preventDefault();
      if (this.camera === 'above') this.above.zoom = Math.max(0.3, Math.min(12, this.above.zoom * Math.exp(-0.001 * e.deltaY)));
      else { this.toFree(); this.free.at = add(this.free.at, rotate(turnOf(this.free.yaw, this.free.pitch), [0, 0, 1]), 0.003 * e.deltaY); }
      this.dirty = true;
    }, {passive: false});
  }

  key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey || $('help').open || /SELECT|INPUT/.test(e.target.tagName) && e.key !== ' ') return;
    const key = e.key.toLowerCase();
    if (e.shiftKey && 'wasdqe'.includes(key) && key.length === 1) { this.toFree(); this.pressedKeys.add(key); }
    else if (key === ' ') this.play();
    else if (key === 'arrowleft') this.seek(this.t - (e.shiftKey ? 1 : 0.05));
    else if (key === 'arrowright') this.seek(this.t + (e.shiftKey ? 1 : 0.05));
    else if (key === 'a') this.coding.mark();
    else if (key === ',') this.step(-1);
    else if (key === '.') this.step(1);
    else if (CAMERAS[Number(key) - 1]) this.setCamera(CAMERAS[Number(key) - 1]);
    else if (KEY_OF[key]) this.toggle(KEY_OF[key]);
    else if (key === '+' || key === '=') this.line.zoom(0.7);
    else if (key === '-') this.line.zoom(1 / 0.7);
    else if (key === '0') this.line.show(0, this.line.end);
    else if (key === '?') $('help').showModal();
    else if (key === ']' && this.sessions.length > 1) this.pick(this.picked + 1);
    else if (key === '[' && this.sessions.length > 1) this.pick(this.picked < 0 ? this.sessions.length - 1 : this.picked - 1);
    else if (key === 'escape') { this.about = null; this.pick(-1); }
    else return;
    e.preventDefault();
  }
}

function swatch(colour) {
  const mark = document.createElement('i');
  mark.style.background = colour;
  return mark;
}

const startMs = performance.now();
unpacked($('data').textContent).then(content => {
  $('data').remove();
  window.viewer = new Viewer(content);
  document.body.dataset.opened = (performance.now() - startMs).toFixed(0);
}).catch(problem => {
  $('nothing').style.display = 'grid';
  $('nothing').textContent = `This page cannot be shown: ${problem.message}`;
  document.body.dataset.problem = problem.message;
  throw problem;
});

// A headset put on: one stands where the participant stood, looks around with one's own head, and time goes on in it.

const STEP_S = 5;
const STICK = {on: 0.7, off: 0.4}; // it has to come back before it counts again
const STICKS = {across: 2, along: 3}, LEAVE = 5; // axes, and the upper button, of the standard's gamepad
const LOWEST_EYE_M = 0.5; // as `lab.eye_height.MIN_EYE_M`: what was measured from somewhere else than the floor is lower
const SAME_PLACE_M = 0.6; // as near to it one stands in the participant, whose body is not drawn then
const GAZE_BEGINS_M = 1; // before one's own eyes a line that begins nearer cannot be looked at, nor the words behind it
const GAZE_M = {line: 0.003, point: 0.006, least: 0.008}; // radii: of the point a metre away, and at least
// Nearer than a monitor stands.
const PANEL = {ahead_m: 0.5, below_m: 0.34, size_m: [0.4, 0.1], px: [992, 248], turns: 0.8, every_ms: 100};
const HOW = ['trigger: play, pause   ·   B or Y: leave', 'right stick: 5 s   ·   left stick: trial   ·   stick up: where they are now'];
const WHAT_TO_DO = {
  'the address is not secure': 'open the page as visavis view SESSION --headset --lan prints it, by https, or at localhost',
  'this browser has no WebXR': 'take the headset\'s own browser (visavis view SESSION --headset --lan), or Chrome or Edge at a computer that a headset is joined to',
  'no headset is connected': 'join one to this computer and start its program (SteamVR, Quest Link), or open the page in the headset\'s own browser',
};

class Headset {
  constructor(viewer) {
    this.viewer = viewer;
    this.isWorn = false;
    this.frames = 0;
    this.boards = new Map();
    if (!viewer.content.header.headset) return;
    $('vr').hidden = false;
    $('enter-vr').onclick = () => this.enter();
    navigator.xr?.addEventListener('devicechange', () => this.look());
    this.look();
  }

  // Say on the page whether one can enter, or why not and what to do.
  async look() {
    $('enter-vr').disabled = true;
    const why = await whyNot();
    if (this.isWorn) return;
    $('enter-vr').disabled = !!why;
    $('vr-note').textContent = why ? `${why}: ${WHAT_TO_DO[why] || 'open the page anew'}` : '';
  }

  async enter() {
    const {viewer} = this, {gl} = viewer.drawing;
    let entry;
    try { entry = await openHeadset(() => gl); } catch (problem) { $('vr-note').textContent = `The headset was not entered: ${problem.message}`; return; }
    const {session, space} = entry;
    Object.assign(this, {session, space, layer: drawIn(session, gl), isWorn: true, stand: null, trial: null, ahead: null, beyond: new Map(), panelMs: -1e9});
    viewer.last = 0;
    $('enter-vr').disabled = true;
    $('vr-note').textContent = 'in the headset';
    session.addEventListener('selectstart', () => viewer.play());
    session.addEventListener('visibilitychange', () => { if (session.visibilityState !== 'visible') viewer.play(false); });
    space.addEventListener('reset', () => { this.stand = null; });
    session.addEventListener('end', () => this.toPage());
    const onFrame = (time, frame) => {
      if (!this.isWorn) return;
      session.requestAnimationFrame(onFrame);
      this.frame(time, frame.getViewerPose(space));
    };
    session.requestAnimationFrame(onFrame);
  }

  toPage() {
    const {viewer} = this;
    this.isWorn = false;
    viewer.play(false);
    viewer.last = 0;
    viewer.dirty = true;
    this.look();
  }

  // ---- hands ----

  listen() {
    for (const {gamepad, handedness} of this.session.inputSources) {
      if (!gamepad) continue;
      const {across, along} = STICKS, isLeft = handedness === 'left';
      this.once(handedness + 'across', gamepad.axes[across], sign => isLeft ? this.step(sign) : this.viewer.seek(this.viewer.t + sign * STEP_S));
      this.once(handedness + 'along', gamepad.axes[along], sign => { if (sign < 0) this.stand = null; });
      this.once(handedness + 'leave', gamepad.buttons[LEAVE]?.value, () => this.session.end());
    }
  }

  // Do something once when a stick or button goes beyond its limit, and again only after it came back.
  once(name, value = 0, act) {
    const wasBeyond = this.beyond.get(name) || false, isBeyond = Math.abs(value) > (wasBeyond ? STICK.off : STICK.on);
    this.beyond.set(name, isBeyond);
    if (isBeyond && !wasBeyond) act(Math.sign(value));
  }

  step(sign) { this.viewer.step(sign); this.stand = null; }

  // ---- one picture for each eye ----

  frame(time, pose) {
    const {viewer, layer} = this, {gl} = viewer.drawing;
    this.listen();
    viewer.advance(time);
    if (!pose || !this.isWorn) return;
    // Where another trial begins elsewhere one is brought there; within one nobody is moved.
    const trial = viewer.trialAt(viewer.t), {position: p, orientation} = pose.transform, at = [p.x, p.y, p.z];
    if (!this.stand || trial && trial !== this.trial && this.isOutside(at)) this.stand = this.place(pose.transform);
    this.trial = trial || this.trial;
    const scene = viewer.sceneNow(), light = viewer.lightOf(scene), isOutside = this.isOutside(at);
    const own = this.stand.toWorld(at), towards = sub(this.stand.toWorld(add(at, rotated(orientation, [0, 0, -1]))), own);
    const turn = turnOf(Math.atan2(-towards[0], -towards[2]), Math.asin(Math.max(-1, Math.min(1, towards[1]))));
    const things = viewer.show.gaze ? viewer.seen.flatMap(one => this.gazeOf(one, own)) : [];
    const sheets = [...(scene?.data.panels || []).map(panel => this.board(panel)), this.panel(time, own, towards)];
    gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
    const [colour, brightness] = viewer.background(scene, light);
    gl.clearColor(...colour.map(v => v / 255 * brightness), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const {viewport, eye, projection} of eyesOf(pose, layer, this.stand)) {
      gl.viewport(...viewport);
      // What is all around reaches as far as any headset sees, however the head is tilted.
      viewer.drawWorld(scene, {projection, at: eye, turn, top: 3, aspect: 1}, light, isOutside);
      viewer.drawing.drawThings(things, projection, null, 1);
      viewer.drawing.drawSheets(sheets, projection);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.frames++;
  }

  // Whether one's head, on the headset's floor, is away from where the participant's is now.
  isOutside(at) {
    const head = this.viewer.streams.headAt(this.viewer.t), own = this.stand.toWorld(at);
    return !head || Math.hypot(head.at[0] - own[0], head.at[2] - own[2]) > SAME_PLACE_M;
  }

  // Where the participant's head was is where one's own head is, turned as theirs about the vertical alone. In a place one
  // stands on its floor, as tall as one is; flat stimuli have no floor, nor has a head that was not measured from it.
  place({position: p, orientation}) {
    const {streams, t} = this.viewer, first = streams.has('head') ? streams.t('head')[0] : 0;
    const head = streams.headAt(t) || streams.headAt(first) || {at: [0, 1.6, 0], turn: [1, 0, 0, 0]};
    const own = {at: [p.x, p.y, p.z], ahead: rotated(orientation, [0, 0, -1])};
    this.ahead = null;
    const hasFloor = !this.viewer.session.isFlat && head.at[1] > LOWEST_EYE_M;
    return standAt(head.at, add(head.at, rotate(head.turn, [0, 0, -1])), own, hasFloor ? 0 : head.at[1] - p.y);
  }

  // A line from the participant's eyes to where gaze ends, and a point there.
  gazeOf(session, own) {
    const gaze = session.streams.gazeAt(this.viewer.t);
    if (!gaze?.valid) return [];
    const end = gazeEnd(gaze), far = size(sub(end, gaze.from)), begins = size(sub(gaze.from, own)) > SAME_PLACE_M ? 0.1 : GAZE_BEGINS_M;
    const paint = [1, 3, 5].map(k => parseInt(session.colour.slice(k, k + 2), 16) / 255), round = Math.max(GAZE_M.least, GAZE_M.point * size(sub(end, own)));
    const point = {solid: 'ball', model: modelMatrix(end, [1, 0, 0, 0], [round, round, round]), paint, glow: 1};
    return far > begins ? [point, {solid: 'rod', model: spanning(add(gaze.from, gaze.along, begins), end, GAZE_M.line), paint, glow: 1}] : [point];
  }

  // ---- words in view ----

  // Which trial it is and when, below what one looks at; it comes after whoever turns away from it.
  panel(ms, own, towards) {
    const flat = Math.hypot(towards[0], towards[2]) > 0.2 ? unit([towards[0], 0, towards[2]]) : this.ahead || [0, 0, -1], {ahead_m, below_m, size_m, turns} = PANEL;
    if (!this.ahead || this.ahead[0] * flat[0] + this.ahead[2] * flat[2] < Math.cos(turns)) this.ahead = flat;
    const {viewer} = this, trial = viewer.trialAt(viewer.t), picture = this.words ||= this.newPicture(PANEL.px);
    if (ms - this.panelMs >= PANEL.every_ms || !picture.text) {
      this.panelMs = ms;
      const where = trial ? `${trial.id}   ${(viewer.t - trial.t0).toFixed(1)} of ${(trial.t1 - trial.t0).toFixed(1)} s` : 'between trials';
      const missing = trial && !viewer.sceneAt(viewer.t) ? trial.beside && !trial.isLoaded ? viewer.problem || 'loading …' : 'not in space' : '';
      this.write(picture, [[`${where}   ${missing || (viewer.playing ? 'playing' : 'paused')}`, 60], [`${clockText(viewer.t, 0)} of ${clockText(viewer.line.end, 0)}   ·   ${HOW[0]}`, 30], [HOW[1], 30]]);
    }
    const at = add(add(own, this.ahead, ahead_m), [0, -below_m, 0]), back = Math.atan2(below_m, ahead_m);
    return {at, turn: turnOf(Math.atan2(-this.ahead[0], -this.ahead[2]), -back), size: size_m, picture: picture.number};
  }

  // A question as it stood in the place.
  board({text, choices, lit, at, turn, size: sides}) {
    const key = JSON.stringify([text, choices, lit]);
    if (!this.boards.has(key)) {
      const picture = this.newPicture([800, Math.round(800 * sides[1] / sides[0])]);
      this.write(picture, [[text, 44], [choices.map((c, k) => k === lit ? `[${c}]` : c).join('   '), 40]]);
      this.boards.set(key, picture);
    }
    return {at, turn, size: sides, picture: this.boards.get(key).number};
  }

  newPicture([width, height]) {
    const {drawing} = this.viewer, canvas = Object.assign(document.createElement('canvas'), {width, height});
    return {canvas, number: drawing.pictures.push(drawing.white) - 1, text: ''};
  }

  // Lines [text, pixels] one below the other, each as large as it fits.
  write(picture, lines) {
    const text = JSON.stringify(lines);
    if (picture.text === text) return;
    picture.text = text;
    const {canvas, number} = picture, {drawing} = this.viewer, {gl} = drawing, g = canvas.getContext('2d');
    g.fillStyle = '#14161a';
    g.fillRect(0, 0, canvas.width, canvas.height);
    Object.assign(g, {fillStyle: '#f2f2f2', textAlign: 'center', textBaseline: 'middle'});
    const total = lines.reduce((sum, [, px]) => sum + 1.4 * px, 0);
    let y = (canvas.height - total) / 2;
    for (const [words, px] of lines) {
      g.font = `${px}px system-ui, sans-serif`;
      g.fillText(words, canvas.width / 2, y + 0.7 * px, 0.96 * canvas.width);
      y += 1.4 * px;
    }
    if (drawing.pictures[number] !== drawing.white) gl.deleteTexture(drawing.pictures[number]);
    drawing.pictures[number] = drawing.picture(canvas);
  }
}

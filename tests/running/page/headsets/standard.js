// A headset for tests that follows the standard's order of events: `selectstart` at the press, then, when
// it ends, `select` and `selectend`; frames are predicted 18 ms ahead. `window.drive` moves it.
(() => {
  const AHEAD_MS = 18;
  const FRAME_MS = 1000 / 72;
  const SIDE_PX = 160;
  const draw = window.seldom || ((gl, frame) => { frame(); return true; }); // seldom.js
  const rotated = ([w, x, y, z], [a, b, c]) => {
    const t = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
    return [a + w * t[0] + y * t[2] - z * t[1], b + w * t[1] + z * t[0] - x * t[2], c + w * t[2] + x * t[1] - y * t[0]];
  };
  const named = ([x, y, z]) => ({ x, y, z, w: 1 });
  class Transform {
    constructor(place, turn) {
      this.place = place;
      this.turn = turn;
      this.position = named(place);
      this.orientation = { w: turn[0], x: turn[1], y: turn[2], z: turn[3] };
    }
    get inverse() {
      const back = [this.turn[0], -this.turn[1], -this.turn[2], -this.turn[3]];
      return new Transform(rotated(back, this.place).map((v) => -v), back);
    }
    get matrix() {
      const columns = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => [...rotated(this.turn, axis), 0]);
      return new Float32Array([...columns.flat(), ...this.place, 1]);
    }
  }
  class Source {
    constructor(handedness) {
      Object.assign(this, { handedness, targetRayMode: "tracked-pointer", profiles: ["standard-test"], hand: null, gripSpace: null });
      this.pulses = 0;
      this.place = [handedness === "left" ? -0.2 : 0.2, 1.2, -0.2];
      this.turn = [1, 0, 0, 0];
      this.targetRaySpace = { source: this };
      this.gamepad = { buttons: Array.from({ length: 6 }, () => ({ value: 0 })), axes: [0, 0, 0, 0],
        hapticActuators: [{ pulse: async () => { this.pulses += 1; return true; } }] };
    }
  }
  const state = { head: [0, 1.6, 0], turn: [1, 0, 0, 0], isWorn: true, isTracked: true, session: null, space: null, ticks: 0, sources: [new Source("left"), new Source("right")], skipped: 0, wanted: null };

  class Frame {
    constructor(session, time) { Object.assign(this, { session, predictedDisplayTime: time + AHEAD_MS, isActive: true }); }
    check() { if (!this.isActive) throw new DOMException("the frame is over", "InvalidStateError"); }
    getPose(space) { this.check(); return { transform: new Transform(space.source.place, space.source.turn), emulatedPosition: false }; }
    getViewerPose() {
      this.check();
      if (!state.isTracked) return null;
      const shake = state.isWorn ? 0.004 * Math.sin(performance.now() / 90) : 0;
      const head = [state.head[0], state.head[1] + shake, state.head[2]];
      const far = 60; const near = 0.05;
      const projection = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
      const views = [-0.032, 0.032].map((x, i) => ({ eye: i ? "right" : "left", projectionMatrix: projection,
        transform: new Transform(rotated(state.turn, [x, 0, 0]).map((v, k) => v + head[k]), state.turn) }));
      return { transform: new Transform(head, state.turn), views, emulatedPosition: false };
    }
  }
  class Session extends EventTarget {
    constructor() {
      super();
      Object.assign(this, { visibilityState: "visible", frameRate: 72, inputSources: state.sources, callbacks: [], isOver: false });
      state.session = this;
      this.clock = setInterval(() => this.tick(), FRAME_MS);
      this.begun = performance.now();
    }
    tick() {
      if (this.visibilityState === "hidden") return;
      state.ticks += 1;
      const [calls, frame] = [this.callbacks, new Frame(this, this.now())];
      this.callbacks = [];
      const isDrawn = draw(this.layer?.gl, () => { for (const call of calls) call(frame.predictedDisplayTime - AHEAD_MS, frame); }, Boolean(state.wanted));
      frame.isActive = false;
      if (isDrawn) state.wanted?.();
    }
    // A clock of its own, in whole frames of the display.
    now() { return FRAME_MS * (state.skipped + Math.round((performance.now() - this.begun) / FRAME_MS)); }
    requestAnimationFrame(call) { this.callbacks.push(call); return this.callbacks.length; }
    async requestReferenceSpace() { state.space = new EventTarget(); return state.space; }
    updateRenderState({ baseLayer }) { if (baseLayer) this.layer = baseLayer; }
    async end() {
      if (this.isOver) return;
      this.isOver = true;
      clearInterval(this.clock);
      this.dispatchEvent(new Event("end"));
    }
    tell(kind, source) {
      const event = new Event(kind);
      const frame = new Frame(this, this.now());
      Object.assign(event, { inputSource: source, frame });
      this.dispatchEvent(event);
      frame.isActive = false;
    }
  }
  window.XRWebGLLayer = class {
    constructor(session, gl) {
      Object.assign(this, { gl, framebufferWidth: 2 * SIDE_PX, framebufferHeight: SIDE_PX, framebuffer: gl.createFramebuffer() });
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 2 * SIDE_PX, SIDE_PX, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
      const depth = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT16, 2 * SIDE_PX, SIDE_PX);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
    getViewport({ eye }) { return { x: eye === "left" ? 0 : SIDE_PX, y: 0, width: SIDE_PX, height: SIDE_PX }; }
  };
  WebGL2RenderingContext.prototype.makeXRCompatible = async () => {};
  const system = Object.assign(new EventTarget(), { isSessionSupported: async () => true, requestSession: async () => {
    if (!navigator.userActivation.isActive) throw new DOMException("nobody pressed a button", "SecurityError");
    return new Session();
  } });
  Object.defineProperty(navigator, "xr", { value: system, configurable: true });
  const of = (side) => state.sources.find((s) => s.handedness === side);
  window.drive = {
    point(side, place, turn) { Object.assign(of(side), { place, turn }); },
    press(side) { of(side).gamepad.buttons[0].value = 1; state.session.tell("selectstart", of(side)); },
    release(side) { of(side).gamepad.buttons[0].value = 0; state.session.tell("select", of(side)); state.session.tell("selectend", of(side)); },
    stick(side, x, y) { of(side).gamepad.axes.splice(2, 2, x, y); },
    upper(side, value) { of(side).gamepad.buttons[5].value = value; }, // B or Y
    head(place, turn) { Object.assign(state, { head: place, turn }); },
    visibility(what) { state.session.visibilityState = what; state.session.dispatchEvent(new Event("visibilitychange")); },
    wear(isWorn) { state.isWorn = isWorn; },
    track(isTracked) { state.isTracked = isTracked; },
    reset() { state.space.dispatchEvent(new Event("reset")); },
    skip(n) { state.skipped += n; }, // the display goes on without n frames
    ticks: () => state.ticks, // frames that were given to the page
    sleep() { const removed = state.sources.splice(0); state.session.dispatchEvent(Object.assign(new Event("inputsourceschange"), { added: [], removed })); },
    wake() { state.sources.push(new Source("left"), new Source("right")); state.session.dispatchEvent(Object.assign(new Event("inputsourceschange"), { added: [...state.sources], removed: [] })); },
    end() { return state.session.end(); },
    pulses: () => state.sources.reduce((sum, s) => sum + s.pulses, 0),
    async picture() { // what the next frame draws for both eyes, as the image of a canvas
      await new Promise((done) => { state.wanted = done; });
      state.wanted = null;
      const { layer } = state.session;
      const { gl } = layer;
      const [w, h] = [layer.framebufferWidth, layer.framebufferHeight];
      const bytes = new Uint8Array(4 * w * h);
      gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
      gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      return { width: w, height: h, bytes: Array.from(bytes) };
    },
  };
})();

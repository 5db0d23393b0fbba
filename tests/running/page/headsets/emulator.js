// Meta's emulator IWER (npm: iwer, MIT) behind the same `window.drive` as the standard's headset.
(() => {
  const device = new IWER.XRDevice(IWER.metaQuest3);
  device.installRuntime({ forceInstall: true });
  device.stereoEnabled = true;
  device.position.set(0, 1.6, 0);
  const ask = XRSession.prototype.requestAnimationFrame;
  XRSession.prototype.requestAnimationFrame = function (frame) {
    return ask.call(this, (...now) => window.seldom(this.renderState.baseLayer?.context, () => frame(...now)));
  };
  let isWorn = true;
  setInterval(() => { if (isWorn) device.position.set(0, 1.6 + 0.004 * Math.sin(performance.now() / 90), 0); }, 20);
  window.drive = {
    point(side, [x, y, z], [qw, qx, qy, qz]) {
      device.controllers[side].position.set(x, y, z);
      device.controllers[side].quaternion.set(qx, qy, qz, qw);
    },
    press(side) { device.controllers[side].updateButtonValue("trigger", 1); },
    release(side) { device.controllers[side].updateButtonValue("trigger", 0); },
    stick(side, x, y) { device.controllers[side].updateAxes("thumbstick", x, y); },
    upper(side, value) { device.controllers[side].updateButtonValue(side === "left" ? "y-button" : "b-button", value); },
    visibility(what) { device.updateVisibilityState(what); },
    wear(now) { isWorn = now; },
    end() { return device.activeSession?.end(); },
  };
})();

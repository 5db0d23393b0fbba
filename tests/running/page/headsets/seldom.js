// Where a processor draws, a picture takes longer than a headset's frame: what is asked for meanwhile would pile
// up and be waited for when the figure is closed. So a picture is drawn every two seconds; the frames between are
// given to the page, too, but nothing of them is drawn, and the last picture stays.
window.seldom = (() => {
  const APART_MS = 2000;
  let isLeftOut = false;
  let last = null;
  let painter = null; // the context that was drawn by last
  for (const name of ["clear", "drawElements", "drawArrays"]) {
    const real = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...how) { painter = this; if (!isLeftOut) real.apply(this, how); };
  }
  const isDrawing = () => !last.gl.isContextLost() && last.gl.getSyncParameter(last.all, last.gl.SYNC_STATUS) !== last.gl.SIGNALED;
  /** Let a frame be drawn by a context, or left out; tells which. `must` says that it may not be left out. */
  const seldom = (gl, frame, must = false) => {
    isLeftOut = Boolean(gl && last) && !must && (performance.now() - last.ms < APART_MS || isDrawing());
    const wasLeftOut = isLeftOut;
    frame();
    isLeftOut = false;
    if (gl && !wasLeftOut) {
      last = { gl, ms: performance.now(), all: gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0) };
      gl.flush();
    }
    return !wasLeftOut;
  };
  const ask = window.requestAnimationFrame.bind(window); // frames of the page itself
  window.requestAnimationFrame = (frame) => ask((now) => seldom(painter, () => frame(now)));
  return seldom;
})();

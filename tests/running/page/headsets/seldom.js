// Where a processor draws, a picture takes longer than a headset's frame: what is asked for meanwhile would pile
// up and be waited for when the figure is closed. So a few pictures a second are drawn; the frames between are
// given to the page, too, but nothing of them is drawn, and the last picture stays.
window.seldom = (() => {
  const APART_MS = 200;
  let isLeftOut = false;
  let last = null;
  for (const name of ["clear", "drawElements", "drawArrays"]) {
    const real = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...how) { if (!isLeftOut) real.apply(this, how); };
  }
  const isDrawing = () => !last.gl.isContextLost() && last.gl.getSyncParameter(last.all, last.gl.SYNC_STATUS) !== last.gl.SIGNALED;
  /** Let a frame be drawn by a context, or left out; tells which. `must` says that it may not be left out. */
  return (gl, frame, must = false) => {
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
})();

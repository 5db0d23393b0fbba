// Somebody in a headset: looks at the board, points at a text of it, presses.
window.addEventListener("headset", ({ detail }) => { window.worn = detail; });
window.person = (() => {
  const unit = (v) => { const n = Math.hypot(...v); return v.map((a) => a / n); };
  // The turn that leads -z to a direction: the shortest one.
  const towards = ([x, y, z]) => {
    const q = [1 - z, y, -x, 0];
    return unit(q);
  };
  const frame = () => new Promise((done) => { const n = window.worn.frames(); const look = () => (window.worn.frames() > n + 1 || !window.worn.isPresenting() ? done() : setTimeout(look, 10)); look(); });
  return {
    texts: () => window.worn.board.texts(),
    async press(text, nth = 0, side = "right", from = null) {
      await frame();
      const { board } = window.worn;
      board.refresh();
      const at = board.placeOf(text, nth);
      if (!at) throw new Error(`no ${text} on the board: ${board.texts()}`);
      const { middle, right, up } = window.worn.place();
      const target = middle.map((m, i) => m + (at[0] - 0.5) * 1.0 * right[i] + (0.5 - at[1]) * (704 / 1024) * up[i]);
      const hand = from || [0.2, 1.2, -0.1];
      window.drive.point(side, hand, towards(unit(target.map((t, i) => t - hand[i]))));
      await frame();
      window.drive.press(side);
      await frame();
      window.drive.release(side);
      await frame();
    },
  };
})();

// Areas of interest cut by the edges of the window through which somebody saw them, however far around they reach.

const NEARLY = 1e-9; // beyond an edge: what lies on it is within

// Closed lines of places around an eye, as they are seen through a window whose middle and sides are given: closed lines
// in its plane, from its middle. Where the area goes on beyond the window, they go along its edges; whether its upper left
// corner is within the area says along which.
function cutByWindow(lines, [right, up, back], [wide, high], hasCorner) {
  const [x, y] = [wide / 2, high / 2];
  const planes = [[-back, 0, right - x], [back, 0, -right - x], [0, -back, up - y], [0, back, -up - y]].map(unit);
  const beyond = (p, plane) => -(p[0] * plane[0] + p[1] * plane[1] + p[2] * plane[2]) / size(p) - NEARLY;
  const onWindow = p => [p[0] * back / p[2] - right, p[1] * back / p[2] - up];
  const whole = [], runs = [];
  for (const line of lines) {
    const first = line.findIndex(p => planes.some(plane => beyond(p, plane) > 0));
    if (first < 0) { whole.push(line.map(onWindow)); continue; }
    let run = null;
    for (let k = 0; k < line.length; k++) {
      const a = line[(first + k) % line.length], b = line[(first + k + 1) % line.length];
      let from = 0, to = 1;
      for (const plane of planes) {
        const [of, at] = [a, b].map(p => beyond(p, plane) * size(p));
        if (of > 0 && at > 0) to = -1;
        else if (of > 0) from = Math.max(from, of / (of - at));
        else if (at > 0) to = Math.min(to, of / (of - at));
      }
      if (from >= to) { run = null; continue; }
      if (from > 0 || !run) runs.push(run = [onWindow(add(a, sub(b, a), from))]);
      run.push(onWindow(add(a, sub(b, a), to)));
      if (to < 1) run = null;
    }
  }
  // Along the edges, clockwise from the upper left corner (0 to 4), every end of a run changes whether it is within.
  const alongEdges = ([h, v]) => Math.abs(h) / x > Math.abs(v) / y ? (h > 0 ? 1.5 - v / y / 2 : 3.5 + v / y / 2) : v > 0 ? 0.5 + h / x / 2 : 2.5 - h / x / 2;
  const corners = [[-x, y], [x, y], [x, -y], [-x, -y]];
  const ends = runs.flatMap(run => [run[0], run.at(-1)].map((p, k) => ({run, isLast: k === 1, s: alongEdges(p)}))).sort((a, b) => a.s - b.s);
  if (!ends.length) return hasCorner ? [...whole, corners] : whole;
  while (runs.length) {
    const path = [];
    let end = ends.find(e => e.run === runs[0] && !e.isLast);
    while (runs.includes(end.run)) {
      const {run, isLast} = end;
      runs.splice(runs.indexOf(run), 1);
      path.push(...isLast ? run.toReversed() : run);
      const k = ends.findIndex(e => e.run === run && e.isLast !== isLast), isUp = k % 2 === (hasCorner ? 1 : 0);
      end = ends[(k + (isUp ? 1 : ends.length - 1)) % ends.length];
      path.push(...cornersBetween(ends[k].s, end.s, isUp).map(c => corners[c]));
    }
    whole.push(path);
  }
  return whole;
}

// The corners on the way along the edges from one place to another, clockwise or not.
function cornersBetween(from, to, isClockwise) {
  if (!isClockwise) return cornersBetween(to, from, true).toReversed();
  const out = [];
  for (let c = Math.ceil(from); c < (to < from ? to + 4 : to); c++) out.push(c % 4);
  return out;
}

// Where somebody looked and walked in a session: gaze on what is drawn, fixations, measures of looks, the path of the head.

const HOLD_STEPS = 1.5, BRIDGE_S = 0.075, MIN_FIXATION_S = 0.15, SLACK_S = 2e-5; // as `analysis.gaze.looks`
const ALIKE_STEP_S = 0.02;
const STANDS_M = 0.5; // who stays within this has not walked

class Session {
  constructor(content, header, colour) {
    this.header = header;
    this.colour = colour;
    this.streams = new Streams(content, header);
    this.content = content;
    this.scenes = new Map();
    this.label = header.participant + (header.session > 1 ? ` session ${header.session}` : '');
    this.paths = new Map();
    this.measured = new Map();
    this.lookSpans = null;
    // Whether there were flat stimuli and no place beside them; and the monitor before which somebody sat then.
    const flats = header.scenes.map(s => s.flat).filter(Boolean);
    this.isFlat = header.scenes.some(s => s.flat) && !header.scenes.some(s => s.agents.length || s.moving?.length || content.header.rooms[s.room]?.lamps.length);
    this.monitor = this.isFlat && flats.filter(f => f.eye && !f.isWide).map(f => f.sheets[0])[0] || null;
    this.seat = flats.map(f => f.eye).find(Boolean); // of who was before a page, where no head was measured
  }

  headAt(t) { return this.streams.headAt(t) || (this.seat && !this.streams.has('head') ? {at: this.seat, turn: [1, 0, 0, 0]} : null); }

  sceneAt(t) {
    const data = this.header.scenes.find(s => t >= s.t0 && t < s.t1);
    if (!data || data.isBeside) return null;
    if (!this.scenes.has(data)) this.scenes.set(data, new Scene(this.content, data));
    return this.scenes.get(data);
  }
  // Begin to load a trial whose scenes are in a file beside the page: a promise of a problem, or of nothing; null where
  // there is nothing to begin.
  load(trial) {
    if (!trial?.beside || trial.asked) return null;
    trial.asked = true;
    return new Promise(done => this.ask(trial, done));
  }
  ask(trial, done) {
    const script = document.createElement('script');
    script.onerror = () => done(`${trial.beside} is not beside the page: keep them together`);
    Session.waiting.set(trial.beside, async text => {
      const own = await unpacked(text), {scenes, gazeEnds} = own.header;
      const rest = this.header.scenes.filter(s => !(s.isBeside && s.trial === trial.id && s.t0 >= trial.t0 && s.t0 < trial.t1));
      this.header.scenes = [...rest, ...scenes.map(s => ({...s, content: own}))].sort((a, b) => a.t0 - b.t0);
      this.header.gazeEnds.push(...gazeEnds.map(e => ({...e, content: own})));
      trial.isLoaded = true;
      this.measured.clear();
      this.lookSpans = null;
      done();
    });
    script.src = trial.beside;
    document.head.append(script);
  }

  trialAt(t) { return this.header.trials.find(s => t >= s.t0 && t < s.t1); }

  // Rows of gaze between two times, and where each fell; null where it was lost.
  fell(from, to) {
    if (!this.streams.has('gaze_targets')) return [];
    const times = this.streams.t('gaze_targets'), origin = this.streams.field('gaze_targets', 'origin_world_m');
    const along = this.streams.field('gaze_targets', 'direction_world'), valid = this.streams.field('gaze_targets', 'valid')[0];
    const hit = this.streams.field('gaze_targets', 'hit')[0], out = [];
    for (let i = Math.max(0, lastAt(times, from)); i < times.length && times[i] <= to; i++) {
      if (!(valid[i] > 0.5) || Number.isNaN(along[0][i])) { out.push(null); continue; }
      const end = this.streams.endAt(times[i]);
      out.push({t: times[i], hit: hit[i], on: end.on, at: gazeEnd({from: origin.map(c => c[i]), along: along.map(c => c[i]), ...end})});
    }
    return out;
  }

  fixations(trial) { return (this.header.fixations || []).filter(f => f.t0 >= trial.t0 && f.t0 < trial.t1); }

  // Where the head was above the floor, ten times a second; empty for who stayed where they were.
  walked(trial) {
    if (!this.paths.has(trial)) {
      const points = [];
      for (let t = trial.t0; t < trial.t1; t += 0.1) {
        const head = this.streams.headAt(t);
        if (head) points.push({t, at: [head.at[0], 0.01, head.at[2]]});
      }
      const reach = k => points.length ? Math.max(...points.map(p => p.at[k])) - Math.min(...points.map(p => p.at[k])) : 0;
      this.paths.set(trial, Math.hypot(reach(0), reach(2)) > STANDS_M ? points : []);
    }
    return this.paths.get(trial);
  }

  // Whom gaze was on: [name, spans] for everybody who was ever looked at.
  whom() {
    if (this.lookSpans) return this.lookSpans;
    const looks = new Map();
    if (this.streams.has('gaze_targets')) {
      const t = this.streams.t('gaze_targets'), hit = this.streams.field('gaze_targets', 'hit')[0];
      const scenes = this.header.scenes.filter(s => s.agents.length || s.flat?.areas.length);
      let scene = 0, open = null;
      for (let i = 0; i < t.length; i++) {
        while (scene < scenes.length - 1 && t[i] >= scenes[scene + 1].t0) scene++;
        const here = scenes[scene];
        const inside = here && t[i] >= here.t0 && t[i] < here.t1;
        const on = inside && here.flat ? this.streams.endAt(t[i]).on : '', isArea = on && here.flat.areas.some(a => a.name === on);
        const name = isArea ? on : inside && hit[i] >= 0 && here.agents[hit[i]] ? here.agents[hit[i]].place || here.agents[hit[i]].id : null;
        if (open && open.name === name && t[i] - open.span[1] < 0.1) { open.span[1] = t[i]; continue; }
        open = null;
        if (name) {
          open = {name, span: [t[i], t[i]]};
          if (!looks.has(name)) looks.set(name, []);
          looks.get(name).push(open.span);
        }
      }
    }
    return this.lookSpans = [...looks].sort((a, b) => a[0] < b[0] ? -1 : 1);
  }

  // Dwell and looks on what is called `key` in a trial: a person's head by their place, a thing by its name.
  // null where the trial has no gaze. A sample lasts until the next, at most 1.5 steps; losses up to 75 ms are bridged.
  measures(key, trial) {
    if (!this.streams.has('gaze_targets') || !trial) return null;
    const id = key.kind + key.name + trial.t0;
    if (this.measured.has(id)) return this.measured.get(id);
    const times = this.streams.t('gaze_targets'), hit = this.streams.field('gaze_targets', 'hit')[0], valid = this.streams.field('gaze_targets', 'valid')[0];
    const first = Math.max(0, lastAt(times, trial.t0)), last = lastAt(times, trial.t1), steps = [];
    for (let i = first + 1; i <= last; i++) steps.push(times[i] - times[i - 1]);
    steps.sort((a, b) => a - b);
    const hold = HOLD_STEPS * (steps[steps.length >> 1] || 1 / 120), looks = [];
    let open = false, dwell = 0;
    for (let i = first; i <= last; i++) {
      const begin = Math.max(times[i], trial.t0), until = Math.min(times[i] + hold, trial.t1, i + 1 < times.length ? times[i + 1] : Infinity);
      if (until <= begin || !(valid[i] > 0.5)) continue;
      if (!this.isOn(key, hit[i], times[i])) { open = false; continue; }
      dwell += until - begin;
      const before = looks[looks.length - 1];
      if (open && begin - before[1] <= BRIDGE_S + SLACK_S) before[1] = until; else looks.push([begin, until]);
      open = true;
    }
    const fixations = looks.filter(([a, b]) => b - a >= MIN_FIXATION_S - SLACK_S);
    const result = {dwell, count: fixations.length, latency: fixations.length ? fixations[0][0] - trial.t0 : null};
    this.measured.set(id, result);
    return result;
  }

  isOn(key, hit, t) {
    if (key.kind === 'person') {
      const agent = hit >= 0 ? this.header.scenes.find(s => t >= s.t0 && t < s.t1)?.agents[hit] : null;
      return !!agent && (agent.place || agent.id) === key.name;
    }
    return hit < 0 && this.streams.endAt(t).on === key.name;
  }

  // What a fixation or a sample of gaze is on, as a key of `measures`; null where it is on nothing.
  keyOf(hit, on, t) {
    const agent = hit >= 0 ? this.header.scenes.find(s => t >= s.t0 && t < s.t1)?.agents[hit] : null;
    if (agent) return {kind: 'person', name: agent.place || agent.id};
    return on ? {kind: 'thing', name: on} : null;
  }
}

// From what to what fixations of a trial went, of all these sessions together: things and heads by the time on them,
// at most `most`, and moves between these with how many there were. What lies between two of them is passed over.
function transitionsOf(sessions, trial, most = 8) {
  const nodes = new Map(), moves = new Map(), ways = [];
  for (const one of sessions) {
    const mine = trial && (one.trialAt(trial.t0 + 1e-6) || trial);
    const way = mine ? one.fixations(mine).map(f => ({name: one.keyOf(f.hit, f.on, f.t0)?.name, s: f.t1 - f.t0})).filter(f => f.name) : [];
    for (const {name, s} of way) nodes.set(name, (nodes.get(name) || 0) + s);
    ways.push(way);
  }
  const top = [...nodes].map(([name, s]) => ({name, s})).sort((a, b) => b.s - a.s).slice(0, most), names = new Set(top.map(n => n.name));
  for (const way of ways) {
    const steps = way.map(f => f.name).filter(name => names.has(name));
    for (let k = 1; k < steps.length; k++) if (steps[k] !== steps[k - 1]) {
      const id = steps[k - 1] + '→' + steps[k];
      if (!moves.has(id)) moves.set(id, {from: steps[k - 1], to: steps[k], n: 0});
      moves.get(id).n++;
    }
  }
  return {nodes: top, moves: [...moves.values()].sort((a, b) => b.n - a.n)};
}

// How alike two participants' views of a trial were, of every pair: the share of moments with gaze of both in which both
// were on the same head or thing (`atOnce`), and how much of the time on heads and things both spent on the same
// (`inAll`: the sum over these of the smaller share); null without gaze.
function alikeOf(sessions, trial) {
  const ways = sessions.map(one => {
    const mine = one.trialAt(trial.t0 + 1e-6) || trial, looked = [], shares = new Map();
    for (let t = mine.t0; t < Math.min(mine.t1, mine.t0 + trial.t1 - trial.t0); t += ALIKE_STEP_S) {
      const gaze = one.streams.gazeAt(t), key = gaze && gaze.valid ? one.keyOf(gaze.hit, gaze.on, t) : null;
      const name = key ? key.kind + ' ' + key.name : null;
      looked.push(name);
      if (name) shares.set(name, (shares.get(name) || 0) + 1);
    }
    const n = looked.filter(Boolean).length;
    for (const [name, count] of shares) shares.set(name, count / n);
    return {looked, shares};
  });
  const pairs = [];
  ways.forEach((one, a) => ways.slice(0, a).forEach((other, b) => {
    let same = 0, both = 0, inAll = 0;
    one.looked.forEach((name, k) => { if (name && other.looked[k]) { both++; same += name === other.looked[k]; } });
    for (const [name, share] of one.shares) inAll += Math.min(share, other.shares.get(name) || 0);
    pairs.push({a: b, b: a, atOnce: both ? same / both : null, inAll: one.shares.size && other.shares.size ? inAll : null});
  }));
  return pairs;
}

Session.waiting = new Map();
// Called by files beside the page.
window.visavisTrial = (place, text) => Session.waiting.get(place)?.(text);

// Which person's head or body, or which thing, a ray from an eye meets first: {kind, name, far}; null for none.
// A body whose figure somebody else has, too, is told by its head alone.
function metBy(scene, header, from, along, largest = Infinity) {
  const figures = scene.data.cast.map(k => header.people[k].name);
  let best = null;
  const take = (far, key) => { if (far > 0.05 && (!best || far < best.far)) best = {...key, far}; };
  scene.data.agents.forEach((agent, k) => {
    const key = {kind: 'person', name: agent.place || agent.id}, figure = figures[k];
    take(throughBall(from, along, agent.at, agent.radius), key);
    const body = figures.indexOf(figure) === figures.lastIndexOf(figure) ? {kind: 'thing', name: figure} : key;
    const root = [...scene.place.subarray(3 * k, 3 * k + 3)]; // a body: three balls from the hips to the neck
    if (k < scene.data.cast.length && Math.hypot(root[0] - agent.at[0], root[2] - agent.at[2]) < 1)
      for (const share of [0, 0.35, 0.7]) take(throughBall(from, along, root.map((v, a) => v + share * (agent.at[a] - v)), 0.2), body);
  });
  for (const [name, low, high] of header.rooms[scene.data.room].things) if (low.every((v, k) => high[k] - v < largest)) take(throughBox(from, along, low, high), {kind: 'thing', name});
  return best;
}

const BEHIND_M = 0.3; // a mark lies on the surface of a head or body, which are told by balls within
const LARGE_M = 3; // walls, floors and ceilings, which a camera may be outside of

// Whether somebody, or a thing that is no wall, stands between a camera and a point.
function isBehind(scene, header, from, point) {
  const way = sub(point, from), far = Math.hypot(...way);
  if (far < 1e-3) return false;
  const met = metBy(scene, header, from, way.map(v => v / far), LARGE_M);
  return !!met && met.far < far - BEHIND_M;
}

function throughBall(from, along, centre, radius) {
  const to = sub(centre, from), ahead = to[0] * along[0] + to[1] * along[1] + to[2] * along[2];
  const aside = to[0] ** 2 + to[1] ** 2 + to[2] ** 2 - ahead ** 2;
  return aside > radius * radius ? -1 : ahead - Math.sqrt(radius * radius - aside);
}

function throughBox(from, along, low, high) { // where a ray from outside enters; −1 where it does not
  let near = -Infinity, far = Infinity;
  for (let k = 0; k < 3; k++) {
    if (Math.abs(along[k]) < 1e-9) { if (from[k] < low[k] || from[k] > high[k]) return -1; continue; }
    const a = (low[k] - from[k]) / along[k], b = (high[k] - from[k]) / along[k];
    near = Math.max(near, Math.min(a, b));
    far = Math.min(far, Math.max(a, b));
  }
  return near <= far ? near : -1;
}

// Whether a point lies within a polygon: a line to the right of it crosses the outline an odd time.
function isWithin(corners, x, y) {
  let is = false;
  corners.forEach((a, k) => {
    const b = corners[(k + 1) % corners.length];
    if (a[1] <= y !== b[1] <= y && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])) is = !is;
  });
  return is;
}

// ---- labels that do not lie over each other ----

class Labels {
  constructor(g, ratio, width, height) { Object.assign(this, {g, ratio, width, height, boxes: []}); }

  overlaps(box) { return this.boxes.some(b => box[0] < b[2] && b[0] < box[2] && box[1] < b[3] && b[1] < box[3]); }

  // Write a text centred above a point, or as near to it as there is room, then with a line to it.
  put(text, x, y, colour) {
    const {g, ratio} = this, line = 15 * ratio, half = g.measureText(text).width / 2 + 2 * ratio;
    const box = (cx, cy) => [cx - half, cy - line / 2, cx + half, cy + line / 2];
    let place = null;
    for (let ring = 0; ring < 8 && !place; ring++)
      for (const [dx, dy] of ring ? [[0, -ring], [-ring, -ring], [ring, -ring], [-ring, 0], [ring, 0], [0, ring + 1]] : [[0, 0]]) {
        const cx = Math.min(this.width - half, Math.max(half, x + dx * line * 1.6)), cy = Math.max(line / 2, y + dy * line);
        if (!this.overlaps(box(cx, cy))) { place = [cx, cy]; break; }
      }
    if (!place) return false;
    const [cx, cy] = place;
    this.boxes.push(box(cx, cy));
    if (Math.hypot(cx - x, cy - y) > line / 2) {
      g.strokeStyle = 'rgba(220,220,220,.6)';
      g.lineWidth = ratio;
      g.beginPath(); g.moveTo(cx, cy + line / 2 - 2 * ratio); g.lineTo(x, y + line / 2); g.stroke();
    }
    writeOn(g, text, cx, cy, colour, ratio);
    return true;
  }
}

function writeOn(g, text, x, y, colour, ratio) {
  g.textBaseline = 'middle';
  g.lineWidth = 3 * ratio; g.strokeStyle = 'rgba(0,0,0,.75)'; g.strokeText(text, x, y);
  g.fillStyle = colour; g.fillText(text, x, y);
}

// Replays a recording of agents in the plane. The page holds everything: `meta` is
// JSON, `tracks` the ways of the agents (see track.rs for the encoding).
'use strict';
(() => {
const $ = (id) => document.getElementById(id);
const meta = JSON.parse($('meta').textContent);
const COLORS = meta.colors;
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const LIST_STEP = 200;
const count = meta.agents; // shown; moving obstacles come after them
const bodies = meta.ids.length;
const end = meta.duration_s;

// ---- The recording ---------------------------------------------------------------

/** Knots of all agents, one after the other: agent i has first[i]..first[i + 1]. */
const tracks = decode($('tracks').textContent);
$('tracks').remove();

function decode(text) {
  const binary = atob(text);
  const first = new Uint32Array(bodies + 1);
  const time = new Float64Array(meta.knots);
  const pose = [0, 1, 2].map(() => new Int32Array(meta.knots));
  let at = 0, knot = 0;
  const number = () => {
    let value = 0, unit = 1, byte;
    do {
      byte = binary.charCodeAt(at++);
      value += (byte & 127) * unit;
      unit *= 128;
    } while (byte > 127);
    return value;
  };
  const last = [0, 0, 0];
  for (let i = 0; i < bodies; i++) {
    let sample = 0;
    last.fill(0);
    for (let left = number(); left > 0; left--, knot++) {
      const head = number();
      sample += Math.floor(head / 8);
      for (let axis = 0; axis < 3; axis++) {
        if (head >> axis & 1) {
          const code = number();
          last[axis] += code % 2 ? -(code + 1) / 2 : code / 2;
        }
        pose[axis][knot] = last[axis];
      }
      // The last sample may come sooner than the others.
      time[knot] = Math.min(sample * meta.sample_s, end);
    }
    first[i + 1] = knot;
  }
  return { first, time, x: pose[0], y: pose[1], h: pose[2] };
}

const indexOf = new Map(meta.ids.map((id, index) => [id, index]));
const outlineOf = (i) => meta.outlines[meta.outline_of.length ? meta.outline_of[i] : 0];
const reach = meta.outlines.map((o) => 'r' in o ? o.r : Math.max(...pairs(o.v).map(([x, y]) => Math.hypot(x, y))));
const reachOf = (i) => reach[meta.outline_of.length ? meta.outline_of[i] : 0];
const largest = Math.max(0, ...reach);
/** Contacts in the order of their beginnings: bodies as ids, `b` null for what stands. */
const contacts = meta.contacts.map(([from, to, a, b]) => ({ from, to: to ?? end, open: to === null, a, b }));

/** What the planner wants to show, by layer; its times are those of the plan. */
const layers = meta.layers.map(({ name, color, range, annotations }) => ({
  name, color, range, shown: true,
  annotations: annotations.map((a) => ({
    agent: a.agent ?? null, from: a.from_s ?? 0, to: a.to_s ?? Infinity, text: a.text ?? '',
    shape: a.shape, shapes: a.xy_m ?? [], values: a.values ?? [],
  })),
}));

/** What the fleet did, if the trace tells it; times become seconds. */
const work = meta.work && readWork(meta.work);

function readWork({ tick_s, cols, goals, reached, calls, notices }) {
  const { rows, side } = meta.cells;
  const seconds = (tick) => tick === null ? null : tick * tick_s;
  let tick = 0;
  const of = new Map(calls.map(([number, [asked, answered, by, planner, fail]]) =>
    [number, { number, asked: seconds(asked), answered: seconds(answered), by, planner, fail, said: [] }]));
  for (const [call, name, module, message] of notices) of.get(call)?.said.push({ name, module, message });
  return {
    goals: goals.map((own) => own.map(([from, to, cell, number, task]) => ({
      from: seconds(from), to: seconds(to), number, task,
      row: Math.floor(cell / cols), col: cell % cols,
      x: (cell % cols + 0.5) * side, y: (rows - Math.floor(cell / cols) - 0.5) * side,
    }))),
    reached: reached.map((since) => seconds(tick += since)),
    calls: [...of.values()],
  };
}

/** How many of the ascending values, or of what `of` makes of them, are not after a time. */
function until(values, time, of = (value) => value) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(values[middle]) <= time + 1e-9) low = middle + 1; else high = middle;
  }
  return low;
}

/** The goal of an agent at a time. */
function goalAt(i, time) {
  if (!work) return meta.goals[i] ? { x: meta.goals[i][0], y: meta.goals[i][1] } : null;
  const own = work.goals[i] ?? [];
  const last = own[until(own, time, (goal) => goal.from) - 1];
  return last && (last.to === null || last.to > time + 1e-9) ? last : null;
}

const BY = { planner: 'planner', 'fail-policy': 'fail policy', nobody: 'nobody' };
const isTrouble = (call) => call.said.length > 0 || (call.by !== null && call.by !== 'planner');
const troubles = work ? work.calls.filter(isTrouble) : [];

const isAgent = (id) => id !== null && id < meta.all_agents;
const nameOf = (id) => id === null ? 'obstacle' : isAgent(id) ? `agent ${id}` : 'moving obstacle';

function pairs(flat) {
  const out = [];
  for (let i = 0; i + 1 < flat.length; i += 2) out.push([flat[i], flat[i + 1]]);
  return out;
}

// Poses at the current time, in metres and radians.
const [X, Y, H] = [0, 1, 2].map(() => new Float64Array(bodies));
/** The knot of each body that is not after the current time. */
const cursor = tracks.first.slice(0, bodies);

function place(time) {
  for (let i = 0; i < bodies; i++) {
    const k = knotAt(i, time, cursor[i]);
    cursor[i] = k;
    const part = k + 1 < tracks.first[i + 1] ? (time - tracks.time[k]) / (tracks.time[k + 1] - tracks.time[k]) : 0;
    const next = part > 0 ? k + 1 : k;
    X[i] = (tracks.x[k] + part * (tracks.x[next] - tracks.x[k])) * meta.length_m;
    Y[i] = (tracks.y[k] + part * (tracks.y[next] - tracks.y[k])) * meta.length_m;
    H[i] = (tracks.h[k] + part * (tracks.h[next] - tracks.h[k])) * meta.angle_rad;
  }
}

/** The last knot of an agent that is not after a time; looks near `guess` first. */
function knotAt(i, time, guess) {
  const from = tracks.first[i], to = tracks.first[i + 1];
  let low = from, high = to;
  if (tracks.time[guess] <= time) {
    for (let step = 0; step < 4; step++) {
      if (guess + 1 >= to || tracks.time[guess + 1] > time) return guess;
      guess++;
    }
    low = guess;
  }
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (tracks.time[middle] <= time) low = middle; else high = middle;
  }
  return low;
}

const MOVING = 0, TURNING = 1, WAITING = 2, PARKED = 3;
const STATES = ['moving', 'turning', 'waiting', 'parked'];

/** Calls `visit(from, to, state)` for the stretches of an agent's time, in order. */
function stretches(i, visit) {
  // Whoever has arrived waits for nothing.
  const arrived = meta.arrivals[i] ?? Infinity;
  let since = 0, state = -1;
  const tell = (from, until, what) => {
    if (what !== WAITING || until <= arrived) return visit(from, until, what);
    if (from < arrived) visit(from, arrived, WAITING);
    visit(Math.max(from, arrived), until, PARKED);
  };
  const put = (until, next) => {
    if (next !== state) {
      if (until > since && state >= 0) tell(since, until, state);
      if (until > since || state < 0) since = until;
      state = next;
    }
  };
  for (let k = tracks.first[i]; k + 1 < tracks.first[i + 1]; k++) {
    const span = tracks.time[k + 1] - tracks.time[k];
    const way = Math.hypot(tracks.x[k + 1] - tracks.x[k], tracks.y[k + 1] - tracks.y[k]) * meta.length_m;
    const turn = Math.abs(tracks.h[k + 1] - tracks.h[k]) * meta.angle_rad;
    // Slower than a hundredth of its own reach per second (or 0.5° per second) is at rest.
    const moves = way > 0.02 * reachOf(i) * span, turns = turn > 0.01 * span;
    put(tracks.time[k], moves ? MOVING : turns ? TURNING : WAITING);
  }
  const last = tracks.time[tracks.first[i + 1] - 1];
  if (last < end) put(last, WAITING);
  if (state >= 0 && end > since) tell(since, end, state);
}

function distance(i) {
  let sum = 0;
  for (let k = tracks.first[i]; k + 1 < tracks.first[i + 1]; k++) {
    sum += Math.hypot(tracks.x[k + 1] - tracks.x[k], tracks.y[k + 1] - tracks.y[k]);
  }
  return sum * meta.length_m;
}

/** Nearest approach of an agent to any other: closed form between knots. */
function nearest(i) {
  let best = { d2: Infinity };
  const { first, time, x, y } = tracks;
  for (let j = 0; j < count; j++) {
    if (j === i) continue;
    let a = first[i], b = first[j], from = 0;
    while (from < end) {
      const lastA = a + 1 >= first[i + 1], lastB = b + 1 >= first[j + 1];
      const to = Math.min(lastA ? end : time[a + 1], lastB ? end : time[b + 1]);
      const rate = (v, k, last) => last ? 0 : (v[k + 1] - v[k]) / (time[k + 1] - time[k]);
      const vx = rate(x, b, lastB) - rate(x, a, lastA), vy = rate(y, b, lastB) - rate(y, a, lastA);
      const at = (v, k, last) => v[k] + rate(v, k, last) * (from - time[k]);
      const dx = at(x, b, lastB) - at(x, a, lastA), dy = at(y, b, lastB) - at(y, a, lastA);
      const speed2 = vx * vx + vy * vy;
      const t = speed2 > 0 ? Math.min(Math.max(-(dx * vx + dy * vy) / speed2, 0), to - from) : 0;
      const d2 = (dx + vx * t) ** 2 + (dy + vy * t) ** 2;
      if (d2 < best.d2) best = { d2, other: j, time: from + t };
      from = to;
      if (!lastA && time[a + 1] <= from) a++;
      if (!lastB && time[b + 1] <= from) b++;
    }
  }
  best.m = Math.sqrt(best.d2) * meta.length_m;
  return best;
}

// ---- What the page shows -----------------------------------------------------------

let now = 0, playing = false, speed = 1;
let selected = -1, following = false;
let pointed = null; // the contact that was clicked
let hover = null; // where the mouse is on the canvas
let over = -1; // the agent there
const show = {};
let theme = {};
const stage = $('stage'), scene = $('scene'), ground = $('ground');
const [pen, groundPen] = [scene.getContext('2d'), ground.getContext('2d')];
const view = { x: 0, y: 0, scale: 1 }; // centre in metres, pixels per metre
let width = 1, height = 1, dpr = 1;
let dirty = true, groundDrawn = null, settle = 0;

function readTheme() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['page', 'card', 'ground', 'solid', 'roadmap', 'ink', 'halo', 'contact', 'moving', 'turning', 'waiting', 'parked', 'planner', 'fail-policy', 'nobody', 'workstation', 'endpoint', 'soft', 'accent']) {
    theme[name] = style.getPropertyValue('--' + name).trim();
  }
  groundDrawn = null;
  dirty = true;
}

const [minX, minY, maxX, maxY] = meta.bounds;

function fit() {
  view.x = (minX + maxX) / 2;
  view.y = (minY + maxY) / 2;
  view.scale = fitScale();
  dirty = true;
}

function fitScale() {
  return 0.95 * Math.min(width / Math.max(maxX - minX, 1e-9), height / Math.max(maxY - minY, 1e-9));
}

/** Zooms by a factor around a point of the canvas. */
function zoom(factor, px = width / 2, py = height / 2) {
  const before = view.scale;
  const most = Math.max(fitScale(), Math.min(width, height) / (4 * (largest || 1)));
  view.scale = Math.min(Math.max(before * factor, fitScale() / 4), most);
  const change = 1 / before - 1 / view.scale;
  if (!following) {
    view.x += (px - width / 2) * change;
    view.y -= (py - height / 2) * change;
  }
  dirty = true;
}

function pan(dx, dy) {
  if (following) follow(selected, false);
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  view.x = clamp(view.x - dx / view.scale, minX, maxX);
  view.y = clamp(view.y + dy / view.scale, minY, maxY);
  dirty = true;
}

const toX = (x) => (x - view.x) * view.scale + width / 2;
const toY = (y) => (view.y - y) * view.scale + height / 2;

// ---- The ground: map and paths, drawn rarely on a canvas larger than the stage --------

const MARGIN = 0.3;

function cellPath(cells) {
  const path = new Path2D();
  if (!cells) return path;
  const { rows, side, rectangles } = cells;
  for (let i = 0; i < rectangles.length; i += 4) {
    const [row, col, down, across] = rectangles.slice(i, i + 4);
    path.rect(col * side, (rows - row - down) * side, across * side, down * side);
  }
  return path;
}
const solid = cellPath(meta.cells);
const stations = [['endpoint', meta.endpoints], ['workstation', meta.workstations]].map(([name, cells]) => [name, cellPath(cells)]);
for (const polygon of meta.polygons) {
  pairs(polygon).forEach(([x, y], at) => at ? solid.lineTo(x, y) : solid.moveTo(x, y));
  solid.closePath();
}
/** What lies between the edge of the world and its box, where it is no rectangle. */
const beyond = new Path2D();
if (meta.outline.length) {
  beyond.rect(minX, minY, maxX - minX, maxY - minY);
  pairs(meta.outline).forEach(([x, y], at) => at ? beyond.lineTo(x, y) : beyond.moveTo(x, y));
  beyond.closePath();
}
const roadmap = new Path2D();
for (let i = 0; i < meta.roadmap.length; i += 4) {
  roadmap.moveTo(meta.roadmap[i], meta.roadmap[i + 1]);
  roadmap.lineTo(meta.roadmap[i + 2], meta.roadmap[i + 3]);
}

let ways = null;
/** All paths as one line per colour, made when first wanted. */
function allWays() {
  return ways ??= COLORS.map((_, color) => {
    const path = new Path2D();
    for (let i = color; i < count; i += COLORS.length) way(path, i, tracks.first[i], tracks.first[i + 1]);
    return path;
  });
}

function way(path, i, from, to) {
  for (let k = from, lastX, lastY; k < to; k++) {
    const x = tracks.x[k], y = tracks.y[k];
    if (x === lastX && y === lastY) continue;
    if (lastX === undefined) path.moveTo(x * meta.length_m, y * meta.length_m);
    else path.lineTo(x * meta.length_m, y * meta.length_m);
    lastX = x;
    lastY = y;
  }
}

function drawGround() {
  const w = width * (1 + 2 * MARGIN), h = height * (1 + 2 * MARGIN);
  const s = view.scale;
  if (ground.width !== Math.round(w * dpr) || ground.height !== Math.round(h * dpr)) {
    ground.width = Math.round(w * dpr);
    ground.height = Math.round(h * dpr);
    Object.assign(ground.style, { width: w + 'px', height: h + 'px', left: -MARGIN * width + 'px', top: -MARGIN * height + 'px' });
  }
  const c = groundPen;
  c.setTransform(1, 0, 0, 1, 0, 0);
  c.fillStyle = theme.page;
  c.fillRect(0, 0, ground.width, ground.height);
  c.setTransform(s * dpr, 0, 0, -s * dpr, (w / 2 - view.x * s) * dpr, (h / 2 + view.y * s) * dpr);
  c.lineWidth = 1 / s;
  c.fillStyle = theme.ground;
  c.fillRect(minX, minY, maxX - minX, maxY - minY);
  c.strokeStyle = theme.roadmap;
  c.strokeRect(minX, minY, maxX - minX, maxY - minY);
  for (const [name, cells] of stations) {
    c.fillStyle = theme[name];
    c.fill(cells);
  }
  c.fillStyle = theme.solid;
  c.fill(beyond, 'evenodd');
  c.stroke(roadmap);
  c.fill(solid);
  if (show.paths) {
    c.lineJoin = c.lineCap = 'round';
    c.lineWidth = Math.max(0.2 * largest, 0.7 / s);
    c.globalAlpha = Math.min(0.6, Math.max(0.25, 60 / count));
    allWays().forEach((path, color) => {
      c.strokeStyle = COLORS[color];
      c.stroke(path);
    });
    c.globalAlpha = 1;
  }
  groundDrawn = { ...view };
}

/** Moves the ground below the scene; draws it anew where moving is not enough. */
function lay() {
  const g = groundDrawn;
  const k = g ? view.scale / g.scale : 0;
  const dx = g ? (g.x - view.x) * view.scale : 0, dy = g ? (view.y - g.y) * view.scale : 0;
  const reaches = Math.abs(dx) + width / 2 <= (0.5 + MARGIN) * width * k &&
    Math.abs(dy) + height / 2 <= (0.5 + MARGIN) * height * k;
  if (!g || !reaches || k > 2) {
    drawGround();
    ground.style.transform = '';
    return;
  }
  ground.style.transform = `translate(${dx}px, ${dy}px) scale(${k})`;
  if (k !== 1) {
    clearTimeout(settle);
    settle = setTimeout(() => { groundDrawn = null; dirty = true; }, 120);
  }
}

// ---- The scene: agents, drawn all the time -------------------------------------------

const TRAIL_S = 10;

function draw() {
  const s = view.scale;
  if (following && selected >= 0) {
    view.x = X[selected];
    view.y = Y[selected];
  }
  lay();
  over = hover ? agentAt(...hover) : -1;
  scene.classList.toggle('over', over >= 0);
  const c = pen;
  c.setTransform(dpr, 0, 0, dpr, 0, 0);
  c.clearRect(0, 0, width, height);
  c.lineJoin = c.lineCap = 'round';
  const slack = largest * s + 2;
  const seen = [];
  for (let i = 0; i < count; i++) {
    const x = toX(X[i]), y = toY(Y[i]);
    if (x > -slack && y > -slack && x < width + slack && y < height + slack) seen.push(i);
  }
  c.beginPath();
  for (let i = count; i < bodies; i++) outline(c, i);
  c.fillStyle = theme.solid;
  c.fill();
  if (show.trails) trails(c, seen);
  if (show.goals) goals(c);
  for (const layer of layers) if (layer.shown) for (const annotation of layer.annotations.filter(holds)) mark(c, layer, annotation);
  if (selected >= 0) {
    selectedWay(c);
    goal(c);
  }
  COLORS.forEach((fill, color) => {
    c.beginPath();
    for (const i of seen) if (i % COLORS.length === color) outline(c, i);
    c.fillStyle = fill;
    c.fill();
  });
  if (largest * s > 5) {
    c.beginPath();
    for (const i of seen) {
      outline(c, i);
      if (meta.headings) {
        const x = toX(X[i]), y = toY(Y[i]), r = reachOf(i) * s;
        c.moveTo(x, y);
        c.lineTo(x + r * Math.cos(H[i]), y - r * Math.sin(H[i]));
      }
    }
    c.strokeStyle = theme.ink;
    c.lineWidth = Math.min(2, 0.1 * largest * s);
    c.stroke();
  }
  const touching = touchingNow();
  if (show.contacts) for (const contact of touching) cross(c, contact);
  if (pointed) for (const i of both(pointed)) ring(c, i, theme.contact);
  if (selected >= 0) ring(c, selected, theme.ink);
  if (over >= 0 && over !== selected) ring(c, over, theme.ink);
  const named = show.ids && largest * s > 7 ? seen : [selected, over].filter((i) => i >= 0);
  numbers(c, named, named === seen);
  scaleBar(c);
  return touching;
}

function outline(c, i) {
  const s = view.scale, x = toX(X[i]), y = toY(Y[i]), shape = outlineOf(i);
  const r = reachOf(i) * s;
  if (r < 2.2) {
    // A dot that can be seen is better than a true size that cannot.
    const half = Math.max(r, 1);
    c.rect(x - half, y - half, 2 * half, 2 * half);
  } else if ('r' in shape) {
    c.moveTo(x + r, y);
    c.arc(x, y, r, 0, 2 * Math.PI);
  } else {
    const cos = Math.cos(H[i]) * s, sin = Math.sin(H[i]) * s, v = shape.v;
    for (let at = 0; at < v.length; at += 2) {
      const px = x + v[at] * cos - v[at + 1] * sin, py = y - v[at] * sin - v[at + 1] * cos;
      if (at) c.lineTo(px, py); else c.moveTo(px, py);
    }
    c.closePath();
  }
}

function trails(c, seen) {
  const from = now - TRAIL_S, s = view.scale, unit = meta.length_m;
  c.lineWidth = Math.max(1, 0.5 * largest * s);
  c.globalAlpha = 0.35;
  COLORS.forEach((stroke, color) => {
    c.beginPath();
    for (const i of seen) {
      if (i % COLORS.length !== color) continue;
      c.moveTo(toX(X[i]), toY(Y[i]));
      for (let k = cursor[i]; k >= tracks.first[i]; k--) {
        let x = tracks.x[k], y = tracks.y[k];
        const since = tracks.time[k];
        if (since < from) {
          if (k + 1 < tracks.first[i + 1]) {
            const part = Math.min(1, (from - since) / (tracks.time[k + 1] - since));
            x += part * (tracks.x[k + 1] - x);
            y += part * (tracks.y[k + 1] - y);
          }
          c.lineTo(toX(x * unit), toY(y * unit));
          break;
        }
        c.lineTo(toX(x * unit), toY(y * unit));
      }
    }
    c.strokeStyle = stroke;
    c.stroke();
  });
  c.globalAlpha = 1;
}

/** The way of the selected agent from its start to its end. */
let chosenWay = { i: -1, path: null };
function selectedWay(c) {
  if (chosenWay.i !== selected) {
    chosenWay = { i: selected, path: new Path2D() };
    way(chosenWay.path, selected, tracks.first[selected], tracks.first[selected + 1]);
  }
  const s = view.scale;
  c.save();
  c.translate(width / 2 - view.x * s, height / 2 + view.y * s);
  c.scale(s, -s);
  for (const [color, wide] of [[theme.halo, 4.5], [theme.ink, 1.8]]) {
    c.strokeStyle = color;
    c.lineWidth = wide / s;
    c.stroke(chosenWay.path);
  }
  c.restore();
}

function ring(c, i, color) {
  const x = toX(X[i]), y = toY(Y[i]), r = Math.max(reachOf(i) * view.scale + 4, 9);
  for (const [stroke, wide] of [[theme.halo, 5], [color, 2.5]]) {
    c.beginPath();
    c.arc(x, y, r, 0, 2 * Math.PI);
    c.strokeStyle = stroke;
    c.lineWidth = wide;
    c.stroke();
  }
}

/** True if an annotation is about now, and about the agent that is followed if only those are wanted.
 * While playing, short ones linger so that they can be seen. */
function holds({ from, to, agent }) {
  const linger = playing ? 0.4 * speed : 0;
  const own = !$('own').checked || selected < 0 || agent === meta.ids[selected];
  return own && now >= from - 1e-9 && now <= Math.max(to, from + linger) + 1e-9;
}

/** Side of a cell, or what stands for it. */
const side = meta.cells?.side ?? 2 * largest;

function mark(c, layer, { shape, shapes, values }) {
  const s = view.scale, half = Math.max(0.42 * side * s, 4), r = Math.max(0.2 * side * s, 3);
  c.lineWidth = Math.max(1.6, 0.06 * side * s);
  shapes.forEach((points, number) => {
    c.strokeStyle = c.fillStyle = shade(layer, values[number]);
    c.beginPath();
    if (shape !== 'points' && points.length > 1) {
      points.forEach(([x, y], at) => at ? c.lineTo(toX(x), toY(y)) : c.moveTo(toX(x), toY(y)));
      if (shape === 'rings') c.closePath();
      c.stroke();
      c.globalAlpha = 0.15;
      if (shape === 'rings') c.fill();
    } else if (points.length === 1 && (shape === 'lines' || shape === 'rings')) {
      c.fillRect(toX(points[0][0]) - 1.5, toY(points[0][1]) - 1.5, 3, 3);
    }
    if (shape === 'points' || shape === 'places') {
      c.beginPath();
      for (const [x, y] of points) {
        if (shape === 'places') {
          c.rect(toX(x) - half, toY(y) - half, 2 * half, 2 * half);
        } else {
          c.moveTo(toX(x) + r, toY(y));
          c.arc(toX(x), toY(y), r, 0, 2 * Math.PI);
        }
      }
      c.globalAlpha = 0.3;
      c.fill();
      c.globalAlpha = 1;
      c.stroke();
    }
    c.globalAlpha = 1;
  });
}

/** The colour of a shape, by its value if it has one. The lightest steps vanish on white. */
function shade({ color, range }, value) {
  if (value === undefined || !range) return color;
  const [least, most] = range, steps = meta.heat.length - 3;
  const part = most > least ? (value / 2 - least / 2) / (most / 2 - least / 2) : 1;
  return meta.heat[2 + Math.min(Math.floor(part * steps), steps)];
}

/** Where agents want to go, as squares of their colours. */
function goals(c) {
  const half = Math.max(0.3 * largest * view.scale, 2.5);
  COLORS.forEach((fill, color) => {
    c.beginPath();
    for (let i = color; i < count; i += COLORS.length) {
      const place = goalAt(i, now);
      if (place) c.rect(toX(place.x) - half, toY(place.y) - half, 2 * half, 2 * half);
    }
    c.strokeStyle = fill;
    c.lineWidth = Math.max(1.2, 0.4 * half);
    c.stroke();
  });
}

/** Where the selected agent wants to go. */
function goal(c) {
  const place = goalAt(selected, now);
  if (!place) return;
  const [x, y] = [toX(place.x), toY(place.y)];
  const half = Math.max(0.4 * largest * view.scale, 4);
  c.beginPath();
  c.setLineDash([5, 5]);
  c.moveTo(toX(X[selected]), toY(Y[selected]));
  c.lineTo(x, y);
  c.strokeStyle = theme.ink;
  c.lineWidth = 1.5;
  c.stroke();
  c.setLineDash([]);
  c.fillStyle = COLORS[selected % COLORS.length];
  c.fillRect(x - half, y - half, 2 * half, 2 * half);
  c.strokeRect(x - half, y - half, 2 * half, 2 * half);
}

/** A cross in a ring between two agents, or on the one that touches an obstacle or an agent that is not shown. */
function cross(c, contact) {
  const ends = both(contact);
  if (!ends.length) return;
  const x = toX(ends.reduce((sum, i) => sum + X[i], 0) / ends.length);
  const y = toY(ends.reduce((sum, i) => sum + Y[i], 0) / ends.length);
  const r = Math.max(0.6 * largest * view.scale, 9), arm = 0.45 * r;
  for (const [stroke, wide] of [[theme.halo, 5], [theme.contact, 2.5]]) {
    c.beginPath();
    c.arc(x, y, r, 0, 2 * Math.PI);
    c.moveTo(x - arm, y - arm);
    c.lineTo(x + arm, y + arm);
    c.moveTo(x - arm, y + arm);
    c.lineTo(x + arm, y - arm);
    c.strokeStyle = stroke;
    c.lineWidth = wide;
    c.stroke();
  }
}

/** The bodies of a contact that are shown, as indices. */
function both(contact) {
  return [contact.a, contact.b].map((id) => indexOf.get(id) ?? -1).filter((i) => i >= 0);
}

/** Contacts now; while playing, short ones linger so that they can be seen. */
function touchingNow() {
  const linger = playing ? 0.4 * speed : 0;
  const out = [];
  for (const contact of contacts) {
    if (contact.from > now) break;
    if (now <= Math.max(contact.to, contact.from + linger)) out.push(contact);
  }
  return out;
}

function numbers(c, agents, inside) {
  const size = inside ? Math.min(Math.max(0.8 * largest * view.scale, 9), 22) : 13;
  c.font = `600 ${size}px system-ui, sans-serif`;
  c.textAlign = 'center';
  c.textBaseline = 'middle';
  c.lineWidth = 3;
  c.strokeStyle = theme.halo;
  c.fillStyle = theme.ink;
  for (const i of agents) {
    const x = toX(X[i]), r = reachOf(i) * view.scale;
    const y = inside ? toY(Y[i]) : toY(Y[i]) - Math.max(r, 5) - 13;
    c.strokeText(meta.ids[i], x, y);
    c.fillText(meta.ids[i], x, y);
  }
}

function scaleBar(c) {
  const most = 0.25 * width / view.scale;
  const power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].find((digit) => digit * power <= most) * power;
  const text = length >= 1000 ? `${length / 1000} km` : length >= 1 ? `${length} m` : `${+(length * 1000).toPrecision(1)} mm`;
  const x = 12.5, y = height - 12.5, w = length * view.scale;
  c.font = '12px system-ui, sans-serif';
  c.textAlign = 'left';
  c.textBaseline = 'alphabetic';
  const wide = Math.max(w, c.measureText(text).width + 4);
  c.globalAlpha = 0.85;
  c.fillStyle = theme.card;
  c.fillRect(x - 6, y - 20, wide + 12, 26);
  c.globalAlpha = 1;
  c.beginPath();
  c.moveTo(x, y - 5);
  c.lineTo(x, y);
  c.lineTo(x + w, y);
  c.lineTo(x + w, y - 5);
  c.strokeStyle = theme.ink;
  c.lineWidth = 1.5;
  c.stroke();
  c.fillStyle = theme.ink;
  c.fillText(text, x + 4, y - 5);
}

// ---- Time ----------------------------------------------------------------------------

let lastFrame = 0;
const cost = { frames: 0, ms: 0, worst_ms: 0 };

function frame(clock) {
  requestAnimationFrame(frame);
  if (playing) {
    // A tab that was hidden does not jump.
    now = Math.min(now + Math.min((clock - lastFrame) / 1000, 0.25) * speed, end);
    if (now >= end) play(false);
    dirty = true;
  }
  lastFrame = clock;
  if (!dirty) return;
  dirty = false;
  const start = performance.now();
  place(now);
  const touching = draw();
  told(touching);
  const spent = performance.now() - start;
  cost.frames++;
  cost.ms += spent;
  cost.worst_ms = Math.max(cost.worst_ms, spent);
}

const digits = end < 10 ? 2 : 1;
const shown = (time) => time.toFixed(digits) + ' s';

/** Brings what is around the canvas up to date. */
function told(touching) {
  const text = `${now.toFixed(digits)} / ${shown(end)}`;
  if ($('clock').textContent !== text) $('clock').textContent = text;
  $('seek').value = now;
  $('seek').setAttribute('aria-valuetext', `${shown(now)} of ${shown(end)}`);
  $('fleet-now').style.left = 100 * (end ? now / end : 0) + '%';
  if (selected >= 0) drawTimeline();
  if (work) tellWork();
  if (layers.length) tellLayers();
  const current = new Set(touching);
  for (const [contact, button] of rows) {
    const on = current.has(contact) || contact === pointed;
    if ((button.getAttribute('aria-current') === 'true') !== on) button.setAttribute('aria-current', on);
  }
}

function say(text) { $('status').textContent = text; }

function play(on) {
  if (on && now >= end) now = 0;
  if (on) pointed = null;
  playing = on;
  $('play').setAttribute('aria-label', on ? 'Pause' : 'Play');
  $('play-icon').setAttribute('d', on ? 'M3 2h4v12H3zM9 2h4v12H9z' : 'M4 2l10 6-10 6z');
  say(on ? 'playing' : `paused at ${shown(now)}`);
  dirty = true;
}

function seek(time) {
  now = Math.min(Math.max(Number.isFinite(time) ? time : 0, 0), end);
  pointed = null;
  dirty = true;
}

function setSpeed(value) {
  speed = value;
  $('speed').value = String(value);
}

function otherSpeed(step) {
  const at = Math.min(Math.max(SPEEDS.indexOf(speed) + step, 0), SPEEDS.length - 1);
  setSpeed(SPEEDS[at]);
  say(`speed ${speed}×`);
}

// ---- Agents ----------------------------------------------------------------------------

function agentAt(px, py) {
  let best = -1, least = Infinity;
  for (let i = 0; i < count; i++) {
    const d = Math.hypot(toX(X[i]) - px, toY(Y[i]) - py);
    if (d < least && d <= Math.max(reachOf(i) * view.scale, 12)) {
      best = i;
      least = d;
    }
  }
  return best;
}

/** Selects an agent (by its index; -1 is none), and follows it or not. */
function follow(i, on) {
  following = on && i >= 0;
  if (i !== selected) {
    selected = i;
    $('only-box').hidden = i < 0 || !contacts.length;
    if (i < 0) $('only').checked = false;
    listContacts();
    describe();
  }
  $('pick').value = i < 0 ? '' : meta.ids[i];
  $('chip').hidden = i < 0;
  if (i >= 0) {
    $('chip-text').textContent = `${following ? 'Following' : 'Agent'} ${meta.ids[i]}`;
    say(following ? `following agent ${meta.ids[i]}` : `agent ${meta.ids[i]} selected`);
  } else {
    say('no agent selected');
  }
  dirty = true;
}

// ---- The fleet -----------------------------------------------------------------------

const INTERVALS = 60;
/** How many seconds the current throughput is of. */
const RECENT_S = 60;

/** The rows of the list of calls that are on the page. */
let callRows = [];
let callsListed = LIST_STEP;

/** Sets what a list of terms says, where it says something else. */
function tell(list, rows) {
  const text = JSON.stringify(rows);
  if (list.dataset.told === text) return;
  list.dataset.told = text;
  list.replaceChildren(...rows.flatMap(([name, value]) => [['dt', name], ['dd', value]]
    .map(([tag, textContent]) => Object.assign(document.createElement(tag), { textContent }))));
}

/** What the fleet and the selected agent are at. */
function tellWork() {
  const reached = until(work.reached, now);
  const since = Math.max(0, now - RECENT_S);
  const recent = reached - (since > 0 ? until(work.reached, since) : 0);
  const perSecond = (goals, time) => time > 0 ? `${(goals / time).toFixed(2)} per second` : '–';
  const asked = until(work.calls, now, (call) => call.asked);
  const last = work.calls[asked - 1];
  const isOpen = last && (last.answered === null || last.answered > now + 1e-9);
  tell($('work'), [
    ['goals', `${reached}, ${perSecond(reached, now)}`],
    [`last ${Math.round(now - since) || RECENT_S} s`, perSecond(recent, now - since)],
    ['calls', `${asked}, ${until(troubles, now, (call) => call.asked)} with trouble`],
    ['planning', isOpen ? `call ${last.number}, since ${shown(last.asked)}` : 'no'],
  ]);
  for (const canvas of ['throughput', 'call-times']) drawOverTime($(canvas));
  for (const [call, button] of callRows) {
    const on = call.asked <= now + 1e-9 && now < (call.answered ?? end) - 1e-9;
    if ((button.getAttribute('aria-current') === 'true') === on) continue;
    button.setAttribute('aria-current', on);
    if (on) reveal(button);
  }
  if (selected < 0) return;
  const own = work.goals[selected] ?? [], goal = goalAt(selected, now);
  const task = goal?.task;
  tell($('job'), [
    ['goal', goal ? `row ${goal.row}, column ${goal.col}, since ${shown(goal.from)}` : 'none'],
    ...(task ? [['task', `${task[0]}, goal ${task[1] + 1} of ${task[2]}`]] : []),
    ['reached', `${until(own.filter(({ to }) => to !== null), now, ({ to }) => to)} goals`],
  ]);
}

/** Scrolls a list, and nothing around it, so that a row can be seen. */
function reveal(row) {
  const list = row.closest('ol'), [inside, outside] = [row, list].map((node) => node.getBoundingClientRect());
  list.scrollTop += Math.min(0, inside.top - outside.top) + Math.max(0, inside.bottom - outside.bottom);
}

/** Pictures of the whole run, drawn once; the time is laid over them. */
const overTime = new Map();

function drawOverTime(canvas) {
  const [c, w, h] = sized(canvas);
  const key = `${w} ${h} ${theme.ink}`;
  let whole = overTime.get(canvas);
  if (whole?.key !== key) {
    const picture = Object.assign(document.createElement('canvas'), { width: Math.max(w, 1), height: Math.max(h, 1) });
    (canvas.id === 'throughput' ? drawThroughput : drawCalls)(picture.getContext('2d'), w, h);
    whole = { key, picture };
    overTime.set(canvas, whole);
  }
  c.clearRect(0, 0, w, h);
  c.drawImage(whole.picture, 0, 0);
  c.fillStyle = theme.ink;
  c.fillRect((end ? now / end : 0) * w - dpr, 0, 2 * dpr, h);
}

/** Goals per second in equal intervals, and their mean. */
function drawThroughput(c, w, h) {
  const width = end / INTERVALS;
  const rates = Array.from({ length: end > 0 ? INTERVALS : 0 }, (_, at) =>
    (until(work.reached, (at + 1) * width) - (at ? until(work.reached, at * width) : 0)) / width);
  const most = Math.max(...rates, 1e-9), mean = end > 0 ? work.reached.length / end : 0;
  const top = 13 * dpr, high = (rate) => rate / most * (h - top);
  c.fillStyle = theme.moving;
  rates.forEach((rate, at) => {
    const from = Math.round(at * w / INTERVALS), to = Math.round((at + 1) * w / INTERVALS);
    c.fillRect(from, h - high(rate), Math.max(to - from - dpr, 1), high(rate));
  });
  c.setLineDash([4 * dpr, 3 * dpr]);
  c.strokeStyle = theme.ink;
  c.lineWidth = dpr;
  c.beginPath();
  c.moveTo(0, h - high(mean));
  c.lineTo(w, h - high(mean));
  c.stroke();
  c.font = `${11 * dpr}px system-ui, sans-serif`;
  c.textBaseline = 'top';
  c.fillStyle = theme.soft;
  c.fillText(`${most.toFixed(2)} at most, ${mean.toFixed(2)} on average`, 0, 0);
  $('throughput').setAttribute('aria-label', `Goals per second over time: ${mean.toFixed(2)} on average, ${most.toFixed(2)} at most`);
}

/** Calls as bars of different height, those with trouble over the others. */
function drawCalls(c, w, h) {
  const tall = { planner: 0.3, 'fail-policy': 0.65, nobody: 1 };
  for (const by of Object.keys(tall)) {
    c.fillStyle = theme[by];
    for (const call of work.calls) {
      if (call.by !== by) continue;
      const from = end ? call.asked / end * w : 0, to = end ? call.answered / end * w : 0;
      c.fillRect(from, h - tall[by] * h, Math.max(to - from - dpr, 1.5 * dpr), tall[by] * h);
    }
  }
  const of = (by) => work.calls.filter((call) => call.by === by).length;
  $('call-times').setAttribute('aria-label', `${work.calls.length} calls over time: ` +
    Object.keys(tall).map((by) => `${of(by)} answered by ${BY[by]}`).join(', '));
}

function listCalls() {
  const wanted = $('failed').checked ? troubles : work.calls;
  const add = (parent, tag, textContent, className = '') =>
    parent.appendChild(Object.assign(document.createElement(tag), { textContent, className }));
  const list = $('calls');
  list.replaceChildren();
  callRows = wanted.slice(0, callsListed).map((call) => {
    const button = add(add(list, 'li', ''), 'button', '');
    button.type = 'button';
    add(button, 'span', shown(call.asked));
    const who = add(button, 'span', '');
    const swatch = call.by === null ? 'waiting' : call.by;
    add(who, 'span', '', 'swatch ' + swatch);
    who.append(`${isTrouble(call) ? '✕ ' : ''}${call.by === null ? 'not answered' : BY[call.by]}`);
    const took = [call.planner, call.fail].map((ms) => ms === null ? '' : `${+ms.toPrecision(3)} ms`);
    add(button, 'small', took.filter((text) => text).join(' + '));
    for (const { name, module, message } of call.said) add(button, 'span', `${name} (${module}): ${message}`, 'said');
    button.title = `call ${call.number}` + (call.answered === null ? '' : `, answered at ${shown(call.answered)}`);
    button.addEventListener('click', () => jumpToCall(call));
    return [call, button];
  });
  if (!wanted.length) add(list, 'li', 'None.', 'none');
  $('more-calls').hidden = wanted.length <= callsListed;
  dirty = true;
}

function jumpToCall(call) {
  play(false);
  seek(call.asked);
  say(`call ${call.number} at ${shown(call.asked)}, answered by ${call.by === null ? 'nobody yet' : BY[call.by]}`);
}

function nextTrouble(step) {
  const later = step > 0
    ? troubles.find((call) => call.asked > now + 1e-6)
    : troubles.findLast((call) => call.asked < now - 1e-6);
  if (later) jumpToCall(later);
}

let timeline = null;

function describe() {
  $('agent-none').hidden = selected >= 0;
  $('agent-some').hidden = selected < 0;
  if (selected < 0) return;
  const i = selected, id = meta.ids[i];
  const spent = STATES.map(() => 0), parts = [];
  stretches(i, (from, to, state) => {
    spent[state] += to - from;
    parts.push([from, to, state]);
  });
  const own = contacts.filter(({ a, b }) => a === id || b === id);
  // Contacts may overlap; the time in contact is that of their union.
  let touched = 0, until = 0;
  for (const { from, to } of own) {
    touched += Math.max(0, to - Math.max(from, until));
    until = Math.max(until, to);
  }
  timeline = { parts, own };
  const list = $('figures');
  list.replaceChildren();
  const put = (name, value, swatch) => {
    const term = document.createElement('dt'), text = document.createElement('dd');
    if (swatch) term.append(Object.assign(document.createElement('span'), { className: 'swatch ' + swatch }));
    term.append(name);
    text.append(value);
    list.append(term, text);
    return text;
  };
  const share = (time) => `${shown(time)} (${Math.round(100 * time / (end || 1))} %)`;
  put('moving', share(spent[MOVING]), 'moving');
  if (meta.headings) put('turning', share(spent[TURNING]), 'turning');
  put('waiting', share(spent[WAITING]), 'waiting');
  if (meta.arrivals.length) put('parked', share(spent[PARKED]), 'parked');
  put('in contact', own.length ? `${shown(touched)} in ${own.length} contact${own.length > 1 ? 's' : ''}` : 'never', 'contact');
  const arrived = meta.arrivals[i];
  if (meta.arrivals.length) put('arrived', arrived === null ? 'never' : `at ${shown(arrived)}`);
  put('travelled', `${distance(i).toFixed(1)} m`);
  const near = put('nearest', '…');
  $('timeline').setAttribute('aria-label', `Agent ${id} over time: moving ${share(spent[MOVING])}, ` +
    `turning ${share(spent[TURNING])}, waiting ${share(spent[WAITING])}, parked ${share(spent[PARKED])}, ${own.length} contacts`);
  // Long recordings of many agents take a moment.
  setTimeout(() => {
    if (selected !== i) return;
    const best = nearest(i);
    if (best.other === undefined) return void (near.textContent = 'alone');
    const jump = document.createElement('button');
    jump.type = 'button';
    jump.textContent = shown(best.time);
    jump.addEventListener('click', () => { play(false); seek(best.time); });
    near.replaceChildren(`${best.m.toFixed(2)} m between centres, to agent ${meta.ids[best.other]} at `, jump);
  }, 30);
}

function sized(canvas) {
  const w = Math.round(canvas.clientWidth * dpr), h = Math.round(canvas.clientHeight * dpr);
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  return [canvas.getContext('2d'), w, h];
}

/** States as bars of different height, so that colour is not all that tells them apart. */
function drawTimeline() {
  const [c, w, h] = sized($('timeline'));
  c.clearRect(0, 0, w, h);
  const at = (time) => end ? time / end * w : 0;
  const tall = [1, 0.65, 0.3, 0.12].map((part) => part * 0.72 * h);
  for (const [from, to, state] of timeline.parts) {
    c.fillStyle = theme[STATES[state]];
    c.fillRect(at(from), h - tall[state], Math.max(at(to) - at(from), 0.5), tall[state]);
  }
  c.fillStyle = theme.contact;
  for (const { from, to } of timeline.own) c.fillRect(at(from), 0, Math.max(at(to) - at(from), 2 * dpr), 0.2 * h);
  c.fillStyle = theme.ink;
  c.fillRect(at(now) - dpr, 0, 2 * dpr, h);
}

function drawFleet() {
  const canvas = $('fleet');
  const w = 640, h = Math.min(Math.max(count, 1), 600);
  const rgb = STATES.concat('contact').map((name) => {
    const c = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
    c.fillStyle = theme[name];
    c.fillRect(0, 0, 1, 1);
    return c.getImageData(0, 0, 1, 1).data;
  });
  Object.assign(canvas, { width: w, height: h });
  const c = canvas.getContext('2d'), image = c.createImageData(w, h);
  const put = (row, from, to, color) => {
    const last = Math.min(w - 1, Math.max(Math.floor(from / end * w), Math.ceil(to / end * w) - 1));
    for (let x = Math.floor(from / end * w); x <= last; x++) image.data.set(color, 4 * (row * w + x));
  };
  if (end > 0) {
    for (let row = 0; row < h && count; row++) {
      // Where there are more agents than rows, some are left out.
      const i = Math.floor(row * count / h);
      stretches(i, (from, to, state) => put(row, from, to, rgb[state]));
    }
    for (const contact of contacts) {
      for (const i of both(contact).filter((i) => i < count)) put(Math.min(h - 1, Math.floor(i * h / count)), contact.from, contact.to, rgb[STATES.length]);
    }
  }
  c.putImageData(image, 0, 0);
  canvas.style.imageRendering = h < 150 ? 'pixelated' : 'auto';
  $('fleet-frame').style.height = Math.min(150, Math.max(24, 14 * count)) + 'px';
}

// ---- Annotations --------------------------------------------------------------------------

const TOLD = 100;

function listLayers() {
  for (const layer of layers) {
    const label = document.createElement('label');
    const box = Object.assign(document.createElement('input'), { type: 'checkbox', checked: true });
    const swatch = document.createElement('i'), count = document.createElement('small');
    swatch.style.background = layer.color;
    label.append(box, swatch, layer.name, count);
    if (layer.range) {
      const scale = Object.assign(document.createElement('i'), { className: 'scale' });
      scale.style.background = `linear-gradient(to right, ${meta.heat.slice(2).join(',')})`;
      const [least, most] = layer.range.map((value) => Object.assign(document.createElement('small'), { textContent: +value.toPrecision(4) }));
      label.append(least, scale, most);
    }
    box.addEventListener('change', () => {
      layer.shown = box.checked;
      dirty = true;
    });
    layer.count = count;
    const row = document.createElement('li');
    row.append(label);
    $('layers').append(row);
  }
}

/** What is on the list. */
let toldNow = [];

function tellLayers() {
  $('own-box').hidden = selected < 0;
  const wanted = [];
  for (const layer of layers) {
    const current = layer.annotations.filter(holds);
    const text = `${current.length} of ${layer.annotations.length}`;
    if (layer.count.textContent !== text) layer.count.textContent = text;
    if (layer.shown) for (const annotation of current) if (annotation.text && wanted.length < TOLD) wanted.push([layer, annotation]);
  }
  if (wanted.length === toldNow.length && wanted.every(([, a], at) => a === toldNow[at][1])) return;
  toldNow = wanted;
  $('annotations').replaceChildren(...wanted.map(([layer, { agent, text }]) => {
    const button = Object.assign(document.createElement('button'), { type: 'button' });
    const [who, what, where] = ['span', 'span', 'small'].map((tag) => document.createElement(tag));
    who.textContent = agent === null ? '' : `agent ${agent}`;
    what.textContent = text;
    where.textContent = layer.name;
    button.append(who, what, where);
    button.disabled = !indexOf.has(agent);
    button.addEventListener('click', () => follow(indexOf.get(agent), true));
    const row = document.createElement('li');
    row.append(button);
    return row;
  }));
}

// ---- Contacts ----------------------------------------------------------------------------

/** The rows of the list that are on the page. */
let rows = [];
let listed = LIST_STEP;

function listContacts() {
  const id = selected >= 0 && $('only').checked ? meta.ids[selected] : null;
  const wanted = id === null ? contacts : contacts.filter(({ a, b }) => a === id || b === id);
  const list = $('contacts');
  list.replaceChildren();
  rows = wanted.slice(0, listed).map((contact) => {
    const button = document.createElement('button');
    button.type = 'button';
    const [when, who, long] = ['span', 'span', 'small'].map((tag) => document.createElement(tag));
    when.textContent = contact.from.toFixed(2) + ' s';
    who.textContent = `${contact.a} × ${isAgent(contact.b) ? contact.b : nameOf(contact.b)}`;
    long.textContent = contact.open ? 'to the end' : (contact.to - contact.from).toFixed(2) + ' s';
    button.setAttribute('aria-label', `at ${when.textContent}: agent ${contact.a} and ` +
      `${nameOf(contact.b)}, ${long.textContent}`);
    button.append(when, who, long);
    button.addEventListener('click', () => jump(contact));
    const row = document.createElement('li');
    row.append(button);
    list.append(row);
    return [contact, button];
  });
  if (!wanted.length) {
    list.append(Object.assign(document.createElement('li'), { className: 'none', textContent: 'None.' }));
  }
  const total = id === null ? meta.contacts_total : wanted.length;
  $('contact-count').textContent = total ? `(${total})` : '';
  $('more').hidden = wanted.length <= listed;
  dirty = true;
}

/** Shows a contact: its moment, its place, its two. */
function jump(contact) {
  play(false);
  seek(contact.from);
  pointed = contact;
  const ends = both(contact);
  if (following) follow(selected, false);
  place(now);
  if (ends.length) {
    view.x = ends.reduce((sum, i) => sum + X[i], 0) / ends.length;
    view.y = ends.reduce((sum, i) => sum + Y[i], 0) / ends.length;
    // Near enough to see who touches whom.
    if (largest * view.scale < 8) view.scale = 8 / largest;
  }
  say(`contact of agent ${contact.a} and ${nameOf(contact.b)} at ${shown(contact.from)}`);
  dirty = true;
}

function nextContact(step) {
  const later = step > 0
    ? contacts.find((contact) => contact.from > now + 1e-6)
    : contacts.findLast((contact) => contact.from < now - 1e-6);
  if (later) jump(later);
}

function drawMarks() {
  const [c, w, h] = sized($('marks'));
  c.clearRect(0, 0, w, h);
  c.fillStyle = theme.contact;
  // The thumb's middle runs from 8 pixels to 8 pixels before the end.
  const inset = 8 * dpr;
  let last = -1;
  for (const { from } of contacts) {
    const x = Math.round(inset + (end ? from / end : 0) * (w - 2 * inset));
    if (x !== last) c.fillRect(x - dpr, 0, 2 * dpr, 0.22 * h);
    last = x;
  }
  c.fillStyle = theme['fail-policy'];
  for (const { asked } of troubles) c.fillRect(inset + (end ? asked / end : 0) * (w - 2 * inset) - dpr, 0.82 * h, 2 * dpr, 0.18 * h);
}

// ---- The user ------------------------------------------------------------------------------

const onClick = (id, action) => $(id).addEventListener('click', action);
onClick('play', () => play(!playing));
onClick('earlier', () => nextContact(-1));
onClick('later', () => nextContact(1));
onClick('zoom-in', () => zoom(1.5));
onClick('zoom-out', () => zoom(1 / 1.5));
onClick('fit', () => { if (following) follow(selected, false); fit(); });
onClick('release', () => follow(-1, false));
onClick('more-calls', () => { callsListed += LIST_STEP; listCalls(); });
onClick('more', () => { listed += LIST_STEP; listContacts(); });
$('only').addEventListener('change', listContacts);
$('failed').addEventListener('change', listCalls);
$('own').addEventListener('change', () => { dirty = true; });
$('seek').addEventListener('input', () => seek(Number($('seek').value)));
$('speed').addEventListener('change', () => setSpeed(Number($('speed').value)));
$('pick').addEventListener('change', () => {
  const text = $('pick').value.trim();
  const i = text === '' || !isAgent(Number(text)) ? -1 : indexOf.get(Number(text)) ?? -1;
  if (text !== '' && i < 0) say(`there is no agent ${text}`);
  follow(i, true);
});
const timeUnder = (event) => {
  const box = event.currentTarget.getBoundingClientRect();
  return (event.clientX - box.left) / box.width * end;
};
for (const id of ['timeline', 'throughput', 'call-times']) $(id).addEventListener('click', (event) => seek(timeUnder(event)));
$('fleet').addEventListener('click', (event) => {
  const box = $('fleet').getBoundingClientRect();
  const i = Math.floor((event.clientY - box.top) / box.height * count);
  seek(timeUnder(event));
  follow(Math.min(Math.max(i, 0), count - 1), true);
});

const setting = {
  trails: count <= 2000,
  paths: false,
  ids: false,
  contacts: true,
  goals: Boolean(work) && count <= 300,
};
for (const name of Object.keys(setting)) {
  const box = $('show-' + name);
  box.checked = show[name] = setting[name];
  box.addEventListener('change', () => {
    show[name] = box.checked;
    groundDrawn = null;
    dirty = true;
  });
}

// Fingers and the mouse: one drags, two pinch, a short touch selects.
const pointers = new Map();
let travelled = 0;
const local = (event) => {
  const box = scene.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};
scene.addEventListener('pointerdown', (event) => {
  if (event.button > 0) return;
  try { scene.setPointerCapture(event.pointerId); } catch { /* a pointer made by a script */ }
  if (!pointers.size) travelled = 0;
  pointers.set(event.pointerId, local(event));
  hover = null;
});
scene.addEventListener('pointermove', (event) => {
  const to = local(event), from = pointers.get(event.pointerId);
  if (!from) {
    hover = event.pointerType === 'mouse' ? to : null;
    if ((hover ? agentAt(...to) : -1) !== over) dirty = true;
    return;
  }
  const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
  travelled += Math.hypot(to[0] - from[0], to[1] - from[1]);
  pointers.set(event.pointerId, to);
  if (others.length) {
    const [px, py] = others[0];
    const apart = (at) => Math.max(Math.hypot(at[0] - px, at[1] - py), 1);
    zoom(apart(to) / apart(from), (to[0] + px) / 2, (to[1] + py) / 2);
    if (!following) pan((to[0] - from[0]) / 2, (to[1] - from[1]) / 2);
  } else if (travelled > 6) {
    scene.classList.add('dragging');
    pan(to[0] - from[0], to[1] - from[1]);
  }
});
const lift = (event) => {
  if (!pointers.delete(event.pointerId)) return;
  if (event.type === 'pointerup' && travelled <= 6 && !pointers.size) {
    const found = agentAt(...local(event));
    if (found >= 0) follow(found, true);
  }
  if (!pointers.size) scene.classList.remove('dragging');
};
scene.addEventListener('pointerup', lift);
scene.addEventListener('pointercancel', lift);
scene.addEventListener('pointerleave', () => { hover = null; dirty = true; });
scene.addEventListener('wheel', (event) => {
  event.preventDefault();
  const lines = event.deltaMode === 1 ? 20 : 1;
  zoom(Math.exp(-0.0015 * lines * event.deltaY), ...local(event));
}, { passive: false });

scene.addEventListener('keydown', (event) => {
  const way = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
  if (way) {
    pan(...way);
    event.preventDefault();
    event.stopPropagation();
  }
});
document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const tag = event.target.tagName, type = event.target.type;
  // Fields keep the keys that they understand themselves.
  if (tag === 'SELECT' || type === 'number') return;
  if (event.key === ' ' && (tag === 'BUTTON' || tag === 'SUMMARY' || type === 'checkbox')) return;
  const by = (step) => () => { play(false); seek(now + step); };
  const jumpBy = (step) => () => seek(now + (event.shiftKey ? 10 : 1) * step);
  const action = {
    ' ': () => play(!playing), k: () => play(!playing),
    ArrowLeft: jumpBy(-1), ArrowRight: jumpBy(1),
    ',': by(-1 / 60), '.': by(1 / 60),
    Home: () => seek(0), End: () => seek(end),
    '[': () => otherSpeed(-1), ']': () => otherSpeed(1),
    c: () => nextTrouble(event.shiftKey ? -1 : 1),
    p: () => nextContact(-1), n: () => nextContact(1),
    '+': () => zoom(1.25), '=': () => zoom(1.25), '-': () => zoom(0.8), 0: () => { if (following) follow(selected, false); fit(); },
    Escape: () => follow(-1, false),
  }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (action) {
    action();
    event.preventDefault();
  }
});

// ---- Beginning -------------------------------------------------------------------------------

function resize() {
  const [w, h] = [Math.max(stage.clientWidth, 2), Math.max(stage.clientHeight, 2)];
  const fine = Math.min(window.devicePixelRatio || 1, 3);
  if (w === width && h === height && fine === dpr) return;
  const whole = width === 1 || Math.abs(view.scale - fitScale()) < 1e-9 * view.scale;
  [width, height, dpr] = [w, h, fine];
  // A canvas that changes its size is blank, so it is drawn at once.
  Object.assign(scene, { width: Math.round(width * dpr), height: Math.round(height * dpr) });
  if (whole) fit();
  groundDrawn = null;
  drawMarks();
  redraw();
}

function redraw() {
  place(now);
  told(draw());
}

function repaint() {
  readTheme();
  drawMarks();
  drawFleet();
}

for (const value of SPEEDS) {
  $('speed').append(Object.assign(document.createElement('option'), { value, textContent: value + '×' }));
}
setSpeed(1);
$('seek').max = end;
$('brief').textContent = `${count} agent${count === 1 ? '' : 's'}, ${shown(end)}, ` +
  (work ? `${work.reached.length} goal${work.reached.length === 1 ? '' : 's'}, ` : '') +
  (meta.contacts_total ? `${meta.contacts_total} contact${meta.contacts_total === 1 ? '' : 's'}` : 'no contacts');
for (const [name, value] of meta.facts) {
  const [term, text] = ['dt', 'dd'].map((tag) => document.createElement(tag));
  term.textContent = name;
  text.textContent = value;
  $('facts').append(term, text);
}
for (const note of meta.notes) {
  $('notes').append(Object.assign(document.createElement('li'), { textContent: note }));
}
$('work-box').hidden = !work;
$('layers-box').hidden = !layers.length;
listLayers();
$('failed-box').hidden = !troubles.length;
$('show-goals').parentNode.hidden = !work && !meta.goals.length;
$('workstations').hidden = !meta.workstations;
$('endpoints').hidden = !meta.endpoints;
$('stations').hidden = !meta.workstations && !meta.endpoints;
if (work) listCalls();
if (!contacts.length) $('earlier').disabled = $('later').disabled = true;
if (!meta.headings) document.querySelector('#legend li:nth-child(2)').remove();

stage.style.setProperty('--tall', (maxY - minY) / Math.max(maxX - minX, 1e-9));
repaint();
listContacts();
resize();
new ResizeObserver(resize).observe(stage);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', repaint);
const paper = () => { repaint(); resize(); redraw(); };
addEventListener('beforeprint', paper);
addEventListener('afterprint', paper);

// `page.html#t=12.5&agent=3&speed=10&play` begins there.
const wish = new URLSearchParams(location.hash.slice(1));
if (wish.has('t')) seek(Number(wish.get('t')));
if (wish.has('agent')) follow(indexOf.get(Number(wish.get('agent'))) ?? -1, true);
if (wish.has('zoom') && Number(wish.get('zoom')) > 0) zoom(Number(wish.get('zoom')));
for (const name of Object.keys(setting)) if (wish.has(name)) $('show-' + name).click();
if (SPEEDS.includes(Number(wish.get('speed')))) setSpeed(Number(wish.get('speed')));
if (wish.has('play')) play(true);
requestAnimationFrame(frame);

// For scripts that drive the page, to make the frames of a film for example.
globalThis.replay = {
  play, seek, follow: (id) => follow(indexOf.get(id) ?? -1, true), zoom, fit, cost,
  /** Draws at once instead of at the next frame. */
  draw: redraw,
  pose: (id) => { const i = indexOf.get(id); place(now); return [X[i], Y[i], H[i]]; },
  onScreen: (id) => { const i = indexOf.get(id); return [toX(X[i]), toY(Y[i])]; },
  get state() {
    return { now, playing, speed, agent: meta.ids[selected] ?? null, following, scale: view.scale, x: view.x, y: view.y, pointed };
  },
};
})();

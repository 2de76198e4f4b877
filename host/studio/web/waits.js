// Who waits for whom: a line with an arrow from each robot that waits to the one that has to go on first. The server
// reads it from the recording; the dependency graph itself was the simulator's.

import { theme } from './drawing.js';

/** Lines of a picture, robots of a chain that is told, cycles that are listed, at most. */
const MOST_LINES = 3000;
const TOLD = 12;
/** Windows that are kept. */
const KEPT = 6;

/** Changes of waits in windows, and who waits for whom at a time. `load(from_s, to_s)` asks the server. */
export class Waits {
  #windows = new Map();
  #at = { number: -1, index: 0, time: 0, all: new Map() };
  #uses = 0;

  /** The reason why nothing is known, if there is one. */
  why = null;

  constructor({ load, window_s, end_s, arrived, failed }) {
    Object.assign(this, { load, window_s, end_s, arrived, failed });
  }

  /** The cause of each wait at a time, by the numbers of robots: another robot's number, or `message`. Null until it has arrived. */
  at(time) {
    if (this.why) return null;
    const number = Math.floor(Math.min(time, this.end_s) / this.window_s), window = this.#windows.get(number);
    if (!window) {
      this.#ask(number);
      return null;
    }
    window.used = ++this.#uses;
    if (!window.changes) return null;
    const at = this.#at;
    if (at.number !== number || at.time > time) Object.assign(at, { number, index: 0, all: new Map() });
    for (; at.index < window.changes.length && window.changes[at.index][0] <= time + 1e-9; at.index++) {
      const [, agent, other] = window.changes[at.index];
      if (other === null) at.all.delete(agent); else at.all.set(agent, other);
    }
    at.time = time;
    // What comes next is there when it is needed.
    if (time > (number + 0.5) * this.window_s && (number + 1) * this.window_s < this.end_s) this.#ask(number + 1);
    return at.all;
  }

  async #ask(number) {
    if (this.#windows.has(number)) return;
    const own = { changes: null, used: ++this.#uses };
    this.#windows.set(number, own);
    if (this.#windows.size > KEPT) this.#windows.delete([...this.#windows].reduce((a, b) => b[1].used < a[1].used ? b : a)[0]);
    try {
      const { why = null, changes = null } = await this.load(number * this.window_s, Math.min((number + 1) * this.window_s, this.end_s));
      this.why = why;
      own.changes = changes;
    } catch (error) {
      this.why = error.message;
      this.failed(error);
    }
    this.arrived();
  }
}

/** The robots from one to the next that it waits for. The last is one that drives, `message`, or one that is in the chain already. */
export function chainOf(all, agent) {
  const chain = [agent], seen = new Set(chain);
  for (let next = all.get(agent); next !== undefined; next = all.get(next)) {
    chain.push(next);
    if (seen.has(next)) break;
    seen.add(next);
  }
  return chain;
}

/** Rings of robots each of which waits for the next, with their lowest number first. */
export function cyclesOf(all) {
  const done = new Set(), cycles = [];
  for (const first of all.keys()) {
    const way = new Map();
    let agent = first;
    while (all.has(agent) && !done.has(agent) && !way.has(agent)) {
      way.set(agent, way.size);
      agent = all.get(agent);
    }
    if (way.has(agent)) {
      const ring = [...way.keys()].slice(way.get(agent)), least = ring.indexOf(Math.min(...ring));
      cycles.push([...ring.slice(least), ...ring.slice(0, least)]);
    }
    for (const one of way.keys()) done.add(one);
  }
  return cycles.sort((a, b) => a[0] - b[0]);
}

/** A chain in words: `waits for 7, which waits for 3`. */
export function inWords(chain) {
  const parts = chain.slice(1, TOLD + 1).map((other) => other === 'message' ? 'waits for a message' : `waits for ${other}`);
  if (!parts.length) return 'waits for nobody';
  const rest = chain.length - 1 - parts.length;
  const ends = new Set(chain).size < chain.length ? ': a cycle' : '';
  return parts.join(', which ') + (rest > 0 ? ` and so on, ${rest} more` : '') + ends;
}

/** The arrows of a pane; those of cycles are dashed, those from the selected robot on are thick. */
export function waitsLayer(pane) {
  return {
    name: 'waits', plane: 'over', visible: false,
    draw(pen, stage) {
      const { recording, scene, waits } = pane, { fleet } = recording, all = waits.at(scene.now);
      if (!all) return;
      const selected = scene.selected < 0 ? [] : chainOf(all, recording.ids[scene.selected]);
      const chosen = new Set(selected.slice(0, -1)), ringed = new Set(cyclesOf(all).flat());
      const lines = { plain: [], chosen: [], cycle: [] };
      let left = MOST_LINES;
      for (const i of scene.seen) {
        const agent = recording.ids[i], other = all.get(agent);
        if (other === undefined || left-- <= 0) continue;
        lines[ringed.has(agent) ? 'cycle' : chosen.has(agent) ? 'chosen' : 'plain'].push([i, other === 'message' ? -1 : recording.agent(other)]);
      }
      const scale = stage.camera.scale, X = (i) => stage.toX(fleet.X[i]), Y = (i) => stage.toY(fleet.Y[i]);
      const trace = ([i, j]) => {
        const x = X(i), y = Y(i);
        if (j < 0) {
          // Nobody is in its way: a bubble above it.
          const r = Math.max(0.5 * fleet.reach(i) * scale, 4);
          pen.moveTo(x + 2 * r, y - 2 * r);
          pen.arc(x + r, y - 2 * r, r, 0, 2 * Math.PI);
          return;
        }
        const dx = X(j) - x, dy = Y(j) - y, way = Math.hypot(dx, dy);
        if (way < 1) return;
        const u = dx / way, v = dy / way, head = Math.min(9, Math.max(5, 0.35 * way));
        // From inside of the one to the edge of the other.
        const to = Math.max(way - fleet.reach(j) * scale * 0.7, 0.5 * way), ex = x + u * to, ey = y + v * to;
        pen.moveTo(x, y);
        pen.lineTo(ex, ey);
        pen.moveTo(ex - head * (u - 0.55 * v), ey - head * (v + 0.55 * u));
        pen.lineTo(ex, ey);
        pen.lineTo(ex - head * (u + 0.55 * v), ey - head * (v - 0.55 * u));
      };
      for (const [kind, color, wide, dash] of [['plain', theme.ink, 1.8, []], ['chosen', theme.accent, 3.2, []], ['cycle', theme.problem, 3.2, [7, 5]]]) {
        if (!lines[kind].length) continue;
        for (const [stroke, more, dashes] of [[theme.halo, 3, []], [color, 0, dash]]) {
          pen.beginPath();
          lines[kind].forEach(trace);
          pen.setLineDash(dashes);
          pen.strokeStyle = stroke;
          pen.lineWidth = wide + more;
          pen.stroke();
        }
        pen.setLineDash([]);
      }
    },
  };
}

// What is selected in the document: starts `s3` and goals `g3` of agents, obstacles `o2`, movers `m0`.

import { batch, setAgents } from './edits.js';
import { corners, within, shifted, round, outlineOf, reachOf, box } from './geometry.js';

export class Selection {
  constructor(store) {
    this.store = store;
    this.keys = new Set();
    this.listeners = [];
    store.on((what) => { if (what === 'document') this.prune(); });
  }

  on(listener) { this.listeners.push(listener); }
  tell() { for (const listener of this.listeners) listener(); }

  set(keys) {
    this.keys = new Set(keys);
    this.tell();
  }
  toggle(key) {
    if (!this.keys.delete(key)) this.keys.add(key);
    this.tell();
  }
  has(key) { return this.keys.has(key); }
  get size() { return this.keys.size; }

  /** Indices of one sort, ascending: of `s`, `g`, `o` or `m`. */
  of(...sorts) {
    const found = new Set();
    for (const key of this.keys) if (sorts.includes(key[0])) found.add(Number(key.slice(1)));
    return [...found].sort((a, b) => a - b);
  }
  get agents() { return this.of('s', 'g'); }

  prune() {
    const { agents, world } = this.store;
    const most = { s: agents.length, g: agents.length, o: world?.obstacles?.length ?? 0, m: world?.movers?.length ?? 0 };
    const left = [...this.keys].filter((key) => Number(key.slice(1)) < most[key[0]]);
    if (left.length < this.keys.size) this.set(left);
  }

  /** All that there is, in the order in which keys go through it. */
  all() {
    const { agents, world } = this.store;
    return [
      ...agents.flatMap((_, index) => [`s${index}`, `g${index}`]),
      ...(world?.obstacles ?? []).map((_, index) => `o${index}`),
      ...(world?.movers ?? []).map((_, index) => `m${index}`),
    ];
  }

  next(step) {
    const all = this.all();
    if (!all.length) return;
    const last = [...this.keys].at(-1), at = last === undefined ? (step > 0 ? -1 : 0) : all.indexOf(last);
    this.set([all[(at + step + all.length) % all.length]]);
  }

  /** The operation that moves what is selected. */
  moved(dx, dy, name = 'move') {
    const { world } = this.store, ops = [];
    const own = this.agents;
    if (own.length) {
      const to = ([x, y, ...turn], on) => on ? [round(x + dx), round(y + dy), ...turn] : [x, y, ...turn];
      ops.push(setAgents(this.store, own, (agent, index) => ({ ...agent, start: to(agent.start, this.has(`s${index}`)), goal: to(agent.goal, this.has(`g${index}`)) })));
    }
    for (const index of this.of('o')) ops.push({ op: 'set-obstacle', index, obstacle: shifted(world.obstacles[index], dx, dy) });
    for (const index of this.of('m')) {
      const mover = world.movers[index];
      ops.push({ op: 'set-mover', index, mover: { ...mover, knots: mover.knots.map(([t, x, y, ...h]) => [t, round(x + dx), round(y + dy), ...h]) } });
    }
    return ops.length ? batch(name, ops) : null;
  }

  /** The operation that removes it. */
  removed() {
    const ops = [];
    const add = (op, indices) => { if (indices.length) ops.push({ op, indices }); };
    add('remove-agents', this.agents);
    add('remove-obstacles', this.of('o'));
    add('remove-movers', this.of('m'));
    return ops.length ? batch('delete', ops) : null;
  }

  /** What is selected, to be added again. */
  get copy() {
    const { agents, world } = this.store;
    return { agents: this.agents.map((index) => agents[index]), obstacles: this.of('o').map((index) => world.obstacles[index]), movers: this.of('m').map((index) => world.movers[index]) };
  }

  /** The operation that adds copies so far to the right and up, and their keys; null if there are none. */
  added({ agents, obstacles, movers }, by) {
    const { store } = this, ops = [], keys = [];
    const to = ([x, y, ...turn]) => [round(x + by), round(y + by), ...turn];
    const has = (sorts, list, first) => list.forEach((_, at) => sorts.forEach((sort) => keys.push(sort + (first + at))));
    if (store.world && obstacles.length) {
      ops.push({ op: 'add-obstacles', obstacles: obstacles.map((obstacle) => shifted(obstacle, by, by)) });
      has(['o'], obstacles, store.world.obstacles?.length ?? 0);
    }
    if (store.world && movers.length) {
      ops.push(...movers.map((mover) => ({ op: 'add-mover', mover: { ...mover, knots: mover.knots.map(([t, ...place]) => [t, ...to(place)]) } })));
      has(['m'], movers, store.world.movers?.length ?? 0);
    }
    if (agents.length) {
      ops.push({ op: 'add-agents', agents: agents.map(({ start, goal, ...rest }) => ({ ...rest, start: to(start), goal: to(goal) })) });
      has(['s', 'g'], agents, store.agents.length);
    }
    return ops.length ? [batch('duplicate', ops), keys] : null;
  }

  /** What it is in words. */
  words() {
    const parts = [], count = (list, one) => { if (list.length) parts.push(list.length === 1 ? `${one} ${list[0]}` : `${list.length} ${one}s`); };
    const whole = this.agents.filter((index) => this.has(`s${index}`) && this.has(`g${index}`));
    count(whole, 'robot');
    count(this.of('s').filter((index) => !this.has(`g${index}`)), 'start');
    count(this.of('g').filter((index) => !this.has(`s${index}`)), 'goal');
    count(this.of('o'), 'obstacle');
    count(this.of('m'), 'mover');
    return parts.join(', ');
  }

  /** The box around it, or null. */
  box() {
    const { agents, world } = this.store, points = [];
    for (const key of this.keys) {
      const index = Number(key.slice(1));
      if (key[0] === 's') points.push(agents[index].start);
      else if (key[0] === 'g') points.push(agents[index].goal);
      else if (key[0] === 'o') points.push(...corners(world.obstacles[index]));
      else points.push(...world.movers[index].knots.map(([, x, y]) => [x, y]));
    }
    return points.length ? box(points) : null;
  }
}

/** Outlines of kinds of robots. */
export class Kinds {
  constructor(store) {
    this.store = store;
    this.presets = new Map();
    this.known = new Map();
  }

  /** The profile of a kind, as an object with footprint and model. */
  profile(name) {
    const profile = this.store.document.robots[name];
    return typeof profile === 'string' ? this.presets.get(profile) ?? { footprint: null, model: profile } : profile;
  }

  outline(name) {
    const profile = this.profile(name), key = profile?.footprint;
    if (!key) return { r: 0.25, reach: 0.25 };
    if (!this.known.has(key)) {
      const outline = outlineOf(key);
      this.known.set(key, { ...outline, reach: reachOf(outline) });
    }
    return this.known.get(key);
  }

  /** The name of an agent's kind. */
  nameOf(agent) { return agent.robot ?? Object.keys(this.store.document.robots)[0]; }

  of(agent) { return this.outline(this.nameOf(agent)); }

  /** The trailer of an agent at one of its places, which begins in line with the car: `{at, heading, outline}`; null of one
   * that tows none. */
  trailer(agent, [x, y, heading = 0, behind = heading]) {
    const trailer = this.profile(this.nameOf(agent))?.model?.car?.trailer;
    if (!trailer) return null;
    const { hitch_m = 0.5, length_m: l = 0.3, width_m: w = 0.25 } = trailer;
    return {
      at: [x - hitch_m * Math.cos(behind), y - hitch_m * Math.sin(behind)], heading: behind,
      outline: { v: [[l / 2, w / 2], [-l / 2, w / 2], [-l / 2, -w / 2], [l / 2, -w / 2]] },
    };
  }
}

/** A place with another heading; the angle of the joint of a car with a trailer stays as it is. */
export function headed([x, y, before, behind], heading) {
  if (heading === null) return [x, y];
  return behind === undefined ? [x, y, heading] : [x, y, heading, round(behind + heading - before)];
}

/** What is at a place. */
export class Hits {
  constructor(store, kinds) { Object.assign(this, { store, kinds }); }

  /** Keys of what is at a place or nearer than `slack` metres, the topmost first. */
  at([x, y], slack) {
    const found = [], { agents, world } = this.store;
    for (const [sort, part] of [['s', 'start'], ['g', 'goal']]) {
      let best = null;
      for (let index = 0; index < agents.length; index++) {
        const agent = agents[index], [ax, ay] = agent[part], trailer = this.kinds.trailer(agent, agent[part]);
        const near = (d, reach) => { if (d <= Math.max(reach, slack) && (!best || d < best[0])) best = [d, sort + index]; };
        near(Math.hypot(ax - x, ay - y), this.kinds.of(agent).reach);
        if (trailer) near(Math.hypot(trailer.at[0] - x, trailer.at[1] - y), reachOf(trailer.outline));
      }
      if (best) found.push(best[1]);
    }
    (world?.movers ?? []).forEach(({ knots, footprint }, index) => {
      if (knots.some(([, kx, ky]) => Math.hypot(kx - x, ky - y) <= Math.max(reachOf(outlineOf(footprint)), slack))) found.push(`m${index}`);
    });
    const obstacles = world?.obstacles ?? [];
    for (let index = obstacles.length - 1; index >= 0; index--) if (within([x, y], corners(obstacles[index]))) found.push(`o${index}`);
    return found;
  }
}

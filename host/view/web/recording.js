// What a page knows of a recording besides motion: its meta (html.rs), read once.

import { Fleet } from './fleet.js';

/** How many of the ascending values, or of what `of` makes of them, are not after a time. */
export function until(values, time, of = (value) => value) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(values[middle]) <= time + 1e-9) low = middle + 1; else high = middle;
  }
  return low;
}

/** True if something went wrong at a call of a fleet's planner. */
export const isTrouble = (call) => call.said.length > 0 || (call.by !== null && call.by !== 'planner');

export class Recording {
  constructor(meta) {
    this.meta = meta;
    /** Agents that are shown; trailers and moving obstacles come after them. */
    this.count = meta.agents;
    this.ids = meta.ids;
    this.end_s = meta.duration_s;
    this.bounds = meta.bounds;
    this.indexOf = new Map(meta.ids.map((id, index) => [id, index]));
    this.fleet = new Fleet({
      outlines: meta.outlines, kinds: meta.outline_of, agents: meta.agents, bodies: meta.ids.length, headings: meta.headings,
      cars: meta.cars.map((both) => both.map((id) => this.indexOf.get(id))),
    });
    /** Cars by their trailers. */
    this.carOf = new Map(meta.cars);
    /** In the order of their beginnings: bodies as ids, `b` null for what stands. */
    this.contacts = meta.contacts.map(([from, to, a, b]) => ({ from, to: to ?? this.end_s, open: to === null, a, b }));
    /** What the planner wants to show, by layer; its times are those of the plan. */
    this.layers = meta.layers.map(({ name, color, range, annotations }) => ({
      name, color, range, shown: true,
      annotations: annotations.map((a) => ({
        agent: a.agent ?? null, from: a.from_s ?? 0, to: a.to_s ?? Infinity, text: a.text ?? '',
        shape: a.shape, shapes: a.xy_m ?? [], values: a.values ?? [],
      })),
    }));
    this.priorities = prioritiesOf(this.layers);
    /** What the fleet did, if the trace tells it. */
    this.work = meta.work && readWork(meta);
    this.troubles = this.work ? this.work.calls.filter(isTrouble) : [];
  }

  /** The index of an agent that is shown, by its id; -1 is none. */
  agent(id) {
    return id !== null && id < this.meta.all_agents ? this.indexOf.get(id) ?? -1 : -1;
  }

  /** A body in words. */
  nameOf(id) {
    if (id === null) return 'obstacle';
    if (this.carOf.has(id)) return `trailer of agent ${this.carOf.get(id)}`;
    return id < this.meta.all_agents ? `agent ${id}` : 'moving obstacle';
  }

  /** The same in short: of an agent its number. */
  shortOf(id) {
    return this.nameOf(id).replace(/^agent /, '');
  }

  /** True if a body is an agent, or its trailer. */
  isOf(body, agent) {
    return body !== null && (body === agent || this.carOf.get(body) === agent);
  }

  /** The goal of an agent at a time, with x and y in metres, or null. */
  goalAt(i, time) {
    const { work, meta } = this;
    if (!work) return meta.goals[i] ? { x: meta.goals[i][0], y: meta.goals[i][1] } : null;
    const own = work.goals[i] ?? [];
    const last = own[until(own, time, (goal) => goal.from) - 1];
    return last && (last.to === null || last.to > time + 1e-9) ? last : null;
  }

  /** The bodies of a contact that are shown, as indices. */
  both(contact) {
    return [contact.a, contact.b].map((id) => this.indexOf.get(id) ?? -1).filter((i) => i >= 0);
  }

  /** Contacts at a time; short ones linger for some seconds. */
  touching(time, linger) {
    const out = [];
    for (const contact of this.contacts) {
      if (contact.from > time) break;
      if (time <= Math.max(contact.to, contact.from + linger)) out.push(contact);
    }
    return out;
  }
}

/** Ranks of agents by their numbers, 0 before 1, and the last rank: what a planner tells in a layer `priority`, where each
 * annotation of an agent has its rank as its first value. Null if there is none. */
function prioritiesOf(layers) {
  const told = layers.find(({ name }) => name === 'priority')?.annotations.filter(({ agent, values }) => agent !== null && values.length) ?? [];
  if (!told.length) return null;
  const of = new Map(told.map(({ agent, values }) => [agent, values[0]]));
  return { of, last: Math.max(...of.values()) };
}

/** The work of a fleet; ticks become seconds, cells places. */
function readWork({ work: { tick_s, cols, goals, reached, calls, notices }, cells: { rows, side } }) {
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

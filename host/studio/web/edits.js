// Operations on a document, as the server takes them, and what they do to the document on this page until it
// has answered. What only the server can work out (random places, snapped ones) waits for the answer.

import { kindsOf, mapOfKinds, KINDS } from './geometry.js';

const without = (list, indices) => {
  const gone = new Set(indices);
  return list.filter((_, index) => !gone.has(index));
};
const replaced = (list, index, value) => list.map((old, at) => at === index ? value : old);
const inWorld = (document, change) => document.ground.world
  ? { ...document, ground: { world: { ...document.ground.world, ...change(document.ground.world) } } } : document;
const inMap = (document, change) => document.ground.map
  ? { ...document, ground: { map: change(document.ground.map) } } : document;

const APPLY = {
  'set-name': (d, { name }) => ({ ...d, name }),
  'set-bounds': (d, { bounds_m }) => inWorld(d, () => ({ bounds_m, boundary_m: undefined })),
  'set-boundary': (d, { boundary_m }) => inWorld(d, () => ({ boundary_m, bounds_m: undefined })),
  'add-obstacles': (d, { obstacles }) => inWorld(d, (w) => ({ obstacles: [...w.obstacles ?? [], ...obstacles] })),
  'set-obstacle': (d, { index, obstacle }) => inWorld(d, (w) => ({ obstacles: replaced(w.obstacles, index, obstacle) })),
  'remove-obstacles': (d, { indices }) => inWorld(d, (w) => ({ obstacles: without(w.obstacles, indices) })),
  'add-mover': (d, { mover }) => inWorld(d, (w) => ({ movers: [...w.movers ?? [], mover] })),
  'set-mover': (d, { index, mover }) => inWorld(d, (w) => ({ movers: replaced(w.movers, index, mover) })),
  'remove-movers': (d, { indices }) => inWorld(d, (w) => ({ movers: without(w.movers, indices) })),
  paint: (d, { as, runs }) => inMap(d, (map) => {
    const kinds = kindsOf(map).slice(), kind = KINDS.indexOf(as);
    for (let i = 0; i + 1 < runs.length; i += 2) kinds.fill(kind, runs[i], runs[i] + runs[i + 1]);
    return mapOfKinds(map, kinds);
  }),
  'set-robot': (d, { name, profile }) => ({ ...d, robots: { ...d.robots, [name]: profile } }),
  'add-agents': (d, { agents }) => ({ ...d, agents: [...d.agents, ...agents] }),
  'set-agents': (d, { indices, agents }) => {
    const all = d.agents.slice();
    indices.forEach((index, at) => { all[index] = agents[at]; });
    return { ...d, agents: all };
  },
  'remove-agents': (d, { indices }) => ({ ...d, agents: without(d.agents, indices) }),
  'set-seed': (d, { seed }) => ({ ...d, seed }),
  batch: (d, { ops }) => ops.reduce(apply, d),
};

/** A document after an operation, as far as this page can tell. */
export function apply(document, op) {
  return APPLY[op.op]?.(document, op) ?? document;
}

/** One operation of several, under a name for the history. */
export function batch(name, ops) {
  return ops.length === 1 ? ops[0] : { op: 'batch', name, ops };
}

/** The operation that sets agents by their numbers, each to what `change` makes of it. */
export function setAgents(document, indices, change) {
  return { op: 'set-agents', indices, agents: indices.map((index) => change(document.agents[index], index)) };
}

// The panel of robots: kinds, agents, scattering and snapping.

import { h, fill, check, field, number, section, select, say, tidy } from './dom.js';
import { batch, setAgents } from './edits.js';
import { run } from './commands.js';
import { AGENTS, theme } from './drawing.js';
import { round } from './geometry.js';
import { headed } from './selection.js';

const CART = { footprint: { disc: { radius_m: 0.25 } }, model: { 'single-integrator': { speed_m_per_s: 1 } } };
const MODELS = ['pebble', 'rotation', 'single-integrator', 'differential-drive', 'unicycle-1', 'unicycle-2', 'double-integrator', 'holonomic', 'waypoint-law'];

const inDegrees = (angle) => +(angle * 180 / Math.PI).toFixed(2);

export function robotsPanel(app, node) {
  const { store, selection, kinds, settings } = app;
  let open = null;
  let scatter = { count: 10, robot: null, seed: 1, replace: false };
  let rename = '';
  /** Robots to keep, from the first. */
  let keep = null;

  function icon(name, index) {
    const canvas = h('canvas', { width: 88, height: 88, 'aria-hidden': 'true' }), pen = canvas.getContext('2d'), outline = kinds.outline(name);
    pen.translate(44, 44);
    pen.scale(36 / outline.reach, -36 / outline.reach);
    pen.beginPath();
    if (outline.r !== undefined) pen.arc(0, 0, outline.r, 0, 2 * Math.PI);
    else outline.v.forEach(([x, y], at) => at ? pen.lineTo(x, y) : pen.moveTo(x, y));
    pen.closePath();
    pen.fillStyle = AGENTS[index % AGENTS.length];
    pen.fill();
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.lineTo(outline.reach * 0.9, 0);
    pen.lineWidth = outline.reach / 18;
    pen.strokeStyle = theme.ink || '#000000';
    pen.stroke();
    return canvas;
  }

  const size = ({ disc, rectangle, polygon } = {}) => disc ? `disc of ${tidy(disc.radius_m)} m`
    : rectangle ? `${tidy(rectangle.length_m)} × ${tidy(rectangle.width_m)} m` : polygon ? `${polygon.vertices_m.length} corners` : 'no footprint';
  const modelName = (model) => typeof model === 'string' ? model : Object.keys(model ?? {})[0] ?? '?';

  function kindRow([name, given], index) {
    const profile = kinds.profile(name), used = store.agents.filter((agent) => (agent.robot ?? name) === name).length;
    return h('div', { class: 'kind' }, icon(name, index),
      h('div', {}, h('b', {}, name), h('small', {}, `${typeof given === 'string' ? `${given}: ` : ''}${size(profile?.footprint ?? {})}, ${modelName(profile?.model)}; ${used} robot${used === 1 ? '' : 's'}`)),
      h('button', { type: 'button', 'aria-expanded': String(open === name), 'data-key': `kind-${name}`, 'aria-label': `Change ${name}`, onclick: () => { open = open === name ? null : name; rename = name; draw(); } }, open === name ? 'Done' : 'Change'));
  }

  function kindForm(name) {
    const profile = kinds.profile(name), footprint = profile.footprint ?? { disc: { radius_m: 0.25 } };
    const set = (change) => store.edit({ op: 'set-robot', name, profile: { footprint, model: profile.model, ...change } });
    const shape = Object.keys(footprint)[0];
    const shapes = { disc: { disc: { radius_m: kinds.outline(name).reach } }, rectangle: { rectangle: { length_m: 0.8, width_m: 0.5 } }, polygon: { polygon: { vertices_m: [[0.4, 0], [-0.3, 0.3], [-0.3, -0.3]] } } };
    const own = [];
    if (shape === 'disc') own.push(field('Radius', number(footprint.disc.radius_m, (radius_m) => set({ footprint: { disc: { radius_m } } }), { min: 1e-3, 'data-key': 'radius' }), 'm'));
    else if (shape === 'rectangle') {
      for (const [key, label] of [['length_m', 'Length'], ['width_m', 'Width']]) own.push(field(label, number(footprint.rectangle[key], (value) => set({ footprint: { rectangle: { ...footprint.rectangle, [key]: value } } }), { min: 1e-3, 'data-key': key }), 'm'));
    } else own.push(jsonField('Corners', footprint.polygon.vertices_m, (vertices_m) => set({ footprint: { polygon: { vertices_m } } }), 'corners'));
    const model = modelName(profile.model), values = typeof profile.model === 'string' ? {} : profile.model?.[model] ?? {};
    return h('div', { class: 'schema' },
      field('Name', h('input', { type: 'text', value: rename, maxLength: 100, 'data-key': 'kind-name', onchange: ({ target }) => { const to = target.value.trim(); if (to && to !== name) store.edit({ op: 'rename-robot', name, to }).then((ok) => { if (ok) open = rename = to; draw(); }); } })),
      field('Footprint', select(Object.keys(shapes), shape, (to) => set({ footprint: shapes[to] }), { 'data-key': 'shape' })), ...own,
      field('Model', select([...new Set([...MODELS, model, ...app.presets.map((preset) => preset.name)])], model, (to) => set({ model: to }), { 'data-key': 'model' })),
      ...Object.entries(values).map(([key, value]) => typeof value === 'number'
        ? field(key.replaceAll('_', ' '), number(value, (told) => set({ model: { [model]: { ...values, [key]: told } } }), { 'data-key': `model-${key}` }))
        : jsonField(key.replaceAll('_', ' '), value, (told) => set({ model: { [model]: { ...values, [key]: told } } }), `model-${key}`)),
      h('div', { class: 'row' }, h('button', { type: 'button', class: 'danger', onclick: () => store.edit({ op: 'remove-robot', name }).then((ok) => { if (ok) open = null; draw(); }) }, 'Remove this kind')));
  }

  const jsonField = (label, value, change, key) => {
    const input = h('input', { type: 'text', value: JSON.stringify(value), spellcheck: false, 'data-key': key, onchange: () => {
      try {
        change(JSON.parse(input.value));
        input.setAttribute('aria-invalid', 'false');
      } catch { input.setAttribute('aria-invalid', 'true'); }
    } });
    return field(label, input);
  };

  function kindsCard() {
    const names = Object.keys(store.document.robots);
    const free = (base) => { let name = base; for (let n = 2; name in store.document.robots; n++) name = `${base}-${n}`; return name; };
    const add = (choice) => {
      const name = free(choice === 'own' ? 'cart' : choice), profile = choice === 'own' ? CART : choice;
      store.edit({ op: 'set-robot', name, profile });
      settings.robot = open = rename = name;
      draw();
    };
    const presets = app.presets.filter((preset) => preset.footprint);
    return section('Kinds of robots',
      ...Object.entries(store.document.robots).flatMap((entry, index) => [kindRow(entry, index), open === entry[0] ? kindForm(entry[0]) : null]),
      names.length ? null : h('p', { class: 'soft' }, 'None yet. A robot that is drawn brings one.'),
      field('Add', select([['', 'choose …'], ['own', 'a disc of 0.25 m, to change'], ...presets.map(({ name, about }) => [name, `${name}: ${about}`])], '', add, { 'data-key': 'add-kind', 'aria-label': 'Add a kind' })));
  }

  function agentCard() {
    const indices = selection.agents, index = indices[0], agent = store.agents[index];
    const find = h('input', { type: 'number', min: 0, step: 1, placeholder: 'number', class: 'short', inputMode: 'numeric', id: 'find-agent', 'aria-label': 'Find a robot by its number', 'data-key': 'find', onchange: () => {
      const wanted = Number(find.value);
      if (find.value === '' || !store.agents[wanted]) return say(`there is no robot ${find.value}`);
      selection.set([`s${wanted}`, `g${wanted}`]);
      run('zoom-selection');
    } });
    const parts = [];
    if (agent && indices.length === 1) {
      const set = (part, place) => store.edit(setAgents(store, [index], () => ({ ...agent, [part]: place })));
      const put = (part, axis) => (value) => set(part, agent[part].map((old, at) => at === axis ? value : old));
      const angle = (turn) => turn === null ? null : round(turn * Math.PI / 180);
      for (const part of ['start', 'goal']) {
        parts.push(h('h3', {}, `${part === 'start' ? 'Start' : 'Goal'} of robot ${index}: x, y in metres, heading in degrees`), h('div', { class: 'row' },
          ...['x', 'y'].map((name, axis) => h('span', { class: 'grow' }, number(agent[part][axis], put(part, axis), { 'aria-label': `${name} of the ${part} in metres`, 'data-key': `${part}-${axis}` }))),
          h('span', { class: 'grow' }, number(agent[part][2] === undefined ? null : inDegrees(agent[part][2]), (turn) => set(part, headed(agent[part], angle(turn))), { empty: true, placeholder: 'any', 'aria-label': `Heading at the ${part} in degrees; empty is any`, 'data-key': `${part}-h` }))));
        const [x, y, heading = 0, behind] = agent[part];
        if (kinds.trailer(agent, agent[part])) {
          parts.push(field('Heading of its trailer', number(behind === undefined ? null : inDegrees(behind), (turn) => set(part, turn === null ? agent[part].slice(0, 3) : [x, y, heading, angle(turn)]), {
            empty: true, placeholder: part === 'start' ? 'in line' : 'any', 'aria-label': `Heading of the trailer at the ${part} in degrees`, 'data-key': `${part}-trailer`,
          }), '°'));
        }
      }
    } else if (indices.length > 1) parts.push(h('p', { class: 'soft' }, `${indices.length} robots: ${indices.slice(0, 12).join(', ')}${indices.length > 12 ? ', …' : ''}`));
    else parts.push(h('p', { class: 'soft' }, store.agents.length ? 'Click a robot, or Shift and drag a box around several.' : 'Choose the tool Robot (A) and drag from a start to a goal.'));
    if (indices.length && Object.keys(store.document.robots).length > 1) {
      parts.push(field('Kind', select(Object.keys(store.document.robots), agent.robot, (robot) => store.edit(setAgents(store, indices, (own) => ofKind(own, robot))), { 'data-key': 'agent-kind' })));
    }
    if (indices.length) {
      parts.push(h('div', { class: 'row' }, h('button', { type: 'button', onclick: () => run('swap') }, 'Swap start and goal'), h('button', { type: 'button', onclick: () => run('duplicate') }, 'Duplicate'),
        h('button', { type: 'button', class: 'danger', onclick: () => store.edit({ op: 'remove-agents', indices }) }, 'Delete')));
    }
    if (store.agents.length > 1) {
      keep = Math.min(keep ?? store.agents.length, store.agents.length);
      const cut = () => store.edit({ op: 'remove-agents', indices: store.agents.map((_, index) => index).slice(keep) });
      parts.push(h('div', { class: 'row' }, h('span', { class: 'line' }, 'Keep the first'),
        h('span', { class: 'grow' }, number(keep, (value) => { keep = value; draw(); }, { min: 0, max: store.agents.length, step: 1, 'aria-label': 'Robots to keep, from the first', 'data-key': 'keep' })),
        h('button', { type: 'button', disabled: keep >= store.agents.length, 'data-key': 'keep-run', onclick: cut }, 'Remove the others')));
    }
    const card = section('Robots', h('div', { class: 'row' }, h('span', { class: 'soft grow' }, `${store.agents.length} in all`), h('span', {}, find)), ...parts);
    return card;
  }

  /** An agent as one of another kind: only a car with a trailer has a heading of that. */
  const ofKind = ({ start, goal, ...rest }, robot) => {
    const tows = kinds.trailer({ robot }, start), place = (at) => tows ? at : at.slice(0, 3);
    return { ...rest, robot, start: place(start), goal: place(goal) };
  };

  function scatterCard() {
    const names = Object.keys(store.document.robots);
    scatter.robot = names.includes(scatter.robot) ? scatter.robot : names[0];
    return section('Place at random',
      h('div', { class: 'pair' },
        field('Robots', number(scatter.count, (count) => { scatter.count = count; }, { min: 1, max: 100000, step: 1, 'data-key': 'scatter-count' })),
        field('Seed', number(scatter.seed, (seed) => { scatter.seed = seed; }, { min: 0, step: 1, 'data-key': 'scatter-seed' }))),
      names.length > 1 ? field('Kind', select(names, scatter.robot, (robot) => { scatter.robot = robot; }, { 'data-key': 'scatter-kind' })) : null,
      check('in place of those that there are', scatter.replace, (on) => { scatter.replace = on; }, { 'data-key': 'scatter-replace' }),
      h('div', { class: 'row' },
        h('button', { type: 'button', class: 'primary', 'data-key': 'scatter', onclick: async () => {
          const ops = [];
          if (!names.length) ops.push({ op: 'set-robot', name: 'cart', profile: CART });
          ops.push({ op: 'scatter', count: scatter.count, robot: scatter.robot ?? 'cart', seed: scatter.seed, replace: scatter.replace });
          if (await store.edit(batch('scatter', ops))) say(`${scatter.count} robots placed`);
        } }, 'Place'),
        h('button', { type: 'button', disabled: !store.agents.length, 'data-key': 'snap-grid', onclick: () => store.edit({ op: 'snap', view: 'grid' }) }, 'Snap to the grid')));
  }

  function toleranceCard() {
    const d = store.document;
    const row = (key, label, unit, fallback) => field(label, number(d[key] ?? null, (value) => store.edit({ op: 'set-tolerances', [key]: value }), { min: 1e-6, empty: true, placeholder: fallback, 'data-key': key }), unit);
    return section('Task',
      field('Seed', number(d.seed ?? 0, (seed) => store.edit({ op: 'set-seed', seed }), { min: 0, step: 1, 'data-key': 'seed' })),
      h('details', { class: 'more', open: app.open.tolerances, ontoggle: ({ target }) => { app.open.tolerances = target.open; } }, h('summary', {}, 'Tolerances'),
        row('goal_tolerance_m', 'Goal', 'm', '10⁻⁶'), row('goal_tolerance_rad', 'Heading', 'rad', '10⁻⁶'), row('goal_tolerance_rate', 'Rates', '', '10⁻⁶'), row('dynamics_tolerance', 'Dynamics', 'm, rad', '0.001')));
  }

  function draw() { fill(node, agentCard(), kindsCard(), scatterCard(), toleranceCard()); }
  return { draw };
}

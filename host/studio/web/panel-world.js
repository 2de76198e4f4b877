// The panel of the world: its size, layers, the parameters of its views, what is selected.

import { h, fill, check, field, number, section, say, tidy } from './dom.js';
import { tableForm } from './forms.js';
import { boundsOf, box, corners } from './geometry.js';
import { run } from './commands.js';

const GRID = [
  ['connectivity', 'Neighbours', 'choice', { choices: [['4', '4'], ['8', '8']], numeric: true, fallback: 4 }],
  ['separation', 'Separation', 'choice', { choices: [['rules', 'rules of MAPF'], ['strict', 'strict: always 2r']], fallback: 'rules' }],
];

const whole = { min: 1, step: 1 };
const ROADMAP = {
  builder: ['builder', 'Builder', 'choice', { choices: [['prm', 'PRM'], ['prm-star', 'PRM*'], ['delaunay', 'Delaunay'], ['lattice', 'lattice'], ['tangent', 'tangent']], fallback: 'prm' }],
  vertices: ['vertices', 'Vertices', 'number', { fallback: 900, bounds: whole }],
  neighbors: ['neighbors', 'Neighbours', 'number', { fallback: 9, bounds: whole }],
  sampling: ['sampling', 'Sampling', 'choice', { choices: ['uniform', 'halton'], fallback: 'uniform' }],
  side: ['side', 'Side', 'number', { unit: 'm', bounds: { min: 1e-6 }, placeholder: 'needed' }],
  directions: ['directions', 'Directions', 'choice', { choices: [['4', '4'], ['8', '8'], ['16', '16'], ['32', '32']], numeric: true, fallback: 8 }],
  sides: ['sides', 'Sides', 'number', { fallback: 16, bounds: { min: 3, step: 1 } }],
  spacing: ['spacing', 'Spacing', 'number', { unit: 'm', bounds: { min: 1e-6 }, placeholder: '2r' }],
  speed: ['speed', 'Speed', 'number', { unit: 'm/s', bounds: { min: 1e-6 }, placeholder: 'that of all' }],
  roadmap_seed: ['roadmap_seed', 'Seed', 'number', { bounds: { min: 0, step: 1 }, placeholder: 'that of the task' }],
};
const DRAWN = { prm: ['vertices', 'neighbors', 'sampling'], 'prm-star': ['vertices', 'sampling'], delaunay: ['vertices', 'sampling'], lattice: ['side', 'directions'], tangent: ['sides'] };

export function worldPanel(app, node) {
  const { store, layers, selection, tools, settings } = app;

  function ground() {
    const { world, map } = store.document.ground;
    if (map) {
      return section('Map',
        h('div', { class: 'pair' },
          field('Rows', number(map.rows, (rows) => store.edit({ op: 'resize-map', rows, cols: map.cols }), { ...whole, max: 10000, 'data-key': 'rows' })),
          field('Columns', number(map.cols, (cols) => store.edit({ op: 'resize-map', rows: map.rows, cols }), { ...whole, max: 10000, 'data-key': 'cols' }))),
        field('Side of a cell', number(map.cell_size_m, (cell_size_m) => store.edit({ op: 'set-cell-size', cell_size_m }), { min: 1e-3, 'data-key': 'side' }), 'm'),
        h('ul', { class: 'legend' }, swatch('--solid', 'blocked'), swatch('--endpoint', 'endpoint'), swatch('--workstation', 'workstation')));
    }
    const [l, b, r, t] = boundsOf(store.document.ground);
    const set = (change) => store.edit({ op: 'set-bounds', bounds_m: [l, b, r, t].map((value, at) => change[at] ?? value) });
    return section('World',
      world.boundary_m ? h('p', { class: 'soft' }, `An edge of ${world.boundary_m.length} corners, ${tidy(r - l)} × ${tidy(t - b)} m.`)
        : h('div', { class: 'pair' },
          field('Width', number(+tidy(r - l, 4), (w) => set({ 2: l + w }), { min: 1e-3, 'data-key': 'width' })),
          field('Height', number(+tidy(t - b, 4), (w) => set({ 3: b + w }), { min: 1e-3, 'data-key': 'height' }))),
      h('p', { class: 'soft' }, [
        `${world.obstacles?.length ?? 0} obstacles, ${world.movers?.length ?? 0} moving`, `from (${tidy(l)}, ${tidy(b)}) to (${tidy(r)}, ${tidy(t)})`,
      ].join(', ')),
      h('div', { class: 'row' },
        h('button', { type: 'button', 'aria-pressed': String(tools.boundsOpen), 'data-key': 'bounds', onclick: () => { tools.boundsOpen = !tools.boundsOpen; tools.choose('select'); tools.tell(); draw(); } },
          tools.boundsOpen ? 'Done with the edge' : 'Drag the edge')));
  }

  const swatch = (color, name) => {
    const mark = h('i');
    mark.style.background = `var(${color})`;
    return h('li', {}, mark, name);
  };

  function layerRow(name, title, note) {
    const layer = layers.all[name], artefact = app.artefacts.find(({ id }) => id === name);
    // What nobody looks at need not be made.
    const state = layer.error || artefact?.state === 'refused' ? 'refused' : layer.visible && artefact?.digest ? artefact.state : null;
    return [
      h('div', { class: 'layer' }, check(title, layer.visible, (on) => layers.show(name, on), { 'data-key': `layer-${name}` }),
        layer.visible && artefact?.digest ? h('code', { title: artefact.digest }, artefact.digest.slice(0, 8)) : null,
        state ? h('span', { class: `state ${state}`, title: artefact?.error ?? '' }, state) : null),
      layer.visible && layer.error ? h('p', { class: 'note' }, `${layer.error.message}. ${layer.error.hint ?? ''}`) : null,
      layer.visible && layer.data ? h('p', { class: 'note' }, note(layer.data)) : null,
    ];
  }

  function views() {
    const own = store.document.views ?? {}, roadmap = own.roadmap ?? {}, grid = own.grid ?? {};
    const set = (name) => (values) => store.edit({ op: 'set-view', [name]: JSON.parse(JSON.stringify(values)) });
    const builder = roadmap.builder ?? 'prm';
    const rows = ['builder', ...DRAWN[builder] ?? [], 'spacing', 'speed', 'roadmap_seed'].map((name) => ROADMAP[name]);
    const density = (vertices, neighbors) => () => store.edit({ op: 'set-view', roadmap: { ...roadmap, builder: 'prm', vertices, neighbors } });
    return section('Views',
      check('Lattice', settings.showLattice, (on) => { settings.showLattice = on; app.stage.invalidate(); }, { 'data-key': 'lattice' }),
      ...layerRow('clearance', 'Clearance', ({ values_cm: values }) => `Distance to what stands: dark is near, light is ${tidy(values.reduce((a, b) => Math.max(a, b), 0) / 100)} m.`),
      ...layerRow('grid', 'Grid', ({ rows, cols, cell_m: side }) => `${rows} × ${cols} cells of ${tidy(side)} m`),
      h('details', { class: 'more', open: app.open.grid, ontoggle: ({ target }) => { app.open.grid = target.open; } }, h('summary', {}, 'Parameters of the grid'), tableForm(GRID, grid, set('grid'), 'grid')),
      ...layerRow('roadmap', 'Roadmap', ({ vertices, edges }) => `${vertices.length / 2} vertices, ${edges.length / 2} edges`),
      h('details', { class: 'more', open: app.open.roadmap, ontoggle: ({ target }) => { app.open.roadmap = target.open; } }, h('summary', {}, 'Parameters of the roadmap'),
        h('div', { class: 'row' }, h('span', { class: 'soft' }, 'Density'),
          ...[['S', 160, 5], ['D', 900, 9], ['SD', 4000, 14]].map(([name, v, n]) => h('button', { type: 'button', 'data-key': `density-${name}`, 'aria-label': `Density ${name}: ${v} vertices`, title: `${v} vertices, ${n} neighbours`, onclick: density(v, n) }, name))),
        tableForm(rows, roadmap, set('roadmap'), 'roadmap')));
  }

  function drawing() {
    return section('Drawing',
      check('Snap to the lattice (Alt: not now)', settings.snap, (on) => { settings.snap = on; }, { 'data-key': 'snap' }),
      field('Lattice', number(settings.lattice, (side) => { settings.lattice = side; app.stage.invalidate(); }, { min: 1e-3, 'data-key': 'lattice-side' }), 'm'));
  }

  function chosen() {
    const index = selection.of('o')[0], obstacle = store.world?.obstacles?.[index];
    if (!selection.size) return null;
    const parts = [];
    if (selection.size === 1 && obstacle) {
      const points = corners(obstacle), [l, b, r, t] = box(points);
      const resize = (w, up) => store.edit({ op: 'set-obstacle', index, obstacle: { polygon: points.map(([x, y]) => [l + (x - l) * w / (r - l), b + (y - b) * up / (t - b)]) } });
      const move = (dx, dy) => store.edit(selection.moved(dx, dy));
      parts.push(h('div', { class: 'pair' },
        field('Left', number(+tidy(l, 4), (x) => move(x - l, 0), { 'data-key': 'left' })), field('Bottom', number(+tidy(b, 4), (y) => move(0, y - b), { 'data-key': 'bottom' })),
        field('Width', number(+tidy(r - l, 4), (w) => resize(w, t - b), { min: 1e-3, 'data-key': 'w' })), field('Height', number(+tidy(t - b, 4), (up) => resize(r - l, up), { min: 1e-3, 'data-key': 'h' }))));
    }
    const mover = selection.size === 1 ? store.world?.movers?.[selection.of('m')[0]] : null;
    if (mover) parts.push(moverForm(app, selection.of('m')[0], mover));
    return section('Selected', h('p', { class: 'soft' }, selection.words()), ...parts,
      h('div', { class: 'row' },
        h('button', { type: 'button', onclick: () => run('duplicate') }, 'Duplicate'),
        h('button', { type: 'button', class: 'danger', onclick: () => run('delete') }, 'Delete')));
  }

  function draw() { fill(node, chosen(), ground(), views(), drawing()); }
  return { draw };
}

function moverForm({ store }, index, mover) {
  const set = (change) => store.edit({ op: 'set-mover', index, mover: { ...mover, ...change } });
  const radius = mover.footprint.disc?.radius_m;
  return h('div', {},
    radius !== undefined ? field('Radius', number(radius, (radius_m) => set({ footprint: { disc: { radius_m } } }), { min: 1e-3, 'data-key': 'mover-radius' }), 'm') : null,
    h('h3', {}, 'Knots: time, x, y'),
    ...mover.knots.map((knot, at) => h('div', { class: 'row' }, ...['time', 'x', 'y'].map((name, axis) =>
      h('span', { class: 'grow' }, number(knot[axis], (value) => set({ knots: mover.knots.map((old, i) => i === at ? old.map((v, j) => j === axis ? value : v) : old) }), { 'aria-label': `${name} of knot ${at}`, 'data-key': `knot-${at}-${axis}` }))),
    mover.knots.length > 1 ? h('button', { type: 'button', class: 'plain', 'aria-label': `Remove knot ${at}`, onclick: () => set({ knots: mover.knots.filter((_, i) => i !== at) }) }, '×') : null)),
    h('button', { type: 'button', class: 'plain', onclick: () => { const [t, x, y, turn = 0] = mover.knots.at(-1); set({ knots: [...mover.knots, [t + 1, x + 0.5, y, turn]] }); say('a knot more'); } }, 'Add a knot'));
}


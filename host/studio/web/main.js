// The studio's page: what its parts share, and how they hear of each other.

import { scaleBar } from '/viewer/overlays.js';
import { Stage } from '/viewer/stage.js';
import { onTheme } from '/viewer/theme.js';

import { $, download, h, icon, iconButton, say, tidy } from './dom.js';
import { api, Feed } from './api.js';
import { boundsOf, round } from './geometry.js';
import { setAgents } from './edits.js';
import { Store } from './store.js';
import { Hits, Kinds, Selection } from './selection.js';
import { Tools, defaultLattice, optionsOf } from './tools.js';
import { drawAgents, drawFloor, drawLattice, drawSelection, drawSolids, pixel, readTheme } from './drawing.js';
import { Layers } from './layers.js';
import { Jobs, isOver } from './jobs.js';
import { Minimap } from './minimap.js';
import { Watch } from './watch.js';
import { Suite } from './suite.js';
import { worldPanel } from './panel-world.js';
import { robotsPanel } from './panel-robots.js';
import { planPanel } from './panel-plan.js';
import { watchPanel } from './panel-watch.js';
import { command, menu, offer, palette, register, run, sheet, shownKey } from './commands.js';
import { asSentence, keyOfPlace, placeInWords } from './places.js';
import { save, saveAs } from './save.js';
import { readLink, writeLink } from './link.js';
import { comeIn } from './door.js';

const TABS = [['world', 'World'], ['robots', 'Robots'], ['plan', 'Plan'], ['watch', 'Watch']];

const store = new Store();
const app = {
  store, presets: [], artefacts: [], open: {}, current: 'world', settings: {
    snap: true, lattice: 0.1, showLattice: true, paint: 'blocked', brush: 1, robot: null, place: 'start', mover: 1,
  },
  pixel,
  get editing() { return ['world', 'robots'].includes(app.current) || !app.watch.open; },
  /** The stage that commands of the view are about. */
  get view() { return app.editing ? app.stage : app.watch.stage; },
  tab, moved, took,
};
readTheme();
app.selection = new Selection(store);
app.kinds = new Kinds(store);
app.hits = new Hits(store, app.kinds);
app.stage = new Stage($('pane-edit'), { scene: $('scene') });
app.layers = new Layers(store, () => { app.stage.invalidate(); panels.world.draw(); });
app.tools = new Tools(app);
app.jobs = new Jobs((id, before) => jobChanged(id, before));
app.watch = new Watch(app);
app.suite = new Suite(app, () => { if (app.current === 'watch') panels.watch.draw(); });
const minimap = new Minimap($('minimap'), { stageOf: () => app.view, store, shown: () => app.editing || app.watch.panes.length === 1 });
const panels = {
  world: worldPanel(app, $('tab-world')), robots: robotsPanel(app, $('tab-robots')),
  plan: planPanel(app, $('tab-plan')), watch: watchPanel(app, $('tab-watch')),
};

// ---- The stage ---------------------------------------------------------------------------

const { stage, selection, tools, settings, layers, watch, jobs } = app;

/** Agents that a problem is about. */
const troubled = () => new Set(store.problems.flatMap((problem) => problem.agents ?? []));

stage.add({ name: 'floor', draw: (pen) => drawFloor(pen, stage, store.document) });
stage.add({
  name: 'lattice', draw(pen) {
    if (settings.showLattice && !store.map) drawLattice(pen, stage, boundsOf(store.document.ground), settings.lattice, 0.55);
  },
});
stage.add({ name: 'clearance', draw: (pen) => layers.draw(pen, stage, ['clearance']) });
stage.add({ name: 'solids', draw: (pen) => drawSolids(pen, stage, store.document) });
stage.add({ name: 'views', draw: (pen) => layers.draw(pen, stage, ['grid', 'roadmap']) });
stage.add({
  name: 'agents', draw(pen) {
    drawAgents(pen, stage, { agents: store.agents, kinds: app.kinds, problems: troubled(), chosen: new Set(selection.agents) });
  },
});
stage.add({
  name: 'selection', plane: 'over', draw(pen) {
    drawSelection(pen, stage, { store, kinds: app.kinds, selection, handles: tools.handles(), tool: tools });
  },
});

stage.add(scaleBar());

stage.grab = (x, y, event) => tools.grab(x, y, event);
stage.on('pick', () => { if (tools.tool.id === 'select') selection.set([]); });
stage.on('hover', (px, py) => {
  const at = px === undefined ? null : [stage.fromX(px), stage.fromY(py)];
  tools.hover(at);
  const over = at && tools.tool.id === 'select' && (app.hits.at(at, tools.near()).length > 0);
  stage.scene.classList.toggle('over-thing', Boolean(over));
  $('place').textContent = at ? `${tidy(at[0], 2)}, ${tidy(at[1], 2)} m` : '';
});
stage.on('camera', () => moved());
stage.on('drawn', () => minimap.draw());
$('scene').addEventListener('keydown', (event) => {
  if (tools.key(event)) {
    event.preventDefault();
    event.stopPropagation();
  }
}, { capture: true });
addEventListener('keydown', (event) => { if (event.key === 'Control' || event.key === ' ') tools.panning = event.key === ' ' && event.target === $('scene'); });
addEventListener('keyup', (event) => { if (event.key === ' ') tools.panning = false; });
onTheme(() => {
  readTheme();
  stage.invalidate('ground');
  watch.drawMarks();
  panels[app.current].draw();
});

// ---- What changes ------------------------------------------------------------------------

let shownGround = null;

store.on((what) => {
  stage.invalidate();
  if (what === 'refusal') return showRefusal(store.refusal);
  if (what !== 'document') return;
  const bounds = boundsOf(store.document.ground).join();
  if (bounds !== shownGround) {
    const first = shownGround === null;
    shownGround = bounds;
    const [l, b, r, t] = boundsOf(store.document.ground);
    $('stages').style.setProperty('--tall', (t - b) / Math.max(r - l, 1e-9));
    stage.detail = Math.max(0.25, ...Object.keys(store.document.robots).map((name) => app.kinds.outline(name).reach));
    if (first) {
      settings.lattice = defaultLattice(store.document.ground);
      stage.fit(boundsOf(store.document.ground));
    } else stage.bounds = boundsOf(store.document.ground);
  }
  if (!tools.possible.includes(tools.tool)) tools.choose('select');
  drawTools();
  drawPanel();
  tellStatus();
  artefactsLater();
});
selection.on(() => {
  stage.invalidate();
  drawPanel();
  tellStatus();
  moved();
});
tools.on(() => {
  drawTools();
  moved();
});
watch.on((what) => {
  if (what === 'time') {
    panels.watch.drawLanes();
    return moved();
  }
  if (what === 'shown') {
    drawTools();
    tellStatus();
  }
  if (app.current === 'watch') panels.watch.draw();
  moved();
});

function jobChanged(id, before) {
  const job = jobs.get(id);
  panels.plan.drawJobs();
  if (job && before && before.state !== job.state && job.state === 'done') say(`job ${id} is done`);
  if (job) {
    watch.changed(job);
    panels.plan.heard(job);
  }
  app.suite.heard(job);
  if (app.current === 'watch') panels.watch.draw();
}

/** The newest plans, which are judged anew after each edit. */
const JUDGED = 8;

let artefactTimer = 0;
function artefactsLater() {
  clearTimeout(artefactTimer);
  artefactTimer = setTimeout(async () => {
    // Plans are judged against the document as it is now.
    for (const { id } of jobs.list.filter((job) => isOver(job) && job.has?.plan).slice(0, JUDGED)) jobs.refresh(id).catch(() => {});
    try {
      const answer = await api.artefacts();
      app.artefacts = Array.isArray(answer) ? answer : answer.artefacts ?? [];
      if (app.current === 'world') panels.world.draw();
    } catch { /* it is only told beside the layers */ }
  }, 300);
}

/** Draws the panel once what is going on is over: a field that is left first passes the focus on. */
let panelTimer = 0;
function drawPanel() {
  clearTimeout(panelTimer);
  panelTimer = setTimeout(() => { if (app.current !== 'watch') panels[app.current].draw(); });
}

function tellStatus() {
  const count = store.agents.length ? store.problems.length : 0, button = $('problems');
  button.textContent = count ? `⚠ ${count} problem${count === 1 ? '' : 's'}` : store.agents.length ? '✓ ready to plan' : 'no robots yet';
  button.className = count ? 'some' : store.agents.length ? 'none' : 'empty';
  $('version').textContent = store.version < 0 ? '' : `version ${store.version}${store.digest ? `, ${store.digest.slice(0, 8)}` : ''}`;
  $('version').title = store.digest;
  $('chosen').textContent = selection.size && app.editing ? `${selection.words()} selected` : '';
  if (document.activeElement !== $('name')) $('name').value = store.document.name;
  document.title = `${store.unsaved ? '• ' : ''}${store.document.name || 'no name'} – Fleetyard Studio`;
  $('unsaved').hidden = !store.unsaved;
  for (const [id, on] of [['undo', store.undoable], ['redo', store.redoable]]) $(`do-${id}`).disabled = !on;
  const empty = store.version >= 0 && !store.agents.length && !(store.world?.obstacles?.length) && !(store.map?.blocked.length) && app.editing && tools.tool.id === 'select' && !welcomed;
  $('welcome').hidden = !empty;
}
let welcomed = false;

function showRefusal(error) {
  const box = $('refusal');
  box.hidden = !error;
  if (!error) return;
  const place = placeInWords(error.place), key = keyOfPlace(error.place), isFile = place !== null && place === error.place;
  box.replaceChildren(h('div', {}, h('p', {}, asSentence(error.message)), error.hint ? h('p', { class: 'hint' }, asSentence(error.hint)) : null,
    place === null ? null : h('p', { class: 'hint' }, selection.all().includes(key) ? h('button', { type: 'button', class: 'plain', onclick: () => show([key]) }, place) : isFile ? h('code', {}, place) : place)),
  iconButton('close', 'Close', () => store.fine()));
}

/** Selects things of the document, where they can be seen. */
function show(keys) {
  if (watching()) tab('robots');
  selection.set(keys);
  run('zoom-selection');
}

function problemList() {
  const { problems, agents } = store;
  $('problem-title').textContent = !agents.length ? 'There are no robots yet' : problems.length ? 'What keeps this from being planned for' : 'Nothing keeps this from being planned for';
  $('problem-list').replaceChildren(...problems.map((problem) => h('li', {}, h('button', {
    type: 'button', onclick: () => {
      $('problem-box').close();
      const own = problem.agents ?? [];
      if (own.length) show(own.map((index) => `${problem.place?.endsWith('/goal') ? 'g' : 's'}${index}`));
      else if (!agents.length) run('tool-robot');
    },
  }, h('span', {}, asSentence(problem.error)), problem.hint ? h('small', {}, asSentence(problem.hint)) : null))));
  $('problem-box').showModal();
}

// ---- Tabs, tools ---------------------------------------------------------------------------

function tab(name, focus = false) {
  if (!(name in panels)) return;
  app.current = name;
  for (const [id] of TABS) {
    const on = id === name, button = $(`to-${id}`);
    button.setAttribute('aria-selected', String(on));
    button.tabIndex = on ? 0 : -1;
    $(`tab-${id}`).hidden = !on;
    if (on && focus) button.focus();
  }
  if (name === 'plan') panels.plan.opened();
  panels[name].draw();
  watch.layout();
  drawTools();
  tellStatus();
  stage.resize();
  moved();
}

for (const [id, title] of TABS) {
  $('tabs').append(h('button', { type: 'button', role: 'tab', id: `to-${id}`, 'aria-controls': `tab-${id}`, 'aria-selected': 'false', tabIndex: -1, onclick: () => tab(id) }, title));
}
$('tabs').addEventListener('keydown', (event) => {
  const at = TABS.findIndex(([id]) => id === app.current), to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: TABS.length - 1 }[event.key];
  if (to === undefined) return;
  tab(TABS[(to + TABS.length) % TABS.length][0], true);
  event.preventDefault();
});

function drawTools() {
  const bar = $('tools'), on = app.editing;
  bar.hidden = !on;
  $('pane-edit').dataset.tool = tools.tool.id;
  const held = bar.contains(document.activeElement) ? document.activeElement.id : null;
  bar.replaceChildren(...tools.possible.map((tool) => iconButton(tool.id, `${tool.name} (${tool.keys[0]})`, () => run(`tool-${tool.id}`), {
    id: `tool-${tool.id}`, role: 'radio', 'aria-checked': String(tool === tools.tool), tabIndex: tool === tools.tool ? 0 : -1,
  })));
  if (held) $(held)?.focus();
  $('options').replaceChildren(...on ? [h('b', {}, tools.tool.name), ...optionsOf(tools.tool)]
    : [h('b', {}, 'Watching'), h('button', { type: 'button', id: 'to-document', title: 'Back to the document', onclick: () => run('to-document') }, 'Edit'),
      h('span', { class: 'hint' }, watch.live ? 'what a click does is chosen in the panel, drag to pan' : 'click a robot to follow it, drag to pan')]);
}
$('tools').addEventListener('keydown', (event) => {
  const all = tools.possible, step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
  if (!step) return;
  tools.choose(all[(all.indexOf(tools.tool) + step + all.length) % all.length].id);
  $(`tool-${tools.tool.id}`).focus();
  event.preventDefault();
});

// ---- Files ---------------------------------------------------------------------------------

async function openFiles(files) {
  // A world or a map comes before the task or the scenario that is on it, plans and traces last.
  const rank = ({ name }) => /\.(map|world\.json)$/.test(name) ? 0 : /\.task\.json$/.test(name) ? 1 : /\.scen$/.test(name) ? 2 : 3;
  const order = [...files].sort((a, b) => rank(a) - rank(b));
  for (const file of order) {
    try {
      took(await api.open(file.name, file), file.name);
    } catch (error) {
      store.refuse(error);
      return;
    }
  }
}

function took(answer, name) {
  if (answer.recording !== undefined) {
    watch.files.set(answer.recording.id, name);
    watch.show([answer.recording.id]);
    return;
  }
  if (answer.job) {
    tab('plan');
    panels.plan.await([answer.job]);
  }
  if (!answer.document) return;
  selection.set([]);
  shownGround = null;
  watch.close();
  store.take(answer.document);
  if (app.current === 'watch') tab('world');
  say([`opened ${name}`, ...answer.notes ?? []].join('; '));
}

async function exportAs(as) {
  try {
    const files = await api.export(as);
    for (const { name, text } of files) download(new Blob([text]), name);
    store.fine();
    say(`exported ${files.map(({ name }) => name).join(', ')}`);
  } catch (error) { store.refuse(error); }
}

async function picture() {
  const canvas = app.view.picture();
  canvas.toBlob((blob) => {
    download(blob, `${store.document.name || 'studio'}.png`);
    say('picture saved');
  }, 'image/png');
}

// What is not in a file asks before it goes. A page that is loaded again by a key loses nothing.
let reloaded_ms = -Infinity;
addEventListener('keydown', (event) => { if (event.key === 'F5' || ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === 'r')) reloaded_ms = event.timeStamp; }, true);
addEventListener('beforeunload', (event) => { if (store.unsaved && performance.now() - reloaded_ms > 1000) event.preventDefault(); });
addEventListener('dragover', (event) => {
  if (![...event.dataTransfer?.types ?? []].includes('Files')) return;
  event.preventDefault();
  $('drop').hidden = false;
});
addEventListener('dragleave', (event) => { if (!event.relatedTarget) $('drop').hidden = true; });
addEventListener('drop', (event) => {
  $('drop').hidden = true;
  if (!event.dataTransfer?.files.length) return;
  event.preventDefault();
  openFiles(event.dataTransfer.files);
});
$('file').addEventListener('change', () => {
  openFiles($('file').files);
  $('file').value = '';
});

function fresh(ground, name) {
  selection.set([]);
  const { robots, views, seed } = store.document;
  store.edit({ op: 'replace', document: { name, ground, robots, agents: [], seed, views } });
  shownGround = null;
}

// ---- Commands --------------------------------------------------------------------------------

const some = () => app.editing && selection.size > 0;
const watching = () => !app.editing;
const chosenRobot = () => watch.panes[0].recording.ids[watch.panes[0].scene.selected];
/** True while a robot of a fleet that drives is chosen. */
const driven = () => watching() && Boolean(watch.live) && watch.panes[0].scene.selected >= 0;
const edit = (op) => { if (op) store.edit(op); };

/** What was copied last. */
let copied = null;
function paste(copy) {
  const [op, keys] = selection.added(copy, round(Math.max(4 * settings.lattice, 0.5))) ?? [];
  if (op) store.edit(op).then((ok) => ok && selection.set(keys));
}

register(
  { id: 'palette', name: 'Command palette', group: 'Find', keys: ['Mod+K', 'Mod+Shift+P'], icon: 'command', run: palette, hidden: true },
  { id: 'find-robot', name: 'Find a robot by its number', group: 'Find', keys: ['Mod+F'], run: () => {
    tab(watching() ? 'watch' : 'robots');
    $(watching() ? 'find-robot' : 'find-agent')?.focus();
  } },
  { id: 'help', name: 'All keys', group: 'Find', keys: ['?', 'F1'], icon: 'help', run: sheet },
  { id: 'problems', name: 'Problems of the document', group: 'Find', keys: ['Shift+P'], run: problemList },
  { id: 'leave', name: 'Leave: tool, selection, following', group: 'Find', keys: ['Escape'], run: () => {
    if (store.refusal) store.fine();
    else if (watching()) watch.select(-1);
    else tools.leave();
  } },
  ...TABS.map(([id, title], at) => ({ id: `tab-${id}`, name: `Panel: ${title}`, group: 'View', keys: [String(at + 1)], run: () => tab(id, true) })),

  { id: 'undo', name: 'Undo', group: 'Edit', keys: ['Mod+Z'], icon: 'undo', when: () => store.undoable, run: () => store.undo().then((ok) => ok && say('undone')) },
  { id: 'redo', name: 'Redo', group: 'Edit', keys: ['Mod+Shift+Z', 'Mod+Y'], icon: 'redo', when: () => store.redoable, run: () => store.redo().then((ok) => ok && say('done again')) },
  { id: 'delete', name: 'Delete what is selected', group: 'Edit', keys: ['Delete', 'Backspace'], icon: 'trash', when: some, run: () => { edit(selection.removed()); say('deleted'); } },
  { id: 'duplicate', name: 'Duplicate what is selected', group: 'Edit', keys: ['Mod+D'], icon: 'copy', when: some, run: () => paste(selection.copy) },
  // A text that is selected is copied as such.
  { id: 'copy', name: 'Copy what is selected', group: 'Edit', keys: ['Mod+C'], when: () => some() && getSelection().isCollapsed, run: () => { copied = selection.copy; say(`${selection.words()} copied`); } },
  { id: 'paste', name: 'Paste what was copied', group: 'Edit', keys: ['Mod+V'], when: () => app.editing && copied !== null, run: () => paste(copied) },
  { id: 'swap', name: 'Swap start and goal', group: 'Edit', when: () => app.editing && selection.agents.length > 0, run: () => edit(setAgents(store, selection.agents, ({ start, goal, ...rest }) => ({ ...rest, start: goal, goal: start }))) },
  { id: 'any-heading', name: 'Let headings be any', group: 'Edit', when: () => app.editing && selection.agents.length > 0, run: () => edit(setAgents(store, selection.agents, (agent) => ({ ...agent, start: agent.start.slice(0, 2), goal: agent.goal.slice(0, 2) }))) },
  { id: 'all', name: 'Select everything', group: 'Edit', keys: ['Mod+A'], when: () => app.editing, run: () => selection.set(selection.all()) },
  { id: 'next', name: 'Select the next thing', group: 'Edit', keys: ['.'], when: () => app.editing, run: () => { selection.next(1); say(selection.words()); } },
  { id: 'previous', name: 'Select the thing before', group: 'Edit', keys: [','], when: () => app.editing, run: () => { selection.next(-1); say(selection.words()); } },

  ...tools.all.map((tool) => ({ id: `tool-${tool.id}`, name: `Tool: ${tool.name}`, group: 'Tools', keys: tool.keys, when: () => app.editing && tools.possible.includes(tool), run: () => { tools.choose(tool.id); welcomed = true; tellStatus(); $('scene').focus(); } })),
  { id: 'snap', name: 'Snap to the lattice, or not', group: 'Tools', keys: ['S'], when: () => app.editing, run: () => { settings.snap = !settings.snap; say(settings.snap ? 'snaps' : 'does not snap'); drawPanel(); } },

  { id: 'in', name: 'Zoom in', group: 'View', keys: ['+', '='], icon: 'plus', run: () => app.view.zoom(1.25) },
  { id: 'out', name: 'Zoom out', group: 'View', keys: ['-'], icon: 'minus', run: () => app.view.zoom(0.8) },
  { id: 'fit', name: 'Show everything', group: 'View', keys: ['0'], icon: 'fit', run: () => app.view.fit() },
  { id: 'zoom-selection', name: 'Zoom to what is selected', group: 'View', keys: ['Z'], when: some, run: () => {
    const [l, b, r, t] = selection.box();
    stage.look({ x: (l + r) / 2, y: (b + t) / 2, scale: Math.max(stage.camera.scale, Math.min(0.4 * Math.min(stage.width / Math.max(r - l, 1e-9), stage.height / Math.max(t - b, 1e-9)), stage.fitScale * 4)) });
  } },
  ...[['grid', 'G'], ['roadmap', 'R'], ['clearance', 'C']].map(([name, key]) => ({ id: `layer-${name}`, name: `Layer: ${name}`, group: 'View', keys: [`Shift+${key}`], when: () => app.editing, run: () => {
    layers.show(name, !layers.all[name].visible);
    say(`${name} ${layers.all[name].visible ? 'shown' : 'hidden'}`);
    moved();
  } })),
  { id: 'minimap', name: 'Minimap', group: 'View', keys: ['Shift+M'], run: () => { minimap.wanted = !minimap.wanted; minimap.draw(); } },

  { id: 'plan', name: 'Plan with the chosen planners', group: 'Plan', keys: ['Mod+Enter'], run: () => { tab('plan'); panels.plan.start(); } },
  { id: 'look', name: 'Refresh the list of planners', group: 'Plan', run: () => { tab('plan'); panels.plan.look(); } },
  { id: 'fleet', name: 'Lifelong fleet: robots that get new goals, on and on', group: 'Plan', run: () => panels.plan.fleet() },

  { id: 'play', name: 'Play or pause', group: 'Watch', keys: ['Space', 'K'], when: watching, run: () => watch.play() },
  ...[['back', 'Back by 1 s', 'ArrowLeft', -1], ['on', 'On by 1 s', 'ArrowRight', 1], ['back-10', 'Back by 10 s', 'Shift+ArrowLeft', -10], ['on-10', 'On by 10 s', 'Shift+ArrowRight', 10], ['frame-back', 'A frame back', ',', -1 / 60], ['frame-on', 'A frame on', '.', 1 / 60]]
    .map(([id, name, key, by]) => ({ id, name, group: 'Watch', keys: [key], when: watching, run: () => watch.by(by) })),
  { id: 'begin', name: 'To the start', group: 'Watch', keys: ['Home'], when: watching, run: () => watch.goTo(0) },
  { id: 'end', name: 'To the end', group: 'Watch', keys: ['End'], when: watching, run: () => watch.goTo(watch.clock.end) },
  { id: 'slower', name: 'Slower', group: 'Watch', keys: ['['], when: watching, run: () => watch.otherSpeed(-1) },
  { id: 'faster', name: 'Faster', group: 'Watch', keys: [']'], when: watching, run: () => watch.otherSpeed(1) },
  { id: 'hold', name: 'Delay the chosen robot', group: 'Live fleet', keys: ['D'], when: driven, run: () => watch.live.hold(chosenRobot()) },
  { id: 'break', name: 'Break the chosen robot, or repair it', group: 'Live fleet', keys: ['B'], when: driven, run: () => watch.live.break(chosenRobot()) },
  { id: 'end-fleet', name: 'End the fleet with what it has', group: 'Live fleet', when: () => Boolean(watch.live), run: () => watch.live.stop() },
  { id: 'earlier', name: 'Contact or violation before', group: 'Watch', keys: ['P'], when: watching, run: () => watch.nextMoment(-1) },
  { id: 'later', name: 'Next contact or violation', group: 'Watch', keys: ['N'], when: watching, run: () => watch.nextMoment(1) },

  { id: 'open', name: 'Open a file', group: 'File', keys: ['Mod+O'], icon: 'open', run: () => $('file').click() },
  { id: 'save', name: 'Save', group: 'File', keys: ['Mod+S'], icon: 'save', run: () => save(store) },
  { id: 'save-as', name: 'Save under another name', group: 'File', icon: 'save', run: () => saveAs(store) },
  { id: 'picture', name: 'Picture of the map (PNG)', group: 'File', keys: ['Mod+Shift+S'], icon: 'camera', run: picture },
  { id: 'copy-link', name: 'Copy the link to this view', group: 'File', icon: 'copy', run: () => navigator.clipboard.writeText(location.href).then(() => say('copied'), () => store.refuse({ message: 'the clipboard is closed to this page', hint: 'copy the address' })) },
  { id: 'to-document', name: 'Back to the document', group: 'View', when: watching, run: () => tab('world') },
  { id: 'new-world', name: 'New world of 10 × 6 m', group: 'File', icon: 'rectangle', run: () => fresh({ world: { bounds_m: [0, 0, 10, 6], obstacles: [], movers: [] } }, 'untitled') },
  { id: 'new-map', name: 'New map of 16 × 16 cells', group: 'File', icon: 'grid', run: () => fresh({ map: { rows: 16, cols: 16, cell_size_m: 1, blocked: [], workstations: [], endpoints: [] } }, 'untitled') },
);

offer((query) => {
  const number = /^\d+$/.test(query) ? Number(query) : null;
  return number !== null && number < store.agents.length ? [{ name: `${number}: select robot ${number}`, group: 'Robots', run: () => {
    if (watching()) return watch.select(number);
    selection.set([`s${number}`, `g${number}`]);
    run('zoom-selection');
  } }] : [];
});
offer(() => panels.plan.planners().map((planner) => ({ name: `Plan with ${planner.id}`, group: 'Planners', run: () => { tab('plan'); panels.plan.add(planner.id); } })));

for (const id of ['undo', 'redo']) $('history').append(iconButton(id, `${command(id).name} (${shownKey(command(id).keys[0])})`, () => run(id), { id: `do-${id}`, disabled: true }));
for (const id of ['open', 'save']) $('files').append(iconButton(id, `${command(id).name} (${shownKey(command(id).keys[0])})`, () => run(id), { id: `do-${id}` }));
for (const [id, name, choices] of [
  ['export', 'Export', () => [...forms.map(({ as }) => `export-${as}`), 'picture', 'copy-link']],
  ['more', 'More of files', () => ['new-world', 'new-map', 'open', 'save', 'save-as']],
]) {
  const button = iconButton(id, name, () => {}, { id });
  $('files').append(button);
  menu(button, () => choices().map(command));
}
$('find').append(h('button', { type: 'button', class: 'wide', id: 'to-palette', 'aria-label': 'Command palette', onclick: () => run('palette') }, icon('command'), h('span', {}, 'Commands'), h('kbd', {}, shownKey('Mod+K'))), iconButton('help', 'All keys (?)', () => run('help')));
for (const id of ['in', 'out', 'fit']) $('views').append(iconButton(command(id).icon, `${command(id).name} (${shownKey(command(id).keys[0])})`, () => run(id)));
$('problems').addEventListener('click', problemList);
$('name').addEventListener('change', () => store.edit({ op: 'set-name', name: $('name').value.trim() }));
$('name').addEventListener('keydown', ({ key }) => { if (key === 'Enter') $('name').blur(); });
for (const dialog of document.querySelectorAll('dialog')) dialog.addEventListener('click', (event) => { if (event.target === dialog) dialog.close(); });
$('welcome').append(h('div', {}, h('h2', {}, 'An empty room'), h('ol', {},
  h('li', {}, 'Draw walls, or drop a map, a world or a task here.'), h('li', {}, 'Drag robots from their starts to their goals.'), h('li', {}, 'Plan with any planner, and watch.')),
h('div', { class: 'row' }, h('button', { type: 'button', class: 'primary', onclick: () => run('tool-rectangle') }, 'Draw walls'), h('button', { type: 'button', onclick: () => run('tool-robot') }, 'Place robots'), h('button', { type: 'button', onclick: () => run('open') }, 'Open'))));

// ---- The link, and the beginning ---------------------------------------------------------------

/** The forms in which the document can be written. */
let forms = [];
async function recordings() {
  for (const { id, name } of await api.recordings()) watch.files.set(id, name);
  panels.watch.draw();
}

let begun = false;
function moved() {
  if (!begun) return;
  const { camera: { x, y, scale }, bounds: [l, b, r, t], fitScale } = app.view;
  const whole = Math.abs(scale / fitScale - 1) < 1e-6 && Math.hypot(x - (l + r) / 2, y - (b + t) / 2) * scale < 1;
  const scene = watching() ? watch.panes[0].scene : null;
  writeLink(() => ({
    tab: app.current, tool: tools.tool.id === 'select' ? null : tools.tool.id,
    at: whole ? null : [x, y].map((value) => tidy(value, 3)).concat(scale.toPrecision(5)).join(','),
    sel: app.editing ? [...selection.keys].slice(0, 50).join(',') : null,
    layers: Object.values(layers.all).filter(({ visible }) => visible).map(({ name }) => name).join(','),
    watch: watch.open ? watch.ids.join(',') : null, t: watch.open ? tidy(watch.clock.now, 3) : null,
    robot: scene && scene.selected >= 0 ? watch.panes[0].recording.ids[scene.selected] : null,
    follow: scene?.following ? 1 : null,
  }));
}

function heard(message) {
  if (message.type === 'recordings') recordings().catch(() => {});
  if (message.type === 'job-gone') jobs.gone(message.id);
  if (message.type === 'newcomer') store.refuse({ message: 'another browser came in', hint: 'if that was not you, end the studio' });
  if (message.type === 'refused') store.refuse({ message: message.error, hint: null });
  if (message.type === 'changed' && message.version !== store.version && !store.pending.length) store.load().catch(() => {});
  if (message.type === 'job' && message.job) {
    jobs.take(message.job);
    // Records are long: they are asked for once, at the end.
    if (isOver(message.job)) jobs.refresh(message.job.id).catch(() => {});
  }
}

async function begin() {
  try {
    await comeIn();
    await store.load();
  } catch (error) {
    store.refuse(error);
    return;
  }
  await Promise.allSettled([
    api.presets().then((found) => { app.presets = found; for (const preset of found) app.kinds.presets.set(preset.name, preset); }),
    jobs.load(),
    recordings(),
    app.suite.load(),
    api.exports().then((found) => {
      forms = found;
      register(...found.map(({ as, about }) => ({ id: `export-${as}`, name: `Export ${as}: ${about}`, short: about.charAt(0).toUpperCase() + about.slice(1), mark: as, group: 'File', icon: 'export', run: () => exportAs(as) })));
    }),
  ]);
  const wish = readLink();
  for (const name of wish.layers) if (name in layers.all) layers.show(name, true);
  watch.feed = new Feed({
    text: heard, clip: (job, bytes) => watch.clip(job, bytes),
    state: (on) => {
      $('connection').className = on ? '' : 'lost';
      $('connection').textContent = on ? 'connected' : 'no connection';
      // What happened meanwhile was not told.
      if (on) Promise.all([store.load(), jobs.load()]).catch(() => {});
    },
  });
  if (wish.watched.length) await watch.show(wish.watched, { tab: false, at: wish.time });
  tab(TABS.some(([id]) => id === wish.tab) ? wish.tab : app.suite.about ? 'watch' : 'world');
  if (wish.tool) tools.choose(wish.tool);
  selection.set(wish.selection.filter((key) => selection.all().includes(key)));
  if (wish.robot !== null && watch.open) watch.select(wish.robot, wish.follow);
  if (wish.camera) app.view.look({ x: wish.camera[0], y: wish.camera[1], scale: wish.camera[2] });
  // The address of a trial becomes that of what is shown of it.
  if (wish.trial !== null) await app.suite.open(wish.trial);
  else if (!wish.watched.length) await app.suite.begin();
  begun = true;
  moved();
  document.documentElement.dataset.ready = 'true';
}

globalThis.studio = app;
begin();

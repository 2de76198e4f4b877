// The panel of watching: what is shown, overlays, the selected robot, all robots over time.

import { h, fill, check, field, number, section, select, say, tidy } from './dom.js';
import { run } from './commands.js';
import { HEAT, theme } from './drawing.js';
import { drawThroughput, throughputWords } from './charts.js';
import { pointsOf } from './jobs.js';
import { violationList } from './panel-plan.js';
import { asSentence, inRobots } from './places.js';
import { CLICKS } from './live.js';
import { COLUMNS } from './survey.js';
import { OVERLAYS } from './watch.js';
import { chainOf, cyclesOf, inWords } from './waits.js';

const COLORS = { agent: 'number', kind: 'kind', state: 'state', delay: 'waiting so far', priority: 'priority' };
const STATES = ['moving', 'turning', 'waiting', 'parked'];
const SHOWN = 100;
/** Cycles and robots that waited longest, as many as are told. */
const TOLD = 5;

export function watchPanel(app, node) {
  const { watch, jobs } = app;
  const lanes = h('canvas', { class: 'wide', role: 'img', 'aria-label': 'All robots over time' });
  lanes.addEventListener('click', (event) => {
    const box = lanes.getBoundingClientRect(), { recording, survey } = watch.panes[0];
    watch.clock.seek((event.clientX - box.left) / box.width * recording.end_s);
    if (survey) watch.select(recording.ids[Math.min(recording.count - 1, Math.floor((event.clientY - box.top) / box.height * recording.count))]);
  });

  function chooser() {
    const offers = watch.offers;
    const toggle = (id) => (on) => {
      const ids = on ? [...watch.ids, id] : watch.ids.filter((other) => other !== id);
      if (ids.length > 4) {
        say('four side by side at most');
        return draw();
      }
      if (ids.length) watch.show(ids, { at: watch.clock.now });
      else watch.close();
    };
    return section('Recordings',
      offers.length ? null : h('p', { class: 'soft' }, 'None yet. Plan with “Execute the plan”, or open a trace.'),
      ...offers.map(([id, name]) => check(name, watch.ids.includes(id), toggle(id), { 'data-key': `recording-${id}` })),
      offers.length ? null : h('div', { class: 'row' }, h('button', { type: 'button', class: 'primary', onclick: () => app.tab('plan') }, 'To the planners'), h('button', { type: 'button', onclick: () => run('open') }, 'Open a file')));
  }

  function overlays() {
    if (!watch.open) return null;
    const walking = watch.panes.find((pane) => pane.surveying);
    const { recording } = watch.panes[0], { priorities } = recording;
    return section('Show',
      h('div', { class: 'pair' }, ...OVERLAYS.filter(([name]) => watch.live ? ['trails', 'goals', 'numbers', 'waits'].includes(name) : name !== 'annotations' || watch.panes.some(({ recording }) => recording.layers.length))
        .map(([name, title]) => check(title, watch.show_[name], (on) => watch.overlay(name, on), { 'data-key': `overlay-${name}` }))),
      watch.show_.reservations ? field('Window', number(watch.window_s, (value) => { watch.window_s = value; watch.stage.invalidate(); }, { min: 0.1, max: 600, 'data-key': 'window' }), 's') : null,
      watch.show_.reservations ? h('p', { class: 'note' }, reserved()) : null,
      field('Colour by', select(watch.colorings.map((by) => [by, COLORS[by]]), watch.colorings.includes(watch.coloring) ? watch.coloring : 'agent', (by) => watch.color(by), { 'data-key': 'color' })),
      watch.coloring === 'state' ? legend() : null,
      watch.coloring === 'delay' ? scale(['0 s', longest]) : null,
      watch.coloring === 'priority' && priorities ? scale([`last: ${priorities.last + 1}`, 'first: 1']) : null,
      walking ? h('p', { class: 'note', role: 'status' }, `Walking through the recording: ${Math.round(100 * (walking.share ?? 0))} %`) : null);
  }

  /** A scale of colours with the meaning of its ends. */
  const scale = ([least, most]) => h('p', { class: 'legend ends' }, h('span', {}, least), gradient(), h('span', {}, most));

  function gradient() {
    const bar = h('i', { class: 'scale', 'aria-hidden': 'true' });
    bar.style.background = `linear-gradient(to right, ${HEAT.join(',')})`;
    return bar;
  }

  /** The source of the reservations, in words. */
  function reserved() {
    const told = watch.panes.map((pane) => pane.reserved).filter(Boolean);
    if (told.length < watch.panes.length) return 'Where robots will be. Dark is soon, light is later.';
    return `${told.every(({ view }) => view === 'grid') ? 'Cells' : told.every(({ view }) => view === 'roadmap') ? 'Vertices and edges' : 'Cells, vertices and edges'} that the plan keeps, at the times of the plan, which robots that go by order may be behind. Dark is soon, light is later.${told.some(({ complete }) => !complete) ? ' Those of robots with high numbers are left out.' : ''}`;
  }

  // What changes while time goes on; the rest of the panel is left alone meanwhile.
  const longest = h('span', { id: 'longest' }), own = h('dd', { id: 'own-wait' }), chain = h('p', { id: 'chain' }), waits = h('div', { id: 'waits' });

  const toRobot = (agent, text = String(agent)) => h('button', { type: 'button', 'data-key': `wait-${agent}`, onclick: () => watch.select(agent) }, text);

  function tellNow() {
    const pane = watch.panes[0];
    if (!pane) return;
    const { recording, scene, motion } = pane, i = scene.selected;
    const put = (node, text) => { if (node.textContent !== text) node.textContent = text; };
    if (motion.waited) {
      const seconds = motion.waited(recording.fleet, recording.meta.arrivals);
      put(longest, `${tidy(scene.longWait, 1)} s`);
      put(own, i < 0 ? '' : `${tidy(seconds[i], 1)} s so far`);
    } else for (const node of [longest, own]) put(node, '…');
    if (!watch.show_.waits) return;
    const all = pane.waits.at(scene.now);
    if (!all) {
      put(chain, '');
      return put(waits, pane.waits.why ? `${pane.waits.why.charAt(0).toUpperCase()}${pane.waits.why.slice(1)}.` : 'Asking …');
    }
    const parts = i < 0 ? [] : chainOf(all, recording.ids[i]);
    put(chain, i < 0 ? '' : `Robot ${recording.ids[i]} ${inWords(parts)}.`);
    const cycles = cyclesOf(all);
    const told = `${all.size ? `${all.size} of ${recording.count} robots wait` : 'Nobody waits'}${cycles.length ? `, ${cycles.length === 1 ? 'and there is a cycle' : `and there are ${cycles.length} cycles`}` : ''}.`;
    const key = `${told} ${parts} ${cycles.slice(0, TOLD).join('; ')}`;
    if (waits.dataset.told === key && waits.childElementCount) return;
    waits.dataset.told = key;
    fill(waits, h('p', {}, told),
      parts.length > 1 ? h('div', { class: 'row' }, ...[...new Set(parts.slice(1, 13))].filter((other) => other !== 'message').map((other) => toRobot(other))) : null,
      ...cycles.slice(0, TOLD).map((ring) => h('p', { class: 'cycle' }, `Cycle: ${[...ring.slice(0, 12), ring.length > 12 ? '…' : ring[0]].join(' → ')} `, toRobot(ring[0], 'Show'))));
  }
  watch.on((what) => { if (what === 'time' || what === 'waits') tellNow(); });

  function dependencies() {
    if (!watch.open || !watch.show_.waits) return null;
    return section('Who waits for whom', chain, waits, h('ul', { class: 'legend' },
      h('li', {}, 'arrow: to the robot that has to go on first'), h('li', {}, 'thick: from the selected robot on'), h('li', {}, 'dashed: a cycle'), h('li', {}, 'bubble: waits for a message')));
  }

  const legend = () => h('ul', { class: 'legend' }, ...STATES.map((state) => h('li', {}, h('i', { class: state }), state)));

  /** What a fleet that drives says, and what is done to it. */
  function live() {
    const { live } = watch;
    if (!live) return null;
    const { job } = live, point = job.point ?? {}, { held, closed } = live.effects(watch.clock.end);
    const per_s = point.time_s > 0 ? `${(point.goals_reached / point.time_s).toFixed(2)} per second` : '–';
    const done = (all, word) => all.size ? `${all.size} ${word}` : 'none';
    const id = watch.panes[0].scene.selected < 0 ? null : watch.panes[0].recording.ids[watch.panes[0].scene.selected];
    const { rows, cols } = live.cells ?? { rows: 0, cols: 0 };
    const cell = () => place.row * cols + place.col;
    const points = pointsOf(jobs.get(job.id) ?? job), curve = points.length > 1 ? h('canvas', { class: 'chart', role: 'img', 'aria-label': throughputWords(points) }) : null;
    if (curve) new ResizeObserver(() => drawThroughput(curve, points)).observe(curve);
    return section('The fleet, live', curve,
      h('dl', { class: 'facts' }, ...[['goals', `${point.goals_reached ?? 0}, ${per_s}`], ['robots held', done(held, 'held')], ['cells blocked', done(closed, 'blocked')]]
        .flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)])),
      field('A click is to', select(CLICKS, live.click, (click) => { live.click = click; }, { 'data-key': 'live-click' })),
      h('div', { class: 'row' },
        h('button', { type: 'button', disabled: id === null, 'data-key': 'live-hold', onclick: () => live.hold(id) }, 'Delay'),
        h('button', { type: 'button', disabled: id === null, 'data-key': 'live-break', onclick: () => live.break(id) }, held.has(id) ? 'Repair' : 'Break'),
        h('span', { class: 'grow soft' }, id === null ? 'the robot that is chosen' : `robot ${id}`)),
      cols ? h('details', { class: 'more', open: place.open, ontoggle: ({ target }) => { place.open = target.open; } }, h('summary', { 'data-key': 'live-cell' }, 'A cell by its row and column'),
        h('div', { class: 'pair' },
          field('Row', number(place.row, (row) => { place.row = row; }, { min: 0, max: rows - 1, step: 1, 'data-key': 'live-row' })),
          field('Column', number(place.col, (col) => { place.col = col; }, { min: 0, max: cols - 1, step: 1, 'data-key': 'live-col' }))),
        h('div', { class: 'row' },
          h('button', { type: 'button', 'data-key': 'live-close', onclick: () => live.close(cell()) }, 'Block or open it'),
          h('button', { type: 'button', disabled: id === null, 'data-key': 'live-send', onclick: () => live.send(id, cell()) }, 'Send the robot there'))) : null,
      h('p', { class: 'note' }, 'All that is done is in the recording of the fleet, and a replay does it again.'));
  }
  const place = { row: 0, col: 0, open: false };

  function robot() {
    if (!watch.open) return null;
    const { recording, scene } = watch.panes[0], i = scene.selected;
    const pick = h('input', { type: 'number', min: 0, step: 1, placeholder: 'number', class: 'short', id: 'find-robot', 'aria-label': 'Follow a robot by its number', 'data-key': 'follow', value: i < 0 ? '' : recording.ids[i], onchange: () => {
      const wanted = pick.value === '' ? -1 : Number(pick.value);
      if (wanted >= 0 && recording.agent(wanted) < 0) say(`there is no robot ${wanted}`);
      watch.select(wanted);
    } });
    const id = i < 0 ? null : recording.ids[i];
    const touched = i < 0 ? [] : recording.contacts.filter(({ a, b }) => recording.isOf(a, id) || recording.isOf(b, id));
    return section('Robot', h('div', { class: 'row' }, h('span', { class: 'grow soft' }, i < 0 ? 'Click one to follow it.' : asSentence(recording.nameOf(id)).slice(0, -1)), h('span', {}, pick)),
      i < 0 ? null : h('dl', { class: 'facts' },
        ...[['arrived', recording.meta.arrivals.length ? recording.meta.arrivals[i] === null ? 'never' : `at ${tidy(recording.meta.arrivals[i], 2)} s` : null], ['contacts', String(touched.length)], ['priority', recording.priorities?.of.has(id) ? `${recording.priorities.of.get(id) + 1} of ${recording.priorities.last + 1}` : null], ['waited', watch.coloring === 'delay' || watch.panes[0].survey ? own : null]]
          .filter(([, value]) => value !== null).flatMap(([name, value]) => [h('dt', {}, name), value === own ? own : h('dd', {}, value)])));
  }

  function trouble() {
    if (!watch.open || watch.live) return null;
    const parts = [];
    for (const pane of watch.panes) {
      const { recording, id } = pane, job = jobs.get(id);
      if (watch.panes.length > 1) parts.push(h('h3', {}, watch.nameOf(id)));
      if (pane.violations.length) parts.push(violationList(app, job, pane.violations));
      const { contacts } = recording;
      parts.push(h('h3', {}, contacts.length ? `${recording.meta.contacts_total} contact${recording.meta.contacts_total === 1 ? '' : 's'}` : 'No contacts'));
      if (contacts.length) {
        parts.push(h('ol', { class: 'list' }, ...contacts.slice(0, SHOWN).map((contact) => h('li', {}, h('button', { type: 'button', onclick: () => pane.scene.point(contact) },
          h('span', {}, `${tidy(contact.from, 2)} s`), h('span', {}, [contact.a, contact.b].map((body) => inRobots(recording.shortOf(body))).join(' × ')), h('small', {}, contact.open ? 'to the end' : `${tidy(contact.to - contact.from, 2)} s`))))));
      }
    }
    return section('Contacts and violations', ...parts);
  }

  function timelines() {
    if (!watch.open || watch.live) return null;
    const { survey } = watch.panes[0];
    return section('All robots over time',
      survey ? lanes : h('div', { class: 'row' }, h('button', { type: 'button', 'data-key': 'walk', disabled: Boolean(watch.panes[0].surveying), onclick: () => { watch.look(watch.panes[0]); draw(); } }, 'Draw them')),
      survey ? legend() : h('p', { class: 'note' }, 'Needs a walk through the whole recording.'));
  }

  function facts() {
    if (!watch.open) return null;
    const { meta } = watch.panes[0].recording;
    return section('About', h('dl', { class: 'facts' }, ...meta.facts.flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)])), ...meta.notes.map((note) => h('p', { class: 'note' }, note)));
  }

  function drawLanes() {
    const survey = watch.panes[0]?.survey;
    if (!survey || !lanes.isConnected) return;
    Object.assign(lanes, { width: COLUMNS, height: Math.max(survey.shown, 1) });
    lanes.style.height = `${Math.min(170, Math.max(20, 12 * survey.shown))}px`;
    lanes.style.imageRendering = survey.shown < 100 ? 'pixelated' : 'auto';
    const pen = lanes.getContext('2d'), image = pen.createImageData(COLUMNS, survey.shown), out = new Uint32Array(image.data.buffer);
    const colors = STATES.map((state) => app.pixel(theme[state]));
    survey.lanes.forEach((state, at) => { out[at] = colors[state] ?? 0; });
    pen.putImageData(image, 0, 0);
    const x = Math.round(watch.clock.now / Math.max(watch.panes[0].recording.end_s, 1e-9) * COLUMNS);
    pen.fillStyle = theme.ink;
    pen.fillRect(x - 1, 0, 2, survey.shown);
  }

  function draw() {
    fill(node, ...app.suite.draw(), chooser(), live(), overlays(), robot(), dependencies(), trouble(), timelines(), facts());
    drawLanes();
    tellNow();
  }
  return { draw, drawLanes };
}

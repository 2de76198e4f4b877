// The panel of watching: what is shown, overlays, the selected robot, all robots over time.

import { h, fill, check, field, number, section, select, say, tidy } from './dom.js';
import { run } from './commands.js';
import { theme } from './drawing.js';
import { violationList } from './panel-plan.js';
import { CLICKS } from './live.js';
import { COLUMNS } from './survey.js';
import { OVERLAYS } from './watch.js';

const COLORS = { agent: 'number', kind: 'kind', state: 'state', delay: 'waiting so far' };
const STATES = ['moving', 'turning', 'waiting', 'parked'];
const SHOWN = 100;

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
    return section('Show',
      h('div', { class: 'pair' }, ...OVERLAYS.filter(([name]) => watch.live ? ['trails', 'numbers'].includes(name) : name !== 'annotations' || watch.panes.some(({ recording }) => recording.layers.length))
        .map(([name, title]) => check(title, watch.show_[name], (on) => watch.overlay(name, on), { 'data-key': `overlay-${name}` }))),
      watch.show_.reservations ? field('Window', number(watch.window_s, (value) => { watch.window_s = value; watch.stage.invalidate(); }, { min: 0.1, max: 600, 'data-key': 'window' }), 's') : null,
      field('Colour by', select(watch.colorings.map((by) => [by, COLORS[by]]), watch.coloring, (by) => watch.color(by), { 'data-key': 'color' })),
      watch.coloring === 'state' ? legend() : null,
      walking ? h('p', { class: 'note', role: 'status' }, `Walking through the recording: ${Math.round(100 * (walking.share ?? 0))} %`) : null);
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
    return section('The fleet, live',
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
    const touched = i < 0 ? [] : recording.contacts.filter(({ a, b }) => a === id || b === id);
    return section('Robot', h('div', { class: 'row' }, h('span', { class: 'grow soft' }, i < 0 ? 'Click one to follow it.' : recording.nameOf(id).replace('agent', 'Robot')), h('span', {}, pick)),
      i < 0 ? null : h('dl', { class: 'facts' },
        ...[['arrived', recording.meta.arrivals.length ? recording.meta.arrivals[i] === null ? 'never' : `at ${tidy(recording.meta.arrivals[i], 2)} s` : null], ['contacts', String(touched.length)]]
          .filter(([, value]) => value !== null).flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)])));
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
          h('span', {}, `${tidy(contact.from, 2)} s`), h('span', {}, `${contact.a} × ${recording.nameOf(contact.b).replace('agent ', '')}`), h('small', {}, contact.open ? 'to the end' : `${tidy(contact.to - contact.from, 2)} s`))))));
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
    fill(node, chooser(), live(), overlays(), robot(), trouble(), timelines(), facts());
    drawLanes();
  }
  return { draw, drawLanes };
}

// The page of a recording: it holds everything. `meta` is JSON (html.rs), `tracks` the ways of
// the bodies (track.rs).

import { AnnotationList } from './annotations.js';
import { Clock, SPEEDS } from './clock.js';
import { ContactList, drawMarks } from './contacts.js';
import { $, counted, make, timeText } from './dom.js';
import { Tracks } from './motion.js';
import { Recording } from './recording.js';
import { Scene } from './scene.js';
import { Stage } from './stage.js';
import { onTheme } from './theme.js';
import { Timeline, drawFleet } from './timeline.js';
import { Work } from './work.js';

const meta = JSON.parse($('meta').textContent);
const tracks = new Tracks($('tracks').textContent, meta);
for (const id of ['meta', 'tracks']) $(id).remove();
const recording = new Recording(meta);
const { count, contacts, layers, work, troubles, ids } = recording;
const end = recording.end_s, shown = timeText(end);
/** `page.html#t=12.5&agent=3&speed=10&play` begins there. */
const wish = new URLSearchParams(location.hash.slice(1));

const say = (text) => { $('status').textContent = text; };

// As tall as the map where that is wider than the screen.
const [left, bottom, right, top] = recording.bounds;
$('stage').style.setProperty('--tall', (top - bottom) / Math.max(right - left, 1e-9));
const clock = new Clock(end);
const stage = new Stage($('stage'), { ground: $('ground'), scene: $('scene') });
const scene = new Scene(stage, recording, tracks, clock, { renderer: wish.get('renderer') });
const timeline = new Timeline(scene, { figures: $('figures'), canvas: $('timeline') });
const contactList = new ContactList(scene, {
  list: $('contacts'), count: $('contact-count'), only: $('only'), onlyBox: $('only-box'), more: $('more'),
}, say);
const annotationList = new AnnotationList(scene, { layers: $('layers'), texts: $('annotations') });
const fleetWork = work && new Work(scene, {
  figures: $('work'), job: $('job'), throughput: $('throughput'), calls: $('call-times'),
  list: $('calls'), failed: $('failed'), more: $('more-calls'),
}, say);

// ---- What the page says ------------------------------------------------------------

/** Brings what is around the stage up to date. */
function told() {
  const { now } = clock, text = `${now.toFixed(end < 10 ? 2 : 1)} / ${shown(end)}`;
  if ($('clock').textContent !== text) $('clock').textContent = text;
  $('seek').value = now;
  $('seek').setAttribute('aria-valuetext', `${shown(now)} of ${shown(end)}`);
  $('fleet-now').style.left = 100 * (end ? now / end : 0) + '%';
  if (scene.selected >= 0) timeline.draw();
  fleetWork?.tell();
  if (layers.length) annotationList.tell();
  contactList.tell();
  if ($('heat').value) $('most').textContent = shown(scene.layer($('heat').value).most_s);
  if (scene.coloring === 'delay') $('longest').textContent = shown(scene.longWait);
}
for (const id of ['color-delay', 'heat-scale']) {
  $(id).querySelector('i').style.background = `linear-gradient(to right, ${meta.heat.join(',')})`;
}
stage.on('drawn', told);

clock.on('play', () => {
  $('play').setAttribute('aria-label', clock.playing ? 'Pause' : 'Play');
  $('play-icon').setAttribute('d', clock.playing ? 'M3 2h4v12H3zM9 2h4v12H9z' : 'M4 2l10 6-10 6z');
  say(clock.playing ? 'playing' : `paused at ${shown(clock.now)}`);
});
clock.on('speed', () => {
  $('speed').value = String(clock.speed);
  say(`speed ${clock.speed}×`);
});

scene.on('selected', (other) => {
  const { selected: i, following } = scene;
  if (other) {
    contactList.list();
    $('agent-none').hidden = i >= 0;
    $('agent-some').hidden = i < 0;
    if (i >= 0) timeline.describe();
  }
  $('own-box').hidden = i < 0;
  $('pick').value = i < 0 ? '' : ids[i];
  $('chip').hidden = i < 0;
  if (i >= 0) $('chip-text').textContent = `${following ? 'Following' : 'Agent'} ${ids[i]}`;
  say(i < 0 ? 'no agent selected' : following ? `following agent ${ids[i]}` : `agent ${ids[i]} selected`);
});

function repaint() {
  drawMarks($('marks'), recording);
  drawFleet($('fleet'), scene);
}
stage.on('resize', () => drawMarks($('marks'), recording));
onTheme(repaint);
// What is printed has another size, and is drawn before it is.
for (const event of ['beforeprint', 'afterprint']) {
  addEventListener(event, () => {
    stage.resize();
    stage.draw();
  });
}

// ---- The user ------------------------------------------------------------------------

const onClick = (id, action) => $(id).addEventListener('click', action);
const whole = () => {
  if (scene.following) scene.select(scene.selected, false);
  stage.fit();
};
onClick('play', () => clock.play());
onClick('earlier', () => contactList.next(-1));
onClick('later', () => contactList.next(1));
onClick('zoom-in', () => stage.zoom(1.5));
onClick('zoom-out', () => stage.zoom(1 / 1.5));
onClick('fit', whole);
onClick('release', () => scene.select(-1, false));
$('own').addEventListener('change', () => {
  scene.ownOnly = $('own').checked;
  stage.invalidate();
});
$('seek').addEventListener('input', () => clock.seek(Number($('seek').value)));
$('speed').addEventListener('change', () => clock.setSpeed(Number($('speed').value)));
$('pick').addEventListener('change', () => {
  const text = $('pick').value.trim(), i = text === '' ? -1 : recording.agent(Number(text));
  if (text !== '' && i < 0) say(`there is no agent ${text}`);
  scene.select(i, true);
});
const timeUnder = (event) => {
  const box = event.currentTarget.getBoundingClientRect();
  return (event.clientX - box.left) / box.width * end;
};
for (const id of ['timeline', 'throughput', 'call-times']) $(id).addEventListener('click', (event) => clock.seek(timeUnder(event)));
$('fleet').addEventListener('click', (event) => {
  const box = $('fleet').getBoundingClientRect();
  const i = Math.floor((event.clientY - box.top) / box.height * count);
  clock.seek(timeUnder(event));
  scene.select(Math.min(Math.max(i, 0), count - 1), true);
});

/** Switches, their layers, and what they are at first. */
const SWITCHES = {
  trails: ['trails', count <= 2000],
  paths: ['paths', false],
  ids: ['numbers', false],
  contacts: ['contacts', true],
  goals: ['goals', Boolean(work) && count <= 300],
};
for (const [name, [layer, on]] of Object.entries(SWITCHES)) {
  const box = $('show-' + name);
  box.checked = on;
  scene.show(layer, on);
  box.addEventListener('change', () => scene.show(layer, box.checked));
}
$('color').addEventListener('change', () => {
  const by = $('color').value;
  scene.color(by);
  $('color-state').hidden = by !== 'state';
  $('color-delay').hidden = by !== 'delay';
});
$('heat').addEventListener('change', () => {
  scene.heat($('heat').value);
  $('heat-scale').hidden = !$('heat').value;
});

document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const tag = event.target.tagName, type = event.target.type;
  // Fields keep the keys that they understand themselves.
  if (tag === 'SELECT' || type === 'number') return;
  if (event.key === ' ' && (tag === 'BUTTON' || tag === 'SUMMARY' || type === 'checkbox')) return;
  const by = (step) => () => { clock.play(false); clock.seek(clock.now + step); };
  const jumpBy = (step) => () => clock.seek(clock.now + (event.shiftKey ? 10 : 1) * step);
  const action = {
    ' ': () => clock.play(), k: () => clock.play(),
    ArrowLeft: jumpBy(-1), ArrowRight: jumpBy(1),
    ',': by(-1 / 60), '.': by(1 / 60),
    Home: () => clock.seek(0), End: () => clock.seek(end),
    '[': () => clock.otherSpeed(-1), ']': () => clock.otherSpeed(1),
    c: () => fleetWork?.nextTrouble(event.shiftKey ? -1 : 1),
    p: () => contactList.next(-1), n: () => contactList.next(1),
    '+': () => stage.zoom(1.25), '=': () => stage.zoom(1.25), '-': () => stage.zoom(0.8), 0: whole,
    Escape: () => scene.select(-1, false),
  }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (action) {
    action();
    event.preventDefault();
  }
});

// ---- Beginning -----------------------------------------------------------------------

for (const value of SPEEDS) $('speed').append(make('option', { value }, value + '×'));
$('speed').value = String(clock.speed);
$('seek').max = end;
$('brief').textContent = [
  counted(count, 'agent'), shown(end), ...work ? [counted(work.reached.length, 'goal')] : [],
  meta.contacts_total ? counted(meta.contacts_total, 'contact') : 'no contacts',
].join(', ');
for (const [name, value] of meta.facts) $('facts').append(make('dt', {}, name), make('dd', {}, value));
for (const note of meta.notes) $('notes').append(make('li', {}, note));
$('work-box').hidden = !work;
$('layers-box').hidden = !layers.length;
$('failed-box').hidden = !troubles.length;
$('show-goals').parentNode.hidden = !work && !meta.goals.length;
$('workstations').hidden = !meta.workstations;
$('endpoints').hidden = !meta.endpoints;
$('stations').hidden = !meta.workstations && !meta.endpoints;
if (!contacts.length) $('earlier').disabled = $('later').disabled = true;
if (!meta.headings) for (const row of document.querySelectorAll('.legend .turning')) row.parentNode.remove();
if (meta.outlines.length < 2) $('color').querySelector('[value="kind"]').remove();
$('fleet-frame').style.height = Math.min(150, Math.max(24, 14 * count)) + 'px';
contactList.list();
repaint();

if (wish.has('t')) clock.seek(Number(wish.get('t')));
if (wish.has('agent')) scene.select(recording.agent(Number(wish.get('agent'))), true);
if (Number(wish.get('zoom')) > 0) stage.zoom(Number(wish.get('zoom')));
for (const name of Object.keys(SWITCHES)) if (wish.has(name)) $('show-' + name).click();
for (const name of ['color', 'heat']) {
  const select = $(name), own = select.value;
  if (!wish.has(name)) continue;
  select.value = wish.get(name);
  // A value that is none of its own leaves a select empty.
  if (select.selectedIndex < 0) select.value = own;
  select.dispatchEvent(new Event('change'));
}
if (SPEEDS.includes(Number(wish.get('speed')))) clock.setSpeed(Number(wish.get('speed')));
if (wish.has('play')) clock.play(true);

/** For scripts that drive the page, to make the frames of a film for example. */
globalThis.replay = {
  play: (on) => clock.play(on), seek: (time_s) => clock.seek(time_s), cost: stage.cost,
  follow: (id) => scene.select(recording.agent(id), true),
  zoom: (...by) => stage.zoom(...by), fit: () => stage.fit(),
  /** Draws at once instead of at the next frame. */
  draw: () => stage.draw(),
  /** The picture as a canvas. */
  picture: () => stage.picture(),
  pose: (id) => {
    const i = recording.agent(id), { X, Y, H } = scene.fleet;
    tracks.place(clock.now, X, Y, H);
    return [X[i], Y[i], H[i]];
  },
  onScreen: (id) => {
    const i = recording.agent(id), { X, Y } = scene.fleet;
    return [stage.toX(X[i]), stage.toY(Y[i])];
  },
  get state() {
    const { now, playing, speed } = clock, { selected, following, pointed } = scene, { x, y, scale } = stage.camera;
    return { now, playing, speed, agent: ids[selected] ?? null, following, scale, x, y, pointed, renderer: scene.bodies.drawnBy };
  },
};

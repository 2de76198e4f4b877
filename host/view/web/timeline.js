// An agent's time: what it did when, and figures of it. Needs tracks.

import { make, sized, timeText } from './dom.js';
import { MOVING, PARKED, STATES, TURNING, WAITING } from './motion.js';
import { rgba, theme } from './theme.js';

/** Calls `visit(from, to, state)` for the stretches of an agent's time. */
const stretches = ({ motion, fleet, recording }, i, visit) =>
  motion.stretches(i, fleet.reach(i), recording.meta.arrivals[i], visit);

/** Figures and timeline of the selected agent. `nodes` are the list of figures and the canvas. */
export class Timeline {
  #parts = [];
  #own = [];

  constructor(scene, nodes) {
    Object.assign(this, { scene, nodes });
  }

  /** Tells of the agent that is selected. */
  describe() {
    const { scene, nodes: { figures, canvas } } = this;
    const { selected: i, recording: { ids, contacts, meta, end_s: end, count }, motion } = scene, id = ids[i];
    const shown = timeText(end), spent = STATES.map(() => 0);
    this.#parts = [];
    stretches(scene, i, (from, to, state) => {
      spent[state] += to - from;
      this.#parts.push([from, to, state]);
    });
    const own = this.#own = contacts.filter(({ a, b }) => scene.recording.isOf(a, id) || scene.recording.isOf(b, id));
    // Contacts may overlap; the time in contact is that of their union.
    let touched = 0, until = 0;
    for (const { from, to } of own) {
      touched += Math.max(0, to - Math.max(from, until));
      until = Math.max(until, to);
    }
    figures.replaceChildren();
    const put = (name, value, swatch) => {
      const text = make('dd', {}, value);
      figures.append(make('dt', {}, ...swatch ? [make('span', { className: 'swatch ' + swatch })] : [], name), text);
      return text;
    };
    const share = (time) => `${shown(time)} (${Math.round(100 * time / (end || 1))} %)`;
    put('moving', share(spent[MOVING]), 'moving');
    if (meta.headings) put('turning', share(spent[TURNING]), 'turning');
    put('waiting', share(spent[WAITING]), 'waiting');
    if (meta.arrivals.length) put('parked', share(spent[PARKED]), 'parked');
    put('in contact', own.length ? `${shown(touched)} in ${own.length} contact${own.length > 1 ? 's' : ''}` : 'never', 'contact');
    const arrived = meta.arrivals[i];
    if (meta.arrivals.length) put('arrived', arrived === null ? 'never' : `at ${shown(arrived)}`);
    put('travelled', `${motion.distance(i).toFixed(1)} m`);
    const near = put('nearest', '…');
    canvas.setAttribute('aria-label', `Agent ${id} over time: moving ${share(spent[MOVING])}, ` +
      `turning ${share(spent[TURNING])}, waiting ${share(spent[WAITING])}, parked ${share(spent[PARKED])}, ${own.length} contacts`);
    // Long recordings of many agents take a moment.
    setTimeout(() => {
      if (scene.selected !== i) return;
      const best = motion.nearest(i, count);
      if (best.other === undefined) return void (near.textContent = 'alone');
      const jump = make('button', { type: 'button', textContent: shown(best.time) });
      jump.addEventListener('click', () => { scene.clock.play(false); scene.clock.seek(best.time); });
      near.replaceChildren(`${best.m.toFixed(2)} m between centres, to agent ${ids[best.other]} at `, jump);
    }, 30);
  }

  /** States as bars of different height, so that colour is not all that tells them apart. */
  draw() {
    const { scene } = this, end = scene.recording.end_s, [c, w, h] = sized(this.nodes.canvas);
    const fine = w / Math.max(this.nodes.canvas.clientWidth, 1);
    c.clearRect(0, 0, w, h);
    const at = (time) => end ? time / end * w : 0;
    const tall = [1, 0.65, 0.3, 0.12].map((part) => part * 0.72 * h);
    for (const [from, to, state] of this.#parts) {
      c.fillStyle = theme[STATES[state]];
      c.fillRect(at(from), h - tall[state], Math.max(at(to) - at(from), 0.5), tall[state]);
    }
    c.fillStyle = theme.contact;
    for (const { from, to } of this.#own) c.fillRect(at(from), 0, Math.max(at(to) - at(from), 2 * fine), 0.2 * h);
    c.fillStyle = theme.ink;
    c.fillRect(at(scene.now) - fine, 0, 2 * fine, h);
  }
}

/** Draws all agents over time on a canvas, a row for each; where there are more agents than rows, some are left out. */
export function drawFleet(canvas, scene) {
  const { recording, recording: { count, contacts, end_s: end } } = scene;
  const w = 640, h = Math.min(Math.max(count, 1), 600);
  const colors = STATES.concat('contact').map((name) => rgba(theme[name]));
  Object.assign(canvas, { width: w, height: h });
  const c = canvas.getContext('2d'), image = c.createImageData(w, h);
  const put = (row, from, to, color) => {
    const last = Math.min(w - 1, Math.max(Math.floor(from / end * w), Math.ceil(to / end * w) - 1));
    for (let x = Math.floor(from / end * w); x <= last; x++) image.data.set(color, 4 * (row * w + x));
  };
  if (end > 0) {
    for (let row = 0; row < h && count; row++) {
      stretches(scene, Math.floor(row * count / h), (from, to, state) => put(row, from, to, colors[state]));
    }
    for (const contact of contacts) {
      for (const i of recording.both(contact).filter((i) => i < count)) {
        put(Math.min(h - 1, Math.floor(i * h / count)), contact.from, contact.to, colors[STATES.length]);
      }
    }
  }
  c.putImageData(image, 0, 0);
  canvas.style.imageRendering = h < 150 ? 'pixelated' : 'auto';
}

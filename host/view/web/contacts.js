// The list of contacts, and where they are in time.

import { make, mark, sized } from './dom.js';
import { theme } from './theme.js';

const LIST_STEP = 200;

/** `nodes` are the list, the text with their number, the box for those of one agent, its label, and the button for more. */
export class ContactList {
  #rows = [];
  #listed = LIST_STEP;

  /** `say` tells what was done, for who does not see it. */
  constructor(scene, nodes, say) {
    Object.assign(this, { scene, nodes, say });
    nodes.more.addEventListener('click', () => {
      this.#listed += LIST_STEP;
      this.list();
    });
    nodes.only.addEventListener('change', () => this.list());
  }

  /** Lists the contacts, of the selected agent if that is wanted. */
  list() {
    const { scene: { recording, recording: { contacts }, selected }, nodes } = this;
    nodes.onlyBox.hidden = selected < 0 || !contacts.length;
    if (selected < 0) nodes.only.checked = false;
    const id = nodes.only.checked ? recording.ids[selected] : null;
    const wanted = id === null ? contacts : contacts.filter(({ a, b }) => recording.isOf(a, id) || recording.isOf(b, id));
    this.#rows = wanted.slice(0, this.#listed).map((contact) => {
      const { a, b, from, to, open } = contact;
      const when = from.toFixed(2) + ' s', long = open ? 'to the end' : (to - from).toFixed(2) + ' s';
      const button = make('button', { type: 'button', ariaLabel: `at ${when}: ${recording.nameOf(a)} and ${recording.nameOf(b)}, ${long}` },
        make('span', {}, when), make('span', {}, `${recording.shortOf(a)} × ${recording.shortOf(b)}`), make('small', {}, long));
      button.addEventListener('click', () => this.jump(contact));
      return [contact, button];
    });
    nodes.list.replaceChildren(...this.#rows.map(([, button]) => make('li', {}, button)));
    if (!wanted.length) nodes.list.append(make('li', { className: 'none' }, 'None.'));
    const total = id === null ? recording.meta.contacts_total : wanted.length;
    nodes.count.textContent = total ? `(${total})` : '';
    nodes.more.hidden = wanted.length <= this.#listed;
    this.tell();
  }

  /** Marks what is in contact now. */
  tell() {
    const { touching, pointed } = this.scene, current = new Set(touching);
    for (const [contact, button] of this.#rows) mark(button, current.has(contact) || contact === pointed);
  }

  /** Shows a contact. */
  jump(contact) {
    const { scene } = this;
    scene.point(contact);
    this.say(`contact of ${scene.recording.nameOf(contact.a)} and ${scene.recording.nameOf(contact.b)} at ${contact.from.toFixed(2)} s`);
  }

  /** Shows the next contact, or with -1 the one before. */
  next(step) {
    const { scene: { recording: { contacts }, now } } = this;
    const later = step > 0
      ? contacts.find((contact) => contact.from > now + 1e-6)
      : contacts.findLast((contact) => contact.from < now - 1e-6);
    if (later) this.jump(later);
  }
}

/** Marks of contacts, and below of calls with trouble, over a bar of time whose ends are inset by the thumb's half. */
export function drawMarks(canvas, { contacts, troubles, end_s: end }) {
  const [c, w, h] = sized(canvas), fine = w / Math.max(canvas.clientWidth, 1), inset = 8 * fine;
  const at = (time) => inset + (end ? time / end : 0) * (w - 2 * inset);
  c.clearRect(0, 0, w, h);
  c.fillStyle = theme.contact;
  let last = -1;
  for (const { from } of contacts) {
    const x = Math.round(at(from));
    if (x !== last) c.fillRect(x - fine, 0, 2 * fine, 0.22 * h);
    last = x;
  }
  c.fillStyle = theme['fail-policy'];
  for (const { asked } of troubles) c.fillRect(at(asked) - fine, 0.82 * h, 2 * fine, 0.18 * h);
}

// Elements and icons, made without markup in strings.

export const $ = (id) => document.getElementById(id);

/** An element. Properties that begin with `on` are listeners, `class` and those with a dash are attributes. */
export function h(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  set(node, props);
  node.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

function set(node, props) {
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === null) continue;
    if (name.startsWith('on')) node.addEventListener(name.slice(2), value);
    else if (name === 'class' || name === 'role' || name === 'for' || name === 'list' || name.includes('-')) {
      if (value !== false || name.startsWith('aria-')) node.setAttribute(name, value);
    } else node[name] = value;
  }
}

const SVG = 'http://www.w3.org/2000/svg';

/** Paths of icons on a square of 16. Those with `fill` are areas, the others lines. */
const ICONS = {
  select: 'M4 2l8.5 6.2-3.9.8L6.7 13z',
  rectangle: 'M2.5 4h11v8h-11z',
  polygon: 'M8 2l6 4.6-2.3 7H4.3L2 6.6z',
  brush: 'M13.5 2.5L7 9M6.8 8.2c-2 0-2.6 1.4-2.8 2.8-.1 1-.7 1.7-2 2 2.8 1 6.8.4 6.8-2.8',
  fill: 'M7.5 1.8l5.6 5.6-5.2 5.2-5.6-5.6zM2.8 7.4h9.8M14 10.5c.9 1.4 1 2.6 0 2.6s-.9-1.2 0-2.6',
  mover: 'M2 8h9M8 4.5L11.5 8 8 11.5M14 3.5v9',
  robot: 'M8 2.5a5.5 5.5 0 1 0 .01 0zM8 8h5.5',
  place: 'M8 14S3.5 9.6 3.5 6.3a4.5 4.5 0 0 1 9 0C12.5 9.6 8 14 8 14zM8 4.8a1.5 1.5 0 1 0 .01 0z',
  measure: 'M2 10.5L10.5 2 14 5.5 5.5 14zM5 7.5l1.5 1.5M7.5 5L9.5 7M10 2.5',
  undo: 'M5.5 3L2.5 6l3 3M2.5 6H10a3.5 3.5 0 0 1 0 7H6',
  redo: 'M10.5 3l3 3-3 3M13.5 6H6a3.5 3.5 0 0 0 0 7h4',
  save: 'M2.5 2.5h9l2 2v9h-11zM5 2.5v4h5v-4M5 13.5v-4h6v4',
  export: 'M8 10V2M5 4.8L8 2l3 2.8M2.5 9.5v4h11v-4',
  more: 'M2.5 4h11M2.5 8h11M2.5 12h11',
  grid: 'M2.5 2.5h11v11h-11zM2.5 6.2h11M2.5 9.8h11M6.2 2.5v11M9.8 2.5v11',
  open: 'M2 12.5v-9h4l1.5 2H13v2M2 12.5l2-5h10.5l-2 5z',
  command: 'M7 2.5a4.5 4.5 0 1 0 .01 0zM10.3 10.3L14 14',
  help: 'M5.5 6a2.5 2.5 0 1 1 3.6 2.2c-.8.4-1.1.9-1.1 1.8M8 12.6v.8',
  plus: 'M8 3v10M3 8h10',
  minus: 'M3 8h10',
  fit: 'M2.5 6V2.5H6M10 2.5h3.5V6M13.5 10v3.5H10M6 13.5H2.5V10',
  trash: 'M3 4.5h10M6 4.5V3h4v1.5M4.5 4.5l.6 9h5.8l.6-9',
  copy: 'M5.5 5.5h8v8h-8zM10.5 5.5v-3h-8v8h3',
  close: 'M4 4l8 8M12 4l-8 8',
  camera: 'M2 5h3l1-1.5h4L11 5h3v8H2zM8 6.5a2.3 2.3 0 1 0 .01 0z',
  stop: 'M4 4h8v8H4z',
};
const FILLED = {
  play: 'M4 2l10 6-10 6z',
  pause: 'M3 2h4v12H3zM9 2h4v12H9z',
  earlier: 'M13 3L6 8l7 5zM3 3h2v10H3z',
  later: 'M3 3l7 5-7 5zM11 3h2v10h-2z',
};

export function icon(name) {
  const svg = document.createElementNS(SVG, 'svg');
  svg.setAttribute('viewBox', '0 0 16 16');
  svg.setAttribute('aria-hidden', 'true');
  svg.setAttribute('class', name in FILLED ? 'icon filled' : 'icon');
  const path = document.createElementNS(SVG, 'path');
  path.setAttribute('d', ICONS[name] ?? FILLED[name]);
  svg.append(path);
  return svg;
}

/** A button with a picture; `label` is its name for those who cannot see it, and its tip. */
export function iconButton(name, label, onclick, props = {}) {
  return h('button', { type: 'button', class: 'icon-button', 'aria-label': label, title: label, onclick, ...props }, icon(name));
}

/** A field with its name before it. */
export function field(label, input, note = null) {
  return h('label', { class: 'field' }, h('span', {}, label), input, note && h('small', {}, note));
}

/** Options are values, `[value, text]`, or groups `[title, options]`. */
export function select(options, value, onchange, props = {}) {
  const choices = (all) => all.map((option) => Array.isArray(option) ? option : [option, option])
    .map(([key, text]) => Array.isArray(text) ? h('optgroup', { label: key }, ...choices(text)) : h('option', { value: key }, text));
  const node = h('select', { onchange: () => onchange(node.value), ...props }, ...choices(options));
  node.value = String(value);
  return node;
}

export function check(label, checked, onchange, props = {}) {
  const box = h('input', { type: 'checkbox', checked, onchange: () => onchange(box.checked), ...props });
  return h('label', { class: 'check' }, box, h('span', {}, label));
}

/** A number that is told when it is one; what is none is marked and not told. */
export function number(value, onchange, { min, max, step = 'any', empty = false, ...props } = {}) {
  const node = h('input', {
    type: 'number', min: min ?? '', max: max ?? '', step, inputMode: 'decimal', value: value ?? '',
    onchange: () => {
      if (node.value === '' && empty) onchange(null);
      else if (node.value !== '' && node.checkValidity()) onchange(Number(node.value));
      node.setAttribute('aria-invalid', String(!node.checkValidity() || (node.value === '' && !empty)));
    },
    ...props,
  });
  return node;
}

let sections = 0;
export function section(title, ...children) {
  const id = `section-${++sections}`;
  return h('section', { class: 'card', 'aria-labelledby': id }, h('h2', { id }, title), ...children);
}

document.addEventListener('input', ({ target }) => { target.dataset.typing = 'true'; });
document.addEventListener('change', ({ target }) => { delete target.dataset.typing; });

/** What is pressed now, and what is to be replaced once it is let go: a click on what has just gone would be lost. */
let pressed = null;
const waiting = new Map();
document.addEventListener('pointerdown', ({ target }) => { pressed = target; }, true);
for (const name of ['pointerup', 'pointercancel']) {
  document.addEventListener(name, () => setTimeout(() => {
    pressed = null;
    const all = [...waiting];
    waiting.clear();
    for (const [node, children] of all) fill(node, ...children);
  }), true);
}

/** Replaces what an element holds. The focus stays on the element of the same `data-key`, with what is being typed there. */
export function fill(node, ...children) {
  if (pressed && node.contains(pressed)) return void waiting.set(node, children);
  waiting.delete(node);
  const active = node.contains(document.activeElement) ? document.activeElement : null;
  const key = active?.dataset.key, typed = active?.dataset.typing ? active.value : null, scroll = node.scrollTop;
  node.replaceChildren(...children.flat().filter((child) => child));
  node.scrollTop = scroll;
  const next = key && node.querySelector(`[data-key="${CSS.escape(key)}"]`);
  if (!next) return;
  next.focus({ preventScroll: true });
  if (typed === null) return;
  next.value = typed;
  next.dataset.typing = 'true';
  // To the browser nobody has typed into the new one.
  next.addEventListener('blur', () => { if (next.dataset.typing) next.dispatchEvent(new Event('change', { bubbles: true })); }, { once: true });
}

export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/** A number as people write it: at most so many digits after the point, without zeros at the end. */
export const tidy = (value, digits = 3) => String(+Number(value).toFixed(digits));

let announcer = null;
/** Tells the result of an action to those who do not see it. */
export function say(text) {
  announcer ??= $('announce');
  announcer.textContent = text;
}

/** Gives bytes to the user as a file. */
export function download(blob, name) {
  const url = URL.createObjectURL(blob);
  const link = h('a', { href: url, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

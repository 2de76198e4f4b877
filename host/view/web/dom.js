// Elements of pages, and text of numbers on them.

/** The element of an id. */
export const $ = (id) => document.getElementById(id);

/** A new element with these properties and children. */
export function make(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

/** Sets what a list of terms says, where it says something else. */
export function tell(list, rows) {
  const text = JSON.stringify(rows);
  if (list.dataset.told === text) return;
  list.dataset.told = text;
  list.replaceChildren(...rows.flatMap(([term, value]) => [make('dt', {}, term), make('dd', {}, value)]));
}

/** Marks a row as that of now, or not. Returns true where that is new. */
export function mark(row, on) {
  if ((row.getAttribute('aria-current') === 'true') === on) return false;
  row.setAttribute('aria-current', on);
  return true;
}

/** Scrolls a list, and nothing around it, so that a row can be seen. */
export function reveal(row) {
  const list = row.closest('ol'), [inside, outside] = [row, list].map((node) => node.getBoundingClientRect());
  list.scrollTop += Math.min(0, inside.top - outside.top) + Math.max(0, inside.bottom - outside.bottom);
}

/** Device pixels per pixel of the page; beyond three nobody sees them. */
export const fineness = () => Math.min(globalThis.devicePixelRatio || 1, 3);

/** The pen of a canvas as large as it is shown, and its size in device pixels. */
export function sized(canvas) {
  const fine = fineness(), w = Math.round(canvas.clientWidth * fine), h = Math.round(canvas.clientHeight * fine);
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  return [canvas.getContext('2d'), w, h];
}

/** How times of a recording are told: two decimals where it is short. */
export const timeText = (end_s) => (time_s) => time_s.toFixed(end_s < 10 ? 2 : 1) + ' s';

/** One agent, two agents. */
export const counted = (number, noun) => `${number} ${noun}${number === 1 ? '' : 's'}`;

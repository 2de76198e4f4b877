// One table of commands. Menus, the palette, keys and the sheet of keys are made of it.

import { $, h, fill, icon, say } from './dom.js';

/** Commands in the order of the sheet: `{id, name, group, keys, run, when, icon}`. */
const commands = [];
const byKey = new Map();

export function register(...added) {
  for (const command of added) {
    commands.push(command);
    for (const key of command.keys ?? []) {
      if (!byKey.has(key)) byKey.set(key, []);
      byKey.get(key).push(command);
    }
  }
}

export const command = (id) => commands.find((command) => command.id === id);
const possible = (command) => !command.when || command.when();

export function run(id) {
  const found = command(id);
  if (found && possible(found)) found.run();
}

/** A key as the table writes it: `Mod+Shift+Z`, `R`, `ArrowLeft`. */
function keyOf(event) {
  const name = event.key.length === 1 ? event.key.toUpperCase() : event.key;
  const letter = name.length > 1 || /[A-Z0-9]/.test(name);
  return [
    event.ctrlKey || event.metaKey ? 'Mod+' : '', event.altKey ? 'Alt+' : '', event.shiftKey && letter ? 'Shift+' : '',
    name === ' ' ? 'Space' : name,
  ].join('');
}

const apple = /Mac|iP(hone|ad)/.test(navigator.platform);
const KEY_NAMES = { ArrowLeft: '←', ArrowRight: '→', ArrowUp: '↑', ArrowDown: '↓', Escape: 'Esc', Delete: 'Del', Backspace: '⌫' };
export const shownKey = (key) => key.split('+').map((part) => part === 'Mod' ? (apple ? '⌘' : 'Ctrl') : KEY_NAMES[part] ?? part).filter((part) => part !== '').join(' ') || '+';

/** Keys that fields and buttons understand themselves are left to them. */
function belongsTo(target, event) {
  const tag = target.tagName, type = target.type;
  if (event.ctrlKey || event.metaKey) return ['z', 'y', 'a', 'c', 'v', 'x'].includes(event.key.toLowerCase()) && isText(target);
  if (event.key === 'Escape') return false;
  if (isText(target) || tag === 'SELECT') return true;
  if (event.key === ' ' || event.key === 'Enter') return tag === 'BUTTON' || tag === 'SUMMARY' || tag === 'A' || type === 'checkbox' || type === 'radio';
  if (event.key.startsWith('Arrow') || event.key === 'Home' || event.key === 'End') return type === 'range' || type === 'radio' || target.getAttribute('role') === 'tab';
  return false;
}

const isText = (target) => target.tagName === 'TEXTAREA' ||
  (target.tagName === 'INPUT' && !['checkbox', 'radio', 'range', 'button'].includes(target.type));

document.addEventListener('keydown', (event) => {
  if (document.querySelector('dialog[open]') && event.key !== 'F1') return;
  if (event.defaultPrevented || belongsTo(event.target, event)) return;
  const found = (byKey.get(keyOf(event)) ?? []).find(possible);
  if (!found) return;
  event.preventDefault();
  found.run();
});

// ---- The palette -----------------------------------------------------------------------

/** More lines of the palette than there are commands: `(query) => [{name, group, run}]`. */
const sources = [];
export const offer = (source) => sources.push(source);

/** True if the letters of a query come in this order in a text; the better, the higher. */
function fits(query, text) {
  if (!query) return 1;
  const low = text.toLowerCase(), at = low.indexOf(query);
  if (at >= 0) return 100 - Math.min(at, 50) + (at === 0 || low[at - 1] === ' ' ? 50 : 0);
  let from = 0;
  for (const letter of query) {
    from = low.indexOf(letter, from) + 1;
    if (!from) return 0;
  }
  return 1;
}

export function palette() {
  const dialog = $('palette'), input = $('palette-input'), list = $('palette-list');
  let found = [], chosen = 0;
  const show = () => {
    const query = input.value.trim().toLowerCase();
    const all = [...commands.filter((command) => !command.hidden && possible(command)), ...sources.flatMap((source) => source(query))];
    found = all.map((line) => [Math.max(fits(query, line.name), fits(query, `${line.group} ${line.name}`) - 20), line])
      .filter(([score]) => score > 0).sort((a, b) => b[0] - a[0]).slice(0, 60).map(([, line]) => line);
    chosen = 0;
    list.replaceChildren(...found.map((line, at) => h('li', {
      role: 'option', id: `palette-${at}`, onclick: () => pick(at), onpointermove: () => mark(at),
    }, h('span', {}, line.name), h('small', {}, line.group), line.keys?.length ? h('kbd', {}, shownKey(line.keys[0])) : null)));
    if (!found.length) list.append(h('li', { class: 'none' }, 'Nothing is called so.'));
    mark(0);
  };
  const mark = (at) => {
    list.children[chosen]?.removeAttribute('aria-selected');
    chosen = Math.max(0, Math.min(at, found.length - 1));
    if (!found.length) return input.removeAttribute('aria-activedescendant');
    list.children[chosen].setAttribute('aria-selected', 'true');
    list.children[chosen].scrollIntoView({ block: 'nearest' });
    input.setAttribute('aria-activedescendant', `palette-${chosen}`);
  };
  const pick = (at) => {
    const line = found[at];
    dialog.close();
    line?.run();
  };
  input.value = '';
  input.oninput = show;
  input.onkeydown = (event) => {
    const by = { ArrowDown: 1, ArrowUp: -1, PageDown: 8, PageUp: -8 }[event.key];
    if (by) mark(chosen + by);
    else if (event.key === 'Enter') pick(chosen);
    else return;
    event.preventDefault();
  };
  show();
  dialog.showModal();
  input.focus();
}

/** The sheet of keys. */
export function sheet() {
  const groups = Map.groupBy ? Map.groupBy(commands.filter(({ keys }) => keys?.length), ({ group }) => group) : grouped();
  fill($('sheet-keys'), ...[...groups].map(([group, own]) => h('section', {},
    h('h3', {}, group),
    h('dl', {}, ...own.flatMap((command) => [
      h('dt', {}, ...command.keys.slice(0, 2).map((key) => h('kbd', {}, shownKey(key)))),
      h('dd', {}, command.name),
    ])))));
  $('sheet').showModal();
}

function grouped() {
  const groups = new Map();
  for (const command of commands) {
    if (!command.keys?.length) continue;
    if (!groups.has(command.group)) groups.set(command.group, []);
    groups.get(command.group).push(command);
  }
  return groups;
}

/** A menu that opens below a button, of commands by their names. */
export function menu(button, ids) {
  const list = h('ul', { class: 'menu', role: 'menu', hidden: true, 'aria-label': button.getAttribute('aria-label') ?? button.textContent });
  button.setAttribute('aria-haspopup', 'menu');
  button.setAttribute('aria-expanded', 'false');
  const close = (back) => {
    list.hidden = true;
    button.setAttribute('aria-expanded', 'false');
    if (back) button.focus();
  };
  const open = () => {
    const items = (typeof ids === 'function' ? ids() : ids.map(command)).filter(possible);
    list.replaceChildren(...items.map((item) => h('li', { role: 'none' }, h('button', {
      type: 'button', role: 'menuitem', onclick: () => { close(true); item.run(); },
    }, item.icon ? icon(item.icon) : null, h('span', {}, item.short ?? item.name), item.mark ? h('small', {}, item.mark) : null, item.keys?.length ? h('kbd', {}, shownKey(item.keys[0])) : null))));
    if (!items.length) return say('nothing to choose');
    list.hidden = false;
    button.setAttribute('aria-expanded', 'true');
    list.querySelector('button').focus();
  };
  button.addEventListener('click', () => list.hidden ? open() : close(true));
  list.addEventListener('keydown', (event) => {
    const items = [...list.querySelectorAll('button')], at = items.indexOf(document.activeElement);
    const to = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: items.length - 1 }[event.key];
    if (to !== undefined) items[(to + items.length) % items.length].focus();
    else if (event.key === 'Escape' || event.key === 'Tab') close(event.key === 'Escape');
    else return;
    event.stopPropagation();
    if (event.key !== 'Tab') event.preventDefault();
  });
  document.addEventListener('pointerdown', ({ target }) => { if (!list.hidden && !list.contains(target) && !button.contains(target)) close(false); });
  button.after(list);
}

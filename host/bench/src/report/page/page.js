// ---- Filters ----------------------------------------------------------------------

/** What a page is narrowed by: values, which of them each trial has, which are allowed. */
const filters = [];
let selection = new Uint32Array(count); // trials that pass, in order

const text = (value) => value === null || value === undefined ? 'none' : value === true ? 'yes' : value === false ? 'no' : String(value);

function addFilter(name, { values, of }) {
  const order = values.map((_, i) => i).sort((a, b) => compare(values[a], values[b]));
  const counts = new Uint32Array(values.length);
  for (let i = 0; i < count; i++) counts[of[i]]++;
  if (values.length < 2) return;
  filters.push({ name, values, of, order, counts, allowed: new Uint8Array(values.length).fill(1), chosen: values.length });
}

/** Numbers by size, words by the alphabet with numbers in them by size, nothing last. */
function compare(a, b) {
  if (a === null || b === null) return (a === null) - (b === null);
  const x = Number(a), y = Number(b);
  return Number.isNaN(x) || Number.isNaN(y) ? collator.compare(String(a), String(b)) : x - y;
}
const collator = new Intl.Collator('en', { numeric: true });

function mapped(codes, change) {
  const seen = new Map(), values = [];
  const next = codes.values.map((value) => {
    const to = change(value);
    if (!seen.has(to)) {
      seen.set(to, values.length);
      values.push(to);
    }
    return seen.get(to);
  });
  const of = new Uint32Array(count);
  for (let i = 0; i < count; i++) of[i] = next[codes.of[i]];
  return { values, of };
}

/** The words before the first number: maps of one family are told apart by numbers. */
const family = (map) => /^[^\d]*?(?=[-_. ]*\d)/.exec(map)?.[0] || map;

function makeFilters() {
  const families = mapped(columns.map.codes, family);
  addFilter('Planner', entrants.codes);
  addFilter('View', columns.view.codes);
  if (families.values.length < columns.map.codes.values.length) addFilter('Map family', families);
  addFilter('Map', columns.map.codes);
  addFilter('Agents', columns.agents.codes);
  addFilter('Maze size', columns.maze_width.codes);
  addFilter('Maze algorithm', columns.maze_algorithm.codes);
  addFilter('Seed', columns.seed.codes);
  addFilter('Outcome', outcomes);
  addFilter('Times', mapped(columns.contended.codes, (why) => why ? 'contended' : 'undisturbed'));
  const row = $('filter-row');
  for (const filter of filters) row.append(filterControl(filter));
  row.append(make('button', { type: 'button', id: 'reset', onclick: reset }, 'Clear filters'));
}

function reset() {
  for (const filter of filters) {
    filter.allowed.fill(1);
    filter.refresh();
  }
  changed();
}

const LISTED = 200;

function filterControl(filter) {
  const summary = make('summary');
  const list = make('div', { class: 'list' });
  const find = make('input', { type: 'search', placeholder: 'Find', 'aria-label': `Find in ${filter.name}` });
  const all = make('button', { type: 'button' }, 'All'), none = make('button', { type: 'button' }, 'None');
  const tools = make('div', { class: 'tools' }, ...(filter.values.length > 10 ? [find] : []), all, none);
  const box = make('details', { class: 'filter', name: 'filter' }, summary,
    make('div', { class: 'choices', role: 'group', 'aria-label': filter.name }, tools, list));
  const found = () => filter.order.filter((code) => text(filter.values[code]).toLowerCase().includes(find.value.toLowerCase()));
  const show = () => {
    const codes = found();
    const entries = codes.slice(0, LISTED).map((code) => {
      const check = make('input', { type: 'checkbox', 'data-code': code });
      check.checked = filter.allowed[code] === 1;
      check.addEventListener('change', () => {
        filter.allowed[code] = check.checked ? 1 : 0;
        label();
        changed();
      });
      return make('label', {}, check, make('span', {}, text(filter.values[code])), make('small', {}, filter.counts[code]));
    });
    list.replaceChildren(...entries);
    if (codes.length > LISTED) list.append(make('p', { class: 'note' }, `and ${codes.length - LISTED} more: find them by name`));
  };
  const label = () => {
    filter.chosen = filter.allowed.reduce((sum, on) => sum + on, 0);
    const narrow = filter.chosen < filter.values.length;
    box.classList.toggle('narrow', narrow);
    const only = filter.chosen === 1 ? short(text(filter.values[filter.allowed.indexOf(1)]), 24) : `${filter.chosen} of ${filter.values.length}`;
    summary.textContent = narrow ? `${filter.name}: ${only}` : filter.name;
  };
  const set = (on) => {
    for (const code of found()) filter.allowed[code] = on;
    show();
    label();
    changed();
  };
  all.addEventListener('click', () => set(1));
  none.addEventListener('click', () => set(0));
  find.addEventListener('input', show);
  box.addEventListener('toggle', () => { if (box.open) show(); });
  box.addEventListener('keydown', (event) => {
    if (event.key !== 'Escape' || !box.open) return;
    box.open = false;
    summary.focus();
  });
  filter.refresh = () => {
    label();
    if (box.open) show();
  };
  label();
  return box;
}

function select() {
  const narrow = filters.filter((filter) => filter.chosen < filter.values.length);
  const passed = new Uint32Array(count);
  let length = 0;
  next: for (let i = 0; i < count; i++) {
    for (const { of, allowed } of narrow) if (!allowed[of[i]]) continue next;
    passed[length++] = i;
  }
  selection = passed.subarray(0, length);
}

/** Everything again, after a filter. */
function changed() {
  const began = performance.now();
  for (const filter of filters) filter.chosen = filter.allowed.reduce((sum, on) => sum + on, 0);
  select();
  story = evaluate(selection, $('rank-by').value);
  showTables();
  showFigures();
  narrow(null);
  $('shown').textContent = selection.length === count ? `${grouping(count)} trials` : `${grouping(selection.length)} of ${grouping(count)} trials`;
  // Which trials are disturbed depends on how long they are.
  if (filters.some(({ name, chosen }) => name === 'Times' && chosen === 1)) $('shown').textContent += ': those that others did not disturb are mostly short, and no fair sample';
  page.filter_ms = performance.now() - began;
}

const grouping = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, '\u202f');
const plural = (n, word) => `${grouping(n)} ${word}${n === 1 ? '' : 's'}`;

// ---- Tables -----------------------------------------------------------------------

let story; // what evaluate() found
const order = { ranking: { by: 'rank', up: true }, paired: { by: '2', up: true } };

/** A planner's name after the mark that it has in figures. */
function named(slot) {
  const mark = make('svg', { class: 'key', viewBox: '0 0 26 14', style: `--c:${colorOf(slot)}`, 'aria-hidden': 'true' },
    make('path', { d: 'M1 7H25', 'stroke-dasharray': dashOf(slot) }),
    make('path', { d: shape(slot, 13, 7, 4), class: 'fill' }));
  return [mark, data.planners[slot]];
}

/** A sortable table. Columns: title, what to sort by, what to show. */
function showTable(id, columns, rows) {
  const table = $(`${id}-table`), { by, up } = order[id];
  const column = columns.find((column) => column.id === by) ?? columns[0];
  const value = (row) => column.sort(row);
  const ordered = [...rows].sort((a, b) => {
    const x = value(a), y = value(b);
    // What does not exist comes last, whichever way.
    if (x === null || y === null) return (x === null) - (y === null);
    return (typeof x === 'string' ? collator.compare(x, y) : x - y) * (up ? 1 : -1);
  });
  const focused = document.activeElement?.closest?.(`#${id}-table th`)?.dataset.id;
  const head = make('tr', {}, ...columns.map((column) => make('th', {
    scope: 'col', 'data-id': column.id, class: column.text ? 'text' : null,
    'aria-sort': column.id === by ? up ? 'ascending' : 'descending' : 'none',
  }, make('button', { type: 'button', title: column.title, onclick: () => {
    order[id] = { by: column.id, up: column.id === by ? !up : !column.down };
    showTable(id, columns, rows);
  } }, column.name))));
  const body = ordered.map((row) => make('tr', {}, ...columns.map((column) => {
    const shown = column.show(row);
    return column.id === 'planner' ? make('th', { scope: 'row', class: 'planner' }, ...shown)
      : make('td', { class: [column.text ? 'text' : '', column.id === 'rank' && row.rank === 1 ? 'first' : ''].join(' ').trim() || null }, ...[shown].flat());
  })));
  if (!body.length) body.push(make('tr', {}, make('td', { colspan: columns.length, class: 'text' }, 'No trials.')));
  table.replaceChildren(make('thead', {}, head), make('tbody', {}, ...body));
  if (focused) table.querySelector(`th[data-id="${focused}"] button`)?.focus();
}

function showTables() {
  showRanking();
  showPaired();
}

const interval = (pair, text = digits) => pair ? `[${text(pair.low)}, ${text(pair.high)}]` : '–';
const small = (content) => make('small', {}, content);

// ---- The trials -------------------------------------------------------------------

const ROW = 32;
/** Browsers do not lay out taller elements. */
const TALLEST = 8e6;

const LIST = [
  { name: 'Trial', show: (i) => text(columns.trial.at(i)), key: () => columns.trial.numbers },
  { name: 'Planner', text: true, show: (i) => entrants.at(i), word: entrants },
  { name: 'Instance', text: true, show: instanceOf, word: 'map' },
  { name: 'Agents', show: (i) => text(columns.agents.at(i)), key: () => columns.agents.numbers },
  { name: 'Seed', show: (i) => text(columns.seed.at(i)), key: () => columns.seed.numbers },
  { name: 'Repeat', show: (i) => text(columns.repeat.at(i)), key: () => columns.repeat.numbers },
  { name: 'Outcome', text: true, show: (i) => outcomes.values[outcomes.of[i]], key: () => outcomes.of },
  { name: 'Time, ms', show: (i) => digits(columns.solve_time_ms.at(i)), key: () => columns.solve_time_ms.numbers },
  { name: 'Length', show: (i) => plain(columns.path_length_cells.at(i)), key: () => columns.path_length_cells.numbers },
  { name: 'SoC', show: (i) => text(columns.soc_steps.at(i) ?? '–'), key: () => columns.soc_steps.numbers },
  { name: 'Expansions', show: (i) => plain(columns.expansions.at(i)), key: () => columns.expansions.numbers },
];
let listed = selection, sorting = { at: 0, up: true }, active = 0;

function instanceOf(i) {
  const map = columns.map.at(i), scenario = columns.scenario.at(i);
  return scenario && scenario !== map ? `${map} · ${scenario}` : map;
}

/** The list shows these trials, or with null all that pass the filters. */
function narrow(rows, why) {
  listed = rows ?? selection;
  $('narrowed').hidden = rows === null;
  if (rows) $('narrowed-text').textContent = `${plural(rows.length, 'trial')}: ${why}`;
  sortList();
  if (rows) {
    $('trials').querySelector('details').open = true;
    $('trials').scrollIntoView({ block: 'start' });
    $('trial-list').focus({ preventScroll: true });
  }
}

function sortList() {
  const { at, up } = sorting, column = LIST[at];
  let key;
  if (column.word) {
    // Words are sorted once, trials by their places.
    const { values, of } = (columns[column.word] ?? column.word).codes;
    const places = new Float64Array(values.length);
    values.map((_, i) => i).sort((a, b) => compare(values[a], values[b])).forEach((code, place) => { places[code] = place; });
    key = (i) => places[of[i]];
  } else {
    const values = column.key();
    key = (i) => values[i];
  }
  const sign = up ? 1 : -1;
  listed = Uint32Array.from(listed);
  let ordered = sign > 0;
  for (let i = 1; ordered && i < listed.length; i++) ordered = key(listed[i - 1]) <= key(listed[i]);
  if (!ordered) {
    listed.sort((a, b) => {
      const x = key(a), y = key(b);
      if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y) || a - b;
      return sign * (x - y) || a - b;
    });
  }
  active = 0;
  $('trial-head').replaceChildren(...LIST.map((column, i) => make('div', {
    role: 'columnheader', class: column.text ? 'text' : null, 'aria-sort': i === at ? up ? 'ascending' : 'descending' : 'none',
  }, make('button', { type: 'button', onclick: () => {
    sorting = { at: i, up: i === at ? !up : true };
    sortList();
    $('trial-head').querySelectorAll('button')[i].focus();
  } }, column.name))));
  const list = $('trial-list');
  list.setAttribute('aria-rowcount', listed.length + 1);
  $('trial-space').style.height = `${Math.min(TALLEST, Math.max(1, listed.length) * ROW)}px`;
  list.scrollTop = 0;
  showList();
}

/** Builds the rows that can be seen, and no others. */
function showList() {
  const list = $('trial-list'), space = $('trial-space');
  const height = list.clientHeight || 460, tall = listed.length * ROW;
  // Beyond the tallest element, the scroll bar stands for more than it is long.
  const range = Math.max(1, Math.min(TALLEST, tall) - height), part = Math.min(1, list.scrollTop / range);
  const top = tall > TALLEST ? part * (tall - height) : list.scrollTop;
  const first = Math.max(0, Math.floor(top / ROW) - 4), last = Math.min(listed.length, first + Math.ceil(height / ROW) + 8);
  const rows = [];
  for (let at = first; at < last; at++) {
    const i = listed[at];
    const row = make('div', { role: 'row', id: `row-${at}`, 'aria-rowindex': at + 2, 'data-at': at, class: at === active ? 'active' : null,
      style: `top:${at * ROW - top + list.scrollTop}px` },
    ...LIST.map((column) => {
      const shown = column.show(i);
      const failed = column.name === 'Outcome' && shown !== 'success';
      return make('div', { role: 'gridcell', class: `${column.text ? 'text' : ''}${failed ? ' failed' : ''}` || null, title: column.text ? shown : null }, shown);
    }));
    rows.push(row);
  }
  if (!rows.length) rows.push(make('div', { role: 'row', style: 'top:0' }, make('div', { role: 'gridcell', class: 'text' }, 'No trials.')));
  space.replaceChildren(...rows);
  if (first <= active && active < last) list.setAttribute('aria-activedescendant', `row-${active}`);
  else list.removeAttribute('aria-activedescendant');
}

function listenList() {
  const list = $('trial-list');
  let pending = false;
  list.addEventListener('scroll', () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => {
      pending = false;
      showList();
    });
  });
  list.addEventListener('click', (event) => {
    const row = event.target.closest('#trial-space [data-at]');
    if (!row) return;
    active = Number(row.dataset.at);
    go(listed[active]);
  });
  list.addEventListener('keydown', (event) => {
    if (event.target !== list || !listed.length) return;
    const page = Math.max(1, Math.floor(list.clientHeight / ROW) - 2);
    const to = { ArrowDown: active + 1, ArrowUp: active - 1, PageDown: active + page, PageUp: active - page, Home: 0, End: listed.length - 1 }[event.key];
    if (event.key === 'Enter') {
      go(listed[active]);
    } else if (to !== undefined) {
      event.preventDefault();
      active = Math.max(0, Math.min(listed.length - 1, to));
      const height = list.clientHeight - 40, tall = listed.length * ROW;
      if (tall > TALLEST) {
        list.scrollTop = active / listed.length * TALLEST;
      } else if (active * ROW < list.scrollTop) {
        list.scrollTop = active * ROW;
      } else if ((active + 1) * ROW > list.scrollTop + height) {
        list.scrollTop = (active + 1) * ROW - height;
      }
      showList();
    }
  });
  $('widen').addEventListener('click', () => narrow(null));
}

// ---- One trial --------------------------------------------------------------------

/** The address of a trial is a part of the page, so that one can go back. */
const go = (i) => { location.hash = `trial=${columns.trial.at(i)}.${i}`; };

function follow() {
  const dialog = $('trial'), found = /^#trial=[^.]*\.(\d+)$/.exec(location.hash);
  const i = found ? Number(found[1]) : -1;
  if (i < 0 || i >= count) {
    if (dialog.open) dialog.close();
    return;
  }
  showTrial(i);
  if (!dialog.open) dialog.showModal();
  dialog.scrollTop = 0;
}

/** Words of a command line as a shell reads them. */
const quoted = (word) => /^[\w@%+=:,./-]+$/.test(word) ? word : `'${String(word).replace(/'/g, `'\\''`)}'`;

/** A command line to copy. */
function commandBox(command) {
  const copy = make('button', { type: 'button', onclick: async () => {
    try {
      await navigator.clipboard.writeText(command);
      copy.textContent = 'Copied';
    } catch {
      getSelection().selectAllChildren(code);
    }
  } }, 'Copy');
  const code = make('code', {}, command);
  return make('div', { class: 'command' }, code, copy);
}

/** How the studio opens a trial: by a link where it has served the page, else by a command. */
function opening(i) {
  const number = columns.trial.at(i);
  if (data.in_studio) return make('p', {}, make('a', { href: `/#trial=${number}` }, 'Open this trial in the studio'));
  return commandBox(['fleetyard', 'studio', stores.at(i), '--trial', number].map((word) => quoted(String(word))).join(' '));
}

function showTrial(i) {
  const at = (name) => columns[name].at(i);
  $('trial-title').textContent = `Trial ${at('trial')}: ${entrants.at(i)}, ${outcomes.values[outcomes.of[i]]}`;
  const same = [];
  for (let j = 0; j < count; j++) if (instances.of[j] === instances.of[i]) same.push(j);
  const others = make('table', {}, make('thead', {}, make('tr', {}, make('th', { class: 'text' }, 'Planner'), make('th', {}, 'Repeat'),
    make('th', { class: 'text' }, 'Outcome'), make('th', {}, 'Time, ms'), make('th', {}, 'Length'), make('th', {}, 'SoC'), make('th', {}, 'Expansions'))),
  make('tbody', {}, ...same.slice(0, 100).map((j) => make('tr', { 'aria-current': j === i ? 'true' : null },
    make('td', { class: 'text wrap' }, j === i ? make('b', {}, entrants.at(j)) : make('a', { href: `#trial=${columns.trial.at(j)}.${j}` }, entrants.at(j))),
    make('td', {}, text(columns.repeat.at(j))), make('td', { class: 'text' }, outcomes.values[outcomes.of[j]]),
    make('td', {}, digits(columns.solve_time_ms.at(j))), make('td', {}, plain(columns.path_length_cells.at(j))),
    make('td', {}, text(columns.soc_steps.at(j) ?? '–')), make('td', {}, plain(columns.expansions.at(j)))))));
  const facts = make('dl');
  for (const column of data.columns.map(({ name }) => columns[name])) {
    facts.append(make('dt', { class: 'mono' }, column.name),
      make('dd', {}, column.at(i) === null ? '–' : text(booleans.has(column.name) ? column.at(i) === 1 : column.at(i)), small(column.doc)));
  }
  $('trial-body').replaceChildren(
    make('h3', {}, 'Watch its plan'), opening(i), make('h3', {}, 'Run it again and watch it'), commandBox(commandsOf(i)),
    make('h3', {}, `On the same instance and seed (${same.length})`), make('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': 'Trials on the same instance' }, others),
    make('h3', {}, 'All columns'), facts);
}

/** The task and the view of a trial as arguments of the command line. */
function viewOf(i) {
  const at = (name) => columns[name].at(i);
  const place = (data.places.tasks ?? []).find((place) => place.map === at('map') && place.scenario === at('scenario'));
  const words = ['--task', place ? place.file : at('scenario')];
  if (place && place.agents !== at('agents')) words.push('--agents', at('agents'));
  for (const [name, value] of Object.entries(JSON.parse(at('view_parameters') || '{}'))) words.push(`--${name.replaceAll('_', '-')}`, value);
  return words;
}

/** How to make this trial again by itself, and the replay of its execution. Limits, sandbox and robots are in the suite. */
function commandsOf(i) {
  const at = (name) => columns[name].at(i);
  const line = (words) => words.map((word) => quoted(String(word))).join(' ');
  let map = `${at('map')}.map`, scenario = at('scenario');
  const lines = [];
  if (at('maze_seed') !== null) {
    const random = /^python\b/.test(scenario) ? 'python' : 'chacha', [rows, cols] = [at('map_rows'), at('map_cols')];
    lines.push(line(['fleetyard', 'maps', 'generate', 'maze', '--width', at('maze_width'), '--height', at('maze_height'),
      '--algorithm', at('maze_algorithm'), '--random', random, '--seed', at('maze_seed'), '--scenario']));
    const name = `maze-${rows}-${cols}-1${random === 'python' ? `-${at('maze_algorithm')}-${at('maze_seed')}` : ''}`;
    [map, scenario] = [`${name}.map`, `${name}.scen`];
  } else if (at('view') === null && !/\.scen$/.test(scenario)) {
    return 'fleetyard bench SUITE.toml --verify   # the suite makes this instance itself';
  } else {
    const place = data.places.scenarios.find((place) => place.map === at('map') && place.scenario === scenario);
    if (place) [map, scenario] = [place.map_file, place.scenario_file];
  }
  const words = ['fleetyard', 'run', ...(at('view') === null ? ['--map', map, '--scen', scenario, '--agents', at('agents')] : viewOf(i))];
  if (at('view') === null && at('connectivity') !== 4) words.push('--connectivity', at('connectivity'));
  if (data.path_rule) words.push('--path-rule', data.path_rule);
  const file = data.places.planners[at('planner')];
  words.push('--planner', file ? `${file}:${at('planner_id')}` : at('planner_id'));
  let options = {};
  try {
    options = JSON.parse(at('options') || '{}');
  } catch { /* They are shown as they are among the columns. */ }
  for (const [name, value] of Object.entries(options)) words.push('--option', `${name}=${typeof value === 'string' ? value : JSON.stringify(value)}`);
  const trace = `trial-${at('trial')}.fyt`, replay = `trial-${at('trial')}.html`;
  words.push('--seed', at('seed'), '--budget', `${at('budget_ms')}ms`, '--trace-out', trace);
  return [...lines, line(words), line(['fleetyard', 'trace', 'export', trace, '--html', replay])].join('\n');
}

// ---- Beginning --------------------------------------------------------------------

function begin() {
  const rank = $('rank-by');
  for (const [value, name] of [['text', 'the paper’s text'], ['appendix', 'its appendix, eq. 23']]) rank.append(make('option', { value }, name));
  rank.value = data.order;
  rank.addEventListener('change', () => {
    story = evaluate(selection, $('rank-by').value);
    showTables();
    showFigures();
  });
  const baselines = [...new Set(data.paired.map(({ baseline }) => baseline))], compared = [...new Set(data.paired.map(({ metric }) => metric))];
  $('baseline').replaceChildren(...baselines.map((baseline, i) => make('option', { value: baseline }, `${data.planners[baseline]}${i ? '' : ' (ranked first)'}`)));
  $('compared').replaceChildren(...compared.map((column) => make('option', { value: column }, metricOf(column).label)));
  for (const select of [$('baseline'), $('compared')]) select.addEventListener('change', showPaired);
  makeFilters();
  story = evaluate(Uint32Array.from({ length: count }, (_, i) => i), data.order);
  makeFigures();
  listenList();
  $('skip').href = '#ranking';
  changed();
  // At first all at once, so that nothing moves.
  drawing++;
  for (const card of cards) showFigure(card);
  page.drawn = drawing;
  addEventListener('hashchange', follow);
  // What is folded has no size until it is opened.
  $('more-figures').addEventListener('toggle', showFigures);
  $('trials').querySelector('details').addEventListener('toggle', showList);
  addEventListener('beforeprint', () => {
    for (const folded of document.querySelectorAll('header > details, section > details')) folded.open = true;
    for (const card of cards) showFigure(card);
  });
  const dialog = $('trial');
  $('trial-close').addEventListener('click', () => dialog.close());
  dialog.addEventListener('click', (event) => { if (event.target === dialog) dialog.close(); });
  dialog.addEventListener('close', () => {
    if (location.hash.startsWith('#trial=')) history.replaceState(null, '', location.pathname + location.search);
  });
  follow();
  let width = innerWidth;
  addEventListener('resize', () => {
    if (innerWidth === width) return;
    width = innerWidth;
    showFigures();
    showList();
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', showFigures);
  document.addEventListener('click', (event) => {
    for (const box of document.querySelectorAll('.filter[open]')) if (!box.contains(event.target)) box.open = false;
  });
  addEventListener('scroll', () => { $('tip').hidden = true; }, { passive: true });
}

// Works the report. `EXPECTED` is what the program says of the same trials.
const cells = (id) => [...document.querySelectorAll(`#${id}-table tbody tr`)].map((row) => [...row.children].map((cell) => cell.textContent));
const heads = (id) => [...document.querySelectorAll(`#${id}-table thead th`)].map((cell) => cell.textContent);
const sameText = (a, b) => JSON.stringify(a) === JSON.stringify(b);
/** Where two values differ, numbers beyond rounding. */
const differ = (a, b, at = '') => {
  a ??= null;
  b ??= null;
  if (typeof a === 'number' && typeof b === 'number') return Math.abs(a - b) <= 1e-9 * Math.max(1, Math.abs(a), Math.abs(b)) ? null : [at, a, b];
  if (a === null || b === null || typeof a !== 'object') return a === b ? null : [at, a, b];
  for (const name of Array.isArray(a) ? [...a.keys(), 'length'] : Object.keys(a)) {
    const found = differ(a[name], b[name], `${at}.${name}`);
    if (found) return found;
  }
  return null;
};
const drawn = async () => { while (report.drawn !== report.drawing) await new Promise((done) => setTimeout(done, 5)); };
await frames(2);
const fits = (name) => {
  const { scrollWidth, clientWidth } = document.documentElement;
  const wide = [...document.querySelectorAll('body *')].filter((one) => one.getBoundingClientRect().right > clientWidth + 1 && !one.closest('.scroll, #trial-list, .skip'));
  check(name, scrollWidth <= clientWidth, [scrollWidth, clientWidth, wide.map((one) => `${one.tagName} ${one.id} ${one.className}`)]);
};
fits('nothing is wider than the window');
// What is read in a minute, with the views of tasks before it; all else is folded.
const views = document.querySelector('#views table');
check('shows views of tasks', Boolean(views && views.checkVisibility()) === (EXPECTED.views || []).length > 0);
const shown = [...document.querySelectorAll('main table, .plot, header li')].filter((one) => one !== views && one.checkVisibility());
check('shows a table and a figure', shown.length === 2, shown.map((one) => one.id || one.className));
for (const folded of document.querySelectorAll('header > details, section > details')) folded.open = true;
await frames(3);
await drawn();
fits('what is unfolded fits');
check('nothing hostile has run', globalThis.hacked === undefined);
check('counts trials', $('shown').textContent.startsWith(`${EXPECTED.overview.trials} trials`), $('shown').textContent);

// The tables and figures of the program.
const table = (title) => EXPECTED.tables.find((table) => table.title === title);
const ranking = table('Ranking'), paired = table('Paired comparison');
if (EXPECTED.overview.trials) {
  check('ranking', sameText(cells('ranking'), ranking.rows) && sameText(heads('ranking'), ranking.head), [heads('ranking'), cells('ranking'), ranking]);
} else {
  check('ranking', cells('ranking')[0][0] === 'No trials.', cells('ranking'));
}
const lead = document.querySelector('header .lead').textContent;
// What nobody sees is drawn as a box.
const seen = (text) => text.replace(/[^ -~]/g, '');
check('headline', seen(lead).includes(seen(EXPECTED.headline ?? '')), [lead, EXPECTED.headline]);
if (EXPECTED.overview.planners > 1) {
  check('paired', sameText(cells('paired'), paired.rows) && sameText(heads('paired'), paired.head), [cells('paired'), paired.rows]);
  const costs = table('Paired comparison: sum of costs');
  if (costs) {
    $('compared').value = 'soc_steps';
    $('compared').dispatchEvent(new Event('change'));
    check('paired costs', sameText([...cells('paired')].sort(), [...costs.rows].sort()) && sameText(heads('paired'), costs.head), [cells('paired'), costs.rows]);
    $('compared').selectedIndex = 0;
    $('compared').dispatchEvent(new Event('change'));
  }
} else {
  check('paired', $('paired').hidden);
}
const wrong = [];
for (const figure of EXPECTED.figures) {
  const [, kind, column] = /^([a-z]+)-?(.*)$/.exec(figure.id);
  const { id, ...expected } = figure;
  expected.series = expected.series.map((series) => series.kind === 'curve' && series.band === null ? { ...series, band: undefined } : series);
  const drawn = report.figure(kind, ...(kind === 'scatter' ? [column, ...report.data.scatter] : column ? [column] : []));
  for (const axis of ['x', 'y']) for (const [name, value] of Object.entries(expected[axis])) if (value === false || value === null) delete expected[axis][name];
  if (expected.diagonal === false) delete expected.diagonal;
  const where = differ(expected, drawn, id);
  if (where) wrong.push(where);
}
check('figures', !wrong.length, wrong);
const empty = [...document.querySelectorAll('.plot')].filter((plot) => !plot.childElementCount);
check('plots are drawn', !empty.length, empty.length);

// Names for those who do not see.
const nameless = [...document.querySelectorAll('button, select, input')].filter((one) => !(one.textContent.trim() || one.getAttribute('aria-label') || one.labels?.length));
check('controls have names', !nameless.length, nameless.map((one) => one.outerHTML));
const unlabelled = [...document.querySelectorAll('.plot')].filter((plot) => !$(plot.getAttribute('aria-labelledby'))?.textContent || !$(plot.getAttribute('aria-describedby'))?.textContent);
check('plots have names', !unlabelled.length);
check('headers say how they sort', [...document.querySelectorAll('thead th[data-id]')].every((th) => th.getAttribute('aria-sort')));
for (const numbers of document.querySelectorAll('figure details')) numbers.open = true;
await frames(3);
check('figures have numbers', [...document.querySelectorAll('figure')].every((figure) => figure.querySelector('.nothing') || figure.querySelector('details tbody tr')));
for (const numbers of document.querySelectorAll('figure details')) numbers.open = false;

if (EXPECTED.overview.trials) {
  // Sorting, by a button that keeps the focus.
  const button = () => document.querySelector('#ranking-table th[data-id="planner"] button');
  button().focus();
  button().click();
  const names = () => [...document.querySelectorAll('#ranking-table tbody th')].map((th) => th.textContent);
  const up = names();
  check('sorts', button().parentElement.ariaSort === 'ascending' && sameText(up, [...up].sort(new Intl.Collator('en', { numeric: true }).compare)), up);
  button().click();
  check('sorts back', button().parentElement.ariaSort === 'descending' && sameText(names(), up.reverse()), names());
  check('keeps the focus', document.activeElement === button());

  // A trial from a plot, by the keyboard.
  const plot = document.querySelector('[data-figure="cactus"] .plot');
  if (plot.plotted) {
    plot.focus();
    key('ArrowRight', plot);
    check('says what is pointed at', $('status').textContent.length > 3 && !$('tip').hidden, $('status').textContent);
    key('Enter', plot);
    await frames(4);
    // Several repeats are listed, and one of them is chosen.
    if (!$('trial').open) {
      check('lists what is behind a point', !$('narrowed').hidden && document.activeElement === $('trial-list'), $('narrowed-text').textContent);
      key('Enter', $('trial-list'));
    }
    await new Promise((done) => setTimeout(done, 80));
    check('opens a trial from a plot', $('trial').open && location.hash.startsWith('#trial='), location.hash);
    check('shows every column', document.querySelectorAll('#trial-body dl dt').length === report.data.columns.length);
    const [watch, commands] = [...document.querySelectorAll('#trial-body code')].map((code) => code.textContent);
    check('says how to open it in the studio', /^fleetyard studio \S+ --trial \d+$/.test(watch), watch);
    const again = commands.startsWith('fleetyard bench ') || /^fleetyard run .* --trace-out (trial-\d+)\.fyt\nfleetyard trace export \1\.fyt --html \1\.html$/m.test(commands);
    const placed = !report.data.places.scenarios.length || /--map '\/far away\/(.+)\.map' --scen '\/far away\/\1-random-\d+\.scen' /.test(commands);
    check('says how to run it again and watch it', again && placed, commands);
    $('trial-close').click();
    await new Promise((done) => setTimeout(done, 50));
    check('closes', !$('trial').open && location.hash === '', location.hash);
  }
  // And from the list.
  const list = $('trial-list');
  list.focus();
  key('End', list);
  await frames(3);
  check('builds few rows', document.querySelectorAll('#trial-space [role="row"]').length < 40);
  key('Enter', list);
  await new Promise((done) => setTimeout(done, 50));
  check('opens a trial from the list', $('trial').open && $('trial-title').textContent.startsWith('Trial '), $('trial-title').textContent);
  const other = document.querySelector('#trial-body a');
  if (other) {
    const before = location.hash;
    other.focus();
    other.click();
    await new Promise((done) => setTimeout(done, 80));
    check('follows a link', location.hash !== before && $('trial').open, location.hash);
  }
  $('trial-close').click();
  document.querySelector('#trial-head button').click();
  check('sorts the list', document.querySelector('#trial-head [aria-sort="descending"]') !== null);
}

// Filters.
const filter = report.filters.find(({ name }) => name === 'Planner');
if (filter) {
  const box = [...document.querySelectorAll('.filter')].find((box) => box.textContent.startsWith('Planner'));
  $('filters').open = true;
  box.open = true;
  await frames(3);
  box.querySelector('input[type="checkbox"]').click();
  const left = EXPECTED.overview.planners - 1;
  check('filters', cells('ranking').length === left && report.selection.length < report.data.rows, cells('ranking').length);
  check('is quick', report.filter_ms < 2000, report.filter_ms);
  fits('filters fit');
  [...box.querySelectorAll('button')].find((one) => one.textContent === 'None').click();
  check('filters everything', report.selection.length === 0 && cells('ranking')[0][0] === 'No trials.', cells('ranking'));
  $('reset').click();
  check('clears filters', report.selection.length === report.data.rows);
  box.open = false;
  $('rank-by').value = 'appendix';
  $('rank-by').dispatchEvent(new Event('change'));
  check('ranks otherwise', report.story.order === 'appendix');
  $('baseline').selectedIndex = 1;
  $('baseline').dispatchEvent(new Event('change'));
  check('compares with another', $('paired-note').textContent.includes(report.story.planners[1].name), $('paired-note').textContent);
  await drawn();
  document.querySelector('#legend button').click();
  check('emphasises', document.querySelectorAll('.plot .series.chosen').length > 0);
  document.querySelector('#legend button').click();
  for (const select of document.querySelectorAll('figure select')) {
    for (const option of select.options) {
      select.value = option.value;
      select.dispatchEvent(new Event('change'));
    }
  }
  await drawn();
  check('shows every quantity', [...document.querySelectorAll('.plot')].every((plot) => plot.childElementCount));
}

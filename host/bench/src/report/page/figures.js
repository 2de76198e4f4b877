// ---- Figures ----------------------------------------------------------------------
// The same as figures.rs makes of all trials.

/** Points that a line has at most; more could not be told apart. */
const POINTS = 400;
const OUTLIERS = 40;

const metricOf = (column) => data.metrics.find((metric) => metric.column === column);
const axisOf = (metric) => ({ label: metric.label, log: metric.log, zero: !metric.log });

/** Evenly chosen places of `length`, both ends among them. */
function thinned(length, most) {
  if (length <= most) return Array.from({ length }, (_, i) => i);
  return Array.from({ length: most }, (_, i) => Math.floor(i * (length - 1) / (most - 1)));
}

/** What trials differ by in size: team sizes, or those of mazes. */
function sizes() {
  const by = columns.agents.codes.values.length > 1 || columns.maze_width.codes.values.filter((w) => w !== null).length < 2
    ? { column: columns.agents, label: 'agents' } : { column: columns.maze_width, label: 'maze width in cells' };
  return by;
}

/** A planner's trials by size, ascending. */
function bySize(rows) {
  const { numbers } = sizes().column, groups = new Map();
  for (const i of rows) {
    const size = numbers[i];
    if (Number.isNaN(size)) continue;
    if (!groups.has(size)) groups.set(size, []);
    groups.get(size).push(i);
  }
  return [...groups].sort(([a], [b]) => a - b);
}

const byRank = (figure) => [...story.planners].map(figure).filter((series) => series !== null);
const bySlot = (figure) => [...story.planners].sort((a, b) => a.slot - b.slot).map(figure).filter((series) => series !== null);
const rankedNames = () => story.planners.map(({ name }) => name);

const FIGURES = {
  success() {
    const { label } = sizes();
    const many = new Set(selectionSizes()).size > 1;
    if (!many) {
      return {
        title: 'Success', caption: 'Share of trials that succeeded, with 95 % Wilson intervals.',
        x: { label: 'success', percent: true, range: [0, 1] }, y: { label: '', names: rankedNames() },
        series: byRank((p) => ({
          kind: 'bar', name: p.name, slot: p.slot, at: p.rank - 1, value: p.success_rate, interval: [p.success_interval.low, p.success_interval.high],
          text: `${p.successes} of ${p.trials} trials`, rows: [p.rows],
        })),
      };
    }
    return {
      title: `Success by ${label}`, caption: 'Share of trials that succeeded, with 95 % Wilson intervals.',
      x: { label }, y: { label: 'success', percent: true, range: [0, 1] },
      series: bySlot((p) => {
        const groups = bySize(p.rows);
        const good = groups.map(([, rows]) => rows.filter((i) => columns.success.numbers[i] === 1).length);
        return {
          kind: 'curve', name: p.name, slot: p.slot,
          points: groups.map(([size, rows], i) => [size, good[i] / rows.length]),
          band: groups.map(([, rows], i) => { const w = wilson(good[i], rows.length); return [w.low, w.high]; }),
          rows: groups.map(([, rows]) => rows),
        };
      }),
    };
  },

  cactus() {
    return {
      title: 'Trials solved within a time', caption: 'Cactus plot: how many of its trials each planner has solved after how long. Higher and further left is better.',
      x: { label: 'solve time, ms', log: true, unit: 'ms' }, y: { label: 'trials solved', zero: true },
      series: bySlot((p) => {
        const { numbers } = columns.solve_time_ms;
        const ordered = Array.from(p.good).sort((a, b) => numbers[a] - numbers[b]);
        const places = thinned(ordered.length, POINTS);
        return { kind: 'steps', name: p.name, slot: p.slot, points: places.map((i) => [numbers[ordered[i]], i + 1]), rows: places.map((i) => [ordered[i]]) };
      }).filter(({ points }) => points.length),
    };
  },

  times() {
    return {
      title: 'Solve times', caption: 'Box: quartiles, with the median; diamond: mean; whiskers: the farthest within 1.5 interquartile ranges. Of successful trials.',
      x: { label: 'solve time, ms', log: true, unit: 'ms' }, y: { label: '', names: rankedNames() },
      series: byRank((p) => boxOf(p)),
    };
  },

  means(column) {
    const metric = metricOf(column);
    return {
      title: `Mean: ${metric.name}`, caption: 'Means over successful trials, with 95 % t intervals.',
      x: axisOf(metric), y: { label: '', names: rankedNames() },
      series: byRank((p) => {
        const found = summary(valuesOf(p.good, column));
        const { mean_interval: i } = found ?? {};
        return {
          kind: 'bar', name: p.name, slot: p.slot, at: p.rank - 1, value: found?.mean ?? null,
          interval: i && (!metric.log || i.low > 0) ? [i.low, i.high] : null, text: found ? `${digits(found.mean)} (${found.count} trials)` : '', rows: [p.good],
        };
      }),
    };
  },

  scatter(column, a, b) {
    const metric = metricOf(column), { numbers } = columns[column];
    const good = (slot) => story.planners.find((p) => p.slot === slot)?.good ?? [];
    const seen = new Map();
    const key = (i) => tasks.of[i] * 65536 + columns.repeat.numbers[i];
    for (const i of good(a)) seen.set(key(i), i);
    const points = [], rows = [];
    for (const j of good(b)) {
      const i = seen.get(key(j));
      if (i === undefined || Number.isNaN(numbers[i]) || Number.isNaN(numbers[j])) continue;
      points.push([numbers[i], numbers[j]]);
      rows.push([i, j]);
    }
    const [x, y] = [a, b].map((slot) => data.planners[slot] ?? '');
    return {
      title: 'One against another', caption: 'A point per instance, seed and repeat that both solved. Above the line the planner of the vertical axis has more.',
      x: { label: `${short(x, 30)}: ${metric.label}`, log: metric.log }, y: { label: `${short(y, 30)}: ${metric.label}`, log: metric.log },
      diagonal: true, square: true,
      series: [{ kind: 'dots', name: y, slot: b, points, rows }],
      pointText: (series, at) => `${digits(points[at][1])} against ${digits(points[at][0])} of ${x}`,
    };
  },

  size(column) {
    const metric = metricOf(column), { label } = sizes();
    return {
      title: `By ${label}: ${metric.name}`, caption: 'Means over successful trials, with 95 % t intervals. Failures are left out: read it beside the success rate.',
      x: { label }, y: axisOf(metric),
      series: bySlot((p) => {
        const groups = bySize(p.good).map(([size, rows]) => [size, rows, summary(valuesOf(rows, column))]).filter(([, , found]) => found);
        return {
          kind: 'curve', name: p.name, slot: p.slot,
          points: groups.map(([size, , found]) => [size, found.mean]),
          band: groups.map(([, , { mean, mean_interval: i }]) => i && (!metric.log || i.low > 0) ? [i.low, i.high] : [mean, mean]),
          rows: groups.map(([, rows]) => rows),
        };
      }).filter(({ points }) => points.length),
    };
  },
};

function boxOf(p) {
  const found = p.time_ms;
  if (!found) return null;
  const { numbers } = columns.solve_time_ms;
  const ordered = Array.from(p.good).sort((a, b) => numbers[a] - numbers[b]);
  const reach = 1.5 * (found.q3 - found.q1);
  const inside = ordered.filter((i) => numbers[i] >= found.q1 - reach && numbers[i] <= found.q3 + reach);
  const outside = ordered.filter((i) => numbers[i] < found.q1 - reach || numbers[i] > found.q3 + reach);
  const kept = thinned(outside.length, OUTLIERS).map((i) => outside[i]);
  return {
    kind: 'box', name: p.name, slot: p.slot, at: p.rank - 1,
    low: numbers[inside[0]], q1: found.q1, median: found.median, q3: found.q3, high: numbers[inside[inside.length - 1]], mean: found.mean,
    outliers: kept.map((i) => numbers[i]), rows: kept.map((i) => [i]), all: p.good,
    text: `median ${digits(found.median)} ms, quartiles ${digits(found.q1)} and ${digits(found.q3)}, mean ${digits(found.mean)}`,
  };
}

function selectionSizes() {
  const { numbers } = sizes().column, seen = new Set();
  for (const i of story.rows) if (!Number.isNaN(numbers[i])) seen.add(numbers[i]);
  return seen;
}

// ---- Their cards ------------------------------------------------------------------

const cards = [];
let emphasised = null;

function makeFigures() {
  const available = data.metrics.filter(({ column }) => columns[column].numbers.some((value) => !Number.isNaN(value)));
  const select = (label, entries, value) => {
    const control = make('select', { 'aria-label': label }, ...entries.map(([value, name]) => make('option', { value }, name)));
    if (value !== undefined) control.value = value;
    return control;
  };
  const metrics = (value) => select('Quantity', available.map(({ column, name }) => [column, name]), available.some(({ column }) => column === value) ? value : available[0]?.column);
  const planners = (label, value) => select(label, data.planners.map((name, slot) => [slot, name]), value);
  addCard('success', [], () => FIGURES.success());
  addCard('cactus', [], () => FIGURES.cactus());
  addCard('times', [], () => FIGURES.times());
  if (available.length) {
    const mean = metrics('expansions');
    addCard('means', [mean], () => FIGURES.means(mean.value));
    if (slots > 1) {
      const [quantity, x, y] = [metrics('solve_time_ms'), planners('Horizontal', data.scatter[0]), planners('Vertical', data.scatter[1])];
      addCard('scatter', [x, y, quantity], () => FIGURES.scatter(quantity.value, Number(x.value), Number(y.value)));
    }
    if (selectionSizes.call(null, story = { rows: Uint32Array.from({ length: count }, (_, i) => i) }).size > 1) {
      const size = metrics('solve_time_ms');
      addCard('size', [size], () => FIGURES.size(size.value));
    }
  }
  $('legend').replaceChildren(...data.planners.map((name, slot) => make('li', {}, make('button', {
    type: 'button', 'aria-pressed': 'false', onclick: (event) => {
      emphasised = emphasised === slot ? null : slot;
      for (const button of $('legend').querySelectorAll('button')) button.setAttribute('aria-pressed', String(button === event.currentTarget && emphasised !== null));
      emphasise();
    },
  }, ...named(slot)))));
}

function emphasise() {
  for (const { place } of cards) {
    place.classList.toggle('emphasis', emphasised !== null);
    for (const group of place.querySelectorAll('.series')) group.classList.toggle('chosen', Number(group.dataset.slot) === emphasised);
  }
}

function addCard(id, controls, model) {
  const title = make('h3', { id: `figure-${id}` });
  const place = make('div', { class: 'plot', tabindex: 0, role: 'group', 'aria-roledescription': 'plot', 'aria-labelledby': `figure-${id}`, 'aria-describedby': `caption-${id}` });
  const caption = make('figcaption', { id: `caption-${id}` });
  const numbers = make('details', {}, make('summary', {}, 'Numbers'), make('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': 'Numbers of the figure' }));
  const card = { id, place, title, caption, numbers, model };
  for (const control of controls) control.addEventListener('change', () => showFigure(card));
  numbers.addEventListener('toggle', () => showNumbers(card));
  listen(place);
  $('figure-grid').append(make('figure', { 'data-figure': id }, make('div', { class: 'head' }, title, make('div', {}, ...controls)), place, caption, numbers));
  cards.push(card);
}

function showFigures() {
  for (const card of cards) showFigure(card);
}

function showFigure(card) {
  const figure = card.figure = card.model();
  card.title.textContent = figure.title;
  card.caption.textContent = figure.caption;
  const some = figure.series.some((series) => series.points ? series.points.length : series.value !== null);
  if (some) {
    draw(card.place, figure, (index, at) => opened(figure, index, at));
  } else {
    card.place.plotted = null;
    card.place.style.height = '';
    card.place.replaceChildren(make('p', { class: 'nothing' }, 'There is nothing to show here.'));
  }
  if (emphasised !== null) emphasise();
  showNumbers(card);
}

/** What is behind a point: a trial is opened, several are listed. */
function opened(figure, index, at) {
  const series = figure.series[index];
  const rows = at < 0 ? series.all : series.rows[at];
  $('tip').hidden = true;
  if (rows.length === 1) go(rows[0]);
  else narrow(rows, `${figure.title}, ${series.name}`);
}

/** The figure as a table, for who does not see it and who wants its numbers. */
function showNumbers({ figure, numbers }) {
  if (!numbers.open) return;
  const head = [], rows = [];
  const [x, y] = [figure.x.label, figure.y.label];
  const value = (axis, number) => axis.percent ? percent(number) : digits(number, 5);
  for (const series of figure.series) {
    if (series.kind === 'bar') {
      head.splice(0, 3, 'Planner', x, '95 % interval');
      rows.push([series.name, value(figure.x, series.value), series.interval ? `[${series.interval.map((end) => value(figure.x, end)).join(', ')}]` : '–']);
    } else if (series.kind === 'box') {
      head.splice(0, 7, 'Planner', 'Low', 'Q1', 'Median', 'Q3', 'High', 'Mean');
      rows.push([series.name, ...[series.low, series.q1, series.median, series.q3, series.high, series.mean].map((v) => digits(v, 5))]);
    } else {
      head.splice(0, 4, 'Planner', x, y, ...(series.band ? ['95 % interval'] : []));
      for (const at of thinned(series.points.length, 60)) {
        const [px, py] = series.points[at];
        rows.push([series.name, value(figure.x, px), value(figure.y, py), ...(series.band ? [`[${series.band[at].map((end) => value(figure.y, end)).join(', ')}]`] : [])]);
      }
    }
  }
  numbers.lastElementChild.replaceChildren(make('table', {},
    make('thead', {}, make('tr', {}, ...head.map((name, i) => make('th', { class: i ? null : 'text', scope: 'col' }, name)))),
    make('tbody', {}, ...rows.map((cells) => make('tr', {}, ...cells.map((cell, i) => make('td', { class: i ? null : 'text wrap' }, cell)))))));
}

// ---- Figures ----------------------------------------------------------------------
// The same as figures.rs makes of all trials.

/** Points that a line has at most; more could not be told apart. */
const POINTS = 400;
const OUTLIERS = 40;

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const metricOf = (column) => data.metrics.find((metric) => metric.column === column);
const axisOf = (metric) => ({ label: metric.label, log: metric.log, zero: !metric.log });

/** Evenly chosen places of `length`, both ends among them. */
function thinned(length, most) {
  if (length <= most) return Array.from({ length }, (_, i) => i);
  return Array.from({ length: most }, (_, i) => Math.floor(i * (length - 1) / (most - 1)));
}

/** Of a case the number of its size and the size itself. */
const sizeOf = (c) => {
  const i = story.found.members[story.found.first[c]];
  return [size.of[i], size.numbers[i]];
};

/** The sizes that every map has which has any. */
function commonSizes() {
  if (story.sizes) return story.sizes;
  const maps = new Map();
  for (const c of story.found.all) {
    const [group, number] = sizeOf(c), map = mapOfCase[c];
    if (Number.isNaN(number)) continue;
    if (!maps.has(map)) maps.set(map, new Set());
    maps.get(map).add(group);
  }
  const [first, ...rest] = maps.values();
  return story.sizes = new Set([...first ?? []].filter((group) => rest.every((other) => other.has(group))));
}

/** Cases by size, ascending: number of the size and cases; of the sizes that every map has. */
function bySize(some) {
  const groups = [], common = commonSizes();
  for (const c of some) {
    const [group, number] = sizeOf(c);
    if (common.has(group)) (groups[group] ??= [number, []])[1].push(c);
  }
  return groups.filter(Boolean).sort(([a], [b]) => a - b);
}

/** Shares of cases that are solved within something, from cases in ascending order. */
function stepsOf(p, ordered, value) {
  const places = thinned(ordered.length, POINTS);
  return places.length ? {
    kind: 'steps', name: p.name, slot: p.slot, points: places.map((at) => [value(ordered[at]), (at + 1) / p.cases]),
    behind: (at) => [ordered[places[at]]],
  } : null;
}
const solvedShare = { label: 'cases solved', percent: true, range: [0, 1] };

/** A series per planner, in the order of ranks or in that of the suite. */
const byRank = (series) => story.planners.map(series).filter((series) => series !== null);
const bySlot = (series) => [...story.planners].sort((a, b) => a.slot - b.slot).map(series).filter((series) => series !== null);
const rankedNames = () => ({ label: '', names: story.planners.map(({ name }) => name) });
const pairOf = (interval) => interval ? [interval.low, interval.high] : null;
const shown = (found, log) => found?.mean_interval && (!log || found.mean_interval.low > 0) ? pairOf(found.mean_interval) : null;
const trialsOf = (some) => some.length === 1 ? Array.from(story.found.trials(some[0])) : Array.from(some, (c) => Array.from(story.found.trials(c))).flat();

const FIGURES = {
  success() {
    const caption = 'Share of trials that succeeded, with 95 % intervals.';
    const share = { label: 'success', percent: true, range: [0, 1] };
    if (!size) {
      return {
        title: 'Success', caption, x: share, y: rankedNames(),
        series: byRank((p) => ({
          kind: 'bar', name: p.name, slot: p.slot, at: p.place, value: p.success_rate, interval: pairOf(p.success_interval),
          text: `${p.successes} of ${p.cases} cases`, behind: () => p.all,
        })),
      };
    }
    return {
      title: `Success by ${size.label}`, caption, x: { label: size.label }, y: share,
      series: bySlot((p) => {
        const groups = bySize(p.all).map(([number, some]) => [number, some, story.found.rate(some, byMap)]);
        const band = groups.map(([, , found]) => pairOf(found.interval));
        return {
          kind: 'curve', name: p.name, slot: p.slot,
          points: groups.map(([number, , found]) => [number, found.share]),
          // Few scenarios of one size have none.
          band: band.every(Boolean) ? band : null,
          behind: (at) => groups[at][1],
        };
      }),
    };
  },

  cactus() {
    const times = story.found.any('solve_time_ms'), { byTime } = story.found;
    return {
      title: 'Cases solved within a time', caption: 'Cactus plot: the share of its cases that each planner solves within how long. Higher and further left is better.',
      x: axisOf(metricOf('solve_time_ms')), y: solvedShare,
      series: bySlot((p) => stepsOf(p, byTime[p.slot], (c) => times[c])),
    };
  },

  profile() {
    const { found } = story, times = found.any('solve_time_ms'), best = new Float64Array(instances.groups).fill(Infinity);
    for (const c of found.all) if (found.success[c]) best[instanceOfCase[c]] = Math.min(best[instanceOfCase[c]], times[c]);
    const factor = (c) => {
      const times_best = times[c] / best[instanceOfCase[c]];
      return Number.isNaN(times_best) ? 1 : times_best;
    };
    return {
      title: 'Performance profile',
      caption: 'The share of its cases that each planner solves within so many times the time of the fastest planner of the instance: '
        + 'at 1 how often it is the fastest, on the right how much it solves.',
      x: { label: 'times the fastest', log: true }, y: solvedShare,
      series: bySlot((p) => {
        const factors = new Map(found.byTime[p.slot].map((c) => [c, factor(c)]).filter(([, value]) => value < Infinity));
        return stepsOf(p, [...factors.keys()].sort((a, b) => factors.get(a) - factors.get(b)), (c) => factors.get(c));
      }),
    };
  },

  times() {
    return {
      title: 'Solve times',
      caption: 'Box: quartiles and median; diamond: mean; whiskers: the farthest values within one and a half boxes on the logarithmic axis. Of cases that succeeded.',
      x: axisOf(metricOf('solve_time_ms')), y: rankedNames(), series: byRank(boxOf),
    };
  },

  means(name) {
    const metric = metricOf(name);
    return {
      title: `Mean ${metric.name}`, caption: 'Means over cases that succeeded, with 95 % intervals.',
      x: axisOf(metric), y: rankedNames(),
      series: byRank((p) => {
        const found = story.found.spread(p.good, name);
        return {
          kind: 'bar', name: p.name, slot: p.slot, at: p.place, value: found?.mean ?? null, interval: shown(found, metric.log),
          text: found ? `${digits(found.mean)} (${plural(found.count, 'case')})` : '', behind: () => p.good,
        };
      }),
    };
  },

  scatter(name, a, b) {
    const metric = metricOf(name), { found } = story, values = found.any(name);
    const value = (c) => found.success[c] ? values[c] : NaN;
    const of = new Int32Array(instances.groups).fill(-1);
    for (const c of found.of[a]) of[instanceOfCase[c]] = c;
    const points = [], behind = [], only = [0, 0, 0];
    for (const c of found.of[b]) {
      const other = of[instanceOfCase[c]];
      if (other < 0) continue;
      const x = value(other), y = value(c);
      if (!Number.isNaN(x) && !Number.isNaN(y)) {
        points.push([x, y]);
        behind.push([other, c]);
      } else {
        only[Number.isNaN(x) ? Number.isNaN(y) ? 2 : 1 : 0]++;
      }
    }
    const [x, y] = [a, b].map((slot) => data.planners[slot]);
    const axis = (planner) => ({ label: `${planner}: ${metric.label}`, log: metric.log });
    return {
      title: capital(`${metric.name}: one against another`),
      caption: 'A point per case that both solved; above the line the vertical planner has more. '
        + `Only the horizontal one solved ${only[0]}, only the vertical one ${only[1]}, neither ${only[2]}.`,
      x: axis(x), y: axis(y), diagonal: true,
      series: [{ kind: 'dots', name: y, slot: b, points, behind: (at) => behind[at] }],
      pointText: (series, at) => `${digits(points[at][1])} against ${digits(points[at][0])} of ${x}`,
    };
  },

  quality() {
    const { moments_ms } = data.quality, { found } = story;
    return {
      title: 'Quality over time',
      caption: 'Mean ratio of the best valid plan so far to the lower bound, with 95 % intervals, over the cases that have a plan by then: '
        + 'it may rise when a hard case gets its first plan.',
      x: { label: 'time, ms', log: true }, y: { label: 'SoC / lower bound' },
      series: bySlot((p) => {
        // Sums of what is above 1, so that they lose nothing.
        const clusters = moments_ms.map(() => [new Float64Array(clusterCount), new Float64Array(clusterCount)]);
        const best = new Float64Array(moments_ms.length);
        for (const c of p.all) {
          const reference = references()[instanceOfCase[c]];
          if (found.first[c + 1] - found.first[c] === 1) {
            bestBy(found.members[found.first[c]], best);
          } else {
            const all = Array.from(found.trials(c), (i) => bestBy(i, new Float64Array(best.length)));
            for (let at = 0; at < best.length; at++) best[at] = all.every((of) => of[at] < Infinity) ? median(all.map((of) => of[at])) : Infinity;
          }
          for (let at = 0; at < best.length; at++) {
            if (best[at] === Infinity) continue;
            const above = reference > 0 ? best[at] / reference - 1 : 0;
            const [counts, sums] = clusters[at];
            counts[clusterOfCase[c]]++;
            sums[clusterOfCase[c]] += above;
          }
        }
        const known = [];
        moments_ms.forEach((time, at) => {
          const found = clusteredMean(...clusters[at]);
          if (!found) return;
          const { low, high } = found.mean_interval ?? { low: found.mean, high: found.mean };
          known.push([time, { mean: 1 + found.mean, mean_interval: { low: 1 + low, high: 1 + high } }]);
        });
        return known.length ? {
          kind: 'curve', name: p.name, slot: p.slot,
          points: known.map(([time, found]) => [time, found.mean]),
          band: known.map(([, found]) => pairOf(found.mean_interval)),
          behind: () => p.all,
        } : null;
      }),
    };
  },

  targets() {
    const { moments_ms } = data.quality, { found } = story, known = bestKnown();
    const reached = (cost, best) => GAPS.filter((gap) => (cost === Infinity ? 1 : cost > 0 ? 1 - best / cost : 0) <= gap).length / GAPS.length;
    return {
      title: 'Targets reached over time',
      caption: 'The share of targets that each planner has reached within how long; a target is an instance and a gap of 1, 2, 5 or 10 % '
        + 'to the best plan that any planner found of it. Higher and further left is better.',
      x: { label: 'time, ms', log: true }, y: { label: 'targets reached', percent: true, range: [0, 1] },
      series: bySlot((p) => {
        const cases = p.all.filter((c) => known[instanceOfCase[c]] < Infinity);
        const sums = new Float64Array(moments_ms.length), best = new Float64Array(moments_ms.length);
        for (const c of cases) {
          const trials = Array.from(found.trials(c));
          const hits = new Float64Array(moments_ms.length);
          for (const i of trials) bestBy(i, best).forEach((cost, at) => { hits[at] += reached(cost, known[instanceOfCase[c]]); });
          hits.forEach((hit, at) => { sums[at] += hit / trials.length; });
        }
        const points = [];
        moments_ms.forEach((time, at) => {
          const share = sums[at] / cases.length;
          if (share > (points.at(-1)?.[1] ?? 0)) points.push([time, share]);
        });
        return points.length ? { kind: 'steps', name: p.name, slot: p.slot, points, behind: () => cases } : null;
      }),
    };
  },

  size(name) {
    const metric = metricOf(name);
    return {
      title: capital(`${metric.name} by ${size.label}`),
      caption: 'Means over cases that succeeded, with 95 % intervals. Failures are left out: read it beside the success rate.',
      x: { label: size.label }, y: axisOf(metric),
      series: bySlot((p) => {
        const groups = bySize(p.good).map(([number, some]) => [number, some, story.found.spread(some, name, byMap)]).filter(([, , found]) => found);
        return groups.length ? {
          kind: 'curve', name: p.name, slot: p.slot,
          points: groups.map(([number, , found]) => [number, found.mean]),
          band: groups.map(([, , found]) => shown(found, metric.log) ?? [found.mean, found.mean]),
          behind: (at) => groups[at][1],
        } : null;
      }),
    };
  },
};

/** The lower bound of every instance, among the trials that pass. */
function references() {
  if (story.references) return story.references;
  const of = story.references = new Float64Array(instances.groups).fill(Infinity), { numbers } = columns.lower_bound_steps;
  for (const i of story.rows) of[instances.of[i]] = Math.min(of[instances.of[i]], numbers[i]);
  return of;
}

/** Gaps to the best known plan that count as targets. */
const GAPS = [0.01, 0.02, 0.05, 0.10];

/** The smallest sum of costs of a valid plan of every instance, among the trials that pass. */
function bestKnown() {
  if (story.known) return story.known;
  const of = story.known = new Float64Array(instances.groups).fill(Infinity), { first, soc } = changes;
  for (const i of story.rows) {
    if (first[i + 1] > first[i]) of[instances.of[i]] = Math.min(of[instances.of[i]], soc.numbers[first[i + 1] - 1]);
  }
  return of;
}

/** The best sum of costs of a trial by each moment. */
function bestBy(i, best) {
  const { first, moment, soc } = changes;
  let from = 0, last = Infinity;
  for (let at = first[i]; at < first[i + 1]; at++) {
    best.fill(last, from, from = moment.numbers[at]);
    last = soc.numbers[at];
  }
  return best.fill(last, from);
}

const changes = (() => {
  const { changes, moment, soc } = data.quality;
  const counts = new Column(changes).numbers, first = new Uint32Array(count + 1);
  for (let i = 0; i < count; i++) first[i + 1] = first[i] + counts[i];
  return { first, moment: new Column(moment, first[count]), soc: new Column(soc, first[count]) };
})();

function boxOf(p) {
  const found = p.time;
  if (!found) return null;
  const times = story.found.any('solve_time_ms');
  const ordered = story.found.byTime[p.slot];
  const { q1, q3 } = found;
  const [low, high] = q1 > 0 ? [q1 * (q1 / q3) ** 1.5, q3 * (q3 / q1) ** 1.5] : [q1 - 1.5 * (q3 - q1), q3 + 1.5 * (q3 - q1)];
  const inner = ordered.filter((c) => times[c] >= low && times[c] <= high);
  const outer = ordered.filter((c) => times[c] < low || times[c] > high);
  const kept = thinned(outer.length, OUTLIERS).map((at) => outer[at]);
  return {
    kind: 'box', name: p.name, slot: p.slot, at: p.place,
    low: Math.min(q1, inner.length ? times[inner[0]] : q1), q1, median: found.median, q3,
    high: Math.max(q3, inner.length ? times[inner[inner.length - 1]] : q3), mean: found.mean,
    outliers: kept.map((c) => times[c]), behind: (at) => at < 0 ? p.good : [kept[at]],
    text: `median ${digits(found.median)} ms, quartiles ${digits(q1)} and ${digits(q3)}, mean ${digits(found.mean)}`,
  };
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
  const metrics = (value) => select('Quantity', available.map(({ column, label }) => [column, label]),
    available.some(({ column }) => column === value) ? value : available[0].column);
  const planners = (label, value) => select(label, data.planners.map((name, slot) => [slot, short(name, 30)]), value);
  addCard('cactus', [], FIGURES.cactus);
  addCard('success', [], FIGURES.success);
  if (data.planners.length > 1) addCard('profile', [], FIGURES.profile);
  addCard('times', [], FIGURES.times);
  if (available.length) {
    const mean = metrics('expansions');
    addCard('means', [mean], () => FIGURES.means(mean.value));
    if (slots > 1) {
      const [quantity, x, y] = [metrics('solve_time_ms'), planners('Horizontal', data.scatter[0]), planners('Vertical', data.scatter[1])];
      addCard('scatter', [x, y, quantity], () => FIGURES.scatter(quantity.value, Number(x.value), Number(y.value)));
    }
    if (data.quality.moments_ms.length) {
      addCard('quality', [], FIGURES.quality);
      addCard('targets', [], FIGURES.targets);
    }
    if (size) {
      const quantity = metrics('solve_time_ms');
      addCard('size', [quantity], () => FIGURES.size(quantity.value));
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
  $(cards.length ? 'figure-grid' : 'first-figure').append(make('figure', { 'data-figure': id }, make('div', { class: 'head' }, title, make('div', {}, ...controls)), place, caption, numbers));
  cards.push(card);
}

let drawing = 0;

/** Draws all figures, those that are seen first and each in a turn of its own, so that
 *  filters answer at once. */
function showFigures() {
  const turn = ++drawing, seen = ({ place }) => {
    const { top, bottom } = place.getBoundingClientRect();
    return bottom > 0 && top < innerHeight;
  };
  const left = [...cards].sort((a, b) => seen(b) - seen(a));
  const next = () => {
    if (turn !== drawing) return;
    showFigure(left.shift());
    if (left.length) setTimeout(next);
    else page.drawn = turn;
  };
  setTimeout(next);
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
  const rows = trialsOf(series.behind(at));
  $('tip').hidden = true;
  if (rows.length === 1) go(rows[0]);
  else narrow(Uint32Array.from(rows), `${figure.title}, ${series.name}`);
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

// ---- What the trials say ----------------------------------------------------------
// The same as evaluate/ says of all trials, here of those that pass the filters: a case
// is a planner on an instance with a seed and a budget, and intervals count clusters. What is tested
// comes with the page, and is of all trials.

const slots = data.planners.length;

/** The place of a planner's trials in all tables and figures. */
const slotOf = (() => {
  const { values, of } = entrants.codes;
  const place = values.map((name) => data.planners.indexOf(name));
  return Uint16Array.from(of, (code) => place[code]);
})();

const instances = grouped([questions, columns.seed, columns.budget_ms]);
const cases = grouped([questions, columns.seed, columns.budget_ms, entrants]);

/** Of every case its planner and its instance. */
const slotOfCase = new Uint16Array(cases.groups), instanceOfCase = new Uint32Array(cases.groups);
for (let i = 0; i < count; i++) {
  slotOfCase[cases.of[i]] = slotOf[i];
  instanceOfCase[cases.of[i]] = instances.of[i];
}

/** Of every case its cluster, and its map. */
const [clusterOfCase, mapOfCase] = [data.clusters, data.maps].map((packed) => {
  const of = new Uint32Array(cases.groups), { numbers } = new Column(packed);
  for (let i = 0; i < count; i++) of[cases.of[i]] = numbers[i];
  return of;
});
const clusterCount = clusterOfCase.reduce((most, cluster) => Math.max(most, cluster + 1), 0);

/** What trials differ by in size: team sizes, or else sizes of mazes, or nothing. */
const size = (() => {
  if (columns.agents.codes.values.length > 1) return { label: 'agents', numbers: columns.agents.numbers, of: columns.agents.codes.of };
  const mazes = grouped([columns.maze_width, columns.maze_height]);
  return mazes.groups > 1 ? { label: 'maze width in cells', numbers: columns.maze_width.numbers, of: mazes.of } : null;
})();

/** The cases of some trials, repeats brought together. */
class Cases {
  constructor(rows) {
    this.rows = rows;
    const success = columns.success.numbers;
    // The trials of case c are members[first[c]] to members[first[c + 1] - 1].
    this.first = new Uint32Array(cases.groups + 1);
    this.success = new Uint8Array(cases.groups).fill(1);
    /** Share of repeats that succeeded. */
    this.share = new Float64Array(cases.groups);
    for (const i of rows) {
      this.first[cases.of[i] + 1]++;
      if (success[i]) this.share[cases.of[i]]++; else this.success[cases.of[i]] = 0;
    }
    let repeated = false, present = 0;
    for (let c = 0; c < cases.groups; c++) {
      if (this.first[c + 1] > 1) repeated = true;
      if (this.first[c + 1]) present++;
      this.share[c] /= this.first[c + 1];
      this.first[c + 1] += this.first[c];
    }
    /** The trials of all cases, case by case. */
    this.members = new Uint32Array(rows.length);
    const filled = this.first.slice(0, cases.groups);
    for (const i of rows) this.members[filled[cases.of[i]]++] = i;
    this.repeated = repeated;
    /** Those that have a trial, by planner. */
    const counts = new Uint32Array(slots);
    this.all = new Uint32Array(present);
    let at = 0;
    for (let c = 0; c < cases.groups; c++) {
      if (this.first[c] === this.first[c + 1]) continue;
      this.all[at++] = c;
      counts[slotOfCase[c]]++;
    }
    this.of = Array.from(counts, (n) => new Uint32Array(n));
    counts.fill(0);
    for (const c of this.all) this.of[slotOfCase[c]][counts[slotOfCase[c]]++] = c;
    this.values = new Map();
  }

  trials(c) {
    return this.members.subarray(this.first[c], this.first[c + 1]);
  }

  /** Per case the median over repeats of a column, NaN where one has none. */
  any(name) {
    let found = this.values.get(name);
    if (found) return found;
    const { numbers } = columns[name];
    found = new Float64Array(cases.groups).fill(NaN);
    for (const c of this.all) {
      const first = this.first[c];
      if (this.first[c + 1] - first === 1) {
        found[c] = numbers[this.members[first]];
      } else {
        const values = Array.from(this.trials(c), (i) => numbers[i]);
        if (!values.some(Number.isNaN)) found[c] = median(values);
      }
    }
    this.values.set(name, found);
    return found;
  }

  /** Values of those cases among some that succeeded and have one. */
  known(some, name) {
    const found = this.any(name), values = new Float64Array(some.length);
    let length = 0;
    for (const c of some) if (this.success[c] && !Number.isNaN(found[c])) values[length++] = found[c];
    return values.subarray(0, length);
  }

  /** The mean of a column over those cases among some that succeeded, with its interval. */
  spread(some, name, weigh = equally) {
    const found = this.any(name), known = some.filter((c) => this.success[c] && !Number.isNaN(found[c]));
    return known.length ? { ...overClusters(known, (c) => found[c], weigh(known)), count: known.length } : null;
  }

  /** The success rate of some cases, with its interval. */
  rate(some, weigh = equally) {
    const weight = weigh(some), counts = new Float64Array(clusterCount);
    for (const c of some) counts[clusterOfCase[c]] += weight(c);
    const all = sum(counts), shares = Float64Array.from(some, (c) => weight(c) * this.share[c]);
    const share = some.length ? Math.min(1, steadyMean(shares) * some.length / all) : 0;
    const clusters = counts.filter(Boolean), squares = sum(clusters.map((m) => m * m));
    return { share, interval: clusters.length < MIN_CLUSTERS ? null : wilson(share, all * all / squares) };
  }

  /** Those that succeeded by planner, by ascending solve time. */
  get byTime() {
    if (this.ordered) return this.ordered;
    const times = this.any('solve_time_ms'), ordered = this.ordered = this.of.map(() => []);
    const timed = (c) => this.success[c] && !Number.isNaN(times[c]);
    if (this.repeated) {
      this.of.forEach((some, slot) => { ordered[slot] = Array.from(some.filter(timed)).sort((a, b) => times[a] - times[b]); });
    } else {
      // Cases are trials, which have been put in order once.
      for (const i of trialsByTime()) {
        const c = cases.of[i];
        if (this.first[c] < this.first[c + 1] && this.members[this.first[c]] === i && timed(c)) ordered[slotOfCase[c]].push(c);
      }
    }
    return ordered;
  }

  succeeded(some) {
    return some.filter((c) => this.success[c] === 1);
  }
}

let ordered = null;

/** All trials by ascending solve time. */
function trialsByTime() {
  if (ordered) return ordered;
  const { numbers } = columns.solve_time_ms;
  return ordered = Uint32Array.from({ length: count }, (_, i) => i).sort((a, b) => numbers[a] - numbers[b] || a - b);
}

/** The mean of values of cases, with its interval. */
function overClusters(some, value, weight) {
  const counts = new Float64Array(clusterCount), sums = new Float64Array(clusterCount);
  for (const c of some) {
    counts[clusterOfCase[c]] += weight(c);
    sums[clusterOfCase[c]] += weight(c) * value(c);
  }
  return clusteredMean(counts, sums);
}

/** How much each of some cases counts: as much as any other, or so that all maps count as much. */
const equally = () => () => 1;
function byMap(some) {
  const counts = new Map();
  for (const c of some) counts.set(mapOfCase[c], (counts.get(mapOfCase[c]) ?? 0) + 1);
  return (c) => 1 / counts.get(mapOfCase[c]);
}

/** The mean with the rounding of every addition added in the end (Neumaier 1974), so that
 *  it does not depend on the order of values: planners may be equal. */
function steadyMean(values) {
  if (!values.length) return null;
  let total = 0, lost = 0;
  for (const value of values) {
    const next = total + value;
    lost += Math.abs(total) >= Math.abs(value) ? total - next + value : value - next + total;
    total = next;
  }
  return (total + lost) / values.length;
}

function evaluate(rows, order) {
  const found = new Cases(rows);
  const present = data.planners.map((_, slot) => slot).filter((slot) => found.of[slot].length);
  const solvedBy = new Uint16Array(instances.groups), asked = new Uint8Array(instances.groups);
  for (const c of found.all) {
    asked[instanceOfCase[c]] = 1;
    if (found.success[c]) solvedBy[instanceOfCase[c]]++;
  }
  const isShared = solvedBy.map((planners) => present.length && planners === present.length ? 1 : 0);
  const shared = sum(isShared);
  const times = found.any('solve_time_ms');
  const planners = present.map((slot) => {
    const of = found.of[slot], good = found.succeeded(of);
    const expansions = steadyMean(found.known(good, 'expansions'));
    const overall = steadyMean(Float64Array.from(of, (c) => times[c]).filter((time) => !Number.isNaN(time)));
    const common = good.filter((c) => isShared[instanceOfCase[c]]);
    const over = (name) => steadyMean(found.known(common, name)), rate = found.rate(of);
    return {
      slot,
      name: data.planners[slot],
      cases: of.length,
      successes: good.length,
      success_rate: rate.share,
      success_interval: rate.interval,
      comparable_time_ms: shared ? over('solve_time_ms') : overall,
      uncertainty_ms: shared ? over('correction_uncertainty_ms') : steadyMean(found.known(good, 'correction_uncertainty_ms')),
      comparable_length_cells: shared ? over('path_length_cells') : steadyMean(found.known(good, 'path_length_cells')),
      expansions,
      mean_time_ms: overall,
      time: summaryOf(Float64Array.from(found.byTime[slot], (c) => times[c])),
      path_length_cells: shared ? over('path_length_cells') : null,
      suboptimality: shared ? over('suboptimality') : null,
      failures: of.length - good.length,
      all: of,
      good,
    };
  });
  const last = (value) => value ?? Infinity;
  const keys = [(p) => -p.success_rate, (p) => last(p.comparable_time_ms)];
  if (order === 'appendix') keys.push((p) => last(p.comparable_length_cells));
  // Expansions are claims: they rank only where every planner is a part of the host.
  if (rows.every((i) => columns.built_in.numbers[i] === 1)) keys.push((p) => last(p.expansions));
  keys.push((p) => last(p.mean_time_ms));
  planners.sort((a, b) => {
    for (const key of keys) if (key(a) !== key(b)) return key(a) - key(b);
    return a.name < b.name ? -1 : 1;
  });
  planners.forEach((planner, i) => {
    const before = planners[i - 1];
    planner.place = i;
    planner.rank = i && keys.every((key) => key(before) === key(planner)) ? before.rank : i + 1;
    const known = i && [planner, before].every((p) => p.comparable_time_ms !== null && p.uncertainty_ms !== null);
    planner.near = Boolean(known) && Math.abs(planner.comparable_time_ms - before.comparable_time_ms) <= planner.uncertainty_ms + before.uncertainty_ms;
  });
  return { rows, found, planners, order, shared, asked: sum(asked) };
}

// ---- The two tables ---------------------------------------------------------------

const column = (id, name, title, sort, show, more = {}) => ({ id, name, title, sort, show, ...more });
const hidden = (row, show) => [show(row)].flat().map((part) => part.textContent ?? part).join('') === '–';

/** Columns in which something has a value. */
const useful = (columns, rows) => columns.filter(({ show }) => !rows.length || !rows.every((row) => hidden(row, show)));

function showRanking() {
  const { planners, shared, asked } = story;
  const comparable = shared ? `Every planner solved ${plural(shared, 'case')} of ${grouping(asked)}: comparable times, lengths and SoC/LB are means over them.`
    : 'No case was solved by every planner: comparable times are means over all cases of each planner, and lengths and costs are not comparable.';
  // Resampled are all trials, in the order of the suite.
  const ranks = (p) => selection.length === count && story.order === data.order ? data.ranks[p.slot] : null;
  $('ranking-note').textContent = `${comparable} Other times and expansions are of the cases that succeeded; those that failed stand beside them.`
    + (planners.some((p) => p.near) ? ' ≈ marks a comparable time that is no farther from the one before than the uncertainties of both.' : '')
    + (planners.some(ranks) ? ` Beside ranks, where 95 % of them lie when ${data.unit} are drawn anew.` : '');
  showTable('ranking', useful([
    column('rank', 'Rank', 'Rank, and where 95 % of resampled ranks lie', (p) => p.place, (p) => [String(p.rank), ...ranks(p) ? [small(` [${ranks(p).join(', ')}]`)] : []]),
    column('planner', 'Planner', 'Planner', (p) => p.name, (p) => named(p.slot), { text: true }),
    column('success', 'Success', 'Share of trials that succeeded, by case, with its 95 % interval', (p) => p.success_rate,
      (p) => [percent(p.success_rate), ...p.success_interval ? [small(` ${interval(p.success_interval, (x) => fixed(100 * x, 1))}`)] : []], { down: true }),
    column('cases', 'Every repeat', 'Cases of which every repeat succeeded', (p) => p.successes, (p) => `${p.successes}/${p.cases}`, { down: true }),
    column('comparable', 'Comparable, ms', 'Mean time on the instances that every planner solved', (p) => p.comparable_time_ms,
      (p) => p.uncertainty_ms === null ? digits(p.comparable_time_ms) : [`${p.near ? '≈ ' : ''}${digits(p.comparable_time_ms)}`, small(` ± ${digits(p.uncertainty_ms)}`)]),
    column('time', 'Time, ms', 'Mean and standard deviation over cases that succeeded', (p) => p.time?.mean ?? null,
      (p) => p.time ? [digits(p.time.mean), small(` ± ${digits(p.time.standard_deviation)}`)] : '–'),
    column('median', 'Median [IQR], ms', 'Median and interquartile range', (p) => p.time?.median ?? null,
      (p) => p.time ? [digits(p.time.median), small(` [${digits(p.time.q1)}, ${digits(p.time.q3)}]`)] : '–'),
    column('p95', 'p95, ms', '95th percentile', (p) => p.time?.p95 ?? null, (p) => digits(p.time?.p95)),
    column('length', 'Length', 'Mean length of paths in cells on the instances that every planner solved', (p) => p.path_length_cells, (p) => fixed(p.path_length_cells, 2)),
    column('ratio', 'SoC/LB', 'Mean ratio of the sum of costs to its lower bound on the instances that every planner solved', (p) => p.suboptimality, (p) => fixed(p.suboptimality, 3)),
    column('expansions', 'Expansions', 'Mean number of expansions that planners claim', (p) => p.expansions, (p) => fixed(p.expansions, 2)),
    column('failures', 'Failed', 'Cases left out of times and expansions', (p) => p.failures, (p) => String(p.failures), { down: true }),
  ], planners), planners);
}

/** The first number of a cell, to sort by; nothing where there is none. */
function numberIn(text) {
  const raised = (digits) => [...digits].map((c) => c === '⁻' ? '-' : '⁰¹²³⁴⁵⁶⁷⁸⁹'.indexOf(c)).join('');
  const plain = text.replaceAll('−', '-').replace(/×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)/, (_, power) => `e${raised(power)}`).replace(/^[[<≈ ]+/, '');
  const number = Number.parseFloat(plain);
  return Number.isNaN(number) ? null : number;
}

function showPaired() {
  const baseline = Number($('baseline').value), compared = $('compared').value;
  const table = data.paired.find((table) => table.baseline === baseline && table.metric === compared);
  $('paired').hidden = !table;
  if (!table) return;
  $('paired-note').textContent = `${table.note} Of all trials, whatever is filtered.`;
  const slot = (row) => data.planners.indexOf(row.cells[0]);
  showTable('paired', table.head.map((name, at) => at
    ? column(String(at), name, name, (row) => numberIn(row.cells[at]), (row) => row.cells[at], { down: at === 1 })
    : column('planner', name, name, (row) => row.cells[0], (row) => named(slot(row)), { text: true })),
  table.rows.map((cells) => ({ cells })));
}

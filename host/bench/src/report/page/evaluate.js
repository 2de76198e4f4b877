// ---- What the trials say ----------------------------------------------------------
// The same as evaluate/ says of all trials, here of those that pass the filters: a case
// is a planner on an instance with a seed and a budget, and its repeats are one.

const slots = data.planners.length;

/** The place of a planner's trials in all tables and figures. */
const slotOf = (() => {
  const { values, of } = columns.planner.codes;
  const place = values.map((name) => data.planners.indexOf(name));
  return Uint16Array.from(of, (code) => place[code]);
})();

const instances = grouped([columns.instance_digest, columns.seed, columns.budget_ms]);
const cases = grouped([columns.instance_digest, columns.seed, columns.budget_ms, columns.planner]);

/** Of every case its planner and its instance. */
const slotOfCase = new Uint16Array(cases.groups), instanceOfCase = new Uint32Array(cases.groups);
for (let i = 0; i < count; i++) {
  slotOfCase[cases.of[i]] = slotOf[i];
  instanceOfCase[cases.of[i]] = instances.of[i];
}

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
    for (const i of rows) {
      this.first[cases.of[i] + 1]++;
      if (!success[i]) this.success[cases.of[i]] = 0;
    }
    let repeated = false, present = 0;
    for (let c = 0; c < cases.groups; c++) {
      if (this.first[c + 1] > 1) repeated = true;
      if (this.first[c + 1]) present++;
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
    const expansions = steadyMean(found.known(good, 'expansions')), length = steadyMean(found.known(good, 'path_length_cells'));
    const overall = steadyMean(Float64Array.from(of, (c) => times[c]).filter((time) => !Number.isNaN(time)));
    const common = good.filter((c) => isShared[instanceOfCase[c]]);
    const over = (name) => steadyMean(found.known(common, name));
    return {
      slot,
      name: data.planners[slot],
      cases: of.length,
      successes: good.length,
      success_rate: good.length / of.length,
      success_interval: wilson(good.length, of.length),
      comparable_time_ms: shared ? over('solve_time_ms') : overall,
      uncertainty_ms: shared ? over('correction_uncertainty_ms') : steadyMean(found.known(good, 'correction_uncertainty_ms')),
      comparable_length_cells: shared ? over('path_length_cells') : length,
      expansions,
      mean_time_ms: overall,
      time: summaryOf(Float64Array.from(found.byTime[slot], (c) => times[c])),
      path_length_cells: length,
      suboptimality: steadyMean(found.known(good, 'suboptimality')),
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
    planner.rank = i + 1;
    const before = planners[i - 1];
    const known = i && [planner, before].every((p) => p.comparable_time_ms !== null && p.uncertainty_ms !== null);
    planner.near = Boolean(known) && Math.abs(planner.comparable_time_ms - before.comparable_time_ms) <= planner.uncertainty_ms + before.uncertainty_ms;
  });
  return { rows, found, planners, order, shared, asked: sum(asked) };
}

/** Whether tests put the planner that ranks first before every other (see evaluate/lead.rs). */
function leadOf({ found, planners }) {
  const [first, ...rest] = planners;
  if (!rest.length || !first.successes) return null;
  const time = found.any('solve_time_ms'), ours = new Int32Array(instances.groups).fill(-1);
  for (const c of first.all) ours[instanceOfCase[c]] = c;
  const rivals = rest.map(({ name, all }) => {
    let lost = 0, won = 0, slower = 0, faster = 0;
    for (const c of all) {
      const own = ours[instanceOfCase[c]];
      if (own < 0) continue;
      if (found.success[own] && !found.success[c]) lost++;
      if (found.success[c] && !found.success[own]) won++;
      // What has no time is neither.
      if (found.success[c] && found.success[own]) {
        if (time[c] > time[own]) slower++;
        if (time[c] < time[own]) faster++;
      }
    }
    return { name, lost, won, slower, faster };
  });
  const tests = holm(rivals.flatMap(({ lost, won, slower, faster }) => [signTest(lost, won), signTest(slower, faster)]));
  rivals.forEach((rival, i) => {
    [rival.p_solved, rival.p_time] = [tests[2 * i], tests[2 * i + 1]];
    rival.behind = rival.p_solved < 0.05 && rival.lost > rival.won
      || rival.p_time < 0.05 && rival.slower > rival.faster && rival.lost >= rival.won;
  });
  return { name: first.name, rivals };
}

/** What the story says of who is best (see story.rs). */
function headlineOf(lead) {
  const open = lead.rivals.filter(({ behind }) => !behind);
  if (!open.length) return `${lead.name} ranks first`;
  const p = (value) => probability(value).replace(/^(?!<)/, '= ');
  const named = open.slice(0, 3).map((rival) => `${rival.name} (instances solved: p ${p(rival.p_solved)}; times: p ${p(rival.p_time)})`);
  if (open.length > 3) named.push(`${open.length - 3} more`);
  const last = named.pop();
  return `No planner is shown to be the best: tests do not put ${lead.name} before ${named.length ? `${named.join(', ')} and ${last}` : last}`;
}

/** Every planner's solve times against those of one, on the instances that both solved. */
function pair({ found, planners }, baseline) {
  const time = found.any('solve_time_ms'), of = new Float64Array(instances.groups).fill(NaN);
  for (const c of found.of[baseline]) if (found.success[c]) of[instanceOfCase[c]] = time[c];
  const rows = planners.filter(({ slot }) => slot !== baseline).map(({ slot, name, good }) => {
    const differences = Float64Array.from(good, (c) => time[c] - of[instanceOfCase[c]]).filter((d) => !Number.isNaN(d)).sort();
    let greater = 0, smaller = 0;
    for (const d of differences) if (d > 0) greater++; else if (d < 0) smaller++;
    return {
      slot, name, greater, smaller, pairs: differences.length,
      median_delta: quantile(differences, 0.5), interval: medianInterval(differences), p: signTest(greater, smaller), p_holm: null,
    };
  });
  const compared = rows.filter(({ pairs }) => pairs);
  holm(compared.map(({ p }) => p)).forEach((p, i) => { compared[i].p_holm = p; });
  return rows.sort((a, b) => (a.median_delta ?? Infinity) - (b.median_delta ?? Infinity) || (a.name < b.name ? -1 : 1));
}

// ---- The two tables ---------------------------------------------------------------

const column = (id, name, title, sort, show, more = {}) => ({ id, name, title, sort, show, ...more });
const hidden = (row, show) => [show(row)].flat().map((part) => part.textContent ?? part).join('') === '–';

/** Columns in which something has a value. */
const useful = (columns, rows) => columns.filter(({ show }) => !rows.length || !rows.every((row) => hidden(row, show)));

function showRanking() {
  const { planners, shared, asked } = story;
  const comparable = shared ? `Every planner solved ${plural(shared, 'instance')} of ${grouping(asked)}: comparable times are means over them.`
    : 'No instance was solved by every planner: comparable times are means over all cases of each planner.';
  const lead = leadOf(story);
  $('ranking-note').textContent = `${lead ? `${headlineOf(lead)}. ` : ''}${comparable} Other times, lengths, costs and expansions are of the cases that succeeded; those that failed stand beside them.`
    + (planners.some((p) => p.near) ? ' ≈ marks a comparable time that is no farther from the one before than the uncertainties of both.' : '');
  showTable('ranking', useful([
    column('rank', 'Rank', 'Rank', (p) => p.rank, (p) => String(p.rank)),
    column('planner', 'Planner', 'Planner', (p) => p.name, (p) => named(p.slot), { text: true }),
    column('success', 'Success', 'Cases that succeeded, with the 95 % Wilson interval of their share', (p) => p.success_rate,
      (p) => [`${p.successes}/${p.cases} `, small(`${interval(p.success_interval, (x) => fixed(100 * x, 1))} %`)], { down: true }),
    column('comparable', 'Comparable, ms', 'Mean time on the instances that every planner solved', (p) => p.comparable_time_ms,
      (p) => p.uncertainty_ms === null ? digits(p.comparable_time_ms) : [`${p.near ? '≈ ' : ''}${digits(p.comparable_time_ms)}`, small(` ± ${digits(p.uncertainty_ms)}`)]),
    column('time', 'Time, ms', 'Mean and standard deviation over cases that succeeded', (p) => p.time?.mean ?? null,
      (p) => p.time ? [digits(p.time.mean), small(` ± ${digits(p.time.standard_deviation)}`)] : '–'),
    column('median', 'Median [IQR], ms', 'Median and interquartile range', (p) => p.time?.median ?? null,
      (p) => p.time ? [digits(p.time.median), small(` [${digits(p.time.q1)}, ${digits(p.time.q3)}]`)] : '–'),
    column('p95', 'p95, ms', '95th percentile', (p) => p.time?.p95 ?? null, (p) => digits(p.time?.p95)),
    column('length', 'Length', 'Mean length of paths in cells', (p) => p.path_length_cells, (p) => fixed(p.path_length_cells, 2)),
    column('ratio', 'SoC/LB', 'Mean ratio of the sum of costs to its lower bound', (p) => p.suboptimality, (p) => fixed(p.suboptimality, 3)),
    column('expansions', 'Expansions', 'Mean number of expansions that planners claim', (p) => p.expansions, (p) => fixed(p.expansions, 2)),
    column('failures', 'Failed', 'Cases left out of times, lengths, costs and expansions', (p) => p.failures, (p) => String(p.failures), { down: true }),
  ], planners), planners);
  const choose = $('baseline'), chosen = choose.picked;
  choose.replaceChildren(...planners.map((p, i) => make('option', { value: p.slot }, i ? p.name : `${p.name} (ranked first)`)));
  if (planners.length) choose.value = planners.some(({ slot }) => slot === chosen) ? chosen : planners[0].slot;
}

function showPaired() {
  const baseline = Number($('baseline').value);
  $('paired').hidden = story.planners.length < 2;
  if (story.planners.length < 2) return;
  const rows = pair(story, baseline), name = data.planners[baseline];
  $('paired-note').textContent = `Differences of solve times from ${name}, on the instances that both solved: positive where the planner is slower. `
    + '95 % percentile bootstrap intervals of the median, exact two-sided sign tests with Holm’s correction.';
  if (story.rows.length === count && data.paired?.baseline === name) {
    const drawn = new Map(data.paired.intervals);
    for (const row of rows) row.interval = drawn.get(row.name) ?? null;
  }
  rows.forEach((row, i) => { row.place = i; });
  showTable('paired', [
    column('planner', 'Planner', 'Planner', (r) => r.name, (r) => named(r.slot), { text: true }),
    column('pairs', 'Pairs', 'Instances that both solved', (r) => r.pairs, (r) => String(r.pairs), { down: true }),
    column('median', 'Median Δ, ms', 'Median of the differences', (r) => r.median_delta, (r) => digits(r.median_delta)),
    column('interval', '95 % interval', 'Percentile bootstrap', (r) => r.interval?.low ?? null, (r) => interval(r.interval)),
    column('slower', 'Slower/faster', 'Instances on which it is slower, and faster', (r) => r.greater, (r) => `${r.greater}/${r.smaller}`),
    column('p', 'p, Holm', 'Two-sided sign test, corrected after Holm', (r) => r.p_holm, (r) => probability(r.p_holm)),
  ], rows);
}

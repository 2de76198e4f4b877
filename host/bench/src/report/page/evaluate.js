// ---- What the trials say ----------------------------------------------------------
// The same as evaluate/ says of all trials; here of those that pass the filters.

const slots = data.planners.length;

/** The place of a planner's trials in all tables and figures. */
const slotOf = (() => {
  const { values, of } = columns.planner.codes;
  const place = values.map((name) => data.planners.indexOf(name));
  return Uint16Array.from(of, (code) => place[code]);
})();

/** Trials with the same instance and seed, which planners are compared on. */
const tasks = grouped([columns.instance_digest, columns.seed]);

/** A column's values of some trials that have one. */
function valuesOf(rows, name) {
  const { numbers } = columns[name], found = new Float64Array(rows.length);
  let length = 0;
  for (const i of rows) if (!Number.isNaN(numbers[i])) found[length++] = numbers[i];
  return found.subarray(0, length);
}

function evaluate(rows) {
  const success = columns.success.numbers, time = columns.solve_time_ms.numbers;
  // Trials by planner: all, and those that succeeded.
  const counts = new Uint32Array(slots), solved = new Uint32Array(slots);
  for (const i of rows) {
    counts[slotOf[i]]++;
    if (success[i]) solved[slotOf[i]]++;
  }
  const all = Array.from(counts, (n) => new Uint32Array(n)), good = Array.from(solved, (n) => new Uint32Array(n));
  const filled = new Uint32Array(slots), kept = new Uint32Array(slots);
  for (const i of rows) {
    const slot = slotOf[i];
    all[slot][filled[slot]++] = i;
    if (success[i]) good[slot][kept[slot]++] = i;
  }
  const present = [...counts.keys()].filter((slot) => counts[slot]);

  // Per task and planner: trials, successes, and the sum of their times.
  const size = tasks.groups * slots;
  const trials = new Uint16Array(size), successes = new Uint16Array(size), times = new Float64Array(size);
  for (const i of rows) {
    const cell = tasks.of[i] * slots + slotOf[i];
    trials[cell]++;
    if (success[i]) {
      successes[cell]++;
      times[cell] += time[i];
    }
  }
  const shared = [];
  let asked = 0;
  for (let task = 0; task < tasks.groups; task++) {
    let any = false, every = true;
    for (const slot of present) {
      const cell = task * slots + slot;
      if (trials[cell]) any = true;
      if (!trials[cell] || successes[cell] < trials[cell]) every = false;
    }
    if (any) asked++;
    if (any && every) shared.push(task);
  }
  const timeAt = (task, slot) => times[task * slots + slot] / successes[task * slots + slot];

  const planners = present.map((slot) => {
    const comparable = shared.map((task) => timeAt(task, slot));
    return {
      slot,
      name: data.planners[slot],
      trials: counts[slot],
      successes: solved[slot],
      success_rate: solved[slot] / counts[slot],
      success_interval: wilson(solved[slot], counts[slot]),
      time_ms: summary(valuesOf(good[slot], 'solve_time_ms')),
      comparable_mean_time_ms: mean(comparable),
      path_length_cells: mean(valuesOf(good[slot], 'path_length_cells')),
      suboptimality: mean(valuesOf(good[slot], 'suboptimality')),
      expansions: mean(valuesOf(good[slot], 'expansions')),
      rows: all[slot],
      good: good[slot],
    };
  });
  const last = (value) => value === null ? Infinity : value;
  const by = [(p) => -p.success_rate, (p) => last(p.comparable_mean_time_ms)];
  if ($('rank-by').value === 'appendix') by.push((p) => last(p.path_length_cells));
  by.push((p) => last(p.expansions), (p) => last(p.time_ms?.mean ?? null));
  planners.sort((a, b) => {
    for (const key of by) {
      const [x, y] = [key(a), key(b)];
      if (x !== y) return x - y;
    }
    return a.name < b.name ? -1 : 1;
  });
  planners.forEach((planner, i) => { planner.rank = i + 1; });
  return { rows, planners, shared, asked, timeAt };
}

/** Every planner against one, on the tasks that all solved. */
function pair(found, baseline) {
  const rows = found.planners.filter(({ slot }) => slot !== baseline).map(({ slot, name, rank }) => {
    const differences = Float64Array.from(found.shared, (task) => found.timeAt(task, slot) - found.timeAt(task, baseline));
    const slower = differences.filter((d) => d > 0).length, faster = differences.filter((d) => d < 0).length;
    return {
      slot, name, rank, slower, faster, count: differences.length,
      median_ms: median(differences), interval: medianInterval(differences), p: signTest(slower, faster),
    };
  });
  const adjusted = holm(rows.map(({ p }) => p));
  rows.forEach((row, i) => { row.adjusted = adjusted[i]; });
  return rows;
}

// ---- The two tables ---------------------------------------------------------------

function showRanking() {
  const { planners, shared, asked } = story;
  $('ranking-note').textContent = `${plural(shared.length, 'instance')} of ${grouping(asked)} solved by every planner: the comparable time is over them. `
    + 'Other times, lengths and expansions are of successful trials; failures are left out of them and counted beside.';
  const column = (id, name, title, sort, show, more = {}) => ({ id, name, title, sort, show, ...more });
  showTable('ranking', [
    column('rank', 'Rank', 'Rank', (p) => p.rank, (p) => String(p.rank)),
    column('planner', 'Planner', 'Planner', (p) => p.name, (p) => named(p.slot), { text: true }),
    column('success', 'Success', 'Trials that succeeded, with the 95 % Wilson interval of their share', (p) => p.success_rate,
      (p) => [`${p.successes}/${p.trials} `, small(interval(p.success_interval, (x) => fixed(100 * x, 1)) + ' %')], { down: true }),
    column('comparable', 'Comparable, ms', 'Mean time on the instances that every planner solved', (p) => p.comparable_mean_time_ms, (p) => digits(p.comparable_mean_time_ms)),
    column('time', 'Time, ms', 'Mean and standard deviation over successful trials', (p) => p.time_ms?.mean ?? null,
      (p) => p.time_ms ? [digits(p.time_ms.mean), small(` ± ${digits(p.time_ms.standard_deviation)}`)] : '–'),
    column('median', 'Median [IQR], ms', 'Median and interquartile range', (p) => p.time_ms?.median ?? null,
      (p) => p.time_ms ? [digits(p.time_ms.median), small(` [${digits(p.time_ms.q1)}, ${digits(p.time_ms.q3)}]`)] : '–'),
    column('p95', 'p95, ms', '95th percentile', (p) => p.time_ms?.p95 ?? null, (p) => digits(p.time_ms?.p95)),
    column('length', 'Length', 'Mean length of paths in cells', (p) => p.path_length_cells, (p) => fixed(p.path_length_cells, 2)),
    column('ratio', 'SoC/LB', 'Mean ratio of the sum of costs to its lower bound', (p) => p.suboptimality, (p) => fixed(p.suboptimality, 3)),
    column('expansions', 'Expansions', 'Mean number of expansions that planners claim', (p) => p.expansions, (p) => fixed(p.expansions, 2)),
    column('failures', 'Failed', 'Trials left out of the numbers to the left', (p) => p.trials - p.successes, (p) => String(p.trials - p.successes), { down: true }),
  ], planners);
  const choose = $('baseline'), chosen = choose.value;
  choose.replaceChildren(...planners.map((p, i) => make('option', { value: p.slot }, i ? p.name : `${p.name} (best)`)));
  if (choose.chosen && planners.some(({ slot }) => String(slot) === chosen)) choose.value = chosen;
  else if (planners.length) choose.value = planners[0].slot;
}

function showPaired() {
  const baseline = Number($('baseline').value);
  const rows = story.planners.length > 1 ? pair(story, baseline) : [];
  $('paired').hidden = story.planners.length < 2;
  const name = data.planners[baseline];
  $('paired-note').textContent = `Differences of times on the ${plural(story.shared.length, 'instance')} that every planner solved: positive where the planner is slower than ${name}. `
    + 'Exact two-sided sign tests, corrected after Holm; 95 % percentile bootstrap intervals of the median.';
  const column = (id, name, title, sort, show, more = {}) => ({ id, name, title, sort, show, ...more });
  const intervalOf = (row) => {
    const { paired } = data;
    const whole = story.rows.length === count && paired && name === paired.baseline && $('rank-by').value === data.ranking;
    return whole ? paired.intervals[row.name] ?? row.interval : row.interval;
  };
  showTable('paired', [
    column('rank', 'Rank', 'Rank', (r) => r.rank, (r) => String(r.rank)),
    column('planner', 'Planner', 'Planner', (r) => r.name, (r) => named(r.slot), { text: true }),
    column('median', 'Median Δ, ms', 'Median of the differences', (r) => r.median_ms, (r) => digits(r.median_ms)),
    column('interval', '95 % interval', 'Percentile bootstrap', (r) => intervalOf(r)?.low ?? null, (r) => interval(intervalOf(r))),
    column('slower', 'Slower/faster', 'Instances on which it is slower, and faster', (r) => r.slower, (r) => `${r.slower}/${r.faster}`),
    column('p', 'p, Holm', 'Two-sided sign test, corrected after Holm', (r) => r.adjusted, (r) => probability(r.adjusted)),
  ], rows);
}

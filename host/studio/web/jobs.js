// Jobs of the studio as this page knows them, and what their records say.

import { api } from './api.js';

/** In the order of a job's life. */
const STATES = ['queued', 'running', 'stopping', 'done', 'failed', 'cancelled'];

export const isOver = (job) => ['done', 'failed', 'cancelled'].includes(job.state);

export class Jobs {
  constructor(changed) {
    this.changed = changed;
    this.all = new Map();
  }

  /** All jobs, with the results of those that have ended. */
  async load() {
    for (const job of await api.jobs()) this.take(job);
    await Promise.all(this.list.filter((job) => isOver(job) && !hasResult(job)).map(({ id }) => this.refresh(id)));
  }

  /** The newest state of a job; what the feed leaves out stays. */
  take(job) {
    const before = this.all.get(job.id);
    // The answer to a request may come after the news of what came of it.
    const isOlder = before && STATES.indexOf(job.state) < STATES.indexOf(before.state);
    const now = isOlder ? { ...job, ...before } : { ...before, ...job };
    // News has the newest point of a fleet alone.
    const points = job.points ?? before?.points ?? [];
    if (now.point) now.points = now.point.time_s > (points.at(-1)?.time_s ?? -1) ? [...points, now.point] : points;
    this.all.set(job.id, now);
    this.changed(job.id, before);
  }

  /** There is no such job any more. */
  gone(id) {
    if (this.all.delete(id)) this.changed(id, null);
  }

  async refresh(id) {
    try {
      this.take(await api.job(id));
    } catch (error) {
      if (error.status !== 404) throw error;
      this.gone(id);
    }
  }

  get list() { return [...this.all.values()].sort((a, b) => b.id - a.id); }
  get(id) { return this.all.get(id) ?? null; }
}

const VIEW_NAMES = { grid: 'grid', roadmap: 'roadmap', continuous: 'plane' };

/** A command line as a shell reads it. */
const commandLine = (argv) => argv.map((word) => /^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`).join(' ');

/** The command lines of a job, in their order. */
export const commandsOf = ({ command = [] }) => command.map(commandLine);

/** The verdict on a job's plan: in the document as it is now if that is known, else that of its record. */
export function verdictOf(job) {
  const { record, verdict: now } = job;
  if (!now && !record) return null;
  const judged = now && !now.error ? now : record?.judged ?? record?.verdict ?? {};
  const none = now?.error ?? judged.no_plan ?? judged.no_place ?? record?.verdict?.no_plan ?? (job.has?.plan === false ? 'the planner gave no plan' : null);
  const valid = judged.valid ?? record?.verdict?.valid ?? false;
  const isValid = Boolean(valid) && !none;
  // A plan may keep the rules of its view where bodies overlap: by the rules of MAPF robots follow each other round corners.
  const inView = judged.view?.valid && judged.world && !judged.world.valid;
  const words = none ? 'no plan' : isValid ? '✓ valid' : inView ? `✓ valid on the ${VIEW_NAMES[job.view] ?? 'view'}, ✕ not in the world` : '✕ invalid';
  return { valid: isValid, none, words, violations: violationsOf(judged, stepOf(job)) };
}

/** Violations by view and world, in the order of their times: `{rule, agents, time_s, text}`. */
function violationsOf(judged, step_s) {
  const parts = judged.view || judged.world ? [judged.view, judged.world] : [judged];
  const found = parts.flatMap((part) => part?.violations ?? []).map(({ rule, agents = [], sentence = '', time_s, time = 0 }) =>
    ({ rule, agents, text: sentence, time_s: time_s ?? time * step_s }));
  return found.sort((a, b) => a.time_s - b.time_s);
}

/** Seconds of a step of a grid's plan. */
function stepOf({ record }) {
  const { makespan_s, makespan_steps } = record?.metrics ?? {};
  return makespan_s && makespan_steps ? makespan_s / makespan_steps : 1;
}

/** What a record says in a few figures, as names and values. */
export function figuresOf(job) {
  const { record = {}, execution = record.execution, fleet } = job;
  const m = record.metrics ?? {}, rows = [];
  const put = (name, value, unit = '', digits = 2) => { if (value !== null && value !== undefined) rows.push([name, `${+Number(value).toFixed(digits)}${unit}`]); };
  put('sum of costs', m.soc_s, ' s');
  put('sum of costs', m.soc_steps, ' steps', 0);
  if (m.lower_bound_steps) put('lower bound', m.lower_bound_steps, ' steps', 0);
  if (m.suboptimality) put('ratio to the bound', m.suboptimality, '', 3);
  put('makespan', m.makespan_s, ' s');
  put('makespan', m.makespan_steps, ' steps', 0);
  put('path length', m.length_m, ' m', 1);
  put('planning', m.planning_time_ms, ' ms', 1);
  put('first plan after', m.first_solution_ms, ' ms', 1);
  if (m.incumbents?.length > 1) rows.push(['plans', String(m.incumbents.length)]);
  put('memory', record.resources?.peak_memory_bytes && record.resources.peak_memory_bytes / 2 ** 20, ' MiB', 0);
  if (execution) {
    put('executed in', execution.makespan_s, ' s');
    if (execution.agents !== undefined) rows.push(['arrived', `${execution.arrived} of ${execution.agents}`]);
    put('contacts', execution.contacts?.total ?? execution.contacts, '', 0);
  }
  if (fleet?.metrics) {
    const { goals_reached, throughput_per_s, waiting_share, planner_calls, fail_calls, planner_time_ms } = fleet.metrics;
    put('goals reached', goals_reached, '', 0);
    put('throughput', throughput_per_s, ' per second', 3);
    put('waiting', waiting_share && 100 * waiting_share, ' % of the time', 1);
    put('calls of the planner', planner_calls, '', 0);
    put('without its plan', fail_calls, ' calls', 0);
    put('time of a call', planner_time_ms?.p50, ' ms (median)', 1);
    put('contacts', fleet.execution?.contacts, '', 0);
  }
  if (record.termination) rows.push(['ended', String(record.termination)]);
  if (record.plan_digest) rows.push(['plan digest', record.plan_digest]);
  return rows;
}

/** Plans as they came: `{ms, cost, bound}`; costs in steps or seconds. */
export function incumbentsOf(job) {
  const own = job.incumbents?.length ? job.incumbents : job.record?.metrics?.incumbents ?? [];
  return own.map((plan) => ({ ms: plan.at_ms ?? plan.time_ms, cost: plan.soc ?? plan.soc_steps ?? null, bound: plan.lower_bound ?? null }))
    .filter(({ cost }) => cost !== null);
}

/** Points of a fleet over time, `{time_s, goals_reached, …}` each. */
export const pointsOf = (job) => job.fleet?.series ?? job.points ?? [];

/** True if it has come to something. */
export const hasResult = (job) => Boolean(job.record || job.execution || job.fleet);

export const nameOf = (job) => job.opened ?? (job.kind === 'fleet' ? `fleet with ${job.planner}` : `${job.planner ?? job.kind ?? 'job'}${job.view ? ` on the ${VIEW_NAMES[job.view] ?? job.view}` : ''}`);

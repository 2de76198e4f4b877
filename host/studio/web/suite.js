// The trials of a suite that the studio was started with: a list with filters, and the one that was opened.

import { h, field, section, select, say, tidy } from './dom.js';
import { api } from './api.js';
import { isOver } from './jobs.js';

/** Trials of a page of the list. */
const AT_ONCE = 20;
/** What is looked for, by the names that the studio gives the choices. */
const FILTERS = [['planner', 'planners', 'Planner'], ['map', 'maps', 'Map'], ['outcome', 'outcomes', 'Outcome']];
/** Figures of a trial: column, name, unit. */
const FIGURES = [
  ['outcome', 'outcome', ''], ['scenario', 'scenario', ''], ['agents', 'robots', ''], ['seed', 'seed', ''], ['solve_time_ms', 'time', ' ms'],
  ['soc_steps', 'sum of costs', ' steps'], ['soc_s', 'sum of costs', ' s'], ['makespan_steps', 'makespan', ' steps'], ['makespan_s', 'makespan', ' s'],
  ['violations', 'violations', ''], ['first_violation', 'first violation', ''], ['contacts', 'contacts', ''], ['fault', 'fault', ''], ['message', 'said', ''],
  ['plan_digest', 'plan digest', ''], ['trace_digest', 'trace digest', ''],
];

/** Opens the report in a tab of its own, to which no key can be sent but in its address, once. */
function report(event) {
  event.preventDefault();
  // Opened at the click: browsers stop windows that come later.
  const tab = window.open('about:blank', '_blank');
  api.ticket().then((ticket) => {
    const address = `/report?ticket=${ticket}`;
    if (tab) {
      tab.opener = null;
      tab.location.replace(address);
    } else location.assign(address);
  }, () => tab?.close());
}

export class Suite {
  constructor(app, draw) {
    Object.assign(this, { app, redraw: draw, about: null, part: { total: 0, from: 0, trials: [] }, wanted: {}, chosen: null, waits: null, asked: 0 });
  }

  /** Learns whether there is a suite. */
  async load() {
    this.about = await api.get('/suite');
    if (this.about) await this.list(0);
  }

  async list(from) {
    const said = new URLSearchParams({ from, count: AT_ONCE }), asked = ++this.asked;
    for (const [name] of FILTERS) if (this.wanted[name]) said.set(name, this.wanted[name]);
    try {
      const part = await api.get(`/suite/trials?${said}`);
      // Answers to earlier questions may come later.
      if (asked === this.asked) this.part = part;
    } catch (error) { this.app.store.refuse(error); }
    this.redraw();
  }

  /** Opens a trial: its document, and its plan as a recording once it was executed. */
  async open(id) {
    const { app } = this;
    try {
      const answer = await api.post(`/suite/trials/${encodeURIComponent(id)}/open`);
      this.chosen = await api.get(`/suite/trials/${encodeURIComponent(id)}`);
      app.took({ document: answer.document, notes: answer.notes }, `trial ${answer.trial}`);
      if (answer.job) this.follow(answer.job);
    } catch (error) {
      app.store.refuse(error);
      return;
    }
    app.tab('watch');
  }

  /** Shows the trial that the studio was started with. */
  async begin() {
    const { trial, job } = this.about?.opened ?? {};
    if (trial === undefined) return;
    this.chosen = await api.get(`/suite/trials/${trial}`);
    this.app.tab('watch');
    if (job !== null) this.follow(this.app.jobs.get(job) ?? { id: job, state: 'queued' });
  }

  /** Watches a job once it has ended. */
  follow(job) {
    this.waits = job.id;
    this.app.jobs.take(job);
    this.heard(this.app.jobs.get(job.id));
  }

  heard(job) {
    if (!job || job.id !== this.waits || !isOver(job)) return;
    this.waits = null;
    if (this.app.watch.canShow(job)) this.app.watch.show([job.id]);
    else this.app.store.refuse({ message: job.error ?? 'the plan was not executed', hint: job.stderr?.trim().split('\n').at(-1) || null });
  }

  async again() {
    const request = this.chosen.again;
    try {
      const { planner, live } = request.fleet ?? request.run;
      if (!(await api.planners()).some(({ id }) => id === planner)) await api.describe();
      const job = await api.start(request);
      if (live) {
        this.app.jobs.take(job);
        this.app.watch.await(job.id);
      } else this.follow(job);
      say(live ? 'driving again' : 'planning again');
    } catch (error) { this.app.store.refuse(error); }
  }

  /** What the panel of watching shows of it. */
  draw() {
    const { about, part, wanted, waits } = this;
    if (!about) return [];
    const last = part.from + part.trials.length;
    const turn = (name, from, on) => h('button', { type: 'button', disabled: !on, 'data-key': `trials-${name}`, onclick: () => this.list(Math.max(0, from)) }, name);
    return [section(`Suite ${about.name}`,
      ...FILTERS.filter(([, all]) => about[all].length > 1).map(([name, all, title]) => field(title, select([['', 'all'], ...about[all]], wanted[name] ?? '', (value) => { wanted[name] = value; this.list(0); }, { 'data-key': `trials-${name}` }))),
      h('ol', { class: 'list trials' }, ...part.trials.map((trial) => h('li', {}, h('button', {
        type: 'button', 'data-key': `trial-${trial.trial}`, 'aria-current': String(trial.trial === this.chosen?.trial), title: `${trial.map}, ${trial.scenario}, ${trial.agents} robots, seed ${trial.seed}`, onclick: () => this.open(trial.trial),
      }, h('span', {}, String(trial.trial)), h('span', {}, trial.planner), h('small', {}, trial.outcome))))),
      h('div', { class: 'row' }, h('span', { class: 'grow soft' }, part.total ? `${part.from + 1} to ${last} of ${part.total}` : 'No trials.'),
        turn('Back', part.from - AT_ONCE, part.from > 0), turn('Next', last, last < part.total)),
      h('p', {}, h('a', { class: 'link', href: '/report', target: '_blank', onclick: report }, 'The report of the suite'))),
    this.details(waits)];
  }

  details(waits) {
    const { chosen } = this;
    if (!chosen) return null;
    const value = (name) => chosen.columns[name] ?? chosen[name] ?? null;
    const text = (told, unit) => typeof told === 'number' ? `${tidy(told, 2)}${unit}` : String(told);
    const figures = FIGURES.map(([name, title, unit]) => [title, name === 'outcome' ? chosen.outcome : value(name), unit]).filter(([, told]) => told !== null && told !== '');
    return section(`Trial ${chosen.trial}`,
      h('p', {}, `${chosen.planner}, ${chosen.map}`),
      waits ? h('p', { class: 'note', role: 'status' }, 'Its plan is being executed.') : null,
      h('dl', { class: 'facts' }, ...figures.flatMap(([title, told, unit]) => [h('dt', {}, title), h('dd', {}, text(told, unit))])),
      chosen.why_not ? h('p', { class: 'note' }, `${chosen.why_not.charAt(0).toUpperCase()}${chosen.why_not.slice(1)}.`) : null,
      chosen.has_plan ? null : h('div', { class: 'row' }, h('button', { type: 'button', 'data-key': 'trial-again', onclick: () => this.again() }, chosen.again.fleet ? 'Drive again' : 'Plan again')));
  }
}

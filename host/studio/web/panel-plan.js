// The panel of planning: planners with their options, budget, the jobs and what came of them.

import { $, h, fill, check, field, number, section, select, say, icon, iconButton, tidy } from './dom.js';
import { api } from './api.js';
import { schemaForm, sentence } from './forms.js';
import { commandsOf, figuresOf, hasResult, incumbentsOf, isOver, nameOf, verdictOf } from './jobs.js';
import { theme } from './drawing.js';

/** Side by side at most. */
const MOST = 4;
const VIEWS = [['grid', 'grid'], ['roadmap', 'roadmap'], ['continuous', 'plane']];
const SHOWN = 100;

export function planPanel(app, node) {
  const { store, jobs } = app;
  /** Planners that are to run: `{id, view, options}`. */
  const chosen = [];
  const terms = { budget_s: 5, seed: 1, sandbox: 'auto', memory: null, annotations: false, execute: true, policy: 'time', delay: '' };
  let planners = [], asked = 'not yet', filter = '', group = Math.floor(Date.now() / 1000) % 2 ** 31;
  const form = h('div', {}), results = h('div', {});
  node.append(form, results);
  form.className = results.className = 'tab-part';

  async function look() {
    asked = 'looking';
    draw();
    try {
      planners = listed(await api.describe());
      asked = 'found';
    } catch (error) {
      asked = 'failed';
      store.refuse(error);
    }
    if (!chosen.length) suggest();
    draw();
  }
  const listed = (answer) => Array.isArray(answer) ? answer : answer?.planners ?? [];

  /** A planner that is likely to do for the ground. */
  function suggest() {
    const found = (store.map ? ['lacam', 'pibt'] : ['roadmap-pp', 'plane-pp', 'lacam']).map((id) => planners.find((p) => p.id === id)).find(Boolean) ?? planners[0];
    if (found) add(found);
  }

  function add(planner) {
    if (chosen.length >= MOST) return say(`${MOST} planners at most`);
    chosen.push({ id: planner.id, view: (planner.representations ?? [])[0] ?? 'grid', options: {} });
  }

  async function opened() {
    if (asked !== 'not yet') return;
    asked = 'looking';
    try { planners = listed(await api.planners()); } catch { planners = []; }
    if (planners.length) {
      asked = 'found';
      if (!chosen.length) suggest();
      draw();
    } else look();
  }

  function plannerRow(choice, at) {
    const planner = planners.find((p) => p.id === choice.id) ?? { id: choice.id, description: '' };
    const views = planner.representations ?? ['grid'], changed = Object.keys(choice.options).length;
    return h('div', { class: 'planner' },
      h('div', { class: 'row' }, h('b', { class: 'grow', title: planner.version ?? '' }, planner.id, ' ', h('small', { class: 'soft' }, planner.version ?? '')),
        views.length > 1 ? h('span', {}, select(VIEWS.filter(([view]) => views.includes(view)), choice.view, (view) => { choice.view = view; }, { 'aria-label': `View for ${planner.id}`, 'data-key': `view-${at}` }))
          : h('small', { class: 'soft' }, (VIEWS.find(([view]) => view === views[0]) ?? [])[1] ?? views[0]),
        iconButton('close', `Without ${planner.id}`, () => { chosen.splice(at, 1); drawForm(); }, { 'data-key': `without-${at}` })),
      h('p', { class: 'about', title: planner.description }, sentence(planner.description)),
      h('details', { class: 'more', open: choice.open, ontoggle: ({ target }) => { choice.open = target.open; } },
        h('summary', { 'data-key': `options-${at}` }, changed ? `Options (${changed} changed)` : 'Options'),
        schemaForm(planner.options_schema ?? {}, choice.options, (options) => { choice.options = options; }, `opt-${at}`)));
  }

  function drawForm() {
    const wanted = planners.filter((p) => !chosen.some((c) => c.id === p.id));
    const problems = store.problems.length;
    fill(form,
      section('Planners',
        asked === 'looking' ? h('p', { class: 'soft', role: 'status' }, 'Asking what is installed, each planner in its sandbox …') : null,
        asked === 'found' && !planners.length ? h('p', { class: 'soft' }, 'No planner is installed.') : null,
        ...chosen.map(plannerRow),
        h('div', { class: 'row' },
          h('span', { class: 'grow' }, select([['', chosen.length ? 'beside it …' : 'choose a planner …'], ...wanted.map((p) => [p.id, `${p.id} (${(p.representations ?? []).map((v) => (VIEWS.find(([key]) => key === v) ?? [v, v])[1]).join(', ')})`])], '', (id) => {
            const planner = planners.find((p) => p.id === id);
            if (planner) add(planner);
            drawForm();
          }, { 'aria-label': 'Add a planner', 'data-key': 'add-planner', disabled: !wanted.length || chosen.length >= MOST })),
          h('button', { type: 'button', disabled: asked === 'looking', 'data-key': 'look', onclick: look }, 'Look again'))),
      section('Terms',
        h('div', { class: 'pair' },
          field('Budget, s', number(terms.budget_s, (value) => { terms.budget_s = value; }, { min: 0.001, max: 86400, 'data-key': 'budget' })),
          field('Seed', number(terms.seed, (value) => { terms.seed = value; }, { min: 0, step: 1, 'data-key': 'run-seed' }))),
        check('Execute the plan', terms.execute, (on) => { terms.execute = on; drawForm(); }, { 'data-key': 'execute' }),
        h('details', { class: 'more', open: app.open.terms, ontoggle: ({ target }) => { app.open.terms = target.open; } }, h('summary', { 'data-key': 'more-terms' }, 'Sandbox, memory, execution'),
          field('Sandbox', select([['strict', 'strict'], ['auto', 'as the machine grants'], ['none', 'none: unranked']], terms.sandbox, (value) => { terms.sandbox = value; }, { 'data-key': 'sandbox' })),
          field('Memory', number(terms.memory, (value) => { terms.memory = value; }, { min: 16, step: 1, empty: true, placeholder: 'no limit', 'data-key': 'memory' }), 'MiB'),
          check('Annotations of the planner', terms.annotations, (on) => { terms.annotations = on; }, { 'data-key': 'annotations' }),
          terms.execute ? field('Robots go on', select([['time', 'by the plan’s times'], ['adg', 'in the plan’s order']], terms.policy, (value) => { terms.policy = value; }, { 'data-key': 'policy' })) : null,
          terms.execute ? field('Delays', h('input', { type: 'text', value: terms.delay, placeholder: 'none, or bernoulli:0.1,2', 'data-key': 'delay', onchange: ({ target }) => { terms.delay = target.value.trim(); } })) : null),
        problems ? h('p', { class: 'note' }, h('button', { type: 'button', class: 'plain danger', onclick: () => $('problems').click() }, `${problems} problem${problems === 1 ? '' : 's'} in the way`)) : null,
        h('div', { class: 'row' }, h('button', { type: 'button', class: 'primary', id: 'run', 'data-key': 'run', disabled: !chosen.length || problems > 0, onclick: start }, chosen.length > 1 ? `Plan with ${chosen.length} planners` : 'Plan'))),
      fleetCard());
  }

  /** Lifelong operation on the map: robots get new goals while planners plan. */
  const fleet = { planner: null, agents: 20, duration_s: 120, model: 'pebble', seed: 1, delay: '', live: true };

  function fleetCard() {
    if (!store.map) return null;
    const ids = planners.filter((p) => (p.representations ?? []).includes('grid')).map(({ id }) => id);
    fleet.planner = ids.includes(fleet.planner) ? fleet.planner : ids.find((id) => id === 'pbs') ?? ids[0];
    const models = ['pebble', 'rotation', 'agv', 'lsmart-effective'];
    return section('Fleet',
      h('details', { class: 'more', open: app.open.fleet, ontoggle: ({ target }) => { app.open.fleet = target.open; } }, h('summary', { 'data-key': 'fleet' }, 'Robots that get new goals, on and on'),
        ids.length ? field('Planner', select(ids, fleet.planner, (id) => { fleet.planner = id; }, { 'data-key': 'fleet-planner' })) : null,
        h('div', { class: 'pair' },
          field('Robots', number(fleet.agents, (value) => { fleet.agents = value; }, { min: 1, max: 100000, step: 1, 'data-key': 'fleet-agents' })),
          field('Time, s', number(fleet.duration_s, (value) => { fleet.duration_s = value; }, { min: 1, max: 86400, 'data-key': 'fleet-duration' }))),
        field('Model', select(models, fleet.model, (model) => { fleet.model = model; }, { 'data-key': 'fleet-model' })),
        field('Seed', number(fleet.seed, (seed) => { fleet.seed = seed; }, { min: 0, step: 1, 'data-key': 'fleet-seed' })),
        field('Delays', h('input', { type: 'text', value: fleet.delay, placeholder: 'none, or bernoulli:0.1,2', 'data-key': 'fleet-delay', onchange: ({ target }) => { fleet.delay = target.value.trim(); } })),
        check('Live: watch it drive, and take part', fleet.live, (on) => { fleet.live = on; }, { 'data-key': 'fleet-live' }),
        h('div', { class: 'row' }, h('button', { type: 'button', class: 'primary', 'data-key': 'fleet-run', disabled: !ids.length, onclick: async () => {
          const { delay, ...asked } = fleet;
          const job = await begin({ fleet: { ...asked, ...(delay ? { delay } : {}) } }, { planner: fleet.planner, kind: 'fleet' });
          if (job && fleet.live) app.watch.await(job.id);
        } }, 'Run the fleet'))));
  }

  /** Asks for a job; null if it was refused. */
  async function begin(request, known) {
    try {
      const job = await api.start(request);
      jobs.take({ state: 'queued', ...known, ...job });
      return job;
    } catch (error) {
      store.refuse(error);
      return null;
    }
  }

  async function start() {
    if (!chosen.length) return say('choose a planner first');
    group = (group + 1) % 2 ** 31;
    for (const { id, view, options } of chosen) {
      const run = { planner: id, options, view, budget_ms: Math.max(1, Math.round(terms.budget_s * 1000)), seed: terms.seed, annotations: terms.annotations, sandbox: terms.sandbox };
      if (terms.memory) run.memory = terms.memory * 2 ** 20;
      if (terms.execute) run.execute = { policy: terms.policy, ...(terms.delay ? { delay: terms.delay } : {}) };
      if (!await begin(chosen.length > 1 ? { run, group } : { run }, { planner: id, view, budget_ms: run.budget_ms })) return;
    }
    say(chosen.length > 1 ? `${chosen.length} planners plan` : `${chosen[0].id} plans`);
    results.scrollIntoView?.({ block: 'nearest' });
  }

  // ---- Jobs ------------------------------------------------------------------------------

  const cards = new Map();

  function drawJobs() {
    const list = jobs.list;
    for (const [id, card] of cards) {
      if (jobs.get(id)) continue;
      card.remove();
      cards.delete(id);
    }
    let before = null;
    for (const job of list) {
      let card = cards.get(job.id);
      if (!card) {
        card = h('section', { 'aria-label': `Job ${job.id}: ${nameOf(job)}` });
        cards.set(job.id, card);
      }
      const beside = isOver(job) ? groupOf(job).length : 0;
      if (card.job !== job || card.beside !== beside) {
        Object.assign(card, { job, beside });
        drawJob(card, job);
      }
      const next = before ? before.nextSibling : results.firstChild;
      if (next !== card) results.insertBefore(card, next);
      before = card;
    }
  }

  function drawJob(card, job) {
    const over = isOver(job), verdict = over ? verdictOf(job) : null;
    const failed = over && !hasResult(job);
    const state = !over ? [job.state === 'queued' ? '' : 'running', job.state] : failed ? ['failed', job.state === 'cancelled' ? 'cancelled' : 'no result']
      : verdict ? [verdict.none ? 'failed' : verdict.valid ? 'valid' : 'invalid', verdict.words] : ['', job.state];
    card.className = `card job ${over ? failed || (verdict && !verdict.valid) ? 'bad' : 'ok' : ''}`;
    const plans = incumbentsOf(job), canvas = plans.length ? h('canvas', { class: 'chart', role: 'img', 'aria-label': chartWords(plans) }) : null;
    const facts = figuresOf(job);
    fill(card,
      h('h3', {}, h('span', {}, `${job.id}. ${nameOf(job)}`), job.stale ? h('span', { class: 'state', title: 'The document has changed since' }, 'of an older document') : null, h('span', { class: `state ${state[0]}` }, state[1])),
      over ? null : h('p', { class: 'soft' }, job.kind === 'fleet' ? `${job.point?.goals_reached ?? 0} goals after ${tidy(job.point?.time_s ?? 0, 0)} s` : plans.length ? `best so far ${tidy(plans.at(-1).cost, 2)}, claimed` : 'no plan yet'),
      canvas,
      facts.length ? h('dl', { class: 'facts' }, ...facts.slice(0, 4).flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)])) : null,
      facts.length > 4 ? h('details', { class: 'more', open: job.open, ontoggle: ({ target }) => { job.open = target.open; } }, h('summary', { 'data-key': `record-${job.id}` }, 'Record'), h('dl', { class: 'facts' }, ...facts.slice(4).flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)]))) : null,
      verdict?.none ? h('p', { class: 'note' }, verdict.none) : null,
      verdict?.violations.length ? violationList(app, job, verdict.violations) : null,
      failed && job.error ? h('p', { class: 'note' }, job.error) : null,
      failed && job.stderr ? h('p', {}, h('code', {}, job.stderr.trim().split('\n').slice(-6).join('\n'))) : null,
      ...commandsOf(job).map((line) => h('div', { class: 'command' }, h('code', {}, line), iconButton('copy', 'Copy the command line', () => copy(line)))),
      h('div', { class: 'row' },
        ...over ? [
          app.watch?.canShow(job) ? h('button', { type: 'button', class: 'primary', 'data-key': `watch-${job.id}`, onclick: () => app.watch.show(groupOf(job)) }, groupOf(job).length > 1 ? 'Watch side by side' : 'Watch') : null,
          h('button', { type: 'button', 'data-key': `remove-${job.id}`, onclick: () => attempt(api.remove(job.id)).then(() => jobs.refresh(job.id)) }, 'Remove'),
        ] : [
          app.watch?.drives(job) ? h('button', { type: 'button', class: 'primary', 'data-key': `watch-${job.id}`, onclick: () => app.watch.show([job.id]) }, 'Watch live') : null,
          h('button', { type: 'button', class: app.watch?.drives(job) ? '' : 'primary', 'data-key': `stop-${job.id}`, title: 'Keeps the best plan', onclick: () => attempt(api.stop(job.id)) }, icon('stop'), 'Stop'),
          h('button', { type: 'button', 'data-key': `cancel-${job.id}`, onclick: () => attempt(api.cancel(job.id)) }, 'Cancel'),
        ]));
    if (canvas) new ResizeObserver(() => drawChart(canvas, plans, job)).observe(canvas);
  }

  /** Jobs that were started with it and have something to show. */
  const groupOf = (job) => job.group === undefined || job.group === null ? [job.id] : jobs.list.filter((other) => other.group === job.group && app.watch.canShow(other)).map((other) => other.id).sort((a, b) => a - b).slice(0, MOST);

  const attempt = (promise) => promise.catch((error) => store.refuse(error));

  async function copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      say('copied');
    } catch { store.refuse({ message: 'the clipboard is closed to this page', hint: 'select the text and copy it' }); }
  }

  function draw() {
    drawForm();
    drawJobs();
  }
  return { draw, drawJobs, opened, start, look, planners: () => planners, add: (id) => { const planner = planners.find((p) => p.id === id); if (planner) add(planner); draw(); } };
}

/** Violations; each leads to its moment. */
export function violationList(app, job, violations) {
  return h('div', {}, h('h3', {}, `${violations.length} violation${violations.length === 1 ? '' : 's'}`),
    h('ol', { class: 'list violations' }, ...violations.slice(0, SHOWN).map((violation) => h('li', {}, h('button', {
      type: 'button', title: violation.text, onclick: () => app.watch?.jump(job.id, violation),
    }, h('span', {}, `${tidy(violation.time_s, 2)} s`), h('span', {}, violation.rule.replaceAll('-', ' ')), h('small', {}, violation.agents.join(' × ')))))));
}

const chartWords = (plans) => `Cost over time: ${plans.length} plan${plans.length === 1 ? '' : 's'}, from ${tidy(plans[0].cost, 2)} after ${tidy(plans[0].ms, 1)} ms to ${tidy(plans.at(-1).cost, 2)} after ${tidy(plans.at(-1).ms, 1)} ms`;

/** Cost of the best plan over time, as steps, and the lower bound where one is claimed. */
function drawChart(canvas, plans, job) {
  const dpr = Math.min(devicePixelRatio || 1, 3), w = canvas.clientWidth, high = canvas.clientHeight;
  // It is drawn as soon as it is shown.
  if (!w) return;
  Object.assign(canvas, { width: Math.round(w * dpr), height: Math.round(high * dpr) });
  const pen = canvas.getContext('2d');
  pen.scale(dpr, dpr);
  const bounds = plans.filter(({ bound }) => bound !== null);
  const most = Math.max(...plans.map(({ cost }) => cost)), least = Math.min(...plans.map(({ cost }) => cost), ...bounds.map(({ bound }) => bound));
  const end = Math.max(plans.at(-1).ms * 1.05, isOver(job) ? job.record?.metrics?.planning_time_ms ?? 0 : job.budget_ms ?? 0, 1);
  // Times span decades: a plan comes after a millisecond, the next one after a minute.
  const start = Math.max(Math.min(plans[0].ms, end / 10), 0.01);
  const at = (ms) => 6 + (w - 12) * Math.log(Math.max(ms, start) / start) / Math.log(Math.max(end / start, 1.001));
  const up = (cost) => 18 + (high - 34) * (most > least ? (most - cost) / (most - least) : 0.5);
  pen.font = '11px system-ui, sans-serif';
  pen.fillStyle = theme.soft;
  pen.textBaseline = 'alphabetic';
  pen.fillText(tidy(most, 2), 6, 11);
  pen.textAlign = 'right';
  pen.fillText(`${tidy(plans.at(-1).cost, 2)} after ${plans.at(-1).ms < 1000 ? `${tidy(plans.at(-1).ms, 1)} ms` : `${tidy(plans.at(-1).ms / 1000, 2)} s`}`, w - 6, 11);
  pen.textAlign = 'left';
  pen.fillText(`${tidy(start, 1)} ms`, 6, high - 2);
  pen.textAlign = 'right';
  pen.fillText(end < 1000 ? `${tidy(end, 0)} ms` : `${tidy(end / 1000, 1)} s`, w - 6, high - 2);
  pen.strokeStyle = theme.line;
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(6, high - 14);
  pen.lineTo(w - 6, high - 14);
  pen.stroke();
  if (bounds.length) {
    pen.setLineDash([4, 3]);
    steps(pen, bounds.map(({ ms, bound }) => [at(ms), up(bound)]), w - 6);
    pen.strokeStyle = theme.soft;
    pen.stroke();
    pen.setLineDash([]);
  }
  steps(pen, plans.map(({ ms, cost }) => [at(ms), up(cost)]), w - 6);
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 2;
  pen.stroke();
  pen.fillStyle = theme.accent;
  for (const { ms, cost } of plans.length > 200 ? plans.slice(-1) : plans) {
    pen.beginPath();
    pen.arc(at(ms), up(cost), 2.5, 0, 2 * Math.PI);
    pen.fill();
  }
}

function steps(pen, points, right) {
  pen.beginPath();
  points.forEach(([x, y], index) => {
    if (index) pen.lineTo(x, points[index - 1][1]);
    pen[index ? 'lineTo' : 'moveTo'](x, y);
  });
  pen.lineTo(right, points.at(-1)[1]);
}

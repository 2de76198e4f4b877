// The panel of planning: planners with their options, budget, the jobs and what came of them.

import { $, h, fill, check, field, number, section, select, say, icon, iconButton, tidy } from './dom.js';
import { api } from './api.js';
import { run } from './commands.js';
import { schemaForm, sentence } from './forms.js';
import { commandsOf, figuresOf, hasResult, incumbentsOf, isOver, nameOf, pointsOf, verdictOf } from './jobs.js';
import { chartWords, drawCosts, drawThroughput, throughputWords } from './charts.js';
import { asSentence, inRobots } from './places.js';
import { VIEWS, offered, offeredToFleets, viewName } from './planners.js';

/** Side by side at most. */
const MOST = 4;
const SHOWN = 100;
/** Plans are made once, or again and again for robots that get new goals. */
const MODES = [['once', 'One plan'], ['fleet', 'Lifelong fleet']];

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

  /** A planner that is likely to do. */
  function suggest() {
    const found = offered(planners, store.document, app.kinds)[0]?.[1][0];
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
          : h('small', { class: 'soft' }, viewName(views[0])),
        iconButton('close', `Without ${planner.id}`, () => { chosen.splice(at, 1); drawForm(); }, { 'data-key': `without-${at}` })),
      h('p', { class: 'about', title: planner.description }, sentence(planner.description)),
      h('details', { class: 'more', open: choice.open, ontoggle: ({ target }) => { choice.open = target.open; } },
        h('summary', { 'data-key': `options-${at}` }, changed ? `Options (${changed} changed)` : 'Options'),
        schemaForm(planner.options_schema ?? {}, choice.options, (options) => { choice.options = options; }, `opt-${at}`)));
  }

  /** What is asked for, as long as nobody has said it: a fleet where there is a map without robots. */
  const mode = () => app.open.mode ?? (store.map && !store.agents.length ? 'fleet' : 'once');

  const modes = () => h('div', { class: 'modes', role: 'radiogroup', 'aria-label': 'What is planned' }, ...MODES.map(([name, title]) => h('button', {
    type: 'button', role: 'radio', 'aria-checked': String(mode() === name), 'data-key': `mode-${name}`, onclick: () => { app.open.mode = name; drawForm(); },
  }, title)));

  const looking = () => [
    asked === 'looking' ? h('p', { class: 'soft', role: 'status' }, 'Asking what is installed, each planner in its sandbox …') : null,
    asked === 'found' && !planners.length ? h('p', { class: 'soft' }, 'No planner is installed.') : null,
  ];
  const refresh = () => h('button', { type: 'button', disabled: asked === 'looking', 'data-key': 'look', title: 'Looks anew for what is installed', onclick: look }, 'Refresh');

  function drawForm() {
    if (mode() === 'fleet') return fill(form, modes(), fleetCard());
    const wanted = offered(planners, store.document, app.kinds)
      .map(([title, all]) => [title, all.filter((p) => !chosen.some((c) => c.id === p.id)).map((p) => [p.id, `${p.id} (${(p.representations ?? []).map(viewName).join(', ')})`])]).filter(([, all]) => all.length);
    const problems = store.problems.length;
    fill(form, modes(),
      section('Planners',
        ...looking(),
        ...chosen.map(plannerRow),
        h('div', { class: 'row' },
          h('span', { class: 'grow' }, select([['', 'Add planner …'], ...wanted], '', (id) => {
            const planner = planners.find((p) => p.id === id);
            if (planner) add(planner);
            drawForm();
          }, { 'aria-label': 'Add planner', 'data-key': 'add-planner', disabled: !wanted.length || chosen.length >= MOST })),
          refresh())),
      section('Settings',
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
        !store.agents.length ? h('p', { class: 'note' }, 'There are no robots yet: ', h('button', { type: 'button', class: 'plain', 'data-key': 'first-robot', onclick: () => { app.tab('robots'); run('tool-robot'); } }, 'place one'), ' or ', h('button', { type: 'button', class: 'plain', 'data-key': 'first-robots', onclick: () => app.tab('robots') }, 'some at random'), '.')
          : problems ? h('p', { class: 'note' }, h('button', { type: 'button', class: 'plain danger', onclick: () => $('problems').click() }, `${problems} problem${problems === 1 ? '' : 's'} in the way`)) : null,
        h('div', { class: 'row' }, h('button', { type: 'button', class: 'primary', id: 'run', 'data-key': 'run', disabled: !chosen.length || problems > 0, onclick: start }, chosen.length > 1 ? `Plan with ${chosen.length} planners` : 'Plan'))));
  }

  /** Lifelong operation: robots get new goals while planners plan. The defaults are those of the command. */
  const fleet = { planner: null, agents: 20, duration_s: 600, model: 'agv', cell_size_m: null, limit_s: 1, seed: 0, delay: '', live: true };

  function fleetCard() {
    const fit = offeredToFleets(planners), ids = fit.map(({ id }) => id);
    fleet.planner = ids.includes(fleet.planner) ? fleet.planner : ids[0] ?? null;
    const about = fit.find(({ id }) => id === fleet.planner)?.description;
    const models = ['agv', 'lsmart-effective', 'pebble', 'rotation'];
    return section('Lifelong fleet',
      h('p', { class: 'note' }, `Robots get new goals on and on, on the ${store.map ? 'map' : 'grid of the world, as discs that fit its cells'}. They begin at random places, whatever robots the document has.`),
      ...looking(),
      field('Planner', select(ids, fleet.planner, (id) => { fleet.planner = id; drawForm(); }, { 'data-key': 'fleet-planner', disabled: !ids.length })),
      about ? h('p', { class: 'note' }, sentence(about)) : null,
      h('div', { class: 'pair' },
        field('Robots', number(fleet.agents, (value) => { fleet.agents = value; }, { min: 1, max: 100000, step: 1, 'data-key': 'fleet-agents' })),
        field('Time, s', number(fleet.duration_s, (value) => { fleet.duration_s = value; }, { min: 1, max: 86400, 'data-key': 'fleet-duration' }))),
      field('Model', select(models, fleet.model, (model) => { fleet.model = model; }, { 'data-key': 'fleet-model' })),
      field('Side of a cell', number(fleet.cell_size_m ?? store.map?.cell_size_m ?? null, (side) => { fleet.cell_size_m = side; }, { min: 1e-3, empty: true, placeholder: 'of the grid', 'data-key': 'fleet-cell' }), 'm'),
      h('details', { class: 'more', open: app.open.fleet, ontoggle: ({ target }) => { app.open.fleet = target.open; } }, h('summary', { 'data-key': 'fleet' }, 'Seed, limit of a call, delays'),
        h('div', { class: 'pair' },
          field('Seed', number(fleet.seed, (seed) => { fleet.seed = seed; }, { min: 0, step: 1, 'data-key': 'fleet-seed' })),
          field('Limit, s', number(fleet.limit_s, (value) => { fleet.limit_s = value; }, { min: 0.001, max: 3600, 'data-key': 'fleet-limit' }))),
        field('Delays', h('input', { type: 'text', value: fleet.delay, placeholder: 'none, or bernoulli:0.1,2s', 'data-key': 'fleet-delay', onchange: ({ target }) => { fleet.delay = target.value.trim(); } }))),
      check('Live: watch it drive, and take part', fleet.live, (on) => { fleet.live = on; }, { 'data-key': 'fleet-live' }),
      h('div', { class: 'row' }, h('button', { type: 'button', class: 'primary', 'data-key': 'fleet-run', disabled: !ids.length, onclick: runFleet }, 'Run the fleet'), refresh()));
  }

  async function runFleet() {
    const { delay, cell_size_m, limit_s, ...asked } = fleet;
    const more = { limit_ms: Math.max(1, Math.round(limit_s * 1000)), ...(cell_size_m ? { cell_size_m } : {}), ...(delay ? { delay } : {}) };
    const job = await begin({ fleet: { ...asked, ...more } }, { planner: fleet.planner, kind: 'fleet' });
    if (!job) return;
    if (fleet.live) app.watch.await(job.id);
    else awaitAll([job]);
    say('the fleet starts');
  }

  /** Jobs whose results the canvas shows as soon as they are there, if the planners are still looked at. */
  const awaited = new Set();
  let shown = [];
  function awaitAll(begun) {
    shown = [];
    awaited.clear();
    for (const { id } of begun) awaited.add(id);
    for (const job of begun) jobs.take(job);
  }

  function heard(job) {
    if (!isOver(job) || !awaited.delete(job.id) || !app.watch.canShow(job)) return;
    const showing = shown.length > 0 && shown.every((id) => app.watch.ids.includes(id)), { now, playing } = app.watch.clock;
    shown = [...shown, job.id].sort((a, b) => a - b).slice(0, MOST);
    if (!['plan', 'watch'].includes(app.current)) return;
    app.watch.show(shown, { tab: false, at: showing ? now : 0, play: !showing || playing });
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
    const begun = [];
    for (const { id, view, options } of chosen) {
      const run = { planner: id, options, view, budget_ms: Math.max(1, Math.round(terms.budget_s * 1000)), seed: terms.seed, annotations: terms.annotations, sandbox: terms.sandbox };
      if (terms.memory) run.memory = terms.memory * 2 ** 20;
      if (terms.execute) run.execute = { policy: terms.policy, ...(terms.delay ? { delay: terms.delay } : {}) };
      const job = await begin(chosen.length > 1 ? { run, group } : { run }, { planner: id, view, budget_ms: run.budget_ms });
      if (!job) return;
      begun.push(job);
    }
    // Until there is something to show, the canvas has what is planned for.
    if (!app.watch.live) app.watch.close();
    awaitAll(begun);
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
    const plans = incumbentsOf(job), points = pointsOf(job);
    const canvas = plans.length ? h('canvas', { class: 'chart', role: 'img', 'aria-label': chartWords(plans) })
      : points.length > 1 ? h('canvas', { class: 'chart', role: 'img', 'aria-label': throughputWords(points) }) : null;
    const facts = figuresOf(job);
    fill(card,
      h('h3', {}, h('span', {}, `${job.id}. ${nameOf(job)}`), job.stale ? h('span', { class: 'state', title: 'The document has changed since' }, 'of an older document') : null, h('span', { class: `state ${state[0]}` }, state[1])),
      over ? null : h('p', { class: 'soft' }, job.kind === 'fleet' ? `${job.point?.goals_reached ?? 0} goals after ${tidy(job.point?.time_s ?? 0, 0)} s` : plans.length ? `best so far ${tidy(plans.at(-1).cost, 2)}, claimed` : 'no plan yet'),
      canvas,
      facts.length ? h('dl', { class: 'facts' }, ...facts.slice(0, 4).flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)])) : null,
      facts.length > 4 ? h('details', { class: 'more', open: job.open, ontoggle: ({ target }) => { job.open = target.open; } }, h('summary', { 'data-key': `record-${job.id}` }, 'Record'), h('dl', { class: 'facts' }, ...facts.slice(4).flatMap(([name, value]) => [h('dt', {}, name), h('dd', {}, value)]))) : null,
      verdict?.none ? h('p', { class: 'note' }, asSentence(verdict.none)) : null,
      verdict?.violations.length ? violationList(app, job, verdict.violations) : null,
      failed && job.error ? h('p', { class: 'note' }, asSentence(job.error)) : null,
      failed && job.stderr ? h('p', {}, h('code', {}, job.stderr.trim().split('\n').slice(-6).join('\n'))) : null,
      h('details', { class: 'more', open: job.told, ontoggle: ({ target }) => { job.told = target.open; } }, h('summary', { 'data-key': `command-${job.id}` }, 'Command line'),
        ...commandsOf(job).map((line) => h('div', { class: 'command' }, h('code', {}, line), iconButton('copy', 'Copy the command line', () => copy(line))))),
      h('div', { class: 'row' },
        ...over ? [
          app.watch?.canShow(job) ? h('button', { type: 'button', class: 'primary', 'data-key': `watch-${job.id}`, onclick: () => app.watch.show(groupOf(job)) }, groupOf(job).length > 1 ? 'Watch side by side' : 'Watch') : null,
          h('button', { type: 'button', 'data-key': `remove-${job.id}`, onclick: () => attempt(api.remove(job.id)).then(() => jobs.refresh(job.id)) }, 'Remove'),
        ] : [
          app.watch?.drives(job) ? h('button', { type: 'button', class: 'primary', 'data-key': `watch-${job.id}`, onclick: () => app.watch.show([job.id]) }, 'Watch live') : null,
          h('button', { type: 'button', class: app.watch?.drives(job) ? '' : 'primary', 'data-key': `stop-${job.id}`, title: 'Keeps the best plan', onclick: () => attempt(api.stop(job.id)) }, icon('stop'), 'Stop'),
          h('button', { type: 'button', 'data-key': `cancel-${job.id}`, onclick: () => attempt(api.cancel(job.id)) }, 'Cancel'),
        ]));
    if (canvas) new ResizeObserver(() => plans.length ? drawCosts(canvas, plans, job) : drawThroughput(canvas, points)).observe(canvas);
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
  return {
    draw, drawJobs, opened, start, look, heard, await: awaitAll, planners: () => offered(planners, store.document, app.kinds).flatMap(([, all]) => all),
    fleet: () => { app.open.mode = 'fleet'; app.tab('plan'); },
    add: (id) => { const planner = planners.find((p) => p.id === id); if (planner) add(planner); app.open.mode = 'once'; draw(); },
  };
}

/** Violations; each leads to its moment. */
export function violationList(app, job, violations) {
  return h('div', {}, h('h3', {}, `${violations.length} violation${violations.length === 1 ? '' : 's'}`),
    h('ol', { class: 'list violations' }, ...violations.slice(0, SHOWN).map((violation) => h('li', {}, h('button', {
      type: 'button', title: inRobots(violation.text), onclick: () => app.watch?.jump(job.id, violation),
    }, h('span', {}, `${tidy(violation.time_s, 2)} s`), h('span', {}, inRobots(violation.rule.replaceAll('-', ' '))), h('small', {}, violation.agents.join(' × ')))))));
}

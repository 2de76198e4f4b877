// Recordings on the stage: one to four side by side on one clock.

import { Clock, SPEEDS } from '/viewer/clock.js';
import { Cells } from '/viewer/cells.js';
import { Clips } from '/viewer/motion.js';
import { Recording } from '/viewer/recording.js';
import { Scene } from '/viewer/scene.js';
import { Stage } from '/viewer/stage.js';
import { decode } from '/viewer/clip.js';

import { $, h, icon, iconButton, say, select } from './dom.js';
import { api } from './api.js';
import { AGENTS, HEAT, theme } from './drawing.js';
import { isOver, nameOf, verdictOf } from './jobs.js';
import { Live, SPEEDS as PACES, effectsLayer } from './live.js';
import { inRobots } from './places.js';
import { reservationsLayer } from './reservations.js';
import { survey } from './survey.js';
import { Waits, waitsLayer } from './waits.js';

const MOST = 4;
/** A violation is shown so long around its moment. */
const AROUND_S = 0.75;
/** Panes are put elsewhere than beside each other if that shows worlds larger by this factor. */
const CLEARLY = 1.15;

export const OVERLAYS = [
  ['trails', 'Tails'], ['paths', 'Paths'], ['goals', 'Goals'], ['numbers', 'Numbers'], ['contacts', 'Contacts'],
  ['violations', 'Violations'], ['waits', 'Waits for'], ['reservations', 'Reservations'], ['usage', 'Usage'], ['waiting', 'Waiting'], ['annotations', 'Annotations'],
];

export class Watch {
  constructor(app) {
    this.app = app;
    this.panes = [];
    this.clock = new Clock(0);
    this.show_ = { trails: true, paths: false, goals: false, numbers: true, contacts: true, violations: true, waits: false, reservations: false, usage: false, waiting: false, annotations: true };
    this.coloring = 'agent';
    this.window_s = 3;
    this.listeners = [];
    /** Recordings that were opened from files: `{id, name}`. */
    this.files = new Map();
    /** The feed, once it is there. */
    this.feed = null;
    /** What to show as soon as it drives, by its job. */
    this.awaited = null;
    this.buildTransport();
    new ResizeObserver(() => this.arrange()).observe($('stages'));
    this.clock.held = () => this.panes.some(({ scene }) => !scene.known);
    this.clock.on('time', () => this.tellTime());
    this.clock.on('play', () => this.tellPlay());
    this.clock.on('speed', () => { if (!this.live) this.speed.value = String(this.clock.speed); });
  }

  on(listener) { this.listeners.push(listener); }
  tell(what) { for (const listener of this.listeners) listener(what); }

  canShow(job) { return Boolean(job.has?.trace) && isOver(job) || this.drives(job); }

  /** True of a fleet that drives now, and can be watched. */
  drives(job) { return Boolean(job?.live && job.has?.scene) && !isOver(job); }

  /** The fleet that is watched while it drives. */
  get live() { return this.panes[0]?.live ?? null; }

  /** What can be watched, as `[id, name]`. */
  get offers() {
    return [
      ...[...this.files].map(([id, name]) => [id, name]),
      ...this.app.jobs.list.filter((job) => this.canShow(job)).map((job) => [job.id, `${job.id}. ${nameOf(job)}`]),
    ];
  }

  nameOf(id) {
    const job = this.app.jobs.get(id);
    return this.files.get(id) ?? (job ? `${job.id}. ${nameOf(job)}` : `recording ${id}`);
  }

  get ids() { return this.panes.map(({ id }) => id); }
  get open() { return this.panes.length > 0; }

  /** Shows recordings side by side. Resolves once their first picture can be drawn. */
  async show(ids, { tab = true, at = null, play = false } = {}) {
    // A fleet that drives has a time of its own.
    const driving = ids.findLast((id) => this.drives(this.app.jobs.get(id)));
    const wanted = driving === undefined ? ids.slice(0, MOST) : [driving];
    if (driving !== undefined && this.live?.job.id === driving) return true;
    const metas = [];
    try {
      for (const id of wanted) metas.push(this.panes.find((pane) => pane.id === id && !pane.live)?.recording.meta ?? await api.meta(id, true));
    } catch (error) {
      this.app.store.refuse(error);
      return false;
    }
    this.close(false);
    if (!SPEEDS.includes(this.clock.speed)) this.clock.setSpeed(1);
    wanted.forEach((id, index) => this.addPane(id, metas[index]));
    this.buildTransport();
    this.clock.end = Math.max(0, ...this.panes.map(({ recording }) => recording.end_s));
    this.seek.max = this.clock.end;
    this.clock.seek(this.live ? 0 : at ?? 0);
    this.tellPlay();
    this.layout();
    if (tab) this.app.tab('watch');
    if (play && !this.live && !matchMedia('(prefers-reduced-motion: reduce)').matches) this.clock.play(true);
    this.app.store.fine();
    this.tell('shown');
    say(`watching ${wanted.map((id) => this.nameOf(id)).join(', ')}`);
    return true;
  }

  addPane(id, meta) {
    const node = h('div', { class: 'pane', 'data-recording': id });
    $('stages').append(node);
    const stage = new Stage(node);
    Object.assign(stage.scene, { tabIndex: 0 });
    stage.scene.setAttribute('role', 'application');
    stage.scene.setAttribute('aria-label', `${this.nameOf(id)}: map with robots. Arrow keys pan, plus and minus zoom, 0 shows everything.`);
    const recording = new Recording(meta);
    const load = async (from, to) => decode(await api.clip(id, from, to));
    const job = this.app.jobs.get(id), live = this.drives(job) && this.feed
      ? new Live({
        job, feed: this.feed, recording, clock: this.clock, asks: () => this.show_.goals || this.show_.waits || pane.scene.selected >= 0,
        changed: () => { this.tellRange(); stage.invalidate(); },
      }) : null;
    const motion = live?.motion ?? new Clips({
      bodies: meta.ids.length, end_s: meta.duration_s, rate_hz: meta.sample_s > 0 ? 1 / meta.sample_s : 10, load,
      arrived: () => stage.invalidate(),
    });
    const scene = new Scene(stage, recording, motion, this.clock);
    const verdict = job ? verdictOf(job) : null;
    const pane = { id, node, stage, recording, motion, scene, load, live, violations: verdict?.violations ?? [], survey: null, surveying: null };
    pane.waits = live ? { why: null, at: () => live.following ? live.waits : new Map() } : new Waits({
      load: (from, to) => api.waits(id, from, to), window_s: motion.window_s, end_s: meta.duration_s,
      arrived: () => { stage.invalidate(); this.tell('waits'); }, failed: (error) => this.app.store.refuse(error),
    });
    const planned = job?.has?.plan && job.view !== 'continuous' ? (from, to) => api.reservations(id, from, to) : null;
    pane.title = h('p', { class: 'pane-title' }, this.titleOf(id, verdict));
    node.append(pane.title);
    pane.layers = [pathsLayer(pane), heatLayer(pane, 'usage'), heatLayer(pane, 'waiting'), reservationsLayer(this, pane, planned), violations(pane), waitsLayer(pane)];
    if (live) {
      pane.layers.push(effectsLayer(pane));
      live.did = () => this.app.store.fine();
      live.failed = ({ what, reason }) => this.app.store.refuse({ message: `the fleet did not do ${what}: ${reason}`, hint: null });
      // Before the stage makes a press a drag or a choice.
      let chosen = -1;
      stage.grab = () => { chosen = scene.selected; return null; };
      stage.on('pick', (px, py) => {
        const robot = scene.bodies.at(px, py);
        // Whoever was chosen stays so, but for robots that something is done to.
        if (live.clicked(robot, chosen, stage.fromX(px), stage.fromY(py))) scene.select(['hold', 'break'].includes(live.click) ? robot : chosen, false);
      });
    }
    for (const layer of pane.layers) stage.add(layer);
    stage.on('camera', () => this.link(pane));
    scene.on('selected', () => {
      live?.ask();
      if (this.linking) return;
      this.linking = true;
      for (const other of this.panes) if (other !== pane) other.scene.select(scene.selected, false);
      this.linking = false;
      this.tell('selected');
    });
    this.panes.push(pane);
    this.apply(pane);
    if (!live) this.complete(pane);
  }

  /** Shows a fleet as soon as it drives. */
  await(id) {
    this.awaited = id;
    const job = this.app.jobs.get(id);
    if (job) this.changed(job);
  }

  /** Takes a clip of a fleet that drives. */
  clip(id, bytes) {
    const { live } = this;
    if (live?.job.id !== id) return;
    try {
      live.take(bytes);
    } catch (error) {
      this.app.store.refuse(error);
    }
  }

  /** A job is another than it was. */
  changed(job) {
    this.judged(job);
    if (this.awaited === job.id && this.canShow(job)) {
      this.awaited = null;
      this.show([job.id]);
      return;
    }
    const { live } = this;
    if (live?.job.id !== job.id) return;
    // What was driven is a recording now, with contacts and the work of the fleet.
    if (isOver(job)) {
      if (job.has?.trace) this.show([job.id], { tab: false, at: this.clock.now });
      else this.close();
      return;
    }
    live.told(job);
    this.speed.value = String(job.live.speed);
    this.tellPlay();
    this.panes[0].stage.invalidate();
  }

  /** Adds what takes the server a walk through the whole recording: contacts, arrivals, the work of a fleet. */
  async complete(pane) {
    try {
      const { fleet, ...rest } = new Recording(await api.meta(pane.id));
      Object.assign(pane.recording, rest);
    } catch (error) {
      this.app.store.refuse(error);
      return;
    }
    if (!this.panes.includes(pane)) return;
    this.apply(pane);
    this.drawMarks();
    this.tell('complete');
  }

  /** The plan of a job was judged anew. */
  judged(job) {
    const pane = this.panes.find(({ id }) => id === job.id), verdict = pane && verdictOf(job);
    if (!verdict) return;
    pane.violations = verdict.violations;
    pane.title.textContent = this.titleOf(job.id, verdict);
    pane.stage.invalidate();
    this.drawMarks();
  }

  titleOf(id, verdict) {
    return this.nameOf(id) + (verdict ? `, ${verdict.words}` : '');
  }

  /** All show the same part of the world, where their worlds are the same. */
  link(pane) {
    if (this.linking) return;
    this.linking = true;
    for (const other of this.panes) {
      if (other === pane || other.recording.bounds.some((value, at) => value !== pane.recording.bounds[at])) continue;
      other.stage.look({ ...pane.stage.camera });
    }
    this.linking = false;
    this.app.moved();
  }

  close(tell = true) {
    this.clock.play(false);
    for (const pane of this.panes) {
      pane.surveying?.abort();
      pane.live?.end();
      pane.scene.end();
      pane.stage.end();
      pane.node.remove();
    }
    this.panes = [];
    if (!tell) return;
    this.layout();
    this.tell('shown');
  }

  /** Shows the panes, or the document. */
  layout() {
    const on = this.open && !this.app.editing;
    $('stages').dataset.panes = on ? this.panes.length : 1;
    this.arrange();
    $('pane-edit').hidden = on;
    for (const { node } of this.panes) node.hidden = !on;
    $('transport').hidden = !on;
    $('stages').closest('main').toggleAttribute('data-watching', on);
    if (on) for (const { stage } of this.panes) stage.resize();
    this.drawMarks();
  }

  /** Puts worlds beside each other, or, where they are so wide that they are larger then, below each other. */
  arrange() {
    const node = $('stages'), count = Number(node.dataset.panes);
    if (!(count > 1)) return;
    const { clientWidth: w, clientHeight: high } = node;
    const [width, height] = [0, 1].map((axis) => Math.max(...this.panes.map(({ recording: { bounds } }) => bounds[axis + 2] - bounds[axis])));
    const scale = (cols) => Math.min(w / cols / width, high / Math.ceil(count / cols) / height);
    const all = Array.from({ length: count }, (_, at) => at + 1);
    // What is usual gives way to what is clearly larger.
    const usual = Math.min(count, 2), best = all.reduce((most, cols) => scale(cols) > scale(most) ? cols : most);
    node.style.setProperty('--cols', scale(best) > CLEARLY * scale(usual) ? best : usual);
  }

  get stage() { return this.panes[0]?.stage ?? null; }

  overlay(name, on) {
    this.show_[name] = on;
    for (const pane of this.panes) this.apply(pane);
    this.tell('overlays');
  }

  color(by) {
    this.coloring = by;
    for (const pane of this.panes) this.apply(pane);
    this.tell('overlays');
  }

  /** What can be coloured by: waiting takes a walk through the recording, priorities a planner that tells them. */
  get colorings() { return ['agent', 'kind', 'state', ...this.live ? [] : ['delay'], ...this.panes.some(({ recording }) => recording.priorities) ? ['priority'] : []]; }

  apply(pane) {
    for (const [name] of OVERLAYS) {
      const own = pane.layers.find((layer) => layer.name === name);
      if (own) own.visible = this.show_[name];
      else if (name !== 'paths') pane.scene.show(name, this.show_[name]);
    }
    pane.scene.color(this.coloring);
    pane.live?.ask();
    if (this.show_.paths || this.show_.usage || this.show_.waiting || this.wantsTimelines || this.coloring === 'delay') this.look(pane);
    pane.stage.invalidate('ground');
  }

  /** Walks through the recording once, for what needs all of it. */
  async look(pane) {
    if (pane.survey || pane.surveying || pane.live) return;
    pane.surveying = new AbortController();
    try {
      pane.survey = await survey(pane.recording, pane.load, pane.motion.window_s, {
        signal: pane.surveying.signal, progress: (share) => { pane.share = share; this.tell('progress'); },
      });
    } catch (error) {
      this.app.store.refuse(error);
    }
    pane.surveying = null;
    if (pane.survey) pane.motion.knowWaits(pane.survey.waited);
    pane.scene.color(this.coloring);
    pane.stage.invalidate('ground');
    this.tell('surveyed');
  }

  /** Selects a robot by its number, in all panes; -1 is none. The first pane follows it, or not. */
  select(number, follow = true) {
    this.panes.forEach(({ scene, recording }, at) => scene.select(number < 0 ? -1 : recording.agent(number), follow && at === 0));
  }

  /** The moment of a violation of a job, and its place. */
  async jump(id, violation) {
    if (!this.ids.includes(id) && !await this.show([id])) return;
    this.app.tab('watch');
    const pane = this.panes.find((pane) => pane.id === id), { recording, stage, scene } = pane;
    this.clock.play(false);
    this.clock.seek(violation.time_s);
    const ends = violation.agents.map((agent) => recording.agent(agent)).filter((i) => i >= 0);
    if (ends.length) scene.select(ends[0], false);
    pane.aim = ends;
    this.aim(pane);
    say(`${inRobots(violation.rule.replaceAll('-', ' '))} at ${violation.time_s.toFixed(2)} s${violation.agents.length ? `, robots ${violation.agents.join(' and ')}` : ''}`);
    stage.invalidate();
  }

  /** Looks at those that a violation is of, once it is known where they are. */
  aim(pane) {
    const { scene, stage, recording, aim } = pane;
    if (!aim?.length) return;
    if (!pane.motion.place(scene.now, recording.fleet.X, recording.fleet.Y, recording.fleet.H)) {
      pane.motion.keep(scene.now);
      setTimeout(() => this.aim(pane), 50);
      return;
    }
    const mean = (values) => aim.reduce((sum, i) => sum + values[i], 0) / aim.length;
    stage.look({ x: mean(recording.fleet.X), y: mean(recording.fleet.Y), scale: Math.max(stage.camera.scale, 14 / recording.fleet.largest) });
    pane.aim = null;
  }

  /** All moments worth a look, ascending: contacts and violations. */
  get moments() {
    const all = this.panes.flatMap(({ id, recording, violations }) => [
      ...recording.contacts.map((contact) => ({ time_s: contact.from, jump: () => this.panes.find((pane) => pane.id === id)?.scene.point(contact) })),
      ...violations.map((violation) => ({ time_s: violation.time_s, jump: () => this.jump(id, violation) })),
    ]);
    return all.sort((a, b) => a.time_s - b.time_s);
  }

  nextMoment(step) {
    const now = this.clock.now, all = this.moments;
    const found = step > 0 ? all.find(({ time_s }) => time_s > now + 1e-6) : all.findLast(({ time_s }) => time_s < now - 1e-6);
    if (found) found.jump();
    else say(step > 0 ? 'nothing comes after' : 'nothing comes before');
  }

  // ---- The transport ---------------------------------------------------------------------

  buildTransport() {
    const { clock, live } = this;
    this.seek = h('input', { type: 'range', id: 'seek', min: 0, step: 'any', value: 0, 'aria-label': 'Time', oninput: () => this.goTo(Number(this.seek.value)) });
    this.speed = live
      ? select(PACES, live.job.live.speed, (value) => live.speed(Number(value)), { 'aria-label': 'Speed of the fleet', title: 'Simulated seconds per second' })
      : select(SPEEDS.map((value) => [value, `${value}×`]), clock.speed, (value) => clock.setSpeed(Number(value)), { 'aria-label': 'Speed', title: 'Speed ([ and ])' });
    this.playButton = iconButton('play', 'Play', () => this.play(), { id: 'play', title: 'Play or pause (Space)' });
    this.time = h('output', { id: 'clock', for: 'seek' });
    $('transport').replaceChildren(this.playButton,
      ...live ? [
        iconButton('later', 'One block further', () => live.step(), { id: 'step', title: 'Drives one block while the fleet stands still (.)' }),
        iconButton('stop', 'End the fleet', () => live.stop(), { id: 'end-fleet', title: 'Ends the fleet with what it has' }),
      ] : [
        iconButton('earlier', 'Contact or violation before', () => this.nextMoment(-1), { title: 'Contact or violation before (P)' }),
        iconButton('later', 'Next contact or violation', () => this.nextMoment(1), { title: 'Next contact or violation (N)' }),
      ],
      h('div', { id: 'seek-box' }, h('canvas', { id: 'marks', 'aria-hidden': 'true' }), this.seek),
      live ? h('button', { type: 'button', id: 'to-now', onclick: () => this.goTo(clock.end) }, 'Live') : '', this.time, this.speed);
  }

  /** Plays or pauses: a recording, or the fleet itself. */
  play() {
    if (this.live) this.live.pause();
    else this.clock.play(!this.clock.playing);
  }

  goTo(time_s) {
    if (this.live) this.live.seek(time_s);
    else this.clock.seek(time_s);
  }

  /** Goes so many seconds on. A step of a frame is one of a block where a fleet drives. */
  by(step_s) {
    const { live, clock } = this;
    if (live && Math.abs(step_s) < 1) return void (step_s > 0 && live.step());
    if (Math.abs(step_s) < 1) clock.play(false);
    this.goTo(clock.now + step_s);
  }

  otherSpeed(step) {
    const { live, clock } = this;
    if (live) {
      const at = PACES.findIndex(([value]) => value === live.job.live?.speed), next = PACES[Math.min(Math.max(at + step, 0), PACES.length - 1)];
      live.speed(next[0]);
      say(`speed ${next[1]}`);
    } else {
      clock.otherSpeed(step);
      say(`speed ${clock.speed}`);
    }
  }

  /** The times that can be seen of a fleet that drives. */
  tellRange() {
    const { live } = this;
    if (!live) return;
    Object.assign(this.seek, { min: live.earliest, max: this.clock.end });
    $('to-now').setAttribute('aria-pressed', String(live.following));
    this.tellTime();
  }

  tellTime() {
    const { now, end } = this.clock, digits = end < 10 ? 2 : 1;
    this.time.textContent = `${now.toFixed(digits)} / ${end.toFixed(digits)} s`;
    this.seek.value = now;
    this.seek.setAttribute('aria-valuetext', `${now.toFixed(digits)} of ${end.toFixed(digits)} seconds`);
    this.tell('time');
  }

  tellPlay() {
    const playing = this.live ? !this.live.job.live?.paused : this.clock.playing;
    this.playButton.setAttribute('aria-label', playing ? 'Pause' : 'Play');
    this.playButton.replaceChildren(icon(playing ? 'pause' : 'play'));
    this.app.moved();
  }

  drawMarks() {
    const canvas = $('marks');
    if (!canvas || $('transport').hidden) return;
    const dpr = Math.min(devicePixelRatio || 1, 3), w = canvas.clientWidth, high = canvas.clientHeight, { end } = this.clock;
    Object.assign(canvas, { width: Math.round(w * dpr), height: Math.round(high * dpr) });
    const pen = canvas.getContext('2d');
    pen.scale(dpr, dpr);
    pen.fillStyle = theme.contact;
    let last = -1;
    for (const { time_s } of this.moments) {
      const x = Math.round(8 + (end ? time_s / end : 0) * (w - 16));
      if (x !== last) pen.fillRect(x - 1, 0, 2, 8);
      last = x;
    }
  }
}

// ---- Layers -----------------------------------------------------------------------------------

function pathsLayer(pane) {
  let made = null;
  return {
    name: 'paths', plane: 'ground', visible: false,
    draw(pen, stage) {
      if (!pane.survey) return;
      made ??= AGENTS.map((_, color) => {
        const path = new Path2D();
        pane.survey.paths.forEach((places, i) => {
          if (i % AGENTS.length !== color) return;
          for (let at = 0; at + 1 < places.length; at += 2) path[at ? 'lineTo' : 'moveTo'](places[at], places[at + 1]);
        });
        return path;
      });
      pen.save();
      pen.lineJoin = pen.lineCap = 'round';
      pen.lineWidth = Math.max(0.2 * pane.recording.fleet.largest, 1 / stage.camera.scale);
      pen.globalAlpha = Math.min(0.6, Math.max(0.25, 60 / pane.recording.count));
      made.forEach((path, color) => {
        pen.strokeStyle = AGENTS[color];
        pen.stroke(path);
      });
      pen.restore();
    },
  };
}

/** Seconds that robots drove or stood in each cell, from little to much. */
function heatLayer(pane, name) {
  let cells = null;
  return {
    name, plane: 'ground', visible: false,
    draw(pen, stage) {
      if (!pane.survey) return;
      const { rows, cols, side, origin } = pane.survey;
      if (!cells) {
        cells = new Cells({ name, rows, cols, side, colors: () => [null, ...HEAT], opacity: 0.8 });
        cells.scale(pane.survey[name], HEAT.length, { shape: Math.sqrt });
      }
      pen.save();
      pen.translate(origin[0], origin[1]);
      cells.draw(pen, stage);
      pen.restore();
    },
  };
}

/** A cross over those of a violation around its moment. */
function violations(pane) {
  return {
    name: 'violations', plane: 'over',
    draw(pen, stage, now) {
      const { X, Y } = pane.recording.fleet;
      for (const { agents, time_s } of pane.violations) {
        if (Math.abs(time_s - now) > AROUND_S) continue;
        const ends = agents.map((agent) => pane.recording.agent(agent)).filter((i) => i >= 0);
        if (!ends.length) continue;
        const x = stage.toX(ends.reduce((sum, i) => sum + X[i], 0) / ends.length), y = stage.toY(ends.reduce((sum, i) => sum + Y[i], 0) / ends.length);
        for (const [color, wide] of [[theme.halo, 6], [theme.problem, 3]]) {
          pen.beginPath();
          pen.rect(x - 13, y - 13, 26, 26);
          pen.moveTo(x - 6, y - 6);
          pen.lineTo(x + 6, y + 6);
          pen.moveTo(x - 6, y + 6);
          pen.lineTo(x + 6, y - 6);
          pen.strokeStyle = color;
          pen.lineWidth = wide;
          pen.stroke();
        }
      }
    },
  };
}

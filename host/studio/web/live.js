// A fleet that drives now: its clips come by the feed, and what one wants of it goes back.

import { Clips } from '/viewer/motion.js';
import { decode } from '/viewer/clip.js';

import { api } from './api.js';
import { say } from './dom.js';
import { theme } from './drawing.js';

/** Speeds that can be asked for, in simulated seconds per second; 0 is as fast as it goes. */
export const SPEEDS = [[0.5, '0.5×'], [1, '1×'], [2, '2×'], [5, '5×'], [10, '10×'], [20, '20×'], [50, '50×'], [0, 'as fast as it goes']];

/** What a click does, by its name: to a robot or to a cell. */
export const CLICKS = [
  ['follow', 'follow a robot'], ['hold', 'delay a robot by 10 s'], ['break', 'break a robot, or repair it'],
  ['close', 'block a cell for 60 s, or open it'], ['send', 'send the chosen robot to a cell, too'],
];

const HOLD_S = 10;
const CLOSE_S = 60;
/** A robot that is broken stands until somebody repairs it: a year is the longest that the fleet takes. */
const BROKEN_S = 366 * 86_400;

/** Milliseconds between two questions about goals and waits, at least. */
const ASK_MS = 250;

/** Seconds that the picture is behind what has come, at the speed of the fleet: so clips join without a halt. */
const BEHIND_S = 0.15;

export class Live {
  /** `feed` carries clips and commands of a job; `recording` is its, `clock` the one to keep in step; `asks()` is true while
   * somebody looks at goals or waits. */
  constructor({ job, feed, recording, clock, asks, changed }) {
    Object.assign(this, { job, feed, recording, clock, asks, changed });
    this.motion = new Clips({ bodies: recording.ids.length, end_s: 0 });
    /** True while one watches what happens now, and not what was. */
    this.following = true;
    this.click = 'follow';
    this.pace_s = 1;
    this.last_ms = null;
    this.refused = job.live?.refused ?? 0;
    /** When something was last done to it. */
    this.done_s = job.live?.interventions?.at(-1)?.at_s ?? -1;
    /** Cells of goals, and who is waited for, by numbers of robots. */
    this.goals = this.waits = new Map();
    this.asking = false;
    this.asked_ms = -Infinity;
    recording.goalAt = (i) => this.following ? this.middleOf(this.goals.get(recording.ids[i])) : null;
    Object.assign(clock, { open: true, end: 0 });
    // All clips: each has just what came since the one before.
    feed.watch(job.id, 60);
  }

  end() {
    this.feed.watch(null);
    this.clock.open = false;
  }

  /** Takes a clip. */
  take(bytes) {
    const clip = decode(bytes), { motion, clock } = this, from_s = motion.end_s;
    const last_s = clip.first_s + (clip.samples - 1) * clip.sample_s;
    const now_ms = performance.now();
    if (this.last_ms !== null && last_s > from_s) {
      const pace = (last_s - from_s) / Math.max((now_ms - this.last_ms) / 1000, 1e-3);
      this.pace_s += 0.2 * (pace - this.pace_s);
    }
    this.last_ms = now_ms;
    motion.add(clip);
    motion.end_s = this.recording.end_s = clock.end = last_s;
    if (this.following) this.follow(clip.first_s);
    this.ask();
    this.changed();
  }

  /** Asks what robots are about to do, if somebody looks. One question at a time: a page that is slow asks less often. */
  async ask() {
    if (!this.asks() || this.asking || performance.now() - this.asked_ms < ASK_MS) return;
    this.asking = true;
    this.asked_ms = performance.now();
    try {
      const { goals, waits } = await api.doing(this.job.id);
      const byNumber = (all) => new Map(Object.entries(all).map(([agent, what]) => [Number(agent), what]));
      Object.assign(this, { goals: byNumber(goals), waits: byNumber(waits) });
      this.changed();
    } catch {
      // A fleet that is gone; its picture stays.
    }
    this.asking = false;
  }

  /** Keeps a little behind what has come: faster or slower as that is farther away or nearer. */
  follow(first_s = this.clock.end) {
    const { clock } = this, wanted_s = BEHIND_S * Math.max(this.pace_s, 0.1), behind_s = clock.end - clock.now;
    // What came was not all, or far more than can be shown in time.
    const known = this.motion.kept.some(([from, to]) => from <= clock.now + 1e-9 && clock.now <= to + 1e-9);
    if (!known || behind_s > 8 * wanted_s) clock.seek(Math.max(Math.min(first_s, clock.end), clock.end - wanted_s));
    clock.setSpeed(Math.max(0.01, this.pace_s * Math.min(Math.max(behind_s / wanted_s, 0.5), 2)));
    if (!clock.playing && !this.job.live?.paused) clock.play(true);
  }

  /** Shows a moment that was, or, at the end, what happens now. */
  seek(time_s) {
    const { clock, motion } = this, kept = motion.kept;
    if (!kept.length) return;
    this.following = time_s >= clock.end - 1e-6;
    // Between clips there is nothing to be seen.
    const inside = kept.find(([from, to]) => time_s >= from && time_s <= to);
    const near = inside ? time_s : kept.flat().reduce((best, each) => Math.abs(each - time_s) < Math.abs(best - time_s) ? each : best);
    clock.seek(near);
    if (!this.following) clock.play(false);
    else this.follow();
    this.changed();
  }

  get earliest() { return this.motion.kept[0]?.[0] ?? 0; }

  tell(what) { this.feed.control(this.job.id, what); }

  pause(on = !this.job.live?.paused) {
    this.tell({ pause: on });
    if (!on) this.seek(this.clock.end);
    say(on ? 'the fleet stands still' : 'the fleet goes on');
  }

  step(blocks = 1) {
    this.tell({ step: blocks });
    this.following = true;
  }

  speed(value) { this.tell({ speed: value }); }

  stop() { this.tell({ stop: true }); }

  /** The newest state of the job. Says what the fleet did not do. */
  told(job) {
    this.job = job;
    const { refused = 0, refusal, interventions = [] } = job.live ?? {};
    const last = interventions.at(-1)?.at_s ?? -1;
    if (refused > this.refused && refusal) this.failed?.(refusal);
    else if (last > this.done_s) this.did?.();
    Object.assign(this, { refused, done_s: last });
    if (job.live?.paused && this.following) this.clock.seek(this.clock.end);
  }

  /** What was done and holds at a time: until when robots are held, and cells closed. */
  effects(now_s) {
    const held = new Map(), closed = new Map();
    for (const { at_s, what } of this.job.live?.interventions ?? []) {
      if (at_s > now_s + 1e-6) break;
      if (what.hold) held.set(what.hold.agent, at_s + what.hold.for_s);
      if (what.release) held.delete(what.release.agent);
      if (what.close) closed.set(what.close.cell, at_s + what.close.for_s);
      if (what.open) closed.delete(what.open.cell);
    }
    for (const all of [held, closed]) for (const [key, until_s] of all) if (until_s <= now_s) all.delete(key);
    return { held, closed };
  }

  // ---- What is done to it ----------------------------------------------------------------------

  hold(agent) {
    this.tell({ hold: { agent, for_s: HOLD_S } });
    say(`robot ${agent} is held for ${HOLD_S} s`);
  }

  break(agent) {
    const broken = this.effects(this.clock.end).held.has(agent);
    this.tell(broken ? { release: { agent } } : { hold: { agent, for_s: BROKEN_S } });
    say(broken ? `robot ${agent} is repaired` : `robot ${agent} is broken`);
  }

  close(cell) {
    const closed = this.effects(this.clock.end).closed.has(cell);
    this.tell(closed ? { open: { cell } } : { close: { cell, for_s: CLOSE_S } });
    say(closed ? `${this.placeOf(cell)} opens` : `${this.placeOf(cell)} closes for ${CLOSE_S} s, once nobody is there`);
  }

  send(agent, cell) {
    this.tell({ send: { agent, cell } });
    say(`robot ${agent} also goes to ${this.placeOf(cell)}`);
  }

  /** Rows, columns and side of cells, in metres. */
  get cells() {
    const { meta, bounds } = this.recording, cells = meta.cells;
    return cells && { rows: cells.rows, side: cells.side, cols: Math.round((bounds[2] - bounds[0]) / cells.side) };
  }

  /** The middle of a cell in metres; null of none. */
  middleOf(cell) {
    if (cell === undefined || !this.cells) return null;
    const { rows, cols, side } = this.cells;
    return { x: (cell % cols + 0.5) * side, y: (rows - Math.floor(cell / cols) - 0.5) * side };
  }

  placeOf(cell) {
    const { cols } = this.cells;
    return `row ${Math.floor(cell / cols)}, column ${cell % cols}`;
  }

  /** The cell at a place in metres, or null. */
  cellAt(x, y) {
    const { cells } = this;
    if (!cells) return null;
    const col = Math.floor(x / cells.side), row = cells.rows - 1 - Math.floor(y / cells.side);
    return col >= 0 && col < cells.cols && row >= 0 && row < cells.rows ? row * cells.cols + col : null;
  }

  /** A click at a place: `robot` is the index of who is there, or -1; `chosen` that of the chosen one. True if it
   * did something to the fleet. */
  clicked(robot, chosen, x, y) {
    const { ids } = this.recording, cell = this.cellAt(x, y);
    if (this.click === 'hold' || this.click === 'break') {
      if (robot >= 0) this[this.click](ids[robot]);
    } else if (this.click === 'close') {
      if (cell !== null) this.close(cell);
    } else if (this.click === 'send') {
      if (chosen >= 0 && cell !== null) this.send(ids[chosen], cell);
      else say('choose a robot first');
    } else return false;
    return true;
  }
}

/** Closed cells, and rings around robots that are held: dashed for a while, whole with a cross while they are broken. */
export function effectsLayer(pane) {
  return {
    name: 'interventions', plane: 'over',
    draw(pen, stage, now) {
      const { live, recording, recording: { fleet } } = pane, { held, closed } = live.effects(now), { cells } = live, { scale } = stage.camera;
      pen.save();
      pen.lineWidth = 2;
      pen.strokeStyle = theme.problem;
      for (const cell of closed.keys()) {
        const x = stage.toX(cell % cells.cols * cells.side), y = stage.toY((cells.rows - Math.floor(cell / cells.cols)) * cells.side), side = cells.side * scale;
        pen.fillStyle = theme.ground;
        pen.globalAlpha = 0.7;
        pen.fillRect(x, y, side, side);
        pen.globalAlpha = 1;
        pen.beginPath();
        pen.rect(x + 1, y + 1, side - 2, side - 2);
        for (let at = 1; at < 4; at++) {
          pen.moveTo(x, y + side * at / 4);
          pen.lineTo(x + side * at / 4, y);
          pen.moveTo(x + side * at / 4, y + side);
          pen.lineTo(x + side, y + side * at / 4);
        }
        pen.stroke();
      }
      for (const [agent, until_s] of held) {
        const i = recording.agent(agent);
        if (i < 0) continue;
        const x = stage.toX(fleet.X[i]), y = stage.toY(fleet.Y[i]), r = Math.max(fleet.reach(i) * scale + 4, 7), broken = until_s - now > BROKEN_S / 2;
        pen.setLineDash(broken ? [] : [4, 3]);
        pen.beginPath();
        pen.arc(x, y, r, 0, 2 * Math.PI);
        if (broken) {
          const d = r * Math.SQRT1_2;
          pen.moveTo(x - d, y - d);
          pen.lineTo(x + d, y + d);
          pen.moveTo(x - d, y + d);
          pen.lineTo(x + d, y - d);
        }
        pen.stroke();
      }
      pen.restore();
    },
  };
}

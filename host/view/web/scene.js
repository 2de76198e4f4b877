// A recording on a stage: ground, bodies, and the layers around them, at the time of a clock.

import { Bodies } from './bodies.js';
import { Emitter } from './emitter.js';
import { heatMap } from './heat.js';
import { allWays, fieldOf, mapLayers } from './map.js';
import { PARKED, STATES, WAITING } from './motion.js';
import { annotations, contacts, goals, numbers, rings, scaleBar, selectedWay, trails } from './overlays.js';
import { theme } from './theme.js';

/** What the colours of bodies can stand for. */
export const COLORINGS = ['agent', 'kind', 'state', 'delay', 'priority'];

/** Seconds of waiting that have the darkest colour, at least. */
const LONG_WAIT_S = 10;

/** Emits `selected` after another agent is selected, or followed or not, and `placed` before each picture. */
export class Scene extends Emitter {
  /** The agent that was clicked, by its index; -1 is none. */
  selected = -1;
  following = false;
  /** The agent under the mouse; -1 is none. */
  over = -1;
  /** The contact that was pointed at. */
  pointed = null;
  /** Contacts now. */
  touching = [];
  /** True if only annotations of the selected agent are shown. */
  ownOnly = false;
  /** False while the bodies' places at this time have not arrived. */
  known = false;
  coloring = 'agent';
  #seen = null;
  #ends = [];
  #clock = null;

  /** `motion` is of Tracks or Clips, or anything with their face (motion.js). */
  constructor(stage, recording, motion, clock, { renderer } = {}) {
    super();
    const { fleet, meta } = recording;
    Object.assign(this, { stage, recording, motion, fleet });
    stage.detail = fleet.largest;
    this.ground = mapLayers(meta);
    if (motion.way) {
      const field = fieldOf(meta, fleet.largest);
      // Above the cells of the map, below walls that are polygons.
      this.ground.splice(-1, 0, ...['usage', 'waiting'].map((name) => heatMap(name, motion, recording, field)));
      this.ground.push(allWays(motion, fleet, meta.colors));
    }
    this.layers = [...this.ground, ...[trails, goals, annotations, selectedWay, contacts, rings, numbers, scaleBar].map((layer) => layer(this))];
    for (const layer of this.layers) stage.add(layer);
    this.bodies = new Bodies(stage, fleet, { palette: () => this.#palette(), renderer });
    this.color('agent');
    this.clock = clock;
    this.#ends.push(
      stage.on('frame', () => this.#place()),
      stage.on('pick', (px, py) => {
        const found = this.bodies.at(px, py);
        if (found >= 0) this.select(found, true);
      }),
      stage.on('hover', (px, py) => {
        if ((px === undefined ? -1 : this.bodies.at(px, py)) !== this.over) stage.invalidate();
      }),
      stage.on('loose', () => this.select(this.selected, false)),
    );
    stage.fit(recording.bounds);
  }

  /** The clock that is followed; scenes that share one are compared. */
  get clock() { return this.#clock; }
  set clock(clock) {
    this.#ends.shift()?.();
    this.#clock = clock;
    const forget = () => { this.pointed = null; };
    const ends = [
      clock.on('time', () => this.stage.invalidate()),
      clock.on('seek', forget),
      clock.on('play', () => clock.playing && forget()),
    ];
    this.#ends.unshift(() => ends.forEach((end) => end()));
    this.stage.invalidate();
  }

  /** Takes everything off the stage. */
  end() {
    for (const end of this.#ends) end();
    this.bodies.end();
    this.stage.remove(...this.layers);
    if (this.following) this.stage.lead = null;
  }

  /** The layer of a name. */
  layer(name) {
    return this.layers.find((layer) => layer.name === name);
  }

  /** Shows or hides layers; `numbers` are those of all agents. */
  show(name, on) {
    const layer = this.layer(name);
    if (!layer) return;
    if (name === 'numbers') layer.all = on; else layer.visible = on;
    this.stage.invalidate(layer.plane);
  }

  /** Shows one heat map, `usage` or `waiting`, or none. */
  heat(name) {
    for (const each of ['usage', 'waiting']) this.show(each, each === name);
  }

  /** Seconds of the recording that are shown. */
  get now() {
    return Math.min(this.#clock.now, this.motion.end_s);
  }

  #place() {
    const { stage, fleet, motion, now } = this;
    this.known = motion.place(now, fleet.X, fleet.Y, fleet.H);
    motion.keep?.(now, this.#clock.speed);
    fleet.moved();
    stage.now = now;
    this.#seen = null;
    if (this.coloring === 'state' || this.coloring === 'delay') this.#colorByMotion();
    this.touching = this.recording.touching(now, this.#clock.linger);
    this.over = stage.hover ? this.bodies.at(...stage.hover) : -1;
    stage.scene.classList.toggle('pointing', this.over >= 0);
    this.emit('placed');
  }

  /** Agents that can be seen, ascending. */
  get seen() {
    return this.#seen ??= this.fleet.seen(this.stage);
  }

  /** Lets colours stand for something of COLORINGS. `delay` is the time that an agent has waited so far, `priority` what a
   * planner says of it; where nobody knows it, colours tell agents apart. */
  color(wanted) {
    const { colors } = this.bodies, { meta, priorities } = this.recording, { fleet } = this;
    const by = (wanted === 'delay' && !this.motion.waited) || (wanted === 'priority' && !priorities) ? 'agent' : wanted;
    this.coloring = by;
    if (by === 'agent') for (let i = 0; i < fleet.agents; i++) colors[i] = i % meta.colors.length;
    if (by === 'kind') for (let i = 0; i < fleet.agents; i++) colors[i] = fleet.kinds[i] % meta.colors.length;
    if (by === 'priority') {
      // The first ones are the darkest.
      const { of, last } = priorities, steps = meta.heat.length - 1;
      for (let i = 0; i < fleet.agents; i++) colors[i] = Math.round((1 - (of.get(this.recording.ids[i]) ?? last) / Math.max(last, 1)) * steps);
    }
    this.stage.invalidate();
  }

  #palette() {
    if (this.coloring === 'state') return STATES.map((state) => theme[state]);
    return this.coloring === 'delay' || this.coloring === 'priority' ? this.recording.meta.heat : this.recording.meta.colors;
  }

  #colorByMotion() {
    const { motion, fleet, now, bodies: { colors } } = this, { arrivals, heat } = this.recording.meta;
    if (this.coloring === 'state') {
      motion.states(fleet, colors);
      for (let i = 0; i < fleet.agents; i++) if (colors[i] === WAITING && (arrivals[i] ?? Infinity) <= now) colors[i] = PARKED;
      return;
    }
    const waited = motion.waited(fleet, arrivals);
    for (let i = 0; i < fleet.agents; i++) colors[i] = Math.min(Math.floor(waited[i] / this.longWait * heat.length), heat.length - 1);
  }

  /** The seconds of waiting that have the darkest colour. */
  get longWait() {
    return Math.max(LONG_WAIT_S, this.motion.longestWait);
  }

  /** True if an annotation is about now, and about the selected agent if only its own are wanted. */
  holds({ from, to, agent }) {
    const own = !this.ownOnly || this.selected < 0 || agent === this.recording.ids[this.selected];
    return own && this.now >= from - 1e-9 && this.now <= Math.max(to, from + this.#clock.linger) + 1e-9;
  }

  /** Selects an agent (by its index; -1 is none), and follows it or not. */
  select(i, follow) {
    const other = i !== this.selected;
    this.selected = i;
    this.following = follow && i >= 0;
    this.stage.lead = this.following ? () => [this.fleet.X[i], this.fleet.Y[i]] : null;
    this.stage.invalidate();
    this.emit('selected', other);
  }

  /** Shows a contact: its moment, its place, its two. */
  point(contact) {
    const { stage, fleet, recording } = this;
    this.#clock.play(false);
    this.#clock.seek(contact.from);
    this.pointed = contact;
    const ends = recording.both(contact);
    if (this.following) this.select(this.selected, false);
    this.motion.place(this.now, fleet.X, fleet.Y, fleet.H);
    if (ends.length) {
      stage.look({
        x: ends.reduce((sum, i) => sum + fleet.X[i], 0) / ends.length,
        y: ends.reduce((sum, i) => sum + fleet.Y[i], 0) / ends.length,
        // Near enough to see who touches whom.
        scale: Math.max(stage.camera.scale, 8 / fleet.largest),
      });
    }
    stage.invalidate();
  }
}

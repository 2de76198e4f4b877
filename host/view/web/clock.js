// The time that a page shows. Stages whose recordings are compared share one clock.

import { CLOCKS, everyFrame, wake } from './frames.js';
import { Emitter } from './emitter.js';

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];

/** A tab that was hidden does not jump by more. */
const MOST_S = 0.25;

/** Simulated seconds from 0 to `end`. Emits `time`, `play` and `speed` after each change,
 * and `seek` where time jumps. */
export class Clock extends Emitter {
  now = 0;
  speed = 1;
  playing = false;
  /** True while more is to come: time waits at the end, which moves. */
  open = false;
  /** True while what is wanted has not arrived; then time stands. Asked in each frame. */
  held = () => false;
  #last_ms = null;

  constructor(end = 0) {
    super();
    this.end = end;
    everyFrame(CLOCKS, (time_ms) => this.#tick(time_ms));
  }

  #tick(time_ms) {
    if (!this.playing) return false;
    const passed = this.#last_ms === null ? 0 : Math.min((time_ms - this.#last_ms) / 1000, MOST_S);
    this.#last_ms = time_ms;
    if (!this.held()) {
      this.now = Math.min(this.now + passed * this.speed, this.end);
      this.emit('time');
      if (this.now >= this.end && !this.open) this.play(false);
    }
    return this.playing;
  }

  /** Plays, from the start again at the end, or pauses. */
  play(on = !this.playing) {
    if (on && this.now >= this.end && !this.open) this.now = 0;
    this.playing = on;
    this.#last_ms = null;
    wake();
    this.emit('play');
    this.emit('time');
  }

  /** Goes to a time. */
  seek(time_s) {
    this.now = Math.min(Math.max(Number.isFinite(time_s) ? time_s : 0, 0), this.end);
    this.emit('seek');
    this.emit('time');
  }

  setSpeed(speed) {
    this.speed = speed;
    this.emit('speed');
  }

  /** The next speed up or down the list. */
  otherSpeed(step) {
    const at = Math.min(Math.max(SPEEDS.indexOf(this.speed) + step, 0), SPEEDS.length - 1);
    this.setSpeed(SPEEDS[at]);
  }

  /** Seconds for which short things linger so that they can be seen. */
  get linger() {
    return this.playing ? 0.4 * this.speed : 0;
  }
}

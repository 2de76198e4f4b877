// Where bodies are at a time. `Tracks` has all of a recording, as a page that is one file does;
// `Clips` has windows of it that arrive while one watches. Both have one face:
//
//   bodies, end_s          their number; seconds at which the recording ends
//   place(time, X, Y, H)   sets metres and radians of all; false where they are not known yet
//   trail(i, since, visit) calls visit(x, y) with places of body i from the time placed last back to `since`
//   states(fleet, out)     sets MOVING, TURNING or WAITING of each body at the time placed last

import { bytesOf } from './base64.js';

export const MOVING = 0;
export const TURNING = 1;
export const WAITING = 2;
export const PARKED = 3;
export const STATES = ['moving', 'turning', 'waiting', 'parked'];

/** The state of a body of a reach that goes so far, and turns so much, in a span of time: slower than a
 * fiftieth of its reach per second, or 0.6° per second, is at rest. */
const stateOf = (way_m, turn_rad, span_s, reach_m) =>
  way_m > 0.02 * reach_m * span_s ? MOVING : turn_rad > 0.01 * span_s ? TURNING : WAITING;

/** Knots of all bodies, between which they move uniformly (see track.rs for the encoding). */
export class Tracks {
  /** `text` is base64; the rest is said by the page's meta. */
  constructor(text, { ids, knots, sample_s, duration_s, length_m, angle_rad, headings }) {
    this.bodies = ids.length;
    this.end_s = duration_s;
    this.length_m = length_m;
    this.angle_rad = angle_rad;
    this.sample_s = sample_s;
    /** The last sample may come sooner than the others. */
    this.lastSample = sample_s > 0 ? duration_s / sample_s : 0;
    /** Body i has the knots first[i] to first[i + 1]. */
    this.first = new Uint32Array(this.bodies + 1);
    this.sample = new Uint32Array(knots);
    this.x = new Int32Array(knots);
    this.y = new Int32Array(knots);
    /** Headings that mean nothing are not kept. */
    this.h = headings ? new Int32Array(knots) : null;
    this.#decode(bytesOf(text));
    /** The knot of each body that is not after the time placed last. */
    this.cursor = this.first.slice(0, this.bodies);
    this.placed_s = 0;
  }

  #decode(bytes) {
    let at = 0, knot = 0;
    const number = () => {
      let byte = bytes[at++], value = byte & 127;
      for (let unit = 128; byte > 127; unit *= 128) {
        byte = bytes[at++];
        value += (byte & 127) * unit;
      }
      return value;
    };
    const last = [0, 0, 0];
    for (let i = 0; i < this.bodies; i++) {
      let sample = 0;
      last.fill(0);
      for (let left = number(); left > 0; left--, knot++) {
        const head = number();
        sample += Math.floor(head / 8);
        for (let axis = 0; axis < 3; axis++) {
          if (head >> axis & 1) {
            const code = number();
            last[axis] += code % 2 ? -(code + 1) / 2 : code / 2;
          }
        }
        this.sample[knot] = sample;
        this.x[knot] = last[0];
        this.y[knot] = last[1];
        if (this.h) this.h[knot] = last[2];
      }
      this.first[i + 1] = knot;
    }
  }

  /** The time of a knot in seconds. */
  time(k) {
    return Math.min(this.sample[k], this.lastSample) * this.sample_s;
  }

  place(time_s, X, Y, H) {
    const { first, sample, x, y, h, cursor, lastSample, length_m, angle_rad } = this;
    const now = this.sample_s > 0 ? time_s / this.sample_s : 0;
    this.placed_s = time_s;
    for (let i = 0; i < this.bodies; i++) {
      const to = first[i + 1];
      let k = cursor[i];
      if (sample[k] > now || (k + 1 < to && Math.min(sample[k + 1], lastSample) <= now)) {
        cursor[i] = k = this.#knotAt(i, now, k);
      }
      const next = k + 1 < to ? k + 1 : k;
      const since = sample[k], until = Math.min(sample[next], lastSample);
      const part = next > k && now > since ? (now - since) / (until - since) : 0;
      X[i] = (x[k] + part * (x[next] - x[k])) * length_m;
      Y[i] = (y[k] + part * (y[next] - y[k])) * length_m;
      if (h) H[i] = (h[k] + part * (h[next] - h[k])) * angle_rad;
    }
    return true;
  }

  /** The last knot of a body that is not after a time, in samples; looks near `guess` first. */
  #knotAt(i, now, guess) {
    const { first, sample, lastSample } = this;
    const from = first[i], to = first[i + 1];
    let low = from, high = to;
    const isPast = (k) => Math.min(sample[k], lastSample) <= now;
    if (isPast(guess)) {
      for (let step = 0; step < 4; step++) {
        if (guess + 1 >= to || !isPast(guess + 1)) return guess;
        guess++;
      }
      low = guess;
    }
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (isPast(middle)) low = middle; else high = middle;
    }
    return low;
  }

  trail(i, since_s, visit) {
    const { first, x, y, cursor, length_m } = this;
    for (let k = cursor[i]; k >= first[i]; k--) {
      const at = this.time(k);
      if (at < since_s) {
        const part = k + 1 < first[i + 1] ? Math.min(1, (since_s - at) / (this.time(k + 1) - at)) : 0;
        const next = part > 0 ? k + 1 : k;
        visit((x[k] + part * (x[next] - x[k])) * length_m, (y[k] + part * (y[next] - y[k])) * length_m);
        return;
      }
      visit(x[k] * length_m, y[k] * length_m);
    }
  }

  /** Appends the whole way of a body to a path, in metres. */
  way(i, path) {
    const { first, x, y, length_m } = this;
    for (let k = first[i], lastX, lastY; k < first[i + 1]; k++) {
      if (x[k] === lastX && y[k] === lastY) continue;
      if (lastX === undefined) path.moveTo(x[k] * length_m, y[k] * length_m);
      else path.lineTo(x[k] * length_m, y[k] * length_m);
      lastX = x[k];
      lastY = y[k];
    }
  }

  /** The state of a body from a knot to the next one. */
  #state(k, reach_m) {
    const { x, y, h } = this, span = this.time(k + 1) - this.time(k);
    const way = Math.hypot(x[k + 1] - x[k], y[k + 1] - y[k]) * this.length_m;
    return stateOf(way, h ? Math.abs(h[k + 1] - h[k]) * this.angle_rad : 0, span, reach_m);
  }

  states(fleet, out) {
    for (let i = 0; i < this.bodies; i++) {
      const k = this.cursor[i];
      out[i] = k + 1 < this.first[i + 1] ? this.#state(k, fleet.reach(i)) : WAITING;
    }
  }

  /** Seconds that each body has waited until the time placed last; whoever has arrived waits for nothing. */
  waited(fleet, arrivals) {
    this.#waits ??= this.#sumWaits(fleet, arrivals);
    const { first, cursor, placed_s } = this, out = this.#waits.now;
    for (let i = 0; i < out.length; i++) {
      const k = cursor[i], until = Math.min(placed_s, arrivals[i] ?? Infinity), since = this.time(k);
      const rests = k + 1 >= first[i + 1] || this.#state(k, fleet.reach(i)) === WAITING;
      out[i] = this.#waits.before[k] + (rests ? Math.max(until - since, 0) : 0);
    }
    return out;
  }

  /** The longest that anybody has waited at the end. */
  get longestWait() {
    return this.#waits?.longest ?? 0;
  }

  #waits = null;

  /** Of each knot the seconds of waiting before it. */
  #sumWaits(fleet, arrivals) {
    const { first } = this, before = new Float32Array(this.sample.length);
    let longest = 0;
    for (let i = 0; i < fleet.agents; i++) {
      const arrived = arrivals[i] ?? Infinity;
      let sum = 0;
      for (let k = first[i]; k < first[i + 1]; k++) {
        before[k] = sum;
        const until = Math.min(k + 1 < first[i + 1] ? this.time(k + 1) : this.end_s, arrived);
        const rests = k + 1 >= first[i + 1] || this.#state(k, fleet.reach(i)) === WAITING;
        if (rests) sum += Math.max(until - this.time(k), 0);
      }
      longest = Math.max(longest, sum);
    }
    return { before, longest, now: new Float64Array(fleet.agents) };
  }

  /** Calls `visit(from, to, state)` for the stretches of a body's time, in order. Whoever has arrived
   * waits for nothing. */
  stretches(i, reach_m, arrived_s, visit) {
    const { first, end_s } = this, arrived = arrived_s ?? Infinity;
    let since = 0, state = -1;
    const tell = (from, until, what) => {
      if (what !== WAITING || until <= arrived) return visit(from, until, what);
      if (from < arrived) visit(from, arrived, WAITING);
      visit(Math.max(from, arrived), until, PARKED);
    };
    const put = (until, next) => {
      if (next !== state) {
        if (until > since && state >= 0) tell(since, until, state);
        if (until > since || state < 0) since = until;
        state = next;
      }
    };
    for (let k = first[i]; k + 1 < first[i + 1]; k++) put(this.time(k), this.#state(k, reach_m));
    const last = this.time(first[i + 1] - 1);
    if (last < end_s) put(last, WAITING);
    if (state >= 0 && end_s > since) tell(since, end_s, state);
  }

  /** Calls `visit(from, to, state, x0, y0, x1, y1)` from knot to knot of a body, in seconds and metres; the last one lasts
   * to the end. */
  spans(i, reach_m, visit) {
    const { first, x, y, length_m } = this, last = first[i + 1] - 1;
    for (let k = first[i]; k <= last; k++) {
      const next = Math.min(k + 1, last);
      const until = k < last ? this.time(next) : this.end_s, state = k < last ? this.#state(k, reach_m) : WAITING;
      visit(this.time(k), until, state, x[k] * length_m, y[k] * length_m, x[next] * length_m, y[next] * length_m);
    }
  }

  /** Length of the way of a body, in metres. */
  distance(i) {
    const { first, x, y } = this;
    let sum = 0;
    for (let k = first[i]; k + 1 < first[i + 1]; k++) sum += Math.hypot(x[k + 1] - x[k], y[k + 1] - y[k]);
    return sum * this.length_m;
  }

  /** Nearest approach of a body to the first `count` others: closed form between knots. */
  nearest(i, count) {
    let best = { d2: Infinity };
    const { first, x, y, end_s: end } = this;
    for (let j = 0; j < count; j++) {
      if (j === i) continue;
      let a = first[i], b = first[j], from = 0;
      while (from < end) {
        const lastA = a + 1 >= first[i + 1], lastB = b + 1 >= first[j + 1];
        const to = Math.min(lastA ? end : this.time(a + 1), lastB ? end : this.time(b + 1));
        const rate = (v, k, last) => last ? 0 : (v[k + 1] - v[k]) / (this.time(k + 1) - this.time(k));
        const vx = rate(x, b, lastB) - rate(x, a, lastA), vy = rate(y, b, lastB) - rate(y, a, lastA);
        const at = (v, k, last) => v[k] + rate(v, k, last) * (from - this.time(k));
        const dx = at(x, b, lastB) - at(x, a, lastA), dy = at(y, b, lastB) - at(y, a, lastA);
        const speed2 = vx * vx + vy * vy;
        const t = speed2 > 0 ? Math.min(Math.max(-(dx * vx + dy * vy) / speed2, 0), to - from) : 0;
        const d2 = (dx + vx * t) ** 2 + (dy + vy * t) ** 2;
        if (d2 < best.d2) best = { d2, other: j, time: from + t };
        from = to;
        if (!lastA && this.time(a + 1) <= from) a++;
        if (!lastB && this.time(b + 1) <= from) b++;
      }
    }
    best.m = Math.sqrt(best.d2) * this.length_m;
    return best;
  }
}

/** Poses of a window, if nobody says otherwise, and bytes of all windows that are kept. */
const WINDOW_POSES = 400_000;
const KEPT_BYTES = 96_000_000;
/** Windows that are loaded at once. */
const AT_ONCE = 2;

/** Clips (clip.js) that arrive in any order and overlap or not; those not used for the longest time are
 * forgotten. */
export class Clips {
  /** Decoded clips by their beginnings. */
  #kept = [];
  #bytes = 0;
  #uses = 0;
  #asked = new Set();
  #here = null;

  /** `load(from_s, to_s)` gives a promise of a decoded clip that has the samples from the last one not after `from_s`
   * to the first one not before `to_s`; without it, clips come by `add`. */
  constructor({ bodies, end_s, rate_hz = 10, window_s, most_bytes = KEPT_BYTES, load = null, arrived = () => {} }) {
    Object.assign(this, { bodies, end_s, most_bytes, load, arrived });
    /** Seconds of a window. */
    this.window_s = window_s ?? Math.min(Math.max(WINDOW_POSES / (Math.max(bodies, 1) * rate_hz), 1), 30);
    this.placed_s = 0;
  }

  /** Takes a clip, which may lie anywhere. */
  add(clip) {
    if (clip.bodies !== this.bodies) throw new RangeError(`a clip of ${clip.bodies} bodies, not of ${this.bodies}`);
    if (!clip.samples) return;
    const last_s = clip.first_s + (clip.samples - 1) * clip.sample_s;
    const bytes = clip.samples * clip.bodies * (clip.h ? 12 : 8);
    const own = { ...clip, last_s, bytes, used: ++this.#uses };
    // What the new one covers is in it too.
    this.#kept = this.#kept.filter((old) => {
      const stays = old.first_s < clip.first_s || old.last_s > last_s;
      if (!stays) this.#bytes -= old.bytes;
      return stays;
    });
    this.#kept.push(own);
    this.#kept.sort((a, b) => a.first_s - b.first_s);
    this.#bytes += bytes;
    while (this.#bytes > this.most_bytes && this.#kept.length > 1) {
      const oldest = this.#kept.reduce((a, b) => a.used < b.used ? a : b);
      this.#kept.splice(this.#kept.indexOf(oldest), 1);
      this.#bytes -= oldest.bytes;
    }
    this.#here = null;
  }

  /** Seconds from and to of each clip that is kept, in their order. */
  get kept() {
    return this.#kept.map(({ first_s, last_s }) => [first_s, last_s]);
  }

  #covers(clip, time_s) {
    if (time_s < clip.first_s - 1e-9) return false;
    // After the last sample of all nothing comes.
    return time_s <= clip.last_s + 1e-9 || clip.last_s > this.end_s - clip.sample_s - 1e-9;
  }

  #clipAt(time_s) {
    if (this.#here && this.#covers(this.#here, time_s)) return this.#here;
    return this.#kept.findLast((clip) => this.#covers(clip, time_s)) ?? null;
  }

  place(time_s, X, Y, H) {
    const clip = this.#clipAt(time_s);
    if (!clip) return false;
    this.#here = clip;
    this.placed_s = time_s;
    clip.used = ++this.#uses;
    const { bodies, samples, x, y, h, length_m, angle_rad } = clip;
    const at = Math.min(Math.max((time_s - clip.first_s) / clip.sample_s, 0), samples - 1);
    const sample = Math.min(Math.floor(at), Math.max(samples - 2, 0)), part = at - sample;
    const here = sample * bodies, next = part > 0 ? here + bodies : here;
    for (let i = 0; i < bodies; i++) {
      X[i] = (x[here + i] + part * (x[next + i] - x[here + i])) * length_m;
      Y[i] = (y[here + i] + part * (y[next + i] - y[here + i])) * length_m;
      if (h) H[i] = (h[here + i] + part * (h[next + i] - h[here + i])) * angle_rad;
    }
    return true;
  }

  /** The window to load next, as `{from_s, to_s}`: the first one from a time on that is missing, or null. */
  wanted(time_s, speed = 1) {
    const { window_s } = this, at = Math.min(Math.max(time_s, 0), this.end_s);
    const last = Math.floor(Math.min(at + Math.max(window_s, 2 * speed), this.end_s) / window_s);
    for (let number = Math.floor(at / window_s); number <= last; number++) {
      const from_s = number * window_s, to_s = Math.min(from_s + window_s, this.end_s);
      if (from_s > 0 && from_s >= this.end_s) break;
      if (!this.#asked.has(number) && !this.#isWhole(Math.max(from_s, number === Math.floor(at / window_s) ? at : 0), to_s)) return { from_s, to_s };
    }
    return null;
  }

  #isWhole(from_s, to_s) {
    for (let at = from_s; ;) {
      const clip = this.#kept.findLast((clip) => this.#covers(clip, at));
      if (!clip) return false;
      if (this.#covers(clip, to_s)) return true;
      // A clip that ends here does not go on from here.
      if (clip.last_s <= at + 1e-9) return false;
      at = clip.last_s;
    }
  }

  /** Loads what is wanted around a time. Errors are those of `load`, told to `failed`. */
  keep(time_s, speed = 1, failed = () => {}) {
    while (this.load && this.#asked.size < AT_ONCE) {
      const window = this.wanted(time_s, speed);
      if (!window) return;
      const number = Math.round(window.from_s / this.window_s);
      this.#asked.add(number);
      this.load(window.from_s, window.to_s)
        .then((clip) => {
          this.add(clip);
          if (!this.#isWhole(window.from_s, window.to_s)) throw new RangeError('a clip lacks what was asked for');
          this.#asked.delete(number);
          this.arrived();
        })
        .catch((error) => {
          // Asked again later, so that a server that is gone is not asked in every frame.
          setTimeout(() => this.#asked.delete(number), 1000);
          failed(error);
        });
    }
  }

  /** Seconds that each body has waited until the time placed last, as Tracks has it; null until somebody says it. */
  waited = null;
  longestWait = 0;

  /** Takes seconds that agents have waited: of all agents at the beginning, and after each of `moments` equal parts of the
   * recording. Whoever walks through all of it knows them. */
  knowWaits({ seconds, moments }) {
    const out = new Float64Array(this.bodies);
    let known = null;
    this.waited = (fleet, arrivals) => {
      const { agents } = fleet, until = (i, time_s) => {
        const at = Math.min(time_s, arrivals[i] ?? Infinity) / Math.max(this.end_s, 1e-9) * moments;
        const moment = Math.min(Math.floor(at), moments - 1), from = seconds[moment * agents + i];
        return from + (at - moment) * (seconds[(moment + 1) * agents + i] - from);
      };
      if (known !== arrivals) {
        known = arrivals;
        this.longestWait = 0;
        for (let i = 0; i < agents; i++) this.longestWait = Math.max(this.longestWait, until(i, this.end_s));
      }
      for (let i = 0; i < agents; i++) out[i] = until(i, this.placed_s);
      return out;
    };
  }

  trail(i, since_s, visit) {
    let clip = this.#here, time_s = this.placed_s;
    while (clip) {
      for (let sample = Math.min(Math.floor((time_s - clip.first_s) / clip.sample_s), clip.samples - 1); sample >= 0; sample--) {
        const k = sample * clip.bodies + i;
        visit(clip.x[k] * clip.length_m, clip.y[k] * clip.length_m);
        if (clip.first_s + sample * clip.sample_s < since_s) return;
      }
      time_s = clip.first_s;
      clip = this.#kept.findLast((other) => other.first_s < time_s - 1e-9 && other.last_s >= time_s - 1e-9);
    }
  }

  states(fleet, out) {
    const clip = this.#here;
    if (!clip || clip.samples < 2) return void out.fill(WAITING);
    const { bodies, x, y, h, length_m, angle_rad, sample_s } = clip;
    const sample = Math.min(Math.max(Math.floor((this.placed_s - clip.first_s) / sample_s), 0), clip.samples - 2);
    for (let i = 0, k = sample * bodies; i < bodies; i++, k++) {
      const way = Math.hypot(x[k + bodies] - x[k], y[k + bodies] - y[k]) * length_m;
      out[i] = stateOf(way, h ? Math.abs(h[k + bodies] - h[k]) * angle_rad : 0, sample_s, fleet.reach(i));
    }
  }
}

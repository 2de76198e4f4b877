// Bodies at one moment: their outlines and where they are. Agents come first, then trailers of cars, then
// obstacles that move.

/** x and y one after the other, as pairs. */
export function pairs(flat) {
  const out = [];
  for (let i = 0; i + 1 < flat.length; i += 2) out.push([flat[i], flat[i + 1]]);
  return out;
}

export class Fleet {
  /** Places in metres and radians. Whoever sets them calls `moved`. */
  X;
  Y;
  H;
  /** Raised whenever places change. */
  version = 0;
  #buckets = null;

  /** Outlines are `{r}` or `{v: [x, y, …]}`, convex; `kinds` has the outline of each body, and is empty where there is
   * one. Of the bodies the first `agents` are agents; `cars` has trailers with their cars, by index. */
  constructor({ outlines, kinds = [], agents, bodies = agents, headings = false, cars = [] }) {
    Object.assign(this, { outlines, agents, bodies, headings, cars });
    /** The agent that a body is, or is towed by; -1 of what is nobody's. */
    this.owners = Int32Array.from({ length: bodies }, (_, i) => i < agents ? i : -1);
    for (const [trailer, car] of cars) this.owners[trailer] = car;
    [this.X, this.Y, this.H] = [0, 1, 2].map(() => new Float64Array(bodies));
    /** The outline of each body. */
    this.kinds = kinds.length ? Uint16Array.from(kinds) : new Uint16Array(bodies);
    /** The farthest that an outline goes. */
    this.reaches = outlines.map((outline) => 'r' in outline ? outline.r : Math.max(...pairs(outline.v).map(([x, y]) => Math.hypot(x, y))));
    this.largest = Math.max(0, ...this.reaches);
  }

  /** Farthest point of a body from its position, in metres. */
  reach(i) {
    return this.reaches[this.kinds[i]] ?? 0;
  }

  /** Says that places have changed. */
  moved() {
    this.version++;
  }

  /** Agents by square cells of the plane, sorted once for all questions about the same places. */
  #sorted() {
    if (this.#buckets?.version === this.version) return this.#buckets;
    const { X, Y, agents } = this;
    let [left, bottom, right, top] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = 0; i < agents; i++) {
      left = Math.min(left, X[i]);
      right = Math.max(right, X[i]);
      bottom = Math.min(bottom, Y[i]);
      top = Math.max(top, Y[i]);
    }
    if (!agents) left = bottom = right = top = 0;
    // About two agents in each where they are spread evenly.
    const side = Math.max(Math.sqrt(2 * (right - left) * (top - bottom) / Math.max(agents, 1)), 2 * this.largest, (right - left + top - bottom) / 2000, 1e-9);
    const across = Math.floor((right - left) / side) + 1, up = Math.floor((top - bottom) / side) + 1;
    const first = new Uint32Array(across * up + 1), order = new Uint32Array(agents), cell = new Uint32Array(agents);
    for (let i = 0; i < agents; i++) {
      cell[i] = Math.floor((Y[i] - bottom) / side) * across + Math.floor((X[i] - left) / side);
      first[cell[i] + 1]++;
    }
    for (let at = 0; at < across * up; at++) first[at + 1] += first[at];
    const next = first.slice();
    for (let i = 0; i < agents; i++) order[next[cell[i]]++] = i;
    return this.#buckets = { version: this.version, left, bottom, side, across, up, first, order };
  }

  /** Calls `visit(i)` for agents in a rectangle, in metres, and for some around it. */
  within(x0, y0, x1, y1, visit) {
    const { left, bottom, side, across, up, first, order } = this.#sorted();
    const clamp = (value, most) => Math.min(Math.max(Math.floor(value / side), 0), most - 1);
    if (x1 < left || y1 < bottom || x0 > left + across * side || y0 > bottom + up * side) return;
    const from = clamp(x0 - left, across), to = clamp(x1 - left, across);
    for (let row = clamp(y0 - bottom, up); row <= clamp(y1 - bottom, up); row++) {
      for (let at = first[row * across + from]; at < first[row * across + to + 1]; at++) visit(order[at]);
    }
  }

  /** The agent nearest to a point that is no farther than its reach, or that of its trailer, or `slack` metres; -1 is none. */
  at(x, y, slack = 0) {
    const far = Math.max(this.largest, slack);
    let best = -1, least = Infinity;
    const look = (i) => {
      const d = Math.hypot(this.X[i] - x, this.Y[i] - y), owner = this.owners[i];
      if (d <= Math.max(this.reach(i), slack) && (d < least || d === least && owner < best)) {
        best = owner;
        least = d;
      }
    };
    this.within(x - far, y - far, x + far, y + far, look);
    for (const [trailer] of this.cars) look(trailer);
    return best;
  }

  /** An agent and its trailer, if it has one. */
  train(i) {
    return [i, ...this.cars.filter(([, car]) => car === i).map(([trailer]) => trailer)];
  }

  /** Agents that a stage shows, ascending. */
  seen(stage) {
    const slack = this.largest + 2 / stage.camera.scale, found = [];
    const [x0, x1, y0, y1] = [stage.fromX(0) - slack, stage.fromX(stage.width) + slack, stage.fromY(stage.height) - slack, stage.fromY(0) + slack];
    const { X, Y, agents } = this;
    for (let i = 0; i < agents; i++) if (X[i] > x0 && X[i] < x1 && Y[i] > y0 && Y[i] < y1) found.push(i);
    return found;
  }
}

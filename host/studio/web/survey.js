// A walk through a whole recording, window by window: where bodies were, where they stood, what each did when.
// What overlays and timelines are drawn of; stopped as soon as nobody wants it.

import { STATES, WAITING } from '/viewer/motion.js';

/** Columns of timelines, and rows at most. */
export const COLUMNS = 600;
export const ROWS = 400;
/** Cells of heat maps at most; places of a path at most. */
const CELLS = 250_000;
const PLACES = 400_000;
/** Moments at which it is known how long everybody has waited, and numbers of that at most. */
const MOMENTS = 600;
const WAITS = 4_000_000;

export { STATES };

/** `load(from_s, to_s)` gives a decoded clip. Calls `progress(share)` after each window. */
export async function survey(recording, load, window_s, { progress, signal }) {
  const { fleet, bounds: [left, bottom, right, top], meta, end_s } = recording;
  const own = meta.cells?.side ?? 0.5;
  const side = Math.max(own, Math.sqrt((right - left) * (top - bottom) / CELLS));
  const cols = Math.max(1, Math.ceil((right - left) / side - 1e-9)), rows = Math.max(1, Math.ceil((top - bottom) / side - 1e-9));
  const usage = new Float32Array(rows * cols), waiting = new Float32Array(rows * cols);
  const shown = Math.min(fleet.agents, ROWS), rowOf = (i) => Math.floor(i * shown / Math.max(fleet.agents, 1));
  const lanes = new Uint8Array(shown * COLUMNS).fill(255);
  const moments = Math.max(1, Math.min(MOMENTS, Math.floor(WAITS / Math.max(fleet.agents, 1)) - 1));
  const waited = new Float32Array((moments + 1) * fleet.agents), sums = new Float64Array(fleet.agents);
  const traced = Math.min(fleet.agents, 2000);
  const paths = Array.from({ length: traced }, () => []);
  let left_places = PLACES;
  const column = (time) => Math.min(COLUMNS - 1, Math.max(0, Math.floor(time / Math.max(end_s, 1e-9) * COLUMNS)));
  for (let from = 0; from < end_s || from === 0; from += window_s) {
    if (signal.aborted) return null;
    const clip = await load(from, Math.min(from + window_s, end_s));
    const { x, y, bodies, samples, length_m, sample_s, first_s, h, angle_rad } = clip;
    for (let s = 0; s < samples; s++) {
      const time = first_s + s * sample_s;
      if (time < from - 1e-9 || (time >= from + window_s && from + window_s < end_s)) continue;
      for (let i = 0; i < fleet.agents; i++) {
        const k = s * bodies + i, k2 = s + 1 < samples ? k + bodies : k, k1 = k2 === k && s > 0 ? k - bodies : k;
        const px = x[k] * length_m, py = y[k] * length_m;
        const way = Math.hypot(x[k2] - x[k1], y[k2] - y[k1]) * length_m, turn = h ? Math.abs(h[k2] - h[k1]) * angle_rad : 0;
        const state = way > 0.02 * fleet.reach(i) * sample_s ? 0 : turn > 0.01 * sample_s ? 1 : time >= (meta.arrivals[i] ?? Infinity) ? 3 : WAITING;
        const cell = Math.min(rows - 1, Math.max(0, Math.floor((top - py) / side))) * cols + Math.min(cols - 1, Math.max(0, Math.floor((px - left) / side)));
        if (state < 2) usage[cell] += sample_s;
        else if (state === WAITING) {
          waiting[cell] += sample_s;
          sums[i] += sample_s;
        }
        waited[Math.min(moments, Math.ceil((time + sample_s) / Math.max(end_s, 1e-9) * moments)) * fleet.agents + i] = sums[i];
        if (rowOf(i) !== rowOf(i - 1) || i === 0) lanes.fill(state, rowOf(i) * COLUMNS + column(time), rowOf(i) * COLUMNS + column(time + sample_s) + 1);
        if (i < traced) {
          const path = paths[i], last = path.length - 2;
          if (left_places > 0 && (last < 0 || Math.hypot(path[last] - px, path[last + 1] - py) > 0.25 * fleet.reach(i))) {
            path.push(px, py);
            left_places--;
          }
        }
      }
    }
    progress(Math.min(1, (from + window_s) / Math.max(end_s, 1e-9)));
    if (end_s === 0) break;
  }
  // Between two samples there may be several moments.
  for (let at = fleet.agents; at < waited.length; at++) waited[at] = Math.max(waited[at], waited[at - fleet.agents]);
  return { waited: { seconds: waited, moments }, rows, cols, side, usage, waiting, lanes, shown, paths, origin: [left, top - rows * side] };
}

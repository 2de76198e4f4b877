// Where time is spent: seconds for which agents were in each cell, or stood still there, over a whole
// recording. Needs tracks.

import { Cells } from './cells.js';
import { WAITING } from './motion.js';

/** Steps in which a way from knot to knot is followed, at most. */
const MOST_STEPS = 4096;

/** Seconds per cell, row by row from the top, of a field of `rows` × `cols` cells of `side` metres whose lower left corner is
 * the origin; of waiting alone if that is wanted. Whoever has arrived waits no more. */
export function secondsInCells(tracks, fleet, arrivals, { rows, cols, side }, waitingOnly) {
  const seconds = new Float32Array(rows * cols);
  const add = (x, y, time) => {
    const row = rows - 1 - Math.floor(y / side), col = Math.floor(x / side);
    if (row >= 0 && row < rows && col >= 0 && col < cols) seconds[row * cols + col] += time;
  };
  for (let i = 0; i < fleet.agents; i++) {
    const arrived = arrivals[i] ?? Infinity;
    tracks.spans(i, fleet.reach(i), (from, to, state, x0, y0, x1, y1) => {
      const until = Math.min(to, arrived);
      if (until <= from || waitingOnly && state !== WAITING) return;
      // Half a cell at a time.
      const steps = Math.min(Math.max(Math.ceil(2 * Math.hypot(x1 - x0, y1 - y0) / side), 1), MOST_STEPS);
      for (let step = 0; step < steps; step++) {
        const part = (step + 0.5) / steps;
        add(x0 + part * (x1 - x0), y0 + part * (y1 - y0), (until - from) / steps);
      }
    });
  }
  return seconds;
}

/** The layer of seconds per cell, `usage` or `waiting`, made when it is first drawn: steps are equal in the square root of
 * the time. `most_s` is the longest in any cell. */
export function heatMap(name, tracks, recording, field) {
  const { heat, arrivals } = recording.meta;
  const layer = new Cells({ ...field, name, colors: () => [null, ...heat], opacity: 0.85 });
  layer.visible = false;
  layer.most_s = 0;
  const { draw } = layer;
  let made = false;
  layer.draw = (pen, stage) => {
    if (!made) {
      const seconds = secondsInCells(tracks, recording.fleet, arrivals, field, name === 'waiting');
      layer.most_s = seconds.reduce((a, b) => Math.max(a, b), 0);
      layer.scale(seconds, heat.length, { shape: Math.sqrt });
      made = true;
    }
    draw.call(layer, pen, stage);
  };
  return layer;
}

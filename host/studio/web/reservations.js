// Places that robots take in the window of time from now on. Plans on grids and roadmaps reserve cells, vertices and
// edges, which the server reads from the plan; for others the recording says where robots will be.

import { AGENTS, theme, traceOutline } from './drawing.js';

/** Moments of a window, and places or outlines of a picture, where the recording is asked. */
const STEPS = 12;
const MOST = 20_000;
/** Seconds of an answer beyond the window. */
const AHEAD_S = 10;
/** Pixels of a cell from which on it has the number of its robot. */
const NUMBERED_PX = 22;

/** `load(from_s, to_s)` gives what the plan reserves; null where there is no plan on a grid or a roadmap. */
export function reservationsLayer(watch, pane, load) {
  const places = [0, 1, 2].map(() => new Float64Array(pane.recording.fleet.bodies));
  let answer = null, asked = null;

  /** The reservations of now and of the window, or null until they have arrived. */
  function held(now) {
    const to = now + watch.window_s, fits = (span) => span && span.from <= now && to <= span.to;
    if (!fits(answer) && !fits(asked)) {
      const span = asked = { from: now, to: to + AHEAD_S };
      load(span.from, span.to).then((found) => {
        answer = { ...span, ...found };
        pane.reserved = found;
        watch.tell('reservations');
      }).catch((error) => {
        // It is sampled from now on.
        load = null;
        watch.app.store.refuse(error);
      }).finally(() => {
        if (asked === span) asked = null;
        pane.stage.invalidate();
      });
    }
    return fits(answer) ? answer : null;
  }

  function drawPlan(pen, stage, now, { held, side_m }) {
    const { recording, scene } = pane, { scale } = stage.camera, { fleet } = recording, named = [];
    for (const [agent, from, to, x, y, x2, y2] of held) {
      const soon = Math.max(from - now, 0) / watch.window_s;
      if (to <= now || soon >= 1) continue;
      pen.fillStyle = pen.strokeStyle = AGENTS[agent % AGENTS.length];
      pen.globalAlpha = 0.62 - 0.5 * soon;
      const px = stage.toX(x), py = stage.toY(y), chosen = scene.selected >= 0 && recording.ids[scene.selected] === agent;
      if (x2 !== undefined) {
        pen.beginPath();
        pen.moveTo(px, py);
        pen.lineTo(stage.toX(x2), stage.toY(y2));
        pen.lineWidth = Math.max(0.5 * fleet.largest * scale, 3);
        pen.stroke();
        continue;
      }
      const half = side_m ? side_m * scale / 2 - 1 : Math.max(0.6 * fleet.largest * scale, 4);
      pen.fillRect(px - half, py - half, 2 * half, 2 * half);
      if (chosen) {
        pen.globalAlpha = 1;
        pen.strokeStyle = theme.ink;
        pen.lineWidth = 2;
        pen.strokeRect(px - half, py - half, 2 * half, 2 * half);
      }
      if (2 * half > NUMBERED_PX && soon > 0) named.push([agent, px, py]);
    }
    pen.globalAlpha = 1;
    pen.font = '600 11px system-ui, sans-serif';
    pen.textAlign = 'center';
    pen.textBaseline = 'middle';
    pen.lineWidth = 3;
    pen.strokeStyle = theme.halo;
    pen.fillStyle = theme.ink;
    for (const [agent, px, py] of named) {
      pen.strokeText(agent, px, py);
      pen.fillText(agent, px, py);
    }
  }

  function drawSampled(pen, stage, now) {
    const { fleet, meta } = pane.recording, { motion, scene } = pane, { scale } = stage.camera;
    const span = watch.window_s / STEPS, side = meta.cells?.side ?? null;
    let left = MOST;
    const taken = new Set();
    for (let step = 1; step <= STEPS && left > 0; step++) {
      if (!motion.place(now + step * span, ...places)) break;
      pen.globalAlpha = 0.62 - 0.5 * step / STEPS;
      for (const i of scene.seen) {
        if (left-- <= 0) break;
        pen.fillStyle = AGENTS[i % AGENTS.length];
        if (side) {
          const col = Math.floor(places[0][i] / side), row = Math.floor(places[1][i] / side), key = (row * 65536 + col) * 8 + i % AGENTS.length;
          if (taken.has(key)) continue;
          taken.add(key);
          pen.fillRect(stage.toX(col * side) + 1, stage.toY((row + 1) * side) + 1, side * scale - 2, side * scale - 2);
        } else {
          pen.beginPath();
          const outline = fleet.outlines[fleet.kinds[i]];
          const pairs = outline.v ? { v: Array.from({ length: outline.v.length / 2 }, (_, at) => [outline.v[2 * at], outline.v[2 * at + 1]]) } : outline;
          traceOutline(pen, stage, pairs, places[0][i], places[1][i], places[2][i]);
          pen.fill();
        }
      }
    }
    pen.globalAlpha = 1;
    // The overlay looked ahead; the picture is of now.
    motion.place(now, fleet.X, fleet.Y, fleet.H);
  }

  return {
    name: 'reservations', visible: false,
    draw(pen, stage) {
      const { now } = pane.scene;
      if (!load) return drawSampled(pen, stage, now);
      const found = held(now);
      if (found) drawPlan(pen, stage, now, found);
    },
  };
}

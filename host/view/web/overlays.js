// Layers above and below the bodies: trails, goals, annotations, contacts, rings, numbers, scale.
// Each draws a bounded number of things per picture; of more, every second or third is drawn.

import { theme } from './theme.js';

/** Seconds that a trail goes back. */
export const TRAIL_S = 10;

/** What one picture has of each, at most. */
const MOST_TRAILS = 3000;
const MOST_GOALS = 5000;
const MOST_NUMBERS = 1500;
const MOST_MARKS = 5000;
/** Points of the trails of a picture, all together. */
const MOST_POINTS = 60_000;

/** Every n-th of some agents, so that no more than `most` are left: always the same ones, however the camera moves. */
function thinned(agents, most) {
  const step = Math.ceil(agents.length / most);
  return step > 1 ? agents.filter((i) => i % step === 0).slice(0, most) : agents;
}

/** Draws once with a wide line and once with a narrow one, so that it shows on everything. */
function twice(pen, color, [wide, narrow], draw) {
  for (const [stroke, width] of [[theme.halo, wide], [color, narrow]]) {
    pen.beginPath();
    draw();
    pen.strokeStyle = stroke;
    pen.lineWidth = width;
    pen.stroke();
  }
}

/** Where agents have been in the last seconds. */
export const trails = (scene) => ({
  name: 'trails',
  draw(pen, stage, now) {
    const { fleet, motion } = scene, { X, Y } = fleet;
    pen.lineWidth = Math.max(1, 0.5 * fleet.largest * stage.camera.scale);
    pen.globalAlpha = 0.35;
    let left = MOST_POINTS;
    const byColor = new Map();
    for (const i of thinned(scene.seen, MOST_TRAILS)) {
      const color = scene.bodies.colors[i];
      if (!byColor.has(color)) byColor.set(color, []);
      byColor.get(color).push(i);
    }
    const palette = scene.bodies.palette();
    for (const [color, own] of [...byColor].sort(([a], [b]) => a - b)) {
      pen.beginPath();
      for (const i of own) {
        if (left <= 0) break;
        pen.moveTo(stage.toX(X[i]), stage.toY(Y[i]));
        motion.trail(i, now - TRAIL_S, (x, y) => {
          if (left-- > 0) pen.lineTo(stage.toX(x), stage.toY(y));
        });
      }
      pen.strokeStyle = palette[color];
      pen.stroke();
    }
    pen.globalAlpha = 1;
  },
});

/** Where agents want to go, as squares of their colours. */
export const goals = (scene) => ({
  name: 'goals',
  draw(pen, stage, now) {
    const { recording, fleet } = scene, { colors } = recording.meta;
    const half = Math.max(0.3 * fleet.largest * stage.camera.scale, 2.5);
    const step = Math.ceil(recording.count / MOST_GOALS);
    colors.forEach((stroke, color) => {
      pen.beginPath();
      for (let i = 0; i < recording.count; i += step) {
        if (i % colors.length !== color) continue;
        const place = recording.goalAt(i, now);
        if (place) pen.rect(stage.toX(place.x) - half, stage.toY(place.y) - half, 2 * half, 2 * half);
      }
      pen.strokeStyle = stroke;
      pen.lineWidth = Math.max(1.2, 0.4 * half);
      pen.stroke();
    });
  },
});

/** The colour of a shape, by its value if it has one. The lightest steps vanish on white. */
export function shade({ color, range }, value, heat) {
  if (value === undefined || !range) return color;
  const [least, most] = range, steps = heat.length - 3;
  const part = most > least ? (value / 2 - least / 2) / (most / 2 - least / 2) : 1;
  return heat[2 + Math.min(Math.floor(part * steps), steps)];
}

/** What the planner wants to show now. */
export const annotations = (scene) => ({
  name: 'annotations',
  draw(pen, stage) {
    let left = MOST_MARKS;
    for (const layer of scene.recording.layers) {
      if (!layer.shown) continue;
      for (const annotation of layer.annotations) {
        if (left <= 0) return;
        if (scene.holds(annotation)) left -= annotate(pen, stage, scene, layer, annotation);
      }
    }
  },
});

/** Draws an annotation and says how many shapes it has. */
function annotate(pen, stage, { recording, fleet }, layer, { shape, shapes, values }) {
  const { heat, cells } = recording.meta;
  // A cell, or what stands for it.
  const size = (cells?.side ?? 2 * fleet.largest) * stage.camera.scale;
  const half = Math.max(0.42 * size, 4), r = Math.max(0.2 * size, 3);
  pen.lineWidth = Math.max(1.6, 0.06 * size);
  shapes.forEach((points, number) => {
    pen.strokeStyle = pen.fillStyle = shade(layer, values[number], heat);
    pen.beginPath();
    if (shape !== 'points' && points.length > 1) {
      points.forEach(([x, y], at) => at ? pen.lineTo(stage.toX(x), stage.toY(y)) : pen.moveTo(stage.toX(x), stage.toY(y)));
      if (shape === 'rings') pen.closePath();
      pen.stroke();
      pen.globalAlpha = 0.15;
      if (shape === 'rings') pen.fill();
    } else if (points.length === 1 && (shape === 'lines' || shape === 'rings')) {
      pen.fillRect(stage.toX(points[0][0]) - 1.5, stage.toY(points[0][1]) - 1.5, 3, 3);
    }
    if (shape === 'points' || shape === 'places') {
      pen.beginPath();
      for (const [x, y] of points) {
        if (shape === 'places') {
          pen.rect(stage.toX(x) - half, stage.toY(y) - half, 2 * half, 2 * half);
        } else {
          pen.moveTo(stage.toX(x) + r, stage.toY(y));
          pen.arc(stage.toX(x), stage.toY(y), r, 0, 2 * Math.PI);
        }
      }
      pen.globalAlpha = 0.3;
      pen.fill();
      pen.globalAlpha = 1;
      pen.stroke();
    }
    pen.globalAlpha = 1;
  });
  return Math.max(shapes.length, 1);
}

/** The way of the selected agent from its start to its end, and where it wants to go. */
export const selectedWay = (scene) => {
  let made = { i: -1, path: null };
  return {
    name: 'selected-way',
    draw(pen, stage, now) {
      const { selected: i, motion, recording, fleet } = scene, { scale } = stage.camera;
      if (i < 0) return;
      if (motion.way) {
        if (made.i !== i) {
          made = { i, path: new Path2D() };
          motion.way(i, made.path);
        }
        stage.inMetres(pen, () => {
          for (const [color, wide] of [[theme.halo, 4.5], [theme.ink, 1.8]]) {
            pen.strokeStyle = color;
            pen.lineWidth = wide / scale;
            pen.stroke(made.path);
          }
        });
      }
      const place = recording.goalAt(i, now);
      if (!place) return;
      const [x, y] = [stage.toX(place.x), stage.toY(place.y)];
      const half = Math.max(0.4 * fleet.largest * scale, 4), { colors } = recording.meta;
      pen.beginPath();
      pen.setLineDash([5, 5]);
      pen.moveTo(stage.toX(fleet.X[i]), stage.toY(fleet.Y[i]));
      pen.lineTo(x, y);
      pen.strokeStyle = theme.ink;
      pen.lineWidth = 1.5;
      pen.stroke();
      pen.setLineDash([]);
      pen.fillStyle = colors[i % colors.length];
      pen.fillRect(x - half, y - half, 2 * half, 2 * half);
      pen.strokeRect(x - half, y - half, 2 * half, 2 * half);
    },
  };
};

/** A cross in a ring between two agents in contact, or on the one that touches an obstacle or an agent that is not shown. */
export const contacts = (scene) => ({
  name: 'contacts', plane: 'over',
  draw(pen, stage) {
    const { fleet: { X, Y, largest }, recording } = scene;
    for (const contact of scene.touching.slice(0, MOST_MARKS)) {
      const ends = recording.both(contact);
      if (!ends.length) continue;
      const x = stage.toX(ends.reduce((sum, i) => sum + X[i], 0) / ends.length);
      const y = stage.toY(ends.reduce((sum, i) => sum + Y[i], 0) / ends.length);
      const r = Math.max(0.6 * largest * stage.camera.scale, 9), arm = 0.45 * r;
      twice(pen, theme.contact, [5, 2.5], () => {
        pen.arc(x, y, r, 0, 2 * Math.PI);
        pen.moveTo(x - arm, y - arm);
        pen.lineTo(x + arm, y + arm);
        pen.moveTo(x - arm, y + arm);
        pen.lineTo(x + arm, y - arm);
      });
    }
  },
});

/** Rings around those of the contact that was pointed at, the selected agent, and the one under the mouse. */
export const rings = (scene) => ({
  name: 'rings', plane: 'over',
  draw(pen, stage) {
    const { fleet, selected, over, pointed, recording } = scene;
    const ring = (i, color) => twice(pen, color, [5, 2.5], () =>
      pen.arc(stage.toX(fleet.X[i]), stage.toY(fleet.Y[i]), Math.max(fleet.reach(i) * stage.camera.scale + 4, 9), 0, 2 * Math.PI));
    if (pointed) for (const i of recording.both(pointed)) ring(i, theme.contact);
    for (const own of [selected, over === selected ? -1 : over]) if (own >= 0) for (const i of fleet.train(own)) ring(i, theme.ink);
  },
});

/** Numbers of agents: of all where they are large enough and `all` is set, else of those that are looked at. */
export const numbers = (scene) => ({
  name: 'numbers', plane: 'over', all: false,
  draw(pen, stage) {
    const { fleet, selected, over, recording } = scene, { scale } = stage.camera;
    const inside = this.all && fleet.largest * scale > 7;
    const named = inside ? thinned(scene.seen, MOST_NUMBERS) : [selected, over].filter((i) => i >= 0);
    const size = inside ? Math.min(Math.max(0.8 * fleet.largest * scale, 9), 22) : 13;
    pen.font = `600 ${size}px system-ui, sans-serif`;
    pen.textAlign = 'center';
    pen.textBaseline = 'middle';
    pen.lineWidth = 3;
    pen.strokeStyle = theme.halo;
    pen.fillStyle = theme.ink;
    for (const i of named) {
      const x = stage.toX(fleet.X[i]), up = inside ? 0 : Math.max(fleet.reach(i) * scale, 5) + 13;
      const y = stage.toY(fleet.Y[i]) - up;
      pen.strokeText(recording.ids[i], x, y);
      pen.fillText(recording.ids[i], x, y);
    }
  },
});

/** The length of a metre, or of a round number of them. */
export const scaleBar = () => ({
  name: 'scale', plane: 'over',
  draw(pen, stage) {
    const { scale } = stage.camera;
    const most = 0.25 * stage.width / scale;
    const power = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].find((digit) => digit * power <= most) * power;
    const text = length >= 1000 ? `${length / 1000} km` : length >= 1 ? `${length} m` : `${+(length * 1000).toPrecision(1)} mm`;
    const x = 12.5, y = stage.height - 12.5, w = length * scale;
    pen.font = '12px system-ui, sans-serif';
    pen.textAlign = 'left';
    pen.textBaseline = 'alphabetic';
    const wide = Math.max(w, pen.measureText(text).width + 4);
    pen.globalAlpha = 0.85;
    pen.fillStyle = theme.card;
    pen.fillRect(x - 6, y - 20, wide + 12, 26);
    pen.globalAlpha = 1;
    pen.beginPath();
    pen.moveTo(x, y - 5);
    pen.lineTo(x, y);
    pen.lineTo(x + w, y);
    pen.lineTo(x + w, y - 5);
    pen.strokeStyle = theme.ink;
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.fillStyle = theme.ink;
    pen.fillText(text, x + 4, y - 5);
  },
});

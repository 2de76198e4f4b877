// Layers of the document on the stage: floor, what stands and moves on it, derived views, agents, what is
// selected. Each is `draw(pen, stage)` in pixels of the stage.

import { theme } from '/viewer/theme.js';

import { boundsOf, corners, kindsOf, outlineOf } from './geometry.js';
import { clamp } from './dom.js';

/** As in recordings and still pictures. */
export const AGENTS = ['#0072b2', '#e69f00', '#009e73', '#cc79a7', '#56b4e9'];
export const HEAT = ['#fff3b8', '#ffeb9c', '#fee084', '#fed16c', '#febe56', '#fda946', '#fd8d3c', '#fa6a32', '#ef4427', '#d91f20', '#b70726', '#800026'];

/** Colours of the page as it is now: those of the viewer, and the studio's own. */
export { theme };
export function readTheme() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['text', 'line', 'problem', 'mover']) theme[name] = style.getPropertyValue('--' + name).trim();
}

export function tracePolygon(pen, stage, points, close = true) {
  points.forEach(([x, y], at) => at ? pen.lineTo(stage.toX(x), stage.toY(y)) : pen.moveTo(stage.toX(x), stage.toY(y)));
  if (close) pen.closePath();
}

/** Adds the outline of a robot at a pose to the path. */
export function traceOutline(pen, stage, outline, x, y, heading = 0, grow = 0) {
  const scale = stage.camera.scale, px = stage.toX(x), py = stage.toY(y);
  if (outline.r !== undefined) {
    const r = Math.max(outline.r * scale, 1.5) + grow;
    pen.moveTo(px + r, py);
    pen.arc(px, py, r, 0, 2 * Math.PI);
    return;
  }
  const cos = Math.cos(heading), sin = Math.sin(heading);
  outline.v.forEach(([u, v], at) => {
    const far = 1 + grow / Math.max(Math.hypot(u, v) * scale, 1);
    const qx = px + (u * cos - v * sin) * scale * far, qy = py - (u * sin + v * cos) * scale * far;
    if (at) pen.lineTo(qx, qy); else pen.moveTo(qx, qy);
  });
  pen.closePath();
}

/** Cells as a picture of one pixel each, coloured by a palette of four bytes a value; made anew when cells change. */
export class CellPicture {
  constructor() { this.key = null; }

  draw(pen, stage, { rows, cols, side, values, colors, origin = [0, 0], smooth = false, key }) {
    if (this.key?.some((part, at) => part !== key[at]) ?? true) {
      this.key = key;
      this.canvas ??= document.createElement('canvas');
      Object.assign(this.canvas, { width: cols, height: rows });
      const c = this.canvas.getContext('2d'), image = c.createImageData(cols, rows), out = new Uint32Array(image.data.buffer);
      for (let i = 0; i < values.length; i++) out[i] = colors[values[i]];
      c.putImageData(image, 0, 0);
    }
    const scale = stage.camera.scale;
    pen.imageSmoothingEnabled = smooth;
    pen.drawImage(this.canvas, stage.toX(origin[0]), stage.toY(origin[1] + rows * side), cols * side * scale, rows * side * scale);
    pen.imageSmoothingEnabled = true;
  }
}

/** A colour as the pixel that a picture wants. */
const probe = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
export function pixel(color, alpha = 1) {
  probe.globalAlpha = 1;
  probe.clearRect(0, 0, 1, 1);
  probe.fillStyle = color;
  probe.fillRect(0, 0, 1, 1);
  const [r, g, b] = probe.getImageData(0, 0, 1, 1).data;
  return (Math.round(alpha * 255) << 24 | b << 16 | g << 8 | r) >>> 0;
}

const mapPicture = new CellPicture();

export function drawFloor(pen, stage, document) {
  const [left, bottom, right, top] = boundsOf(document.ground), scale = stage.camera.scale;
  const [x, y, w, h] = [stage.toX(left), stage.toY(top), (right - left) * scale, (top - bottom) * scale];
  pen.fillStyle = theme.ground;
  pen.fillRect(x, y, w, h);
  const { map } = document.ground;
  if (map) {
    mapPicture.draw(pen, stage, {
      rows: map.rows, cols: map.cols, side: map.cell_size_m, values: kindsOf(map), key: [map, theme.solid],
      colors: [theme.ground, theme.solid, theme.endpoint, theme.workstation].map((color) => pixel(color)),
    });
    if (map.cell_size_m * scale >= 7) drawLattice(pen, stage, [left, bottom, right, top], map.cell_size_m, 0.5);
  }
  pen.strokeStyle = theme.roadmap;
  pen.lineWidth = 1;
  pen.strokeRect(x, y, w, h);
}

/** Obstacles of a world, those that move, and what lies beyond its edge. */
export function drawSolids(pen, stage, { ground }) {
  const { world } = ground, [left, bottom, right, top] = boundsOf(ground), scale = stage.camera.scale;
  const [x, y, w, h] = [stage.toX(left), stage.toY(top), (right - left) * scale, (top - bottom) * scale];
  if (world) {
    pen.fillStyle = theme.solid;
    if (world.boundary_m) {
      pen.beginPath();
      pen.rect(x, y, w, h);
      tracePolygon(pen, stage, world.boundary_m);
      pen.fill('evenodd');
    }
    pen.save();
    pen.beginPath();
    pen.rect(x, y, w, h);
    pen.clip();
    for (const obstacle of world.obstacles ?? []) {
      // One path of all of them would be slower by far: it asks where they overlap.
      pen.beginPath();
      tracePolygon(pen, stage, corners(obstacle));
      pen.fill();
    }
    pen.restore();
    drawMovers(pen, stage, world.movers ?? []);
  }
}

function drawMovers(pen, stage, movers) {
  for (const { footprint, knots } of movers) {
    const outline = outlineOf(footprint);
    pen.strokeStyle = theme.mover;
    pen.fillStyle = theme.mover;
    pen.lineWidth = 1.5;
    pen.setLineDash([6, 4]);
    pen.beginPath();
    tracePolygon(pen, stage, knots.map(([, x, y]) => [x, y]), false);
    pen.stroke();
    pen.setLineDash([]);
    knots.forEach(([, x, y, heading = 0], at) => {
      pen.beginPath();
      traceOutline(pen, stage, outline, x, y, heading);
      pen.globalAlpha = at ? 0.25 : 0.75;
      pen.fill();
      pen.globalAlpha = 1;
      pen.stroke();
    });
  }
}

export function drawLattice(pen, stage, [left, bottom, right, top], side, alpha = 1) {
  // Of a fine lattice every second, fifth, tenth line and so on is drawn.
  const least = Math.max(1, 8 / (side * stage.camera.scale)), ten = 10 ** Math.floor(Math.log10(least));
  const step = side * [1, 2, 5, 10].map((digit) => digit * ten).find((many) => many >= least * (1 - 1e-9));
  const [x0, x1] = [Math.max(left, stage.fromX(0)), Math.min(right, stage.fromX(stage.width))];
  const [y0, y1] = [Math.max(bottom, stage.fromY(stage.height)), Math.min(top, stage.fromY(0))];
  pen.beginPath();
  for (let i = Math.ceil((x0 - left) / step); left + i * step <= x1; i++) {
    const x = Math.round(stage.toX(left + i * step)) + 0.5;
    pen.moveTo(x, stage.toY(y0));
    pen.lineTo(x, stage.toY(y1));
  }
  for (let i = Math.ceil((y0 - bottom) / step); bottom + i * step <= y1; i++) {
    const y = Math.round(stage.toY(bottom + i * step)) + 0.5;
    pen.moveTo(stage.toX(x0), y);
    pen.lineTo(stage.toX(x1), y);
  }
  pen.globalAlpha = alpha;
  pen.strokeStyle = theme.line;
  pen.lineWidth = 1;
  pen.stroke();
  pen.globalAlpha = 1;
}

const gridPicture = new CellPicture();
const gridValues = new WeakMap();

/** The grid view: blocked cells shaded, free ones framed. */
export function drawGrid(pen, stage, grid) {
  const { rows, cols, cell_m: side, corner_m: origin } = grid;
  if (!gridValues.has(grid)) gridValues.set(grid, kindsOf({ ...grid, endpoints: [], workstations: [] }));
  gridPicture.draw(pen, stage, {
    rows, cols, side, origin, values: gridValues.get(grid), key: [grid, theme.accent],
    colors: [0, pixel(theme.accent, 0.28), 0, 0],
  });
  const frame = [origin[0], origin[1], origin[0] + cols * side, origin[1] + rows * side];
  if (side * stage.camera.scale >= 5) drawLattice(pen, stage, frame, side);
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 1;
  pen.strokeRect(stage.toX(frame[0]), stage.toY(frame[3]), cols * side * stage.camera.scale, rows * side * stage.camera.scale);
}

export function drawRoadmap(pen, stage, { vertices, edges }) {
  const scale = stage.camera.scale;
  pen.beginPath();
  for (let i = 0; i + 1 < edges.length; i += 2) {
    const [a, b] = [2 * edges[i], 2 * edges[i + 1]];
    pen.moveTo(stage.toX(vertices[a]), stage.toY(vertices[a + 1]));
    pen.lineTo(stage.toX(vertices[b]), stage.toY(vertices[b + 1]));
  }
  pen.strokeStyle = theme.accent;
  pen.globalAlpha = clamp(2000 / (edges.length + 1), 0.18, 0.55);
  pen.lineWidth = 1;
  pen.stroke();
  pen.globalAlpha = 0.9;
  const r = clamp(0.05 * scale, 1.2, 3.5);
  pen.fillStyle = theme.accent;
  pen.beginPath();
  for (let i = 0; i + 1 < vertices.length; i += 2) pen.rect(stage.toX(vertices[i]) - r, stage.toY(vertices[i + 1]) - r, 2 * r, 2 * r);
  pen.fill();
  pen.globalAlpha = 1;
}

const clearancePicture = new CellPicture();
const clearanceValues = new WeakMap();

/** The distance to what stands, from near (dark) to far (light). */
export function drawClearance(pen, stage, field) {
  const { rows, cols, side_m: side, values_cm: values, origin_m: origin = [0, 0] } = field;
  if (!clearanceValues.has(field)) {
    let most = 1;
    for (const value of values) most = Math.max(most, value);
    clearanceValues.set(field, Uint8Array.from(values, (value) => value <= 0 ? 0 : 1 + Math.min(HEAT.length - 1, Math.floor((1 - value / most) * HEAT.length))));
  }
  clearancePicture.draw(pen, stage, {
    rows, cols, side, origin, smooth: true, values: clearanceValues.get(field), key: [field],
    colors: [0, ...HEAT.map((color) => pixel(color, 0.5))],
  });
}

/** Starts as footprints, goals as squares of the same colour, numbers where there is room. */
export function drawAgents(pen, stage, { agents, kinds, problems, chosen, faint = false }) {
  const scale = stage.camera.scale;
  const [l, r] = [stage.fromX(-40), stage.fromX(stage.width + 40)], [b, t] = [stage.fromY(stage.height + 40), stage.fromY(-40)];
  const seen = (place) => place[0] >= l && place[0] <= r && place[1] >= b && place[1] <= t;
  const shown = [], aimed = [];
  agents.forEach((agent, index) => {
    if (seen(agent.start)) shown.push(index);
    if (seen(agent.goal)) aimed.push(index);
  });
  pen.globalAlpha = faint ? 0.35 : 1;
  pen.lineJoin = 'round';
  // Lines from starts to goals help while there are few of them.
  if (agents.length <= 60 || chosen.size) {
    for (const index of agents.length <= 60 ? agents.keys() : chosen) {
      const { start, goal } = agents[index];
      pen.beginPath();
      pen.moveTo(stage.toX(start[0]), stage.toY(start[1]));
      pen.lineTo(stage.toX(goal[0]), stage.toY(goal[1]));
      pen.setLineDash([2, 5]);
      pen.lineWidth = chosen.has(index) ? 2 : 1.2;
      pen.strokeStyle = AGENTS[index % AGENTS.length];
      pen.globalAlpha = (chosen.has(index) ? 0.9 : 0.45) * (faint ? 0.35 : 1);
      pen.stroke();
    }
    pen.setLineDash([]);
    pen.globalAlpha = faint ? 0.35 : 1;
  }
  // Trailers of cars, in their colours: where they begin, and outlines of where they end.
  const tow = (index, part) => {
    const agent = agents[index], trailer = kinds.trailer(agent, agent[part]);
    if (!trailer) return false;
    pen.beginPath();
    pen.moveTo(stage.toX(agent[part][0]), stage.toY(agent[part][1]));
    pen.lineTo(stage.toX(trailer.at[0]), stage.toY(trailer.at[1]));
    pen.strokeStyle = AGENTS[index % AGENTS.length];
    pen.lineWidth = clamp(0.05 * scale, 1.2, 3);
    pen.stroke();
    pen.beginPath();
    traceOutline(pen, stage, trailer.outline, ...trailer.at, trailer.heading);
    return true;
  };
  for (const index of aimed) if (tow(index, 'goal')) pen.stroke();
  for (const index of shown) {
    if (!tow(index, 'start')) continue;
    pen.fillStyle = AGENTS[index % AGENTS.length];
    pen.fill();
    pen.strokeStyle = theme.ink;
    pen.lineWidth = 1.2;
    pen.stroke();
  }
  AGENTS.forEach((color, own) => {
    pen.beginPath();
    for (const index of aimed) {
      if (index % AGENTS.length !== own) continue;
      const [x, y] = agents[index].goal, half = Math.max(0.62 * kinds.of(agents[index]).reach * scale, 2.5);
      pen.rect(stage.toX(x) - half, stage.toY(y) - half, 2 * half, 2 * half);
    }
    pen.fillStyle = theme.halo;
    pen.globalAlpha *= 0.55;
    pen.fill();
    pen.globalAlpha = faint ? 0.35 : 1;
    pen.strokeStyle = color;
    pen.lineWidth = clamp(0.06 * scale, 1.4, 3);
    pen.stroke();
    pen.beginPath();
    for (const index of shown) {
      if (index % AGENTS.length !== own) continue;
      const [x, y, heading = 0] = agents[index].start;
      traceOutline(pen, stage, kinds.of(agents[index]), x, y, heading);
    }
    pen.fillStyle = color;
    pen.fill();
  });
  const big = shown.filter((index) => kinds.of(agents[index]).reach * scale > 7);
  pen.strokeStyle = theme.ink;
  pen.lineWidth = 1.2;
  pen.beginPath();
  for (const index of big) {
    const [x, y, heading = 0] = agents[index].start, outline = kinds.of(agents[index]);
    traceOutline(pen, stage, outline, x, y, heading);
    if (agents[index].start.length > 2) tick(pen, stage, [x, y], heading, outline.reach);
  }
  for (const index of aimed) {
    const goal = agents[index].goal;
    if (goal.length > 2) tick(pen, stage, goal, goal[2], kinds.of(agents[index]).reach);
  }
  pen.stroke();
  pen.textAlign = 'center';
  pen.textBaseline = 'middle';
  for (const [list, part, ink] of [[shown, 'start', '#ffffff'], [aimed, 'goal', theme.ink]]) {
    for (const index of list) {
      const size = clamp(0.85 * kinds.of(agents[index]).reach * scale, 0, 15);
      if (size < 8 && !(chosen.has(index) && chosen.size < 30)) continue;
      pen.font = `600 ${Math.max(size, 11)}px system-ui, sans-serif`;
      const [x, y] = [stage.toX(agents[index][part][0]), stage.toY(agents[index][part][1]) + (size < 8 ? -14 : 0)];
      pen.lineWidth = 3;
      pen.strokeStyle = ink === '#ffffff' && size >= 8 ? 'rgba(0, 0, 0, 0.55)' : theme.halo;
      pen.fillStyle = size < 8 ? theme.ink : ink;
      pen.strokeText(index, x, y);
      pen.fillText(index, x, y);
    }
  }
  for (const index of problems) {
    if (!agents[index]) continue;
    const [x, y] = agents[index].start, px = stage.toX(x), py = stage.toY(y) - Math.max(kinds.of(agents[index]).reach * scale, 4) - 9;
    pen.beginPath();
    pen.moveTo(px, py - 8);
    pen.lineTo(px + 8, py + 6);
    pen.lineTo(px - 8, py + 6);
    pen.closePath();
    pen.fillStyle = theme.problem;
    pen.strokeStyle = theme.halo;
    pen.lineWidth = 3;
    pen.stroke();
    pen.fill();
    pen.font = '700 10px system-ui, sans-serif';
    pen.fillStyle = '#ffffff';
    pen.fillText('!', px, py + 1);
  }
  pen.globalAlpha = 1;
}

function tick(pen, stage, [x, y], heading, reach) {
  const scale = stage.camera.scale, px = stage.toX(x), py = stage.toY(y);
  pen.moveTo(px, py);
  pen.lineTo(px + reach * scale * Math.cos(heading), py - reach * scale * Math.sin(heading));
}

/** Frames around what is selected, and the handles that change it. */
export function drawSelection(pen, stage, { store, kinds, selection, handles, tool }) {
  const { agents, world } = store;
  const frame = () => {
    for (const [color, wide] of [[theme.halo, 5], [theme.accent, 2.5]]) {
      pen.strokeStyle = color;
      pen.lineWidth = wide;
      pen.stroke();
    }
  };
  let left = 4000;
  for (const key of selection.keys) {
    if (!left--) break;
    const index = Number(key.slice(1));
    pen.beginPath();
    if (key[0] === 's' && agents[index]) {
      const [x, y, heading = 0] = agents[index].start;
      traceOutline(pen, stage, kinds.of(agents[index]), x, y, heading, 3);
    } else if (key[0] === 'g' && agents[index]) {
      const [x, y] = agents[index].goal, half = Math.max(0.62 * kinds.of(agents[index]).reach * stage.camera.scale, 2.5) + 4;
      pen.rect(stage.toX(x) - half, stage.toY(y) - half, 2 * half, 2 * half);
    } else if (key[0] === 'o' && world?.obstacles?.[index]) tracePolygon(pen, stage, corners(world.obstacles[index]));
    else if (key[0] === 'm' && world?.movers?.[index]) {
      const { footprint, knots } = world.movers[index];
      for (const [, x, y, heading = 0] of knots) traceOutline(pen, stage, outlineOf(footprint), x, y, heading, 3);
    }
    const agent = 'sg'.includes(key[0]) && agents[index], trailer = agent && kinds.trailer(agent, agent[key[0] === 's' ? 'start' : 'goal']);
    if (trailer) traceOutline(pen, stage, trailer.outline, ...trailer.at, trailer.heading, 3);
    frame();
  }
  for (const { at: [x, y], kind, from } of handles) {
    const px = stage.toX(x), py = stage.toY(y);
    if (from) {
      pen.beginPath();
      pen.moveTo(stage.toX(from[0]), stage.toY(from[1]));
      pen.lineTo(px, py);
      pen.strokeStyle = theme.accent;
      pen.lineWidth = 1.5;
      pen.stroke();
    }
    pen.beginPath();
    if (kind === 'corner') pen.rect(px - 5, py - 5, 10, 10);
    else if (kind === 'middle') pen.rect(px - 3, py - 3, 6, 6);
    else pen.arc(px, py, 6, 0, 2 * Math.PI);
    pen.fillStyle = kind === 'middle' ? theme.accent : theme.card;
    pen.strokeStyle = theme.accent;
    pen.lineWidth = 2;
    pen.fill();
    pen.stroke();
  }
  tool?.draw?.(pen, stage);
}

/** A length with its unit. */
export const metres = (value) => value >= 1000 ? `${+(value / 1000).toFixed(2)} km` : value >= 1 ? `${+value.toFixed(2)} m` : `${Math.round(value * 100)} cm`;

export function label(pen, text, x, y) {
  pen.font = '600 12px system-ui, sans-serif';
  pen.textAlign = 'center';
  pen.textBaseline = 'middle';
  const w = pen.measureText(text).width + 12;
  pen.fillStyle = theme.card;
  pen.globalAlpha = 0.92;
  pen.beginPath();
  pen.roundRect(x - w / 2, y - 11, w, 22, 6);
  pen.fill();
  pen.globalAlpha = 1;
  pen.strokeStyle = theme.line;
  pen.lineWidth = 1;
  pen.stroke();
  pen.fillStyle = theme.text;
  pen.fillText(text, x, y + 0.5);
}


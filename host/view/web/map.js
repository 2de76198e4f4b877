// The ground of a recording: world, map of cells, roadmap, and all ways.

import { Cells } from './cells.js';
import { pairs } from './fleet.js';
import { theme } from './theme.js';

function polygonPath(path, flat) {
  pairs(flat).forEach(([x, y], at) => at ? path.lineTo(x, y) : path.moveTo(x, y));
  path.closePath();
}

/** The layer of free ground in the bounds of a world. */
export const floor = ([left, bottom, right, top]) => ({
  name: 'floor', plane: 'ground',
  draw(pen) {
    pen.fillStyle = theme.ground;
    pen.fillRect(left, bottom, right - left, top - bottom);
    pen.strokeStyle = theme.roadmap;
    pen.strokeRect(left, bottom, right - left, top - bottom);
  },
});

/** The layer of obstacles that are polygons, and of what lies beyond the edge of a world that is no rectangle. */
export function solids({ bounds: [left, bottom, right, top], polygons, outline }) {
  const solid = new Path2D(), beyond = new Path2D();
  for (const polygon of polygons) polygonPath(solid, polygon);
  if (outline.length) {
    beyond.rect(left, bottom, right - left, top - bottom);
    polygonPath(beyond, outline);
  }
  return {
    name: 'solids', plane: 'ground',
    draw(pen) {
      pen.fillStyle = theme.solid;
      pen.fill(beyond, 'evenodd');
      pen.fill(solid);
    },
  };
}

/** The layer of edges: x and y of both ends of each, one after the other. */
export function edges(name, flat, color = () => theme.roadmap) {
  const path = new Path2D();
  for (let i = 0; i + 3 < flat.length; i += 4) {
    path.moveTo(flat[i], flat[i + 1]);
    path.lineTo(flat[i + 2], flat[i + 3]);
  }
  return {
    name, plane: 'ground',
    draw(pen) {
      pen.strokeStyle = color();
      pen.stroke(path);
    },
  };
}

/** The cells over a recording: those of its map, else such as robots fill; never more than a million. */
export function fieldOf({ bounds: [, , right, top], cells }, largest_m) {
  const least = Math.sqrt(Math.max(right, 0) * Math.max(top, 0) / 1e6);
  const side = Math.max(cells?.side ?? 2 * largest_m, cells ? 0 : least) || 1;
  return { rows: cells?.rows ?? Math.ceil(Math.max(top, 0) / side), cols: Math.ceil(Math.max(right, 0) / side - 1e-6), side };
}

/** The layer of a map's cells: what a page's meta says of walls, endpoints and workstations. */
export function cellMap({ cells, endpoints, workstations }) {
  const { rows, side } = cells, all = [endpoints, workstations, cells];
  let cols = 0;
  for (const some of all) for (let at = 0; at < (some?.rectangles.length ?? 0); at += 4) cols = Math.max(cols, some.rectangles[at + 1] + some.rectangles[at + 3]);
  const layer = new Cells({
    name: 'cells', rows, cols, side,
    colors: () => [null, theme.endpoint, theme.workstation, theme.solid],
  });
  all.forEach((some, at) => some && layer.fill(some.rectangles, at + 1));
  return layer;
}

/** The layers of the ground of a recording, from the bottom. */
export function mapLayers(meta) {
  return [
    floor(meta.bounds),
    ...meta.cells ? [cellMap(meta)] : [],
    edges('roadmap', meta.roadmap),
    solids(meta),
  ];
}

/** The most points of all ways together; of more, every second or third agent has one. */
const MOST_POINTS = 500_000;

/** The layer of all ways, one line per colour, made when first wanted. Needs tracks. */
export function allWays(tracks, fleet, colors) {
  let paths = null;
  const make = () => {
    const made = colors.map(() => new Path2D()), step = Math.max(1, Math.ceil(tracks.first[fleet.agents] / MOST_POINTS));
    for (let i = 0; i < fleet.agents; i += step) tracks.way(i, made[i % colors.length]);
    return made;
  };
  return {
    name: 'paths', plane: 'ground', visible: false,
    draw(pen, stage) {
      paths ??= make();
      pen.save();
      pen.lineJoin = pen.lineCap = 'round';
      pen.lineWidth = Math.max(0.2 * fleet.largest, 0.7 / stage.camera.scale);
      pen.globalAlpha = Math.min(0.6, Math.max(0.25, 60 / fleet.agents));
      paths.forEach((path, color) => {
        pen.strokeStyle = colors[color];
        pen.stroke(path);
      });
      pen.restore();
    },
  };
}

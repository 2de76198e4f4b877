// Shapes of a document in metres, and cells as runs.

export const turned = ([x, y], angle, [cx, cy] = [0, 0]) => {
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  return [cx + x * cos - y * sin, cy + x * sin + y * cos];
};

/** The corners of an obstacle of a world file. */
export function corners(obstacle) {
  if (obstacle.polygon) return obstacle.polygon;
  const { center, size: [w, h], angle_rad = 0 } = obstacle.rectangle;
  return [[-w / 2, -h / 2], [w / 2, -h / 2], [w / 2, h / 2], [-w / 2, h / 2]].map((corner) => turned(corner, angle_rad, center));
}

/** An obstacle moved. */
export function shifted(obstacle, dx, dy) {
  if (obstacle.polygon) return { polygon: obstacle.polygon.map(([x, y]) => [round(x + dx), round(y + dy)]) };
  const { center: [x, y], ...rest } = obstacle.rectangle;
  return { rectangle: { ...rest, center: [round(x + dx), round(y + dy)] } };
}

/** Places are written to a tenth of a millimetre: what a hand can draw. */
export const round = (value) => Math.round(value * 1e4) / 1e4 + 0;

export function within([x, y], points) {
  let inside = false;
  for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
    const [[xi, yi], [xj, yj]] = [points[i], points[j]];
    if (yi > y !== yj > y && x < (xj - xi) * (y - yi) / (yj - yi) + xi) inside = !inside;
  }
  return inside;
}

/** Left, bottom, right and top of points. */
export function box(points) {
  const out = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [x, y] of points) {
    out[0] = Math.min(out[0], x);
    out[1] = Math.min(out[1], y);
    out[2] = Math.max(out[2], x);
    out[3] = Math.max(out[3], y);
  }
  return out;
}

/** Left, bottom, right and top of the ground. */
export function boundsOf({ world, map }) {
  if (map) return [0, 0, map.cols * map.cell_size_m, map.rows * map.cell_size_m];
  return world.bounds_m ?? box(world.boundary_m);
}

/** The outline of a footprint around the place of its robot: a disc `{r}` or corners `{v}`. */
export function outlineOf(footprint) {
  if (footprint?.disc) return { r: footprint.disc.radius_m };
  if (footprint?.rectangle) {
    const { length_m: l, width_m: w } = footprint.rectangle;
    return { v: [[l / 2, w / 2], [-l / 2, w / 2], [-l / 2, -w / 2], [l / 2, -w / 2]] };
  }
  if (!footprint?.polygon) return { r: 0.25 };
  const points = footprint.polygon.vertices_m, [cx, cy] = middle(points);
  return { v: points.map(([x, y]) => [x - cx, y - cy]) };
}

export const reachOf = (outline) => outline.r ?? Math.max(...outline.v.map(([x, y]) => Math.hypot(x, y)));

/** The centre of the smallest circle around a few points, which is where a pose puts them. */
function middle(points) {
  const covers = ([x, y, r]) => points.every(([px, py]) => Math.hypot(px - x, py - y) <= r * (1 + 1e-9) + 1e-12);
  let best = [0, 0, Infinity];
  const offer = (circle) => { if (circle && circle[2] < best[2] && covers(circle)) best = circle; };
  for (let i = 0; i < points.length; i++) {
    for (let j = 0; j < i; j++) {
      const [[ax, ay], [bx, by]] = [points[i], points[j]];
      offer([(ax + bx) / 2, (ay + by) / 2, Math.hypot(ax - bx, ay - by) / 2]);
      for (let k = 0; k < j; k++) offer(around(points[i], points[j], points[k]));
    }
  }
  return best;
}

function around([ax, ay], [bx, by], [cx, cy]) {
  const d = 2 * (ax * (by - cy) + bx * (cy - ay) + cx * (ay - by));
  if (Math.abs(d) < 1e-12) return null;
  const [a, b, c] = [ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy];
  const x = (a * (by - cy) + b * (cy - ay) + c * (ay - by)) / d, y = (a * (cx - bx) + b * (ax - cx) + c * (bx - ax)) / d;
  return [x, y, Math.hypot(ax - x, ay - y)];
}

/** Cells by runs `[first, length, …]` as bytes: 1 in a run, else 0. */
export function cellsOf(runs, count) {
  const cells = new Uint8Array(count);
  for (let i = 0; i + 1 < runs.length; i += 2) cells.fill(1, runs[i], runs[i] + runs[i + 1]);
  return cells;
}

/** Runs of the cells that are not 0. */
export function runsOf(cells) {
  const runs = [];
  for (let i = 0; i < cells.length; i++) {
    if (!cells[i]) continue;
    const first = i;
    while (i < cells.length && cells[i]) i++;
    runs.push(first, i - first);
  }
  return runs;
}

/** Runs of numbers of cells, in any order. */
export function runsOfList(list) {
  const runs = [];
  for (const cell of [...new Set(list)].sort((a, b) => a - b)) {
    const last = runs.length - 2;
    if (last >= 0 && runs[last] + runs[last + 1] === cell) runs[last + 1]++;
    else runs.push(cell, 1);
  }
  return runs;
}

/** What each cell of a map is: 0 free, 1 blocked, 2 endpoint, 3 workstation. Kept for each map. */
const kept = new WeakMap();
export const KINDS = ['free', 'blocked', 'endpoint', 'workstation'];
export function kindsOf(map) {
  if (!kept.has(map)) {
    const kinds = new Uint8Array(map.rows * map.cols);
    [map.blocked, map.endpoints, map.workstations].forEach((runs, kind) => {
      for (let i = 0; i + 1 < (runs?.length ?? 0); i += 2) kinds.fill(kind + 1, runs[i], runs[i] + runs[i + 1]);
    });
    kept.set(map, kinds);
  }
  return kept.get(map);
}

/** The map of such kinds, with the sizes of another. */
export function mapOfKinds(map, kinds) {
  const of = (kind) => runsOf(kinds.map((value) => value === kind));
  const out = { ...map, blocked: of(1), endpoints: of(2), workstations: of(3) };
  kept.set(out, kinds);
  return out;
}

/** The cell at a place, or -1. */
export function cellAt({ rows, cols, cell_size_m: side }, [x, y]) {
  const row = rows - 1 - Math.floor(y / side), col = Math.floor(x / side);
  return row >= 0 && row < rows && col >= 0 && col < cols ? row * cols + col : -1;
}

/** The middle of a cell. */
export const middleOf = ({ rows, cols, cell_size_m: side }, cell) =>
  [(cell % cols + 0.5) * side, (rows - Math.floor(cell / cols) - 0.5) * side];

/** All cells of one kind that join a cell by their sides. */
export function flood(map, from) {
  const kinds = kindsOf(map), kind = kinds[from], seen = new Uint8Array(kinds.length), queue = [from];
  seen[from] = 1;
  for (let at = 0; at < queue.length; at++) {
    const cell = queue[at], col = cell % map.cols;
    const near = [cell - map.cols, cell + map.cols];
    if (col > 0) near.push(cell - 1);
    if (col + 1 < map.cols) near.push(cell + 1);
    for (const next of near) {
      if (next >= 0 && next < kinds.length && !seen[next] && kinds[next] === kind) {
        seen[next] = 1;
        queue.push(next);
      }
    }
  }
  return queue;
}

/** A length that divides well: 1, 2 or 5 times a power of ten, not above a value. */
export function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].find((digit) => digit * power <= value * (1 + 1e-9)) * power;
}

// What the pointer and the keys do on the stage, by tool.
//
// A tool is made of clicks: the first one begins, the next one ends, and a drag is a click where it begins and
// one where it ends. So keys can do the same: arrows move a cross, Enter clicks there.

import { h, field, select, number, say, tidy } from './dom.js';
import { batch } from './edits.js';
import { boundsOf, box, cellAt, corners, flood, kindsOf, middleOf, nice, outlineOf, reachOf, round, runsOfList, turned, KINDS } from './geometry.js';
import { AGENTS, label, metres, theme, traceOutline, tracePolygon } from './drawing.js';
import { headed } from './selection.js';

/** A press that goes farther than so many pixels is a drag. */
const DRAG_PX = 5;
/** How near to a handle a press means it, in pixels. */
const NEAR_PX = { mouse: 9, pen: 12, touch: 20 };

export class Tools {
  /** `app` has store, selection, kinds, stage and settings. */
  constructor(app) {
    this.app = app;
    this.listeners = [];
    this.cross = null;
    this.panning = false;
    this.boundsOpen = false;
    this.all = [selectTool(this), rectangleTool(this), polygonTool(this), brushTool(this), fillTool(this), moverTool(this), robotTool(this), placeTool(this), measureTool(this)];
    this.tool = this.all[0];
  }

  on(listener) { this.listeners.push(listener); }
  tell() {
    for (const listener of this.listeners) listener();
    this.app.stage.invalidate();
  }

  /** Tools that fit the ground. */
  get possible() { return this.all.filter((tool) => !tool.needs || tool.needs()); }

  choose(id) {
    const tool = this.possible.find((tool) => tool.id === id);
    if (!tool || tool === this.tool) return;
    this.tool.cancel?.();
    this.tool = tool;
    this.cross = null;
    say(`${tool.name}: ${tool.hint}`);
    this.tell();
  }

  /** A place on the lattice, where snapping is on. */
  snap([x, y], event) {
    const { snap, lattice } = this.app.settings;
    if (!snap || event?.altKey) return [round(x), round(y)];
    const [left, bottom] = boundsOf(this.app.store.document.ground);
    return [round(left + Math.round((x - left) / lattice) * lattice), round(bottom + Math.round((y - bottom) / lattice) * lattice)];
  }

  near(event) { return (NEAR_PX[event?.pointerType] ?? NEAR_PX.mouse) / this.app.stage.camera.scale; }

  /** What the stage asks at each press. */
  grab(x, y, event) {
    this.cross = null;
    if (this.panning || event.button > 0) return null;
    const own = this.tool.press?.([x, y], event);
    if (own !== undefined) return own;
    if (!this.tool.click) return null;
    const begun = [event.clientX, event.clientY], was = this.tool.begun;
    this.tool.click(this.snap([x, y], event), event);
    return {
      move: (mx, my, e) => this.hover([mx, my], e),
      up: (ux, uy, e) => {
        // A drag ends what its press began.
        if (this.tool.begun && !was && Math.hypot(e.clientX - begun[0], e.clientY - begun[1]) > DRAG_PX) this.tool.click(this.snap([ux, uy], e), e);
      },
      cancel: () => this.cancel(),
    };
  }

  hover(at, event) {
    this.at = at && (this.tool.click ? this.snap(at, event) : at);
    this.tool.hover?.(this.at, event);
    this.app.stage.invalidate();
  }

  cancel() {
    this.tool.cancel?.();
    this.app.store.try(null);
    this.cross = null;
    this.tell();
  }

  /** Leaves, one thing at a time: what is being drawn, the tool, the selection. */
  leave() {
    if (this.tool.begun) return this.cancel();
    if (this.tool !== this.all[0]) return this.choose('select');
    if (this.boundsOpen) {
      this.boundsOpen = false;
      return this.tell();
    }
    this.app.selection.set([]);
  }

  /** Keys on the stage; true if the key was for the tool. */
  key(event) {
    if (event.ctrlKey || event.metaKey) return false;
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    const { selection, store, settings, stage } = this.app;
    if (way) {
      const step = (store.map && this.tool !== this.all[0] ? store.map.cell_size_m : settings.lattice) * (event.shiftKey ? 10 : event.altKey ? 0.1 : 1);
      if (this.tool === this.all[0]) {
        if (!selection.size) return false;
        const op = selection.moved(way[0] * step, way[1] * step);
        if (op) store.edit(op);
        return true;
      }
      const [left, bottom, right, top] = boundsOf(store.document.ground);
      this.cross ??= this.at ? [...this.at] : this.snap([stage.camera.x, stage.camera.y]);
      this.cross = [Math.min(Math.max(this.cross[0] + way[0] * step, left), right), Math.min(Math.max(this.cross[1] + way[1] * step, bottom), top)].map(round);
      this.hover(this.cross);
      say(`${tidy(this.cross[0])}, ${tidy(this.cross[1])} metres`);
      return true;
    }
    if (event.key === 'Enter' && this.tool !== this.all[0]) {
      const at = this.cross ?? this.at;
      if (this.tool.enter?.(at)) return true;
      if (at && this.tool.click) this.tool.click(this.snap(at), event);
      return true;
    }
    return this.tool.key?.(event) ?? false;
  }

  draw(pen, stage) {
    this.tool.draw?.(pen, stage);
    if (!this.cross) return;
    const [x, y] = [stage.toX(this.cross[0]), stage.toY(this.cross[1])];
    for (const [color, wide] of [[theme.halo, 4], [theme.accent, 1.5]]) {
      pen.beginPath();
      pen.moveTo(x - 11, y);
      pen.lineTo(x + 11, y);
      pen.moveTo(x, y - 11);
      pen.lineTo(x, y + 11);
      pen.strokeStyle = color;
      pen.lineWidth = wide;
      pen.stroke();
    }
  }

  // ---- Handles of what is selected ------------------------------------------------------

  /** Points that change what is selected: `{at, kind, drag(point, event) -> op}`. */
  handles() {
    const { store, selection, kinds, stage } = this.app;
    if (this.tool !== this.all[0]) return [];
    if (this.boundsOpen && store.world) return boundsHandles(store.world);
    if (selection.keys.size > 2) return [];
    const out = [];
    if (selection.keys.size === 1 && selection.of('o').length === 1) {
      const index = selection.of('o')[0], obstacle = store.world?.obstacles[index];
      if (obstacle) out.push(...obstacleHandles(index, obstacle, 22 / stage.camera.scale));
    }
    for (const key of selection.keys) {
      if (key[0] !== 's' && key[0] !== 'g') continue;
      const index = Number(key.slice(1)), part = key[0] === 's' ? 'start' : 'goal', agent = store.agents[index];
      if (!agent || selection.agents.length > 1) continue;
      const [x, y, heading = 0] = agent[part], far = kinds.of(agent).reach + 20 / stage.camera.scale;
      out.push({
        at: [x + far * Math.cos(heading), y + far * Math.sin(heading)], from: [x, y], kind: 'heading',
        drag: ([px, py], event) => {
          const place = headed(agent[part], round(stepped(Math.atan2(py - y, px - x), event)));
          return { op: 'set-agents', indices: [index], agents: [{ ...agent, [part]: place }] };
        },
      });
      const trailer = kinds.trailer(agent, agent[part]);
      if (!trailer) continue;
      const [u, v] = trailer.at, long = reachOf(trailer.outline) + 20 / stage.camera.scale;
      out.push({
        at: [u - long * Math.cos(trailer.heading), v - long * Math.sin(trailer.heading)], from: trailer.at, kind: 'heading',
        drag: ([px, py], event) => {
          const behind = round(stepped(Math.atan2(y - py, x - px), event));
          return { op: 'set-agents', indices: [index], agents: [{ ...agent, [part]: [x, y, heading, behind] }] };
        },
      });
    }
    return out;
  }
}

/** An angle in steps of 15°, but with Alt. */
const stepped = (angle, event) => event?.altKey ? angle : Math.round(angle / (Math.PI / 12)) * (Math.PI / 12);

const isUpright = (points) => points.length === 4 && [0, 1, 2, 3].every((at) => {
  const [[ax, ay], [bx, by]] = [points[at], points[(at + 1) % 4]];
  return (Math.abs(ax - bx) < 1e-9) !== (Math.abs(ay - by) < 1e-9);
});

function obstacleHandles(index, obstacle, far) {
  const points = corners(obstacle), set = (polygon) => ({ op: 'set-obstacle', index, obstacle: { polygon } });
  const out = [], upright = isUpright(points);
  points.forEach((corner, at) => {
    const next = points[(at + 1) % points.length];
    const middle = [(corner[0] + next[0]) / 2, (corner[1] + next[1]) / 2];
    out.push({
      at: middle, kind: 'middle', drag: (to) => upright
        ? set(points.map((p, i) => i !== at && i !== (at + 1) % 4 ? p : Math.abs(corner[0] - next[0]) < 1e-9 ? [to[0], p[1]] : [p[0], to[1]]))
        : set([...points.slice(0, at + 1), to, ...points.slice(at + 1)]),
    });
    out.push({
      at: corner, kind: 'corner', drag: (to, event) => {
        if (!upright || event?.shiftKey) return set(points.map((p, i) => i === at ? to : p));
        return set(points.map(([x, y]) => [x === corner[0] ? to[0] : x, y === corner[1] ? to[1] : y]));
      },
      remove: points.length > 3 ? () => set(points.filter((_, i) => i !== at)) : null,
    });
  });
  const [left, , right, top] = box(points), middle = [(left + right) / 2, (box(points)[1] + top) / 2];
  out.push({
    at: [middle[0], top + far], from: [middle[0], top], kind: 'turn', drag: ([x, y], event) => {
      const turn = stepped(Math.atan2(y - middle[1], x - middle[0]) - Math.PI / 2, event);
      return set(points.map(([px, py]) => turned([px - middle[0], py - middle[1]], turn, middle).map(round)));
    },
  });
  return out;
}

function boundsHandles(world) {
  if (world.boundary_m) {
    return world.boundary_m.map((corner, at) => ({
      at: corner, kind: 'corner', drag: (to) => ({ op: 'set-boundary', boundary_m: world.boundary_m.map((p, i) => i === at ? to : p) }),
    }));
  }
  const b = world.bounds_m;
  return [[0, 1], [2, 1], [2, 3], [0, 3]].map(([i, j]) => ({
    at: [b[i], b[j]], kind: 'corner', drag: ([x, y]) => {
      const bounds_m = [...b];
      bounds_m[i] = x;
      bounds_m[j] = y;
      return { op: 'set-bounds', bounds_m };
    },
  }));
}

// ---- The tools -----------------------------------------------------------------------------

function selectTool(tools) {
  const { app } = tools;
  let band = null;
  return {
    id: 'select', name: 'Select', keys: ['V'], hint: 'click, drag to move; drag on the floor for a box; Space or the middle button pans',
    press([x, y], event) {
      const { selection } = app;
      if (!app.editing) return null;
      const near = tools.near(event);
      const handle = tools.handles().findLast(({ at }) => Math.hypot(at[0] - x, at[1] - y) <= near);
      if (handle) return dragHandle(handle, event);
      const found = app.hits.at([x, y], near);
      // A finger has no other way to pan.
      if (!found.length) return event.pointerType === 'touch' ? null : dragBox([x, y], event);
      const key = found.find((key) => selection.has(key)) ?? found[0];
      if (event.shiftKey) {
        selection.toggle(key);
        return {};
      }
      const fresh = !selection.has(key);
      if (fresh) selection.set([key]);
      return dragSelection([x, y], event, found, fresh);
    },
    cancel() { band = null; },
    draw(pen, stage) {
      if (!band) return;
      const [a, b] = band;
      pen.beginPath();
      pen.rect(stage.toX(a[0]), stage.toY(a[1]), (b[0] - a[0]) * stage.camera.scale, (a[1] - b[1]) * stage.camera.scale);
      pen.fillStyle = theme.accent;
      pen.globalAlpha = 0.12;
      pen.fill();
      pen.globalAlpha = 1;
      pen.strokeStyle = theme.accent;
      pen.lineWidth = 1.5;
      pen.setLineDash([5, 4]);
      pen.stroke();
      pen.setLineDash([]);
    },
  };

  function dragHandle(handle, press) {
    let op = null;
    if (press.altKey && handle.remove) {
      app.store.edit(handle.remove());
      return {};
    }
    return {
      move: (x, y, event) => {
        op = handle.drag(handle.kind === 'heading' || handle.kind === 'turn' ? [x, y] : tools.snap([x, y], event), event);
        app.store.try(op);
      },
      up: () => { if (op) app.store.edit(op); },
      cancel: () => app.store.try(null),
    };
  }

  function dragSelection([x, y], press, found, fresh) {
    const anchor = app.selection.box(), begun = [press.clientX, press.clientY];
    let op = null, moved = false;
    return {
      move: (mx, my, event) => {
        moved ||= Math.hypot(event.clientX - begun[0], event.clientY - begun[1]) > DRAG_PX;
        if (!moved) return;
        app.store.draft = null;
        app.store.recount('none');
        // The lower left corner, or the place of what is one, keeps to the lattice.
        const to = tools.snap([anchor[0] + mx - x, anchor[1] + my - y], event);
        op = app.selection.moved(to[0] - anchor[0], to[1] - anchor[1]);
        app.store.try(op);
      },
      up: () => {
        if (op) app.store.edit(op);
        else if (!moved && !fresh && app.selection.size === 1 && found.length > 1) {
          // Clicked again: what lies below.
          const at = found.findIndex((key) => app.selection.has(key));
          app.selection.set([found[(at + 1) % found.length]]);
        }
      },
      cancel: () => app.store.try(null),
    };
  }

  function dragBox(from, press) {
    const begun = [press.clientX, press.clientY];
    return {
      move: (x, y, event) => {
        if (!band && Math.hypot(event.clientX - begun[0], event.clientY - begun[1]) <= DRAG_PX) return;
        band = [from, [x, y]];
        app.stage.invalidate();
      },
      up: () => {
        const { store, selection } = app, keys = press.shiftKey ? [...selection.keys] : [];
        if (!band) return selection.set(keys);
        const [l, b, r, t] = box(band), inside = ([x, y]) => x >= l && x <= r && y >= b && y <= t;
        store.agents.forEach((agent, index) => {
          if (inside(agent.start)) keys.push(`s${index}`);
          if (inside(agent.goal)) keys.push(`g${index}`);
        });
        (store.world?.obstacles ?? []).forEach((obstacle, index) => { if (corners(obstacle).every(inside)) keys.push(`o${index}`); });
        (store.world?.movers ?? []).forEach((mover, index) => { if (mover.knots.every(([, x, y]) => inside([x, y]))) keys.push(`m${index}`); });
        band = null;
        selection.set(keys);
      },
      cancel: () => { band = null; },
    };
  }
}

/** A tool of two clicks. */
function twoClicks(tools, { commit, preview, ...rest }) {
  return {
    begun: null,
    click(at, event) {
      if (!this.begun) {
        this.begun = at;
        say(`from ${tidy(at[0])}, ${tidy(at[1])}`);
        return tools.tell();
      }
      const from = this.begun;
      this.begun = null;
      commit(from, at, event);
      tools.tell();
    },
    cancel() { this.begun = null; },
    draw(pen, stage) {
      if (tools.at || this.begun) preview(pen, stage, this.begun, tools.at ?? this.begun);
    },
    ...rest,
  };
}

function dashed(pen, draw) {
  pen.beginPath();
  draw();
  pen.fillStyle = theme.solid;
  pen.globalAlpha = 0.4;
  pen.fill();
  pen.globalAlpha = 1;
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 2;
  pen.stroke();
}

function rectangleTool(tools) {
  const { app } = tools;
  return twoClicks(tools, {
    id: 'rectangle', name: 'Rectangle', keys: ['R'], hint: 'drag, or click two corners',
    commit(a, b) {
      const { store, selection } = app, [l, bottom, r, t] = box([a, b]);
      if (r - l < 1e-6 || t - bottom < 1e-6) return say('a rectangle needs two corners');
      if (store.map) {
        const runs = cellsWithin(store.map, [l, bottom, r, t]);
        if (runs.length) store.edit({ op: 'paint', as: app.settings.paint, runs });
        return;
      }
      const index = (store.world.obstacles ?? []).length;
      store.edit({ op: 'add-obstacles', obstacles: [{ polygon: [[l, bottom], [r, bottom], [r, t], [l, t]] }] });
      selection.set([`o${index}`]);
      say(`obstacle of ${metres(r - l)} by ${metres(t - bottom)}`);
    },
    preview(pen, stage, a, b) {
      if (!a) return;
      const [l, bottom, r, t] = box([a, b]);
      dashed(pen, () => tracePolygon(pen, stage, [[l, bottom], [r, bottom], [r, t], [l, t]]));
      label(pen, `${metres(r - l)} × ${metres(t - bottom)}`, stage.toX((l + r) / 2), stage.toY(bottom) + 18);
    },
    options: () => app.store.map ? paintChoice(tools) : [],
  });
}

function cellsWithin(map, [l, b, r, t]) {
  const { rows, cols, cell_size_m: side } = map, list = [];
  for (let cell = 0; cell < rows * cols; cell++) {
    const [x, y] = middleOf(map, cell);
    if (x > l - side * 1e-6 && x < r + side * 1e-6 && y > b - side * 1e-6 && y < t + side * 1e-6) list.push(cell);
  }
  return runsOfList(list);
}

function polygonTool(tools) {
  const { app } = tools;
  let points = [];
  const finish = () => {
    const polygon = points;
    points = [];
    tool.begun = null;
    if (polygon.length < 3) say('a polygon needs three corners');
    else {
      const index = (app.store.world.obstacles ?? []).length;
      app.store.edit({ op: 'add-obstacles', obstacles: [{ polygon }] });
      app.selection.set([`o${index}`]);
    }
    tools.tell();
  };
  const tool = {
    id: 'polygon', name: 'Polygon', keys: ['P'], hint: 'click corners; the first one again, or Enter twice, closes it',
    needs: () => Boolean(app.store.world), begun: null,
    // Corners are clicks alone: a drag does not end one.
    press(at, event) {
      const to = tools.snap(at, event);
      this.click(to, event);
      return { move: (x, y, e) => tools.hover([x, y], e), cancel: () => tools.cancel() };
    },
    click(at, event) {
      const same = (a, b, slack) => a && Math.hypot(a[0] - b[0], a[1] - b[1]) <= slack;
      if (points.length >= 3 && same(points[0], at, tools.near(event))) return finish();
      if (same(points.at(-1), at, 1e-9)) return points.length >= 3 ? finish() : undefined;
      points.push(at);
      this.begun = points[0];
      say(`corner ${points.length}`);
      tools.tell();
    },
    key(event) {
      if (event.key !== 'Backspace' || !points.length) return false;
      points.pop();
      this.begun = points[0] ?? null;
      tools.tell();
      return true;
    },
    cancel() {
      points = [];
      this.begun = null;
    },
    draw(pen, stage) {
      if (!points.length) return;
      const at = tools.at;
      dashed(pen, () => tracePolygon(pen, stage, at ? [...points, at] : points, points.length > 1));
      for (const [index, [x, y]] of points.entries()) {
        pen.beginPath();
        pen.arc(stage.toX(x), stage.toY(y), index ? 4 : 7, 0, 2 * Math.PI);
        pen.fillStyle = theme.card;
        pen.fill();
        pen.stroke();
      }
      if (at) label(pen, metres(Math.hypot(at[0] - points.at(-1)[0], at[1] - points.at(-1)[1])), stage.toX(at[0]), stage.toY(at[1]) + 20);
    },
  };
  return tool;
}

function paintChoice({ app }) {
  return [field('Paint', select(KINDS.map((kind) => [kind, kind]), app.settings.paint, (as) => { app.settings.paint = as; }))];
}

/** Cells on the line between two cells, so that a quick brush leaves no gaps. */
function line(map, a, b) {
  const [r0, c0, r1, c1] = [Math.floor(a / map.cols), a % map.cols, Math.floor(b / map.cols), b % map.cols];
  const steps = Math.max(Math.abs(r1 - r0), Math.abs(c1 - c0), 1);
  return Array.from({ length: steps + 1 }, (_, i) => Math.round(r0 + (r1 - r0) * i / steps) * map.cols + Math.round(c0 + (c1 - c0) * i / steps));
}

function around(map, cell, size) {
  const row = Math.floor(cell / map.cols), col = cell % map.cols, from = -Math.floor((size - 1) / 2), out = [];
  for (let r = row + from; r < row + from + size; r++) {
    for (let c = col + from; c < col + from + size; c++) if (r >= 0 && c >= 0 && r < map.rows && c < map.cols) out.push(r * map.cols + c);
  }
  return out;
}

function brushTool(tools) {
  const { app } = tools;
  const op = (cells) => ({ op: 'paint', as: app.settings.paint, runs: runsOfList(cells) });
  return {
    id: 'brush', name: 'Brush', keys: ['B'], hint: 'drag over cells', needs: () => Boolean(app.store.map),
    press(at) {
      const map = app.store.map, cells = new Set();
      let last = cellAt(map, at);
      const add = (cell) => {
        if (cell < 0) return;
        for (const on of line(map, last < 0 ? cell : last, cell)) for (const near of around(map, on, app.settings.brush)) cells.add(near);
        last = cell;
        app.store.try(op(cells));
      };
      add(last);
      return {
        move: (x, y, event) => {
          tools.hover([x, y], event);
          add(cellAt(map, [x, y]));
        },
        up: () => { if (cells.size) app.store.edit(op(cells)); },
        cancel: () => app.store.try(null),
      };
    },
    enter(at) {
      const cell = at ? cellAt(app.store.map, at) : -1;
      if (cell >= 0) app.store.edit(op(around(app.store.map, cell, app.settings.brush)));
      return true;
    },
    draw(pen, stage) {
      const map = app.store.map, cell = tools.at && map ? cellAt(map, tools.at) : -1;
      if (cell < 0) return;
      const side = map.cell_size_m, [x, y] = middleOf(map, cell), size = app.settings.brush, from = Math.floor((size - 1) / 2);
      pen.strokeStyle = theme.accent;
      pen.lineWidth = 2;
      pen.strokeRect(stage.toX(x - (from + 0.5) * side), stage.toY(y + (from + 0.5) * side), size * side * stage.camera.scale, size * side * stage.camera.scale);
    },
    options: () => [...paintChoice(tools), field('Cells', number(app.settings.brush, (value) => { app.settings.brush = value; }, { min: 1, max: 32, step: 1 }))],
  };
}

function fillTool(tools) {
  const { app } = tools;
  const pour = (at) => {
    const map = app.store.map, cell = at ? cellAt(map, at) : -1;
    if (cell < 0) return;
    if (KINDS[kindsOf(map)[cell]] === app.settings.paint) return say(`it is ${app.settings.paint} already`);
    app.store.edit({ op: 'paint', as: app.settings.paint, runs: runsOfList(flood(map, cell)) });
  };
  return {
    id: 'fill', name: 'Fill', keys: ['F'], hint: 'click a cell: all that join it and are alike are painted', needs: () => Boolean(app.store.map),
    press(at) {
      pour(at);
      return {};
    },
    enter(at) {
      pour(at);
      return true;
    },
    options: () => paintChoice(tools),
  };
}

function moverTool(tools) {
  const { app } = tools;
  const disc = () => ({ disc: { radius_m: 0.3 } });
  return twoClicks(tools, {
    id: 'mover', name: 'Moving obstacle', keys: ['M'], hint: 'drag from where it begins to where it ends', needs: () => Boolean(app.store.world),
    commit(a, b) {
      const way = Math.hypot(b[0] - a[0], b[1] - a[1]), index = (app.store.world.movers ?? []).length;
      const knots = way > 1e-6 ? [[0, ...a, 0], [round(way / app.settings.mover), ...b, 0]] : [[0, ...a, 0]];
      app.store.edit({ op: 'add-mover', mover: { footprint: disc(), knots } });
      app.selection.set([`m${index}`]);
    },
    preview(pen, stage, a, b) {
      dashed(pen, () => {
        for (const [x, y] of a ? [a, b] : [b]) traceOutline(pen, stage, outlineOf(disc()), x, y);
        if (a) tracePolygon(pen, stage, [a, b], false);
      });
      const way = a ? Math.hypot(b[0] - a[0], b[1] - a[1]) : 0;
      if (way) label(pen, `${metres(way)} in ${tidy(way / app.settings.mover, 1)} s`, stage.toX(b[0]), stage.toY(b[1]) + 24);
    },
    options: () => [field('m/s', number(app.settings.mover, (value) => { app.settings.mover = value; }, { min: 0.01, max: 100 }))],
  });
}

function robotTool(tools) {
  const { app } = tools;
  const kind = () => app.settings.robot in app.store.document.robots ? app.settings.robot : Object.keys(app.store.document.robots)[0];
  return twoClicks(tools, {
    id: 'robot', name: 'Robot', keys: ['A'], hint: 'drag from the start of a robot to its goal',
    commit(start, goal) {
      const { store, selection } = app, index = store.agents.length, ops = [];
      let name = kind();
      if (!name) {
        // The first robot brings its kind.
        name = 'cart';
        ops.push({ op: 'set-robot', name, profile: { footprint: { disc: { radius_m: 0.25 } }, model: { 'single-integrator': { speed_m_per_s: 1 } } } });
      }
      ops.push({ op: 'add-agents', agents: [{ robot: name, start, goal }] });
      store.edit(batch('add robot', ops));
      selection.set([`s${index}`, `g${index}`]);
      say(`robot ${index}`);
    },
    preview(pen, stage, a, b) {
      const outline = kind() ? app.kinds.outline(kind()) : { r: 0.25, reach: 0.25 }, color = AGENTS[app.store.agents.length % AGENTS.length];
      const start = a ?? b;
      pen.globalAlpha = 0.75;
      pen.beginPath();
      traceOutline(pen, stage, outline, ...start);
      pen.fillStyle = color;
      pen.fill();
      pen.globalAlpha = 1;
      if (!a) return;
      pen.strokeStyle = color;
      pen.lineWidth = 2;
      pen.beginPath();
      const half = Math.max(0.62 * outline.reach * stage.camera.scale, 3);
      pen.rect(stage.toX(b[0]) - half, stage.toY(b[1]) - half, 2 * half, 2 * half);
      pen.moveTo(stage.toX(a[0]), stage.toY(a[1]));
      pen.lineTo(stage.toX(b[0]), stage.toY(b[1]));
      pen.stroke();
    },
    options: () => {
      const names = Object.keys(app.store.document.robots);
      return names.length > 1 ? [field('Kind', select(names, kind(), (name) => { app.settings.robot = name; }))] : [];
    },
  });
}

function placeTool(tools) {
  const { app } = tools;
  return {
    id: 'place', name: 'Start or goal', keys: ['G'], hint: 'click where the selected robot starts or ends; after each the next robot is selected',
    needs: () => app.store.agents.length > 0, begun: null,
    click(at) {
      const { store, selection, settings } = app, index = selection.agents[0];
      if (index === undefined) {
        const found = app.hits.at(at, tools.near()).find((key) => key[0] === 's' || key[0] === 'g');
        if (found) selection.set([found]);
        else say('select a robot first: click it, or search by number');
        return;
      }
      const part = settings.place, agent = store.agents[index];
      store.edit({ op: 'set-agents', indices: [index], agents: [{ ...agent, [part]: [...at, ...agent[part].slice(2)] }] });
      say(`${part} of robot ${index}`);
      selection.set([`${part[0]}${(index + 1) % store.agents.length}`]);
    },
    draw(pen, stage) {
      const index = app.selection.agents[0], agent = app.store.agents[index];
      if (!agent || !tools.at) return;
      pen.globalAlpha = 0.6;
      pen.beginPath();
      traceOutline(pen, stage, app.kinds.of(agent), ...tools.at, agent[app.settings.place][2] ?? 0);
      pen.fillStyle = AGENTS[index % AGENTS.length];
      pen.fill();
      pen.globalAlpha = 1;
      label(pen, `${app.settings.place} of ${index}`, stage.toX(tools.at[0]), stage.toY(tools.at[1]) + 26);
    },
    options: () => [field('Put', select(['start', 'goal'], app.settings.place, (part) => {
      app.settings.place = part;
      tools.tell();
    }))],
  };
}

function measureTool(tools) {
  let last = null;
  const tool = twoClicks(tools, {
    id: 'measure', name: 'Measure', keys: ['D'], hint: 'drag: length and direction',
    commit(a, b) {
      last = [a, b];
      say(`${metres(Math.hypot(b[0] - a[0], b[1] - a[1]))}`);
    },
    preview: () => {},
    draw(pen, stage) {
      const pair = tool.begun ? [tool.begun, tools.at ?? tool.begun] : last;
      if (!pair) return;
      const [a, b] = pair, dx = b[0] - a[0], dy = b[1] - a[1];
      for (const [color, wide] of [[theme.halo, 5], [theme.accent, 2]]) {
        pen.beginPath();
        tracePolygon(pen, stage, pair, false);
        pen.strokeStyle = color;
        pen.lineWidth = wide;
        pen.stroke();
      }
      label(pen, `${metres(Math.hypot(dx, dy))}, ${Math.round(Math.atan2(dy, dx) * 180 / Math.PI)}°`, stage.toX((a[0] + b[0]) / 2), stage.toY((a[1] + b[1]) / 2) - 18);
    },
    cancel() {
      tool.begun = null;
      last = null;
    },
  });
  return tool;
}

/** A lattice that suits the ground. */
export function defaultLattice(ground) {
  if (ground.map) return ground.map.cell_size_m;
  const [l, b, r, t] = boundsOf(ground);
  return nice(Math.max(r - l, t - b, 1e-3) / 40);
}

/** The bar with what a tool can be told. */
export function optionsOf(tool) {
  return [h('span', { class: 'hint' }, tool.hint), ...(tool.options?.() ?? [])];
}

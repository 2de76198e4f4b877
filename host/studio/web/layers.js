// What is derived of the document while it is edited: grid, roadmap, clearance. Fetched while it is shown, drawn
// below the agents; what was shown last stays, faded, until the answer comes.

import { api } from './api.js';
import { boundsOf } from './geometry.js';
import { drawClearance, drawGrid, drawRoadmap } from './drawing.js';

const DRAW = { grid: drawGrid, roadmap: drawRoadmap, clearance: drawClearance };
/** After the last edit; a drag of a wall is many. */
const REST_MS = 60;
/** Of a clearance field, about. */
const POINTS = 30_000;

export class Layers {
  constructor(store, changed) {
    Object.assign(this, { store, changed, timer: 0 });
    this.all = Object.fromEntries(Object.keys(DRAW).map((name) => [name, { name, visible: false, data: null, version: -1, error: null, busy: false }]));
    store.on((what) => { if (what === 'document') this.later(); });
  }

  show(name, visible) {
    this.all[name].visible = visible;
    this.changed();
    if (visible) this.refresh(this.all[name]);
  }

  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      for (const layer of Object.values(this.all)) if (layer.visible) this.refresh(layer);
    }, REST_MS);
  }

  async refresh(layer) {
    if (layer.busy || this.store.pending.length || layer.version === this.store.version) return;
    layer.busy = true;
    const version = this.store.version;
    try {
      const [x, y, right, top] = boundsOf(this.store.document.ground);
      const side = Math.max(Math.sqrt((right - x) * (top - y) / POINTS), 0.01);
      // Cells without a place of their own begin at the lower left corner of the ground.
      layer.data = { origin_m: [x, y], ...await api[layer.name](side) };
      layer.error = null;
    } catch (error) {
      layer.data = null;
      layer.error = error;
    }
    layer.busy = false;
    layer.version = version;
    this.changed();
    // An edit came meanwhile.
    if (layer.visible && version !== this.store.version) this.refresh(layer);
  }

  draw(pen, stage, names) {
    for (const name of names) {
      const layer = this.all[name];
      if (!layer.visible || !layer.data) continue;
      pen.save();
      if (layer.version !== this.store.version) pen.globalAlpha = 0.5;
      DRAW[name](pen, stage, layer.data);
      pen.restore();
    }
  }
}

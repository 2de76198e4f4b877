// The whole ground in a corner, with the part that the stage shows. There while that is not all.

import { h } from './dom.js';
import { boundsOf, corners, kindsOf } from './geometry.js';
import { AGENTS, theme } from './drawing.js';

const WIDE = 168, TALL = 120;

export class Minimap {
  constructor(canvas, { stageOf, store, shown }) {
    Object.assign(this, { canvas, stageOf, store, shown, wanted: true, picture: null, key: null });
    const go = (event) => {
      const box = canvas.getBoundingClientRect(), { l, t, k } = this.frame;
      this.stageOf().look({ x: l + (event.clientX - box.left) / k, y: t - (event.clientY - box.top) / k });
    };
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      go(event);
    });
    canvas.addEventListener('pointermove', (event) => { if (canvas.hasPointerCapture(event.pointerId)) go(event); });
  }

  draw() {
    const stage = this.stageOf();
    const hidden = !this.wanted || !stage || !this.shown() || stage.camera.scale < 1.4 * stage.fitScale;
    if (this.canvas.hidden !== hidden) this.canvas.hidden = hidden;
    if (hidden) return;
    const [l, b, r, t] = boundsOf(this.store.document.ground), k = Math.min(WIDE / (r - l), TALL / (t - b));
    const w = Math.max(8, Math.round((r - l) * k)), high = Math.max(8, Math.round((t - b) * k)), dpr = Math.min(devicePixelRatio || 1, 3);
    this.frame = { l, t, k };
    const key = [this.store.document, w, high, dpr, theme.ground].map((part, at) => at ? part : this.store.version).join(' ');
    if (this.key !== key) {
      this.key = key;
      this.picture = this.still(w * dpr, high * dpr, k * dpr);
      Object.assign(this.canvas, { width: w * dpr, height: high * dpr });
      Object.assign(this.canvas.style, { width: `${w}px`, height: `${high}px` });
    }
    const pen = this.canvas.getContext('2d');
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.drawImage(this.picture, 0, 0);
    pen.scale(dpr, dpr);
    pen.strokeStyle = theme.accent;
    pen.lineWidth = 2;
    const [x0, y0] = [(stage.fromX(0) - l) * k, (t - stage.fromY(0)) * k];
    pen.strokeRect(x0, y0, stage.width / stage.camera.scale * k, stage.height / stage.camera.scale * k);
  }

  still(w, high, k) {
    const picture = h('canvas', { width: w, height: high }), pen = picture.getContext('2d'), { ground, agents } = this.store.document, [l, , , t] = boundsOf(ground);
    pen.fillStyle = theme.ground;
    pen.fillRect(0, 0, w, high);
    pen.fillStyle = theme.solid;
    if (ground.map) {
      const { cols, cell_size_m: side } = ground.map, kinds = kindsOf(ground.map);
      kinds.forEach((kind, cell) => { if (kind === 1) pen.fillRect(cell % cols * side * k, Math.floor(cell / cols) * side * k, side * k + 0.5, side * k + 0.5); });
    } else {
      pen.beginPath();
      for (const obstacle of ground.world.obstacles ?? []) corners(obstacle).forEach(([x, y], at) => pen[at ? 'lineTo' : 'moveTo']((x - l) * k, (t - y) * k));
      pen.fill();
    }
    agents.forEach(({ start: [x, y] }, index) => {
      pen.fillStyle = AGENTS[index % AGENTS.length];
      pen.fillRect((x - l) * k - 1.5, (t - y) * k - 1.5, 3, 3);
    });
    return picture;
  }
}

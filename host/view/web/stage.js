// A piece of the plane on the screen: camera, canvases on top of each other, layers that draw
// on them, and what fingers, mouse and keys do to the camera.
//
// Planes from the bottom: `ground` is drawn rarely, on a canvas larger than the stage that is
// moved below the others; its pen has metres, y up. `scene` is drawn in every frame with pixels of
// the page. `bodies` has its own canvas (bodies.js). `over` is as `scene`, above the bodies.

import { Emitter } from './emitter.js';
import { fineness, make } from './dom.js';
import { STAGES, everyFrame, wake } from './frames.js';
import { onTheme, theme } from './theme.js';

/** What the ground has beyond each edge of the stage, in parts of it. */
const MARGIN = 0.3;

/** A touch that goes farther than so many pixels is no click. */
const CLICK_PX = 6;

/** Emits `camera`; `frame` before each picture and `drawn` after it; `pick` (px, py, event) at a
 * click; `hover` (px, py), or nothing when the mouse leaves; `loose` when the user moves a camera that
 * follows; `resize`. */
export class Stage extends Emitter {
  /** Centre in metres, pixels per metre. */
  camera = { x: 0, y: 0, scale: 1 };
  width = 1;
  height = 1;
  dpr = 1;
  /** What draws, from the bottom: `{name, plane, visible, draw(pen, stage, now)}`, where `plane` is
   * `scene` unless it is said and `visible` is true unless it is false. */
  layers = [];
  /** What `fit` shows: left, bottom, right, top in metres. */
  bounds = [0, 0, 1, 1];
  /** Metres of what one looks at most closely: it fills a half of the stage at the largest scale. */
  detail = 0.5;
  /** Gives the point in the middle while the camera follows somebody. */
  lead = null;
  /** Simulated seconds of the picture. */
  now = 0;
  /** Where the mouse is, in pixels. */
  hover = null;
  /** Asked at each press with (x, y, event), in metres, before the camera is moved: what it returns has
   * the pointer, with `move(x, y, event)`, `up(x, y, event)` and `cancel()`, each if it wants. */
  grab = null;
  cost = { frames: 0, ms: 0, worst_ms: 0 };
  #dirty = true;
  #laid = null;
  #settle = 0;
  #ends = [];

  /** A stage in an element. Canvases that are not given are made. */
  constructor(node, { ground, scene, over } = {}) {
    super();
    this.node = node;
    node.classList.add('stage');
    const canvas = (given) => given ?? make('canvas');
    this.ground = canvas(ground);
    this.scene = canvas(scene);
    this.over = canvas(over);
    /** The place of canvases that layers of the plane `bodies` have. */
    this.slot = make('div', { className: 'slot' });
    node.prepend(this.ground, this.scene, this.slot, this.over);
    for (const [name, plane] of Object.entries({ ground: this.ground, scene: this.scene, over: this.over })) plane.classList.add('plane', name);
    for (const hidden of [this.ground, this.slot, this.over]) hidden.setAttribute('aria-hidden', 'true');
    this.#listen();
    const watch = new ResizeObserver(() => this.resize());
    watch.observe(node);
    this.#ends.push(
      everyFrame(STAGES, () => this.#frame()),
      onTheme(() => this.invalidate('ground')),
      () => watch.disconnect(),
    );
    this.resize();
  }

  /** Ends what runs for the stage. */
  end() {
    clearTimeout(this.#settle);
    for (const end of this.#ends) end();
  }

  // ---- Camera -----------------------------------------------------------------------

  toX(x) { return (x - this.camera.x) * this.camera.scale + this.width / 2; }
  toY(y) { return (this.camera.y - y) * this.camera.scale + this.height / 2; }
  fromX(px) { return (px - this.width / 2) / this.camera.scale + this.camera.x; }
  fromY(py) { return this.camera.y - (py - this.height / 2) / this.camera.scale; }

  /** Pixels per metre at which everything can be seen. */
  get fitScale() {
    const [left, bottom, right, top] = this.bounds;
    return 0.95 * Math.min(this.width / Math.max(right - left, 1e-9), this.height / Math.max(top - bottom, 1e-9));
  }

  /** Shows everything; other bounds are kept from then on. */
  fit(bounds = this.bounds) {
    this.bounds = bounds;
    const [left, bottom, right, top] = bounds;
    this.look({ x: (left + right) / 2, y: (bottom + top) / 2, scale: this.fitScale });
  }

  /** Sets the camera, or parts of it. */
  look(camera) {
    Object.assign(this.camera, camera);
    this.emit('camera');
    this.invalidate();
  }

  /** Zooms by a factor around a point of the stage. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const before = this.camera.scale, fit = this.fitScale;
    const most = Math.max(fit, Math.min(this.width, this.height) / (4 * (this.detail || 1)));
    const scale = Math.min(Math.max(before * factor, fit / 4), most);
    const change = this.lead ? 0 : 1 / before - 1 / scale;
    this.look({
      x: this.camera.x + (px - this.width / 2) * change,
      y: this.camera.y - (py - this.height / 2) * change,
      scale,
    });
  }

  /** Moves the picture by pixels. */
  pan(dx, dy) {
    if (this.lead) {
      this.lead = null;
      this.emit('loose');
    }
    const [left, bottom, right, top] = this.bounds, { x, y, scale } = this.camera;
    const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
    this.look({ x: clamp(x - dx / scale, left, right), y: clamp(y + dy / scale, bottom, top) });
  }

  // ---- Drawing ----------------------------------------------------------------------

  /** Adds a layer above the others of its plane; returns it. */
  add(layer) {
    this.layers.push(layer);
    this.invalidate(layer.plane);
    return layer;
  }

  /** Takes layers away. */
  remove(...gone) {
    this.layers = this.layers.filter((layer) => !gone.includes(layer));
    this.invalidate('ground');
  }

  /** Wants a new picture; of the ground too, where that is named. */
  invalidate(plane) {
    if (plane === 'ground') this.#laid = null;
    this.#dirty = true;
    wake();
  }

  #frame() {
    if (!this.#dirty) return false;
    const start = performance.now();
    this.draw();
    const spent = performance.now() - start, { cost } = this;
    cost.frames++;
    cost.ms += spent;
    cost.worst_ms = Math.max(cost.worst_ms, spent);
    return this.#dirty;
  }

  /** Draws at once. */
  draw() {
    this.#dirty = false;
    this.emit('frame');
    if (this.lead) [this.camera.x, this.camera.y] = this.lead();
    this.#lay();
    this.#paint('scene', this.scene);
    this.#each('bodies', null);
    this.#paint('over', this.over);
    this.emit('drawn');
  }

  #each(plane, pen) {
    for (const layer of this.layers) {
      if ((layer.plane ?? 'scene') === plane && layer.visible !== false) layer.draw(pen, this, this.now);
    }
  }

  #paint(plane, canvas) {
    const pen = canvas.getContext('2d');
    pen.setTransform(this.dpr, 0, 0, this.dpr, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    pen.lineJoin = pen.lineCap = 'round';
    this.#each(plane, pen);
  }

  /** Gives a pen metres, y up, until it is restored. */
  inMetres(pen, draw) {
    const { x, y, scale } = this.camera;
    pen.save();
    pen.translate(this.width / 2 - x * scale, this.height / 2 + y * scale);
    pen.scale(scale, -scale);
    draw(pen);
    pen.restore();
  }

  #drawGround() {
    const { width, height, dpr, ground } = this, { x, y, scale } = this.camera;
    const w = width * (1 + 2 * MARGIN), h = height * (1 + 2 * MARGIN);
    const [wide, tall] = [Math.round(w * dpr), Math.round(h * dpr)];
    if (ground.width !== wide || ground.height !== tall) {
      Object.assign(ground, { width: wide, height: tall });
      Object.assign(ground.style, { width: w + 'px', height: h + 'px', left: -MARGIN * width + 'px', top: -MARGIN * height + 'px' });
    }
    const pen = ground.getContext('2d');
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.fillStyle = theme.page;
    pen.fillRect(0, 0, wide, tall);
    pen.setTransform(scale * dpr, 0, 0, -scale * dpr, (w / 2 - x * scale) * dpr, (h / 2 + y * scale) * dpr);
    pen.lineWidth = 1 / scale;
    this.#each('ground', pen);
    this.#laid = { x, y, scale };
  }

  /** Moves the ground below the scene; draws it anew where moving is not enough. */
  #lay() {
    const laid = this.#laid, { width, height, ground } = this, { x, y, scale } = this.camera;
    const k = laid ? scale / laid.scale : 0;
    const dx = laid ? (laid.x - x) * scale : 0, dy = laid ? (y - laid.y) * scale : 0;
    const reaches = Math.abs(dx) + width / 2 <= (0.5 + MARGIN) * width * k &&
      Math.abs(dy) + height / 2 <= (0.5 + MARGIN) * height * k;
    if (!laid || !reaches || k > 2) {
      this.#drawGround();
      ground.style.transform = '';
      return;
    }
    ground.style.transform = `translate(${dx}px, ${dy}px) scale(${k})`;
    if (k !== 1) {
      clearTimeout(this.#settle);
      this.#settle = setTimeout(() => this.invalidate('ground'), 120);
    }
  }

  /** Takes the size of its element, if that has changed, and draws. */
  resize() {
    const { node } = this, fine = fineness();
    const [w, h] = [Math.max(node.clientWidth, 2), Math.max(node.clientHeight, 2)];
    if (w === this.width && h === this.height && fine === this.dpr) return;
    const whole = this.width === 1 || Math.abs(this.camera.scale - this.fitScale) < 1e-9 * this.camera.scale;
    [this.width, this.height, this.dpr] = [w, h, fine];
    for (const canvas of [this.scene, this.over]) Object.assign(canvas, { width: Math.round(w * fine), height: Math.round(h * fine) });
    this.emit('resize');
    if (whole) this.fit();
    this.#laid = null;
    // A canvas that changes its size is blank, so it is drawn at once.
    this.draw();
  }

  /** The picture as one canvas, for a file. */
  picture() {
    this.#laid = null;
    this.draw();
    const { width, height, dpr } = this;
    const whole = make('canvas', { width: Math.round(width * dpr), height: Math.round(height * dpr) });
    const pen = whole.getContext('2d');
    pen.drawImage(this.ground, -Math.round(MARGIN * width * dpr), -Math.round(MARGIN * height * dpr));
    for (const canvas of [this.scene, ...this.slot.children, this.over]) pen.drawImage(canvas, 0, 0);
    return whole;
  }

  // ---- Fingers and the mouse: one drags, two pinch, a short touch selects; the middle button always drags ------

  /** The place of an event on the stage, in pixels. */
  local(event) {
    const box = this.scene.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  #listen() {
    const { scene } = this;
    const pointers = new Map();
    let travelled = 0, held = null, middle = false;
    const place = (event) => {
      const [px, py] = this.local(event);
      return [this.fromX(px), this.fromY(py), event];
    };
    const hover = (at) => {
      this.hover = at;
      this.emit('hover', ...at ?? []);
    };
    scene.addEventListener('pointerdown', (event) => {
      if (event.button > 1) return;
      middle = event.button === 1;
      try { scene.setPointerCapture(event.pointerId); } catch { /* a pointer made by a script */ }
      if (!pointers.size) travelled = 0;
      pointers.set(event.pointerId, this.local(event));
      hover(null);
      // A second finger makes a pinch of whatever the first one began.
      held?.cancel?.();
      held = pointers.size === 1 && !middle ? this.grab?.(...place(event)) ?? null : null;
    });
    scene.addEventListener('pointermove', (event) => {
      const to = this.local(event), from = pointers.get(event.pointerId);
      if (!from) return void hover(event.pointerType === 'mouse' ? to : null);
      const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      travelled += Math.hypot(to[0] - from[0], to[1] - from[1]);
      pointers.set(event.pointerId, to);
      if (held) return void held.move?.(...place(event));
      if (others.length) {
        const [px, py] = others[0];
        const apart = (at) => Math.max(Math.hypot(at[0] - px, at[1] - py), 1);
        this.zoom(apart(to) / apart(from), (to[0] + px) / 2, (to[1] + py) / 2);
        if (!this.lead) this.pan((to[0] - from[0]) / 2, (to[1] - from[1]) / 2);
      } else if (travelled > CLICK_PX) {
        scene.classList.add('dragging');
        this.pan(to[0] - from[0], to[1] - from[1]);
      }
    });
    const lift = (event) => {
      if (!pointers.delete(event.pointerId)) return;
      const up = event.type === 'pointerup';
      if (held) {
        if (up) held.up?.(...place(event)); else held.cancel?.();
        held = null;
      } else if (up && !middle && travelled <= CLICK_PX && !pointers.size) {
        this.emit('pick', ...this.local(event), event);
      }
      if (!pointers.size) scene.classList.remove('dragging');
    };
    // Else the browser scrolls by itself.
    scene.addEventListener('mousedown', (event) => { if (event.button === 1) event.preventDefault(); });
    scene.addEventListener('pointerup', lift);
    scene.addEventListener('pointercancel', lift);
    scene.addEventListener('pointerleave', () => hover(null));
    scene.addEventListener('wheel', (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 20 : 1;
      this.zoom(Math.exp(-0.0015 * lines * event.deltaY), ...this.local(event));
    }, { passive: false });
    scene.addEventListener('keydown', (event) => {
      const way = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
      if (!way || event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
      this.pan(...way);
      event.preventDefault();
      event.stopPropagation();
    });
  }
}

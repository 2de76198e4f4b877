// The layer of bodies. WebGL2 draws them where there is a graphics processor, a pen where there is none (which is
// faster than WebGL by the processor) or while the context is lost; what can be seen is the same.
//
// A body has the colour of its number in `colors`, an edge and a tick for its heading where it is large
// enough, and is a square of two pixels at least: a dot that can be seen is better than a true size
// that cannot.

import { make } from './dom.js';
import { GlPainter } from './bodies-gl.js';
import { PenPainter } from './bodies-pen.js';
import { onTheme, rgba, theme } from './theme.js';

/** Radius in pixels below which a body is a square, and half its side at least. */
const DOT_PX = 2.2;
const HALF_DOT_PX = 1;
/** Radius in pixels of the largest body above which edges are drawn. */
const EDGE_PX = 5;

export class Bodies {
  name = 'bodies';
  plane = 'bodies';
  visible = true;
  #painter = null;
  #ends = [];

  /** Bodies of a fleet (fleet.js). `palette` gives CSS colours; `renderer` is `webgl2` or `2d`, the better one of those that
   * there are if neither is named. */
  constructor(stage, fleet, { palette, renderer } = {}) {
    Object.assign(this, { stage, fleet, palette, renderer });
    /** For each body the number of its colour in the palette. */
    this.colors = new Uint8Array(fleet.bodies);
    this.#ends.push(onTheme(() => stage.invalidate()));
    this.#begin();
    stage.add(this);
  }

  /** `webgl2` or `2d`. */
  get drawnBy() {
    return this.#painter.name;
  }

  #begin() {
    const canvas = () => {
      const { width, height, dpr } = this.stage;
      return make('canvas', { width: Math.round(width * dpr), height: Math.round(height * dpr) });
    };
    if (this.renderer !== '2d') {
      const own = canvas();
      this.#painter = GlPainter.on(own, this.fleet, this.renderer);
      own.addEventListener('webglcontextlost', (event) => {
        // Without this the context never comes back.
        event.preventDefault();
        if (this.#painter?.canvas !== own) return;
        this.#show(new PenPainter(canvas(), this.fleet));
      });
      own.addEventListener('webglcontextrestored', () => {
        const painter = this.#painter && GlPainter.on(own, this.fleet, this.renderer);
        if (painter) this.#show(painter);
      });
    }
    this.#show(this.#painter ?? new PenPainter(canvas(), this.fleet));
  }

  #show(painter) {
    const before = this.#painter;
    this.#painter = painter;
    if (before && before !== painter && before.canvas.isConnected) before.canvas.replaceWith(painter.canvas);
    else if (!painter.canvas.isConnected) this.stage.slot.append(painter.canvas);
    painter.canvas.classList.add('plane');
    painter.canvas.setAttribute('aria-hidden', 'true');
    this.stage.invalidate();
  }

  /** Takes the layer away. */
  end() {
    for (const end of this.#ends) end();
    const painter = this.#painter;
    // Whatever becomes of its context is nobody's business any more.
    this.#painter = null;
    painter.canvas.remove();
    painter.end();
    this.stage.remove(this);
  }

  draw(_, stage) {
    const { width, height, dpr, camera } = stage, { canvas } = this.#painter;
    const [w, h] = [Math.round(width * dpr), Math.round(height * dpr)];
    if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
    const large = this.fleet.largest * camera.scale;
    this.#painter.draw({
      x: camera.x, y: camera.y,
      // In device pixels.
      scale: camera.scale * dpr, width: w, height: h, dpr,
      dot: DOT_PX * dpr, half: HALF_DOT_PX * dpr,
      edge: large > EDGE_PX ? Math.min(2, 0.1 * large) * dpr : 0,
      colors: this.colors,
      palette: this.palette().map(rgba), ink: rgba(theme.ink), solid: rgba(theme.solid),
    });
  }

  /** The agent under a point of the stage, or near it; -1 is none. */
  at(px, py, near_px = 12) {
    return this.fleet.at(this.stage.fromX(px), this.stage.fromY(py), near_px / this.stage.camera.scale);
  }
}

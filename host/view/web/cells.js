// Fields of cells: a map, or numbers per cell, as one picture with a pixel per cell that the
// stage enlarges. The first row is the uppermost; the lower left corner is the origin of the world.

import { make } from './dom.js';
import { rgba, theme } from './theme.js';

/** The largest side of a picture that browsers draw; larger fields have several cells to a pixel. */
const MOST = 4096;

export class Cells {
  #canvas = null;
  #image = null;
  #dirty = true;
  #theme = 0;

  /** A layer of `rows` × `cols` cells of `side` metres. `colors` gives the CSS colours that cells' numbers stand for,
   * of which 0 is nothing at all; it is asked again after `changed`, and when the colours of the page change. */
  constructor({ name, rows, cols, side, colors, plane = 'ground', opacity = 1 }) {
    Object.assign(this, { name, rows, cols, side, colors, plane, opacity, visible: true });
    this.step = Math.max(1, Math.ceil(Math.max(rows, cols) / MOST));
    this.values = new Uint8Array(rows * cols);
  }

  /** Sets all values to one. */
  clear(value = 0) {
    this.values.fill(value);
    this.changed();
  }

  /** Sets the cells of rectangles: row, column, rows and columns of each, one after the other. */
  fill(rectangles, value) {
    for (let at = 0; at + 3 < rectangles.length; at += 4) {
      const [row, col, down, across] = rectangles.slice(at, at + 4);
      for (let r = row; r < row + down; r++) this.values.fill(value, r * this.cols + col, r * this.cols + col + across);
    }
    this.changed();
  }

  /** Sets runs of cells, row by row from the top: first and length of each, one after the other. */
  runs(runs, value) {
    for (let at = 0; at + 1 < runs.length; at += 2) this.values.fill(value, runs[at], runs[at] + runs[at + 1]);
    this.changed();
  }

  /** Shows numbers by the steps of a scale of `steps` colours, of which the first is for the least; what is not above
   * `least` is not shown. Steps are equal in what `shape` makes of the share of the largest. */
  scale(numbers, steps, { least = 0, most = 0, shape = (share) => share } = {}) {
    if (!most) for (let i = 0; i < numbers.length; i++) if (numbers[i] > most) most = numbers[i];
    const width = most > least ? most - least : 1;
    for (let i = 0; i < this.values.length; i++) {
      const share = (numbers[i] - least) / width;
      this.values[i] = share > 0 ? 1 + Math.min(Math.floor(shape(share) * steps), steps - 1) : 0;
    }
    this.changed();
  }

  /** Says that values or colours have changed. */
  changed() {
    this.#dirty = true;
  }

  #paint() {
    const { rows, cols, step, values } = this;
    const tall = Math.ceil(rows / step), wide = Math.ceil(cols / step);
    this.#canvas ??= make('canvas', { width: wide, height: tall });
    const pen = this.#canvas.getContext('2d');
    this.#image ??= pen.createImageData(wide, tall);
    const pixels = new Uint32Array(this.#image.data.buffer);
    const palette = new Uint32Array(256);
    const bytes = new Uint8Array(palette.buffer);
    this.colors().forEach((color, at) => color && bytes.set(rgba(color), 4 * at));
    if (step === 1) {
      for (let i = 0; i < values.length; i++) pixels[i] = palette[values[i]];
    } else {
      // The largest value stands for all cells of a pixel: what is rare is not lost.
      for (let y = 0; y < tall; y++) {
        for (let x = 0; x < wide; x++) {
          let value = 0;
          for (let row = y * step; row < Math.min((y + 1) * step, rows); row++) {
            for (let col = x * step; col < Math.min((x + 1) * step, cols); col++) value = Math.max(value, values[row * cols + col]);
          }
          pixels[y * wide + x] = palette[value];
        }
      }
    }
    pen.putImageData(this.#image, 0, 0);
    this.#dirty = false;
    this.#theme = theme.changes;
  }

  draw(pen, stage) {
    if (!this.rows || !this.cols) return;
    if (this.#dirty || this.#theme !== theme.changes) this.#paint();
    const lay = () => {
      const { rows, side, step } = this;
      pen.save();
      pen.globalAlpha *= this.opacity;
      // Cells stay sharp, and mix where they are smaller than pixels.
      pen.imageSmoothingEnabled = side * step * stage.camera.scale * stage.dpr < 1;
      pen.imageSmoothingQuality = 'high';
      pen.translate(0, rows * side);
      pen.scale(side * step, -side * step);
      pen.drawImage(this.#canvas, 0, 0);
      pen.restore();
    };
    if (this.plane === 'ground') lay(); else stage.inMetres(pen, lay);
  }
}

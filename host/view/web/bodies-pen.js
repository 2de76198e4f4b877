// Bodies by the pen of a canvas.

/** From so many squares on they are put down pixel by pixel, which is faster than a path. */
const MANY = 1500;

export class PenPainter {
  name = '2d';
  #image = null;

  constructor(canvas, fleet) {
    Object.assign(this, { canvas, fleet });
  }

  draw({ x, y, scale, width, height, dot, half, edge, colors, palette, ink, solid }) {
    const pen = this.canvas.getContext('2d'), { fleet } = this, { X, Y } = fleet;
    // Trailers have the colours of their cars.
    const colorAt = (i) => fleet.owners[i] < 0 ? -1 : colors[fleet.owners[i]];
    const toX = (i) => (X[i] - x) * scale + width / 2, toY = (i) => (y - Y[i]) * scale + height / 2;
    const slack = fleet.largest * scale + 2 * half;
    // The numbers of bodies that can be seen, by colour; those that are squares, apart.
    const shapes = new Map(), dots = [];
    for (let i = 0; i < fleet.bodies; i++) {
      const px = toX(i), py = toY(i);
      if (!(px > -slack && py > -slack && px < width + slack && py < height + slack)) continue;
      if (fleet.reach(i) * scale < dot) {
        dots.push(i);
        continue;
      }
      const color = colorAt(i);
      const own = shapes.get(color) ?? [];
      if (!own.length) shapes.set(color, own);
      own.push(i);
    }
    const css = ([r, g, b]) => `rgb(${r} ${g} ${b})`;
    const colorOf = (color) => color < 0 ? solid : palette[color] ?? solid;
    pen.clearRect(0, 0, width, height);
    this.#dots(pen, dots, { toX, toY, scale, width, height, half, rgb: (i) => colorOf(colorAt(i)), css });
    for (const color of [...shapes.keys()].sort((a, b) => a - b)) {
      pen.beginPath();
      for (const i of shapes.get(color)) this.#outline(pen, i, toX(i), toY(i), scale);
      pen.fillStyle = css(colorOf(color));
      pen.fill();
    }
    if (!edge) return;
    pen.beginPath();
    for (const [color, own] of shapes) {
      if (color < 0) continue;
      for (const i of own) {
        const px = toX(i), py = toY(i);
        this.#outline(pen, i, px, py, scale);
        if (!fleet.headings) continue;
        const r = fleet.reach(i) * scale;
        pen.moveTo(px, py);
        pen.lineTo(px + r * Math.cos(fleet.H[i]), py - r * Math.sin(fleet.H[i]));
      }
    }
    for (const i of dots) if (fleet.owners[i] >= 0) this.#square(pen, toX(i), toY(i), fleet.reach(i) * scale, half);
    pen.lineJoin = pen.lineCap = 'round';
    pen.strokeStyle = css(ink);
    pen.lineWidth = edge;
    pen.stroke();
  }

  #square(pen, px, py, r, half) {
    const side = Math.max(r, half);
    pen.rect(px - side, py - side, 2 * side, 2 * side);
  }

  #outline(pen, i, px, py, scale) {
    const { fleet } = this, shape = fleet.outlines[fleet.kinds[i]];
    if ('r' in shape) {
      pen.moveTo(px + shape.r * scale, py);
      pen.arc(px, py, shape.r * scale, 0, 2 * Math.PI);
      return;
    }
    const cos = Math.cos(fleet.H[i]) * scale, sin = Math.sin(fleet.H[i]) * scale, { v } = shape;
    for (let at = 0; at < v.length; at += 2) {
      const qx = px + v[at] * cos - v[at + 1] * sin, qy = py - v[at] * sin - v[at + 1] * cos;
      if (at) pen.lineTo(qx, qy); else pen.moveTo(qx, qy);
    }
    pen.closePath();
  }

  #dots(pen, dots, { toX, toY, scale, width, height, half, rgb, css }) {
    const { fleet } = this;
    if (dots.length < MANY) {
      for (const i of dots) {
        pen.beginPath();
        this.#square(pen, toX(i), toY(i), fleet.reach(i) * scale, half);
        pen.fillStyle = css(rgb(i));
        pen.fill();
      }
      return;
    }
    if (this.#image?.width !== width || this.#image.height !== height) this.#image = pen.createImageData(width, height);
    const { data } = this.#image, pixels = new Uint32Array(data.buffer);
    pixels.fill(0);
    for (const i of dots) {
      const px = toX(i), py = toY(i), side = Math.max(fleet.reach(i) * scale, half), color = rgb(i);
      const r = color[0], g = color[1], b = color[2], whole = (r | g << 8 | b << 16) >>> 0;
      const x0 = px - side, x1 = px + side, y0 = py - side, y1 = py + side;
      for (let v = Math.max(Math.floor(y0), 0); v < Math.min(y1, height); v++) {
        const tall = Math.min(v + 1, y1) - Math.max(v, y0);
        for (let u = Math.max(Math.floor(x0), 0); u < Math.min(x1, width); u++) {
          // The part of the pixel that the square covers, over what is there.
          const cover = tall * (Math.min(u + 1, x1) - Math.max(u, x0)), n = v * width + u;
          if (!pixels[n] || cover >= 1) {
            pixels[n] = (whole | Math.round(255 * cover) << 24) >>> 0;
            continue;
          }
          const at = 4 * n, below = data[at + 3] / 255 * (1 - cover), all = cover + below;
          data[at] = (r * cover + data[at] * below) / all;
          data[at + 1] = (g * cover + data[at + 1] * below) / all;
          data[at + 2] = (b * cover + data[at + 2] * below) / all;
          data[at + 3] = 255 * all;
        }
      }
    }
    pen.putImageData(this.#image, 0, 0);
  }

  /** As a painter that has something to give back. */
  end() {}
}

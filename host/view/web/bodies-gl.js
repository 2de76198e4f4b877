// Bodies by WebGL2: one instanced draw for the bodies of an outline, and one for their edges.
//
// A mesh has, for each corner, a place in metres, a direction in which it is pushed out by pixels, and
// the sign of its distance from the outline there. Distances are interpolated, and make edges smooth and as
// thick as wanted at every scale. Discs, and squares that stand for small bodies, are squares whose pixels know their
// distance from the outline.

import { pairs } from './fleet.js';

const MOST_COLORS = 64;

/** How a fragment knows its distance from the outline. */
const POLYGON = 0, DISC = 1, SQUARE = 2;

/** Devices that are the processor itself; not all browsers call that a caveat. */
const SLOW = /swiftshader|llvmpipe|softpipe|software|basic render/i;

function deviceOf(gl) {
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  return String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

const VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec2 corner;
layout(location = 1) in vec2 push;
layout(location = 2) in vec2 kind;
layout(location = 3) in vec4 body;
uniform vec2 size;
uniform float scale, unit, turns, reach;
uniform vec3 palette[${MOST_COLORS}];
out vec3 along;
flat out float shape;
flat out vec3 tint;
void main() {
  vec2 q = corner * unit + push * reach;
  float c = cos(body.z * turns), s = sin(body.z * turns);
  vec2 p = body.xy * scale + vec2(c * q.x - s * q.y, s * q.x + c * q.y);
  gl_Position = vec4(2.0 * p / size, 0.0, 1.0);
  along = vec3(q, kind.x * reach);
  shape = kind.y;
  tint = palette[int(body.w)];
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 along;
flat in float shape;
flat in vec3 tint;
uniform float radius, line;
uniform vec3 ink;
out vec4 color;
void main() {
  float d = shape > 1.5 ? max(abs(along.x), abs(along.y)) - radius : shape > 0.5 ? length(along.xy) - radius : along.z;
  float cover = line > 0.0 ? clamp(0.5 * line + 0.5 - abs(d), 0.0, 1.0) : clamp(0.5 - d, 0.0, 1.0);
  color = vec4(line > 0.0 ? ink : tint, 1.0) * cover;
}`;

/** The tick of a heading: from the middle to the farthest point ahead. */
function tick(corners, reach, indices) {
  const at = corners.length / 6;
  corners.push(0, 0, 0, -1, -1, POLYGON, reach, 0, 0, -1, -1, POLYGON, reach, 0, 0, 1, 1, POLYGON, 0, 0, 0, 1, 1, POLYGON);
  indices.push(at, at + 1, at + 2, at, at + 2, at + 3);
}

/** Corners, indices of the area, indices of edge and tick, of a convex polygon. */
function polygonMesh(flat, reach) {
  let points = pairs(flat);
  const area = points.reduce((sum, [x, y], i) => {
    const [u, v] = points[(i + 1) % points.length];
    return sum + x * v - u * y;
  }, 0);
  if (area < 0) points = points.reverse();
  // Neighbours at one place have no direction between them.
  points = points.filter(([x, y], i) => {
    const [u, v] = points[(i + 1) % points.length];
    return x !== u || y !== v;
  });
  const n = points.length, corners = [], fill = [], edge = [];
  const normal = (i) => {
    const [x, y] = points[i], [u, v] = points[(i + 1) % n], length = Math.hypot(u - x, v - y);
    return [(v - y) / length, (x - u) / length];
  };
  points.forEach(([x, y], i) => {
    const [ax, ay] = normal((i + n - 1) % n), [bx, by] = normal(i);
    // So that both sides are moved by one pixel; corners that are sharp are cut.
    const stretch = 1 / Math.max(1 + ax * bx + ay * by, 0.25);
    const [mx, my] = [(ax + bx) * stretch, (ay + by) * stretch];
    corners.push(x, y, -mx, -my, -1, POLYGON, x, y, mx, my, 1, POLYGON);
    const inner = 2 * i, next = 2 * ((i + 1) % n);
    edge.push(inner, inner + 1, next + 1, inner, next + 1, next);
    if (i > 1) fill.push(0, 2 * (i - 1), inner);
  });
  fill.push(...edge);
  tick(corners, reach, edge);
  return { corners, fill, edge };
}

/** Of a disc or a square around the middle, and the pixels around it. */
function squareMesh(radius, shape) {
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].flatMap(([x, y]) => [x * radius, y * radius, x, y, 0, shape]);
  const fill = [0, 1, 2, 0, 2, 3], edge = [...fill];
  tick(corners, radius, edge);
  return { corners, fill, edge };
}

export class GlPainter {
  name = 'webgl2';

  /** A painter, or null where there is no WebGL2, or only one that is slow and nobody wants by name. */
  static on(canvas, fleet, wanted) {
    const gl = canvas.getContext('webgl2', {
      alpha: true, antialias: false, depth: false, stencil: false, powerPreference: 'high-performance',
      failIfMajorPerformanceCaveat: wanted !== 'webgl2',
    });
    if (!gl || gl.isContextLost()) return null;
    if (wanted !== 'webgl2' && SLOW.test(deviceOf(gl))) {
      gl.getExtension('WEBGL_lose_context')?.loseContext();
      return null;
    }
    try {
      return new GlPainter(canvas, gl, fleet);
    } catch (error) {
      if (gl.isContextLost()) return null;
      throw error;
    }
  }

  constructor(canvas, gl, fleet) {
    Object.assign(this, { canvas, gl, fleet });
    this.program = program(gl);
    this.at = Object.fromEntries(['size', 'scale', 'unit', 'turns', 'reach', 'palette', 'radius', 'line', 'ink'].map((name) => [name, gl.getUniformLocation(this.program, name)]));
    this.#sort();
    this.places = new Float32Array(4 * fleet.bodies);
    this.buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.places.byteLength, gl.DYNAMIC_DRAW);
    const square = this.#mesh(squareMesh(1, SQUARE));
    for (const group of this.groups) {
      const outline = fleet.outlines[group.kind];
      if (!outline) continue;
      group.disc = 'r' in outline;
      group.shape = this.#array(this.#mesh(group.disc ? squareMesh(outline.r, DISC) : polygonMesh(outline.v, fleet.reaches[group.kind])), group.from);
      group.dot = this.#array(square, group.from);
    }
  }

  /** Bodies by outline, moving obstacles first: `order` has their numbers, groups their ranges in it. */
  #sort() {
    const { fleet } = this;
    const key = (i) => (fleet.owners[i] >= 0 ? fleet.outlines.length : 0) + fleet.kinds[i];
    const counts = new Uint32Array(2 * fleet.outlines.length + 1);
    for (let i = 0; i < fleet.bodies; i++) counts[key(i) + 1]++;
    for (let at = 1; at < counts.length; at++) counts[at] += counts[at - 1];
    this.groups = [];
    for (let at = 0; at + 1 < counts.length; at++) {
      const from = counts[at], count = counts[at + 1] - from;
      if (count) this.groups.push({ kind: at % fleet.outlines.length, isAgent: at >= fleet.outlines.length, from, count });
    }
    this.order = new Uint32Array(fleet.bodies);
    for (let i = 0; i < fleet.bodies; i++) this.order[counts[key(i)]++] = i;
  }

  #mesh({ corners, fill, edge }) {
    const { gl } = this, [vertices, indices] = [gl.createBuffer(), gl.createBuffer()];
    gl.bindBuffer(gl.ARRAY_BUFFER, vertices);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.STATIC_DRAW);
    // Unbound from whatever array was current.
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array([...fill, ...edge]), gl.STATIC_DRAW);
    return { vertices, indices, fill: fill.length, edge: edge.length };
  }

  /** A mesh for the instances from a number on. */
  #array(mesh, from) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, mesh.vertices);
    for (let at = 0; at < 3; at++) {
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, 2, gl.FLOAT, false, 24, 8 * at);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.enableVertexAttribArray(3);
    gl.vertexAttribPointer(3, 4, gl.FLOAT, false, 16, 16 * from);
    gl.vertexAttribDivisor(3, 1);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.indices);
    gl.bindVertexArray(null);
    return { ...mesh, array };
  }

  draw({ x, y, scale, width, height, dot, half, edge, colors, palette, ink, solid }) {
    const { gl, at, fleet, places, order } = this, { X, Y, H, owners } = fleet;
    if (gl.isContextLost()) return;
    // The last colour is that of moving obstacles.
    const last = MOST_COLORS - 1;
    for (let n = 0, to = 0; n < order.length; n++) {
      const i = order[n];
      // Relative to the camera, so that single precision is enough.
      places[to++] = X[i] - x;
      places[to++] = Y[i] - y;
      places[to++] = H[i];
      places[to++] = owners[i] >= 0 ? Math.min(colors[owners[i]], last - 1) : last;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, places);
    gl.useProgram(this.program);
    const parts = new Float32Array(3 * MOST_COLORS);
    palette.slice(0, last).concat(Array(Math.max(0, last - palette.length)).fill(solid), [solid])
      .forEach((color, n) => parts.set([0, 1, 2].map((part) => color[part] / 255), 3 * n));
    gl.uniform3fv(at.palette, parts);
    gl.uniform3f(at.ink, ink[0] / 255, ink[1] / 255, ink[2] / 255);
    gl.uniform2f(at.size, width, height);
    gl.uniform1f(at.scale, scale);
    for (const line of edge ? [0, edge] : [0]) {
      gl.uniform1f(at.line, line);
      gl.uniform1f(at.reach, 0.5 * line + 0.5);
      for (const group of this.groups) {
        if (!group.shape || line && !group.isAgent) continue;
        const radius = fleet.reaches[group.kind] * scale, isDot = radius < dot;
        const mesh = isDot ? group.dot : group.shape;
        const side = Math.max(radius, half);
        gl.uniform1f(at.unit, isDot ? side : scale);
        gl.uniform1f(at.turns, isDot || group.disc && !line ? 0 : 1);
        gl.uniform1f(at.radius, isDot ? side : radius);
        gl.bindVertexArray(mesh.array);
        // Without headings, and on dots, there are no ticks, which are the last six indices.
        const count = line ? mesh.edge - (fleet.headings && !isDot ? 0 : 6) : mesh.fill;
        gl.drawElementsInstanced(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, line ? 2 * mesh.fill : 0, group.count);
      }
    }
    gl.bindVertexArray(null);
  }

  /** Gives the context back. */
  end() {
    this.gl.getExtension('WEBGL_lose_context')?.loseContext();
  }
}

function program(gl) {
  const made = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? 'the context is lost');
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) ?? 'the context is lost');
  return made;
}

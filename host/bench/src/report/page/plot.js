// ---- Plots ------------------------------------------------------------------------
// A figure says what is shown (axes, series); this draws it. svg.rs draws the same
// figures on paper.

const SVG = 'http://www.w3.org/2000/svg';
const DASHES = ['', '7 4', '2 3', '9 3 2 3'];
const CHARACTER = 6.7; // width of one at 12 px, roughly

/** An element with attributes and children; text is text, whatever it contains. */
function make(name, attributes = {}, ...children) {
  const node = name === 'svg' || make.drawn.has(name) ? document.createElementNS(SVG, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith('on')) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? '' : value);
  }
  node.append(...children.filter((child) => child !== null));
  return node;
}
make.drawn = new Set(['g', 'path', 'line', 'rect', 'circle', 'text', 'title']);

const colorOf = (slot) => `var(--s${slot % data.colors.length})`;
const dashOf = (slot) => DASHES[Math.floor(slot / data.colors.length) % DASHES.length];

/** A mark of a planner around a point. */
function shape(slot, x, y, r) {
  const d = r * 0.9, t = r * 1.15;
  switch (slot % 5) {
    case 0: return `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`;
    case 1: return `M${x - d} ${y - d}h${2 * d}v${2 * d}h${-2 * d}z`;
    case 2: return `M${x} ${y - t}l${t} ${1.8 * t}h${-2 * t}z`;
    case 3: return `M${x} ${y - t}l${t} ${t}l${-t} ${t}l${-t} ${-t}z`;
    default: return `M${x} ${y + t}l${t} ${-1.8 * t}h${-2 * t}z`;
  }
}

const short = (text, length) => [...text].length > length ? [...text].slice(0, Math.max(1, length - 1)).join('') + '…' : text;

/** From where to where an axis goes, and where it is marked. */
function axis(spec, values, length) {
  if (spec.names) {
    const step = length / Math.max(1, spec.names.length);
    return { place: (i) => (i + 0.5) * step, step, ticks: [], from: 0, to: spec.names.length };
  }
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (!Number.isFinite(value) || spec.log && value <= 0) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (spec.range) [low, high] = spec.range;
  if (low > high) [low, high] = spec.log ? [1, 10] : [0, 1];
  const room = Math.max(2, Math.floor(length / 56));
  if (spec.log) {
    let from = Math.log10(low), to = Math.log10(high);
    const margin = Math.max(0.03 * (to - from), 0.05);
    from -= margin;
    to += margin;
    const steps = to - from > 2.2 ? [1] : to - from > 0.7 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 7];
    const every = Math.max(1, Math.ceil((to - from) / room));
    const ticks = [];
    for (let power = Math.floor(from); power <= to; power++) {
      if (power % every) continue;
      for (const step of steps) {
        const tick = step * 10 ** power;
        if (Math.log10(tick) >= from - 1e-9 && Math.log10(tick) <= to + 1e-9) ticks.push(tick);
      }
    }
    return { place: (value) => (Math.log10(Math.max(value, 1e-300)) - from) / (to - from) * length, ticks, from: 10 ** from, to: 10 ** to };
  }
  if (spec.zero) [low, high] = [Math.min(0, low), Math.max(0, high)];
  if (low === high) [low, high] = low === 0 ? [0, 1] : [low - Math.abs(low) * 0.1, high + Math.abs(high) * 0.1];
  const raw = (high - low) / Math.min(room, 6), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((n) => n * power).find((step) => step >= raw * 0.999);
  if (!spec.range) {
    // The values themselves are marked where they are few, and have some air.
    const margin = (high - low) * 0.04;
    if (!(spec.zero && low === 0)) low -= margin;
    if (!(spec.zero && high === 0)) high += margin;
  }
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) ticks.push(i * step);
  return { place: (value) => (value - low) / (high - low) * length, ticks, from: low, to: high };
}

const rounded = (value) => minus(String(Number(value.toPrecision(3))));

/** As in format.rs. */
function tickText(spec, tick) {
  if (spec.percent) return `${rounded(100 * tick)} %`;
  const size = Math.abs(tick);
  if (size >= 1e6 || size < 1e-4 && size > 0) return scientific(tick).replace('.00', '').replace(/^1×/, '');
  return size >= 1e4 ? `${rounded(tick / 1000)}k` : rounded(tick);
}

/** Every x and every y of a figure. */
function extents(figure) {
  const xs = [], ys = [], bands = [];
  for (const series of figure.series) {
    if (series.kind === 'bar') {
      xs.push(series.value, ...(series.interval ?? []));
    } else if (series.kind === 'box') {
      xs.push(series.low, series.high, series.mean, ...series.outliers);
    } else {
      for (const [x, y] of series.points) { xs.push(x); ys.push(y); }
      for (const [low, high] of series.band ?? []) bands.push(low, high);
    }
  }
  return { xs, ys: ys.concat(bounded(ys, bands, figure.y.log)) };
}

/** Intervals of few values may be so wide that nothing else could be seen: they widen
 *  an axis by a third of what its points need, at either end, and are cut off beyond. */
function bounded(points, bands, log) {
  const onAxis = (value) => log ? Math.log10(value) : value;
  let low = Infinity, high = -Infinity;
  for (const value of points.map(onAxis)) {
    if (!Number.isFinite(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  const third = (high - low) / 3;
  const bound = (value) => low < high && Number.isFinite(value) ? Math.max(low - third, Math.min(high + third, value)) : value;
  return bands.map((value) => log ? 10 ** bound(onAxis(value)) : bound(value));
}

/** Draws a figure into its place; `open(series, index)` is called for a chosen point. */
function draw(place, figure, open) {
  const width = Math.max(260, Math.round(place.clientWidth) || 560);
  const names = figure.y.names;
  const height = names ? Math.max(150, 54 + names.length * 26) : Math.round(Math.min(360, Math.max(250, width * 0.6)));
  place.style.height = `${height}px`;
  const labels = names ? Math.min(Math.max(...names.map((name) => [...name].length), 1) * CHARACTER + 14, width * 0.36) : 62;
  const frame = { left: Math.round(labels), right: width - 20, top: 12, bottom: height - 42 };
  const { xs, ys } = extents(figure);
  const across = axis(figure.x, xs, frame.right - frame.left), down = axis(figure.y, ys, frame.bottom - frame.top);
  const X = (value) => frame.left + across.place(value);
  const Y = names ? (i) => frame.top + down.place(i) : (value) => frame.bottom - down.place(value);
  const inside = (y) => Math.max(frame.top, Math.min(frame.bottom, y));
  const svg = make('svg', { viewBox: `0 0 ${width} ${height}`, width, height, 'aria-hidden': 'true' });

  const grid = make('g', { class: 'grid' });
  for (const tick of across.ticks) {
    const x = X(tick);
    grid.append(make('line', { x1: x, x2: x, y1: frame.top, y2: frame.bottom }),
      make('text', { x, y: frame.bottom + 16, 'text-anchor': 'middle' }, tickText(figure.x, tick)));
  }
  for (const tick of down.ticks) {
    const y = Y(tick);
    grid.append(make('line', { x1: frame.left, x2: frame.right, y1: y, y2: y }),
      make('text', { x: frame.left - 7, y: y + 4, 'text-anchor': 'end' }, tickText(figure.y, tick)));
  }
  (names ?? []).forEach((name, i) => {
    const text = make('text', { x: frame.left - 8, y: Y(i) + 4, 'text-anchor': 'end', class: 'name' }, short(name, Math.floor((frame.left - 12) / CHARACTER)));
    text.append(make('title', {}, name));
    grid.append(text);
  });
  grid.append(make('line', { x1: frame.left, x2: frame.right, y1: frame.bottom, y2: frame.bottom, class: 'axis' }),
    make('line', { x1: frame.left, x2: frame.left, y1: frame.top, y2: frame.bottom, class: 'axis' }),
    make('text', { x: (frame.left + frame.right) / 2, y: height - 7, 'text-anchor': 'middle', class: 'label' }, figure.x.label));
  if (figure.y.label) {
    const middle = (frame.top + frame.bottom) / 2;
    grid.append(make('text', { x: 13, y: middle, 'text-anchor': 'middle', class: 'label', transform: `rotate(-90 13 ${middle})` }, figure.y.label));
  }
  if (figure.diagonal) {
    const low = Math.max(across.from, down.from), high = Math.min(across.to, down.to);
    if (low < high) grid.append(make('line', { x1: X(low), y1: Y(low), x2: X(high), y2: Y(high), class: 'diagonal' }));
  }
  svg.append(grid);

  // Where the pointer and the arrow keys find something: series by series.
  const hits = [];
  let canvas = null;
  figure.series.forEach((series, index) => {
    const { slot } = series, color = colorOf(slot);
    const group = make('g', { class: 'series', 'data-slot': slot, style: `--c:${color}` });
    const hit = (x, y, at, text) => hits.push({ x, y, series: index, at, text });
    if (series.kind === 'bar') {
      const y = Y(series.at), half = Math.min(9, down.step * 0.32), from = figure.x.log ? frame.left : X(0);
      if (series.value !== null) {
        group.append(make('rect', { x: from, y: y - half, width: Math.max(1, X(series.value) - from), height: 2 * half, class: 'fill' }));
        if (series.interval) group.append(make('path', { d: `M${X(series.interval[0])} ${y}H${X(series.interval[1])}`, class: 'whisker' }));
        hit(X(series.value), y, 0, () => series.text);
      }
    } else if (series.kind === 'box') {
      const y = Y(series.at), half = Math.min(9, down.step * 0.32);
      const bar = (value) => `M${X(value)} ${y - half}V${y + half}`;
      group.append(
        make('path', { d: `M${X(series.low)} ${y}H${X(series.q1)}M${X(series.q3)} ${y}H${X(series.high)}${bar(series.low)}${bar(series.high)}`, class: 'line' }),
        make('rect', { x: X(series.q1), y: y - half, width: Math.max(1, X(series.q3) - X(series.q1)), height: 2 * half, class: 'box' }),
        make('path', { d: bar(series.median), class: 'line thick' }),
        make('path', { d: series.outliers.map((value) => shape(0, X(value), y, 1.6)).join(''), class: 'outliers' }),
        make('path', { d: shape(3, X(series.mean), y, 4), class: 'mean' }));
      hit(X(series.median), y, -1, () => series.text);
      series.outliers.forEach((value, i) => hit(X(value), y, i, () => `${digits(value)}, outside the whiskers`));
    } else {
      const points = series.points.map(([x, y]) => [X(x), Y(y)]);
      const d = (points) => points.map(([x, y], i) => `${i ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`).join('');
      if (series.band) {
        const upper = series.band.map(([, high], i) => [points[i][0], inside(Y(high))]);
        const lower = series.band.map(([low], i) => [points[i][0], inside(Y(low))]).reverse();
        if (points.length > 1) group.append(make('path', { d: `${d([...upper, ...lower])}z`, class: 'band' }));
        else if (points.length) group.append(make('path', { d: `M${points[0][0]} ${upper[0][1]}V${lower[0][1]}`, class: 'whisker' }));
      }
      if (series.kind === 'steps') {
        group.append(make('path', { d: points.map(([x, y], i) => i ? `H${x.toFixed(1)}V${y.toFixed(1)}` : `M${x.toFixed(1)} ${frame.bottom}V${y.toFixed(1)}`).join(''), class: 'line', 'stroke-dasharray': dashOf(slot) }));
      } else if (series.kind === 'curve') {
        group.append(make('path', { d: d(points), class: 'line', 'stroke-dasharray': dashOf(slot) }));
        if (points.length <= 15) group.append(make('path', { d: points.map(([x, y]) => shape(slot, x, y, 3.2)).join(''), class: 'fill' }));
      } else if (points.length <= 400) {
        group.append(make('path', { d: points.map(([x, y]) => shape(slot, x, y, 3)).join(''), class: 'dots' }));
      } else {
        // Thousands of points are painted, not built.
        canvas ??= make('canvas', { 'aria-hidden': 'true' });
        (canvas.painted ??= []).push([series, points]);
      }
      points.forEach(([x, y], at) => hit(x, y, at, () => figure.pointText ? figure.pointText(series, at) : pointText(figure, series.points[at])));
    }
    svg.append(group);
  });
  const ring = make('circle', { r: 7, class: 'ring', visibility: 'hidden' });
  svg.append(ring);
  place.replaceChildren(...(canvas ? [canvas, svg] : [svg]));
  if (canvas) paint(canvas, width, height);
  place.plotted = { hits, ring, open, width, says: (hit) => `${figure.series[hit.series].name}: ${hit.text()}` };
  point(place, -1);
}

const pointText = (figure, [x, y]) =>
  `${figure.y.percent ? percent(y) : digits(y)} at ${digits(x)}`;

function paint(canvas, width, height) {
  const ratio = Math.max(1, Math.min(2, devicePixelRatio || 1));
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext('2d');
  context.scale(ratio, ratio);
  for (const [series, points] of canvas.painted) {
    context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue(`--s${series.slot % data.colors.length}`);
    context.globalAlpha = 0.5;
    for (const [x, y] of points) context.fillRect(x - 1.25, y - 1.25, 2.5, 2.5);
  }
}

/** Points at one of the hits, or at none. */
function point(place, at) {
  const { hits, ring } = place.plotted, tip = $('tip'), hit = hits[at];
  place.plotted.at = at;
  ring.setAttribute('visibility', hit ? 'visible' : 'hidden');
  if (!hit) {
    if (tip.plot === place) tip.hidden = true;
    return;
  }
  ring.setAttribute('cx', hit.x);
  ring.setAttribute('cy', hit.y);
  tip.plot = place;
  tip.textContent = place.plotted.says(hit);
  tip.hidden = false;
  const box = place.getBoundingClientRect(), scale = box.width / place.plotted.width;
  const x = box.left + hit.x * scale, y = box.top + hit.y * scale;
  const { width, height } = tip.getBoundingClientRect();
  tip.style.left = `${Math.max(4, Math.min(document.documentElement.clientWidth - width - 4, x - width / 2))}px`;
  tip.style.top = `${y - height - 12 < 4 ? y + 14 : y - height - 12}px`;
}

function choose(place) {
  const { hits, at, open } = place.plotted, hit = hits[at];
  if (hit) open(hit.series, hit.at);
}

/** Makes a plot answer to pointers and keys. */
function listen(place) {
  const nearest = (event) => {
    const box = place.getBoundingClientRect(), scale = place.plotted.width / box.width;
    const x = (event.clientX - box.left) * scale, y = (event.clientY - box.top) * scale;
    let best = -1, least = 28 * 28;
    place.plotted.hits.forEach((hit, i) => {
      const distance = (hit.x - x) ** 2 + (hit.y - y) ** 2;
      if (distance < least) [best, least] = [i, distance];
    });
    return best;
  };
  place.addEventListener('pointermove', (event) => { if (place.plotted) point(place, nearest(event)); });
  place.addEventListener('pointerleave', () => { if (place.plotted) point(place, -1); });
  place.addEventListener('blur', () => { if (place.plotted) point(place, -1); });
  place.addEventListener('click', (event) => {
    if (!place.plotted) return;
    point(place, nearest(event));
    choose(place);
  });
  place.addEventListener('keydown', (event) => {
    if (!place.plotted) return;
    const { hits, at } = place.plotted;
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    let to = at;
    if (step) {
      to = at < 0 ? 0 : Math.max(0, Math.min(hits.length - 1, at + step));
    } else if (event.key === 'ArrowDown' || event.key === 'ArrowUp') {
      // The same place in the next series that has one.
      const series = [...new Set(hits.map((hit) => hit.series))];
      const now = series.indexOf(hits[at]?.series);
      const next = series[Math.max(0, Math.min(series.length - 1, now + (event.key === 'ArrowDown' ? 1 : -1)))];
      let least = Infinity;
      hits.forEach((hit, i) => {
        const distance = Math.abs(hit.x - (hits[at]?.x ?? 0));
        if (hit.series === next && distance < least) [to, least] = [i, distance];
      });
    } else if (event.key === 'Home') {
      to = 0;
    } else if (event.key === 'End') {
      to = hits.length - 1;
    } else if (event.key === 'Enter' || event.key === ' ') {
      event.preventDefault();
      choose(place);
      return;
    } else if (event.key === 'Escape') {
      to = -1;
    } else {
      return;
    }
    event.preventDefault();
    point(place, to);
    if (hits[to]) $('status').textContent = place.plotted.says(hits[to]);
  });
}

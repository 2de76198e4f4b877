// Curves of jobs: costs of plans over time, and the throughput of fleets.

import { tidy } from './dom.js';
import { theme } from './drawing.js';
import { isOver } from './jobs.js';

export const chartWords = (plans) => `Cost over time: ${plans.length} plan${plans.length === 1 ? '' : 's'}, from ${tidy(plans[0].cost, 2)} after ${tidy(plans[0].ms, 1)} ms to ${tidy(plans.at(-1).cost, 2)} after ${tidy(plans.at(-1).ms, 1)} ms`;

/** Cost of the best plan over time, as steps, and the lower bound where one is claimed. */
export function drawCosts(canvas, plans, job) {
  const dpr = Math.min(devicePixelRatio || 1, 3), w = canvas.clientWidth, high = canvas.clientHeight;
  // It is drawn as soon as it is shown.
  if (!w) return;
  Object.assign(canvas, { width: Math.round(w * dpr), height: Math.round(high * dpr) });
  const pen = canvas.getContext('2d');
  pen.scale(dpr, dpr);
  const bounds = plans.filter(({ bound }) => bound !== null);
  const most = Math.max(...plans.map(({ cost }) => cost)), least = Math.min(...plans.map(({ cost }) => cost), ...bounds.map(({ bound }) => bound));
  const end = Math.max(plans.at(-1).ms * 1.05, isOver(job) ? job.record?.metrics?.planning_time_ms ?? 0 : job.budget_ms ?? 0, 1);
  // Times span decades: a plan comes after a millisecond, the next one after a minute.
  const start = Math.max(Math.min(plans[0].ms, end / 10), 0.01);
  const at = (ms) => 6 + (w - 12) * Math.log(Math.max(ms, start) / start) / Math.log(Math.max(end / start, 1.001));
  const up = (cost) => 18 + (high - 34) * (most > least ? (most - cost) / (most - least) : 0.5);
  pen.font = '11px system-ui, sans-serif';
  pen.fillStyle = theme.soft;
  pen.textBaseline = 'alphabetic';
  pen.fillText(tidy(most, 2), 6, 11);
  pen.textAlign = 'right';
  pen.fillText(`${tidy(plans.at(-1).cost, 2)} after ${plans.at(-1).ms < 1000 ? `${tidy(plans.at(-1).ms, 1)} ms` : `${tidy(plans.at(-1).ms / 1000, 2)} s`}`, w - 6, 11);
  pen.textAlign = 'left';
  pen.fillText(`${tidy(start, 1)} ms`, 6, high - 2);
  pen.textAlign = 'right';
  pen.fillText(end < 1000 ? `${tidy(end, 0)} ms` : `${tidy(end / 1000, 1)} s`, w - 6, high - 2);
  pen.strokeStyle = theme.line;
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(6, high - 14);
  pen.lineTo(w - 6, high - 14);
  pen.stroke();
  if (bounds.length) {
    pen.setLineDash([4, 3]);
    steps(pen, bounds.map(({ ms, bound }) => [at(ms), up(bound)]), w - 6);
    pen.strokeStyle = theme.soft;
    pen.stroke();
    pen.setLineDash([]);
  }
  steps(pen, plans.map(({ ms, cost }) => [at(ms), up(cost)]), w - 6);
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 2;
  pen.stroke();
  pen.fillStyle = theme.accent;
  for (const { ms, cost } of plans.length > 200 ? plans.slice(-1) : plans) {
    pen.beginPath();
    pen.arc(at(ms), up(cost), 2.5, 0, 2 * Math.PI);
    pen.fill();
  }
}

function steps(pen, points, right) {
  pen.beginPath();
  points.forEach(([x, y], index) => {
    if (index) pen.lineTo(x, points[index - 1][1]);
    pen[index ? 'lineTo' : 'moveTo'](x, y);
  });
  pen.lineTo(right, points.at(-1)[1]);
}

/** Throughput is told of so many seconds before a moment, or of this part of the time so far. */
const WINDOW_S = 10;
const WINDOW_SHARE = 0.1;

/** Goals per second at the times of points. */
function throughput(points) {
  let from = 0;
  return points.map(({ time_s, goals_reached }) => {
    while (points[from + 1]?.time_s <= time_s - Math.max(WINDOW_S, WINDOW_SHARE * time_s)) from++;
    const begin = points[from].time_s < time_s && time_s - points[from].time_s >= WINDOW_S ? points[from] : { time_s: 0, goals_reached: 0 };
    return { time_s, per_s: time_s > begin.time_s ? (goals_reached - begin.goals_reached) / (time_s - begin.time_s) : 0 };
  });
}

const perSecond = ({ time_s, goals_reached }) => time_s > 0 ? goals_reached / time_s : 0;

export const throughputWords = (points) => `Goals per second over time: ${perSecond(points.at(-1)).toFixed(2)} in ${tidy(points.at(-1).time_s, 0)} s, ${throughput(points).at(-1).per_s.toFixed(2)} at last`;

/** Goals per second of the last seconds over time, and of all the time as a dashed line. */
export function drawThroughput(canvas, points) {
  const dpr = Math.min(devicePixelRatio || 1, 3), w = canvas.clientWidth, high = canvas.clientHeight;
  if (!w || points.length < 2) return;
  Object.assign(canvas, { width: Math.round(w * dpr), height: Math.round(high * dpr) });
  const pen = canvas.getContext('2d');
  pen.scale(dpr, dpr);
  const rates = throughput(points), mean = perSecond(points.at(-1)), end_s = points.at(-1).time_s;
  const most = Math.max(...rates.map(({ per_s }) => per_s), mean, 1e-9);
  const at = (time_s) => 6 + (w - 12) * time_s / end_s, up = (per_s) => high - 14 - (high - 34) * per_s / most;
  pen.font = '11px system-ui, sans-serif';
  pen.fillStyle = theme.soft;
  pen.fillText(`${most.toFixed(2)} goals/s`, 6, 11);
  pen.fillText('0 s', 6, high - 2);
  pen.textAlign = 'right';
  pen.fillText(`${rates.at(-1).per_s.toFixed(2)} now, ${mean.toFixed(2)} in all`, w - 6, 11);
  pen.fillText(`${tidy(end_s, 0)} s`, w - 6, high - 2);
  const line = (places, color, wide, dash = []) => {
    pen.setLineDash(dash);
    pen.strokeStyle = color;
    pen.lineWidth = wide;
    pen.beginPath();
    places.forEach(([x, y], index) => pen[index ? 'lineTo' : 'moveTo'](x, y));
    pen.stroke();
    pen.setLineDash([]);
  };
  line([[6, high - 14], [w - 6, high - 14]], theme.line, 1);
  line([[6, up(mean)], [w - 6, up(mean)]], theme.soft, 1, [4, 3]);
  line([[6, high - 14], ...rates.map(({ time_s, per_s }) => [at(time_s), up(per_s)])], theme.accent, 2);
}

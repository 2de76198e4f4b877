// The work of a fleet: goals per second, calls of its planner and who answered them.

import { make, mark, reveal, sized, tell, timeText } from './dom.js';
import { isTrouble, until } from './recording.js';
import { theme } from './theme.js';

const LIST_STEP = 200;
const INTERVALS = 60;
/** How many seconds the current throughput is of. */
const RECENT_S = 60;

const BY = { planner: 'planner', 'fail-policy': 'fail policy', nobody: 'nobody' };

/** Calls as bars of different height, so that colour is not all that tells them apart. */
const TALL = { planner: 0.3, 'fail-policy': 0.65, nobody: 1 };

/** `nodes` are the lists of figures of the fleet and of the agent, canvases of throughput and calls, the list of calls,
 * the box for those with trouble, and the button for more. */
export class Work {
  #rows = [];
  #listed = LIST_STEP;
  /** Pictures of the whole run, drawn once; the time is laid over them. */
  #whole = new Map();

  constructor(scene, nodes, say) {
    Object.assign(this, { scene, nodes, say, shown: timeText(scene.recording.end_s) });
    nodes.more.addEventListener('click', () => {
      this.#listed += LIST_STEP;
      this.list();
    });
    nodes.failed.addEventListener('change', () => this.list());
    this.list();
  }

  /** What the fleet and the selected agent are at. */
  tell() {
    const { scene: { recording, recording: { work, troubles, end_s: end }, selected, now }, nodes, shown } = this;
    const reached = until(work.reached, now);
    const since = Math.max(0, now - RECENT_S);
    const recent = reached - (since > 0 ? until(work.reached, since) : 0);
    const perSecond = (goals, time) => time > 0 ? `${(goals / time).toFixed(2)} per second` : '–';
    const asked = until(work.calls, now, (call) => call.asked);
    const last = work.calls[asked - 1];
    const isOpen = last && (last.answered === null || last.answered > now + 1e-9);
    tell(nodes.figures, [
      ['goals', `${reached}, ${perSecond(reached, now)}`],
      [`last ${Math.round(now - since) || RECENT_S} s`, perSecond(recent, now - since)],
      ['calls', `${asked}, ${until(troubles, now, (call) => call.asked)} with trouble`],
      ['planning', isOpen ? `call ${last.number}, since ${shown(last.asked)}` : 'no'],
    ]);
    this.#drawOverTime(nodes.throughput, (c, w, h, fine) => this.#drawThroughput(c, w, h, fine));
    this.#drawOverTime(nodes.calls, (c, w, h, fine) => this.#drawCalls(c, w, h, fine));
    for (const [call, button] of this.#rows) {
      const on = call.asked <= now + 1e-9 && now < (call.answered ?? end) - 1e-9;
      if (mark(button, on) && on) reveal(button);
    }
    if (selected < 0) return;
    const own = work.goals[selected] ?? [], goal = recording.goalAt(selected, now), task = goal?.task;
    tell(nodes.job, [
      ['goal', goal ? `row ${goal.row}, column ${goal.col}, since ${shown(goal.from)}` : 'none'],
      ...(task ? [['task', `${task[0]}, goal ${task[1] + 1} of ${task[2]}`]] : []),
      ['reached', `${until(own.filter(({ to }) => to !== null), now, ({ to }) => to)} goals`],
    ]);
  }

  #drawOverTime(canvas, draw) {
    const [c, w, h] = sized(canvas), fine = w / Math.max(canvas.clientWidth, 1);
    const { now, recording: { end_s: end } } = this.scene, key = `${w} ${h} ${theme.ink}`;
    let whole = this.#whole.get(canvas);
    if (whole?.key !== key) {
      whole = { key, picture: make('canvas', { width: Math.max(w, 1), height: Math.max(h, 1) }) };
      draw(whole.picture.getContext('2d'), w, h, fine);
      this.#whole.set(canvas, whole);
    }
    c.clearRect(0, 0, w, h);
    c.drawImage(whole.picture, 0, 0);
    c.fillStyle = theme.ink;
    c.fillRect((end ? now / end : 0) * w - fine, 0, 2 * fine, h);
  }

  /** Goals per second in equal intervals, and their mean. */
  #drawThroughput(c, w, h, fine) {
    const { work: { reached }, end_s: end } = this.scene.recording;
    const width = end / INTERVALS;
    const rates = Array.from({ length: end > 0 ? INTERVALS : 0 }, (_, at) =>
      (until(reached, (at + 1) * width) - (at ? until(reached, at * width) : 0)) / width);
    const most = Math.max(...rates, 1e-9), mean = end > 0 ? reached.length / end : 0;
    const top = 13 * fine, high = (rate) => rate / most * (h - top);
    c.fillStyle = theme.moving;
    rates.forEach((rate, at) => {
      const from = Math.round(at * w / INTERVALS), to = Math.round((at + 1) * w / INTERVALS);
      c.fillRect(from, h - high(rate), Math.max(to - from - fine, 1), high(rate));
    });
    c.setLineDash([4 * fine, 3 * fine]);
    c.strokeStyle = theme.ink;
    c.lineWidth = fine;
    c.beginPath();
    c.moveTo(0, h - high(mean));
    c.lineTo(w, h - high(mean));
    c.stroke();
    c.font = `${11 * fine}px system-ui, sans-serif`;
    c.textBaseline = 'top';
    c.fillStyle = theme.soft;
    c.fillText(`${most.toFixed(2)} at most, ${mean.toFixed(2)} on average`, 0, 0);
    this.nodes.throughput.setAttribute('aria-label', `Goals per second over time: ${mean.toFixed(2)} on average, ${most.toFixed(2)} at most`);
  }

  /** Those with trouble over the others. */
  #drawCalls(c, w, h, fine) {
    const { work: { calls }, end_s: end } = this.scene.recording;
    for (const by of Object.keys(TALL)) {
      c.fillStyle = theme[by];
      for (const call of calls) {
        if (call.by !== by) continue;
        const from = end ? call.asked / end * w : 0, to = end ? call.answered / end * w : 0;
        c.fillRect(from, h - TALL[by] * h, Math.max(to - from - fine, 1.5 * fine), TALL[by] * h);
      }
    }
    const of = (by) => calls.filter((call) => call.by === by).length;
    this.nodes.calls.setAttribute('aria-label', `${calls.length} calls over time: ` +
      Object.keys(TALL).map((by) => `${of(by)} answered by ${BY[by]}`).join(', '));
  }

  /** Lists the calls, those with trouble if only they are wanted. */
  list() {
    const { scene: { recording: { work, troubles } }, nodes, shown } = this;
    const wanted = nodes.failed.checked ? troubles : work.calls;
    this.#rows = wanted.slice(0, this.#listed).map((call) => {
      const took = [call.planner, call.fail].map((ms) => ms === null ? '' : `${+ms.toPrecision(3)} ms`);
      const who = `${isTrouble(call) ? '✕ ' : ''}${call.by === null ? 'not answered' : BY[call.by]}`;
      const button = make('button', { type: 'button' },
        make('span', {}, shown(call.asked)),
        make('span', {}, make('span', { className: 'swatch ' + (call.by ?? 'waiting') }), who),
        make('small', {}, took.filter((text) => text).join(' + ')),
        ...call.said.map(({ name, module, message }) => make('span', { className: 'said' }, `${name} (${module}): ${message}`)));
      button.title = `call ${call.number}` + (call.answered === null ? '' : `, answered at ${shown(call.answered)}`);
      button.addEventListener('click', () => this.jump(call));
      return [call, button];
    });
    nodes.list.replaceChildren(...this.#rows.map(([, button]) => make('li', {}, button)));
    if (!wanted.length) nodes.list.append(make('li', { className: 'none' }, 'None.'));
    nodes.more.hidden = wanted.length <= this.#listed;
    this.scene.stage.invalidate();
  }

  /** Goes to a call. */
  jump(call) {
    const { clock } = this.scene;
    clock.play(false);
    clock.seek(call.asked);
    this.say(`call ${call.number} at ${this.shown(call.asked)}, answered by ${call.by === null ? 'nobody yet' : BY[call.by]}`);
  }

  /** Goes to the next call with trouble, or with -1 to the one before. */
  nextTrouble(step) {
    const { now, recording: { troubles } } = this.scene;
    const later = step > 0
      ? troubles.find((call) => call.asked > now + 1e-6)
      : troubles.findLast((call) => call.asked < now - 1e-6);
    if (later) this.jump(later);
  }
}

// The lists of a planner's annotations: layers with switches, and what is said now.

import { make } from './dom.js';

/** Texts that are listed at once. */
const TOLD = 100;

/** `nodes` are the list of layers and the list of texts. */
export class AnnotationList {
  #counts = [];
  #told = [];

  constructor(scene, nodes) {
    Object.assign(this, { scene, nodes });
    const { layers, meta } = scene.recording;
    nodes.layers.replaceChildren(...layers.map((layer) => {
      const box = make('input', { type: 'checkbox', checked: layer.shown }), swatch = make('i'), count = make('small');
      swatch.style.background = layer.color;
      const label = make('label', {}, box, swatch, layer.name, count);
      if (layer.range) {
        const scale = make('i', { className: 'scale' });
        scale.style.background = `linear-gradient(to right, ${meta.heat.slice(2).join(',')})`;
        const [least, most] = layer.range.map((value) => make('small', {}, +value.toPrecision(4)));
        label.append(least, scale, most);
      }
      box.addEventListener('change', () => {
        layer.shown = box.checked;
        scene.stage.invalidate();
      });
      this.#counts.push(count);
      return make('li', {}, label);
    }));
  }

  /** Brings both lists up to date. */
  tell() {
    const { scene, scene: { recording } } = this, wanted = [];
    recording.layers.forEach((layer, number) => {
      const current = layer.annotations.filter((annotation) => scene.holds(annotation));
      const text = `${current.length} of ${layer.annotations.length}`, count = this.#counts[number];
      if (count.textContent !== text) count.textContent = text;
      if (layer.shown) for (const annotation of current) if (annotation.text && wanted.length < TOLD) wanted.push([layer, annotation]);
    });
    if (wanted.length === this.#told.length && wanted.every(([, a], at) => a === this.#told[at][1])) return;
    this.#told = wanted;
    this.nodes.texts.replaceChildren(...wanted.map(([layer, { agent, text }]) => {
      const i = recording.indexOf.get(agent) ?? -1;
      const button = make('button', { type: 'button', disabled: i < 0 },
        make('span', {}, agent === null ? '' : `agent ${agent}`), make('span', {}, text), make('small', {}, layer.name));
      button.addEventListener('click', () => scene.select(i, true));
      return make('li', {}, button);
    }));
  }
}

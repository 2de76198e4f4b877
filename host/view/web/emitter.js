// What can be listened to.

export class Emitter {
  #listeners = new Map();

  /** Calls `hear` whenever `name` happens; returns a function that ends it. */
  on(name, hear) {
    const all = this.#listeners.get(name) ?? new Set();
    this.#listeners.set(name, all.add(hear));
    return () => all.delete(hear);
  }

  /** Tells all who listen. */
  emit(name, ...what) {
    for (const hear of this.#listeners.get(name) ?? []) hear(...what);
  }
}

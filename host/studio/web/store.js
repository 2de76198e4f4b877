// The document as this page shows it: what the server has, and the edits on their way to it on top, so that an
// edit is on the screen at once. An edit that is refused, or that meets another page's, is taken back.

import { api, onDone, Refusal } from './api.js';
import { apply } from './edits.js';

const EMPTY = {
  name: '', ground: { world: { bounds_m: [0, 0, 10, 6], obstacles: [], movers: [] } }, robots: {}, agents: [],
  seed: 1, views: {},
};

export class Store {
  constructor() {
    Object.assign(this, {
      version: -1, digest: '', server: EMPTY, problems: [], undoable: false, redoable: false,
      pending: [], draft: null, busy: false, listeners: [], shown: EMPTY, refusal: null, file: null, unsaved: false,
    });
    onDone(() => this.fine());
  }

  /** Calls a listener after each change, with what changed: `document`, `draft` or `refusal`. */
  on(listener) { this.listeners.push(listener); }
  tell(what) { for (const listener of this.listeners) listener(what); }

  /** The document to draw. */
  get document() { return this.shown; }
  get world() { return this.shown.ground.world ?? null; }
  get map() { return this.shown.ground.map ?? null; }
  get agents() { return this.shown.agents; }

  async load() { this.take(await api.document()); }

  take(answer) {
    if (answer.version === this.version && !this.pending.length && answer.digest === this.digest && answer.unsaved === this.unsaved) return;
    Object.assign(this, {
      version: answer.version, digest: answer.digest ?? '', server: answer.document, problems: answer.problems ?? [],
      undoable: Boolean(answer.undo), redoable: Boolean(answer.redo), undoes: answer.undo, redoes: answer.redo,
      file: answer.file ?? null, unsaved: Boolean(answer.unsaved),
    });
    this.recount('document');
  }

  recount(what) {
    this.shown = this.pending.reduce((document, { op }) => apply(document, op), this.server);
    if (this.draft) this.shown = apply(this.shown, this.draft);
    this.tell(what);
  }

  /** Shows an edit that is still being made with the pointer; null shows none. */
  try(op) {
    this.draft = op;
    this.recount('draft');
  }

  /** Makes an edit. True once the server has it; false if it was refused. */
  edit(op) {
    this.draft = null;
    return new Promise((done) => {
      this.pending.push({ op, ask: (version) => api.edit(version, op), done });
      this.recount('document');
      this.flush();
    });
  }

  step(which) {
    return new Promise((done) => {
      this.pending.push({ op: { op: which }, ask: (version) => api[which](version), done });
      this.flush();
    });
  }
  undo() { return this.step('undo'); }
  redo() { return this.step('redo'); }

  async flush() {
    if (this.busy) return;
    this.busy = true;
    while (this.pending.length) {
      const next = this.pending[0];
      try {
        const answer = await next.ask(this.version);
        this.pending.shift();
        this.take(answer);
        next.done(true);
      } catch (error) {
        if (!(error instanceof Refusal)) throw error;
        // What came after it was meant for a document that there is not.
        const lost = this.pending.splice(0);
        if (error.status === 409) {
          error = new Refusal(409, { error: 'the document was changed elsewhere', hint: 'this page shows the newer one: do it again if it still fits' });
          try { this.take(await api.document()); } catch { /* told below */ }
        }
        this.refuse(error);
        for (const { done } of lost) done(false);
        this.recount('document');
      }
    }
    this.busy = false;
  }

  refuse(error) {
    this.refusal = error;
    this.tell('refusal');
  }

  /** Something was done: what was refused before is history. */
  fine() {
    if (this.refusal) this.refuse(null);
  }
}

// Talks to the server that sent the page; docs/studio-protocol.md has the routes.

import { keyOf } from './door.js';

/** A refusal of the server: an error, the place in the document, a way out. */
export class Refusal extends Error {
  constructor(status, { error, place = null, hint = null, ...rest }) {
    super(error);
    Object.assign(this, { status, place, hint, rest });
  }
}

/** Called after each request that did something. */
let done = () => {};
export const onDone = (listener) => { done = listener; };

async function ask(path, options = {}) {
  let answer;
  const headers = { ...options.headers, Authorization: `Bearer ${keyOf()}` };
  try {
    answer = await fetch('/api' + path, { ...options, headers });
  } catch {
    throw new Refusal(0, { error: 'the studio does not answer', hint: 'is `fleetyard studio` still running?' });
  }
  if (answer.ok) {
    if (options.method && !options.quiet) done();
    return answer;
  }
  const text = await answer.text();
  let said;
  try { said = JSON.parse(text); } catch { said = {}; }
  throw new Refusal(answer.status, { error: text.slice(0, 200) || `answer ${answer.status}`, ...said });
}

const json = async (path, options) => {
  const answer = await ask(path, options);
  return answer.status === 204 ? null : answer.json();
};
const post = (path, body) => json(path, {
  method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body ?? {}),
});

export const api = {
  get: (path) => json(path),
  post,
  document: () => json('/document'),
  edit: (base_version, op) => post('/edit', { base_version, op }),
  undo: (base_version) => post('/undo', { base_version }),
  redo: (base_version) => post('/redo', { base_version }),
  open: (name, bytes) => json('/open?name=' + encodeURIComponent(name), {
    method: 'POST', headers: { 'Content-Type': 'application/octet-stream' }, body: bytes,
  }),
  about: () => json('/studio'),
  /** For one request that can have no header: a socket, a new window. */
  ticket: async () => (await json('/ticket', { method: 'POST', quiet: true })).ticket,
  /** Writes the files of the document: those from which it was opened, or, by a name, new ones. */
  save: (how) => post('/save', how),
  exports: () => json('/exports'),
  /** The files of the document in a form: `{name, text}` each. */
  export: async (as) => (await json(`/export?all=true&as=${encodeURIComponent(as)}`)).files,
  presets: () => json('/presets'),
  artefacts: () => json('/artefacts'),
  grid: () => json('/grid'),
  roadmap: () => json('/roadmap'),
  clearance: (side) => json(`/clearance?side=${side.toPrecision(6)}`),
  planners: () => json('/planners'),
  describe: () => post('/planners'),
  jobs: () => json('/jobs'),
  job: (id) => json(`/jobs/${id}`),
  start: (request) => post('/jobs', request),
  stop: (id) => post(`/jobs/${id}/stop`),
  cancel: (id) => post(`/jobs/${id}/cancel`),
  remove: (id) => json(`/jobs/${id}`, { method: 'DELETE' }),
  /** What is told of a recording; quickly, it lacks contacts, arrivals and the work of a fleet. */
  meta: (id, quick = false) => json(`/recordings/${id}/meta${quick ? '?quick=true' : ''}`),
  recordings: () => json('/recordings'),
  clip: async (id, from, to) => (await ask(`/recordings/${id}/clip?from_s=${from}&to_s=${to}`)).arrayBuffer(),
  waits: (id, from, to) => json(`/recordings/${id}/waits?from_s=${from}&to_s=${to}`),
  /** Goals and waits of the robots of a live fleet. */
  doing: (id) => json(`/jobs/${id}/doing`),
  reservations: (id, from, to) => json(`/jobs/${id}/reservations?from_s=${from}&to_s=${to}`),
  annotations: (id) => json(`/recordings/${id}/annotations`),
};

/** The WebSocket of the page. It comes back by itself, more and more slowly. */
export class Feed {
  constructor({ text, clip, state }) {
    Object.assign(this, { text, clip, state, wait: 250, watching: null, socket: null, over: false });
    this.connect();
  }

  again() {
    this.state(false);
    if (this.over) return;
    setTimeout(() => this.connect(), this.wait);
    this.wait = Math.min(this.wait * 2, 8000);
  }

  async connect() {
    let ticket;
    try { ticket = await api.ticket(); } catch { return void this.again(); }
    const socket = new WebSocket(`ws://${location.host}/api/feed?ticket=${ticket}`);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.wait = 250;
      this.state(true);
      if (this.watching) this.send(this.watching);
    };
    socket.onmessage = ({ data }) => {
      if (typeof data !== 'string') {
        this.clip(new DataView(data).getUint32(0, true), data.slice(4));
        return;
      }
      const message = JSON.parse(data);
      if (message.type === 'goodbye') this.over = true;
      this.text(message);
    };
    socket.onclose = () => this.again();
    this.socket = socket;
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** Clips of one live fleet, or of none. */
  watch(job, rate = 20) {
    if (this.watching) this.send({ type: 'unwatch', job: this.watching.job });
    this.watching = job === null ? null : { type: 'watch', job, rate };
    if (this.watching) this.send(this.watching);
  }

  control(job, what) {
    this.send({ type: 'control', job, do: what });
  }
}

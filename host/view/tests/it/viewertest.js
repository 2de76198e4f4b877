// Works the modules of the viewer.
const { bytesOf, Bodies, Cells, Clips, Clock, Fleet, Recording, Scene, Stage, decode } = viewer;
const throws = (act) => {
  try { act(); return false; } catch (error) { return error instanceof RangeError; }
};

// ---- Clips
const bytes = bytesOf($('clip').textContent);
const clip = decode(bytes.buffer);
check('a clip is read', clip.bodies === 3 && clip.samples === 12 && near(clip.first_s, 0.1) && near(clip.length_m, 0.001), clip);
check('its poses', Array.from(clip.x.slice(0, 3)).join() === '1100,2500,-1073741824' && clip.y[3 * 11 + 1] === -10000, [...clip.x, ...clip.y]);
const turned = (sample) => clip.h[3 * sample + 1] * clip.angle_rad;
check('headings are not wrapped', near(turned(11) - turned(0), 7 * 1.1, 0.01), turned(11) - turned(0));
const cut = Array.from({ length: bytes.length }, (_, length) => throws(() => decode(bytes.slice(0, length).buffer)));
check('cut clips are refused', cut.every(Boolean), cut.indexOf(false));
const longer = new Uint8Array(bytes.length + 1);
longer.set(bytes);
check('more than a clip is refused', throws(() => decode(longer.buffer)));
const changed = (at, value) => {
  const other = bytes.slice();
  new DataView(other.buffer).setUint32(at, value, true);
  return throws(() => decode(other.buffer));
};
check('hostile headers are refused', [[0, 1], [4, 4e9], [8, 4e9], [12, 7], [28, 0xffffffff]].every(([at, value]) => changed(at, value)));

/** A clip of two bodies whose x is the time in tenths. */
const window = (from, to) => {
  const samples = to - from + 1, x = new Int32Array(2 * samples), y = new Int32Array(2 * samples);
  for (let sample = 0; sample < samples; sample++) x.fill(from + sample, 2 * sample, 2 * sample + 2);
  return { first_s: from / 10, sample_s: 0.1, length_m: 0.1, angle_rad: 1, bodies: 2, samples, x, y, h: null };
};
const [X, Y, H] = [0, 1, 2].map(() => new Float64Array(2));
const clips = new Clips({ bodies: 2, end_s: 10, window_s: 2, most_bytes: 16 * 21 * 3 });
check('nothing is known at first', !clips.place(0, X, Y, H));
check('the window around the time is wanted', JSON.stringify(clips.wanted(4.5)) === '{"from_s":4,"to_s":6}', clips.wanted(4.5));
clips.add(window(40, 60));
check('a clip places', clips.place(5.25, X, Y, H) && near(X[1], 5.25), X[1]);
check('then the next one is wanted', clips.wanted(4.5).from_s === 6, clips.wanted(4.5));
clips.add(window(0, 20));
clips.add(window(60, 80));
check('nothing else is wanted', clips.wanted(4.5) === null, clips.wanted(4.5));
check('clips arrive in any order', clips.place(7.95, X, Y, H) && near(X[0], 7.95) && clips.place(0.05, X, Y, H) && near(X[0], 0.05));
check('gaps stay gaps', !clips.place(3, X, Y, H) && near(X[0], 0.05));
const trail = [];
clips.place(6.25, X, Y, H);
clips.trail(0, 5.5, (x) => trail.push(x));
check('a trail goes through clips', near(trail[0], 6.2) && near(trail.at(-1), 5.4), trail);
clips.place(7, X, Y, H);
clips.add(window(80, 100));
check('what was used last stays', JSON.stringify(clips.kept.map(([from]) => from)) === '[0,6,8]' || JSON.stringify(clips.kept.map(([from]) => from)) === '[4,6,8]', clips.kept);
check('it ends', clips.place(10, X, Y, H) && near(X[0], 10));
check('others are refused', throws(() => clips.add({ ...window(0, 1), bodies: 3 })));
const asked = [];
const served = new Clips({ bodies: 2, end_s: 10, window_s: 2, load: async (from_s, to_s) => {
  asked.push(from_s);
  return window(Math.round(10 * from_s), Math.round(10 * to_s));
} });
for (let at = 0; at < 10; at += 0.5) {
  served.keep(at);
  await new Promise((done) => setTimeout(done));
}
check('windows are loaded once', asked.join() === '0,2,4,6,8', asked);

// ---- Fleet
let seed = 7;
const random = () => (seed = (seed * 1103515245 + 12345) % 2147483648) / 2147483648;
const outlines = [{ r: 0.4 }, { v: [0.5, 0, -0.4, 0.35, -0.4, -0.35] }, { v: [-0.5, -0.25, 0.5, -0.25, 0.5, 0.25, -0.5, 0.25] }];
const crowd = (agents, side, bodies = agents) => {
  const fleet = new Fleet({ outlines, kinds: Array.from({ length: bodies }, (_, i) => i % 3), agents, bodies, headings: true });
  const across = Math.ceil(Math.sqrt(bodies));
  for (let i = 0; i < bodies; i++) {
    fleet.X[i] = (i % across + 0.3 + 0.4 * random()) * side;
    fleet.Y[i] = (Math.floor(i / across) + 0.3 + 0.4 * random()) * side;
    fleet.H[i] = 7 * random();
  }
  fleet.moved();
  return fleet;
};
const people = crowd(500, 1.2);
const slowly = (x, y, slack) => {
  let best = -1, least = Infinity;
  for (let i = 0; i < people.agents; i++) {
    const d = Math.hypot(people.X[i] - x, people.Y[i] - y);
    if (d <= Math.max(people.reach(i), slack) && d < least) [best, least] = [i, d];
  }
  return best;
};
let wrong = 0;
for (let n = 0; n < 2000; n++) {
  const [x, y, slack] = [30 * random() - 1, 30 * random() - 1, 2 * random()];
  if (people.at(x, y, slack) !== slowly(x, y, slack)) wrong++;
}
check('buckets find who is nearest', wrong === 0, wrong);

// ---- Bodies with and without WebGL
const stage = new Stage($('stage'));
const palette = () => ['#0072b2', '#e69f00', '#009e73', '#cc79a7', '#56b4e9'];
const pixels = () => {
  const whole = stage.picture();
  return whole.getContext('2d').getImageData(0, 0, whole.width, whole.height).data;
};
/** Shares of pixels that are drawn on, and that differ by more than can be seen; browsers smooth edges in ways of their own. */
const compare = (fleet, bounds) => {
  const shown = ['webgl2', '2d'].map((renderer) => {
    const bodies = new Bodies(stage, fleet, { palette, renderer });
    for (let i = 0; i < fleet.bodies; i++) bodies.colors[i] = i % 5;
    stage.fit(bounds);
    const data = pixels(), by = bodies.drawnBy;
    bodies.end();
    return { data, by };
  });
  const [a, b] = shown.map(({ data }) => data);
  let drawn = 0, other = 0, sum = 0;
  for (let at = 0; at < a.length; at += 4) {
    const apart = Math.abs(a[at] - b[at]) + Math.abs(a[at + 1] - b[at + 1]) + Math.abs(a[at + 2] - b[at + 2]);
    if (a[at] !== a[0] || a[at + 1] !== a[1]) drawn++;
    if (apart > 150) other++;
    sum += apart;
  }
  const n = a.length / 4;
  return { by: shown.map(({ by }) => by).join(), drawn: drawn / n, other: other / n, mean: sum / n };
};
const same = ({ by, drawn, other, mean }) => by === 'webgl2,2d' && drawn > 0.02 && other < 0.004 * Math.max(drawn / 0.1, 1) && mean < 18 * drawn;
for (const [name, fleet, bounds] of [
  ['large', crowd(40, 1.5, 45), [0, 0, 10, 8]],
  ['middling', crowd(500, 1.2), [0, 0, 30, 28]],
  ['small', crowd(1200, 1.2), [0, 0, 200, 120]],
  ['many', crowd(6000, 1.2), [0, 0, 110, 95]],
]) {
  const found = compare(fleet, bounds);
  check(`${name} bodies look the same`, same(found), found);
}

const lost = new Bodies(stage, people, { palette, renderer: 'webgl2' });
stage.fit([0, 0, 30, 28]);
const gl = stage.slot.firstChild.getContext('webgl2'), loser = gl.getExtension('WEBGL_lose_context');
const before = pixels();
const soon = async (what) => { for (let left = 100; left && !what(); left--) await new Promise((done) => setTimeout(done, 20)); return what(); };
loser.loseContext();
check('a lost context is replaced', await soon(() => lost.drawnBy === '2d'), lost.drawnBy);
const apart = (a, b) => a.reduce((sum, value, at) => sum + Math.abs(value - b[at]), 0) / a.length;
check('nothing is lost with it', apart(before, pixels()) < 1, apart(before, pixels()));
loser.restoreContext();
check('and comes back', await soon(() => lost.drawnBy === 'webgl2') && apart(before, pixels()) < 0.01, [lost.drawnBy, apart(before, pixels())]);
lost.end();
check('nothing stays', stage.slot.children.length === 0 && stage.layers.length === 0);

// ---- Cells
const field = new Cells({ name: 'field', rows: 2, cols: 3, side: 1, colors: () => [null, '#ff0000', '#00ff00', '#0000ff'], plane: 'scene' });
field.runs([0, 1, 4, 2], 1);
field.fill([0, 2, 1, 1], 3);
stage.add(field);
stage.fit([0, 0, 3, 2]);
const colorAt = (x, y) => {
  const pen = stage.picture().getContext('2d');
  return [...pen.getImageData(stage.toX(x) * stage.dpr, stage.toY(y) * stage.dpr, 1, 1).data].slice(0, 3).join();
};
check('cells have their places', colorAt(0.5, 1.5) === '255,0,0' && colorAt(1.5, 0.5) === '255,0,0' && colorAt(2.9, 0.1) === '255,0,0' && colorAt(2.5, 1.02) === '0,0,255',
  [colorAt(0.5, 1.5), colorAt(1.5, 0.5), colorAt(2.9, 0.1), colorAt(2.5, 1.02)]);
field.scale([0, 1, 2, 3, 4, 5], 3);
check('cells have a scale', field.values.join() === '0,1,2,2,3,3', field.values.join());
stage.remove(field);

// ---- A scene of clips
const clock = new Clock(0.6), recording = new Recording(JSON.parse($('meta').textContent));
const arriving = new Clips({ bodies: 3, end_s: 0.6 });
const scene = new Scene(stage, recording, arriving, clock);
clock.seek(0.35);
stage.draw();
check('a scene waits', !scene.known);
arriving.add(clip);
stage.draw();
check('a scene is placed', scene.known && near(scene.fleet.X[0], 1.35, 0.002), scene.fleet.X[0]);
scene.color('state');
stage.draw();
check('its states', scene.bodies.colors[0] === 0 && scene.bodies.colors[1] === 0, [...scene.bodies.colors]);
scene.end();
stage.end();

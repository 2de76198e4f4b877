// Looks at the replay of a fleet.
/** Whether the scene has a line of a colour around a point of the map, in metres. */
const seen = (x, y, [r, g, b]) => {
  const { state } = replay, dpr = window.devicePixelRatio || 1;
  const px = (x - state.x) * state.scale + $('scene').clientWidth / 2;
  const py = (state.y - y) * state.scale + $('scene').clientHeight / 2;
  const size = Math.round(0.5 * state.scale * dpr);
  const { data } = $('scene').getContext('2d')
    .getImageData(px * dpr - size / 2, py * dpr - size / 2, size, size);
  for (let at = 0; at < data.length; at += 4) {
    if (data[at + 3] > 200 && Math.hypot(data[at] - r, data[at + 1] - g, data[at + 2] - b) < 30) return true;
  }
  return false;
};
const [BLUE, ORANGE] = [[0, 114, 178], [230, 159, 0]];
const at = async (time) => { replay.seek(time); replay.draw(); await frames(2); };
await frames(3);
check('there is work', !$('work-box').hidden && $('brief').textContent.includes('1 goal,'), $('brief').textContent);
check('stations are told', !$('endpoints').hidden && !$('workstations').hidden && !$('stations').hidden);
check('goals are on', $('show-goals').checked && !$('show-goals').parentNode.hidden);

await at(2);
check('a goal is drawn', seen(4.5, 1.5, BLUE) && !seen(0.5, 1.5, BLUE));
check('who has no goal has none', !seen(0.5, 0.5, ORANGE));
check('nothing is reached', $('work').textContent.includes('goals0, 0.00 per second'), $('work').textContent);
await at(6.5);
check('the next goal is drawn', seen(0.5, 1.5, BLUE) && seen(0.5, 0.5, ORANGE));
check('goals are counted', $('work').textContent.includes('goals1, 0.15 per second'), $('work').textContent);
check('planning is told', $('work').textContent.includes('calls3, 1 with trouble') &&
  $('work').textContent.includes('planningcall 2, since 6.0 s'), $('work').textContent);
$('show-goals').click();
await at(6.5);
check('goals can be hidden', !seen(0.5, 0.5, ORANGE));

replay.follow(0);
await at(6.5);
const job = () => $('job').textContent;
check('goal and task', job() === 'goalrow 0, column 0, since 5.0 stask17, goal 2 of 2reached1 goals', job());
replay.follow(1);
await at(2);
check('no goal', job() === 'goalnonereached0 goals', job());

const rows = () => [...document.querySelectorAll('#calls button')];
const texts = () => rows().map((row) => row.textContent);
check('calls are listed', rows().length === 4 && texts()[0] === '0.0 splanner12.3 ms' &&
  texts()[2].startsWith('6.0 s✕ fail policy1000 ms + 2.5 msplanner-fault (') && texts()[3] === '9.0 snot answered', texts());
check('names are text', !document.querySelector('#calls b') && !globalThis.hacked);
$('failed').click();
check('only those with trouble', rows().length === 1, texts());
rows()[0].click();
await frames(2);
check('a call jumps', near(replay.state.now, 6) && rows()[0].getAttribute('aria-current') === 'true', replay.state);
key('Home');
key('c');
check('next call with trouble', near(replay.state.now, 6), replay.state.now);

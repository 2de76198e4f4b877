// Works the replay.
const pointer = (type, id, x, y, kind = 'mouse') => {
  const box = $('scene').getBoundingClientRect();
  $('scene').dispatchEvent(new PointerEvent(type, {
    pointerId: id, pointerType: kind, clientX: box.left + x, clientY: box.top + y, bubbles: true, button: type === 'pointermove' ? -1 : 0,
  }));
};
await frames(3);
check('begins', !replay.state.playing && replay.state.now === 0, replay.state);

// Agent 0 goes 1 m per second along x from 1.5; agent 1 turns a quarter per second.
replay.seek(4.25);
check('interpolates', near(replay.pose(0)[0], 5.75, 0.002) && near(replay.pose(0)[1], 2.5, 0.002), replay.pose(0));
check('turns', near(replay.pose(1)[2], 4.25 * Math.PI / 2, 0.004), replay.pose(1));
replay.seek(1e9);
check('ends', near(replay.state.now, 10) && near(replay.pose(0)[0], 11.5, 0.002), [replay.state.now, replay.pose(0)]);
replay.seek(0);

$('play').click();
check('plays', replay.state.playing && $('play').getAttribute('aria-label') === 'Pause');
await frames(5);
const after = replay.state.now;
check('advances', after > 0, after);
key(' ');
check('pauses', !replay.state.playing);
const stopped = replay.state.now;
await frames(3);
check('stands', replay.state.now === stopped, [stopped, replay.state.now]);

$('seek').value = '7.5';
$('seek').dispatchEvent(new Event('input', { bubbles: true }));
await frames(2);
check('seeks', near(replay.state.now, 7.5) && $('clock').textContent.startsWith('7.5'), $('clock').textContent);
key('ArrowLeft');
check('steps', near(replay.state.now, 6.5), replay.state.now);
key('Home');
check('home', replay.state.now === 0);

$('speed').value = '100';
$('speed').dispatchEvent(new Event('change', { bubbles: true }));
check('speed', replay.state.speed === 100);
key('[');
check('slower', replay.state.speed === 50 && $('speed').value === '50');
$('play').click();
for (let left = 300; left > 0 && replay.state.playing; left--) await frames(1);
check('stops at the end', near(replay.state.now, 10) && !replay.state.playing, replay.state);

const before = replay.state.scale;
$('scene').dispatchEvent(new WheelEvent('wheel', { deltaY: -300, clientX: 200, clientY: 200, bubbles: true, cancelable: true }));
check('wheel zooms', replay.state.scale > before * 1.2, [before, replay.state.scale]);
const wheel = replay.state.scale;
pointer('pointerdown', 1, 100, 100, 'touch');
pointer('pointerdown', 2, 200, 100, 'touch');
pointer('pointermove', 2, 260, 100, 'touch');
pointer('pointerup', 1, 100, 100, 'touch');
pointer('pointerup', 2, 260, 100, 'touch');
check('pinch zooms', near(replay.state.scale / wheel, 1.6, 1e-6), replay.state.scale / wheel);
const x = replay.state.x;
pointer('pointerdown', 1, 100, 100);
pointer('pointermove', 1, 130, 100);
pointer('pointerup', 1, 130, 100);
check('drag pans', replay.state.x < x, [x, replay.state.x]);
const y = replay.state.y;
key('ArrowUp', $('scene'));
check('keys pan', replay.state.y > y && near(replay.state.now, 10), [y, replay.state.y]);
$('fit').click();
check('fits', near(replay.state.scale, before), [before, replay.state.scale]);

replay.seek(2);
replay.draw();
const at = replay.onScreen(0);
pointer('pointerdown', 1, ...at);
pointer('pointerup', 1, ...at);
await frames(2);
check('click follows', replay.state.agent === 0 && replay.state.following, replay.state);
check('camera follows', near(replay.state.x, 3.5, 0.01), replay.state.x);
await new Promise((done) => setTimeout(done, 100));
const figures = $('figures').textContent;
check('timeline', /moving10\.0 s \(100 %\)/.test(figures) && /travelled10\.0 m/.test(figures) && /in contact0\.5 s in 2 contacts/.test(figures) && /arrivednever/.test(figures), figures);
check('nearest', /nearest0\.50 m between centres, to agent 2 at 5\.0 s/.test(figures), figures);
check('timeline is drawn', $('timeline').width > 50 && $('timeline').getAttribute('aria-label').startsWith('Agent 0 over time'));
$('pick').value = '1';
$('pick').dispatchEvent(new Event('change', { bubbles: true }));
check('turning', /turning10\.0 s \(100 %\)/.test($('figures').textContent), $('figures').textContent);
$('pick').value = '3';
$('pick').dispatchEvent(new Event('change', { bubbles: true }));
check('waiting', /waiting8\.0 s \(80 %\)/.test($('figures').textContent) && /moving2\.0 s/.test($('figures').textContent), $('figures').textContent);
$('pick').value = '2';
$('pick').dispatchEvent(new Event('change', { bubbles: true }));
check('arrival', /arrivedat 8\.0 s/.test($('figures').textContent), $('figures').textContent);
check('who has arrived waits no more', /waiting8\.0 s \(80 %\)/.test($('figures').textContent) && /parked2\.0 s \(20 %\)/.test($('figures').textContent), $('figures').textContent);
key('Escape');
check('releases', replay.state.agent === null && $('agent-some').hidden);

const rows = [...document.querySelectorAll('#contacts button')];
check('contacts listed', rows.length === 2 && $('contact-count').textContent === '(2)', rows.length);
check('contacts named', rows[0].getAttribute('aria-label') === 'at 4.75 s: agent 0 and agent 2, 0.50 s' &&
  /obstacle/.test(rows[1].textContent), rows.map((row) => row.getAttribute('aria-label')));
rows[0].click();
await frames(2);
check('contact jumps', near(replay.state.now, 4.75) && replay.state.pointed.b === 2, replay.state);
check('contact is current', rows[0].getAttribute('aria-current') === 'true');
check('contact is in view', near(replay.state.x, (6.25 + 6.5) / 2, 0.3), replay.state.x);
key('n');
check('next contact', near(replay.state.now, 10), replay.state.now);
key('p');
check('contact before', near(replay.state.now, 4.75), replay.state.now);

replay.seek(3);
replay.draw();
const layers = [...document.querySelectorAll('#layers li')];
check('layers listed', layers.length === 2 && !$('layers-box').hidden && layers[0].textContent.includes('<b>'), layers.map((row) => row.textContent));
check('layers counted', layers[0].textContent.endsWith('1 of 1') && /tree1 of 21.*3/.test(layers[1].textContent), layers.map((row) => row.textContent));
const told = () => [...document.querySelectorAll('#annotations li')].map((row) => row.textContent);
check('annotations told', told().length === 2 && told()[1].includes('the tree'), told());
layers[1].querySelector('input').click();
await frames(2);
check('a layer is hidden', told().length === 1, told());
replay.seek(4.5);
replay.draw();
check('annotations have their time', told().length === 0 && layers[0].textContent.endsWith('0 of 1'), told());
layers[1].querySelector('input').click();
replay.seek(6);
replay.follow(1);
$('own').click();
replay.draw();
check('annotations of one agent', !$('own-box').hidden && /1 of 2/.test(layers[1].textContent), layers[1].textContent);
$('own').click();
key('Escape');
replay.draw();
check('annotations of all', $('own-box').hidden && /2 of 2/.test(layers[1].textContent), layers[1].textContent);
check('left out is noted', $('notes').textContent.includes('3 annotations of the planner were more than are kept'), $('notes').textContent);
for (const name of ['paths', 'ids', 'trails', 'contacts']) {
  $('show-' + name).click();
  replay.draw();
  $('show-' + name).click();
}
replay.draw();
check('renderer', replay.state.renderer === (location.hash ? 'webgl2' : '2d'), replay.state.renderer);
// Agent 3 is in the middle, and what it does and how long it waited has a colour of its own.
const middle = () => {
  replay.follow(3);
  replay.draw();
  const pen = replay.picture().getContext('2d');
  const [px, py] = replay.onScreen(3).map((at) => (at - 3) * (window.devicePixelRatio || 1));
  return [...pen.getImageData(px, py, 1, 1).data].slice(0, 3).join();
};
const colored = (by, time) => {
  $('color').value = by;
  $('color').dispatchEvent(new Event('change'));
  replay.seek(time);
  return middle();
};
check('colour by agent', colored('agent', 6) === '204,121,167', colored('agent', 6));
check('colour by kind', colored('kind', 6) === '230,159,0', colored('kind', 6));
check('colour by state', colored('state', 6) === '184,188,194' && colored('state', 9) === '0,114,178', [colored('state', 6), colored('state', 9)]);
check('colour by waiting', colored('delay', 0.1) === '255,243,184' && colored('delay', 8) === '217,31,32' && !$('color-delay').hidden, [colored('delay', 0.1), colored('delay', 8)]);
colored('agent', 6);
// Agent 2 stands in a cell all the time, agent 3 in another for the 8 s until it moves.
$('heat').value = 'waiting';
$('heat').dispatchEvent(new Event('change'));
replay.draw();
check('heat map', $('most').textContent === '8.0 s' && !$('heat-scale').hidden, $('most').textContent);
$('heat').value = '';
$('heat').dispatchEvent(new Event('change'));
key('Escape');
replay.draw();
const dot = $('scene').getContext('2d').getImageData(0, 0, $('scene').width, $('scene').height).data;
check('draws', dot.some((value) => value > 0));
check('fleet is drawn', $('fleet').height === 4 && $('fleet').width > 0);
check('names are text', document.title.includes('<b>') && !document.querySelector('h1 *') && !globalThis.hacked);
check('facts', $('facts').textContent.includes('</' + 'script><' + 'script>'), $('facts').textContent);
check('every control has a name', [...document.querySelectorAll('button, input, select, canvas:not([aria-hidden])')]
  .every((node) => node.getAttribute('aria-label') || node.textContent.trim() || node.closest('label')?.textContent.trim()));
